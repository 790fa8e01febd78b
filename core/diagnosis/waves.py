"""What of a signal goes as a wave of a joint's angle; plain text that Numba compiles, and what asks it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..simulation.compiled import compile_text

Vector = NDArray[np.float64]

# part that either half of a wave has by itself
SINGLE = 0.01


class Angle(NamedTuple):
    """A joint's motion in one run, and what is left there.

    Attributes:
        q, dq, ddq: Position, speed and acceleration, shape (m,).
        left: What is left, shape (m,).
    """

    q: Vector
    dq: Vector
    ddq: Vector
    left: Vector


def periodic(angles: Sequence[Angle], grid: Vector, *, itself: bool, second: bool) -> Vector:
    """Energy that a wave of each number of cycles a turn takes of what is left of every run at a joint, (g,).

    The wave itself, its second derivative in time, or both; one amplitude and one phase of each for all runs, a mean
    for every run (Zechmeister and Kuerster 2009).

    Args:
        angles: One a run.
        grid: Cycles a turn, evenly spaced, shape (g,).
        itself: The wave itself.
        second: Its second derivative.
    """
    count = 2 * (itself + second)
    normal, moment = np.zeros((len(grid), count, count)), np.zeros((len(grid), count))
    apart = float(grid[1] - grid[0]) if len(grid) > 1 else 0.0
    for one in angles:
        if np.any(one.left):
            q, dq, ddq, left = (np.ascontiguousarray(x) for x in one)
            compile_text(gather_waves)(grid[0], apart, q, dq, ddq, left - left.mean(), itself, second, normal, moment)
    size = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-300))
    # over a part of a wave its two halves are one
    even = normal / (size[:, :, None] * size[:, None, :]) + SINGLE * np.eye(count)
    moment /= size
    return np.sum(moment * np.linalg.solve(even, moment[:, :, None])[:, :, 0], axis=1)


def gather_waves(
    lowest: float,
    apart: float,
    q: Any,
    dq: Any,
    ddq: Any,
    left: Any,
    itself: bool,
    second: bool,
    normal: Any,
    moment: Any,
) -> None:
    """Add one run's sums of products of waves, their means taken out, and of waves with what is left.

    Args:
        lowest: Cycles of the first wave.
        apart: By how much each next one has more.
        q: Position, shape (m,).
        dq: Speed.
        ddq: Acceleration.
        left: What is left, of mean 0.
        itself: Whether the waves themselves are there: cosine and sine.
        second: Whether their second derivatives are.
        normal: To be added to, shape (g, c, c).
        moment: To be added to, shape (g, c).
    """
    m = len(q)
    cosine, sine = np.cos(lowest * q), np.sin(lowest * q)
    # from one wave to the next the phase turns by as much as the angle
    turn_cosine, turn_sine = np.cos(apart * q), np.sin(apart * q)
    count = moment.shape[1]
    values, total = np.empty(count), np.empty(count)
    for g in range(len(moment)):
        cycles = lowest + apart * g
        total[:] = 0.0
        for k in range(m):
            c, s = cosine[k], sine[k]
            j = 0
            if itself:
                values[0], values[1] = c, s
                j = 2
            if second:
                # (e^(i c q))'' = e^(i c q) (i c q'' - (c q')^2)
                along, across = -((cycles * dq[k]) ** 2), cycles * ddq[k]
                values[j] = along * c - across * s
                values[j + 1] = along * s + across * c
            for a in range(count):
                total[a] += values[a]
                moment[g, a] += values[a] * left[k]
                for b in range(a + 1):
                    normal[g, a, b] += values[a] * values[b]
            cosine[k] = c * turn_cosine[k] - s * turn_sine[k]
            sine[k] = s * turn_cosine[k] + c * turn_sine[k]
        for a in range(count):
            for b in range(a + 1):
                normal[g, a, b] -= total[a] * total[b] / m
                normal[g, b, a] = normal[g, a, b]
