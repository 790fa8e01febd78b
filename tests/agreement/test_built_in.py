"""All engines and the tables' text on every built-in robot: at rest, and in a short run of every kind it has."""

import json

import pytest

from mbexport.core.agreement import agree, reference
from mbexport.core.agreement.quantities import STATICS
from mbexport.core.database import built_in, load
from mbexport.core.errors import UsageError
from mbexport.core.simulation import backend_named


def told(answer):
    lines = [
        f"{f.scenario} {f.signal} {f.voices} {f.value:.1e} gate {f.gate:.1e}" for f in answer.figures if not f.passed
    ]
    return "\n".join([*answer.sentences, *map(str, answer.left_out), *lines])


@pytest.mark.parametrize("robot", built_in())
def test_at_rest(robot):
    answer = agree(robot, quantities=STATICS)
    refused = {omission.voice for omission in answer.left_out if backend_named(omission.voice).runs}
    # published data that no body can have may be refused, by name
    assert not refused or load(robot).inertia_check == "warn", told(answer)
    assert answer.agreed, told(answer)
    assert {voice.name for voice in answer.voices} | refused >= {"tables", "urdf", "mjcf", "exudyn", "pybullet"}


RUNS = ["rigid_motion", "rigid_loop", "compliant_motion", "compliant_loop", "friction_loop", "stick_loop"]


@pytest.mark.parametrize("robot", ["planar2r", "imece2013", "puma560"])
def test_short_runs(robot):
    answer = agree(robot, quantities=RUNS, duration=0.05)
    assert answer.agreed, told(answer)
    assert not [omission for omission in answer.left_out if backend_named(omission.voice).runs]
    assert answer.runs and all(run.steps for run in answer.runs)


def test_the_answer_as_json_is_the_same_each_time():
    first, second = (
        agree("planar2r", ["urdf", "mjcf"], quantities=["gravity", "rigid_loop"], duration=0.05) for _ in "ab"
    )
    data = json.dumps(first.to_json(), allow_nan=False)
    assert data == json.dumps(second.to_json(), allow_nan=False)
    read = json.loads(data)
    assert read["schema"] == "mbexport-agreement/1" and read["agreed"] is True
    assert {tuple(figure["voices"]) for figure in read["figures"]} == {
        ("tables", "urdf"),
        ("tables", "mjcf"),
        ("urdf", "mjcf"),
    }
    assert first.worst()[0].signal == "gravity"


def test_a_database_in_memory_speaks_through_the_text_it_would_be_written_as():
    answer = agree(load("scara"), ["urdf"], quantities=["mass_matrix", "drive_torque"])
    assert answer.agreed and [voice.name for voice in answer.voices] == ["tables", "urdf"]


def test_an_effect_that_the_tables_voice_does_not_know_leaves_it_out_by_name(monkeypatch):
    monkeypatch.setattr(reference, "READ", reference.READ - {"rotor_inertia"})
    answer = agree("planar2r", ["urdf", "mjcf"], quantities=["gravity"])
    assert [(omission.voice, omission.scenario) for omission in answer.left_out] == [("tables", "everything")]
    assert "rotor_inertia" in answer.left_out[0].reason
    assert answer.agreed and [voice.name for voice in answer.voices] == ["urdf", "mjcf"]


def test_rows_of_effects_that_replace_the_database_s_reach_all_voices(tmp_path):
    (tmp_path / "payload.dat").write_text("robot mass x\nrobot 3 0.1\n")
    answer = agree("planar2r", ["urdf", "mjcf"], quantities=["mass_matrix", "gravity"], with_effects=tmp_path)
    assert answer.agreed and "payload" in answer.effects
    bare = agree("planar2r", ["urdf", "mjcf"], quantities=["mass_matrix", "gravity"])
    assert abs(answer.evidence.answers["tables"]["gravity"] - bare.evidence.answers["tables"]["gravity"]).max() > 1.0


@pytest.mark.parametrize("level", ["rigid", "friction"])
def test_rows_of_effects_count_at_any_level_in_all_voices(tmp_path, level):
    """The rigid robot has the one rotor that is given, and not the database's other one."""
    (tmp_path / "payload.dat").write_text("robot mass x\nrobot 3 0.1\n")
    (tmp_path / "rotor_inertia.dat").write_text("joint inertia\n2 0.7\n")
    answer = agree(
        "planar2r", ["urdf", "mjcf"], level, quantities=["mass_matrix", "motor_inertia"], with_effects=tmp_path
    )
    assert answer.agreed and [voice.name for voice in answer.voices] == ["tables", "urdf", "mjcf"]
    assert {"payload", "rotor_inertia"} <= set(answer.effects)


def test_unknown_names_are_named():
    with pytest.raises(UsageError, match="no quantity 'weight'"):
        agree("planar2r", quantities=["weight"])
    with pytest.raises(UsageError, match="no backend 'gazebo'"):
        agree("planar2r", ["gazebo"])
    with pytest.raises(UsageError, match="duration"):
        agree("planar2r", ["urdf"], duration=0.0)


def test_an_engine_that_refuses_by_name_is_left_out_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(type(backend_named("mjcf")), "refusal", lambda self, robot, program: "not today")
    answer = agree("planar2r", ["mjcf", "urdf"], quantities=["gravity"])
    assert answer.agreed and [(o.voice, o.reason) for o in answer.left_out] == [("mjcf", "not today")]


def test_a_format_whose_engine_is_elsewhere_is_left_out_by_name(monkeypatch):
    monkeypatch.setattr(type(backend_named("mjcf")), "runs", False)
    answer = agree("planar2r", ["mjcf", "urdf"], quantities=["gravity"])
    assert answer.agreed and [(o.voice, o.scenario) for o in answer.left_out] == [("mjcf", "everything")]
    assert "emitted only" in answer.left_out[0].reason
    nothing = agree("planar2r", ["mjcf"], quantities=["gravity"])
    assert not nothing.agreed and "Nothing could be compared" in nothing.sentences[0]
