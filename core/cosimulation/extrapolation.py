"""What one side takes the other's signal to be between communication points: a polynomial through its last values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

HIGHEST = 2


class Extrapolation:
    """The polynomial of an order through the last values of a signal, beginning at the last communication point.

    Order 0 holds the last value. Before the first communication point the signal is taken to have stood still, as the
    robot has.
    """

    def __init__(self, order: int, interval: float, first: Vector) -> None:
        """Nothing has come yet.

        Args:
            order: 0, 1 or 2.
            interval: Communication step [s].
            first: The signal until the first communication point, shape (...,).
        """
        self._interval = interval
        self._last = [first] * (order + 1)
        self._begin = 0.0
        self._terms: list[Vector] = [first]

    def hear(self, t: float, value: Vector) -> None:
        """A value of a communication point at t [s], shape (...,)."""
        self._begin = t
        self._last = [value, *self._last[:-1]]
        # Newton's backward differences over s = (t - begin) / interval
        y = self._last
        self._terms = [y[0]]
        if len(y) > 1:
            self._terms.append(y[0] - y[1])
        if len(y) > 2:
            bend = 0.5 * (y[0] - 2.0 * y[1] + y[2])
            self._terms = [y[0], self._terms[1] + bend, bend]

    def at(self, t: float) -> Vector:
        """The signal at t [s], shape (...,)."""
        s = (t - self._begin) / self._interval
        value = self._terms[-1]
        for term in self._terms[-2::-1]:
            value = value * s + term
        return value

    def held_twice(self, t: float, duration: float) -> tuple[Vector, Vector]:
        """Two values to hold, each for half of a duration [s] from t [s], that do as the signal would, shapes (...,).

        Impulse and first moment are the signal's, so that what is moved by it arrives with the same speed at the same
        place; what is left is of the fourth order in the duration.
        """
        a = (t - self._begin) / self._interval
        b = a + duration / self._interval
        # means of 1, s, s^2 from a to b
        means = (1.0, 0.5 * (a + b), (a * a + a * b + b * b) / 3.0)
        mean: Vector = np.asarray(sum(mean * term for mean, term in zip(means, self._terms, strict=False)))
        apart = (self.at(t + duration) - self.at(t)) / 3.0
        return mean - apart, mean + apart
