"""The numbers hold anywhere: other seeds of hashes, languages, places and times of day change no byte."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ARTEFACTS = Path(__file__).with_name("artefacts.py")


@pytest.fixture(scope="module")
def german(tmp_path_factory) -> dict[str, str] | None:
    """Environment of a language with decimal commas; None where the system cannot make one."""
    folder = tmp_path_factory.mktemp("locales")
    if shutil.which("localedef") is None:
        return None
    done = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")], capture_output=True, check=False
    )
    return {"LOCPATH": str(folder), "LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8"} if done.returncode == 0 else None


def artefacts(folder: Path, environment: dict[str, str]) -> tuple[dict[str, str], str]:
    """Name to digest of everything, and the decimal point of that process."""
    folder.mkdir(parents=True)
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("LC_", "LANG", "PYTHON"))}
    done = subprocess.run(
        [sys.executable, str(ARTEFACTS)],
        cwd=folder,
        env={**kept, **environment},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")[-3000:]
    pairs = [line.split("\t") for line in done.stdout.decode().splitlines()]
    return dict(pairs), done.stderr.decode(errors="replace").rpartition("\t")[2].strip()


def test_two_processes_that_have_little_in_common(tmp_path, german):
    here, point = artefacts(tmp_path / "here", {"PYTHONHASHSEED": "0", "LC_ALL": "C", "TZ": "UTC", "PYTHONUTF8": "0"})
    assert point == "."
    far = tmp_path / "weit weg" / "größer"
    there, point = artefacts(
        far,
        {"PYTHONHASHSEED": "31337", "TZ": "Asia/Tokyo", "COLUMNS": "40", **(german or {"LC_ALL": "C.UTF-8"})},
    )
    assert point == ("," if german else ".")
    assert list(here) == list(there)
    assert {name for name in here if here[name] != there[name]} == set()
    # it is about something
    assert len(here) > 100
    for part in (
        "mjcf", "urdf", "exudyn", "pybullet", ".adm", ".cmd", "simscape", ".fmu", "concepts", "run data.csv",
        "agreement.html", "variants.parquet", "study.png", "study report.html", "diagnosis.json",
        "diagnosis report.html", "problems",
    ):  # fmt: skip
        assert any(part in name for name in here), part


def test_the_seed_of_hashes_is_really_another(tmp_path):
    """The guard itself: what depends on the order of a set differs between the two processes."""
    code = "print(list({'alpha', 'beta', 'gamma', 'delta', 'epsilon', 'zeta'}))"
    orders = {
        subprocess.run(
            [sys.executable, "-c", code], env={"PYTHONHASHSEED": seed}, capture_output=True, check=True
        ).stdout
        for seed in ("0", "31337")
    }
    assert len(orders) == 2
