"""Exudyn: a readable script with a kinematic tree, its drives as second-order coordinates beside it, run by RK4."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version as version_of
from typing import Any, ClassVar, Literal

from ..core.rendering import render
from ..core.representation import Pose, Robot, Stage
from ..core.simulation.backend import Backend, Emission, Engine, Program
from ..core.simulation.imposed import imposed_acceleration
from .common import Fate, concepts_of, header_lines, weightless_motor
from .script import literal, motionless, run_script, script_values, sources

INTEGRATOR = "explicit Runge-Kutta of order 4 (RK44), drives evaluated at every stage"

_EXACT: Mapping[str, str] = {
    "gravity": "GRAVITY of the kinematic tree",
    "base": "BASE, folded into the first joint's frame",
    "kinematics": "position and rotation of the joints' frames in ARMS",
    "corrections": "in the joints' frames in ARMS",
    "inertia": "mass, center of mass and tensor about it in ARMS",
    "tool": "TOOL, read by sensors on the last link",
    "joint.type": "RevoluteZ or PrismaticZ",
    "limits.position": "stands in ARMS; nothing enforces it",
    "limits.velocity": "stands in ARMS; nothing enforces it",
    "limits.effort": "stands in ARMS; nothing enforces it",
    "home": "stands in ARMS",
    "rotor_inertia.inertia": "mass matrix of the drives' object",
    "dummy_inertia": "mass matrix of the drives' object",
    "joint_compliance.stiffness": "stiffness matrix of the drives' object, or the drives' equations at every stage",
    "joint_compliance.damping": "damping matrix of the drives' object, or the drives' equations at every stage",
    "viscous_friction.coefficient": "damping matrix of the drives' object, or the drives' equations at every stage",
    "joint_spring": "stiffness matrix of the drives' object, or the drives' equations at every stage",
    "backlash.gap": "the drives' equations at every stage",
    "hysteresis": "the drives' equations at every stage",
    "friction.model": "the drives' equations at every stage; what slips is kept after each step",
    "torque_constant.gain": "DRIVES, where the torque is handed to Exudyn",
    "torque_limit.torque": "DRIVES, in the script's controller",
    "encoder_offset.offset": "CONTROL, in the script's controller",
    "torque_offset.torque": "stands in CONTROL; the script reports no torque",
    "delay": "CONTROL, in the script's controller",
    "controller_gain": "CONTROL, in the script's controller",
}


class ExudynBackend(Backend):
    """A script that builds the robot in Exudyn and runs it; engine: Exudyn."""

    name: ClassVar[str] = "exudyn"
    engine: ClassVar[str] = "Exudyn"
    integrator: ClassVar[str] = INTEGRATOR
    order: ClassVar[int] = 4
    gate_class: ClassVar[Literal["A", "B"]] = "A"
    largest_step: ClassVar[float] = 1.0e-3
    # where the stability region of RK4 ends on the negative real axis
    stable: ClassVar[float] = 2.785
    scripted: ClassVar[bool] = True

    def version(self) -> str:
        """Version of Exudyn, from its metadata."""
        return version_of("exudyn")

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """Motors without weight, and joints that move nothing."""
        return weightless_motor(robot, program) or motionless(robot)

    def emit(self, robot: Robot, program: Program) -> Emission:
        """The robot as a script."""
        file = f"{robot.name}_exudyn.py"
        header = header_lines(
            robot,
            "conventions: frame i is the moving frame of joint i at its real place (geometry corrections included), z "
            "along its axis",
            "inertia: about the center of mass, axes of frame i; products are elements of the tensor (minus the "
            "integral)",
        )
        text = render(
            "exudyn/arm.py.j2",
            header=header,
            file=file,
            integrator=INTEGRATOR,
            imposed_text=sources(imposed_acceleration),
            gravity=literal(list(robot.gravity)),
            base=literal(robot.base.matrix().tolist()),
            tool=literal(robot.tool_in_last_joint().matrix().tolist()),
            arms=literal([_arm(robot, i, stage) for i, stage in enumerate(robot.stages)]),
            shapes=literal([_shapes(robot, i, stage) for i, stage in enumerate(robot.stages)]),
            **script_values(robot, program),
        )

        def answer(datum: str, i: int) -> Fate:
            if datum == "shapes":
                return _fate_of_shapes(robot.stages[i])
            return "exact", _EXACT.get(datum, "its law's text, in the drives' equations at every stage")

        return Emission(self.name, file, {file: text}, concepts_of(robot, answer))

    def load(self, emission: Emission) -> Engine:
        """The script's own functions build the model."""
        from .exudyn_engine import ExudynEngine

        return ExudynEngine(run_script(emission.files[emission.main], emission.main))


def _pose(pose: Pose) -> dict[str, Any]:
    return {"position": list(pose.xyz), "rotation": [list(row) for row in pose.rotation]}


def _arm(robot: Robot, i: int, stage: Stage) -> dict[str, Any]:
    body, joint = robot.inertia_in_joint(i), stage.joint
    return {
        "name": stage.arm.name,
        "joint": joint.name,
        "kind": joint.kind,
        **_pose(robot.joint_in_previous(i)),
        "mass": body.mass,
        "com": list(body.com),
        "inertia": body.tensor().tolist(),
        "home": joint.home,
        "limits": {name: getattr(joint, name) for name in ("lower", "upper", "velocity", "effort")},
    }


def _shapes(robot: Robot, i: int, stage: Stage) -> list[dict[str, Any]]:
    return [
        {
            "kind": shape.kind,
            "size": list(shape.size),
            **_pose(robot.arm_in_joint(i) @ shape.in_arm),
            "mesh": shape.mesh,
            "rgba": list(shape.rgba),
        }
        for shape in stage.arm.shapes
    ]


def _fate_of_shapes(stage: Stage) -> Fate:
    for shape in stage.arm.shapes:
        if shape.kind == "mesh" and not (shape.mesh.lower().endswith(".stl") and len(set(shape.size)) == 1):
            return "impossible", f"stands in SHAPES, but Exudyn draws STL files of one scale only, not {shape.mesh}"
    return "exact", "SHAPES, drawn with --view"
