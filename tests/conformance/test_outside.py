"""The plugins of examples/, each a distribution of its own: installed, found, and tried like anyone else's."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

needs_drake = pytest.mark.skipif(find_spec("pydrake") is None, reason="Drake is not installed")


def mbexport(env, *words: object) -> str:
    code = "from mbexport.core.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)], env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def drake(installed):
    return installed("mbexport-drake")


@pytest.fixture(scope="module")
def thermal(installed):
    return installed("mbexport-thermal-friction")


@needs_drake
def test_drake_passes_the_suite(drake, run_pytest, tmp_path):
    """The part that there is time for; the whole of it by the command in the example's own page."""
    suite = ("--pyargs", "mbexport.core.conformance", "--backend", "drake")
    done = run_pytest(tmp_path, *suite, "-m", "quick", "--duration", "0.3", env=drake)
    assert done.returncode == 0, done.stdout[-5000:]
    assert "41 passed" in done.stdout
    # what it cannot is told, not hidden
    assert "refused by name" in done.stdout
    assert "effect-joint_compliance_6d: joint_1_carrier has no mass, and SDF has no such link" in done.stdout


def test_drake_is_listed_whether_or_not_its_engine_is_there(drake):
    (row,) = [
        row for row in json.loads(mbexport(drake, "list", "backends", "--json"))["backends"] if row["name"] == "drake"
    ]
    assert row["distribution"] == "mbexport-drake 0.1.0"
    if find_spec("pydrake") is None:
        assert "drake" in row["problem"]
    else:
        assert row["engine"] == "Drake"
        assert row["version"]


def test_drake_emits_without_its_engine(drake, tmp_path):
    """SDF is text: whoever has no Drake can still write it."""
    mbexport(drake, "--to", "drake", "imece2013", "-o", tmp_path)
    from xml.etree import ElementTree

    root = ElementTree.parse(tmp_path / "imece2013.sdf").getroot()
    assert [joint.get("name") for joint in root.iter("joint")] == [
        "world_to_base",
        *(f"joint_{i}" for i in range(1, 7)),
    ]
    fates = json.loads((tmp_path / "imece2013.concepts.json").read_text())["concepts"]
    assert {fate["status"] for fate in fates if fate["datum"] == "inertia"} == {"exact"}
    assert {fate["status"] for fate in fates if fate["datum"] == "joint_compliance.stiffness"} == {"impossible"}


def test_an_outside_effect_passes_its_own_tests(thermal, run_pytest):
    done = run_pytest(Path(thermal["SOURCE"]), "tests", env=thermal)
    assert done.returncode == 0, done.stdout[-5000:]
    assert "9 passed" in done.stdout


def test_an_outside_effect_is_listed(thermal):
    rows = json.loads(mbexport(thermal, "list", "effects", "--json"))["effects"]
    (row,) = [row for row in rows if row["name"] == "thermal_friction"]
    assert row["distribution"] == "mbexport-thermal-friction 0.1.0"
    assert "softening[K]" in row["columns"]


def test_outside_effects_of_two_joints_pass_their_own_tests(installed, run_pytest):
    """In one engine; the others by pytest in the example's own folder."""
    wrist = installed("mbexport-coupled-wrist")
    done = run_pytest(Path(wrist["SOURCE"]), "tests", "-k", "not urdf and not exudyn and not pybullet", env=wrist)
    assert done.returncode == 0, done.stdout[-5000:]
    assert "5 passed" in done.stdout
