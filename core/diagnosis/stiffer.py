"""Fits of springs that stiffen, and of the straight ones that a database and engines take in their place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .fit import Part
from .hypotheses import clamped
from .inverse import stretch_of
from .model import tables
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined, left_with, refined
from .stiffening import SPRINGS, STIFFENING, straight

if TYPE_CHECKING:
    from .search import Found

Vector = NDArray[np.float64]

# where fits begin: a spring that rings is nearly right near its own numbers only. Parts of the straight one's
# stiffness, and by what part of itself it is stiffer at that one's root mean square stretch
SOFTER, HARDER = (0.55, 0.75, 0.9, 1.1), (0.05, 0.2, 0.7, 2.0)
# and the straight one that is nearest: times the stiffness at rest
CHORDS = (1.0, 1.15, 1.3, 1.5, 1.75, 2.0, 2.5)
# part of what a straight spring leaves above noise that one which stiffens leaves, or it is straight
STIFFENS = 0.8
# part of the energy that is there without it which a straight spring may leave and need no other form
CLOSE = 0.02


def stiffer(
    problem: Problem,
    whiten: Whitening,
    found: Sequence[Found],
    fit: Refined,
    parts: Sequence[Part],
    item: Found,
    before: float,
) -> Refined:
    """The fit with a spring that stiffens, where that leaves clearly less; the fit itself where it does not.

    Args:
        problem: The question.
        whiten: Its nuisances.
        found: Findings, the spring among them.
        fit: Their joint fit.
        parts: Bands of what is left.
        item: The one that is asked about, a spring or not.
        before: Sum of squares that is left without it.
    """
    columns = [name for name in SPRINGS.get(item.effect, ()) if math.isfinite(fit.rows[item.key].values[name])]
    row = fit.rows[item.key]
    left = _above(fit)
    if not columns or STIFFENING in row.values or clamped(problem, item.at):
        return fit
    loud = before - len(fit.left)
    if not CLOSE * loud < left < loud:
        # it is straight, or explains nothing
        return fit
    stretch = _stretch(problem, fit, item)
    if not stretch > 0.0:
        return fit

    def bent(softer: float, harder: float) -> EffectRow:
        values = {name: softer * row.values[name] for name in columns}
        return EffectRow(item.at, {**row.values, **values, STIFFENING: harder / stretch**2})

    def leaves(begun: EffectRow) -> float:
        rest = left_with(problem, whiten, tables({**fit.rows, item.key: begun}))
        return float(rest @ rest)

    begun = min((bent(softer, harder) for softer in SOFTER for harder in HARDER), key=leaves)
    trial = [replace(one, row=begun if one.key == item.key else fit.rows[one.key]) for one in found]
    other = refined(problem, whiten, trial, parts)
    return other if _above(other) < STIFFENS * left else fit


def straightened(
    problem: Problem, whiten: Whitening, found: Sequence[Found], fit: Refined, parts: Sequence[Part]
) -> Refined:
    """The fit with straight springs in the place of those that stiffen; itself where none does."""
    bent = [item for item in found if STIFFENING in fit.rows[item.key].values]
    if not bent:
        return fit
    rows = {key: straight(row) for key, row in fit.rows.items()}

    def leaves(begun: Mapping[tuple[str, int], EffectRow]) -> float:
        rest = left_with(problem, whiten, tables(begun))
        return float(rest @ rest)

    for item in bent:
        values = rows[item.key].values
        chords = [
            EffectRow(item.at, {**values, **{name: times * values[name] for name in SPRINGS[item.effect]}})
            for times in CHORDS
        ]
        rows[item.key] = min(chords, key=lambda row, key=item.key: leaves({**rows, key: row}))
    return refined(problem, whiten, [replace(item, row=rows[item.key]) for item in found], parts)


def _above(fit: Refined) -> float:
    """Sum of squares above noise that a fit leaves."""
    return float(fit.left @ fit.left) - len(fit.left)


def _stretch(problem: Problem, fit: Refined, item: Found) -> float:
    """Root mean square stretch of a straight spring along all runs."""
    robots = problem.robots(tables({key: straight(row) for key, row in fit.rows.items()}))
    runs = problem.evidence.runs
    squares = [stretch_of(robot, run, item.effect, item.at) ** 2 for robot, run in zip(robots, runs, strict=True)]
    return math.sqrt(float(np.mean(squares)))
