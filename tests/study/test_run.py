"""Running a study: stopped and gone on with, by one or by many, and the same bytes in the end."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mbexport.core.errors import UsageError
from mbexport.core.report.study import write_study
from mbexport.core.study import results_of, run_study
from mbexport.core.study.experiment import NOMINAL, Experiment, Outcome
from mbexport.core.study.study import Study

DASK = (sys.executable, "-m", "dask")
RESULTS = ("study.json", "variants.parquet", "sensitivity.json", "study.png", "report.html")


def finished(study, folder, **options):
    """Run it; what it found, as files without the pictures, which take their time."""
    return results_of(study, run_study(study, folder, **options)).files()


def awaited(look, seconds=300.0):
    """What `look` gives once it gives something."""
    end = time.monotonic() + seconds
    while not (found := look()):
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.05)
    return found


def fake(monkeypatch, run):
    """Let `run(variant, values)` stand for a simulation."""
    monkeypatch.setattr(Experiment, "run", lambda self, variant, values: run(variant, values))


def made_up(variant, values):
    numbers = values or (1.0, 1.0)
    return Outcome(variant, tuple(float(numbers[0] * (k + 1) + numbers[1]) for k in range(17)))


def test_one_or_several_processes_make_the_same_bytes(small, tmp_path):
    study = small()
    for workers, name in ((1, "alone"), (2, "two")):
        write_study(results_of(study, run_study(study, tmp_path / name, workers=workers)), tmp_path / name)
    for name in RESULTS:
        assert (tmp_path / "two" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes(), name
    table = pd.read_parquet(tmp_path / "two" / "variants.parquet")
    assert len(table) == 9
    assert (table["failed"] == "").all()
    # softer springs, more error
    order = table.sort_values("joint_compliance.stiffness@joint_1", kind="stable")["tip_rms"].to_numpy()
    assert order[:3].mean() > order[3:6].mean() > order[6:].mean()


def test_a_stopped_study_goes_on(small, tmp_path, monkeypatch):
    study, ran = small(), []

    def stopping(variant, values):
        ran.append(variant)
        if len(ran) == 5:
            raise KeyboardInterrupt
        return made_up(variant, values)

    fake(monkeypatch, stopping)
    with pytest.raises(KeyboardInterrupt):
        run_study(study, tmp_path / "stopped", workers=1)
    kept = set(ran[:4])
    (ledger,) = (tmp_path / "stopped").glob("finished-*.jsonl")
    assert {json.loads(line)["variant"] for line in ledger.read_text().splitlines()} == kept
    # a crash in the middle of a line
    with ledger.open("a") as file:
        file.write('{"variant": 7, "figures": [0.1, ')
    ran.clear()
    fake(monkeypatch, lambda variant, values: (ran.append(variant), made_up(variant, values))[1])
    resumed = finished(study, tmp_path / "stopped", workers=1)
    assert set(ran) == {NOMINAL, *range(9)} - kept
    assert resumed == finished(study, tmp_path / "whole", workers=1)
    ran.clear()
    assert finished(study, tmp_path / "stopped", workers=1) == resumed
    assert ran == []


def test_lines_that_are_not_ours_do_not_count(small, tmp_path, monkeypatch):
    study, ran = small(), []
    fake(monkeypatch, lambda variant, values: (ran.append(variant), made_up(variant, values))[1])
    run_study(study, tmp_path, workers=1)
    (ledger,) = tmp_path.glob("finished-*.jsonl")
    lines = ledger.read_text().splitlines()
    spoiled = ['{"variant": 99, "figures": []}', '{"variant": 0, "figures": ["a"]}', "[]", "\x00", '{"variant": "1"}']
    ledger.write_text("\n".join([*spoiled, *lines[3:]]))
    ran.clear()
    run_study(study, tmp_path, workers=1)
    assert len(ran) == 3


def test_a_folder_holds_one_study(small, tmp_path, monkeypatch):
    fake(monkeypatch, made_up)
    study = small()
    before = finished(study, tmp_path, workers=1)
    for other in (
        small(duration=0.02),
        small("joint_compliance.stiffness@joint_1=0.5:2:4"),
        small(motion="excitation"),
    ):
        with pytest.raises(UsageError, match="holds another study"):
            run_study(other, tmp_path, workers=1)
    assert finished(study, tmp_path, workers=1) == before
    other = small(duration=0.02)
    assert finished(other, tmp_path, workers=1, force=True) != before
    assert len(list(tmp_path.glob("finished-*.jsonl"))) == 1


def test_files_of_others_are_not_written_over(small, tmp_path):
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(UsageError, match=r"report\.html exists already"):
        run_study(small(), tmp_path, workers=1)
    (tmp_path / "study.json").write_text("mine")
    with pytest.raises(UsageError, match="is no study of ours"):
        run_study(small(), tmp_path, workers=1)
    assert {path.read_text() for path in tmp_path.iterdir()} == {"mine"}


def test_two_do_not_write_into_one_study(small, tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    study = small()

    def meanwhile(variant, values):
        with pytest.raises(UsageError, match="another process"):
            run_study(study, tmp_path, workers=1)
        return made_up(variant, values)

    fake(monkeypatch, meanwhile)
    run_study(study, tmp_path, workers=1)


def test_failed_variants_are_rows_with_their_reason(small, tmp_path):
    study = small("inertia.Izz[SI]@arm_1=0.06,0.05", "inertia.mass[kg]@arm_2=-1,1")
    outcomes = run_study(study, tmp_path, workers=1)
    results = results_of(study, outcomes)
    table = results.frame()
    assert table["failed"].tolist() == ["refused", "refused", "refused", ""]
    assert table["reason"].str.contains("mass is above zero").tolist() == [False, False, True, False]
    assert np.isnan(table["tip_rms"].to_numpy()[:3]).all()
    assert np.isfinite(table["tip_rms"][3])
    write_study(results, tmp_path)
    assert "no body can have this inertia" in (tmp_path / "report.html").read_text()


def test_wrong_use_ends_a_study_at_once(small, tmp_path, monkeypatch):
    def refuse(variant, values):
        raise UsageError("options do not fit")

    fake(monkeypatch, refuse)
    with pytest.raises(UsageError, match="do not fit"):
        run_study(small(), tmp_path, workers=1)
    for options in ({"workers": 0}, {"workers": 2, "dask": "tcp://nowhere:1"}):
        with pytest.raises(UsageError, match="--workers"):
            run_study(small(), tmp_path, **options)


DEADLY = """
import os
from mbexport.core.study.experiment import Experiment, Outcome

class Deadly(Experiment):
    def run(self, variant, values):
        if variant == 4:
            os._exit(1)
        return Outcome(variant, tuple(float(variant + k) for k in range(17)))
"""


def test_a_variant_that_kills_its_process_is_a_row_too(small, tmp_path, monkeypatch):
    (tmp_path / "deadly_study.py").write_text(DEADLY)
    monkeypatch.syspath_prepend(tmp_path)
    from deadly_study import Deadly

    plain = small()
    shared = {name: getattr(plain.experiment, name) for name in Experiment.__dataclass_fields__}
    study = Study(Deadly(**shared), plain.design)
    outcomes = run_study(study, tmp_path / "out", workers=2)
    assert list(outcomes) == [NOMINAL, *range(9)]
    assert [variant for variant, outcome in outcomes.items() if outcome.failed] == [4]
    assert (outcomes[4].failed, outcomes[4].reason) == ("crashed", "the process that ran it died.")


def test_a_dask_cluster_makes_the_same_bytes(small, tmp_path):
    """Scheduler and worker are processes of their own, as on any cluster; the address is all that is known of them."""
    pytest.importorskip("distributed", reason="distributed is not installed")
    study = small("joint_compliance.stiffness@joint_1=0.5,1")
    here = finished(study, tmp_path / "here", workers=1)
    address, started = "", []
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    try:
        file = tmp_path / "scheduler.json"
        words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        started.append(subprocess.Popen([*DASK, "scheduler", *words], **quiet))
        address = json.loads(awaited(lambda: file.is_file() and file.read_text()))["address"]
        words = ["--nthreads", "2", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path)]
        started.append(subprocess.Popen([*DASK, "worker", address, *words], **quiet))
        import distributed

        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=300)
        assert finished(study, tmp_path / "there", dask=address) == here
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def test_a_cluster_that_is_not_there_is_one_error(small, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("mbexport.core.parallel.ANSWER_TIME", 0.3)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(UsageError, match="no Dask scheduler answers"):
            run_study(small(), tmp_path, dask=address)


def test_results_say_nothing_of_where_they_were_made(small, tmp_path):
    text = "".join(str(small().facts()))
    for word in (str(tmp_path), str(Path.cwd()), sys.executable, str(Path.home())):
        assert word not in text
