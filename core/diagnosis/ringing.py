"""What gives and rings or has play: tried along its whole range beside what was found, and in the place of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..parallel import side_by_side
from .beyond import SPRINGS, STIFFENING
from .contender import THRESHOLD, Contender
from .fit import Part, energy_of, gained, spread
from .found import Found, rows_of
from .hypothesis import Hypothesis
from .model import merged
from .other_laws import begun_from, stiffer
from .refine import Refined, left_with, refined
from .resonance import clearances, springs, stiffening
from .state import Search, loudness, prune
from .tried import best_tried

Vector = NDArray[np.float64]

# part of the gap's energy that a straight spring must take alone, or stiffening ones are tried; and where no other
# cause takes so much either, they are the first to be. And where neither straight ones nor play take as little as this,
# nothing gives, unless no cause at all takes a tenth
RINGS, HINTS, FAINT = 0.3, 0.0025, 0.1
# part of a spring's evidence that a cause has which may be no more than how that spring stiffens
SMALL = 0.05
# springs to either side of the likeliest of a place that are tried again
BESIDE = 1
# at how many of the loudest joints the widths of play are tried finely
LOUDEST = 3


def one_spring(state: Search, parts: Sequence[Part]) -> None:
    """Put one spring in the place of two that together say what it says alone.

    Far from its own stiffness a spring hardly shows, and others are found for it: half of a bearing and the next drive,
    whose axis it tilts about where both meet.
    """
    problem = state.problem
    springs_there = [item for item in state.found if item.effect in SPRINGS]
    base = state
    for two in itertools.combinations(springs_there, 2):
        kept = [item for item in state.found if item not in two]
        base = _in_place(base, kept, parts)
        picked = one_that_rings(base, parts, ())
        if not picked:
            continue
        trial = [*kept, *picked]
        fit = refined(problem, state.whiten, trial, parts)
        sigma = spread(state.left, parts)
        worse = 0.5 * (energy_of(fit.left / sigma) - energy_of(state.left / sigma))
        if worse < THRESHOLD + 2.0 * (state.slope.shape[1] - fit.slope.shape[1]):
            prune(state, trial, fit, parts)
            return


def spring_instead(state: Search, parts: Sequence[Part]) -> tuple[list[Found], Refined] | None:
    """A spring that rings and explains more than all that was found instead, where much is left; and its fit.

    Alone, or in the place of the springs that were found: another may have been picked before the rest was there, and
    much of it for what that one left.
    """
    if not state.found or not loudness(state):
        return None
    rest = [item for item in state.found if item.effect not in SPRINGS]
    there = {item.key for item in state.found}
    best: tuple[list[Found], Refined] | None = None
    base = state
    for kept in [[], rest] if 0 < len(rest) < len(state.found) else [[]]:
        base = _in_place(base, kept, parts)
        picked = one_that_rings(base, parts, ())
        if not picked or picked[0].key in there:
            continue
        fit = refined(state.problem, state.whiten, [*kept, *picked], parts)
        if energy_of(fit.left) < (energy_of(best[1].left) if best else energy_of(state.left)):
            best = [*kept, *picked], fit
    return best


def stiffens_instead(state: Search, parts: Sequence[Part]) -> tuple[list[Found], Refined] | None:
    """A spring that stiffens and says what a straight one and small causes beside it say together; and its fit.

    Where a straight one leaves too little to be asked for another form, others are found for what it leaves.
    """
    problem, whiten = state.problem, state.whiten
    sigma = spread(state.left, parts)
    for item in state.found:
        small = [other for other in state.found if other.gain < SMALL * item.gain]
        if item.effect not in SPRINGS or STIFFENING in item.row.values or not small:
            continue
        kept = [one for one in state.found if one not in small]
        straight = refined(problem, whiten, kept, parts)
        begun = stiffer(problem, straight, item)
        if not begun:
            continue
        fit = begun_from(problem, whiten, kept, straight, parts, item, begun)
        worse = 0.5 * (energy_of(fit.left / sigma) - energy_of(state.left / sigma))
        if worse < 2.0 * (state.slope.shape[1] - fit.slope.shape[1]):
            return kept, fit
    return None


def _in_place(state: Search, kept: Sequence[Found], parts: Sequence[Part]) -> Search:
    """A search that knows what another one does, with some of its findings: for springs in the place of the rest."""
    base = state.without(())
    if not base.rung or any(name in SPRINGS for name in base.rung_beside):
        # what springs change beside one that was found says nothing of what they change in its place; and a memory that
        # begins here is of these findings, not of those of the search that asks
        base.rung, base.rung_beside = {}, {}
    if kept:
        base.take(kept, refined(state.problem, state.whiten, kept, parts))
    return base


def rings_first(state: Search, parts: Sequence[Part]) -> list[Found]:
    """The spring that rings, where it takes a good part of the gap and no other cause alone does; none or one.

    All that is picked before it would be made up of small parts of its noise.
    """
    if _much_by_one(state) or not (loud := loudness(state)):
        return []
    picked = one_that_rings(state, parts, ())
    if not picked:
        return []
    left = left_with(state.problem, state.whiten, rows_of(picked))
    return picked if energy_of(state.left) - energy_of(left) >= RINGS * loud else []


def one_that_rings(state: Search, parts: Sequence[Part], skip: Sequence[tuple[str, int]]) -> list[Found]:
    """The spring or play that explains most of what no signature does, where that is loud; none or one."""
    loud = loudness(state)
    if state.scales is None or not loud:
        return []
    rows, out = rows_of(state.found), {*state.out, *skip}
    options = springs(state.problem, rows, state.scales, out)
    straight, wide = _rung(state, options), _rung(state, clearances(state.problem, rows, out, _loudest(state)))
    rung = [*straight, *wide]
    gives = _taken(state, rung) >= HINTS * loud or not _much_by_one(state, FAINT)
    rings = _taken(state, straight) >= RINGS * loud
    if gives and not (rings or state.found or _much_by_one(state)):
        # one that stiffens rings nowhere as straight ones do, but near them
        rung += _rung(state, [bent for one in options for bent in stiffening(state.problem, {}, one)])
    tried = _by_energy(rung)
    if not tried:
        return []
    sigma = spread(tried[0][2], parts)
    good = [
        Contender(
            hypothesis,
            gained(state.left, left, sigma, parts),
            float(np.clip((energy_of(state.left) - energy) / loud, 0.0, 1.0)),
            np.zeros_like(hypothesis.scale),
            left,
            0.0,
        )
        for energy, hypothesis, left in tried
    ]
    # where nothing else is there the nearest of them are tried
    good = [one for one in good if one.earns] or ([] if state.found else good)
    winner = best_tried(state, good, good, parts, rings=True)
    return [winner] if winner else []


def _loudest(state: Search) -> list[int]:
    """Numbers of the joints at whose own channels most is left."""
    total = np.zeros(state.problem.database.n)
    for channel in state.problem.evidence.channels:
        if not channel.signal.startswith("ee"):
            total[channel.index] += energy_of(state.left[channel.first : channel.last])
    return [int(i) + 1 for i in np.argsort(-total, kind="stable")[:LOUDEST]]


def _taken(state: Search, rung: Sequence[tuple[Hypothesis, Vector]]) -> float:
    """Energy that the best of these takes of what is left."""
    return energy_of(state.left) - min((energy_of(left) for _, left in rung), default=math.inf)


def _much_by_one(state: Search, much: float = RINGS) -> bool:
    """Whether a cause alone takes a good part of the gap by its signature."""
    return any(one.explains >= much for one in state.first if one.earns and one.possible)


def _by_energy(rung: Sequence[tuple[Hypothesis, Vector]]) -> list[tuple[float, Hypothesis, Vector]]:
    """Springs with what they leave, and its energy, those that leave least first."""
    each = ((energy_of(left), hypothesis, left) for hypothesis, left in rung)
    return sorted(each, key=lambda one: (one[0], one[1].key, one[1].form))


def _rung(state: Search, options: Sequence[Hypothesis]) -> list[tuple[Hypothesis, Vector]]:
    """What springs leave beside what was found: all of them the first time, then those of each place that come nearest.

    Which these are is told by what they changed before. What was found meanwhile moves resonances, but not by far.
    """
    rows = rows_of(state.found)
    places: dict[tuple[str, int], list[Hypothesis]] = {}
    for hypothesis in options:
        places.setdefault(hypothesis.key, []).append(hypothesis)
    asked: list[tuple[Hypothesis, Vector | None]] = []
    for place in places.values():
        names = [(hypothesis.effect, hypothesis.at, hypothesis.form) for hypothesis in place]
        near = range(len(place))
        if all(name in state.rung for name in names):
            if rows == state.rung_beside:
                asked += [(place[k], state.left + state.rung[names[k]]) for k in near]
                continue
            best = min(near, key=lambda k: energy_of(state.left + state.rung[names[k]]))
            near = near[max(best - BESIDE, 0) : best + BESIDE + 1]
        elif not state.rung:
            state.rung_beside = rows
        asked += [(place[k], None) for k in near]

    def left_by(hypothesis: Hypothesis) -> Vector:
        spring = hypothesis.rows(np.zeros_like(hypothesis.scale)) or {}
        return state.whiten(state.problem.misfit(merged(rows, spring)))

    new = [hypothesis for hypothesis, known in asked if known is None]
    lefts = side_by_side(left_by, new)
    if rows == state.rung_beside:
        pairs = zip(new, lefts, strict=True)
        state.rung.update({(one.effect, one.at, one.form): left - state.left for one, left in pairs})
    found = iter(lefts)
    return [(hypothesis, next(found) if known is None else known) for hypothesis, known in asked]
