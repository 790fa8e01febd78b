"""MJCF, run by MuJoCo: an elastic joint is two hinges on one body, which is exact and needs no dummy mass."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, ClassVar, Literal

from ..core.representation import Robot
from ..core.simulation.backend import Backend, Emission, Program
from .common import Fate, concepts_of, sheet_name, sheet_text, weightless_motor
from .mjcf_text import CARRIER, carriers, has_range, mjcf_text

if TYPE_CHECKING:
    from .mujoco_engine import MujocoEngine

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
    threads: ClassVar[bool] = True

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


def _fate(robot: Robot, datum: str, i: int) -> Fate:
    if datum in _FATES:
        if datum == "inertia" and i in carriers(robot):
            return "approximated", f"{CARRIER.mass!r} kg for none, so that no body has more joints than MuJoCo takes"
        refused = "the format asks for a range that is not empty; " + _IN_SHEET
        if datum == "limits.position" and not has_range(robot.stages[i]):
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
