"""Files that cannot be imported: each ends in one clear ModelFileError, and never in anything else."""

from __future__ import annotations

import random
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from mbexport.core.errors import ModelFileError
from mbexport.core.importing import import_model
from mbexport.core.importing.xml_file import DEEPEST, LARGEST_FILE

WEIGHT = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def urdf(inside: str) -> str:
    return f'<robot name="r">\n{inside}\n</robot>'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", inside: str = '<limit lower="-1" upper="1"/>'
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def links(*names: str) -> str:
    return "".join(f'<link name="{name}">{WEIGHT}</link>' for name in names)


ONE_JOINT = links("a", "b") + joint("j", "a", "b")

URDF = {
    "text": ("this is a robot", ["model.xml:1", "is no XML"]),
    "cut off": (urdf(ONE_JOINT)[:-20], ["is no XML"]),
    "another format": ("<sdf><model/></sdf>", ["<sdf> is neither", "SDF is not read"]),
    "xacro": (urdf('<xacro:macro name="m"/>' + ONE_JOINT), ["model.xml:2", "run xacro"]),
    "bomb": (
        '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>' + urdf("<link name='&b;'/>"),
        ["document type", "delete that line"],
    ),
    "outside file": ('<!DOCTYPE r SYSTEM "file:///etc/passwd">' + urdf(ONE_JOINT), ["document type"]),
    "too deep": ("<a>" * (DEEPEST + 2), [f"nested deeper than {DEEPEST}"]),
    "empty": (urdf(""), ["holds no <link>"]),
    "no joint": (urdf(links("a")), ["no joint of it turns or slides"]),
    "only fixed": (urdf(links("a", "b") + joint("j", "a", "b", "fixed")), ["no joint of it turns or slides"]),
    "two roots": (urdf(links("stray") + ONE_JOINT), ["2 links hang on no joint: stray, a"]),
    "loop": (
        urdf(links("base", "a", "b") + joint("j", "a", "b") + joint("k", "b", "a")),
        ["form a loop through links a, b"],
    ),
    "all in a loop": (urdf(links("a", "b") + joint("j", "a", "b") + joint("k", "b", "a")), ["form a loop"]),
    "two parents": (
        urdf(links("a", "b", "c") + joint("j", "a", "c") + joint("k", "b", "c")),
        ["link 'c' hangs on two joints, 'j' and 'k'"],
    ),
    "two links of a name": (urdf(links("b") + ONE_JOINT), ["column name, value 'b'", "a second link"]),
    "unnamed joint": (urdf(ONE_JOINT + '<joint type="fixed"/>'), ["<joint> needs a name"]),
    "unknown link": (urdf(links("arm") + joint("j", "arn", "arm")), ["value 'arn'", "did you mean 'arm'?"]),
    "no child": (urdf(links("a") + '<joint name="j" type="fixed"><parent link="a"/></joint>'), ["no <child>"]),
    "unknown kind": (urdf(links("a", "b") + joint("j", "a", "b", "hinge")), ["value 'hinge'", "must be one of"]),
    "floating": (urdf(links("w", *"ab") + joint("f", "w", "a", "floating") + joint("j", "a", "b")), ["floating joint"]),
    "planar": (urdf(links("w", *"ab") + joint("j", "w", "a") + joint("f", "a", "b", "planar")), []),
    "no axis": (urdf(links("a", "b") + joint("j", "a", "b", inside='<axis xyz="0 0 0"/>')), ["has no direction"]),
    "nan": (
        urdf(links("a", "b") + joint("j", "a", "b", inside='<origin xyz="0 nan 0"/>')),
        ["column xyz", "value '0 nan 0'"],
    ),
    "infinite": (urdf(ONE_JOINT + joint("k", "a", "b", inside='<origin xyz="0 1e999 0"/>')), []),
    "underscore": (urdf(ONE_JOINT.replace('value="1"', 'value="1_000"', 1)), ["value '1_000'"]),
    "two numbers": (urdf(links("a", "b") + joint("j", "a", "b", inside='<axis xyz="0 1"/>')), ["3 numbers must"]),
    "negative mass": (urdf(ONE_JOINT.replace('value="1"', 'value="-1"')), ["must be at least 0.0"]),
    "no tensor": (urdf(ONE_JOINT.replace('iyz="0"', "")), ["<inertia> needs the attribute 'iyz'"]),
    "limits": (urdf(ONE_JOINT.replace('lower="-1"', 'lower="2"')), ["lower 2.0 is above upper 1.0"]),
    "branches": (
        urdf(links(*"abc") + joint("j", "a", "b") + joint("k", "a", "c")),
        ["2 chains that move: 'b' (1 joint), 'c' (1 joint)", "Choose one by --tip"],
    ),
}


def mjcf(inside: str, before: str = "") -> str:
    return f"<mujoco>\n{before}<worldbody>\n{inside}\n</worldbody></mujoco>"


def body(inside: str) -> str:
    return f'<body name="b">{inside}</body>'


BALL = '<geom size="0.1"/>'

MJCF = {
    "empty": ("<mujoco/>", ["holds no body"]),
    "part": ("<mujocoinclude/>", ["import the file that includes it"]),
    "free": (mjcf(body("<freejoint/>" + BALL + '<body name="c"><joint/>' + BALL + "</body>")), ["a free joint"]),
    "ball": (mjcf(body("<joint/>" + BALL + '<body name="c"><joint type="ball"/>' + BALL + "</body>")), []),
    "only ball": (mjcf(body('<joint type="ball"/>' + BALL)), ["no joint of it turns or slides", "its joints are ball"]),
    "unknown kind": (mjcf(body('<joint type="revolute"/>' + BALL)), ["hinge, slide, ball, free"]),
    "mesh": (mjcf(body('<joint/><geom type="mesh" mesh="m"/>')), ["model.xml:3", "from a mesh", "give the body"]),
    "shell": (mjcf(body('<joint/><geom size="1" shellinertia="true"/>')), ["from a shell"]),
    "no size": (mjcf(body("<joint/><geom/>")), ["<geom> needs the attribute 'size'"]),
    "few sizes": (mjcf(body('<joint/><geom type="box" size="1 2"/>')), ["a box needs 3 lengths"]),
    "class": (mjcf(body('<joint class="elbo"/>' + BALL), '<default><default class="elbow"/></default>'), ["'elbow'?"]),
    "class of a body": (mjcf('<body childclass="x"><joint/>' + BALL + "</body>"), ["no such default class"]),
    "class twice": (
        mjcf(body("<joint/>" + BALL), '<default><default class="x"/><default class="x"/></default>'),
        ["class name of its own"],
    ),
    "two orientations": (mjcf('<body quat="1 0 0 0" euler="0 0 1"><joint/>' + BALL + "</body>"), ["more than one"]),
    "no orientation": (mjcf('<body quat="0 0 0 0"><joint/>' + BALL + "</body>"), ["says no orientation"]),
    "full and diagonal": (
        mjcf(body('<joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1" fullinertia="1 1 1 0 0 0"/>')),
        ["fullinertia and diaginertia cannot both"],
    ),
    "two inertials": (mjcf(body("<joint/>" + '<inertial pos="0 0 0" mass="1"/>' * 2)), ["a second <inertial>"]),
    "two bodies": (mjcf(body("<joint/>" + BALL) * 2), ["a second body of this name"]),
    "two joints": (mjcf(body('<joint name="j"/><joint name="j"/>' + BALL)), ["a second joint of this name"]),
    "range": (mjcf(body('<joint range="1 -1"/>' + BALL)), ["first number must be below"]),
    "limited": (mjcf(body('<joint limited="true"/>' + BALL)), ["limited without range"]),
    "autolimits": (mjcf(body('<joint range="0 1"/>' + BALL), '<compiler autolimits="false"/>'), ["autolimits=false"]),
    "global": (mjcf(body("<joint/>" + BALL), '<compiler coordinate="global"/>'), ["only local coordinates"]),
    "eulerseq": (mjcf(body("<joint/>" + BALL), '<compiler eulerseq="abc"/>'), ["three letters"]),
    "replicate": (mjcf(body("<joint/><replicate count='2'>" + BALL + "</replicate>")), ["mj_saveLastXML"]),
    "attach": (mjcf(body("<joint/>" + BALL + '<attach model="m"/>')), ["<attach> brings in another model"]),
    "actuator": (
        mjcf(body('<joint name="elbow"/>' + BALL), '<actuator><motor joint="elbo" armature="1"/></actuator>'),
        ["did you mean 'elbow'?"],
    ),
    "negative damping": (mjcf(body('<joint damping="-1"/>' + BALL)), ["must be at least 0.0"]),
    "include outside": (mjcf('<include file="../secret.xml"/>'), ["outside of the model's folder"]),
    "include absolute": (mjcf('<include file="/etc/passwd"/>'), ["outside of the model's folder"]),
    "include missing": (mjcf('<include file="parts.xml"/>'), ["no such file"]),
    "include itself": (mjcf('<include file="model.xml"/>'), ["a second time"]),
    "include nothing": (mjcf("<include/>"), ["outside of the model's folder"]),
}


@pytest.mark.parametrize("case", URDF)
def test_bad_urdf(case: str, model_file: Callable[..., Path]) -> None:
    text, said = URDF[case]
    tip = "b" if case in {"planar"} else None
    with pytest.raises(ModelFileError) as caught:
        import_model(model_file(text), tip)
    one_clear_error(caught.value, said)


@pytest.mark.parametrize("case", MJCF)
def test_bad_mjcf(case: str, model_file: Callable[..., Path]) -> None:
    text, said = MJCF[case]
    tip = "c" if case in {"ball", "free"} else None
    with pytest.raises(ModelFileError) as caught:
        import_model(model_file(text), tip)
    one_clear_error(caught.value, said)


def one_clear_error(error: ModelFileError, said: list[str]) -> None:
    message = str(error)
    assert message.startswith("model.xml")
    for words in said:
        assert words in message


@pytest.mark.parametrize("tip", ["nowhere", "", "a"])
def test_bad_tips(tip: str, model_file: Callable[..., Path]) -> None:
    with pytest.raises(ModelFileError, match=r"has no link|no joint moves"):
        import_model(model_file(urdf(ONE_JOINT)), tip)


def test_all_faults_are_told_at_once(model_file: Callable[..., Path]) -> None:
    text = urdf(
        ONE_JOINT.replace('value="1"', 'value="x"', 1)
        + "\n"
        + joint("k", "a", "d", inside='<limit lower="q"/>')
        + "\n"
        + joint("j", "a", "b", "hinge")
    )
    with pytest.raises(ModelFileError) as caught:
        import_model(model_file(text))
    places = [(problem.line, problem.value) for problem in caught.value.problems]
    assert places == [(2, "x"), (3, "d"), (4, "j")]


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "empty.urdf").write_bytes(b"")
    (tmp_path / "binary.urdf").write_bytes(bytes(range(256)) * 20)
    (tmp_path / "huge.urdf").write_bytes(b" " * (LARGEST_FILE + 1))
    for name, said in (
        ("missing.urdf", "No such file"),
        (".", "is no file"),
        ("empty.urdf", "no element"),
        ("binary.urdf", "is no XML"),
        ("huge.urdf", "is larger than 16 MiB"),
        ("nul\0.urdf", "cannot be read"),
    ):
        with pytest.raises(ModelFileError, match=said):
            import_model(tmp_path / name)


def test_includes_cannot_nest_without_end(model_file: Callable[..., Path]) -> None:
    for i in range(40):
        nest = "<body>" * 20 + f'<include file="{i + 1}.xml"/>' + "</body>" * 20
        model_file(f"<mujocoinclude>{nest}</mujocoinclude>", f"{i}.xml")
    path = model_file(mjcf('<include file="0.xml"/>'))
    with pytest.raises(ModelFileError, match="too much is nested"):
        import_model(path)


def test_a_link_out_of_the_folder_is_not_followed(model_file: Callable[..., Path], tmp_path: Path) -> None:
    outside = tmp_path / "secret.xml"
    outside.write_text("<mujocoinclude/>")
    path = model_file(mjcf('<include file="inner.xml"/>'), "robot/model.xml")
    (tmp_path / "robot" / "inner.xml").symlink_to(outside)
    with pytest.raises(ModelFileError, match="outside of the model's folder"):
        import_model(path)


def test_the_deepest_chain_that_is_read_is_imported(model_file: Callable[..., Path]) -> None:
    count = DEEPEST - 3
    inside = '<body pos="0 0 0.1"><joint/><geom size="0.1"/>' * count + "</body>" * count
    assert import_model(model_file(mjcf(inside))).database.n == count


def test_what_is_beside_the_chain_may_be_unweighed(model_file: Callable[..., Path]) -> None:
    scene = body("<joint/>" + BALL) + '<body><freejoint/><geom type="mesh" mesh="cup"/></body>'
    assert import_model(model_file(mjcf(scene))).database.n == 1


SEEDS = [
    urdf(links(*"abcd") + joint("j", "a", "b") + joint("k", "b", "c", "prismatic") + joint("f", "c", "d", "fixed")),
    mjcf(
        '<body name="b" euler="1 2 3"><joint range="-1 1" axis="1 0 1"/>'
        '<geom type="box" size="1 2 3" fromto="0 0 0 1 1 1"/><geom type="capsule" size="1 2 3" mass="2" zaxis="0 1 0"/>'
        '<frame pos="1 0 0"><body name="c" quat="1 1 0 0"><joint class="x" type="slide" ref="2"/>'
        '<inertial pos="0 0 0" mass="1" fullinertia="1 1 1 0 0 0"/><site name="s"/></body></frame></body>',
        '<compiler angle="radian" balanceinertia="true" settotalmass="4"/><default><default class="x">'
        '<joint damping="1"/></default></default><actuator><motor joint="j" gear="2"/></actuator>',
    ),
]
SPLICES = [*"<>b0\0é", "", "nan", "inf", "type", "&#0;", "<joint/>", "<body>", "</body>", "<include file='.'/>", '"']
VALUES = [
    "-1",
    "1e308",
    "-1e15",
    "1e15",
    "1e-300",
    "1e-320",
    "0",
    "0 0 0",
    "1 2 3",
    "1 2 3 4",
    "1e15 -1e15 1e-15",
    "true",
]


def damaged(text: str, source: random.Random) -> str:
    """A cut, a splice or a swap anywhere, or another value in an attribute."""
    if source.random() < 0.6:
        values = list(re.finditer(r"[-\d.][-\d. e]*(?=\")", text))
        found = source.choice(values)
        return text[: found.start()] + source.choice(VALUES) + text[found.end() :]
    words = re.split(r"([\s=\"<>/]+)", text)
    at, other = source.randrange(len(words)), source.randrange(len(words))
    match source.randrange(3):
        case 0:
            words[at] = source.choice(SPLICES)
        case 1:
            words[at], words[other] = words[other], words[at]
        case _:
            words.insert(at, source.choice(SPLICES))
    return "".join(words)


@pytest.mark.parametrize("seed", range(4))
def test_damaged_files_give_a_database_or_a_clear_error(seed: int, model_file: Callable[..., Path]) -> None:
    """No other exception, no warning of numpy, nothing that is not a number."""
    source = random.Random(seed)
    outcomes = {"imported": 0, "refused": 0}
    for _ in range(200):
        text = damaged(SEEDS[seed % 2], source)
        if source.random() < 0.3:
            text = damaged(text, source)
        path = model_file(text)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                imported = import_model(path, repair=source.random() < 0.5)
            except ModelFileError as error:
                outcomes["refused"] += 1
                assert str(error).startswith("model.xml")
                assert len(str(error)) < 2000
            else:
                outcomes["imported"] += 1
                assert "nan" not in repr(imported.database)
                finite = [*imported.database.kinematics, *imported.database.inertias, imported.database.tool]
                assert "inf" not in repr(finite)
    assert min(outcomes.values()) > 20, outcomes
