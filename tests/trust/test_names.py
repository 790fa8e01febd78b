"""Whatever a stranger writes where names and remarks stand: refused in one clear error, or a text of the same build.

A name that breaks out of a template shows as a statement, an element, an attribute or a line more than the harmless
robot has.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.errors import DatabaseError, MbexportError, UsageError
from mbexport.core.export import concept_report, emit, export
from mbexport.core.importing import import_model
from mbexport.core.motion import MotionLaw, hold
from mbexport.core.rendering import comment_line, python_literal, xml_text
from mbexport.core.representation import Robot
from mbexport.core.simulation import backend_named, backend_names

BACKENDS = backend_names()
PIECES = [
    '"', "'", '"""', "'''", "\\", "\n", "\r", "\r\n", "\t", "\0", "\x0c", "\x1b[2J", "\x85", "\u2028", "\u2029",
    "\u202e", "\ufffe", "\uffff", "\ufeff", "<", ">", "&", "&amp;", "&x;", "<!--", "-->", "--", "---", "-", "]]>",
    "<![CDATA[", "<?x?>", "/>", "<evil/>", "{{ 7 * 7 }}", "{% include 'x' %}", "{#", "#}", "#", "%", "%{", "%}", "...",
    "!", "&\n", ";", "$", "`", "(", ")", "[", "]", "{", "}", ",", ":", "=", " ", "/", "..", "../", "~", "|", "*", "a",
    "Z", "0", "_", "é", "😀", "import os", "__import__('os').system('id')", "end", "stop", "system('id')",
    "!system id", "\\N{DASH}", "${x}", "$(id)", "@", "con", "nul", "file:///etc/passwd", "f'{1}'", "\\u0022",
    "\\x22", "--><evil/><!--",
]  # fmt: skip
hostile = st.lists(st.sampled_from(PIECES) | st.text(max_size=4), min_size=1, max_size=8).map("".join)
quick = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
# how a comment of a line begins, by the ending of the file
COMMENT = {".adm": "!", ".cmd": "!", ".acf": "!", ".m": "%"}
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:-[A-Za-z0-9_-]*)?")


def structure(file: str, text: str) -> Any:
    """What of a text does not depend on the words in it; fails where the text is none of its kind."""
    assert "\0" not in text
    suffix = Path(file).suffix
    if suffix == ".py":
        return [type(node).__name__ for node in ast.walk(ast.parse(text))]
    if suffix == ".json":
        return shape(json.loads(text))
    if suffix in COMMENT:
        assert re.search(r"[^\x20-\x7e\n]", text) is None
        lines = [line for line in text.split("\n") if not line.lstrip().startswith(COMMENT[suffix])]
        # between the words and the numbers only
        return [IDENTIFIER.sub("x", line) for line in lines]
    # an XML of any ending
    return [(element.tag, sorted(element.attrib)) for element in ElementTree.fromstring(text).iter()]


def shape(data: Any) -> Any:
    match data:
        case dict():
            return {key: shape(value) for key, value in data.items() if key not in {"notes", "effects"}}
        case list():
            return [shape(value) for value in data]
        case _:
            return type(data).__name__


def emitted(robot: Robot, backend: str, motion: MotionLaw | None = None) -> dict[str, Any]:
    """Structure of each file of an emission, by the part of its name that is not the robot's."""
    emission = emit(robot, backend_named(backend), motion)
    found: dict[str, Any] = {}
    named = re.compile("|".join({re.escape(robot.name), re.sub(r"[^A-Za-z0-9_]", "_", robot.name)}))
    for file, text in (*emission.files.items(), ("x.concepts.json", concept_report(robot, emission))):
        assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", file), file
        start = named.match(file)
        found[file[start.end() :] if start else file] = structure(file, text)
    return found


@pytest.fixture(scope="module")
def robot() -> Robot:
    return build(load("planar2r"))


@pytest.fixture(scope="module")
def harmless(robot: Robot) -> Callable[[str, bool], dict[str, Any]]:
    made: dict[str, dict[str, Any]] = {}

    remarked = replace(robot, notes=("remark",), effects=(*robot.effects, "effect"))

    def of(backend: str, remarks: bool) -> dict[str, Any]:
        key = f"{backend} {remarks}"
        if key not in made:
            made[key] = emitted(remarked if remarks else robot, backend)
        return made[key]

    return of


@pytest.mark.parametrize("backend", BACKENDS)
@settings(quick, max_examples=12)
@example("---")
@example("\ufffe -")
@example("x\n</mujoco>\nimport os\nstop")
@given(hostile)
def test_remarks_stay_in_their_comments(backend: str, robot: Robot, harmless, text: str):
    """What people write about a robot may be any text; it stands in comments and says nothing to a machine."""
    changed = replace(robot, notes=(text,), source_hash=text, level=text, effects=(*robot.effects, text))
    assert emitted(changed, backend) == harmless(backend, True)


@pytest.mark.parametrize("backend", BACKENDS)
@settings(quick, max_examples=12)
@given(st.from_regex(r"[A-Za-z][A-Za-z0-9_-]{7}", fullmatch=True))
@example("a--b---_")
def test_names_that_are_taken_are_only_names(backend: str, robot: Robot, harmless, name: str):
    """As long as the harmless one, for texts are wrapped."""
    assert emitted(replace(robot, name=name), backend) == harmless(backend, False)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["x" * 64, "a", "end", "stop", "A-"])
def test_names_that_mean_something_elsewhere(backend: str, robot: Robot, harmless, name: str):
    made = emitted(replace(robot, name=name), backend)
    assert len(made) == len(harmless(backend, False))


@quick
@given(hostile)
def test_no_robot_has_a_name_that_is_none(robot: Robot, text: str):
    stage = robot.stages[0]
    for make in (
        lambda: replace(robot, name=text),
        lambda: replace(robot, stages=(replace(stage, joint=replace(stage.joint, name=text)),)),
        lambda: replace(robot, stages=(replace(stage, arm=replace(stage.arm, name=text)),)),
    ):
        if re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,63}", text):
            make()
        else:
            with pytest.raises(UsageError, match="is no name") as caught:
                make()
            assert str(caught.value).isprintable()


ONE_ARM = {
    "kinematics": [{"arm": 1, "alpha": 0, "a": 0.3, "theta": 0, "d": 0.2}],
    "inertia": [{"arm": 1, "mass": 4, "x": 0, "y": 0, "z": 0, "Ixx": 1, "Iyy": 1, "Izz": 1}],
}


@quick
@given(
    place=st.sampled_from(["name", "level", "effect", "motion", "mesh", "source", "remark", "key", "visual", "unit"]),
    text=hostile,
)
def test_a_database_of_a_stranger(place: str, text: str, tmp_path: Path):
    """JSON is YAML: whatever the text, it arrives as it is."""
    data: dict[str, Any] = {
        "name": "small",
        **ONE_ARM,
        "effects": {"viscous_friction": [{"joint": 1, "coefficient": 1}]},
    }
    match place:
        case "name" | "source":
            data[place] = text
        case "remark":
            data["remarks"] = [text]
        case "level":
            data["levels"] = {text: ["viscous_friction"]}
        case "effect":
            data["effects"][text] = [{"joint": 1, "coefficient": 1}]
        case "motion":
            data["motions"] = {text: [["t", "q1"], [0, 0], [1, 1]]}
        case "mesh":
            data["visuals"] = {1: [{"kind": "mesh", "mesh": text}]}
        case "visual":
            data["visuals"] = {1: [{"kind": text, "size": [1, 1, 1]}]}
        case "unit":
            data["inertia"] = [{f"mass[{text}]": 1, "arm": 1}]
        case _:
            data[text] = 1
    path = tmp_path / "robot.yaml"
    path.write_text(json.dumps(data))
    try:
        database = load(path)
    except DatabaseError as error:
        assert str(error).replace("\n", "").isprintable()
        return
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,63}", database.name)
    for name in (*database.levels, *database.motions):
        assert re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name)


@quick
@given(robot_name=hostile, joint_name=hostile, link_name=hostile, material=hostile, file=hostile)
def test_a_model_of_a_stranger(
    robot_name: str, joint_name: str, link_name: str, material: str, file: str, tmp_path: Path
):
    """Names of a file that is imported stand in the remarks, and nowhere else."""
    names = [xml_text(text) for text in (robot_name, joint_name, link_name, material, file)]
    robot, joint, link, colour, mesh = names
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<visual><geometry><mesh filename="{mesh}"/></geometry><material name="{colour}"/></visual>'
    )
    text = (
        f'<robot name="{robot}"><link name="a">{inertial}</link><link name="b{link}">{inertial}</link>'
        f'<joint name="j{joint}" type="continuous"><parent link="a"/><child link="b{link}"/></joint></robot>'
    )
    path = tmp_path / "model.urdf"
    path.write_text(text, encoding="utf-8", newline="")
    try:
        database = import_model(path).database
    except MbexportError as error:
        assert str(error).replace("\n", "").isprintable()
        return
    made = build(database)
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,63}", made.name)
    for backend in ("mjcf", "exudyn"):
        emitted(made, backend, hold(made.home(), 1.0))


@pytest.mark.parametrize(
    "name", ["numpy.py", "exudyn.py", "sitecustomize.py", "startup.m", "meshes/x.mexa64", "a.stl.py"]
)
def test_a_mesh_that_a_language_would_run(name: str, small, tmp_path: Path):
    """It would stand beside the emitted script, where Python and MATLAB look for modules first."""
    folder = small({"visuals.yaml": f"1:\n  - {{kind: mesh, mesh: {name}}}\n", name: "print('harm')\n"})
    with pytest.raises(DatabaseError, match=r"ending in \.dae"):
        load(folder)


def test_nothing_is_written_beside_the_folder(small, tmp_path: Path):
    """All files of an export stay in it."""
    folder = small({"visuals.yaml": "1:\n  - {kind: mesh, mesh: meshes/arm.stl}\n", "meshes/arm.stl": b"solid"})
    before = set(tmp_path.rglob("*"))
    export(build(load(folder)), BACKENDS, tmp_path / "out" / "here", meshes=folder)
    after = set(tmp_path.rglob("*")) - before
    assert after
    assert all(path.is_relative_to(tmp_path / "out") for path in after)


@quick
@given(hostile)
@example("a-\\")
def test_the_filters(text: str):
    """One string, one attribute, one comment each, whatever the text."""
    assert ast.literal_eval(python_literal(text)) == text
    assert ast.literal_eval(python_literal({text: [text]})) == {text: [text]}
    root = ElementTree.fromstring(f'<a b="{xml_text(text)}">{xml_text(text)}</a>')
    assert (root.tag, list(root), list(root.attrib)) == ("a", [], ["b"])
    comment = comment_line(text)
    assert comment.isprintable()
    root = ElementTree.fromstring(f"<a><!-- {comment}\n--></a>")
    assert (list(root), root.text) == ([], None)
    assert ast.dump(ast.parse(f"# {comment}\nx = 1\n")) == ast.dump(ast.parse("x = 1\n"))
