"""Slopes by differences, taken anew only where they no longer say where what is left goes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..parallel import side_by_side

Vector = NDArray[np.float64]

# part of its size that a number is moved by
PART = 1.0e-3
# a number this small is moved by as much as one of this size
SMALL = 1.0e-2
# slopes hold that miss this part of a change, or any part of one that is this small beside what is left
MISSED, NEXT_TO_NOTHING = 0.02, 1.0e-3


def differences(of: Callable[[Vector], Vector], x: Vector, high: Vector, now: Vector | None = None) -> Vector:
    """Change of a function's values (m,) with numbers x (k,), which go up to high, shape (m, k).

    Args:
        of: The function; it is asked side by side.
        x: The numbers.
        high: Up to where they may go.
        now: Its values there, if they are known.
    """
    there = of(x) if now is None else now
    step = PART * np.maximum(np.abs(x), SMALL)
    step = np.where(x + step > high, -step, step)

    def column(k: int) -> Vector:
        moved = x.copy()
        moved[k] += step[k]
        return (of(moved) - there) / (moved[k] - x[k])

    return np.array(side_by_side(column, range(len(x))), dtype=np.float64).reshape(len(x), len(there)).T


class Sloped:
    """A function of numbers and its slopes along a search; most laws are linear in most of their numbers."""

    def __init__(self, of: Callable[[Vector], Vector], high: Vector) -> None:
        """Of numbers (k,) that go up to high, values (m,)."""
        self._of, self._high = of, high
        self._last: tuple[Vector, Vector] | None = None
        self._known: tuple[Vector, Vector, Vector] | None = None

    def at(self, x: Vector) -> Vector:
        """Values at numbers x (k,), shape (m,)."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self._of(x)
        return self._last[1]

    def slopes(self, x: Vector) -> Vector:
        """Their change with the numbers there, shape (m, k)."""
        now = self.at(x)
        if self._known is not None:
            before, then, slopes = self._known
            expected = slopes @ (x - before)
            missed, change = (float(np.linalg.norm(one)) for one in (now - then - expected, expected))
            if missed <= max(MISSED * change, NEXT_TO_NOTHING * float(np.linalg.norm(now))):
                return slopes
        # where it is, its values are known
        slopes = differences(self._of, x, self._high, now)
        self._known = x.copy(), now, slopes
        return slopes
