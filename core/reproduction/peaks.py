"""Peaks of the tip's deviation across the edges of the path: when, and how high."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# what deviates less is no oscillation [m]
LEAST = 5.0e-5


@dataclass(frozen=True, slots=True)
class Peak:
    """One turn of the tip beside an edge.

    Attributes:
        edge: Number of the edge, from 0.
        t: When [s].
        height: How far to the left of the edge, seen along it from above [m]; negative to its right.
        left: It turns back from the left.
    """

    edge: int
    t: float
    height: float
    left: bool


def across(tip: Array, begin: Array, end: Array) -> Array:
    """Deviation to the left of an edge in the level plane [m], shape (m,), of tips (m, 3); an edge goes begin to end.

    What the command does along the edge does not enter, so that a run that is early is not taken for one that is off.
    """
    x, y = (end - begin)[:2] / np.linalg.norm((end - begin)[:2])
    return (tip[:, :2] - begin[:2]) @ np.array([-y, x])


def peaks_of(t: Array, tip: Array, corners: Array, places: Array) -> tuple[Peak, ...]:
    """All peaks beside all edges.

    Args:
        t: Times [s], shape (m,).
        tip: In the base [m], shape (m, 3).
        corners: When the command is at each corner [s], shape (k,).
        places: Where the corners are, in the base [m], shape (k, 3).
    """
    found: list[Peak] = []
    for edge in range(len(corners) - 1):
        on = (t > corners[edge]) & (t < corners[edge + 1])
        found += [
            Peak(edge, when, height, left)
            for when, height, left in turns(t[on], across(tip[on], places[edge], places[edge + 1]))
            if abs(height) > LEAST
        ]
    return tuple(found)


def turns(t: Array, x: Array) -> list[tuple[float, float, bool]]:
    """Times, values and whether it is a maximum, where a record turns: parabolas through three samples, shape (m,)."""
    slope = np.diff(x)
    k = np.flatnonzero(slope[:-1] * slope[1:] < 0.0) + 1
    before, at, after = x[k - 1], x[k], x[k + 1]
    shift = 0.5 * (before - after) / (before - 2.0 * at + after)
    step = float(t[1] - t[0]) if len(t) > 1 else 0.0
    times, heights = t[k] + shift * step, at - 0.25 * (before - after) * shift
    return list(zip(times.tolist(), heights.tolist(), (slope[k - 1] > 0.0).tolist(), strict=True))


# a peak of another run further away than this is another peak [s]
APART = 0.02


def pairs_of(one: tuple[Peak, ...], other: tuple[Peak, ...]) -> list[tuple[Peak, Peak]]:
    """The peaks that two runs have in common: on the same edge, turning the same way, nearest in time."""
    pairs: list[tuple[Peak, Peak]] = []
    for peak in one:
        same = [
            near for near in other if near.edge == peak.edge and near.left == peak.left and abs(near.t - peak.t) < APART
        ]
        if same:
            pairs.append((peak, min(same, key=lambda near: abs(near.t - peak.t))))
    return pairs
