"""Slopes by differences, taken anew only where they no longer say where what is left goes."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

# part of its size that a number is moved by
PART = 1.0e-3
# a number this small is moved by as much as one of this size
SMALL = 1.0e-2
# slopes hold that miss this part of a change, or any part of one that is this small beside what is left
MISSED, NEXT_TO_NOTHING = 0.02, 1.0e-3


def differences(of: Callable[[Vector], Vector], x: Vector, high: Vector) -> Vector:
    """Change of a function's values (m,) with numbers x (k,), which go up to high, shape (m, k)."""
    optimize: Any = import_module("scipy.optimize")

    if not len(x):
        return np.zeros((len(of(x)), 0))
    step = PART * np.maximum(np.abs(x), SMALL)
    step = np.where(x + step > high, -step, step)
    return np.asarray(optimize.approx_fprime(x, of, step), dtype=np.float64).reshape(-1, len(x))


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
        slopes = differences(self.at, x, self._high)
        self._known = x.copy(), now, slopes
        return slopes
