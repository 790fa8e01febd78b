"""mbexport demo: the whole story, told on a small robot for a short time, and what it refuses."""

from __future__ import annotations

import json

import pytest

from mbexport.core.cli import demo


@pytest.fixture
def short(monkeypatch):
    """The command with another robot, two engines and a second of motion."""
    whole = demo.Story
    monkeypatch.setattr(
        demo, "Story", lambda quiet: whole(quiet, robot="planar2r", backends=("mjcf", "urdf"), duration=0.4)
    )


def test_the_whole_story(mbexport, content, tmp_path, short):
    answer = mbexport("demo", "-o", tmp_path / "demo")
    assert answer.status == 0, answer.err
    files = content(tmp_path / "demo")
    for name in ("mjcf", "urdf"):
        assert f"models/{name}/planar2r.concepts.json" in files
        for kind in ("rigid", "compliant", "closed_loop"):
            assert {f"runs/{kind}-{name}/log.yaml", f"runs/{kind}-{name}/data.csv"} <= set(files)
    assert files["tip.png"].startswith(b"\x89PNG")
    assert json.loads(files["agreement/agreement.json"])["agreed"] is True
    assert b"<html" in files["agreement/agreement.html"]
    summary = json.loads(files["summary.json"])
    tips = summary["tip"]
    # a rigid path is the command; springs give millimetres, and engines agree on them
    assert tips["rigid"]["from_rigid_largest"] == 0.0
    for kind in ("compliant", "closed_loop"):
        assert 1e-3 < tips[kind]["from_rigid_largest"] < 0.1
        assert tips[kind]["engines_apart"] < 1e-6
    assert f"{1e3 * tips['compliant']['from_rigid_mean']:.1f} mm" in answer.out
    assert summary["agreement"]["agreed"] is True
    again = mbexport("demo", "-o", tmp_path / "demo")
    assert again.status == 2
    assert "--force" in again.err
    assert content(tmp_path / "demo") == files


def test_every_model_that_is_told_of_is_written(monkeypatch):
    """Text or not: the one that is an archive too."""
    from mbexport.backends import fmu
    from mbexport.core.build import build
    from mbexport.core.database import load
    from mbexport.core.motion import motion_named

    # its sources are enough here
    monkeypatch.setattr(fmu, "compiler", lambda: None)
    story = demo.Story(quiet=True, backends=("adams", "fmu", "simscape", "urdf"))
    robot = build(load("planar2r"), "compliant")
    story._export(robot, motion_named(robot, "hold"))
    for name in ("adams/planar2r.cmd", "adams/planar2r.adm", "simscape/planar2r_simscape.m", "urdf/planar2r.urdf"):
        assert story.files[f"models/{name}"]
    assert story.files["models/fmu/planar2r.fmu"][:2] == b"PK"


def test_the_dummy_is_stated(capsys):
    from mbexport.core.build import build
    from mbexport.core.database import load

    story = demo.Story(quiet=False)
    database = load(demo.ROBOT)
    story._dummy(build(database, demo.LEVEL), database.dummy_inertia)
    said = " ".join(capsys.readouterr().out.split())
    assert "dummy_inertia" in said
    assert "1.0 of the arm's diagonal mass-matrix entry" in said


def test_an_engine_that_is_broken_is_left_out_by_name(monkeypatch):
    from mbexport.core.build import build
    from mbexport.core.database import load
    from mbexport.core.errors import PluginError
    from mbexport.core.motion import hold
    from mbexport.core.simulation import backends

    robot = build(load("planar2r"), "compliant")
    real = backends.backend_named

    def named(name):
        if name == "exudyn":
            raise PluginError("no licence server")
        return real(name)

    monkeypatch.setattr("mbexport.core.simulation.backend_named", named)
    story = demo.Story(quiet=True, backends=("exudyn", "urdf"))
    assert story._export(robot, hold(robot.home(), 0.1)) == ["urdf"]
    assert story.left_out == {"exudyn": "no licence server"}


def test_disagreement_exits_1(mbexport, tmp_path, monkeypatch):
    monkeypatch.setattr(
        demo.Story, "tell", lambda self: {"agreement": {"agreed": False, "sentences": ["The arm is too heavy."]}}
    )
    assert mbexport("demo", "-o", tmp_path / "demo").status == 1
    assert (tmp_path / "demo" / "summary.json").is_file()


def test_a_file_in_the_way(mbexport, tmp_path):
    (tmp_path / "demo").write_text("mine")
    answer = mbexport("demo", "-o", tmp_path / "demo")
    assert answer.status == 2
    assert (tmp_path / "demo").read_text() == "mine"


@pytest.mark.parametrize("words", [("demo",), ("diagnose", "pendulum", "nowhere"), ("agree", "pendulum")])
def test_a_place_that_cannot_be_is_refused_before_the_work(mbexport, tmp_path, words):
    (tmp_path / "notes").write_text("a file")
    answer = mbexport(*words, "-o", tmp_path / "notes" / "here", "--force")
    assert answer.status == 2 and answer.out == ""
    assert answer.err == f"mbexport: cannot write into {tmp_path}/notes/here: {tmp_path}/notes is no folder.\n"
