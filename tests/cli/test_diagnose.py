"""mbexport diagnose: a folder of answers from recorded runs, a corrected model from it, one message for wrong use."""

from __future__ import annotations

import json
import re

CONTROL = """\
control: {mode: pd, kp: [60.0], kd: [8.0], feedforward: none, rate: 1000.0}
noise: {q: 1.0e-5, tau: 0.01}
"""


def test_a_diagnosis_is_written_and_its_effects_go_into_the_next_model(mbexport, content, tmp_path):
    control, effects, runs, out = (tmp_path / name for name in ("control.yaml", "hidden", "runs", "out"))
    control.write_text(CONTROL)
    effects.mkdir()
    (effects / "viscous_friction.dat").write_text("joint coefficient[N*m*s/rad]\n1 0.5\n")
    # made by another engine than the one that judges
    plant = ("simulate", "pendulum", "--backend", "urdf", "--with-effects", effects, "--with", "viscous_friction")
    for seconds in ("3", "4"):
        words = ("--motion", "excitation", "--duration", seconds, "--control", control, "--noise", "--seed", seconds)
        done = mbexport(*plant, *words, "-o", runs / f"run-{seconds}")
        assert done.status == 0, done.err
    words = ("diagnose", "pendulum", runs, "--level", "rigid", "--backends", "mjcf", "-o", out)
    answer = mbexport(*words, "--json")
    assert answer.status == 0, answer.err
    said = answer.json()
    assert said == json.loads((out / "diagnosis.json").read_text())
    assert said["schema"] == "mbexport-diagnosis/1"
    assert [(one["effect"], one["at"]) for one in said["which"]] == [("viscous_friction", "joint_1")]
    assert said["data"]["runs"] == ["run-3", "run-4"]
    assert re.match(r"<!doctype html>", (out / "report.html").read_text(), re.IGNORECASE)
    model = mbexport(
        "--to", "mjcf", "pendulum", "--level", "rigid", "--with-effects", out / "effects", "-o", tmp_path / "m"
    )
    assert model.status == 0, model.err
    before = content(out)
    again = mbexport(*words)
    assert again.status == 2
    assert content(out) == before


def test_bad_input_is_one_message(mbexport, tmp_path):
    (tmp_path / "run").mkdir()
    answer = mbexport("diagnose", "pendulum", tmp_path / "run", "-o", tmp_path / "out")
    assert answer.status == 2
    assert "holds no run" in answer.err
    assert not (tmp_path / "out").exists()
