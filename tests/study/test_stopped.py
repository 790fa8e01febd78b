"""A study as it is run: interrupted, killed, gone on with, and the same bytes as if nothing had happened."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mbexport.core.database import load
from mbexport.core.report.study import write_study
from mbexport.core.study import plan_study, results_of, run_study

VARY, OPTIONS = "joint_compliance.stiffness@all=0.5:2", {"level": "compliant", "motion": "hold", "duration": 0.4}
VARIANTS, PATIENCE = 200, 300.0
# what a shell starts in the background ignores interrupts, and so would what it starts
PROGRAM = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from mbexport.core.cli import main
main()
"""
COMMAND = (
    sys.executable, "-c", PROGRAM, "sweep", "planar2r", "--vary", VARY,
    "--level", "compliant", "--motion", "hold", "--duration", "0.4", "--sample", "random", "--count", str(VARIANTS),
    "--workers", "2", "-o",
)  # fmt: skip


def lines(folder: Path) -> int:
    """How many variants are finished."""
    return sum(path.read_bytes().count(b"\n") for path in folder.glob("finished-*.jsonl"))


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def stopped(folder: Path, how: signal.Signals) -> tuple[int, list[int]]:
    """Runs the study until two more variants are finished, and stops it so; its exit status, its processes."""
    before, end = lines(folder), time.monotonic() + PATIENCE
    process = subprocess.Popen([*COMMAND, str(folder)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while lines(folder) < before + 2:
            assert process.poll() is None and time.monotonic() < end
            time.sleep(0.005)
        started = children(process.pid)
        os.kill(process.pid, how)
        return process.wait(PATIENCE), started
    finally:
        process.kill()
        process.wait()


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="the system does not tell a process's children so")
def test_an_interrupted_and_a_killed_study_end_as_if_nothing_had_happened(tmp_path):
    study = plan_study(load("planar2r"), [VARY], sampling="random", count=VARIANTS, **OPTIONS)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    status, _ = stopped(broken, signal.SIGINT)
    kept = lines(broken)
    assert status == 1 and 0 < kept < VARIANTS
    status, started = stopped(broken, signal.SIGKILL)
    assert status == -signal.SIGKILL and kept < lines(broken) < VARIANTS
    # whom it had started does not wait for it forever
    assert len(started) >= 2
    end = time.monotonic() + PATIENCE
    while any(map(alive, started)):
        assert time.monotonic() < end
        time.sleep(0.05)
    for folder in (whole, broken):
        write_study(results_of(study, run_study(study, folder, workers=1)), folder)
    for name in ("study.json", "variants.parquet", "sensitivity.json", "study.png", "report.html"):
        assert (whole / name).read_bytes() == (broken / name).read_bytes(), name
