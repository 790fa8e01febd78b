"""The drives of a loaded model while it runs: arrays, memory of friction, and the compiled equations."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from .backend import MachineState, Vector
from .compiled import (
    compiled_coordinate_torques,
    compiled_loaded_torques,
    compiled_torques,
    law_address,
    uses_load,
)
from .drive_law import DriveTable, flat_memory, flat_sizes
from .drive_sheet import DriveSheet
from .drive_table import relax


class Drives:
    """What every engine asks for the joint torques that it does not have by itself.

    All arrays are views into two flat ones, so that a call of the compiled equations costs about a microsecond.

    Attributes:
        table: The drives as arrays.
        q, dq, theta, dtheta: State of the last evaluation, shape (n,).
        load: T of rigid joints, where laws need it: solved by `evaluate_loaded`, or set before `evaluate`, shape (n,).
        needs_load: Some law at a rigid joint needs it.
        transmitted: T of elastic joints at the last evaluated state, shape (n,).
        reaction: The same on the motor side.
        friction: Friction on the motor side, positive against positive speed.
        on_arm: Torque on the arm beside T.
        stick_anchor, slip_anchor: Memory of sticking friction and of slip elements.
        numbers, counts: The flat memory, for compiled callbacks of an engine.
    """

    def __init__(self, sheet: DriveSheet, *, native: Collection[str] = (), table: DriveTable | None = None) -> None:
        """Take the drives of a sheet, less what the engine does natively (see `DriveSheet.table`); or its table."""
        self.sheet = sheet
        table = sheet.table(law_address, native=native) if table is None else table
        n, m, s = len(table.inertia), len(table.kinds), len(table.slip_level)
        numbers, counts = flat_sizes(n, m, s)
        self.numbers = np.zeros(numbers)
        self.counts = np.zeros(counts, dtype=np.int64)
        self.counts[:3] = n, m, s
        self.memory = flat_memory(self.numbers, self.counts)
        self.table = self.memory.table
        for view, values in zip(self.table, table, strict=True):
            view[...] = values
        self.q: Vector = self.memory.q
        self.dq: Vector = self.memory.dq
        self.theta: Vector = self.memory.theta
        self.dtheta: Vector = self.memory.dtheta
        self.load: Vector = self.memory.load
        self.transmitted: Vector = self.memory.transmitted
        self.reaction: Vector = self.memory.reaction
        self.friction: Vector = self.memory.friction
        self.on_arm: Vector = self.memory.on_arm
        self.stick_anchor: Vector = self.memory.stick_anchor
        self.slip_anchor: Vector = self.memory.slip_anchor
        self.needs_load = any(
            uses_load(term.effect, term.law) for drive in sheet.drives if drive.spring is None for term in drive.terms
        )
        self._torques = compiled_torques()
        self._coordinate_torques = compiled_coordinate_torques()
        self._factor = np.zeros((n, n))
        self._ddq = np.zeros(n)

    @property
    def remembers(self) -> bool:
        """Friction has a state that moves with accepted steps."""
        return bool(self.table.stick_displacement.any()) or len(self.table.slip_level) > 0

    def reset(self, state: MachineState) -> None:
        """Friction at zero force at this state, and hysteresis but where the state says how it is bent."""
        self.theta[:] = state.theta
        self.dtheta[:] = state.dtheta
        relax(self.memory)
        if state.slips is not None:
            self.slip_anchor[:] = state.slips

    def evaluate(self, t: float, q: Vector, dq: Vector, theta: Vector, dtheta: Vector, *, accept: bool = False) -> None:
        """Torques at a state, into the arrays of this object; `accept` where the integrator has accepted it."""
        self._write(q, dq, theta, dtheta)
        self._torques(self.numbers, self.counts, t, accept)

    def evaluate_loaded(
        self,
        t: float,
        q: Vector,
        dq: Vector,
        theta: Vector,
        dtheta: Vector,
        command: Vector,
        mass_matrix: Vector,
        bias: Vector,
        *,
        accept: bool = False,
    ) -> None:
        """`evaluate` with the load of rigid joints solved together with the accelerations.

        Args:
            t: Time [s].
            q: Position of the arm side, shape (n,).
            dq: Its speed.
            theta: Position of the motor side.
            dtheta: Its speed.
            command: Motor torques before the drives' gain, shape (n,).
            mass_matrix: Of the arms, shape (n, n).
            bias: Gravity, Coriolis and centrifugal torques, shape (n,).
            accept: The integrator has accepted this state.
        """
        self._write(q, dq, theta, dtheta)
        compiled_loaded_torques()(
            self.numbers, self.counts, t, accept, command, mass_matrix, bias, self._factor, self._ddq
        )

    def coordinate_torques(
        self, t: float, x: Vector, v: Vector, command: Vector, out: Vector, accept: bool = False
    ) -> None:
        """Torques on coordinates (q, motor sides of elastic joints), see `drive_law.coordinate_torques`."""
        self._coordinate_torques(self.numbers, self.counts, t, x, v, command, out, accept)

    def motor_torque(self, command: Vector) -> Vector:
        """What accelerates the motor sides: gain tau - friction - (1 + de/dtheta) T, shape (n,)."""
        return self.table.gain * command - self.friction - self.reaction

    def _write(self, q: Vector, dq: Vector, theta: Vector, dtheta: Vector) -> None:
        self.q[:] = q
        self.dq[:] = dq
        self.theta[:] = theta
        self.dtheta[:] = dtheta
