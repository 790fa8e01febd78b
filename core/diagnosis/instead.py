"""Other names in the place of findings: one for several, and another one that says more or the same with less."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .bodies import fitted_as_bodies
from .contender import NUMBER, THRESHOLD, found_of
from .fit import Part, energy_of, gained, spread, takes_the_same
from .found import beside_or_more, never_slipping, rows_of, stuck_joints, without_bodies
from .hypotheses import names_of_one, twins_of
from .hypothesis import Hypothesis
from .refine import free_columns, left_with, refined, removal
from .state import CRUMB, Search, contenders, prune
from .tried import ALIKE, SIMPLER

# names that are tried in the place of several
MOST_CONDENSED = 4
# findings in whose place others are put, and how many of the likeliest and of plainer ones are tried in that of one
MOST_SWAPPED, SWAPPED = 3, 2


def condense(state: Search, parts: Sequence[Part]) -> None:
    """Put one cause in the place of several that together say what it says alone.

    Where the largest share of a gap was picked first by another name, or by a form with too few numbers, the rest of it
    is made up of small ones.
    """
    tried: list[Hypothesis] = []
    for contender in state.first:
        if len(state.found) < 2 or len(tried) == MOST_CONDENSED or not contender.earns:
            return
        hypothesis = contender.hypothesis
        key, rows = hypothesis.key, hypothesis.rows(contender.beta)
        there = next((item for item in state.found if item.key == key), None)
        fuller = there is None or contender.numbers > len(free_columns(there.effect, there.row))
        if rows is None or key in state.out or not fuller or any(h.key == key for h in tried):
            continue
        tried.append(hypothesis)
        if len(state.found) == 2 and state.alone.get(key, 0.0) > _best_alone(state):
            # it would have to say alone what one of the two said better
            continue
        trial = [replace(item, gain=0.0) for item in (found_of(contender, rows), *state.found) if item is not there]
        trial, fit, _ = fitted_as_bodies(state.problem, state.whiten, trial, parts)
        other = Search(state.problem, state.whiten)
        prune(other, trial, fit, parts, keep=key)
        if without_bodies(state.problem, other.found) or not other.found:
            continue
        sigma = spread(state.left, parts)
        worse = 0.5 * (energy_of(other.left / sigma) - energy_of(state.left / sigma))
        fewer = len(state.found) - len(other.found)
        numbers = state.slope.shape[1] - other.slope.shape[1]
        # with more numbers than all of them another must say more than they do, not the same
        another = numbers < 0 and there is None
        if fewer > 0 and worse < (0.0 if another else fewer * THRESHOLD) + NUMBER * numbers:
            again = refined(state.problem, state.whiten, other.found, parts)
            prune(state, other.found, again, parts)


def swapped(state: Search, parts: Sequence[Part]) -> bool:
    """Put another name in the place of a finding, where that says more or the same with less; whether there is one.

    A cause is picked beside what was fitted by then: the largest alone may come before the one that goes with others,
    and one with more numbers before the plain one that says the same once the others are there. What could not be then
    may be beside them.
    """
    if len(state.found) < 2:
        return False
    problem, whiten = state.problem, state.whiten
    fit = refined(problem, whiten, state.found, parts)
    sigma = spread(fit.left, parts)
    for item in sorted(state.found, key=lambda one: one.gain):
        if item.absent is None:
            continue
        moved = removal(fit, item.key, item.absent).rows
        others = [replace(other, row=moved[other.key]) for other in state.found if other is not item]
        beside = Search(problem, whiten, others, signatures=state.signatures, scales=state.scales, banned=state.banned)
        beside.left = left_with(problem, whiten, rows_of(others))
        own = fit.numbers_of(item.key)
        beside.slope = np.delete(fit.slope, own, axis=1)
        same = SIMPLER * (energy_of(beside.left) - energy_of(fit.left))
        # a load and its arm's inertia are one body, but with some of its numbers only one may say more than the other
        same_name = {item.key} if item.key in twins_of(problem) else names_of_one(problem, *item.key)
        options = contenders(beside, parts, sorted(same_name))
        # before all of its numbers are free a plainer one may seem to leave more
        near = energy_of(fit.left) + CRUMB * (energy_of(beside.left) - energy_of(fit.left))
        plain = [one for one in options if one.numbers < len(own) and energy_of(one.left) < near]
        better = [one for one in options[:SWAPPED] if gained(fit.left, one.left, sigma, parts) >= -THRESHOLD]
        for contender in dict.fromkeys((*plain[:SWAPPED], *better)):
            rows = contender.hypothesis.rows(contender.beta)
            if rows is None:
                continue
            # more numbers of a finding that is there are no second one
            trial = beside_or_more(others, [found_of(contender, rows)])
            other = Search(problem, whiten)
            trial, joint, _ = fitted_as_bodies(problem, whiten, trial, parts)
            prune(other, trial, joint, parts)
            unreal = without_bodies(problem, other.found) | never_slipping(problem, other.found)
            if unreal or stuck_joints(problem, other.found) or not other.found:
                continue
            more = other.slope.shape[1] - fit.slope.shape[1]
            second = len(other.found) - len(state.found)
            # another one with more numbers than those that it replaces must say more than they do, not the same
            another = more > 0 and contender.hypothesis.key not in {one.key for one in others}
            dearer = THRESHOLD * (max(second, 0) if another else second) + NUMBER * more
            plainer = more < 0 and second <= 0
            # what takes something else away, of a channel that nothing explains, is no other name
            alike = takes_the_same(beside.left, fit.left, other.left, sigma)
            as_much = plainer and alike and energy_of(other.left) - energy_of(fit.left) < same
            if as_much:
                # moved in a straight line, others may come to where they leave more than nothing does
                rest = refined(problem, whiten, others, parts).left
                same = min(same, SIMPLER * (energy_of(rest) - energy_of(fit.left)))
                as_much = energy_of(other.left) - energy_of(fit.left) < same
            if as_much or gained(fit.left, other.left, sigma, parts) > dearer + ALIKE:
                state.found, state.left, state.slope = other.found, other.left, other.slope
                return True
    return False


def _best_alone(state: Search) -> float:
    """What the best of the findings left alone; infinity where none was tried so."""
    return min((state.alone.get(item.key, math.inf) for item in state.found), default=math.inf)
