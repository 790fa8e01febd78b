"""Motion laws: joint positions over time as piecewise polynomials, with the speeds and accelerations that are theirs.

The paper's two codes differed because each differentiated the joint rotation by itself (IMECE2013-64815, section 8);
here position, speed and acceleration come from one polynomial, the same for every engine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import RunFileError
from .evaluate import MotionTable

Array = NDArray[np.float64]

# what rounding does to a time [s]
INSTANT = 1.0e-9


@dataclass(frozen=True, slots=True, eq=False)
class MotionLaw:
    """Positions of n joints over time; at rest at the end positions before the first and after the last knot.

    The law is what its table makes it: Akima pieces join with continuous speed only, cubic Hermite pieces too, quintic
    Hermite pieces with continuous acceleration. At a knot the piece after it counts. A law that does not end at rest
    stops at once; a time that rounding puts beyond an end is on it.

    Attributes:
        knots: Times between which the law is one polynomial [s], growing, shape (m + 1,).
        coefficients: Highest power of (t - knot) first, as SciPy's PPoly has them [rad or m], shape (k, m, n).
    """

    knots: Array
    coefficients: Array

    def __post_init__(self) -> None:
        knots = np.array(self.knots, dtype=np.float64)
        coefficients = np.array(self.coefficients, dtype=np.float64)
        if coefficients.ndim != 3 or knots.shape != (coefficients.shape[1] + 1,) or 0 in coefficients.shape:
            raise ValueError(f"knots {knots.shape} and coefficients {coefficients.shape} do not fit together")
        if not (np.isfinite(knots).all() and np.isfinite(coefficients).all() and (np.diff(knots) > 0.0).all()):
            raise ValueError("knots must grow, and all numbers must be finite")
        for name, array in (("knots", knots), ("coefficients", coefficients)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.coefficients.shape[2]

    @property
    def duration(self) -> float:
        """Time of the last knot [s]; a run begins at t = 0."""
        return float(self.knots[-1])

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Positions, speeds and accelerations at times t (...) [s], each of shape (..., n)."""
        t = np.asarray(t, dtype=np.float64)
        inside = np.clip(t, self.knots[0], self.knots[-1])
        piece = np.clip(np.searchsorted(self.knots, inside, side="right") - 1, 0, len(self.knots) - 2)
        x = (inside - self.knots[piece])[..., None]
        value, slope, bend = (np.zeros((*t.shape, self.n)) for _ in range(3))
        for power in self.coefficients:
            bend = bend * x + slope
            slope = slope * x + value
            value = value * x + power[piece]
        moving = (np.abs(t - inside) <= INSTANT)[..., None]
        return value, np.where(moving, slope, 0.0), np.where(moving, 2.0 * bend, 0.0)

    def shifted(self, offsets: ArrayLike) -> MotionLaw:
        """The same motion with constant offsets (n,) added to the positions [rad or m]."""
        coefficients = self.coefficients.copy()
        coefficients[-1] += np.asarray(offsets, dtype=np.float64)
        return MotionLaw(self.knots, coefficients)

    def going_on(self, time: float) -> MotionLaw:
        """The same motion, which goes on with the acceleration that it ends with for a time [s] before it stops."""
        piece = np.zeros((max(3, len(self.coefficients)), 1, self.n))
        q, dq, ddq = self.at(self.duration)
        piece[-3], piece[-2], piece[-1] = 0.5 * ddq, dq, q
        before = np.zeros((len(piece) - len(self.coefficients), *self.coefficients.shape[1:]))
        coefficients = np.concatenate([np.concatenate([before, self.coefficients]), piece], axis=1)
        return MotionLaw(np.append(self.knots, self.duration + time), coefficients)

    def spread(self, joints: Sequence[int], n: int) -> MotionLaw:
        """The same motion as that of some joints (from 0) of n; the others stand at 0."""
        if self.n == n:
            return self
        coefficients = np.zeros((*self.coefficients.shape[:2], n))
        coefficients[:, :, list(joints)] = self.coefficients
        return MotionLaw(self.knots, coefficients)

    def table(self) -> MotionTable:
        """The law for `evaluate.motion_at` and for scripts."""
        # copies: compiled code knows writeable arrays only
        return MotionTable(self.knots.copy(), self.coefficients.copy())


def from_table(
    t: ArrayLike, q: ArrayLike, dq: ArrayLike | None = None, ddq: ArrayLike | None = None, *, source: str | None = None
) -> MotionLaw:
    """The law through given knots.

    Positions alone: Akima's spline (Akima, 1970), as in the paper. With speeds: cubic Hermite pieces. With speeds and
    accelerations, which the paper recommends: quintic Hermite pieces.

    Args:
        t: Times [s], growing, shape (m,), m >= 2.
        q: Positions [rad or m], shape (m, n).
        dq: Speeds, shape (m, n), or None.
        ddq: Accelerations, shape (m, n), or None; only with dq.
        source: Where the table stands, for messages.

    Raises:
        RunFileError: Numbers that make no motion.
    """
    t = np.asarray(t, dtype=np.float64)
    columns = [np.asarray(values, dtype=np.float64) for values in (q, dq, ddq) if values is not None]
    _check_table(t, columns, ddq is not None and dq is None, source)
    h = np.diff(t)[:, None]
    if len(columns) == 1:
        return MotionLaw(t, _akima(t, columns[0]))
    q0, q1, v0, v1 = columns[0][:-1], columns[0][1:], columns[1][:-1], columns[1][1:]
    # what is left at the end of a piece once its first terms are taken out
    position, speed = q1 - q0 - h * v0, h * (v1 - v0)
    if len(columns) == 2:
        terms = [(speed - 2.0 * position) / h**3, (3.0 * position - speed) / h**2, v0, q0]
        return MotionLaw(t, np.stack(terms))
    a0, a1 = columns[2][:-1], columns[2][1:]
    position, speed, bend = position - 0.5 * h**2 * a0, speed - h**2 * a0, h**2 * (a1 - a0)
    terms = [
        (6.0 * position - 3.0 * speed + 0.5 * bend) / h**5,
        (-15.0 * position + 7.0 * speed - bend) / h**4,
        (10.0 * position - 4.0 * speed + 0.5 * bend) / h**3,
        0.5 * a0,
        v0,
        q0,
    ]
    return MotionLaw(t, np.stack(terms))


def hold(q: ArrayLike, duration: float) -> MotionLaw:
    """Standing still at positions q (n,) for a duration [s]."""
    q = np.asarray(q, dtype=np.float64)
    return MotionLaw(np.array([0.0, duration]), q[None, None, :])


def point_to_point(start: ArrayLike, end: ArrayLike, duration: float) -> MotionLaw:
    """From rest to rest on one quintic a joint: speed and acceleration are zero at both ends.

    Args:
        start: Positions [rad or m], shape (n,).
        end: Positions, shape (n,).
        duration: [s].
    """
    q = np.array([start, end], dtype=np.float64)
    return from_table([0.0, duration], q, np.zeros_like(q), np.zeros_like(q))


def _akima(t: Array, q: Array) -> Array:
    from scipy.interpolate import Akima1DInterpolator

    if len(t) == 2:
        slope = (q[1] - q[0]) / (t[1] - t[0])
        return np.stack([slope[None], q[:1]])
    return np.asarray(Akima1DInterpolator(t, q).c)


def _check_table(t: Array, columns: list[Array], missing_speed: bool, source: str | None) -> None:
    def fail(message: str) -> None:
        raise RunFileError(f"{source}: {message}" if source else message)

    if missing_speed:
        fail("accelerations need speeds beside them: give dq too")
    if t.ndim != 1 or len(t) < 2:
        fail(f"a motion needs two times or more, not {t.size}")
    for values in columns:
        if values.ndim != 2 or len(values) != len(t) or values.shape != columns[0].shape:
            fail(f"{len(t)} times and positions, speeds or accelerations of shape {values.shape} do not fit together")
    growing = np.diff(t) > 0.0
    if not growing.all():
        at = int(np.argmin(growing))
        fail(f"times must grow: row {at + 2} has t = {float(t[at + 1])!r} s after {float(t[at])!r} s")
    for values in (t, *columns):
        finite = np.isfinite(values.reshape(len(t), -1)).all(axis=1)
        if not finite.all():
            at = int(np.argmin(finite))
            fail(f"row {at + 1} (t = {float(t[at])!r} s) holds a number that is not finite")
