"""URDF, run by Pinocchio: what the format cannot say stands in a sheet beside it and our run applies it."""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import TYPE_CHECKING, ClassVar, Literal

from ..core.representation import Robot
from ..core.simulation.backend import Backend, Emission, Program
from .common import Fate, concepts_of, sheet_name, sheet_text, weightless_motor
from .urdf_text import urdf_joint_type, urdf_text

if TYPE_CHECKING:
    from .pinocchio_engine import PinocchioEngine

_IN_SHEET = "in the .drives.json beside the model; our run applies it"
_FATES: dict[str, Fate] = {
    "gravity": ("impossible", _IN_SHEET),
    "base": ("exact", "fixed joint world_to_base"),
    "kinematics": ("exact", "origins of the joints; link frames are the joints' moving frames"),
    "corrections": ("exact", "in the joints' origins: they stand at their real places"),
    "inertia": ("exact", "inertial at the center of mass, tensor in the link's axes (rpy = 0)"),
    "shapes": ("exact", "visuals"),
    "tool": ("exact", "link tool, fixed to the last arm, without mass"),
    "joint.type": ("exact", "type, axis z"),
    "limits.position": ("exact", "limit lower, upper; our run does not enforce it"),
    "limits.velocity": ("exact", "limit velocity; our run does not enforce it"),
    "limits.effort": ("exact", "limit effort; our run does not enforce it"),
    "home": ("impossible", "in the .drives.json beside the model"),
    "rotor_inertia.inertia": ("impossible", "the format has no armature; " + _IN_SHEET),
    "dummy_inertia": ("impossible", "the format has no armature; " + _IN_SHEET),
    "joint_compliance.stiffness": ("impossible", "the format has no springs; " + _IN_SHEET),
    "joint_compliance.damping": ("impossible", "the format has no springs; " + _IN_SHEET),
    "backlash.gap": ("impossible", _IN_SHEET),
    "viscous_friction.coefficient": ("exact", "dynamics damping, on the motor side where the joint is elastic"),
    "friction.model": ("impossible", _IN_SHEET),
    "hysteresis": ("impossible", _IN_SHEET),
    "joint_spring": ("impossible", "the format has no springs; " + _IN_SHEET),
    "torque_constant.gain": ("impossible", _IN_SHEET),
    "torque_limit.torque": ("impossible", _IN_SHEET),
    "encoder_offset.offset": ("impossible", _IN_SHEET),
    "torque_offset.torque": ("impossible", _IN_SHEET),
    "delay": ("impossible", _IN_SHEET),
    "controller_gain": ("impossible", _IN_SHEET),
}


class UrdfBackend(Backend):
    """Pinocchio; its rigid bodies under the classical Runge-Kutta method."""

    name: ClassVar[str] = "urdf"
    engine: ClassVar[str] = "Pinocchio"
    integrator: ClassVar[str] = "RK4"
    order: ClassVar[int] = 4
    gate_class: ClassVar[Literal["A", "B"]] = "A"
    stable: ClassVar[float] = 2.7

    def version(self) -> str:
        """Version of the installed Pinocchio."""
        return version("pin")

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """An elastic joint moved by torque needs an inertia between torque and spring."""
        return weightless_motor(robot, program)

    def emit(self, robot: Robot, program: Program) -> Emission:
        """One URDF file and the sheet beside it."""
        main = f"{robot.name}.urdf"
        files = {main: urdf_text(robot), sheet_name(robot): sheet_text(robot)}
        return Emission(self.name, main, files, concepts_of(robot, lambda datum, i: _fate(robot, datum, i)))

    def load(self, emission: Emission) -> PinocchioEngine:
        """The file in Pinocchio.

        Raises:
            RefusedError: Pinocchio cannot read it.
        """
        from .pinocchio_engine import PinocchioEngine

        return PinocchioEngine(emission)


def _fate(robot: Robot, datum: str, i: int) -> Fate:
    if datum in _FATES:
        if datum == "corrections" and i == robot.n - 1:
            return "exact", "the flange: in the shapes"
        joint = robot.stages[i].joint
        one_sided = math.isinf(joint.lower) or math.isinf(joint.upper)
        if datum == "limits.position" and urdf_joint_type(joint) != "continuous" and one_sided:
            return "approximated", "the bound that is missing is written as 1e9"
        return _FATES[datum]
    kinds = {term.kind for term in robot.stages[i].drive.terms if term.effect == datum}
    if kinds == {"level"}:
        return "approximated", "dynamics friction: its level at rest, which few engines read; " + _IN_SHEET
    return "impossible", _IN_SHEET
