"""MJCF, run by MuJoCo: an elastic joint is two hinges on one body, which is exact and needs no dummy mass."""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from ..core.build import level_at_rest
from ..core.rendering import number, numbers, render
from ..core.representation import ArmSpring, Inertia, Pose, Robot, Stage
from ..core.simulation.backend import Backend, Emission, Program
from .common import UNLIMITED, Fate, concepts_of, header_lines, sheet_name, sheet_text, weightless_motor

if TYPE_CHECKING:
    from .mujoco_engine import MujocoEngine

MOTOR_SUFFIX = "_motor"
ARM_SPRING_SUFFIX = "_arm_spring"
# MuJoCo's friction is a soft constraint; these come within 1e-3 of the law, its defaults do not
_FRICTION_SOLVER = {"solreffriction": "0.002 1", "solimpfriction": "0.99 0.999 0.0001"}
# A flat body's moments meet a + b = c; their last digits may break it, and MuJoCo refuses that
_ROUNDING = 1.0e-12

_IN_SHEET = "in the .drives.json beside the model; our run applies it"
_FATES: dict[str, Fate] = {
    "gravity": ("exact", "option gravity"),
    "base": ("exact", "body base"),
    "kinematics": ("exact", "pos and quat of the bodies, whose frames are the joints' moving frames"),
    "corrections": ("exact", "in the bodies' pos and quat: joints stand at their real places"),
    "inertia": ("exact", "inertial: principal moments (diaginertia) and axes (quat)"),
    "shapes": ("exact", "visual geoms without mass or contact"),
    "tool": ("exact", "site tool"),
    "joint.type": ("exact", "hinge or slide about or along the body's z"),
    "limits.position": ("exact", "range; our run switches it off"),
    "limits.velocity": (
        "impossible",
        "the format has no limit of speed; it stands in the .drives.json beside the model",
    ),
    "limits.effort": ("exact", "actuatorfrcrange; our run switches it off"),
    "home": ("exact", "key home"),
    "rotor_inertia.inertia": ("exact", "armature"),
    "dummy_inertia": ("exact", "armature"),
    "joint_compliance.stiffness": ("exact", "stiffness of the second hinge on the body, after the motor's"),
    "joint_compliance.damping": ("exact", "damping of the second hinge"),
    "backlash.gap": ("approximated", "the file's spring has no clearance; " + _IN_SHEET),
    "viscous_friction.coefficient": ("exact", "damping of the motor's hinge"),
    "friction.model": ("approximated", "frictionloss is a soft constraint and sticks in its own way; " + _IN_SHEET),
    "hysteresis": ("impossible", _IN_SHEET),
    "torque_constant.gain": ("exact", "gear of the motor"),
    "torque_limit.torque": ("exact", "ctrlrange of the motor"),
    "encoder_offset.offset": ("impossible", _IN_SHEET),
    "torque_offset.torque": ("impossible", _IN_SHEET),
    "delay": ("impossible", _IN_SHEET),
    "controller_gain": ("impossible", _IN_SHEET),
}


class MjcfBackend(Backend):
    """MuJoCo, integrator RK4; laws that it does not have act through a compiled callback at every stage."""

    name: ClassVar[str] = "mjcf"
    engine: ClassVar[str] = "MuJoCo"
    integrator: ClassVar[str] = "RK4"
    order: ClassVar[int] = 4
    gate_class: ClassVar[Literal["A", "B"]] = "A"
    stable: ClassVar[float] = 2.7

    def version(self) -> str:
        """Version of the installed MuJoCo."""
        return version("mujoco")

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """An elastic joint moved by torque needs an inertia between torque and spring."""
        return weightless_motor(robot, program)

    def emit(self, robot: Robot, program: Program) -> Emission:
        """One MJCF file and the sheet beside it."""
        main = f"{robot.name}.xml"
        files = {main: mjcf_text(robot, program.step), sheet_name(robot): sheet_text(robot)}
        return Emission(self.name, main, files, concepts_of(robot, lambda datum, i: _fate(robot, datum, i)))

    def load(self, emission: Emission) -> MujocoEngine:
        """The file in MuJoCo.

        Raises:
            RefusedError: MuJoCo cannot hold the model.
        """
        from .mujoco_engine import MujocoEngine

        return MujocoEngine(emission)


def mjcf_text(robot: Robot, step: float) -> str:
    """A robot as MJCF.

    The frame of body arm_i is joint i's moving frame, z along its axis. A rigid joint is one hinge (or slide)
    joint_i. An elastic one is two on the same body: joint_i_motor is theta_i, joint_i the deflection q_i - theta_i.

    Args:
        robot: The robot.
        step: Time step that stands in the file [s].
    """
    meshes: dict[tuple[str, tuple[float, ...]], str] = {}
    bodies = [_body(robot, i, meshes) for i in range(robot.n)]
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
        motors=[_motor(stage) for stage in stages],
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


def _body(robot: Robot, i: int, meshes: dict[tuple[str, tuple[float, ...]], str]) -> dict[str, Any]:
    stage, arm_in_joint = robot.stages[i], robot.arm_in_joint(i)
    geoms: list[dict[str, str]] = []
    for shape in stage.arm.shapes:
        pose = arm_in_joint @ shape.in_arm
        if shape.kind == "mesh":
            name = meshes.setdefault((shape.mesh, shape.size), f"mesh_{len(meshes) + 1}")
            form = {"type": "mesh", "mesh": name}
        else:
            # half of every length, but radii whole
            factor = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 0.5), "sphere": (1.0,)}[shape.kind]
            form = {"type": shape.kind, "size": numbers(f * x for f, x in zip(factor, shape.size, strict=True))}
        geoms.append(form | {"pos": numbers(pose.xyz), "quat": numbers(pose.quaternion()), "rgba": numbers(shape.rgba)})
    return {
        "name": stage.arm.name,
        **_place(robot.joint_in_previous(i)),
        "inertial": _inertial(robot.inertia_in_joint(i)),
        "joints": _joints(stage),
        "geoms": geoms,
    }


def _inertial(inertia: Inertia) -> dict[str, Any]:
    (a, b, c), pose = inertia.principal()
    if a + b < c <= (a + b) * (1.0 + _ROUNDING):
        c = a + b
    return {**_place(pose), "mass": inertia.mass, "moments": (a, b, c)}


def _joints(stage: Stage) -> list[dict[str, str]]:
    joint, drive = stage.joint, stage.drive
    kind = "hinge" if joint.kind == "revolute" else "slide"
    motor = {"name": joint.name, "type": kind, "armature": number(drive.inertia), "damping": number(drive.damping)}
    if _has_range(stage):
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


def _has_range(stage: Stage) -> bool:
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


def _fate(robot: Robot, datum: str, i: int) -> Fate:
    if datum in _FATES:
        refused = "the format asks for a range that is not empty; " + _IN_SHEET
        if datum == "limits.position" and not _has_range(robot.stages[i]):
            return "impossible", refused
        if datum == "limits.effort" and robot.stages[i].joint.effort <= 0.0:
            return "impossible", refused
        if datum == "torque_limit.torque" and robot.stages[i].drive.torque_limit <= 0.0:
            return "impossible", refused
        if datum == "corrections" and i == robot.n - 1:
            return "exact", "the flange: in the shapes"
        return _FATES[datum]
    drive = robot.stages[i].drive
    if datum == "joint_spring":
        if drive.spring:
            return "exact", "fixed tendon over the joint's two hinges: stiffness, springlength"
        return "exact", "stiffness and springref of the joint"
    kinds = {term.kind for term in drive.terms if term.effect == datum}
    if kinds == {"level"}:
        return "approximated", "frictionloss: its level at rest as a soft constraint; " + _IN_SHEET
    return "impossible", _IN_SHEET
