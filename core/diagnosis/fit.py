"""Least squares with a prior and lower bounds, and how well a hypothesis does against none: Gaussian evidence."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .evidence import Evidence

Vector = NDArray[np.float64]

# misfit is taken to be alike within these bands [Hz] of a channel
BANDS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, np.inf)
# of the power of what is not understood in a channel, this part may be in any of its bands
LEAK = 0.2
# of the largest curvature, what round-off leaves of none
SHARED = 1.0e-12
# standard deviations below what noise leaves of a channel from which less is no better
CHANCE = 2.0
# cosine of the angle between what two names take away from which they may be names of one thing
SAME = 0.5
# nobody knows how large an amount is plain: a cause may be so much smaller altogether, and pays for the choice
SMALLER = (1.0, 0.3, 0.1, 0.03, 0.01)


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """The best of a linear hypothesis.

    Attributes:
        beta: Its numbers, shape (k,).
        left: What it leaves, shape (N,).
        cost: Sum of squares of what it leaves, over the spread, with the prior's part.
        volume: Half the logarithm of how much the prior had to be narrowed (Occam).
        told: How many numbers the data tell of it, the rest are the prior's (the trace of the resolution matrix, Backus
            and Gilbert 1968).
    """

    beta: Vector
    left: Vector
    cost: float
    volume: float
    told: float


def energy_of(left: Vector) -> float:
    """Sum of squares of what is left."""
    return float(left @ left)


def linear(r0: Vector, slope: Vector, scale: Vector, lower: Vector) -> Linear:
    """The most probable beta of r0 + slope beta ~ N(0, 1), beta ~ N(0, (s scale)^2), beta >= lower, s of SMALLER.

    Args:
        r0: Residual at beta = 0, over its spread, shape (N,).
        slope: Its change with beta, shape (N, k).
        scale: Prior spread of beta, shape (k,).
        lower: Least values, shape (k,).
    """
    scaled = slope * scale
    gram, moment = scaled.T @ scaled, scaled.T @ r0
    known, axes = np.linalg.eigh(gram)
    told = float(np.sum(np.maximum(known, 0.0) / (1.0 + np.maximum(known, 0.0))))
    # where noise is next to nothing, directions that two numbers share are told by the prior alone
    known = np.maximum(known, 0.0) + SHARED * float(np.diagonal(gram).max())
    options: list[tuple[float, float, Vector, float]] = []
    for smaller in SMALLER:
        narrowed = 1.0 + known * smaller**2
        x = -axes @ (axes.T @ moment * smaller / narrowed)
        least = lower / (scale * smaller)
        if np.any(x < least):
            x = _bounded(axes, narrowed, moment * smaller, least)
        volume, moved, prior = 0.5 * float(np.sum(np.log(narrowed))), x * smaller, float(x @ x)
        options.append(
            (0.5 * float(2.0 * moment @ moved + moved @ gram @ moved + prior) + volume, volume, moved, prior)
        )
    _, volume, moved, prior = min(options, key=lambda option: option[0])
    left = r0 + scaled @ moved
    return Linear(moved * scale, left, float(left @ left) + prior, volume + math.log(len(SMALLER)), told)


def _bounded(axes: Vector, narrowed: Vector, moment: Vector, least: Vector) -> Vector:
    """The most probable x >= least, where how much it is narrowed stands by its axes."""
    optimize: Any = import_module("scipy.optimize")

    if len(least) == 1:
        return np.maximum(-moment / narrowed, least)
    root = np.sqrt(narrowed)[:, None] * axes.T
    target = -(axes.T @ moment) / np.sqrt(narrowed)
    bounds = (np.minimum(least, -1e-12), np.inf)
    return np.asarray(optimize.lsq_linear(root, target, bounds=bounds, method="bvls").x, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Part:
    """A band of a channel: coefficients values[first:last]; those of the whole channel are values[begin:end]."""

    first: int
    last: int
    begin: int
    end: int


def blocks(evidence: Evidence) -> list[Part]:
    """Each band of each channel."""
    out: list[Part] = []
    for channel in evidence.channels:
        run = evidence.runs[channel.run]
        step = 0.5 / ((len(run.t) - run.first) * run.h)
        edges = [channel.first + int(np.ceil(edge / step)) for edge in BANDS[:-1]] + [channel.last]
        for a, b in itertools.pairwise(edges):
            first, last = min(a, channel.last), min(b, channel.last)
            if last > first:
                out.append(Part(first, last, channel.first, channel.last))
    return out


def edges_of(parts: Sequence[Part]) -> list[tuple[int, int]]:
    """Where each channel begins and ends."""
    return sorted({(part.begin, part.end) for part in parts})


def spread(left: Vector, parts: Sequence[Part]) -> Vector:
    """What a model may miss, as a standard deviation of each coefficient in units of noise, shape (N,).

    At least the noise; at least the rms that is left in the band, of which few coefficients are pulled towards the
    noise (two of them count as known); and at least LEAK of the power that is left in the whole channel: what is not
    understood is nowhere understood well, and a quiet band must not be bought at the price of a loud one.
    """
    out = np.empty(len(left))
    for part in parts:
        square = float(np.sum(left[part.first : part.last] ** 2))
        level = (square + 2.0) / (part.last - part.first + 2.0)
        whole = float(np.mean(left[part.begin : part.end] ** 2))
        out[part.first : part.last] = np.sqrt(max(1.0, level, 1.0 + LEAK * (whole - 1.0)))
    return out


def unexpected(left: Vector, parts: Sequence[Part]) -> float:
    """Minus the log likelihood of what is left, but for a constant, where it may be louder than noise in every band.

    Args:
        left: What is left, in units of noise, shape (N,).
        parts: Bands of channels.
    """
    edges = np.array([(part.first, part.last) for part in parts])
    count = edges[:, 1] - edges[:, 0]
    square = np.diff(np.concatenate([[0.0], np.cumsum(left**2)])[edges])[:, 0]
    level = np.maximum(1.0, (square + 2.0) / (count + 2.0))
    return 0.5 * float(np.sum(count * np.log(level) + square / level))


def gained(before: Vector, after: Vector, sigma: Vector, parts: Sequence[Part]) -> float:
    """Log evidence of what is left after over what was left before, both in units of noise, shape (N,).

    Below what noise leaves of a channel nothing is gained: who turns a gain down turns its sensor's noise down with it.

    Args:
        before: What was left.
        after: What is left.
        sigma: Spread that both are judged by.
        parts: Bands of channels.
    """
    channels = edges_of(parts)
    starts = [begin for begin, _ in channels]
    count = np.array([end - begin for begin, end in channels])
    floor = count - CHANCE * np.sqrt(2.0 * count)
    squares = np.stack([before, after]) ** 2
    had, has = np.add.reduceat(squares, starts, axis=1)
    less, weighed = had - has, np.add.reduceat((squares[0] - squares[1]) / sigma**2, starts)
    counts = np.maximum(had, floor) - np.maximum(has, floor)
    return 0.5 * float(
        np.sum(weighed * np.divide(np.abs(counts), np.abs(less), out=np.ones(len(count)), where=less != 0))
    )


def takes_the_same(before: Vector, one: Vector, other: Vector, sigma: Vector) -> bool:
    """Whether two names take the same away: as much may be gained elsewhere by another cause.

    Args:
        before: What is left without either, in units of noise, shape (N,).
        one: What is left with the one.
        other: What is left with the other.
        sigma: Spread that both are judged by.
    """
    a, b = (before - one) / sigma, (before - other) / sigma
    return float(a @ b) > SAME * max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
