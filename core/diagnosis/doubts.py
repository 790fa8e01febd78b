"""Intervals that know of a law whose form is another one: its numbers depend on what they are asked for.

The straight spring that moves an arm most like one that stiffens is not the one whose torque is nearest to its; and
friction that yields is one number near rest, and another one at speed. How far these are apart is no matter of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .beyond import CONSTANT, LIMIT, SPRINGS, STIFFENING, beyond_of, by_catalogue, harmonics
from .fit import Part, gained, spread
from .forms import have_other_forms, law_along, other_forms
from .found import Found, gives_alone
from .hypothesis import clamped, defaults
from .inverse import stretch_of
from .model import tables
from .nuisances import Whitening
from .problem import BODIES, Problem
from .refine import PLAY, SHAPES, Refined, covariance_of
from .unseen import EARNS

Vector = NDArray[np.float64]
# a number is moved by so much of itself, and what two numbers do is alike where it differs by less than this part
STEP, SAME = 1.0e-3, 1.0e-2
# part of itself by which play may be wider or narrower that an arm bounces in: of robots whose play is up to twice as
# much apart none is like the real one, and which fit comes nearest is a matter of chance
BOUNCED = 0.015
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
    out = _beyond(problem, fit, nearest) | _harmonics(problem, found, fit) | _widths(problem, found, fit)
    return out | {
        key: max(value, out.get(key, 0.0)) for key, value in _formed(problem, whiten, found, fit, parts).items()
    }


def doubted(fit: Refined, doubts: Doubts) -> Refined:
    """A fit whose intervals reach as far."""
    extra = np.array([doubts.get(key, 0.0) for key in fit.free])
    return replace(fit, covariance=fit.covariance + np.diag(extra**2)) if extra.any() else fit


def untold(
    problem: Problem, found: Sequence[Found], fit: Refined, with_moments: Refined, doubts: Doubts
) -> list[Found]:
    """Findings of which there may as well be nothing: what it would be lies in the region of 95 % of their amounts.

    Beside others they helped, by numbers of which nothing is known: what they took away is another cause's. Springs and
    limits, of which there is none where they are infinite, are always told; a law that is of another form than it was
    known to be is there, though one number of it may be what it was; and so is what others need. Moments that were left
    out of a body may say what others were found for, but there are none without a body.

    Args:
        problem: The runs that were fitted.
        found: Findings.
        fit: Of all their numbers.
        with_moments: The same, whose intervals know of moments of inertia that were left out of bodies.
        doubts: What of both is for laws of other forms.
    """

    def may_be_nothing(item: Found, beyond: Doubts) -> bool:
        return _may_be_nothing(problem, fit if item.effect in BODIES else with_moments, item, beyond)

    unsure = [item for item in found if may_be_nothing(item, {}) and not gives_alone(problem, found, item)]
    bent = have_other_forms(problem, found) if unsure and doubts else ()
    return [item for item in unsure if item.key not in bent or may_be_nothing(item, doubts)]


def _may_be_nothing(problem: Problem, fit: Refined, item: Found, doubts: Doubts) -> bool:
    """Whether there may as well be nothing of it, but for these doubts."""
    stats: Any = import_module("scipy.stats")
    known = problem.row_at(item.effect, item.at, {})
    nothing = known.values if known else defaults(item.effect)
    own = fit.numbers_of(item.key)
    amounts = [k for k in own if fit.shown[k] and fit.free[k][2] not in SHAPES]
    names = [fit.free[k][2] for k in amounts]
    away = np.array([fit.rows[item.key].values[name] - nothing.get(name, 0.0) for name in names])
    if not amounts or not np.isfinite(away).all():
        return False
    doubt = np.array([doubts.get(fit.free[k], 0.0) for k in amounts])
    covariance = fit.covariance[np.ix_(amounts, amounts)] - np.diag(doubt**2)
    # a spring may be soft and far away or hard and near: its torque is known far better than both; and what no run
    # shows may be anything, as may be what shows with it alone
    given = [k for k in own if k not in amounts and (fit.free[k][2] == "rest" or not fit.shown[k])]
    both, held = fit.covariance[np.ix_(amounts, given)], fit.covariance[np.ix_(given, given)]
    covariance = covariance - both @ covariance_of(held) @ both.T
    # of numbers that go together some combinations may be known exactly
    size = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(size, size)
    far = float(away / size @ np.linalg.pinv(correlation, hermitian=True) @ (away / size))
    return far < float(stats.chi2.ppf(0.95, len(amounts)))


def _beyond(problem: Problem, fit: Refined, nearest: Refined) -> dict[tuple[str, int, str], float]:
    """From laws beyond the catalogue's to those in their place; of a spring's, the straight one nearest in torque."""
    out: dict[tuple[str, int, str], float] = {}
    for (effect, at), row in fit.rows.items():
        stiffening = row.values.get(STIFFENING, 0.0)
        chord = 1.0 + stiffening * _fourth(problem, fit, effect, at) if stiffening else 1.0
        if not stiffening and effect not in (LIMIT, CONSTANT):
            continue
        for place in (place for place in nearest.free if place[:2] == (effect, at)):
            own = row.values[place[2]] * (chord if place[2] in SPRINGS.get(effect, ()) else 1.0)
            out[place] = abs(own - nearest.rows[effect, at].values[place[2]])
    return out


def _fourth(problem: Problem, fit: Refined, effect: str, at: int) -> float:
    """Sum of the fourth power of a spring's stretch over that of its square, along all runs [rad^2 or m^2]."""
    rows = tables(fit.rows)
    squares, fourth = 0.0, 0.0
    e = problem.evidence
    for robot, run, nominal in zip(problem.robots(rows), e.runs, e.nominals, strict=True):
        stretch = stretch_of(robot, run, nominal, effect, at, beyond_of(rows))
        squares += float(np.sum(stretch**2))
        fourth += float(np.sum(stretch**4))
    return fourth / squares if squares > 0.0 else 0.0


def _formed(
    problem: Problem, whiten: Whitening, found: Sequence[Found], fit: Refined, parts: Sequence[Part]
) -> dict[tuple[str, int, str], float]:
    """How far numbers go where other forms of the laws are fitted beside them; nowhere where these earn nothing."""
    optimize: Any = import_module("scipy.optimize")

    whole = [replace(item, row=fit.rows[item.key]) for item in found]
    placed = other_forms(problem, whole)
    forms = [form for _, form in placed]
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
    # numbers that do the same go no farther for it
    firm = np.hstack([SAME * np.eye(free), np.zeros((free, len(forms)))])
    target = np.concatenate([-fit.left / sigma, np.zeros(free)])
    solution = optimize.lsq_linear(np.vstack([system, firm]), target, bounds=(least, most))
    amounts = np.asarray(solution.x, dtype=np.float64)
    left = fit.left + (system @ amounts) * sigma
    if gained(fit.left, left, spread(left, parts), parts) < EARNS:
        return {}
    moved = amounts[:free] / np.where(size > 0.0, size, np.inf)
    out = {key: abs(float(move)) for key, move in zip(fit.free, moved, strict=True)}
    for k, item in enumerate(whole):
        more = [
            amount * np.concatenate(form.law)
            for amount, (j, form) in zip(amounts[free:].tolist(), placed, strict=True)
            if j == k and form.law
        ]
        own = fit.numbers_of(item.key)
        if more and own:
            shifts = _taken_up(problem, whole, k, fit, np.sum(more, axis=0), own)
            for j, shift in zip(own, shifts.tolist(), strict=True):
                out[fit.free[j]] = max(out[fit.free[j]], abs(float(moved[j] + shift)))
    return out


def _harmonics(problem: Problem, found: Sequence[Found], fit: Refined) -> dict[tuple[str, int, str], float]:
    """Of waves that come twice as often as well: how far the numbers of the plain wave that is nearest are."""
    whole = [replace(item, row=by_catalogue(fit.rows[item.key])) for item in found]
    out: dict[tuple[str, int, str], float] = {}
    for k, item in enumerate(whole):
        for twice in harmonics(fit.rows[item.key])[1:]:
            more = np.concatenate(law_along(problem, whole, k, twice))
            own = [j for j in fit.numbers_of(item.key) if fit.free[j][2] in item.row.values]
            shifts = _taken_up(problem, whole, k, fit, more, own)
            out |= {fit.free[j]: abs(float(shift)) for j, shift in zip(own, shifts, strict=True)}
    return out


def _widths(problem: Problem, found: Sequence[Found], fit: Refined) -> dict[tuple[str, int, str], float]:
    """Of play in which arms bounce: clamped ones do not."""
    loose = [item.key for item in found if item.effect == PLAY and not clamped(problem, item.at)]
    return {(*key, "gap"): BOUNCED * fit.rows[key].values["gap"] for key in loose}


def _taken_up(
    problem: Problem, found: Sequence[Found], k: int, fit: Refined, more: Vector, own: Sequence[int]
) -> Vector:
    """By what a finding's numbers take up what its law says more, least squares along the runs whatever the noise.

    A fit weighs what noise leaves clear, and a law that is nearest where it counts is not the one that is nearest.

    Args:
        problem: The runs.
        found: Findings.
        k: Place of this one.
        fit: Its numbers.
        more: What its law says more, run after run, shape (M,).
        own: Places of the numbers that are asked for.
    """
    item = found[k]
    here = np.concatenate(law_along(problem, found, k, item.row))
    columns: list[Vector] = []
    steps: list[float] = []
    for j in own:
        name = fit.free[j][2]
        step = STEP * (abs(item.row.values[name]) or 1.0)
        there = law_along(
            problem, found, k, EffectRow(item.at, {**item.row.values, name: item.row.values[name] + step})
        )
        columns.append(np.concatenate(there) - here)
        steps.append(step)
    size = np.array([float(np.linalg.norm(column)) or 1.0 for column in columns])
    slope = np.column_stack(columns) / size
    return np.asarray(np.linalg.lstsq(slope, more, rcond=SAME)[0] / size * np.array(steps), dtype=np.float64)
