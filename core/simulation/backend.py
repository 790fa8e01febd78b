"""The contract of a backend: from the neutral robot to text, and from that text to a running simulation.

A backend is a class named by an entry point of the group `mbexport.backends`. It must RUN WHAT IT EMITTED: `load` gets
the emitted files and nothing else.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from ..representation import Robot

if TYPE_CHECKING:
    from ..control import Control, PdTable
    from ..motion import MotionLaw
    from .timeline import Rows, Timeline

Vector = NDArray[np.float64]
Status = Literal["exact", "approximated", "impossible"]


@dataclass(frozen=True, slots=True)
class Concept:
    """How one datum of the robot fares in a format.

    Attributes:
        datum: What, e.g. "joint_compliance.stiffness", "inertia", "limits.effort".
        at: Where: "joint_2", "arm_1", "robot", "all joints".
        status: "exact"; "approximated" (how says the error); "impossible" (not in the file).
        how: Where it stands in the file, or what a run of ours does about it.
    """

    datum: str
    at: str
    status: Status
    how: str


@dataclass(frozen=True, slots=True)
class Program:
    """What an emitted script runs by itself, and in which way a run will use the model.

    Attributes:
        motion: Commanded joint motion.
        control: Controller; mode "motion" imposes the motion on the motor sides.
        duration: [s].
        step: Integration step of the script [s].
    """

    motion: MotionLaw
    control: Control
    duration: float
    step: float


@dataclass(frozen=True, slots=True)
class Emission:
    """What a backend emitted.

    Attributes:
        backend: Its name.
        main: Name of the file that a user opens.
        files: File name (relative, POSIX) to text.
        concepts: What became of every datum.
        packed: File name to bytes, for formats that are no text.
    """

    backend: str
    main: str
    files: Mapping[str, str]
    concepts: tuple[Concept, ...]
    packed: Mapping[str, bytes] = field(default_factory=dict[str, bytes])


@dataclass(slots=True)
class MachineState:
    """State of a running robot; arrays of shape (n,), rad or m and s.

    Attributes:
        t: Time [s].
        q, dq: Arm side.
        theta, dtheta: Motor side; equal to q, dq at rigid joints.
        slips: Where the slip elements of hysteresis are fixed, joint by joint, shape (s,); None: at theta, all unbent.
    """

    t: float
    q: Vector
    dq: Vector
    theta: Vector
    dtheta: Vector
    slips: Vector | None = None


class Engine(ABC):
    """A loaded model in its engine, ready to be asked and to be run.

    All frames are the representation's; positions and torques in the order of the joints, base to tool. Statics are
    of the arms alone, without the motor sides' inertia and the drives' torques.
    """

    n: int

    @abstractmethod
    def tool_in_base(self, q: Vector) -> Vector:
        """Pose of the tool centre point in the base, shape (4, 4)."""

    def tools_in_base(self, q: Vector) -> Vector:
        """`tool_in_base` of many positions, shape (m, 4, 4) at q (m, n)."""
        return np.array([self.tool_in_base(row) for row in q])

    @abstractmethod
    def mass_matrix(self, q: Vector) -> Vector:
        """Mass matrix of the arms, shape (n, n), without rotors."""

    @abstractmethod
    def bias(self, q: Vector, dq: Vector) -> Vector:
        """Torques that gravity, Coriolis and centrifugal forces ask of the joints, shape (n,)."""

    @abstractmethod
    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """Torques that the joints must give for a motion, shape (n,), without rotors."""

    def gravity(self, q: Vector) -> Vector:
        """Torques that hold the arms against gravity, shape (n,)."""
        return self.bias(q, np.zeros(self.n))

    @abstractmethod
    def motor_inertia(self) -> Vector:
        """Motor-side inertia as the loaded model has it, shape (n,) [kg m^2 or kg]."""

    @abstractmethod
    def drive_torque(self, q: Vector, dq: Vector, theta: Vector, dtheta: Vector) -> tuple[Vector, Vector]:
        """(torque on the arms, torque on the motor sides) at a state, by the loaded model's own numbers, shapes (n,).

        Springs, dampers and friction laws as a run of this engine applies them, friction from fresh anchors at
        theta; the command is zero. At rigid joints friction is in the second, and the first has what acts on the arm.
        """

    @abstractmethod
    def reset(self, state: MachineState, imposed: MotionLaw | None) -> None:
        """Start from a state: friction at zero force, hysteresis too but where the state has it bent; held torque zero.

        Args:
            state: Where everything is.
            imposed: Motion of the motor sides (mode motion); None: they move by torque.
        """

    @abstractmethod
    def hold(self, torque: Vector) -> None:
        """Motor torques from now on [N m or N], before the drives' gain, shape (n,)."""

    @abstractmethod
    def advance(self, duration: float, steps: int) -> None:
        """Integrate over a duration [s] in that many equal steps of the native integrator."""

    @abstractmethod
    def state(self) -> MachineState:
        """Where everything is now; the arrays are the caller's."""

    @abstractmethod
    def friction(self) -> Vector:
        """Friction torque of the motor sides now, positive against positive speed, shape (n,)."""

    @abstractmethod
    def transmitted(self) -> Vector:
        """Torque T that elastic joints pass to the arms now, shape (n,); 0 at rigid joints."""

    def reaction(self) -> Vector:
        """What T is on the motor sides: (1 + de/dtheta) T where a gear's transmission error is e, shape (n,)."""
        return self.transmitted()

    def follow(self, timeline: Timeline, law: PdTable, offsets: Vector, rows: Rows) -> bool:
        """Go through a part of a controlled run at once, in compiled code that leaves Python to others meanwhile.

        As a run does it step by step: advance to each instant; at a tick the law sees the motors' positions, with the
        encoders' offsets, and their speeds; at a switch its torque is held; at a row the state and the held torque are
        recorded.

        Args:
            timeline: The instants.
            law: Of the controller; its torques are written.
            offsets: Of the encoders, shape (n,).
            rows: Where the record goes.

        Returns:
            False, and nothing has happened, where this engine does not: the run goes step by step then.
        """
        del timeline, law, offsets, rows
        return False

    def close(self) -> None:
        """Give back what the engine holds."""
        return


class Backend(ABC):
    """One format and the engine that runs it.

    Attributes:
        name: One name everywhere: entry point, --to, --backend, JSON.
        engine: Name of the engine.
        integrator: Native integrator that runs use, in words.
        order: Its order of convergence.
        gate_class: "A" (RK4, second-order implicit, adaptive) or "B" (first order); decides the gates of agreement.
        largest_step: Longest step it takes where nothing is stiff [s].
        stable: Largest step times eigenvalue at which the integrator is stable.
        scripted: What it emits runs a program by itself.
        runs: It has an engine here; a format for engines elsewhere is emitted only.
        compiles: Its emission waits for a compiler, so that it is begun before those of others.
        threads: Several of its engines may run at a time, each in a thread of its own.
    """

    name: ClassVar[str]
    engine: ClassVar[str]
    integrator: ClassVar[str]
    order: ClassVar[int]
    gate_class: ClassVar[Literal["A", "B"]]
    largest_step: ClassVar[float] = 1.0e-3
    stable: ClassVar[float] = 2.0
    scripted: ClassVar[bool] = False
    runs: ClassVar[bool] = True
    compiles: ClassVar[bool] = False
    threads: ClassVar[bool] = False

    @abstractmethod
    def version(self) -> str:
        """Version of the engine; may not import it where its metadata tells."""

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """Why this backend cannot run the robot so, by the effect's name; None where it can."""
        return None

    @abstractmethod
    def emit(self, robot: Robot, program: Program) -> Emission:
        """The model as text; the robot is not changed, and the same robot gives the same bytes.

        Raises:
            RefusedError: The format can say nothing useful of this robot.
        """

    def begin(self, robot: Robot, program: Program) -> Callable[[], Emission]:
        """`emit` in two parts: what is called then gives the emission, once a compiler is through.

        Raises:
            RefusedError: As `emit`.
        """
        emission = self.emit(robot, program)
        return lambda: emission

    @abstractmethod
    def load(self, emission: Emission) -> Engine:
        """The emitted text in the engine."""

    def engine_for(self, robot: Robot, program: Program) -> Engine:
        """Emit and load.

        Raises:
            RefusedError: The backend refuses this robot or this way of running it.
        """
        self.insist_on(robot, program)
        return self.load(self.emit(robot, program))

    def insist_on(self, robot: Robot, program: Program | None) -> None:
        """Nothing, where the backend can run the robot so.

        Raises:
            RefusedError: The backend refuses this robot or this way of running it.
        """
        reason = self.refusal(robot, program)
        if reason is not None:
            raise RefusedError(f"{self.name} ({self.engine}) refuses {robot.name}: {reason}")
