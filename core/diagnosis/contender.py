"""What competes for a gap: every hypothesis by its signature beside what was found, and what it is worth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import MbexportError
from .fit import Linear, Part, edges_of, energy_of, gained, linear, spread, unexpected
from .found import Found
from .hypothesis import STEP, Hypothesis
from .model import Rows, merged
from .problem import Problem

Vector = NDArray[np.float64]

# log evidence that a finding needs: some hundreds compete, and a false name is worse than none
THRESHOLD = 10.0
# what a finding must explain of the energy that is left above noise: where a large part is not understood, small
# parts of it prove nothing
LEAST_SHARE = 0.02
# every number more must explain this part more
DEARER = 0.1
# log evidence that a number costs
NUMBER = 2.0
# part of one channel's that is no crumb either: the loudest channel must not drown what another is about
MUCH = 0.3
# part of what is left that is most of it
MOST = 0.5
# standard deviations of pure noise above it from which what is left is loud
LOUD = 5.0
# of a plain amount, what is none
NONE = 1.0e-6


@dataclass(frozen=True, slots=True, eq=False)
class Contender:
    """A hypothesis with its best fit.

    Attributes:
        hypothesis: What is said.
        gain: Log evidence above saying nothing.
        explains: Part of the residual's energy above noise that it takes.
        beta: Its numbers.
        left: What it leaves, in units of noise.
        shows: By how many standard deviations of everything together a plain amount of it changes what is said.
        closes: Part of what is left above noise of one channel, that of which it takes most.
        told: How many numbers of it these runs tell.
    """

    hypothesis: Hypothesis
    gain: float
    explains: float
    beta: Vector
    left: Vector
    shows: float
    closes: float = 0.0
    told: float = math.inf

    @property
    def earns(self) -> bool:
        """Whether it is more than chance and more than a crumb, of everything or of one channel."""
        return self.gain >= THRESHOLD and (self.explains >= LEAST_SHARE or self.closes >= MUCH)

    @property
    def possible(self) -> bool:
        """Whether there can be so much of it."""
        return self.hypothesis.rows(self.beta) is not None

    @property
    def worth(self) -> float:
        """What it explains, less for every number that it needs for that."""
        return self.explains / self.price

    @property
    def numbers(self) -> int:
        """How many numbers it needs: those that stand at the least they can be are not there."""
        least, scale = self.hypothesis.lower, self.hypothesis.scale
        return max(1, int(np.sum(self.beta > least + NONE * scale)))

    @property
    def price(self) -> float:
        """By what its energy is divided for the numbers that it needs and that these runs tell."""
        return 1.0 + DEARER * (max(1.0, min(self.numbers, self.told)) - 1.0)


Fitting = tuple[Hypothesis, Vector, Vector]


def found_of(contender: Contender, rows: Rows) -> Found:
    hypothesis = contender.hypothesis
    nothing = hypothesis.rows(np.zeros(len(hypothesis.scale))) if hypothesis.alone else None
    absent = nothing[hypothesis.effect][0] if nothing else None
    row = rows[hypothesis.effect][0]
    if absent and any(
        math.isfinite(value) > math.isfinite(absent.values.get(name, 0.0)) for name, value in row.values.items()
    ):
        # what is rigid without it has no finite number there
        absent = None
    return Found(*hypothesis.key, row, contender.gain, absent)


def ranked(fits: Sequence[Fitting], left: Vector, parts: Sequence[Part], basis: Vector) -> list[Contender]:
    """Hypotheses by evidence, judged by the spread that the best of them leaves.

    Args:
        fits: Each with what would be left with none of it, and its slope.
        left: What is left now, shape (N,).
        parts: Bands of it.
        basis: Slopes of what stays free beside them, shape (N, k).
    """
    if not fits:
        return []
    sigma = spread(left, parts)
    order: list[tuple[float, Hypothesis, Linear, Vector, float]] = []
    # what is left by the best so far tells what misfit is to be expected; a second round settles it
    for settled in (False, True):
        frame = np.linalg.qr(basis / sigma[:, None])[0] if basis.shape[1] else None
        null = _beside(left / sigma, frame) * sigma
        order = []
        for hypothesis, r0, slope in fits:
            beside = _beside(slope / sigma[:, None], frame)
            fit = linear(_beside(r0 / sigma, frame), beside, hypothesis.scale, hypothesis.lower)
            prior = 0.5 * (fit.cost - energy_of(fit.left))
            gain = gained(null, fit.left * sigma, sigma, parts) - prior - fit.volume
            shows = float(np.linalg.norm(slope * hypothesis.scale))
            order.append((gain, hypothesis, fit, fit.left * sigma, shows))
        order.sort(key=lambda entry: (-entry[0], entry[1].key, entry[1].form))
        if settled:
            break
        best = order[0][3]
        if order[0][0] < THRESHOLD:
            hidden = _hiding(left, [(len(one.scale), rest) for _, one, _, rest, _ in order], parts)
            if hidden is None and order[0][0] <= 0.0:
                break
            best = best if hidden is None else hidden
        sigma = spread(best, parts)
    whole, energy = energy_of(left), _above(left)
    return [
        Contender(
            hypothesis,
            gain,
            float(np.clip((whole - energy_of(rest)) / energy, 0.0, 1.0)),
            fit.beta,
            rest,
            shows,
            _most_gone(left, rest, parts),
            fit.told,
        )
        for gain, hypothesis, fit, rest, shows in order
    ]


def _hiding(left: Vector, options: Sequence[tuple[int, Vector]], parts: Sequence[Part]) -> Vector | None:
    """What is left by the hypothesis that takes most of what is left, where that itself makes it look like chance.

    What is loud in a few coefficients is hidden by the spread that it makes there: it is judged by the evidence that
    knows no spread beforehand, two nats off for each number.

    Args:
        left: What is left now.
        options: Of each hypothesis how many numbers it has, and what it leaves.
        parts: Bands of it.
    """
    priced = [(unexpected(rest, parts) + NUMBER * numbers, rest) for numbers, rest in options]
    least, rest = min(priced, key=lambda one: one[0])
    most = energy_of(left) - energy_of(rest) >= MOST * _above(left)
    return rest if most and unexpected(left, parts) - least >= THRESHOLD else None


def _above(left: Vector) -> float:
    """Energy of what is left above noise; of pure noise nothing is explained."""
    return max(energy_of(left) - len(left), 3.0 * math.sqrt(2.0 * len(left)))


def _most_gone(left: Vector, rest: Vector, parts: Sequence[Part]) -> float:
    """Part of what is left above noise of one channel that is gone, of the channel of which most is; of loud ones."""
    channels = np.array(edges_of(parts))
    count = channels[:, 1] - channels[:, 0]
    had, has = np.add.reduceat(np.stack([left, rest]) ** 2, channels[:, 0], axis=1)
    above = had - count
    taken = np.divide(had - has, above, out=np.zeros(len(above)), where=above > LOUD * np.sqrt(2.0 * count))
    return float(np.clip(np.max(taken), 0.0, 1.0))


def _beside(values: Vector, frame: Vector | None) -> Vector:
    """What of numbers or columns no amount of the others can say."""
    return values if frame is None else values - frame @ (frame.T @ values)


def signature_of(problem: Problem, hypothesis: Hypothesis, rows: Rows, base: Vector) -> tuple[Vector, Vector] | None:
    """Residual at beta = 0 and its slope, by differences; None where there can be no such robot."""
    try:
        return _differences(problem, hypothesis, rows, base)
    except MbexportError:
        return None


def _differences(problem: Problem, hypothesis: Hypothesis, rows: Rows, base: Vector) -> tuple[Vector, Vector] | None:
    k = len(hypothesis.scale)
    zero = np.zeros(k)
    if hypothesis.alone:
        r0 = base
    else:
        start = hypothesis.rows(zero)
        if start is None:
            return None
        r0 = problem.residual(merged(rows, start))
    columns: list[Vector] = []
    for j in range(k):
        step = zero.copy()
        step[j] = STEP * hypothesis.scale[j]
        carried = hypothesis.carried and j > 0
        if carried:
            # a first moment needs a mass to be one of
            step[0] = STEP * hypothesis.scale[0]
        moved = hypothesis.rows(step)
        if moved is None:
            return None
        column = (problem.residual(merged(rows, moved)) - r0) / step[j]
        columns.append(column - columns[0] * step[0] / step[j] if carried else column)
    slope = np.column_stack(columns)
    return (r0, slope) if np.all(np.isfinite(slope)) and np.all(np.isfinite(r0)) else None
