"""mbexport agree: the answer as an exit status, a page and JSON."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from mbexport.backends.urdf import UrdfBackend

QUICK = ("--backends", "mjcf,urdf", "--only", "tool_position,mass_matrix,gravity,rigid_loop", "--duration", "0.2")


def test_agreement_exits_0(mbexport, content, tmp_path):
    answer = mbexport("agree", "planar2r", *QUICK, "--level", "rigid", "-o", tmp_path / "report")
    assert answer.status == 0, answer.out
    assert "All 2 engines and the text of its tables agree on planar2r at level rigid" in answer.out
    files = content(tmp_path / "report")
    assert set(files) == {"agreement.json", "agreement.html"}
    data = json.loads(files["agreement.json"])
    assert data["agreed"] is True
    assert {voice["name"] for voice in data["voices"]} == {"tables", "mjcf", "urdf"}
    assert {figure["signal"] for figure in data["figures"]} >= {"mass_matrix", "rigid_loop_tip"}
    page = files["agreement.html"].decode()
    assert "planar2r" in page
    # nothing to load from elsewhere
    assert not [mark for mark in ("<script src", "<link", 'src="http', "@import") if mark in page]


def test_disagreement_exits_1_and_names_the_culprit(mbexport, tmp_path, monkeypatch):
    honest = UrdfBackend.emit

    def heavy(self, robot, program):
        stage = robot.stages[1]
        inertia = replace(stage.arm.inertia, mass=1.25 * stage.arm.inertia.mass)
        wrong = replace(stage, arm=replace(stage.arm, inertia=inertia))
        return honest(self, replace(robot, stages=(robot.stages[0], wrong)), program)

    monkeypatch.setattr(UrdfBackend, "emit", heavy)
    answer = mbexport("agree", "planar2r", *QUICK, "--level", "rigid", "-o", tmp_path / "report", "--json")
    assert answer.status == 1
    data = answer.json()
    assert data["agreed"] is False
    (sentence,) = data["sentences"]
    assert sentence.startswith("urdf (Pinocchio)")
    assert "arm_2" in sentence
    assert data == json.loads((tmp_path / "report" / "agreement.json").read_text())


def test_nothing_is_written_over_without_force(mbexport, tmp_path):
    (tmp_path / "agreement.html").write_text("mine")
    answer = mbexport("agree", "planar2r", *QUICK, "-o", tmp_path)
    assert answer.status == 2
    assert "--force" in answer.err
    assert [path.name for path in tmp_path.iterdir()] == ["agreement.html"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["planar2r", "--backends", "mjfc"], "mjcf"),
        (["planar2s"], "planar2r"),
        (["planar2r", "--only", "mass"], "mass_matrix"),
        (["planar2r", "--duration", "0"], "above 0"),
        (["planar2r", "--level", "full", "--with", "rotor_inertia"], "--with"),
        (["planar2r", "--level", "stiff"], "stiff"),
    ],
)
def test_wrong_words_exit_2_and_write_nothing(mbexport, tmp_path, words, said):
    answer = mbexport("agree", *words, "-o", tmp_path / "report")
    assert answer.status == 2
    assert said in answer.err
    assert not (tmp_path / "report").exists()
