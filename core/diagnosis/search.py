"""Which effects: all compete beside what was found, the largest cause first, until nothing earns its place.

Near where it starts every effect is linear, and its signature is worked out once. A round picks causes by their
signatures alone, as many as earn their place beside each other; then all of their numbers are fitted together to what
robots with these effects would really have said, and the next round begins from what is left. Those that the others
make needless are taken out again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np

from .bodies import fitted_as_bodies
from .contender import THRESHOLD, Contender, found_of, ranked
from .fit import Part, blocks, gained, spread
from .found import Found, beside_or_more, numbers_in, without_bodies
from .hypotheses import names_of_one, twins_of
from .hypothesis import GIVING, clamped
from .instead import MOST_SWAPPED, condense, swapped
from .refine import refined
from .ringing import one_spring, one_that_rings, rings_first, spring_instead, stiffens_instead
from .state import Search, contenders, fits_beside, prune
from .tried import ALIKE, SAME_ENERGY, SIMPLER, best_tried

# findings beside those that a robot with friction and an unknown rotor inertia in every joint has
MORE_THAN_USUAL = 6
# what is not linear is looked at closely where it explains this part of what the best does
CLOSE = 0.6
# picks that may come to nothing once all their numbers are free
MOST_FAILED = 3


def search(
    state: Search, tell: Callable[[str], None] | None = None, vain: Callable[[Search], bool] | None = None
) -> Search:
    """Find the effects, from where a search stands.

    Args:
        state: Where it stands.
        tell: Is told what was found.
        vain: Whether to give up there, as no answer would do; asked after every round.
    """
    parts = blocks(state.problem.evidence)
    _gather(state, parts, tell, vain)
    if vain and vain(state):
        return state
    if (instead := spring_instead(state, parts)) is not None:
        prune(state, *instead, parts)
        _gather(state, parts, tell)
    if (bent := stiffens_instead(state, parts)) is not None:
        prune(state, *bent, parts)
        _gather(state, parts, tell)
    condense(state, parts)
    one_spring(state, parts)
    for _ in range(MOST_SWAPPED):
        if not swapped(state, parts):
            break
    return state


def one_cause_more(state: Search, tell: Callable[[str], None] | None = None) -> bool:
    """Take the largest cause beside what was found; whether there is one that earns its place."""
    before = {item.key for item in state.found}
    _gather(state, blocks(state.problem.evidence), tell, most=len(before) + 1)
    return not before >= {item.key for item in state.found}


def _gather(
    state: Search,
    parts: Sequence[Part],
    tell: Callable[[str], None] | None,
    vain: Callable[[Search], bool] | None = None,
    most: int | None = None,
) -> None:
    """Take one cause after the other until none is left that earns its place, it is vain, or there are so many."""
    problem, whiten = state.problem, state.whiten
    most = 3 * problem.database.n + MORE_THAN_USUAL if most is None else most
    failed: list[set[tuple[str, int]]] = []
    let_go = False
    while len(state.found) < most and not (vain and vain(state)):
        before = list(state.found)
        out = sorted(set[tuple[str, int]]().union(*failed))
        picked = _picked(state, parts, most - len(before), out)
        if picked and not before and not failed and (ringing := rings_first(state, parts)):
            picked = ringing
        if not picked and not let_go and (giving := _letting_go(state, parts)):
            # judged when there is something beside it
            let_go, kept = True, [*before, *giving]
            state.take(kept, refined(problem, whiten, kept, parts))
            continue
        picked = picked or one_that_rings(state, parts, out)
        if not picked:
            break
        if tell:
            tell(", ".join(f"{item.effect} at {item.place}" for item in picked[:3]))
        trial = beside_or_more(before, picked)
        trial, fit, unreal = fitted_as_bodies(problem, whiten, trial, parts)
        if unreal:
            # what cannot exist is not there, and what never slips is a spring; the others try again
            state.unreal |= unreal
            trial = [item for item in trial if item.key not in unreal]
            if trial:
                prune(state, trial, refined(problem, whiten, trial, parts), parts)
            else:
                state.begin()
            continue
        sigma = spread(fit.left, parts)
        if gained(state.left, fit.left, sigma, parts) >= THRESHOLD:
            prune(state, trial, fit, parts)
            if without_bodies(problem, state.found):
                # what was one beside what is needless
                kept, fit, unreal = fitted_as_bodies(problem, whiten, state.found, parts)
                if not unreal:
                    prune(state, kept, fit, parts)
        if numbers_in(state.found) <= numbers_in(before):
            # what seemed best to its signature alone must not stand in the way of others
            failed.append({item.key for item in picked})
            if len(failed) == MOST_FAILED:
                break
    if let_go:
        prune(state, state.found, refined(problem, whiten, state.found, parts), parts)


def _letting_go(state: Search, parts: Sequence[Part]) -> list[Found]:
    """The likeliest of what may give before each clamped output whose motor moves, where none is found.

    It need not be felt: in a clearance that is wider than the motor's way there is friction alone.
    """
    problem = state.problem
    if not any(clamped(problem, at) for at in range(1, problem.database.n + 1)):
        return []
    gives = {item.at for item in state.found if item.effect in GIVING}
    likeliest: dict[int, Found] = {}
    for contender in contenders(state, parts):
        one = contender.hypothesis
        rows = one.rows(contender.beta) if one.effect in GIVING else None
        if rows is not None and one.at not in gives and one.at not in likeliest and clamped(problem, one.at):
            likeliest[one.at] = found_of(contender, rows)
    return [likeliest[at] for at in sorted(likeliest)]


def _picked(state: Search, parts: Sequence[Part], room: int, skip: Sequence[tuple[str, int]]) -> list[Found]:
    """Causes that earn their place beside what was found and beside each other, by their signatures."""
    fits = fits_beside(state, skip)
    left, basis = state.left, state.slope
    picked: list[Found] = []
    while len(picked) < room:
        taken = {key for item in picked for key in names_of_one(state.problem, *item.key)}
        ranking = ranked([fit for fit in fits if fit[0].key not in taken], left, parts, basis)
        if not state.first:
            state.first = ranking
        good = sorted((one for one in ranking if one.earns and one.possible), key=lambda one: -one.worth)
        if not good:
            break
        best = _likeliest(good, twins_of(state.problem))
        if any(one.hypothesis.curved for one in good if one.worth >= CLOSE * good[0].worth):
            if not picked:
                winner = best_tried(state, good, ranking, parts)
                picked += [winner] if winner else []
            break
        row = best.hypothesis.rows(best.beta)
        if row is None:
            break
        picked.append(found_of(best, row))
        slope = next(slope for hypothesis, _, slope in fits if hypothesis is best.hypothesis)
        left, basis = best.left, np.column_stack([basis, slope])
    return picked


def _likeliest(good: Sequence[Contender], twins: Collection[tuple[str, int]]) -> Contender:
    """Of those that explain as much as the best, the likeliest; of those that are as likely, the simplest.

    Of two names of one body the load's: more hangs at a hand than is wrong with its arm.
    """
    as_much = [one for one in good if one.worth >= good[0].worth - SAME_ENERGY]
    best = max(as_much, key=lambda one: one.gain)
    same = [one for one in as_much if one.gain > best.gain - ALIKE or one.explains > best.explains - SIMPLER]
    first = min(same, key=lambda one: (one.numbers, -one.gain))
    if first.hypothesis.key not in twins:
        return first
    return next((one for one in same if one.hypothesis.effect == "payload"), first)
