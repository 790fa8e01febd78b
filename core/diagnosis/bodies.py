"""Findings fitted as what can exist: masses as bodies, hysteresis that slips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .fit import Part
from .found import Found, at_points, embodied, hung, never_slipping, without_bodies
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined, refined


def fitted_as_bodies(
    problem: Problem, whiten: Whitening, found: Sequence[Found], parts: Sequence[Part]
) -> tuple[list[Found], Refined, set[tuple[str, int]]]:
    """The joint fit of findings; what comes out as no body is given moments of inertia, put at a point, or hung up.

    Returns:
        The findings that were fitted, their fit, and those that cannot be all the same: masses that are no bodies, and
        hysteresis that never slips.
    """
    trial, fit = list(found), refined(problem, whiten, found, parts)
    unreal = _unreal(problem, trial, fit)
    for bodies in (embodied, at_points, hung):
        if unreal and (other := bodies(problem, _fitted(trial, fit), unreal)) is not None:
            trial, fit = other, refined(problem, whiten, other, parts)
            unreal = _unreal(problem, trial, fit)
    return trial, fit, unreal


def _fitted(found: Sequence[Found], fit: Refined) -> list[Found]:
    return [replace(item, row=fit.rows[item.key]) for item in found]


def _unreal(problem: Problem, found: Sequence[Found], fit: Refined) -> set[tuple[str, int]]:
    fitted = _fitted(found, fit)
    return without_bodies(problem, fitted) | never_slipping(problem, fitted)
