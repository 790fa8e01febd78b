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
    SIZE,
    Book,
    drive_memory_at,
    floats,
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

JOINTS, COORDINATES, X, V, COMMAND, OUT, FLYWHEEL = range(ENGINE, ENGINE + 7)

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
        self._book.entries[[JOINTS, COORDINATES]] = n, len(x)
        for place, array in (
            (X, x),
            (V, v),
            (COMMAND, self.command),
            (OUT, self.out),
            (FLYWHEEL, np.array([flywheel])),
        ):
            self._book.put(place, array)
        self._address = self._book.address
        self._compiled = _compiled()

    def impose(self, motion: MotionLaw | None) -> None:
        """Motor sides follow a motion; None: they move freely."""
        self._book.impose(motion)

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
            for i in range(n):
                if memory.table.elastic[i] == 0:
                    wanted = _acceleration(x[i], v[i], q_ref[i], dq_ref[i], ddq_ref[i])
                    out[i] = floats(book[FLYWHEEL], 1)[0] * wanted

    return _numba.njit(_types.void(_types.int64, _types.float64, _types.boolean), cache=True)(evaluate)
