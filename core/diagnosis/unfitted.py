"""What numbers that a fit left out of its findings do to those that it has.

A load or what an arm has more is found as mass and first moments wherever its moments of inertia show nothing of their
own. No body is a point, and what these would say the others say for them: an axis feels m c^2 and I as one. So is an
arm that is off found by one number of its geometry wherever that explains all: another one that says nearly the same
may be off as well. Their intervals are widened by what such numbers of a usual size would move them, as far as the runs
let these be there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .fit import Part, spread
from .model import tables
from .nuisances import Whitening
from .plain import stray, usual_length
from .problem import Problem
from .refine import Refined, left_with, taken_up

Vector = NDArray[np.float64]
Key = tuple[str, int]

# what is usual of each, as part of what is of a moment: no product is more than half of the largest of these
MOMENTS = {"Ixx": 1.0, "Iyy": 1.0, "Izz": 1.0, "Ixy": 0.5, "Ixz": 0.5, "Iyz": 0.5}
GEOMETRY = ("alpha", "a", "theta", "d", "beta")
# a load's moment of inertia about its centre, as part of its mass times the square of how far that is away
USUAL = 0.25


def with_moments(problem: Problem, whiten: Whitening, fit: Refined, parts: Sequence[Part]) -> Refined:
    """A fit whose intervals know of the moments of inertia that were left out of its bodies.

    That there is a body they do not put in doubt: no moment is without a mass.

    Args:
        problem: The runs that were fitted.
        whiten: Their nuisances.
        fit: Of them.
        parts: Of their evidence.
    """
    usual: dict[Key, dict[str, float]] = {}
    for key, row in fit.rows.items():
        moment, fitted = _moment(problem, key[0], row), _fitted(fit, key)
        if moment:
            usual[key] = {name: part * moment for name, part in MOMENTS.items() if name not in fitted}
    return _widened(problem, whiten, fit, parts, usual)


def with_geometry(problem: Problem, whiten: Whitening, fit: Refined, parts: Sequence[Part]) -> Refined:
    """A fit whose intervals know of the other numbers of arms that are off, which may be as far off as those it has.

    That an arm is off they do not put in doubt: which of its numbers is, and how far. Arguments as `with_moments`.
    """
    usual: dict[Key, dict[str, float]] = {}
    for key, row in fit.rows.items():
        if key[0] != "kinematic_error":
            continue
        known, fitted = problem.row_at(*key, {}), _fitted(fit, key)
        found = {name: row.values[name] - (known.values[name] if known else 0.0) for name in fitted}
        off = max((abs(more) / stray(problem, name) for name, more in found.items()), default=0.0)
        usual[key] = {name: off * stray(problem, name) for name in GEOMETRY if off and name not in fitted}
    return _widened(problem, whiten, fit, parts, usual)


def _fitted(fit: Refined, key: Key) -> set[str]:
    """Names of a finding's numbers that are fitted."""
    return {fit.free[k][2] for k in fit.numbers_of(key)}


def _widened(
    problem: Problem, whiten: Whitening, fit: Refined, parts: Sequence[Part], usual: Mapping[Key, Mapping[str, float]]
) -> Refined:
    """A fit whose intervals know of other numbers of its findings, each there by as much as is usual.

    What of these the fit's own numbers cannot say the runs would show: by that they are known themselves.
    """
    covariance = fit.covariance
    left: Vector | None = None
    for key, more in usual.items():
        if not more:
            continue
        if left is None:
            left = left_with(problem, whiten, tables(fit.rows))
        row = fit.rows[key]
        there = (EffectRow(row.at, {**row.values, name: row.values[name] + size}) for name, size in more.items())
        change = np.column_stack([left_with(problem, whiten, tables({**fit.rows, key: one})) - left for one in there])
        sigma = spread(left, parts)
        moved = taken_up(fit, change, sigma)
        seen = (change - fit.slope @ moved) / sigma[:, None]
        known = np.linalg.inv(np.eye(len(more)) + seen.T @ seen)
        covariance = covariance + moved @ known @ moved.T
    return replace(fit, covariance=covariance)


def _moment(problem: Problem, effect: str, row: EffectRow) -> float:
    """A usual moment of inertia of what a row adds [kg m^2]; 0 where that is no body."""
    values = row.values
    if effect == "payload":
        return USUAL * values["mass"] * (values["x"] ** 2 + values["y"] ** 2 + values["z"] ** 2)
    if effect == "link_inertia":
        arm = problem.database.inertias[row.at - 1]
        # these are about the arm's frame: what differs is as far from it as its moments say, or as the arm's own mass
        away = math.sqrt(math.hypot(*arm.com) ** 2 + 0.5 * (arm.xx + arm.yy + arm.zz) / arm.mass) if arm.mass else 0.0
        mass, found = abs(values["mass"]), math.hypot(values["mx"], values["my"], values["mz"])
        first = max(found, mass * usual_length(problem))
        return max(first * away, first**2 / mass if mass else 0.0)
    return 0.0
