"""PyBullet: a URDF file and a readable script beside it that switches off what PyBullet adds and adds what it lacks."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version as version_of
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from ..core.rendering import render
from ..core.representation import Robot
from ..core.simulation.backend import Backend, Emission, Program
from ..core.simulation.imposed import imposed_acceleration, rigid_joint_torques
from .common import Fate, concepts_of, header_lines, weightless_motor
from .script import literal, motionless, script_values, sources
from .urdf_text import urdf_text, within_triangle

if TYPE_CHECKING:
    from .pybullet_engine import PybulletEngine

INTEGRATOR = "semi-implicit Euler, torques of the step's start"
# products of inertia about the joint from which rounding may break the symmetry by 1.1e-15 [kg m^2]
HEAVY = 2.0
# how near, relative, a body may come to the end of the triangle before rounding takes it there
FLAT = 1.0e-13
_IN_LAW = "DRIVES, the drives' equations at every step's start"
_IN_CONTROLLER = "CONTROL, in the script's controller"
_EXACT: Mapping[str, str] = {
    "gravity": "GRAVITY in the script",
    "base": "fixed joint world_to_base of the URDF",
    "kinematics": "origins of the URDF's joints",
    "corrections": "in the origins of the URDF's joints: they stand at their real places",
    "inertia": "inertials of the URDF, turned to the principal axes; of heavy and flat arms on a link of their own",
    "shapes": "visuals of the URDF",
    "tool": "link tool of the URDF, without mass",
    "joint.type": "type in the URDF, axis z",
    "limits.position": "limit in the URDF; the script switches it off",
    "limits.velocity": "limit in the URDF; the script switches it off",
    "limits.effort": "limit in the URDF; nothing enforces it",
    "home": "HOME in the script",
    "rotor_inertia.inertia": "DRIVES; the script solves for the accelerations and hands PyBullet what rotors leave",
    "dummy_inertia": "DRIVES; the script integrates the motor side beside PyBullet, by the same rule",
    "joint_compliance.stiffness": _IN_LAW,
    "joint_compliance.damping": _IN_LAW,
    "backlash.gap": _IN_LAW,
    "viscous_friction.coefficient": _IN_LAW + "; PyBullet's own damping is off",
    "friction.model": _IN_LAW,
    "hysteresis": _IN_LAW,
    "joint_spring": _IN_LAW,
    "torque_constant.gain": _IN_LAW,
    "torque_limit.torque": "DRIVES, in the script's controller",
    "encoder_offset.offset": _IN_CONTROLLER,
    "torque_offset.torque": "stands in CONTROL; the script reports no torque",
    "delay": _IN_CONTROLLER,
    "controller_gain": _IN_CONTROLLER,
}


class PybulletBackend(Backend):
    """A URDF file with a script that runs it; engine: PyBullet."""

    name: ClassVar[str] = "pybullet"
    engine: ClassVar[str] = "PyBullet"
    integrator: ClassVar[str] = INTEGRATOR
    order: ClassVar[int] = 1
    gate_class: ClassVar[Literal["A", "B"]] = "B"
    largest_step: ClassVar[float] = 1.0e-4
    # a spring and damper that act explicitly under semi-implicit Euler need h b / m + h^2 k / (2 m) < 2; critical
    # damping is the worst case, 2 (sqrt(2) - 1)
    stable: ClassVar[float] = 0.82
    scripted: ClassVar[bool] = True

    def version(self) -> str:
        """Version of PyBullet, from its metadata."""
        return version_of("pybullet")

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """Motors without weight, joints that move nothing, and bodies that PyBullet would make weightless."""
        return weightless_motor(robot, program) or motionless(robot) or _zeroed_inertia(robot)

    def emit(self, robot: Robot, program: Program) -> Emission:
        """The robot as URDF, and the script that runs it."""
        model, main = f"{robot.name}.urdf", f"{robot.name}_pybullet.py"
        script = render(
            "pybullet/arm.py.j2",
            header=header_lines(robot, f"the arms stand in {model}; this script holds the rest"),
            file=main,
            urdf=model,
            integrator=INTEGRATOR,
            imposed_text=sources(imposed_acceleration, rigid_joint_torques),
            gravity=literal(list(robot.gravity)),
            joints=literal([stage.joint.name for stage in robot.stages]),
            home=literal([stage.joint.home for stage in robot.stages]),
            **script_values(robot, program),
        )
        files = {main: script, model: urdf_text(robot, principal_axes=True, hung=_hung(robot))}
        return Emission(self.name, main, files, concepts_of(robot, _fate))

    def load(self, emission: Emission) -> PybulletEngine:
        """The script's own functions load the URDF."""
        from .pybullet_engine import PybulletEngine

        return PybulletEngine(emission)


def _fate(datum: str, i: int) -> Fate:
    return "exact", _EXACT.get(datum, "its law's text; " + _IN_LAW)


def _hung(robot: Robot) -> tuple[int, ...]:
    """Arms whose body must be a link of its own, fixed at its center of mass, for PyBullet's mass matrix.

    It moves each body's tensor to the joint, and refuses what then is not symmetric to 1.1e-15 kg m^2 or breaks the
    triangle: rounding does that to heavy bodies and to flat ones. A body at its own center is not moved.
    """
    stages: list[int] = []
    for i in range(robot.n):
        body = robot.inertia_in_joint(i)
        (a, b, c), pose = body.principal()
        x, y, z = np.abs(pose.rotation_matrix().T @ np.array(body.com))
        heavy = body.mass * max(x * y, y * z, z * x) > HEAVY
        flat = body.mass > 0.0 and a + b - c <= FLAT * (c + body.mass * float(x * x + y * y + z * z))
        if heavy or flat:
            stages.append(i)
    return tuple(stages)


def _zeroed_inertia(robot: Robot) -> str | None:
    """PyBullet sets an inertia whose principal moments break the triangle to zero, with a warning only."""
    for i, stage in enumerate(robot.stages):
        a, b, c = within_triangle(robot.inertia_in_joint(i).principal()[0])
        if a < 0.0 or c > a + b:
            return (
                f"{stage.arm.name} has principal moments {a!r}, {b!r}, {c!r} kg m^2, which no body has; PyBullet would "
                "take them all as zero."
            )
    return None
