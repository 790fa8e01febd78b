"""SDF, run by Drake."""

from __future__ import annotations

from importlib.metadata import version

from mbexport import Backend, Emission, Program, Robot, concepts_of
from mbexport.backends.common import sheet_name, sheet_text, weightless_motor

from .sdf import sdf_text

_SHEET = "drives.json beside the model; runs apply it"
_FATES = {
    "gravity": ("impossible", "a model has none, its world has; " + _SHEET),
    "base": ("exact", "pose of link base, welded to the world"),
    "kinematics": ("exact", "poses of the links"),
    "corrections": ("exact", "in the poses of the links: joints stand at their real places"),
    "inertia": ("exact", "inertial of the link"),
    "shapes": ("exact", "visuals of the link"),
    "tool": ("exact", "frame tool"),
    "joint.type": ("exact", "type of the joint, axis z"),
    "limits.position": ("exact", "limit of the axis; not enforced in a run"),
    "limits.velocity": ("exact", "limit of the axis; not enforced in a run"),
    "limits.effort": ("exact", "limit of the axis; not enforced in a run"),
    "home": ("impossible", _SHEET),
    "joint_spring": ("exact", "spring_stiffness and spring_reference of the axis, all springs of the joint as one"),
}
# what the format has for a rigid joint only
_RIGID = {
    "rotor_inertia.inertia": "drake:rotor_inertia of the joint",
    "viscous_friction.coefficient": "damping of the axis",
}


class DrakeBackend(Backend):
    """MultibodyPlant in continuous time, under Drake's Runge-Kutta method of order 5 with fixed steps."""

    name = "drake"
    engine = "Drake"
    integrator = "runge_kutta5, fixed steps"
    order = 5
    gate_class = "A"
    # on the imaginary axis, where springs without damping lie, the method of Dormand and Prince ends near 1
    stable = 1.0

    def version(self) -> str:
        """Version of the installed Drake."""
        return version("drake")

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """SDF has no arms without mass; an elastic joint moved by torque needs an inertia of its motor side."""
        for stage in robot.stages:
            if stage.arm.inertia.mass == 0.0:
                return (
                    f"{stage.arm.name} has no mass, and SDF has no such link; joint_compliance_6d and link_flexibility "
                    "make such arms."
                )
        return weightless_motor(robot, program)

    def emit(self, robot: Robot, program: Program) -> Emission:
        """One SDF file, and beside it the sheet with what it cannot say."""
        main = f"{robot.name}.sdf"

        def fate(datum: str, i: int) -> tuple[str, str]:
            drive = robot.stages[i].drive
            if datum in _RIGID and not drive.spring:
                return "exact", _RIGID[datum]
            kinds = {term.kind for term in drive.terms if term.effect == datum}
            if kinds == {"level"} and not drive.spring:
                return "approximated", "friction of the axis: its level at rest; " + _SHEET
            return _FATES.get(datum, ("impossible", _SHEET))

        files = {main: sdf_text(robot), sheet_name(robot): sheet_text(robot)}
        return Emission(self.name, main, files, concepts_of(robot, fate))

    def load(self, emission: Emission):
        """The file in Drake.

        Raises:
            RefusedError: Drake cannot read it.
        """
        from .engine import DrakeEngine

        return DrakeEngine(emission)
