"""The drives at one stage of Exudyn's integrator, compiled: it reads Exudyn's coordinates where they lie in memory.

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
    drive_memory_at,
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
    from ..core.simulation.backend import Vector
    from ..core.simulation.drives import Drives

_numba: Any = import_module("numba")
_types: Any = _numba.types

(
    COORDINATES,
    LAST,  # half steps since the advance began, at the last evaluation
    X,
    V,
    COMMAND,
    OUT,
    FLYWHEEL,
    CLOCK,  # when the advance began, and half a step
) = range(ENGINE, ENGINE + 8)

_acceleration: Any = imposed.imposed_acceleration
_coordinate_torques: Any = drive_law.coordinate_torques
as_it_stands(_acceleration)


class Stage:
    """The drives' torques on the coordinates of one model in Exudyn.

    Attributes:
        command: Motor torques before the drives' gain, shape (n,).
        out: Torque on every coordinate, shape (n,) or (n + e,).
    """

    def __init__(self, drives: Drives, x: Vector, v: Vector, flywheel: float) -> None:
        """Take the live coordinates and speeds of a model, and the inertia of rigid joints that are imposed."""
        n = len(drives.q)
        self.command = np.zeros(n)
        self.out = np.zeros(len(x))
        self._book = Book(drives)
        self._clock = np.zeros(2)
        self._book.entries[COORDINATES] = len(x)
        for place, array in (
            (X, x),
            (V, v),
            (COMMAND, self.command),
            (OUT, self.out),
            (FLYWHEEL, np.array([flywheel])),
            (CLOCK, self._clock),
        ):
            self._book.put(place, array)
        self._address = self._book.address
        self._compiled = _compiled()

    def impose(self, motion: MotionLaw | None) -> None:
        """Motor sides follow a motion; None: they move freely."""
        self._book.impose(motion)

    def begin(self, t: float, h: float) -> None:
        """Steps of h [s] begin at time t [s]."""
        self._clock[:] = t, 0.5 * h
        self._book.entries[LAST] = 0

    def evaluate(self, t: float, accept: bool) -> None:
        """Torques at the model's coordinates as they are now, into `out`; `accept` after a step."""
        self._compiled(self._address, t, accept)


@cache
def _compiled() -> Any:
    stamp = source_stamp(sys.modules[__name__], imposed)

    def evaluate(address: int, t: float, accept: bool) -> None:
        book = integers(address, SIZE)
        if stamp == 0:
            return
        n = book[JOINTS]
        size = book[COORDINATES]
        x = floats(book[X], size)
        v = floats(book[V], size)
        out = floats(book[OUT], size)
        memory = drive_memory_at(book)
        q_ref, dq_ref, ddq_ref = motion_reference(book, n)
        if book[IMPOSED]:
            follow_motion(book, n, t)
            for i in range(n):
                memory.theta[i] = q_ref[i]
                memory.dtheta[i] = dq_ref[i]
        _coordinate_torques(memory, t, x, v, floats(book[COMMAND], n), out, accept)
        if book[IMPOSED]:
            # The fourth stage of a step and the first of the next are at one time, and only they: which of them asks
            # shows in the time of the one that asked before.
            clock = floats(book[CLOCK], 2)
            now = round((t - clock[0]) / clock[1])
            stage = 1 if now % 2 == 1 else 3 if book[LAST] % 2 == 1 else 0
            book[LAST] = now
            follow_acceleration(book, n, t, stage)
            for i in range(n):
                if memory.table.elastic[i] == 0:
                    wanted = _acceleration(x[i], v[i], q_ref[i], dq_ref[i], ddq_ref[i])
                    out[i] = floats(book[FLYWHEEL], 1)[0] * wanted

    return _numba.njit(_types.void(_types.int64, _types.float64, _types.boolean), cache=True)(evaluate)
