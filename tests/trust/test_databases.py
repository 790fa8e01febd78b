"""Databases of strangers: reading executes nothing, takes bounded time and memory, and stays in the folder."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from mbexport.core.database import load
from mbexport.core.database.table import MOST_ROWS
from mbexport.core.errors import DatabaseError


def one_problem(path: Path):
    with pytest.raises(DatabaseError) as caught:
        load(path)
    (problem,) = caught.value.problems
    return problem


def test_a_table_of_ten_million_rows(small):
    folder = small({"motions/long.dat": None})
    (folder / "motions").mkdir()
    with (folder / "motions" / "long.dat").open("wb") as stream:
        stream.write(b"t q1 q2\n")
        stream.write(b"0 0 0\n" * 10_000_000)
    problem = one_problem(folder)
    (folder / "motions" / "long.dat").unlink()
    assert problem.file == "motions/long.dat"
    assert str(MOST_ROWS) in problem.message


def test_a_file_that_is_too_large(small):
    folder = small()
    with (folder / "kinematics.dat").open("wb") as stream:
        stream.truncate(2**40)
    problem = one_problem(folder)
    assert str(2**40) in problem.message
    assert problem.file == "kinematics.dat"


def bomb(levels: int, width: int) -> str:
    lines = ["a0: &a0 [" + ", ".join(["0"] * width) + "]"]
    lines += [f"a{i}: &a{i} [" + ", ".join([f"*a{i - 1}"] * width) + "]" for i in range(1, levels)]
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name: small\n" + bomb(12, 10), "unfolds to more than"),
        ("name: small\ngravity: &g [0, 0, *g]\n", "before its anchor is complete"),
        ("name: small\ngravity: " + "[" * 100_000, "nested deeper"),
        ("name: small\ngravity: " + "{a: " * 100_000, "nested deeper"),
        ("name: small\n" + "- " * 10_000, "no YAML"),
        ("name: !!python/object/apply:os.system [touch harm]\n", "is not read"),
        ("name: !<tag:yaml.org,2002:python/name:os.system> x\n", "is not read"),
        ("name: !include /etc/passwd\n", "is not read"),
        ("name: one\n---\nname: two\n", "second document"),
        ("name: small\n? [a, b]\n: 1\n", "not a list"),
    ],
)
def test_yaml_that_would_do_harm(small, text: str, says: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = time.perf_counter()
    problem = one_problem(small({"robot.yaml": text}))
    assert time.perf_counter() - before < 5
    assert problem.file == "robot.yaml"
    assert says in problem.message
    assert not (tmp_path / "harm").exists()


@pytest.mark.parametrize(
    "name",
    [
        "../up",
        "a/b",
        "a b",
        "a;rm",
        "1st",
        "ünicode",
        "a" * 65,
        "a\\nb",
        "x'''+__import__('os').system('id')+'''",
        "{{ 7 * 7 }}",
        "--><evil/>",
        "con\\u202e",
    ],
)
def test_names_that_would_break_out_of_what_is_emitted(small, name: str):
    problem = one_problem(small({"robot.yaml": f'name: "{name}"\n'}))
    assert problem.column == "name"


@pytest.mark.parametrize("text", ['"a\\0b"', '"\\x1b[2J"', '"\\ud800"', '"\\x7f"'])
def test_texts_with_control_characters(small, text: str):
    problem = one_problem(small({"robot.yaml": f"name: small\nsource: {text}\n"}))
    assert problem.column in {"source", None}


def test_a_text_without_end(small):
    problem = one_problem(small({"robot.yaml": f"name: small\nsource: {'x' * 30_000}\n"}))
    assert "30000 characters" in problem.message
    assert len(str(problem)) < 300


@pytest.mark.parametrize("name", ["a b", "é", "-x", "x;y", "x" * 65])
def test_names_of_motions(small, name: str):
    problem = one_problem(small({f"motions/{name}.dat": "t q1 q2\n0 0 0\n1 0 0\n"}))
    assert "motion's name" in problem.message


@pytest.mark.parametrize(
    "mesh", ["../../etc/passwd", "/etc/passwd", "a/../../b.stl", ".ssh/key", 'a".stl', "a\\\\b.stl", "<x>"]
)
def test_meshes_that_leave_the_folder(small, mesh: str):
    text = f'1:\n  - {{kind: mesh, mesh: "{mesh}"}}\n'.replace('a".stl', 'a\\".stl')
    problem = one_problem(small({"visuals.yaml": text}))
    assert problem.column == "visuals.1.mesh"


def test_a_mesh_that_is_a_link_out_of_the_folder(small, tmp_path: Path):
    (tmp_path / "secret.stl").write_text("secret")
    folder = small({"visuals.yaml": "1:\n  - {kind: mesh, mesh: arm.stl}\n"})
    (folder / "arm.stl").symlink_to(tmp_path / "secret.stl")
    assert "leaves the database's folder" in one_problem(folder).message


def test_what_is_no_file(small, tmp_path: Path):
    folder = small({"kinematics.dat": None})
    (folder / "kinematics.dat").mkdir()
    assert "not a file" in one_problem(folder).message
    (folder / "kinematics.dat").rmdir()
    os.mkfifo(folder / "kinematics.dat")
    assert "not a file" in one_problem(folder).message
    (folder / "kinematics.dat").unlink()
    (folder / "kinematics.dat").symlink_to("/dev/zero")
    assert "not a file" in one_problem(folder).message


def test_thousands_of_faults_are_told_in_hundreds(small):
    rows = "\n".join(f"{i} x" for i in range(5000))
    folder = small({"effects/viscous_friction.dat": f"joint coefficient\n{rows}\n"})
    with pytest.raises(DatabaseError) as caught:
        load(folder)
    assert 100 <= len(caught.value.problems) <= 201


def test_thousands_of_files(small):
    folder = small()
    (folder / "effects").mkdir()
    for i in range(501):
        (folder / "effects" / f"e{i}.dat").touch()
    assert "501 files" in one_problem(folder).message


def test_a_mesh_that_is_too_large(small):
    folder = small({"visuals.yaml": "1:\n  - {kind: mesh, mesh: arm.stl}\n"})
    with (folder / "arm.stl").open("wb") as stream:
        stream.truncate(2**40)
    assert str(2**40) in one_problem(folder).message


def test_what_a_file_holds_does_not_steer_the_terminal(small):
    """Messages repeat what is wrong; escape sequences in them would be obeyed."""
    problem = one_problem(small({"kinematics.dat": "arm alpha a theta \x1b]0;x\x07d\n1 0 0 0 0\n2 0 0 0 0\n"}))
    assert "\x1b" in (problem.column or "") + (problem.value or "")
    assert str(problem).isprintable()
