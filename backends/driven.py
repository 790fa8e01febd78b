"""An engine whose drives follow the common equations: what it reports of them, and motion that needs no integration."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import RefusedError
from ..core.motion import evaluate
from ..core.simulation.backend import Engine, MachineState, Vector
from ..core.simulation.compiled import compile_text
from ..core.simulation.drive_sheet import DriveSheet
from ..core.simulation.drives import Drives
from ..core.simulation.imposed import rigid_joint_torques

if TYPE_CHECKING:
    from ..core.motion import MotionLaw, MotionTable


class DrivenEngine(Engine):
    """Engine that asks the common equations for its drives' torques.

    Where all joints are rigid and their motion is imposed, nothing is integrated: the state is the motion.
    """

    def __init__(self, sheet: DriveSheet) -> None:
        """Take the drives; what the loaded model says of them itself is written into their table by the engine."""
        self.n = len(sheet.drives)
        self.drives = Drives(sheet)
        self.elastic = self.drives.table.elastic.astype(bool)
        self.command: Vector = np.zeros(self.n)
        self._imposed: MotionLaw | None = None
        self._imposed_table: MotionTable | None = None
        self._motion_at = compile_text(evaluate.motion_at)
        self._kinematic = False
        self._t = 0.0
        # the state at this instant, where somebody has asked for it
        self._seen: MachineState | None = None
        self._evaluated = False

    def motor_inertia(self) -> Vector:
        """As the contract says."""
        return np.array(self.drives.table.inertia)

    def drive_torque(self, q: Vector, dq: Vector, theta: Vector, dtheta: Vector) -> tuple[Vector, Vector]:
        """As the contract says."""
        drives = self.drives
        before = drives.numbers.copy()
        drives.load[:] = 0.0
        drives.stick_anchor[:] = theta
        drives.slip_anchor[:] = np.repeat(theta, np.diff(drives.table.slip_first))
        drives.evaluate(self._t, q, dq, theta, dtheta)
        torques = drives.transmitted + drives.on_arm, -drives.friction - drives.reaction
        drives.numbers[:] = before
        return torques

    def reset(self, state: MachineState, imposed: MotionLaw | None) -> None:
        """As the contract says.

        Raises:
            RefusedError: An elastic joint without motor-side inertia shall be moved by torque.
        """
        if imposed is None and np.any(self.elastic & (self.drives.table.inertia == 0.0)):
            joint = self.drives.sheet.joints[int(np.argmax(self.elastic & (self.drives.table.inertia == 0.0)))]
            raise RefusedError(
                f"{joint} is elastic and its motor side has no inertia: only an imposed motion can move it."
            )
        self._imposed = imposed
        self._imposed_table = imposed.table() if imposed is not None else None
        self._kinematic = imposed is not None and not self.elastic.any()
        self._t = state.t
        self._evaluated = False
        self.command[:] = 0.0
        self.drives.reset(state)
        self._start(state)
        self._seen = None

    def hold(self, torque: Vector) -> None:
        """As the contract says."""
        self.command[:] = torque
        self._evaluated = False

    def advance(self, duration: float, steps: int) -> None:
        """As the contract says.

        Raises:
            RefusedError: The state is no longer finite.
        """
        self._evaluated = False
        if self._kinematic:
            if not self.drives.remembers:
                self._t += duration
                return
            begin = self._t
            for k in range(steps):
                self._t = begin + (k + 1) * duration / steps
                self._evaluate(accept=True)
            return
        self._integrate(duration, steps)
        self._t += duration
        self._seen = None

    def state(self) -> MachineState:
        """As the contract says."""
        if self._imposed is None:
            return self._integrated()
        theta, dtheta = np.empty(self.n), np.empty(self.n)
        self._motion_at(self._t, self._imposed_table, theta, dtheta, np.empty(self.n))
        if self._kinematic:
            return MachineState(self._t, theta, dtheta, theta.copy(), dtheta.copy())
        state = self._integrated()
        rigid = ~self.elastic
        state.q[rigid], state.dq[rigid] = theta[rigid], dtheta[rigid]
        state.theta, state.dtheta = theta, dtheta
        # the arrays handed out are the caller's to change
        self._seen = MachineState(self._t, state.q.copy(), state.dq.copy(), theta.copy(), dtheta.copy())
        return state

    def friction(self) -> Vector:
        """As the contract says."""
        if not self._evaluated:
            self._evaluate()
        return self.drives.friction.copy()

    def transmitted(self) -> Vector:
        """As the contract says."""
        if not self._evaluated:
            self._evaluate()
        return self.drives.transmitted.copy()

    def reaction(self) -> Vector:
        """As the contract says."""
        if not self._evaluated:
            self._evaluate()
        return self.drives.reaction.copy()

    def _evaluate(self, *, accept: bool = False) -> None:
        """The drives' torques at the state that is."""
        state = self._seen or self.state()
        drives = self.drives
        arguments = (self._t, state.q, state.dq, state.theta, state.dtheta)
        if drives.needs_load and self._imposed is None:
            mass_matrix, bias = self.mass_matrix(state.q), self.bias(state.q, state.dq)
            drives.evaluate_loaded(*arguments, self.command, mass_matrix, bias, accept=accept)
        else:
            if drives.needs_load:
                drives.load[:] = self._imposed_load(state)
            drives.evaluate(*arguments, accept=accept)
        self._evaluated = True

    def _imposed_load(self, state: MachineState) -> Vector:
        """Torque that rigid joints pass to the arms when their motion is imposed, shape (n,)."""
        assert self._imposed is not None
        on_arm, _ = self.drive_torque(state.q, state.dq, state.theta, state.dtheta)
        torque = rigid_joint_torques(
            self.mass_matrix(state.q),
            self.bias(state.q, state.dq),
            on_arm,
            ~self.elastic,
            self._imposed.at(self._t)[2],
        )
        return np.where(self.elastic, 0.0, torque - on_arm)

    def _not_finite(self, t: float) -> RefusedError:
        return RefusedError(
            f"the motion is no longer finite at t = {float(t)!r} s: take a smaller step or weaker gains."
        )

    @abstractmethod
    def _start(self, state: MachineState) -> None:
        """Put a state into the engine; the motion that is imposed, if any, is set."""

    @abstractmethod
    def _integrate(self, duration: float, steps: int) -> None:
        """Advance; the time is moved by who calls."""

    @abstractmethod
    def _integrated(self) -> MachineState:
        """The state that the engine has integrated; where motion is imposed, q and dq of elastic joints count."""
