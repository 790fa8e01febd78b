"""Exudyn: a readable script with a kinematic tree, its drives as second-order coordinates beside it, run by RK4."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from importlib.metadata import version as version_of
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ..core.errors import RefusedError
from ..core.rendering import render
from ..core.representation import Pose, Robot, Stage
from ..core.simulation.backend import Backend, Emission, Engine, MachineState, Program, Vector
from ..core.simulation.drive_sheet import DriveSheet
from ..core.simulation.imposed import CORRECTION_TIME, rigid_joint_torques
from .common import Fate, concepts_of, header_lines
from .script import literal, run_script, script_values

if TYPE_CHECKING:
    from ..core.motion import MotionLaw
    from ..core.simulation.drives import Drives

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

    def version(self) -> str:
        """Version of Exudyn, from its metadata."""
        return version_of("exudyn")

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """A joint that moves nothing has no equation of motion."""
        return motionless(robot)

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
            correction_time=CORRECTION_TIME,
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
        return ExudynEngine(run_script(emission.files[emission.main], emission.main))


def motionless(robot: Robot) -> str | None:
    """Joints that would turn or shift no inertia at all, by name; None where there are none."""
    behind = 0.0
    for stage in reversed(robot.stages):
        body = stage.arm.inertia
        behind += body.mass + body.xx + body.yy + body.zz
        if behind == 0.0 and (stage.drive.inertia == 0.0 or stage.drive.spring is not None):
            return f"{stage.joint.name} moves no mass: {stage.arm.name} and what follows it have mass 0."
    return None


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


class ExudynEngine(Engine):
    """The model that the emitted script builds, stepped by Exudyn's explicit solver.

    Exudyn holds three models of the robot: its arms alone for statics, and, made when first needed, one whose motor
    sides move by torque and one whose motor sides follow a motion.
    """

    def __init__(self, script: dict[str, Any]) -> None:
        """Take the names that the script defines."""
        from ..core.simulation.drives import Drives

        self._script = script
        sheet = DriveSheet.from_data(script["DRIVES"])
        self.n = len(sheet.drives)
        self._elastic = np.array(sheet.elastic())
        self._rigid = ~self._elastic
        self._arms = script["build"]("none")
        self._motor: list[int] = script["motor_coordinates"](True)
        self._drives = Drives(sheet)
        self._models: dict[bool, _Driven] = {}
        self._running: _Driven | None = None
        self._law: MotionLaw | None = None
        self._t = 0.0

    def tool_in_base(self, q: Vector) -> Vector:
        """From sensors on the last link."""
        return self._script["tool_in_base"](self._arms, q)

    def mass_matrix(self, q: Vector) -> Vector:
        """From the solver's system mass matrix."""
        return self._script["mass_matrix_and_bias"](self._arms, q, np.zeros(self.n))[0]

    def bias(self, q: Vector, dq: Vector) -> Vector:
        """From the right-hand side of the equations of motion."""
        return self._script["mass_matrix_and_bias"](self._arms, q, dq)[1]

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """Mass matrix times acceleration, and bias."""
        mass, bias = self._script["mass_matrix_and_bias"](self._arms, q, dq)
        return mass @ ddq + bias

    def motor_inertia(self) -> Vector:
        """The mass matrix with the drives, less that of the arms."""
        driven = self._driven(imposed=False)
        with self._aside(driven):
            zeros = np.zeros(len(driven.model.x))
            both, _ = self._script["mass_matrix_and_bias"](driven.model, zeros, zeros)
        arms = self.mass_matrix(np.zeros(self.n))
        return np.diag(both)[self._motor] - np.where(self._elastic, 0.0, np.diag(arms))

    def drive_torque(self, q: Vector, dq: Vector, theta: Vector, dtheta: Vector) -> tuple[Vector, Vector]:
        """The right-hand side of the equations of motion with the drives, less that of the arms."""
        driven = self._driven(imposed=False)
        with self._aside(driven):
            driven.hold(np.zeros(self.n))
            self._drives.reset(MachineState(0.0, q, dq, theta, dtheta))
            x, v = self._coordinates(driven, q, dq, theta, dtheta)
            _, against = self._script["mass_matrix_and_bias"](driven.model, x, v)
            self._drives.evaluate(0.0, q, dq, theta, dtheta)
            friction = self._drives.friction.copy()
        total = -against
        total[: self.n] += self.bias(q, dq)
        # at a rigid joint both act on one coordinate
        on_arm = total[: self.n] + np.where(self._elastic, 0.0, friction)
        return on_arm, np.where(self._elastic, total[self._motor], -friction)

    def reset(self, state: MachineState, imposed: MotionLaw | None) -> None:
        """Coordinates and speeds of the model."""
        self._law, self._t = imposed, state.t
        self._drives.reset(state)
        self._running = None
        if imposed is None or self._elastic.any():
            driven = self._running = self._driven(imposed=imposed is not None)
            driven.stage.impose(imposed)
            driven.hold(np.zeros(self.n))
            x, v = self._coordinates(driven, state.q, state.dq, state.theta, state.dtheta)
            self._script["place"](driven.model, state.t, x, v)

    def hold(self, torque: Vector) -> None:
        """Into the force vector of the drives' object, or kept for the drives' equations."""
        if self._running is not None:
            self._running.hold(torque)

    def advance(self, duration: float, steps: int) -> None:
        """Steps of RK44."""
        if self._running is not None:
            try:
                self._script["advance"](self._running.model, self._t, duration, steps)
            except RuntimeError as error:
                raise RefusedError(str(error)) from error
        self._t += duration
        if self._running is None:
            self._evaluate(accept=True)

    def state(self) -> MachineState:
        """Coordinates and speeds; where a motion is imposed, the motor sides are on it exactly."""
        q, dq, theta, dtheta, _ = self._now()
        return MachineState(self._t, q.copy(), dq.copy(), theta.copy(), dtheta.copy())

    def friction(self) -> Vector:
        """From the drives' equations at the state."""
        self._evaluate()
        return self._drives.friction.copy()

    def transmitted(self) -> Vector:
        """From the drives' equations at the state."""
        self._evaluate()
        return self._drives.transmitted.copy()

    def close(self) -> None:
        """Let Exudyn's containers go."""
        self._models.clear()
        self._running = None

    def _driven(self, *, imposed: bool) -> _Driven:
        if imposed not in self._models:
            self._models[imposed] = _Driven(self._script, self._drives, self._arms, imposed=imposed)
        return self._models[imposed]

    def _coordinates(
        self, driven: _Driven, q: Vector, dq: Vector, theta: Vector, dtheta: Vector
    ) -> tuple[Vector, Vector]:
        x, v = np.zeros(len(driven.model.x)), np.zeros(len(driven.model.x))
        if not driven.imposed:
            x[self._motor], v[self._motor] = theta, dtheta
        x[: self.n], v[: self.n] = q, dq
        return x, v

    @contextmanager
    def _aside(self, driven: _Driven) -> Generator[None]:
        """Ask a model something at another state, and leave everything as it was."""
        model, command, memory = driven.model, driven.stage.command.copy(), self._drives.numbers.copy()
        t, x, v = model.mbs.systemData.GetTime(), model.x.copy(), model.v.copy()
        yield
        self._drives.numbers[:] = memory
        driven.hold(command)
        self._script["place"](model, t, x, v)

    def _now(self) -> tuple[Vector, Vector, Vector, Vector, Vector]:
        """q, dq, theta, dtheta, and the imposed acceleration of the motor sides."""
        if self._law is None:
            model = self._driven(imposed=False).model
            x, v = model.x, model.v
            return x[: self.n], v[: self.n], x[self._motor], v[self._motor], np.zeros(self.n)
        theta, dtheta, ddtheta = self._law.at(self._t)
        if self._running is None:
            return theta, dtheta, theta, dtheta, ddtheta
        model = self._running.model
        q, dq = np.where(self._rigid, theta, model.x), np.where(self._rigid, dtheta, model.v)
        return q, dq, theta, dtheta, ddtheta

    def _evaluate(self, *, accept: bool = False) -> None:
        """The drives' equations at the accepted state."""
        drives = self._drives
        q, dq, theta, dtheta, ddtheta = self._now()
        if drives.needs_load:
            mass, bias = self._script["mass_matrix_and_bias"](self._arms, q, dq)
            if self._law is None:
                command = self._driven(imposed=False).stage.command
                drives.evaluate_loaded(self._t, q, dq, theta, dtheta, command, mass, bias)
            else:
                drives.evaluate(self._t, q, dq, theta, dtheta)
                driving = drives.transmitted + drives.on_arm
                torques = rigid_joint_torques(mass, bias, driving, self._rigid, ddtheta)
                drives.load[:] = np.where(self._rigid, torques - drives.on_arm, 0.0)
        drives.evaluate(self._t, q, dq, theta, dtheta, accept=accept)


class _Driven:
    """The model with its drives, whose motor sides are free or imposed.

    Attributes:
        imposed: Motor sides follow a motion.
        model: As the script built it.
        stage: The drives at each stage of the integrator.
        native: Exudyn does all the drives do, by matrices.
    """

    def __init__(self, script: dict[str, Any], drives: Drives, arms: Any, *, imposed: bool) -> None:
        from .exudyn_stage import Stage

        self._script, self._drives, self._arms = script, drives, arms
        self.imposed = imposed
        self.native = script["LINEAR"] and not imposed
        motors = "imposed" if imposed else "free"
        accepted = self._accepted if drives.remembers else None
        self.model = script["build"](motors) if self.native else script["build"](motors, self._force, accepted)
        self.stage = Stage(drives, self.model.x, self.model.v, script["FLYWHEEL"])
        self._out = self.stage.out
        self._loads = drives.needs_load and not imposed

    def hold(self, torque: Vector) -> None:
        self.stage.command[:] = torque
        if self.native:
            self._script["hold"](self.model, torque)

    def _force(self, mbs: Any, t: float, item: int, x: list[float], v: list[float]) -> Vector:
        """Torque on every coordinate; Exudyn asks at each stage."""
        if self._loads:
            self._solve_load(t)
        self.stage.evaluate(t, False)
        return self._out

    def _accepted(self, mbs: Any, t: float) -> bool:
        """What slips has slipped for good; Exudyn tells after each step."""
        if self._loads:
            self._solve_load(t)
        self.stage.evaluate(t, True)
        return True

    def _solve_load(self, t: float) -> None:
        """Torque that rigid joints pass, solved together with the accelerations."""
        self.stage.evaluate(t, False)
        drives = self._drives
        q, dq, theta, dtheta = (drives.q.copy(), drives.dq.copy(), drives.theta.copy(), drives.dtheta.copy())
        mass, bias = self._script["mass_matrix_and_bias"](self._arms, q, dq)
        drives.evaluate_loaded(t, q, dq, theta, dtheta, self.stage.command, mass, bias)
