"""Whatever stands in the files: a database, or DatabaseError with at least one problem; never anything else."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mbexport.core.database import check, load, parse_motion
from mbexport.core.database.units import UnknownUnitError, factor_by_library
from mbexport.core.errors import DatabaseError, RunFileError
from mbexport.core.representation import Joint

PIECES = [
    "arm", "joint", "robot", "t", "alpha", "alpha[deg]", "a[m]", "theta[rad]", "d", "beta", "mass[kg]", "x", "Ixx",
    "type", "prismatic", "continuous", "lower[deg|m]", "home", "1", "2", "3", "0", "-1", "1e-3", "1e999", "inf",
    "-inf", "nan", "[", "]", "[]", "a[[m]]", "a[m", "#", "# x", "\n", "\n\n", "\r\n", "\t", " ", ":", "- ", "? ", "{",
    "}", ",", "&a ", "*a", "!!int ", "!x ", "<<: *a", "---\n", "...\n", "%YAML 1.1\n", "%TAG ! x\n", "|\n", ">-\n",
    '"', "'", '"\\ud800"',
    '"\\x00"', "\\", "name: x\n", "kinematics:\n", "inertia:\n", "effects:\n", "motions:\n", "visuals:\n", "levels:\n",
    "  soft: [joint_compliance]\n", "  - ", "- [arm, alpha, a, theta, d]\n", "- [1, 0, 1, 0, 0]\n", "{arm: 1, mass: 1}",
    "joint_compliance:", "payload:", "wave:", "é", "\u2028", "\x85", "\ufeff", "\x00", "\x7f", "😀", "a: b: c\n",
]  # fmt: skip
soup = st.lists(st.sampled_from(PIECES) | st.text(max_size=5), max_size=40).map("".join)
FILES = [
    "robot.yaml",
    "kinematics.dat",
    "corrections.dat",
    "inertia.dat",
    "joints.dat",
    "effects/joint_compliance.dat",
    "effects/payload.dat",
    "effects/x.dat",
    "motions/wave.dat",
    "visuals.yaml",
]
quick = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))


def answer(path: Path) -> None:
    try:
        robot = load(path)
    except DatabaseError as error:
        assert error.problems
        assert all(problem.severity == "error" for problem in error.problems)
        assert all("\n" not in problem.message for problem in error.problems)
        assert [p for p in check(path) if p.severity == "error"] == list(error.problems)
    else:
        robot.content_hash()
        assert all(problem.severity == "warning" for problem in check(path))


@quick
@given(st.dictionaries(st.sampled_from(FILES), soup | st.binary(max_size=30).map(bytes), min_size=1, max_size=3))
def test_any_text_in_any_file(small, files):
    folder = small(files)
    answer(folder)
    # the folder is used again, so what this example added is taken out
    for file in files:
        (folder / file).unlink()


@quick
@given(soup)
def test_any_text_as_one_yaml(tmp_path: Path, text: str):
    path = tmp_path / "robot.yaml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    answer(path)


WHOLE = """name: small
kinematics: [{arm: 1, alpha: 0, a: 0.3, theta: 0, d: 0.2}]
inertia: [[arm, mass, x, y, z, Ixx, Iyy, Izz], [1, 4, 0, 0, 0, 1, 1, 1]]
joints: [{joint: 1, lower: -1, upper: 1}]
effects: {joint_compliance: [{joint: 1, stiffness: 5}], payload: [{robot: robot, mass: 1}]}
motions: {wave: [[t, q1], [0, 0], [1, 1]]}
levels: {soft: [joint_compliance]}
visuals: {1: [{kind: box, size: [1, 1, 1]}]}
"""


@quick
@given(
    st.lists(st.tuples(st.integers(0, len(WHOLE)), st.integers(0, 6), st.sampled_from(PIECES)), min_size=1, max_size=3)
)
def test_a_good_database_with_bites_taken_out(tmp_path: Path, edits):
    text = WHOLE
    for at, cut, put in edits:
        text = text[:at] + put + text[at + cut :]
    path = tmp_path / "robot.yaml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    answer(path)


def test_the_whole_one_is_good(tmp_path: Path):
    (tmp_path / "robot.yaml").write_text(WHOLE)
    assert load(tmp_path / "robot.yaml").n == 1


@quick
@given(soup)
def test_any_text_as_a_motion(text: str):
    try:
        parse_motion(text, [Joint("joint_1")])
    except RunFileError as error:
        assert error.problems


@quick
@given(st.text(st.sampled_from("mkgsradNHzdeµ°%*/^()1-2 ·"), max_size=14))
def test_any_text_as_a_unit(text: str):
    with suppress(UnknownUnitError):
        factor_by_library(text, "N*m/rad")
