"""Motion laws: joint positions with their speeds and accelerations as piecewise polynomials of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import UsageError
from .evaluate import MotionTable

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotionLaw:
    """Piecewise polynomials; at rest at its ends' positions before and after.

    The paper found that two codes differed because each differentiated the rotation by itself: here position, speed
    and acceleration come from the same polynomials everywhere.

    Attributes:
        knots: Where pieces begin, and the end [s], shape (m + 1,), growing, the first is 0 for a run.
        coefficients: Powers of t - knot, highest first, shape (order, m, n) [rad or m, by s].
    """

    knots: Array
    coefficients: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.coefficients.shape[2])

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.knots[-1])

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """(q, dq, ddq) at times t [s], shape (...,); each of shape (..., n)."""
        times = np.asarray(t, dtype=float)
        flat = np.atleast_1d(times).ravel()
        inside = np.clip(flat, self.knots[0], self.knots[-1])
        piece = np.clip(np.searchsorted(self.knots, inside, side="right") - 1, 0, len(self.knots) - 2)
        s = (inside - self.knots[piece])[:, None]
        value, slope, bend = (np.zeros((len(flat), self.n)) for _ in range(3))
        for power in self.coefficients:
            bend = bend * s + 2.0 * slope
            slope = slope * s + value
            value = value * s + power[piece]
        still = ((flat < self.knots[0]) | (flat > self.knots[-1]))[:, None]
        shape = (*times.shape, self.n)
        moving = (np.where(still, 0.0, slope), np.where(still, 0.0, bend))
        return value.reshape(shape), moving[0].reshape(shape), moving[1].reshape(shape)

    def shifted(self, offset: ArrayLike) -> MotionLaw:
        """The same motion with an offset added to every position, shape (n,) [rad or m]."""
        coefficients = self.coefficients.copy()
        coefficients[-1] += np.asarray(offset, dtype=float)
        return MotionLaw(self.knots, coefficients)

    def table(self) -> MotionTable:
        """Contiguous arrays for compiled code and for scripts."""
        return MotionTable(np.ascontiguousarray(self.knots), np.ascontiguousarray(self.coefficients))


def hold(q: Sequence[float], duration: float) -> MotionLaw:
    """Standing still at q [rad or m] for a duration [s]."""
    return MotionLaw(np.array([0.0, duration]), np.array(q, dtype=float).reshape(1, 1, -1))


def from_table(t: ArrayLike, q: ArrayLike, dq: ArrayLike | None = None, ddq: ArrayLike | None = None) -> MotionLaw:
    """Through the knots of a motion table.

    Positions alone make an Akima spline (the paper's; its acceleration jumps at knots), positions and speeds a cubic
    Hermite, all three a quintic Hermite spline.

    Args:
        t: Times [s], growing, shape (m,).
        q: Positions [rad or m], shape (m, n).
        dq: Speeds, shape (m, n).
        ddq: Accelerations, shape (m, n).

    Raises:
        UsageError: Fewer than two knots, or times that do not grow.
    """
    from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline

    times, positions = np.asarray(t, dtype=float), np.asarray(q, dtype=float)
    if len(times) < 2 or not np.all(np.diff(times) > 0.0):
        raise UsageError("a motion needs two knots or more, at times that grow.")
    if dq is None:
        if len(times) == 2:
            return from_table(times, positions, np.tile(np.diff(positions, axis=0) / np.diff(times), (2, 1)))
        return MotionLaw(times, np.asarray(Akima1DInterpolator(times, positions).c))
    speeds = np.asarray(dq, dtype=float)
    if ddq is None:
        return MotionLaw(times, np.asarray(CubicHermiteSpline(times, positions, speeds).c))
    return MotionLaw(times, _quintic(times, positions, speeds, np.asarray(ddq, dtype=float)))


def _quintic(t: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """Coefficients of the quintic Hermite spline, shape (6, m - 1, n)."""
    h = np.diff(t)[:, None]
    v0, v1 = dq[:-1] * h, dq[1:] * h
    a0, a1 = ddq[:-1] * h * h, ddq[1:] * h * h
    step = np.diff(q, axis=0) - v0 - a0 / 2
    dv, da = v1 - v0 - a0, a1 - a0
    c3 = 10 * step - 4 * dv + da / 2
    c4 = -15 * step + 7 * dv - da
    c5 = 6 * step - 3 * dv + da / 2
    return np.stack([c5 / h**5, c4 / h**4, c3 / h**3, ddq[:-1] / 2, dq[:-1], q[:-1]])
