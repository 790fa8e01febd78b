"""Findings fitted as what can exist: masses as bodies, hysteresis that slips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ..effects import EffectRow
from .contender import NUMBER
from .fit import Part, gained, spread
from .found import Found, at_points, embodied, hung, never_slipping, without_bodies
from .hypothesis import TENSOR
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined, refined

# moments of a load that is spread along other axes than its frame's
PRODUCTS = TENSOR[3:]


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


def plainer_loads(
    problem: Problem, whiten: Whitening, found: Sequence[Found], fit: Refined, parts: Sequence[Part]
) -> Iterator[list[Found]]:
    """Findings with a load at a point, or without products, where its moments say no more than they cost.

    Where a load is picked before anything else its mass may be a little off without its moments, and these take up for
    all that it is off by; once every number is free they need not.
    """
    load = next((item for item in found if item.effect == "payload"), None)
    known = problem.row_at("payload", 0, {})
    sigma = spread(fit.left, parts)
    for names in (TENSOR, PRODUCTS) if load else ():
        before = {name: known.values[name] if known else 0.0 for name in names}
        row = EffectRow(0, {**fit.rows["payload", 0].values, **before})
        if row.values == fit.rows["payload", 0].values:
            continue
        trial = [replace(item, row=row if item is load else fit.rows[item.key]) for item in found]
        other = refined(problem, whiten, trial, parts)
        fewer = len(fit.free) - len(other.free)
        if fewer > 0 and gained(other.left, fit.left, sigma, parts) < NUMBER * fewer:
            yield _fitted(trial, other)


def _fitted(found: Sequence[Found], fit: Refined) -> list[Found]:
    return [replace(item, row=fit.rows[item.key]) for item in found]


def _unreal(problem: Problem, found: Sequence[Found], fit: Refined) -> set[tuple[str, int]]:
    fitted = _fitted(found, fit)
    return without_bodies(problem, fitted) | never_slipping(problem, fitted)
