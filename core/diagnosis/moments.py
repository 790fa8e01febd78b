"""What moments of inertia that a fit left out of a body do to the numbers that it has.

A load or what an arm has more is found as mass and first moments wherever its moments of inertia show nothing of their
own. No body is a point, and what these would say the others say for them: an axis feels m c^2 and I as one. So their
intervals are widened by what moments of a body's usual size would move them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .fit import Part, spread
from .model import tables
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined, left_with, taken_up

Vector = NDArray[np.float64]

MOMENTS = ("Ixx", "Iyy", "Izz")
# a load's moment of inertia about its centre, as part of its mass times the square of how far that is away
USUAL = 0.25


def with_moments(problem: Problem, whiten: Whitening, fit: Refined, parts: Sequence[Part]) -> Refined:
    """A fit whose intervals know of the moments of inertia that were left out of its bodies.

    Args:
        problem: The runs that were fitted.
        whiten: Their nuisances.
        fit: Of them.
        parts: Of their evidence.
    """
    covariance = fit.covariance
    free = set(fit.free)
    left: Vector | None = None
    for (effect, at), row in fit.rows.items():
        missing = [name for name in MOMENTS if name in row.values and (effect, at, name) not in free]
        usual = _usual(problem, effect, row) if missing else 0.0
        if usual == 0.0:
            continue
        if left is None:
            left = left_with(problem, whiten, tables(fit.rows))
        there = (EffectRow(row.at, {**row.values, name: row.values[name] + usual}) for name in missing)
        change = [left_with(problem, whiten, tables({**fit.rows, (effect, at): one})) - left for one in there]
        moved = taken_up(fit, np.column_stack(change), spread(left, parts))
        covariance = covariance + moved @ moved.T
    return replace(fit, covariance=covariance)


def _usual(problem: Problem, effect: str, row: EffectRow) -> float:
    """A usual moment of inertia of what a row adds [kg m^2]; 0 where that is no body."""
    values = row.values
    if effect == "payload":
        return USUAL * values["mass"] * (values["x"] ** 2 + values["y"] ** 2 + values["z"] ** 2)
    if effect == "link_inertia":
        arm = problem.database.inertias[row.at - 1]
        # these are about the arm's frame: what differs is as far from it as its moments say, or as the arm's own mass
        away = math.sqrt(math.hypot(*arm.com) ** 2 + 0.5 * (arm.xx + arm.yy + arm.zz) / arm.mass) if arm.mass else 0.0
        mass, first = abs(values["mass"]), math.hypot(values["mx"], values["my"], values["mz"])
        return max(first * away, first**2 / mass if mass else 0.0)
    return 0.0
