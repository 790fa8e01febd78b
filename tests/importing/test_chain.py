"""Which chain of a tree is taken, what becomes of the rest, and what is told of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from mbexport.core.importing import import_model

Writer = Callable[..., Path]


def link(name: str, mass: float = 1.0) -> str:
    tensor = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><mass value="{mass!r}"/>{tensor}</inertial></link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", more: str = "", place: str = "0 0 0.5") -> str:
    limit = '<limit lower="-1" upper="2" velocity="3" effort="4"/>' if kind in {"revolute", "prismatic"} else ""
    more = more if "<limit" in more else more + limit
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}"/><axis xyz="0 1 0"/>{more}</joint>'
    )


def urdf(*parts: str) -> str:
    return f'<robot name="a robot">{"".join(parts)}</robot>'


GRIPPER = urdf(
    *(link(name) for name in ("base", "one", "two", "hand", "left", "right")),
    joint("j1", "base", "one"),
    joint("j2", "one", "two"),
    joint("wrist", "two", "hand", "fixed"),
    joint("l", "hand", "left", "prismatic", '<limit lower="0.02" upper="0.04"/>', "0 0.1 0"),
    joint("r", "hand", "right", "prismatic", '<mimic joint="l" multiplier="-1"/>', "0 -0.1 0"),
)


def test_what_moves_beside_the_chain_is_held_within_its_limits(model_file: Writer) -> None:
    imported = import_model(model_file(GRIPPER), "hand")
    arm = imported.database.inertias[1]
    assert imported.database.n == 2
    assert arm.mass == 4.0
    text = "\n".join(imported.remarks)
    assert "joint 'l' at 0.03 m moves beside the chain" in text
    assert "joint 'r' at 0.0 m moves beside the chain" in text
    assert "'base' (1.0 kg) stands still" in text
    # in the hand: link two 0.5 m below, the left finger at 0.1 + 0.03 m along y, the right one at -0.1 m
    in_hand = imported.database.tool.pose().inverse().matrix() @ [*arm.com, 1.0]
    assert in_hand[:3] == pytest.approx([0.0, 0.03 / 4.0, -0.5 / 4.0], abs=1e-15)
    assert imported.database.name == "a_robot"


def test_a_finger_can_be_the_tip(model_file: Writer) -> None:
    imported = import_model(model_file(GRIPPER), "right")
    assert [joint.kind for joint in imported.database.joints] == ["revolute", "revolute", "prismatic"]
    assert any("'r' follows another joint in the file (-1.0 * l + 0.0)" in remark for remark in imported.remarks)


def test_the_tip_may_be_before_the_end(model_file: Writer) -> None:
    imported = import_model(model_file(GRIPPER), "one")
    assert imported.database.n == 1
    assert imported.database.inertias[0].mass == 5.0


def test_the_outermost_fixed_link_is_the_tip(model_file: Writer) -> None:
    text = urdf(
        *(link(name) for name in ("base", "one", "flange", "camera", "tool", "tool_2")),
        joint("j1", "base", "one"),
        joint("f1", "one", "flange", "fixed"),
        joint("f2", "one", "camera", "fixed"),
        joint("f3", "flange", "tool", "fixed"),
        joint("f4", "flange", "tool_2", "fixed"),
    )
    imported = import_model(model_file(text))
    assert "the tool stands at 'tool'; as far out: 'tool_2'" in imported.remarks
    assert imported.database.inertias[0].mass == 5.0


def test_limits_as_urdf_reads_them(model_file: Writer) -> None:
    text = urdf(
        *(link(name) for name in "abcde"),
        joint("turns", "a", "b", "continuous", '<limit velocity="2" effort="0"/>'),
        joint("stuck", "b", "c", "revolute", '<limit velocity="0" effort="1e308"/>'),
        joint("bare", "c", "d", "revolute", "<limit/>").replace("<limit/>", ""),
        joint("off", "d", "e", "revolute", '<limit lower="1" upper="3" velocity="1" effort="1"/>'),
    )
    imported = import_model(model_file(text))
    limits = [(j.lower, j.upper, j.velocity, j.effort, j.home) for j in imported.database.joints]
    endless = math.inf
    assert limits == [
        (-endless, endless, 2.0, endless, 0.0),
        (0.0, 0.0, endless, endless, 0.0),
        (-endless, endless, endless, endless, 0.0),
        (1.0, 3.0, 1.0, 1.0, 2.0),
    ]
    text = "\n".join(imported.remarks)
    assert "the effort limit of joint 'turns' is 0" in text
    assert "the velocity limit of joint 'stuck' is 0" in text
    assert "joint 'stuck' cannot move" in text
    assert "joint 'bare' is revolute without <limit>" in text


def test_what_urdf_says_beyond_a_database_is_listed(model_file: Writer) -> None:
    text = urdf(
        link("a").replace("</link>", "<visual/><collision/><contact/></link>"),
        link("b"),
        joint(
            "j", "a", "b", more='<safety_controller k_velocity="1"/><calibration/><dynamics damping="1" armature="2"/>'
        ),
        '<transmission name="t"/><gazebo/><mujoco/><material name="grey"/>',
    )
    imported = import_model(model_file(text))
    text = "\n".join(imported.remarks)
    for said in (
        "1 <visual> shapes", "1 <collision> shapes", "<contact> in <link>", "<safety_controller> of 1 joint",
        "<calibration> of 1 joint", "transmissions are left out: t", "<gazebo>", "<mujoco> in <robot>",
        "attribute 'armature' of <dynamics>", "URDF has no gravity", "joint_1 = j",
    ):  # fmt: skip
        assert said in text
    assert "grey" not in text


def test_massless_frames_are_no_reason_to_warn(model_file: Writer) -> None:
    text = urdf(link("a"), link("b"), '<link name="tool0"/>', joint("j", "a", "b"), joint("f", "b", "tool0", "fixed"))
    assert import_model(model_file(text)).database.inertia_check == "error"


def test_an_arm_without_mass_is_kept_with_a_warning_or_repaired(model_file: Writer) -> None:
    path = model_file(urdf(link("a"), '<link name="b"/>', link("c"), joint("j", "a", "b"), joint("k", "b", "c")))
    kept, mended = import_model(path), import_model(path, repair=True)
    assert kept.database.inertia_check == "warn"
    assert kept.database.inertias[0].mass == 0.0
    assert any(remark.startswith("arm_1 (b): it has no mass; kept") for remark in kept.remarks)
    assert mended.database.inertia_check == "error"
    assert mended.database.inertias[0].mass > 0.0


def test_the_source_names_the_file_and_nothing_of_the_machine(model_file: Writer) -> None:
    path = model_file(GRIPPER, "my robot.urdf")
    database = import_model(path, "hand").database
    assert database.source.startswith("URDF file my robot.urdf, SHA-256 ")
    assert str(path.parent) not in database.source + "".join(database.remarks)


@pytest.mark.parametrize(("name", "expected"), [("", "model"), ("2nd arm", "robot_2nd_arm"), ("é!", "robot")])
def test_names_are_safe(name: str, expected: str, model_file: Writer) -> None:
    assert import_model(model_file(GRIPPER.replace("a robot", name)), "hand").database.name == expected
