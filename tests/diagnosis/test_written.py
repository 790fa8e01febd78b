"""What a diagnosis writes: the contract's JSON, tables that read back to the last bit, nothing of an earlier one."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from mbexport.core.database import FrozenMap, load_effects, load_motion, with_effects
from mbexport.core.diagnosis.diagnosis import Diagnosis
from mbexport.core.diagnosis.written import check_place, files_of, write_files
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.errors import UsageError


def awkward(diagnosis: Diagnosis) -> Diagnosis:
    """The same with rows of all keys and numbers that need all their digits."""
    sag = {column.name: column.default or 0.0 for column in effect_named("link_inertia").columns}
    play = {"gap": math.pi / 3000, "stiffness": math.inf, "damping": math.inf}
    rows = {
        "payload": (EffectRow(0, FrozenMap({c.name: 0.1 + 0.2 for c in effect_named("payload").columns})),),
        "link_inertia": (EffectRow(2, FrozenMap({**sag, "mass": -1e-17, "mx": 1 / 3})),),
        "backlash": (EffectRow(1, FrozenMap(play)), EffectRow(6, FrozenMap(play))),
    }
    return replace(diagnosis, effects=rows)


def test_tables_read_back_to_the_last_bit(explained, paper_arm, tmp_path):
    found = awkward(explained)
    write_files(tmp_path, files_of(found, "<html>"))
    rows = load_effects(tmp_path / "effects", paper_arm)
    assert dict(rows) == dict(found.effects)
    assert with_effects(paper_arm, rows).effects["backlash"][1].values["gap"] == math.pi / 3000
    assert load_motion(tmp_path / "motions" / "next.dat", paper_arm.joints) == found.next_experiment.motion


def test_the_json_is_that_of_the_contract(explained, tmp_path):
    data = json.loads(files_of(explained, "")["diagnosis.json"])
    assert list(data) == [
        "schema", "robot", "verdict", "where", "which", "rejected", "how_far", "unexplained", "next_experiment", "data",
    ]  # fmt: skip
    (found,) = data["which"]
    assert found["parameters"] == {"torque": {"value": 12.1, "ci95": [11.7, 12.5], "unit": "N*m"}}
    assert [rival["effect"] for rival in found["indistinguishable_from"]] == ["stribeck_friction", "hysteresis"]
    assert data["how_far"]["backends"]["pybullet"] is None and "not installed" in data["how_far"]["refused"]["pybullet"]
    assert data["next_experiment"]["motion"] == "motions/next.dat"


def test_without_findings_there_are_no_tables(no_gap):
    assert set(files_of(no_gap, "")) == {"diagnosis.json", "report.html"}


def test_an_earlier_diagnosis_leaves_nothing(explained, no_gap, tmp_path):
    write_files(tmp_path, files_of(awkward(explained), ""))
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(UsageError, match="--force"):
        write_files(tmp_path, files_of(explained, ""))
    assert (tmp_path / "effects" / "backlash.dat").exists()
    write_files(tmp_path, files_of(explained, ""), force=True)
    assert [path.name for path in (tmp_path / "effects").iterdir()] == ["coulomb_friction.dat"]
    write_files(tmp_path, files_of(no_gap, ""), force=True)
    left = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {"diagnosis.json", "report.html", "mine.txt"}


def test_tables_of_others_are_not_mixed_in(explained, tmp_path):
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "backlash.dat").write_text("mine")
    with pytest.raises(UsageError, match=r"backlash\.dat exists already"):
        check_place(tmp_path, force=False)
    with pytest.raises(UsageError, match=r"backlash\.dat exists already"):
        write_files(tmp_path, files_of(explained, ""))
    assert len(list(tmp_path.rglob("*.*"))) == 1


def test_the_table_has_a_row_a_parameter(explained, no_gap):
    table = explained.frame()
    assert table.iloc[0].to_dict() == {
        "effect": "coulomb_friction",
        "at": "joint_2",
        "probability": 0.98,
        "shrinks_by": 0.93,
        "parameter": "torque",
        "value": 12.1,
        "low": 11.7,
        "high": 12.5,
        "unit": "N*m",
        "indistinguishable_from": "stribeck_friction joint_2, hysteresis joint_2",
    }
    many = awkward(explained)
    assert len(replace(many, which=many.which * 2).frame()) == 2
    empty = no_gap.frame()
    assert len(empty) == 0 and list(empty.columns) == list(table.columns)
