"""A motion law at one instant: plain Python that Numba compiles and that emitted scripts carry verbatim."""

from __future__ import annotations

from typing import Any, NamedTuple


class MotionTable(NamedTuple):
    """Piecewise polynomials of n joints over m pieces.

    Attributes:
        knots: Where pieces begin and the last ends [s], shape (m + 1,).
        coefficients: Powers of t - knot, highest first, shape (order, m, n).
    """

    knots: Any
    coefficients: Any


def motion_at(t: float, table: MotionTable, q: Any, dq: Any, ddq: Any) -> None:
    """Position, speed and acceleration at time t [s] into q, dq, ddq, shape (n,); at rest outside of the knots."""
    last = len(table.knots) - 1
    # rounding may put a time this far beyond the end that it is on
    outside = t < table.knots[0] - 1.0e-9 or t > table.knots[last] + 1.0e-9
    low = 0
    high = last
    while high - low > 1:
        middle = (low + high) // 2
        if t >= table.knots[middle]:
            low = middle
        else:
            high = middle
    s = min(max(t, table.knots[0]), table.knots[last]) - table.knots[low]
    order = table.coefficients.shape[0]
    for j in range(table.coefficients.shape[2]):
        value = 0.0
        slope = 0.0
        bend = 0.0
        for k in range(order):
            bend = bend * s + 2.0 * slope
            slope = slope * s + value
            value = value * s + table.coefficients[k, low, j]
        q[j] = value
        dq[j] = 0.0 if outside else slope
        ddq[j] = 0.0 if outside else bend
