"""Intervals that know of a law whose form is another one: its numbers depend on what they are asked for.

The straight spring that moves an arm most like one that stiffens is not the one whose torque is nearest to its; and
friction that yields is one number near rest, and another one at speed. How far these are apart is no matter of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .beyond import LIMIT, SPRINGS, STIFFENING, beyond_of
from .fit import Part, gained, spread
from .forms import other_forms
from .inverse import stretch_of
from .model import tables
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined
from .unseen import EARNS

if TYPE_CHECKING:
    from .search import Found

Vector = NDArray[np.float64]
# by effect, number of its place and column: how far a number may be another one [SI]
Doubts = Mapping[tuple[str, int, str], float]


def doubts_of(
    problem: Problem,
    whiten: Whitening,
    found: Sequence[Found],
    fit: Refined,
    nearest: Refined,
    parts: Sequence[Part],
) -> dict[tuple[str, int, str], float]:
    """How far numbers of laws of another form are from each other.

    Args:
        problem: The runs that were fitted.
        whiten: Their nuisances.
        found: Findings.
        fit: With laws beyond the catalogue's where there are any.
        nearest: With the catalogue's in their place, as they are handed on.
        parts: Of the evidence.
    """
    out = _beyond(problem, fit, nearest)
    return out | {
        key: max(value, out.get(key, 0.0)) for key, value in _formed(problem, whiten, found, fit, parts).items()
    }


def doubted(fit: Refined, doubts: Doubts) -> Refined:
    """A fit whose intervals reach as far."""
    extra = np.array([doubts.get(key, 0.0) for key in fit.free])
    return replace(fit, covariance=fit.covariance + np.diag(extra**2)) if extra.any() else fit


def _beyond(problem: Problem, fit: Refined, nearest: Refined) -> dict[tuple[str, int, str], float]:
    """From laws beyond the catalogue's to those in their place; of a spring's, the straight one nearest in torque."""
    out: dict[tuple[str, int, str], float] = {}
    for (effect, at), row in fit.rows.items():
        stiffening = row.values.get(STIFFENING, 0.0)
        chord = 1.0 + stiffening * _fourth(problem, fit, effect, at) if stiffening else 1.0
        if not stiffening and effect != LIMIT:
            continue
        for place in (place for place in nearest.free if place[:2] == (effect, at)):
            own = row.values[place[2]] * (chord if place[2] in SPRINGS.get(effect, ()) else 1.0)
            out[place] = abs(own - nearest.rows[effect, at].values[place[2]])
    return out


def _fourth(problem: Problem, fit: Refined, effect: str, at: int) -> float:
    """Sum of the fourth power of a spring's stretch over that of its square, along all runs [rad^2 or m^2]."""
    rows = tables(fit.rows)
    squares, fourth = 0.0, 0.0
    for robot, run in zip(problem.robots(rows), problem.evidence.runs, strict=True):
        stretch = stretch_of(robot, run, effect, at, beyond_of(rows))
        squares += float(np.sum(stretch**2))
        fourth += float(np.sum(stretch**4))
    return fourth / squares if squares > 0.0 else 0.0


def _formed(
    problem: Problem, whiten: Whitening, found: Sequence[Found], fit: Refined, parts: Sequence[Part]
) -> dict[tuple[str, int, str], float]:
    """How far numbers go where other forms of the laws are fitted beside them; nowhere where these earn nothing."""
    optimize: Any = import_module("scipy.optimize")

    whole = [replace(item, row=fit.rows[item.key]) for item in found]
    forms = other_forms(problem, whole)
    if not forms or not fit.free:
        return {}
    sigma = spread(fit.left, parts)
    columns = whiten(np.column_stack([form.column for form in forms])) / sigma[:, None]
    slope = fit.slope / sigma[:, None]
    size = np.linalg.norm(slope, axis=0)
    free = len(fit.free)
    system = np.hstack([slope / np.where(size > 0.0, size, 1.0), columns])
    least = np.r_[np.full(free, -np.inf), [form.within[0] for form in forms]]
    most = np.r_[np.full(free, np.inf), [form.within[1] for form in forms]]
    amounts = np.asarray(optimize.lsq_linear(system, -fit.left / sigma, bounds=(least, most)).x, dtype=np.float64)
    left = fit.left + (system @ amounts) * sigma
    if gained(fit.left, left, spread(left, parts), parts) < EARNS:
        return {}
    moved = amounts[:free] / np.where(size > 0.0, size, np.inf)
    return {key: abs(float(move)) for key, move in zip(fit.free, moved, strict=True)}
