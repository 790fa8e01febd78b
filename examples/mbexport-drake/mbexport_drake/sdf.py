"""A robot as SDF text."""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

from mbexport import Robot
from mbexport.backends.common import header_lines
from mbexport.core.build import level_at_rest
from mbexport.core.rendering import comment_line, number, numbers
from mbexport.core.representation import Pose, Shape, Stage

VERSION = "1.9"
DRAKE = "http://drake.mit.edu"


def sdf_text(robot: Robot) -> str:
    """A robot as one SDF model.

    The frame of link arm_i is joint i's moving frame, z along its axis; the joint's position is q_i. The link base is
    welded to the world, and the frame tool is fixed to the last arm.
    """
    Xml.register_namespace("drake", DRAKE)
    root = Xml.Element("sdf", version=VERSION)
    head = header_lines(
        robot,
        "conventions: the frame of link arm_i is the moving frame of joint i at its real place (geometry corrections "
        "included), z along the axis",
        "inertia: about the center of mass, in the axes of the link; products are the elements of the tensor",
        "link base is welded to the world: the mass that the format asks of it moves nothing",
    )
    root.append(Xml.Comment("\n" + "".join(f"  {comment_line(line)}\n" for line in head)))
    model = Xml.SubElement(root, "model", name=robot.name)
    base = Xml.SubElement(model, "link", name="base")
    _pose(base, robot.base)
    weld = Xml.SubElement(model, "joint", name="world_to_base", type="fixed")
    _texts(weld, parent="world", child="base")
    parent = "base"
    for i, stage in enumerate(robot.stages):
        _link(model, robot, i, parent)
        _joint(model, stage, parent)
        parent = stage.arm.name
    _pose(Xml.SubElement(model, "frame", name="tool", attached_to=parent), robot.tool_in_last_joint())
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _pose(element: Xml.Element, pose: Pose, **attributes: str) -> None:
    place = Xml.SubElement(element, "pose", attributes)
    place.text = numbers((*pose.xyz, *pose.rpy()))


def _texts(element: Xml.Element, **texts: str) -> None:
    for tag, text in texts.items():
        Xml.SubElement(element, tag).text = text


def _link(model: Xml.Element, robot: Robot, i: int, parent: str) -> None:
    arm, inertia, arm_in_joint = robot.stages[i].arm, robot.inertia_in_joint(i), robot.arm_in_joint(i)
    link = Xml.SubElement(model, "link", name=arm.name)
    _pose(link, robot.joint_in_previous(i), relative_to=parent)
    inertial = Xml.SubElement(link, "inertial")
    _pose(inertial, Pose(inertia.com))
    _texts(inertial, mass=number(inertia.mass))
    moments = {f"i{axes}": number(getattr(inertia, axes)) for axes in ("xx", "xy", "xz", "yy", "yz", "zz")}
    _texts(Xml.SubElement(inertial, "inertia"), **moments)
    for k, shape in enumerate(arm.shapes):
        visual = Xml.SubElement(link, "visual", name=f"{arm.name}_shape_{k + 1}")
        _pose(visual, arm_in_joint @ shape.in_arm)
        _geometry(Xml.SubElement(visual, "geometry"), shape)
        _texts(Xml.SubElement(visual, "material"), diffuse=numbers(shape.rgba))


def _geometry(geometry: Xml.Element, shape: Shape) -> None:
    element = Xml.SubElement(geometry, shape.kind)
    if shape.kind == "mesh":
        _texts(element, uri=shape.mesh, scale=numbers(shape.size))
    elif shape.kind == "box":
        _texts(element, size=numbers(shape.size))
    else:
        names = ("radius", "length")
        _texts(element, **{name: number(size) for name, size in zip(names, shape.size, strict=False)})


def _joint(model: Xml.Element, stage: Stage, parent: str) -> None:
    joint, drive = stage.joint, stage.drive
    element = Xml.SubElement(model, "joint", name=joint.name, type=joint.kind)
    _texts(element, parent=parent, child=stage.arm.name)
    axis = Xml.SubElement(element, "axis")
    _texts(axis, xyz="0 0 1")
    limits = {name: getattr(joint, name) for name in ("lower", "upper", "effort", "velocity")}
    finite = {name: number(value) for name, value in limits.items() if math.isfinite(value)}
    if finite:
        _texts(Xml.SubElement(axis, "limit"), **finite)
    springs = drive.arm_springs
    stiffness = sum(spring.stiffness for spring in springs)
    dynamics = {
        # where a spring lies between motor and arm, the motor's friction is no friction of the joint
        "damping": 0.0 if drive.spring else drive.damping,
        "friction": 0.0 if drive.spring else level_at_rest(drive, 0.0),
        "spring_stiffness": stiffness,
        "spring_reference": sum(s.stiffness * s.rest for s in springs) / stiffness if stiffness else 0.0,
    }
    if any(dynamics.values()):
        _texts(Xml.SubElement(axis, "dynamics"), **{name: number(value) for name, value in dynamics.items()})
    if drive.inertia and not drive.spring:
        _texts(element, **{f"{{{DRAKE}}}rotor_inertia": number(drive.inertia), f"{{{DRAKE}}}gear_ratio": "1.0"})
