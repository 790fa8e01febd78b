"""One step of what PyBullet lacks, compiled: drives, rotors and motor sides, by semi-implicit Euler as its own.

This module imports Numba; import it only where something runs.
"""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.simulation import drive_law, imposed
from ..core.simulation.by_address import (
    ENGINE,
    IMPOSED,
    JOINTS,
    SIZE,
    Book,
    accelerate_elastic,
    drive_memory_at,
    evaluate_drives,
    evaluate_loaded_drives,
    floats,
    follow_acceleration,
    follow_motion,
    integers,
    motion_reference,
    source_stamp,
)
from ..core.simulation.compiled import as_it_stands

if TYPE_CHECKING:
    from ..core.motion import MotionLaw
    from ..core.simulation.backend import MachineState, Vector
    from ..core.simulation.drives import Drives

_numba: Any = import_module("numba")
_types: Any = _numba.types

(
    FREE,  # how many joints the motion does not impose
    ROTORS,  # 1 where rigid joints have inertia of their own
    LOADED,  # 1 where friction of rigid joints depends on the torque they pass
    Q,
    DQ,
    THETA,
    DTHETA,
    COMMAND,
    OUT,
    MASS,
    BIAS,
    ORDERED,  # free joints, then imposed ones
    FACTOR,
    VECTOR,
    ACCELERATION,
) = range(ENGINE, ENGINE + 15)

_acceleration: Any = imposed.imposed_acceleration
_factorised: Any = drive_law.factorised
_solved: Any = drive_law.solved
as_it_stands(_acceleration)


class DriveStep:
    """What a step of PyBullet needs beside it.

    Attributes:
        q, dq: Arm side at the step's start, shape (n,); written before each step.
        theta, dtheta: Motor side, shape (n,).
        command: Motor torques before the drives' gain, shape (n,).
        mass_matrix, bias: Of the arms, shapes (n, n) and (n,); written before each step that `needs_mass`.
        torque: Out: what PyBullet's arms get, shape (n,).
        needs_mass: Accelerations have to be solved for.
        constant: The drives pass the command on and do nothing else, so that no state is needed between steps.
    """

    def __init__(self, drives: Drives) -> None:
        """Take the drives."""
        n = len(drives.q)
        self._elastic = drives.table.elastic == 1
        self._rotors = bool(np.where(self._elastic, 0.0, drives.table.inertia).any())
        self._loaded = drives.needs_load
        self.q, self.dq, self.theta, self.dtheta, self.command, self.torque, self.bias = (np.zeros(n) for _ in range(7))
        self.mass_matrix: Vector = np.zeros((n, n))
        self.needs_mass = self.constant = False
        table = drives.table
        silent = (table.elastic, table.inertia, table.damping, table.arm_stiffness)
        self._silent = not any(values.any() for values in silent) and not len(table.kinds) and not len(table.slip_level)
        self._book = Book(drives)
        for place, array in (
            (Q, self.q),
            (DQ, self.dq),
            (THETA, self.theta),
            (DTHETA, self.dtheta),
            (COMMAND, self.command),
            (OUT, self.torque),
            (MASS, self.mass_matrix),
            (BIAS, self.bias),
            (ORDERED, np.argsort(~self._elastic, kind="stable").astype(np.int64)),
            (FACTOR, np.zeros(n * n)),
            (VECTOR, np.zeros(n)),
            (ACCELERATION, np.zeros(n)),
        ):
            self._book.put(place, array)
        self._address = self._book.address
        self._compiled = _compiled()

    def start(self, state: MachineState, motion: MotionLaw | None) -> None:
        """From a state, motor sides moved by torque or along a motion."""
        self.q[:], self.dq[:], self.theta[:], self.dtheta[:] = state.q, state.dq, state.theta, state.dtheta
        imposed_motion = motion is not None
        self._book.impose(motion)
        loaded = self._loaded and not imposed_motion
        rotors = self._rotors and not imposed_motion
        self._book.entries[[FREE, ROTORS, LOADED]] = int(self._elastic.sum()), rotors, loaded
        self.constant = self._silent and not imposed_motion
        self.needs_mass = rotors or loaded or (imposed_motion and not bool(self._elastic.all()))

    def step(self, t: float, h: float) -> None:
        """Torques at time t [s], and the motor sides a step h [s] later."""
        self._compiled(self._address, t, h)


@cache
def _compiled() -> Any:
    stamp = source_stamp(sys.modules[__name__], imposed)

    def step(address: int, t: float, h: float) -> None:
        book = integers(address, SIZE)
        if stamp == 0:
            return
        n = book[JOINTS]
        q = floats(book[Q], n)
        dq = floats(book[DQ], n)
        theta = floats(book[THETA], n)
        dtheta = floats(book[DTHETA], n)
        command = floats(book[COMMAND], n)
        out = floats(book[OUT], n)
        mass_matrix = floats(book[MASS], n * n).reshape((n, n))
        bias = floats(book[BIAS], n)
        acceleration = floats(book[ACCELERATION], n)
        vector = floats(book[VECTOR], n)
        memory = drive_memory_at(book)
        table = memory.table
        q_ref, dq_ref, ddq_ref = motion_reference(book, n)
        if book[IMPOSED]:
            follow_motion(book, n, t)
        for i in range(n):
            if book[IMPOSED]:
                theta[i] = q_ref[i]
                dtheta[i] = dq_ref[i]
            elif table.elastic[i] == 0:
                theta[i] = q[i]
                dtheta[i] = dq[i]
            memory.q[i] = q[i]
            memory.dq[i] = dq[i]
            memory.theta[i] = theta[i]
            memory.dtheta[i] = dtheta[i]
        if book[LOADED]:
            factor = floats(book[FACTOR], n * n).reshape((n, n))
            evaluate_loaded_drives(memory, t, True, command, mass_matrix, bias, factor, acceleration)
        else:
            evaluate_drives(memory, t, True)
        for i in range(n):
            driving = table.gain[i] * command[i] - memory.friction[i]
            if table.elastic[i] == 1:
                out[i] = memory.transmitted[i] + memory.on_arm[i]
                if not book[IMPOSED]:
                    dtheta[i] += h * (driving - memory.reaction[i]) / table.inertia[i]
                    theta[i] += h * dtheta[i]
            else:
                out[i] = driving + memory.on_arm[i]
        if book[IMPOSED]:
            order = integers(book[ORDERED], n)
            free = book[FREE]
            if free < n:
                follow_acceleration(book, n, t, 0)
                for r in order[free:]:
                    acceleration[r] = _acceleration(q[r], dq[r], q_ref[r], dq_ref[r], ddq_ref[r])
                factor = floats(book[FACTOR], free * free).reshape((free, free))
                accelerate_elastic(mass_matrix, bias, out, order, free, factor, vector, acceleration)
                for r in order[free:]:
                    out[r] = bias[r]
                    for j in range(n):
                        out[r] += mass_matrix[r, j] * acceleration[j]
        elif book[ROTORS]:
            # PyBullet knows no rotors: it gets what they leave of the torque
            factor = floats(book[FACTOR], n * n).reshape((n, n))
            for i in range(n):
                for j in range(n):
                    factor[i, j] = mass_matrix[i, j]
                if table.elastic[i] == 0:
                    factor[i, i] += table.inertia[i]
                vector[i] = out[i] - bias[i]
            _factorised(factor)
            _solved(factor, vector)
            for i in range(n):
                if table.elastic[i] == 0:
                    out[i] -= table.inertia[i] * vector[i]

    return _numba.njit(_types.void(_types.int64, _types.float64, _types.float64), cache=True)(step)
