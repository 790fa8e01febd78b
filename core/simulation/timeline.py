"""The instants of a run under a controller: its ticks, where a torque begins to act, and where the run is recorded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .backend import Vector

# two instants closer than this are one [s]
INSTANT = 1.0e-9


class Rows(NamedTuple):
    """What is recorded of a run under a controller, arrays of shape (rows, n).

    Attributes:
        q, dq: Arm side.
        theta, dtheta: Motor side.
        tau: Torque that is held.
    """

    q: Any
    dq: Any
    theta: Any
    dtheta: Any
    tau: Any


class Timeline(NamedTuple):
    """All instants in order, arrays of shape (m,); numbers are -1 where nothing of that kind falls on an instant.

    Attributes:
        spans: Time since the one before [s].
        steps: Integration steps on the way there; the first instant has none.
        ticks: Number of the controller's tick.
        switches: Number of the tick whose torque begins to act.
        rows: Number of the record's row.
    """

    spans: Any
    steps: Any
    ticks: Any
    switches: Any
    rows: Any

    @staticmethod
    def of(times: Vector, ticks: Vector, switches: Vector, h: float) -> Timeline:
        """Of a record's times, ticks and switches [s], with steps of h [s] at most; all end with the record."""
        everything = np.concatenate([times, ticks, switches])
        order = np.sort(everything[everything <= times[-1] + INSTANT])
        instants = order[np.concatenate([[True], np.diff(order) > INSTANT])]
        spans = np.diff(instants, prepend=instants[0])

        def numbers(of: Vector) -> Any:
            at = np.searchsorted(of, instants - INSTANT)
            found = at < len(of)
            near = np.zeros(len(instants), dtype=bool)
            near[found] = np.abs(of[at[found]] - instants[found]) <= INSTANT
            return np.where(near, at, -1)

        steps = np.maximum(1, np.ceil(spans / h - 1.0e-6)).astype(np.int64)
        steps[0] = 0
        return Timeline(spans, steps, numbers(ticks), numbers(switches), numbers(times))

    def parts(self, most: int) -> Iterator[Timeline]:
        """It in parts of that many instants."""
        for begin in range(0, len(self.spans), most):
            yield Timeline(*(values[begin : begin + most] for values in self))

    def instants(self) -> Iterator[tuple[float, int, int, int, int]]:
        """One after the other."""
        return zip(*(values.tolist() for values in self), strict=True)
