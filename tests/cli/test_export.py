"""mbexport --to ...: shorthand, levels, whole or not at all."""

from __future__ import annotations

import json

import pytest


def test_shorthand_is_export(mbexport, content, tmp_path):
    assert mbexport("export", "imece2013", "--to", "urdf", "-o", tmp_path / "a").status == 0
    for folder, words in {
        "b": ["--to", "urdf", "imece2013"],
        "c": ["imece2013", "--to", "urdf"],
        "d": ["--to=urdf", "imece2013"],
        "e": ["--to", "urdf"],
    }.items():
        assert mbexport(*words, "-o", tmp_path / folder).status == 0
        assert content(tmp_path / folder) == content(tmp_path / "a")
    assert set(content(tmp_path / "a")) == {
        "imece2013.urdf",
        "imece2013.drives.json",
        "imece2013.concepts.json",
    }


def test_several_backends_get_a_folder_each(mbexport, content, tmp_path):
    answer = mbexport("--to", "urdf", "--to", "mjcf", "planar2r", "-o", tmp_path, "--json")
    facts = answer.json()
    assert answer.status == 0
    assert set(facts["exports"]) == {"urdf", "mjcf"}
    assert {name.split("/")[0] for name in content(tmp_path)} == {"urdf", "mjcf"}
    for name, export in facts["exports"].items():
        assert export["folder"] == str(tmp_path / name)
        assert (tmp_path / name / export["main"]).is_file()
        assert all((tmp_path / name / file).is_file() for file in export["files"])


def test_all_is_every_backend(mbexport, content, tmp_path):
    from mbexport.core.simulation import backend_names

    assert mbexport("--to", "all", "planar2r", "-o", tmp_path / "out").status == 0
    assert {name.split("/")[0] for name in content(tmp_path / "out")} == set(backend_names())


def test_default_folder_is_named_after_the_robot(mbexport, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert mbexport("--to", "urdf", "pendulum").status == 0
    assert (tmp_path / "pendulum-export" / "pendulum.urdf").is_file()


def test_nothing_is_written_over_without_force(mbexport, content, tmp_path):
    assert mbexport("--to", "urdf", "pendulum", "-o", tmp_path).status == 0
    (tmp_path / "pendulum.urdf").write_text("mine")
    before = content(tmp_path)
    answer = mbexport("--to", "urdf", "pendulum", "-o", tmp_path)
    assert answer.status == 2
    assert "--force" in answer.err
    assert "pendulum.urdf" in answer.err
    assert content(tmp_path) == before
    assert mbexport("--to", "urdf", "pendulum", "-o", tmp_path, "--force").status == 0
    assert (tmp_path / "pendulum.urdf").read_text() != "mine"


def test_strict_refuses_what_is_not_exact_and_writes_nothing(mbexport, tmp_path):
    answer = mbexport("--to", "urdf", "imece2013", "-o", tmp_path / "out", "--strict")
    assert answer.status == 1
    assert "joint_compliance.stiffness" in answer.err
    assert not (tmp_path / "out").exists()


def test_levels_and_effects(mbexport, tmp_path):
    def effects(*words):
        answer = mbexport("--to", "mjcf", "planar2r", "-o", tmp_path / "out", "--force", "--json", *words)
        return answer.json()["level"], answer.json()["effects"]

    assert effects("--level", "rigid") == ("rigid", [])
    assert effects("--level", "compliant") == ("compliant", ["joint_compliance", "rotor_inertia"])
    assert effects("--with", "rotor_inertia, viscous_friction") == ("custom", ["rotor_inertia", "viscous_friction"])
    assert effects()[0] == "full"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--to", "urfd", "pendulum"], "urdf"),
        (["--to", "urdf", "pendulun"], "pendulum"),
        (["--to", "urdf", "pendulum", "--level", "complaint"], "full"),
        (["--to", "urdf", "pendulum", "--with", "magic"], "magic"),
        (["--to", "urdf", "pendulum", "--with", "backlash"], "no table"),
        (["--to", "urdf", "pendulum", "--with", "coulomb_friction", "--level", "rigid"], "--with"),
        (["--to", "urdf", "pendulum", "--motion", "grecca"], "greca"),
        (["--to", "urdf", "pendulum", "--control", "no_such.yaml"], "no_such.yaml"),
        (["--to", "urdf", "pendulum", "--with-effects", "no_such_folder"], "no_such_folder"),
    ],
)
def test_wrong_words_exit_2_and_write_nothing(mbexport, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    answer = mbexport(*words, "-o", "out")
    assert answer.status == 2
    assert answer.err.startswith("mbexport: ")
    assert said in answer.err
    assert not list(tmp_path.iterdir())


def test_with_effects_replaces_rows(mbexport, tmp_path):
    tables = tmp_path / "effects"
    tables.mkdir()
    (tables / "coulomb_friction.dat").write_text("joint torque\n1 0.5\n")
    assert mbexport("--to", "mjcf", "pendulum", "--with-effects", tables, "-o", tmp_path / "out").status == 0
    sheet = json.loads((tmp_path / "out" / "pendulum.drives.json").read_text())
    terms = {term["effect"]: term["parameters"] for term in sheet["joints"][0]["terms"]}
    assert terms["coulomb_friction"] == [0.5]


@pytest.mark.parametrize("level", ["rigid", "friction"])
def test_with_effects_counts_at_any_level(mbexport, tmp_path, level):
    tables = tmp_path / "effects"
    tables.mkdir()
    (tables / "payload.dat").write_text("robot mass\nrobot 0.5\n")
    words = ("--to", "mjcf", "pendulum", "--level", level, "--json")
    assert mbexport(*words, "-o", tmp_path / "bare").status == 0
    loaded = json.loads(mbexport(*words, "--with-effects", tables, "-o", tmp_path / "out").out)
    assert "payload" in loaded["effects"] and loaded["level"] == level
    assert (tmp_path / "out" / "pendulum.xml").read_text() != (tmp_path / "bare" / "pendulum.xml").read_text()


def test_what_a_format_cannot_say_is_told(mbexport, tmp_path):
    answer = mbexport("--to", "urdf", "imece2013", "-o", tmp_path)
    assert "impossible" in answer.out
    assert "joint_compliance.stiffness" in answer.out
    report = json.loads((tmp_path / "imece2013.concepts.json").read_text())
    assert report["schema"] == "mbexport-concepts/1"
    assert sum(report["counts"].values()) == len(report["concepts"])
    assert f"{report['counts']['exact']} data exact" in answer.out
