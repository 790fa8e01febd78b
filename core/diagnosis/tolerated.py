"""Intervals that know what the database's tolerances make of the effects that were found.

Along the nominal robot's motion tolerances are taken out where they show. What they only do beside an effect, as a mass
that is off to what a tilt makes of it, shows nowhere there: by as much the effect's own number may be off.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from .fit import Part, spread
from .model import merged, tables
from .nuisances import Whitening, tolerance_columns
from .problem import Problem
from .refine import Refined, left_with, taken_up


def with_tolerances(
    problem: Problem, whiten: Whitening, fit: Refined, parts: Sequence[Part], effects: Collection[str] | None = None
) -> Refined:
    """A fit whose intervals know of that.

    Args:
        problem: The runs that were fitted.
        whiten: Their nuisances, the tolerances of the nominal robot among them.
        fit: Of them, with the catalogue's laws.
        parts: Of their evidence.
        effects: Whose numbers are told so; None: all.
    """
    asked = [k for k, (effect, _, _) in enumerate(fit.free) if effects is None or effect in effects]
    if not asked:
        return fit
    rows = tables(fit.rows)
    beside = tolerance_columns(replace(problem, known=merged(problem.known, rows)))
    if not beside.shape[1]:
        return fit
    change = whiten(beside - whiten.columns[:, : beside.shape[1]])
    moved = taken_up(fit, change, spread(left_with(problem, whiten, rows), parts))
    moved[np.setdiff1d(np.arange(len(fit.free)), asked)] = 0.0
    return replace(fit, covariance=fit.covariance + moved @ moved.T)
