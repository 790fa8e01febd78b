"""A robot as URDF text; the format of two backends."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from ..core.build import level_at_rest
from ..core.rendering import render
from ..core.representation import Inertia, Joint, Pose, Robot, Stage, Vector3
from .common import UNLIMITED, header_lines

BODY_SUFFIX = "_body"
# how far rounding may break the triangle of a flat body's moments, relative
FLAT = 1.0e-9


def urdf_text(robot: Robot, *, principal_axes: bool = False, frames: bool = True, hung: Collection[int] = ()) -> str:
    """A robot as URDF.

    The frame of link arm_i is joint i's moving frame, z along its axis; the joint's position is q_i.

    Args:
        robot: The robot.
        principal_axes: Turn the inertial frames to the principal axes, so that all products are 0 (some engines drop
            them or lose digits); else they are parallel to the link's frame, rpy = 0.
        frames: Add the links world (root), base (fixed to it at the base's pose) and tool, without mass; else base is
            the root, and whoever loads the file places it.
        hung: Stages (from 0) whose body hangs on a link without mass, as a link of its own at its principal axes.
    """
    stages = robot.stages
    links: list[dict[str, Any]] = [_frame("world"), _frame("base")] if frames else [_frame("base")]
    joints = [_fixed("world_to_base", "world", "base", robot.base)] if frames else []
    materials: dict[tuple[float, ...], str] = {}
    parent = "base"
    for i, stage in enumerate(stages):
        links.append(_link(robot, i, principal_axes, materials))
        joints.append(_joint(stage, parent, robot.joint_in_previous(i)))
        parent = stage.arm.name
        if i in hung:
            body, name = links[-1]["body"], parent + BODY_SUFFIX
            links[-1]["body"] = _body(Inertia(), Pose())
            links.append({"name": name, "body": {**body, **_origin(Pose())}, "shapes": []})
            place = {key: body[key] for key in ("xyz", "rpy")}
            joints.append({"name": f"{parent}_to_body", "type": "fixed", "parent": parent, "child": name, **place})
    if frames:
        links.append(_frame("tool"))
        joints.append(_fixed("arm_to_tool", parent, "tool", robot.tool_in_last_joint()))
    axes = "the principal axes (rpy)" if principal_axes else "the link's axes (rpy = 0)"
    header = header_lines(
        robot,
        "conventions: the frame of link arm_i is the moving frame of joint i at its real place (geometry corrections "
        "included), z along the axis",
        f"inertia: about the center of mass, in {axes}; products are elements of the tensor (minus the integral)",
        f"a limit of {UNLIMITED!r} stands where the format asks for one and the robot has none",
        "friction: Coulomb's level at rest; damping: viscous, on the motor side",
    )
    return render("urdf/robot.urdf.j2", name=robot.name, header=header, links=links, joints=joints)


def urdf_joint_type(joint: Joint) -> str:
    """The format's type of a joint; it knows no revolute joint without limits."""
    unlimited = math.isinf(joint.lower) and math.isinf(joint.upper)
    return "continuous" if joint.kind == "revolute" and unlimited else joint.kind


def _origin(pose: Pose) -> dict[str, Any]:
    return {"xyz": pose.xyz, "rpy": pose.rpy()}


def _body(inertia: Inertia, pose: Pose) -> dict[str, Any]:
    tensor = {name: getattr(inertia, name) for name in ("xx", "yy", "zz", "xy", "xz", "yz")}
    return {**_origin(pose), "mass": inertia.mass, **tensor}


def _frame(name: str) -> dict[str, Any]:
    # mass 0 is said, for some engines take a link without inertial as 1 kg
    return {"name": name, "body": _body(Inertia(), Pose()), "shapes": []}


def _fixed(name: str, parent: str, child: str, pose: Pose) -> dict[str, Any]:
    return {"name": name, "type": "fixed", "parent": parent, "child": child, **_origin(pose)}


def _link(robot: Robot, i: int, principal_axes: bool, materials: dict[tuple[float, ...], str]) -> dict[str, Any]:
    arm, inertia, arm_in_joint = robot.stages[i].arm, robot.inertia_in_joint(i), robot.arm_in_joint(i)
    if principal_axes:
        moments, pose = inertia.principal()
        body = _body(Inertia(inertia.mass, inertia.com, *within_triangle(moments)), pose)
    else:
        body = _body(inertia, Pose(inertia.com))
    shapes = [
        {
            "kind": shape.kind,
            "size": shape.size,
            "mesh": shape.mesh,
            "rgba": shape.rgba,
            "material": materials.setdefault(shape.rgba, f"colour_{len(materials) + 1}"),
            **_origin(arm_in_joint @ shape.in_arm),
        }
        for shape in arm.shapes
    ]
    return {"name": arm.name, "body": body, "shapes": shapes}


def within_triangle(moments: Vector3) -> Vector3:
    """Ascending principal moments of a flat or thin body, whose rounding no engine shall take for a broken triangle."""
    a, b, c = (0.0 if -FLAT * moments[2] <= moment < 0.0 else moment for moment in moments)
    return a, b, a + b if a + b < c <= (a + b) * (1.0 + FLAT) else c


def _joint(stage: Stage, parent: str, place: Pose) -> dict[str, Any]:
    joint, drive = stage.joint, stage.drive
    kind = urdf_joint_type(joint)
    values = {name: getattr(joint, name) for name in ("lower", "upper", "effort", "velocity")}
    if kind == "continuous":
        del values["lower"], values["upper"]
        if all(math.isinf(value) for value in values.values()):
            values = {}
    return {
        "name": joint.name,
        "type": kind,
        "parent": parent,
        "child": stage.arm.name,
        **_origin(place),
        "limit": {
            name: math.copysign(UNLIMITED, value) if math.isinf(value) else value for name, value in values.items()
        },
        "damping": drive.damping,
        "friction": level_at_rest(drive, 0.0),
    }
