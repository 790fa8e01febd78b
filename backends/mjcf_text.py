"""A robot as MJCF text: an elastic joint is two hinges on one body, which is exact and needs no dummy mass."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from ..core.build import level_at_rest
from ..core.rendering import number, numbers, render
from ..core.representation import ArmSpring, Inertia, Pose, Robot, Stage
from .common import UNLIMITED, header_lines

MOTOR_SUFFIX = "_motor"
ARM_SPRING_SUFFIX = "_arm_spring"
# MuJoCo's friction is a soft constraint; these come within 1e-3 of the law, its defaults do not
_FRICTION_SOLVER = {"solreffriction": "0.002 1", "solimpfriction": "0.99 0.999 0.0001"}
# A flat body's moments meet a + b = c; their last digits may break it, and MuJoCo refuses that
_ROUNDING = 1.0e-12
# joints that MuJoCo takes on one body
_MOST_JOINTS = 6
# MuJoCo wants more than 1e-15 of what moves, kg and kg m^2
CARRIER = Inertia(1.0e-14, (0.0, 0.0, 0.0), 1.0e-14, 1.0e-14, 1.0e-14)


def mjcf_text(robot: Robot, step: float) -> str:
    """A robot as MJCF.

    The frame of body arm_i is joint i's moving frame, z along its axis. A rigid joint is one hinge (or slide)
    joint_i. An elastic one is two on the same body: joint_i_motor is theta_i, joint_i the deflection q_i - theta_i.

    Args:
        robot: The robot.
        step: Time step that stands in the file [s].
    """
    meshes: dict[tuple[str, tuple[float, ...]], str] = {}
    bodies = _bodies(robot, meshes)
    stages = robot.stages
    header = header_lines(
        robot,
        "conventions: the frame of body arm_i is the moving frame of joint i at its real place (geometry corrections "
        "included), z along the axis; angle radian; quat w x y z",
        "inertia: about the center of mass, principal moments and their axes",
        "elastic joint: two joints on one body, joint_i_motor is the motor side theta, joint_i the deflection "
        "q - theta; armature is the motor side's inertia",
        "frictionloss: friction's level at rest, a soft approximation; the laws stand in the .drives.json beside this "
        "file",
    )
    return render(
        "mjcf/robot.xml.j2",
        name=robot.name,
        header=header,
        step=step,
        gravity=robot.gravity,
        base=_place(robot.base),
        bodies=bodies,
        tool=_place(robot.tool_in_last_joint()),
        meshes=[{"name": name, "file": file, "scale": scale} for (file, scale), name in meshes.items()],
        tendons=[_arm_spring(stage) for stage in stages if stage.drive.spring and stage.drive.arm_springs],
        motors=[_motor(stage) for stage in stages if not stage.drive.passive],
        sensed=[str(joint["name"]) for body in bodies for joint in body["joints"]],
        home=[x for stage in stages for x in ((stage.joint.home, 0.0) if stage.drive.spring else (stage.joint.home,))],
    )


def total_arm_spring(springs: tuple[ArmSpring, ...]) -> ArmSpring:
    """The one spring that pulls as several on the same joint."""
    stiffness = sum(spring.stiffness for spring in springs)
    moment = sum(spring.stiffness * spring.rest for spring in springs)
    return ArmSpring(stiffness, moment / stiffness if stiffness else 0.0)


def _place(pose: Pose) -> dict[str, Any]:
    return {"xyz": pose.xyz, "quat": pose.quaternion()}


def carriers(robot: Robot) -> tuple[int, ...]:
    """Arms (from 0) without inertia that get a body all the same: too many joints for one would come together."""
    found: list[int] = []
    joints = 0
    for i, (stage, following) in enumerate(pairwise(robot.stages)):
        joints += len(_joints(stage))
        if stage.arm.inertia != Inertia():
            joints = 0
        elif joints + len(_joints(following)) > _MOST_JOINTS:
            found.append(i)
            joints = 0
    return tuple(found)


def _bodies(robot: Robot, meshes: dict[tuple[str, tuple[float, ...]], str]) -> list[dict[str, Any]]:
    """One body an arm; joints of arms without any inertia, which MuJoCo refuses, go to the next body that has some.

    Joints of one body act one after another, each in the frame that those before it have moved: the same chain. Where
    they would be more than MuJoCo takes, a carrier in between gets an inertia that no digit of the arms' shows.
    """
    carrying = carriers(robot)
    bodies: list[dict[str, Any]] = []
    place = Pose()
    joints: list[tuple[dict[str, str], Pose]] = []
    geoms: list[dict[str, str]] = []
    for i, stage in enumerate(robot.stages):
        step = robot.joint_in_previous(i)
        place = place @ step
        joints = [(joint, step.inverse() @ pose) for joint, pose in joints]
        joints += [(joint, Pose()) for joint in _joints(stage)]
        geoms += _geoms(robot, i, meshes)
        inertia = robot.inertia_in_joint(i)
        if stage.arm.inertia == Inertia() and i < robot.n - 1:
            if i not in carrying:
                continue
            inertia = CARRIER
        bodies.append(
            {
                "name": stage.arm.name,
                **_place(place),
                "inertial": _inertial(inertia),
                "joints": [joint | _axis(pose) for joint, pose in joints],
                "geoms": geoms,
            }
        )
        place, joints, geoms = Pose(), [], []
    return bodies


def _axis(pose: Pose) -> dict[str, str]:
    if pose == Pose():
        return {}
    return {"pos": numbers(pose.xyz), "axis": numbers(row[2] for row in pose.rotation)}


def _geoms(robot: Robot, i: int, meshes: dict[tuple[str, tuple[float, ...]], str]) -> list[dict[str, str]]:
    arm_in_joint = robot.arm_in_joint(i)
    geoms: list[dict[str, str]] = []
    for shape in robot.stages[i].arm.shapes:
        pose = arm_in_joint @ shape.in_arm
        if shape.kind == "mesh":
            name = meshes.setdefault((shape.mesh, shape.size), f"mesh_{len(meshes) + 1}")
            form = {"type": "mesh", "mesh": name}
        else:
            # half of every length, but radii whole
            factor = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 0.5), "sphere": (1.0,)}[shape.kind]
            form = {"type": shape.kind, "size": numbers(f * x for f, x in zip(factor, shape.size, strict=True))}
        geoms.append(form | {"pos": numbers(pose.xyz), "quat": numbers(pose.quaternion()), "rgba": numbers(shape.rgba)})
    return geoms


def _inertial(inertia: Inertia) -> dict[str, Any]:
    (a, b, c), pose = inertia.principal()
    if a + b < c <= (a + b) * (1.0 + _ROUNDING):
        c = a + b
    return {**_place(pose), "mass": inertia.mass, "moments": (a, b, c)}


def _joints(stage: Stage) -> list[dict[str, str]]:
    joint, drive = stage.joint, stage.drive
    kind = "hinge" if joint.kind == "revolute" else "slide"
    motor = {"name": joint.name, "type": kind, "armature": number(drive.inertia), "damping": number(drive.damping)}
    if has_range(stage):
        motor["range"] = numbers(min(max(x, -UNLIMITED), UNLIMITED) for x in (joint.lower, joint.upper))
    if math.isfinite(joint.effort) and joint.effort > 0.0:
        motor["actuatorfrcrange"] = numbers((-joint.effort, joint.effort))
    level = level_at_rest(drive, 0.0)
    if level > 0.0:
        motor |= {"frictionloss": number(level), **_FRICTION_SOLVER}
    if drive.spring is None:
        if drive.arm_springs:
            spring = total_arm_spring(drive.arm_springs)
            motor |= {"stiffness": number(spring.stiffness), "springref": number(spring.rest)}
        return [motor]
    deflection = {
        "name": joint.name,
        "type": kind,
        "stiffness": number(drive.spring.stiffness),
        "damping": number(drive.spring.damping),
    }
    return [motor | {"name": joint.name + MOTOR_SUFFIX}, deflection]


def has_range(stage: Stage) -> bool:
    """Whether the joint has limits of position that the format can say."""
    joint = stage.joint
    return joint.lower < joint.upper and not (math.isinf(joint.lower) and math.isinf(joint.upper))


def _arm_spring(stage: Stage) -> dict[str, Any]:
    """A fixed tendon over q = theta + deflection; its sign keeps the rest length above 0, for -1 means "automatic"."""
    spring = total_arm_spring(stage.drive.arm_springs)
    sign = -1.0 if spring.rest < 0.0 else 1.0
    name = stage.joint.name
    return {
        "name": name + ARM_SPRING_SUFFIX,
        "stiffness": spring.stiffness,
        "length": sign * spring.rest,
        "sign": sign,
        "joints": (name + MOTOR_SUFFIX, name),
    }


def _motor(stage: Stage) -> dict[str, str]:
    name = stage.joint.name
    motor = {"name": name, "joint": name + MOTOR_SUFFIX if stage.drive.spring else name}
    motor["gear"] = number(stage.drive.gain)
    if math.isfinite(stage.drive.torque_limit) and stage.drive.torque_limit > 0.0:
        motor["ctrlrange"] = numbers((-stage.drive.torque_limit, stage.drive.torque_limit))
    return motor
