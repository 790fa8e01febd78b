"""The drives of a loaded model while it runs: arrays, memory of friction, and the compiled equations."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from .backend import MachineState, Vector
from .compiled import compiled_loaded_torques, compiled_torques, law_address, uses_load
from .drive_sheet import DriveSheet


class Drives:
    """What every engine asks for the joint torques that it does not have by itself.

    Attributes:
        table: The drives as arrays.
        load: T of rigid joints, where laws need it: solved by `evaluate_loaded`, or set before `evaluate`, shape (n,).
        needs_load: Some law at a rigid joint needs it.
        transmitted: T of elastic joints at the last evaluated state, shape (n,).
        reaction: The same on the motor side.
        friction: Friction on the motor side, positive against positive speed.
        on_arm: Torque on the arm beside T.
        stick_anchor, slip_anchor: Memory of sticking friction and of slip elements.
    """

    def __init__(self, sheet: DriveSheet, *, native: Collection[str] = ()) -> None:
        """Take the drives of a sheet, less what the engine does natively (see `DriveSheet.table`)."""
        n = len(sheet.drives)
        self.sheet = sheet
        self.table = sheet.table(law_address, native=native)
        self.load = np.zeros(n)
        self.transmitted = np.zeros(n)
        self.reaction = np.zeros(n)
        self.friction = np.zeros(n)
        self.on_arm = np.zeros(n)
        self.stick_anchor = np.zeros(n)
        self.slip_anchor = np.zeros(len(self.table.slip_level))
        self.needs_load = any(
            uses_load(term.effect, term.law) for drive in sheet.drives if drive.spring is None for term in drive.terms
        )
        self._torques = compiled_torques()
        self._factor = np.zeros((n, n))
        self._ddq = np.zeros(n)

    def reset(self, state: MachineState) -> None:
        """Friction and hysteresis at zero force at this state."""
        table = self.table
        self.stick_anchor[:] = state.theta + table.stick_time * state.dtheta
        joint_of_slip = np.repeat(np.arange(len(state.theta)), np.diff(table.slip_first))
        self.slip_anchor[:] = state.theta[joint_of_slip]

    def evaluate(self, t: float, q: Vector, dq: Vector, theta: Vector, dtheta: Vector, *, accept: bool = False) -> None:
        """Torques at a state, into the arrays of this object; `accept` where the integrator has accepted it."""
        self._torques(
            self.table,
            self.stick_anchor,
            self.slip_anchor,
            t,
            q,
            dq,
            theta,
            dtheta,
            self.load,
            self.transmitted,
            self.reaction,
            self.friction,
            self.on_arm,
            accept,
        )

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
        compiled_loaded_torques()(
            self.table,
            self.stick_anchor,
            self.slip_anchor,
            t,
            q,
            dq,
            theta,
            dtheta,
            self.load,
            self.transmitted,
            self.reaction,
            self.friction,
            self.on_arm,
            accept,
            command,
            mass_matrix,
            bias,
            self._factor,
            self._ddq,
        )

    def motor_torque(self, command: Vector) -> Vector:
        """What accelerates the motor sides: gain tau - friction - (1 + de/dtheta) T, shape (n,)."""
        return self.table.gain * command - self.friction - self.reaction
