"""The best few names with all their numbers free: the one that explains most, or is likeliest by its own noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..parallel import side_by_side
from .beyond import how_many, number_of
from .contender import DEARER, NUMBER, THRESHOLD, Contender, found_of
from .fit import Part, energy_of, gained, spread
from .found import Found, rows_of
from .other_laws import beyond_catalogue
from .refine import PLAY, Refined, at_its_width, refined
from .state import Search

# others are names of the same finding where their evidence is so near
ALIKE = 5.0
# what a name may leave more than the best one, as part of the gap's energy, and still not be told apart
ALIKE_SHARE = 0.01
# names that are fitted with all their numbers free before one is chosen
MOST_TRIED = 5
# names that explain the gap alike but for this part of its energy are told apart by likelihood
SAME_ENERGY = 0.02
# of those that differ by no more than this part of it, the simplest is taken: laws are never as exact as that
SIMPLER = 0.002


def best_tried(
    state: Search,
    good: Sequence[Contender],
    order: Sequence[Contender],
    parts: Sequence[Part],
    *,
    rings: bool = False,
) -> Found | None:
    """The best few with all their numbers free, together with what was found: the one that explains most.

    Of springs that ring, each making its own noise, the likeliest by that.
    """
    likely = [one for one in order if one.earns]
    # a name may be tried twice, in the likeliest of its forms and in the one that explains most
    chosen: dict[int, tuple[Contender, Found]] = {}
    for contender in _few(likely, 2) + _few(good, MOST_TRIED):
        rows = contender.hypothesis.rows(contender.beta)
        if rows is not None and len(chosen) < MOST_TRIED:
            chosen.setdefault(id(contender), (contender, found_of(contender, rows)))

    def fitted(one: tuple[Contender, Found]) -> Refined:
        return _with_all_numbers(state, one[1], parts)

    fits = side_by_side(fitted, list(chosen.values()))
    tried = [(contender, item, fit) for (contender, item), fit in zip(chosen.values(), fits, strict=True)]
    if not state.found:
        for _, item, fit in tried:
            state.alone[item.key] = min(energy_of(fit.left), state.alone.get(item.key, math.inf))
    if not tried:
        return None
    least = min((fit.left for _, _, fit in tried), key=energy_of)
    sigma = spread(least, parts)
    scored = [
        (
            gained(state.left, fit.left, sigma, parts) - NUMBER * (contender.numbers + _numbers_beyond(fit, item)),
            contender,
            item,
            fit,
        )
        for contender, item, fit in tried
    ]
    earning = [entry for entry in scored if entry[0] >= THRESHOLD]
    if not earning:
        return None
    if rings:
        return _by_own_noise(state, [(gain, item, fit) for gain, _, item, fit in earning], parts)
    # the largest cause first: what it leaves unexplained elsewhere is easily taken for small ones
    worth = [
        (energy_of(state.left) - energy_of(fit.left)) / (contender.price + DEARER * _numbers_beyond(fit, item))
        for _, contender, item, fit in earning
    ]
    most = max(worth)
    as_much = [entry for entry, one in zip(earning, worth, strict=True) if one >= most - SAME_ENERGY * abs(most)]
    best = max(as_much, key=lambda entry: entry[0])
    margin = SIMPLER * (energy_of(state.left) - energy_of(best[3].left))
    same = (
        entry
        for entry in as_much
        if entry[0] > best[0] - ALIKE or energy_of(entry[3].left) < energy_of(best[3].left) + margin
    )
    gain, _, item, fit = min(same, key=lambda entry: (len(entry[3].free), -entry[0]))
    return replace(item, row=fit.rows[item.key], gain=gain)


def _with_all_numbers(state: Search, item: Found, parts: Sequence[Part]) -> Refined:
    """One cause more fitted beside what was found, all numbers free; by a law beyond the catalogue where that is so."""
    trial = [*state.found, item]
    fit = refined(state.problem, state.whiten, trial, parts)
    if item.effect == PLAY:
        fit = at_its_width(state.problem, state.whiten, trial, fit, parts, item.at)
    return beyond_catalogue(state.problem, state.whiten, trial, fit, parts, item, energy_of(state.left))


def _by_own_noise(state: Search, tried: Sequence[tuple[float, Found, Refined]], parts: Sequence[Part]) -> Found:
    """Of springs, each with its gain and the fit with it, the one that is likeliest with the noise that it makes.

    What rings makes many times its sensors' noise of it where it rings: in one noise for all the one that rings a
    little beside the truth would win by what it makes of noise.
    """
    scored: list[tuple[float, float, Found, Refined]] = []
    for gain, item, fit in tried:
        trial = [*(replace(one, row=fit.rows[one.key]) for one in state.found), replace(item, row=fit.rows[item.key])]
        problem = state.problem.heard(rows_of(trial), exactly=True)
        whiten = state.whiten.told_by(state.problem.evidence, problem.evidence)
        own = refined(problem, whiten, trial, parts)
        sigma = spread(own.left, parts)
        likely = float(np.sum(np.log(problem.evidence.weights / sigma)) + np.sum(np.log(whiten.shrink)))
        likely -= 0.5 * energy_of(own.left / sigma) + NUMBER * len(own.numbers_of(item.key))
        scored.append((likely, gain, item, fit))
    best = max(likely for likely, *_ in scored)
    _, gain, item, fit = min(
        (entry for entry in scored if entry[0] > best - ALIKE), key=lambda entry: (len(entry[3].free), -entry[0])
    )
    return replace(item, row=fit.rows[item.key], gain=gain)


def _numbers_beyond(fit: Refined, item: Found) -> int:
    """How many numbers more a law beyond the catalogue's has, 0 for one of it."""
    return how_many(item.effect) * int(number_of(item.effect, fit.rows[item.key]) > 0.0)


def _few(order: Sequence[Contender], count: int) -> list[Contender]:
    """The first form of each of the first few names."""
    out: dict[tuple[str, int], Contender] = {}
    for contender in order:
        if len(out) == count:
            break
        out.setdefault(contender.hypothesis.key, contender)
    return list(out.values())
