"""Which effects: all compete beside what was found, the largest cause first, until nothing earns its place.

Near where it starts every effect is linear, and its signature is worked out once. A round picks causes by their
signatures alone, as many as earn their place beside each other; then all of their numbers are fitted together to what
robots with these effects would really have said, and the next round begins from what is left. Those that the others
make needless are taken out again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from ..errors import MbexportError
from ..parallel import side_by_side
from .beyond import SPRINGS, how_many, number_of
from .fit import Linear, Part, blocks, edges_of, gained, linear, spread, takes_the_same
from .hypotheses import (
    GIVING,
    STEP,
    TENSOR,
    Hypothesis,
    Scales,
    clamped,
    hypotheses,
    names_of_one,
    place_of,
    scales_of,
    twins_of,
)
from .model import Rows, merged, tables
from .nuisances import Whitening
from .other_laws import beyond_catalogue
from .plain import LEAST_MASS, at_a_point
from .problem import BODIES, Problem
from .refine import Refined, free_columns, left_with, refined, removal
from .resonance import clearances, springs, stiffening

Vector = NDArray[np.float64]

# findings beside those that a robot with friction and an unknown rotor inertia in every joint has
MORE_THAN_USUAL = 6
# log evidence that a finding needs: some hundreds compete, and a false name is worse than none
THRESHOLD = 10.0
# others are names of the same finding where their evidence is so near
ALIKE = 5.0
# what a name may leave more than the best one, as part of the gap's energy, and still not be told apart
ALIKE_SHARE = 0.01
# what a finding must explain of the energy that is left above noise: where a large part is not understood, small
# parts of it prove nothing
LEAST_SHARE = 0.02
# names that are fitted with all their numbers free before one is chosen
MOST_TRIED = 5
# names that explain the gap alike but for this part of its energy are told apart by likelihood
SAME_ENERGY = 0.02
# of those that differ by no more than this part of it, the simplest is taken: laws are never as exact as that
SIMPLER = 0.002
# what is not linear is looked at closely where it explains this part of what the best does
CLOSE = 0.6
# every number more must explain this part more
DEARER = 0.1
# part of one channel's that is no crumb either: the loudest channel must not drown what another is about
MUCH = 0.3
# standard deviations of pure noise above it from which springs are looked for by their resonance
LOUD = 5.0
# part of the gap's energy for which they are not
CRUMB = 0.05
# part of it that a straight spring must take alone, or stiffening ones are tried; and where no other cause takes so
# much either, they are the first to be. And where none takes as little as this, nothing rings
RINGS, HINTS = 0.3, 0.0025
# springs to either side of the likeliest of a place that are tried again
BESIDE = 1
# of a plain amount, what is none
NONE = 1.0e-6
# effects with so many numbers that they may be found with some of them and need the others later
PARTIAL = ("kinematic_error", "link_inertia", "payload")
# names that are tried in the place of several
MOST_CONDENSED = 4
# findings in whose place others are put, and how many of the likeliest and of plainer ones are tried in that of one
MOST_SWAPPED, SWAPPED = 3, 2
# picks that may come to nothing once all their numbers are free
MOST_FAILED = 3
# curved findings with so much evidence need not be taken out on trial
BEYOND_DOUBT = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Contender:
    """A hypothesis with its best fit.

    Attributes:
        hypothesis: What is said.
        gain: Log evidence above saying nothing.
        explains: Part of the residual's energy above noise that it takes.
        beta: Its numbers.
        left: What it leaves, in units of noise.
        shows: By how many standard deviations of everything together a plain amount of it changes what is said.
        closes: Part of what is left above noise of one channel, that of which it takes most.
        told: How many numbers of it these runs tell.
    """

    hypothesis: Hypothesis
    gain: float
    explains: float
    beta: Vector
    left: Vector
    shows: float
    closes: float = 0.0
    told: float = math.inf

    @property
    def earns(self) -> bool:
        """Whether it is more than chance and more than a crumb, of everything or of one channel."""
        return self.gain >= THRESHOLD and (self.explains >= LEAST_SHARE or self.closes >= MUCH)

    @property
    def possible(self) -> bool:
        """Whether there can be so much of it."""
        return self.hypothesis.rows(self.beta) is not None

    @property
    def worth(self) -> float:
        """What it explains, less for every number that it needs for that."""
        return self.explains / self.price

    @property
    def numbers(self) -> int:
        """How many numbers it needs: those that stand at the least they can be are not there."""
        least, scale = self.hypothesis.lower, self.hypothesis.scale
        return max(1, int(np.sum(self.beta > least + NONE * scale)))

    @property
    def price(self) -> float:
        """By what its energy is divided for the numbers that it needs and that these runs tell."""
        return 1.0 + DEARER * (max(1.0, min(self.numbers, self.told)) - 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """An effect that was found.

    Attributes:
        effect, at: What and where.
        row: Its values.
        gain: Log evidence that it adds to the others.
        absent: Its row where it is as if it were not there; None where no row of finite numbers is that.
    """

    effect: str
    at: int
    row: EffectRow
    gain: float
    absent: EffectRow | None = None

    @property
    def place(self) -> str:
        """joint_N, arm_N or robot."""
        return place_of(self.effect, self.at)

    @property
    def key(self) -> tuple[str, int]:
        """Effect and number of its place."""
        return (self.effect, self.at)


@dataclass(slots=True)
class Search:
    """The search as it goes.

    Attributes:
        problem: The question.
        whiten: Nuisances.
        found: What was found, in order.
        left: What is left, whitened, in units of noise.
        slope: Its change with the findings' numbers, shape (N, k).
        first: Contenders of the first round, for the map of scores.
        signatures: What was worked out of a hypothesis before: how it begins apart from what is left, and its slope.
            What was found meanwhile changes them little, and those chosen are fitted in full.
        scales: Of the first round.
        alone: Sum of squares that a candidate left alone with all its numbers free, where that was tried.
        rung: What each spring that was tried changed when all were tried first.
        rung_beside: Rows of what was found by then.
        banned: Effects and numbers of places that are out, for they did not hold.
        unreal: Those that needed a body that cannot exist, or never slipped, beside what was found by then.
    """

    problem: Problem
    whiten: Whitening
    found: list[Found] = field(default_factory=list[Found])
    left: Vector = field(default_factory=lambda: np.zeros(0))
    slope: Vector = field(default_factory=lambda: np.zeros((0, 0)))
    first: list[Contender] = field(default_factory=list[Contender])
    signatures: dict[tuple[str, int, str], tuple[Vector, Vector]] = field(
        default_factory=dict[tuple[str, int, str], tuple[Vector, Vector]]
    )
    scales: Scales | None = None
    alone: dict[tuple[str, int], float] = field(default_factory=dict[tuple[str, int], float])
    rung: dict[tuple[str, int, str], Vector] = field(default_factory=dict[tuple[str, int, str], Vector])
    rung_beside: Rows = field(default_factory=dict[str, tuple[EffectRow, ...]])
    banned: set[tuple[str, int]] = field(default_factory=set[tuple[str, int]])
    unreal: set[tuple[str, int]] = field(default_factory=set[tuple[str, int]])

    @property
    def out(self) -> set[tuple[str, int]]:
        """Effects and numbers of places that are not looked for."""
        return self.banned | self.unreal

    def begin(self) -> None:
        """Nothing found."""
        self.found, self.left = [], self.whiten(self.problem.residual({}))
        self.slope = np.zeros((len(self.left), 0))

    def without(self, names: Collection[tuple[str, str]]) -> Search:
        """A search from the beginning that knows what this one worked out, but for effects at places."""
        other = Search(
            self.problem,
            self.whiten,
            first=self.first,
            signatures=self.signatures,
            scales=self.scales,
            rung=self.rung,
            rung_beside=self.rung_beside,
        )
        known = (*(one.hypothesis for one in self.first), *self.found)
        other.unreal = set(self.unreal)
        other.banned = self.banned | {item.key for item in known if (item.effect, item.place) in names}
        other.begin()
        return other

    def heard(self, problem: Problem, whiten: Whitening) -> Search:
        """A search from the beginning of the same question with its noise known better, that knows what this one does.

        Args:
            problem: The question as it is heard now.
            whiten: Its nuisances.
        """

        def told(values: Vector) -> Vector:
            return whiten(problem.evidence.told_by(self.problem.evidence, self.whiten.undone(values)))

        other = Search(problem, whiten, first=self.first, scales=self.scales, banned=set(self.banned))
        other.unreal = set(self.unreal)
        other.signatures = {name: (told(ahead), told(slope)) for name, (ahead, slope) in self.signatures.items()}
        other.rung = {name: told(change) for name, change in self.rung.items()}
        other.rung_beside = self.rung_beside
        other.begin()
        return other

    def take(self, found: Sequence[Found], fit: Refined) -> None:
        """These findings, as fitted."""
        self.found = [replace(item, row=fit.rows[item.key]) for item in found]
        self.left, self.slope = fit.left, fit.slope


Fitting = tuple[Hypothesis, Vector, Vector]


def rows_of(found: Sequence[Found]) -> Rows:
    """Findings as tables."""
    return tables({item.key: item.row for item in found})


def search(state: Search, tell: Callable[[str], None] | None = None) -> Search:
    """Find the effects, from where a search stands."""
    parts = blocks(state.problem.evidence)
    _gather(state, parts, tell)
    if (instead := _spring_instead(state, parts)) is not None:
        prune(state, *instead, parts)
        _gather(state, parts, tell)
    _condense(state, parts)
    _one_spring(state, parts)
    for _ in range(MOST_SWAPPED):
        if not _swapped(state, parts):
            break
    return state


def _gather(state: Search, parts: Sequence[Part], tell: Callable[[str], None] | None) -> None:
    """Take one cause after the other until none is left that earns its place."""
    problem, whiten = state.problem, state.whiten
    most = 3 * problem.database.n + MORE_THAN_USUAL
    failed: list[set[tuple[str, int]]] = []
    let_go = False
    while len(state.found) < most:
        before = list(state.found)
        out = sorted(set[tuple[str, int]]().union(*failed))
        picked = _picked(state, parts, most - len(before), out)
        if picked and not before and not failed and (ringing := _rings_first(state, parts)):
            picked = ringing
        if not picked and not let_go and (giving := _letting_go(state, parts)):
            # judged when there is something beside it
            let_go, kept = True, [*before, *giving]
            state.take(kept, refined(problem, whiten, kept, parts))
            continue
        picked = picked or _ringing(state, parts, out)
        if not picked:
            break
        if tell:
            tell(", ".join(f"{item.effect} at {item.place}" for item in picked[:3]))
        trial = _beside_or_more(before, picked)
        fit = refined(problem, whiten, trial, parts)
        fitted = [replace(item, row=fit.rows[item.key]) for item in trial]
        unreal = without_bodies(problem, fitted) | never_slipping(problem, fitted)
        for bodies in (_embodied, at_points):
            if unreal and (other := bodies(problem, fitted, unreal)) is not None:
                fit = refined(problem, whiten, other, parts)
                trial, fitted = other, [replace(item, row=fit.rows[item.key]) for item in other]
                unreal = without_bodies(problem, fitted) | never_slipping(problem, fitted)
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
        if _numbers(state.found) <= _numbers(before):
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
    gives = {item.at for item in state.found if item.effect in GIVING}
    likeliest: dict[int, Found] = {}
    for contender in contenders(state, parts):
        one = contender.hypothesis
        rows = one.rows(contender.beta) if one.effect in GIVING else None
        if rows is not None and one.at not in gives and one.at not in likeliest and clamped(problem, one.at):
            likeliest[one.at] = _found(contender, rows)
    return [likeliest[at] for at in sorted(likeliest)]


def _beside_or_more(found: Sequence[Found], picked: Sequence[Found]) -> list[Found]:
    """Findings and picks; a pick of an effect that is there already has more of its numbers."""
    more = {item.key: item for item in picked}
    kept = [replace(item, row=more[item.key].row) if item.key in more else item for item in found]
    there = {item.key for item in found}
    return [*kept, *(item for item in picked if item.key not in there)]


def _numbers(found: Sequence[Found]) -> set[tuple[str, int, str]]:
    """Effect, place and column of every number that is fitted."""
    return {(*item.key, name) for item in found for name in free_columns(item.effect, item.row)}


def _condense(state: Search, parts: Sequence[Part]) -> None:
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
        trial = [replace(item, gain=0.0) for item in (_found(contender, rows), *state.found) if item is not there]
        fit = refined(state.problem, state.whiten, trial, parts)
        other = Search(state.problem, state.whiten)
        prune(other, trial, fit, parts, keep=key)
        if without_bodies(state.problem, other.found) or not other.found:
            continue
        sigma = spread(state.left, parts)
        worse = 0.5 * (_energy(other.left / sigma) - _energy(state.left / sigma))
        fewer = len(state.found) - len(other.found)
        numbers = state.slope.shape[1] - other.slope.shape[1]
        # with more numbers than all of them another must say more than they do, not the same
        another = numbers < 0 and there is None
        if fewer > 0 and worse < (0.0 if another else fewer * THRESHOLD) + 2.0 * numbers:
            again = refined(state.problem, state.whiten, other.found, parts)
            prune(state, other.found, again, parts)


def _one_spring(state: Search, parts: Sequence[Part]) -> None:
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
        picked = _ringing(base, parts, ())
        if not picked:
            continue
        trial = [*kept, *picked]
        fit = refined(problem, state.whiten, trial, parts)
        sigma = spread(state.left, parts)
        worse = 0.5 * (_energy(fit.left / sigma) - _energy(state.left / sigma))
        if worse < THRESHOLD + 2.0 * (state.slope.shape[1] - fit.slope.shape[1]):
            prune(state, trial, fit, parts)
            return


def _swapped(state: Search, parts: Sequence[Part]) -> bool:
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
        same = SIMPLER * (_energy(beside.left) - _energy(fit.left))
        options = contenders(beside, parts, sorted(names_of_one(problem, *item.key)))
        # before all of its numbers are free a plainer one may seem to leave more
        near = _energy(fit.left) + CRUMB * (_energy(beside.left) - _energy(fit.left))
        plain = [one for one in options if one.numbers < len(own) and _energy(one.left) < near]
        better = [one for one in options[:SWAPPED] if gained(fit.left, one.left, sigma, parts) >= -THRESHOLD]
        for contender in dict.fromkeys((*plain[:SWAPPED], *better)):
            rows = contender.hypothesis.rows(contender.beta)
            if rows is None:
                continue
            # more numbers of a finding that is there are no second one
            trial = _beside_or_more(others, [_found(contender, rows)])
            other = Search(problem, whiten)
            prune(other, trial, refined(problem, whiten, trial, parts), parts)
            unreal = without_bodies(problem, other.found) | never_slipping(problem, other.found)
            if unreal or _stuck(problem, other.found) or not other.found:
                continue
            more = other.slope.shape[1] - fit.slope.shape[1]
            second = len(other.found) - len(state.found)
            # another one with more numbers than those that it replaces must say more than they do, not the same
            another = more > 0 and contender.hypothesis.key not in {one.key for one in others}
            dearer = THRESHOLD * (max(second, 0) if another else second) + 2.0 * more
            plainer = more < 0 and second <= 0
            # what takes something else away, of a channel that nothing explains, is no other name
            alike = takes_the_same(beside.left, fit.left, other.left, sigma)
            as_much = plainer and alike and _energy(other.left) - _energy(fit.left) < same
            if as_much or gained(fit.left, other.left, sigma, parts) > dearer + ALIKE:
                state.found, state.left, state.slope = other.found, other.left, other.slope
                return True
    return False


def _best_alone(state: Search) -> float:
    """What the best of the findings left alone; infinity where none was tried so."""
    return min((state.alone.get(item.key, math.inf) for item in state.found), default=math.inf)


def without_bodies(problem: Problem, found: Sequence[Found]) -> set[tuple[str, int]]:
    """Findings with which an arm is no body that can exist."""
    heavy = [item for item in found if item.effect in BODIES]
    if not heavy:
        return set()
    faults = problem.impossible(rows_of(found))
    return {item.key for item in heavy if faults[item.at - 1]}


def _embodied(problem: Problem, found: Sequence[Found], unreal: Collection[tuple[str, int]]) -> list[Found] | None:
    """Findings with moments of inertia for masses at points that are no bodies without them; None: no such."""

    def thin(item: Found) -> bool:
        values = item.row.values
        return item.key in unreal and item.effect == "link_inertia" and not any(values[name] for name in TENSOR)

    def whole(item: Found) -> Found:
        least = LEAST_MASS * max(problem.database.inertias[item.at - 1].mass, 1e-3)
        values = {**item.row.values, **at_a_point(item.row.values, least)}
        return replace(item, row=EffectRow(item.at, values))

    return [whole(item) if thin(item) else item for item in found] if any(map(thin, found)) else None


def at_points(problem: Problem, found: Sequence[Found], unreal: Collection[tuple[str, int]]) -> list[Found] | None:
    """Findings with masses that are no bodies put at points: moments that runs hardly show must not cost them.

    None where there are no such moments.
    """

    def spread_out(item: Found) -> bool:
        heavy = item.effect in BODIES
        return item.key in unreal and heavy and any(item.row.values[name] for name in TENSOR)

    def point(item: Found) -> Found:
        return replace(item, row=EffectRow(item.at, {**item.row.values, **dict.fromkeys(TENSOR, 0.0)}))

    return [point(item) if spread_out(item) else item for item in found] if any(map(spread_out, found)) else None


def never_slipping(problem: Problem, found: Sequence[Found]) -> set[tuple[str, int]]:
    """Hysteresis that slips nowhere on the way that its joint goes: a spring says the same with less."""
    loops = [item for item in found if item.effect == "hysteresis"]
    if not loops:
        return set()
    way = problem.way()
    numbers = {item.key: item.row.values for item in loops}
    return {key for key, row in numbers.items() if row["torque"] > row["stiffness"] * float(way[key[1] - 1])}


def _picked(state: Search, parts: Sequence[Part], room: int, skip: Sequence[tuple[str, int]]) -> list[Found]:
    """Causes that earn their place beside what was found and beside each other, by their signatures."""
    fits = _fits(state, skip)
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
                winner = _tried(state, good, ranking, parts)
                picked += [winner] if winner else []
            break
        row = best.hypothesis.rows(best.beta)
        if row is None:
            break
        picked.append(_found(best, row))
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


def _found(contender: Contender, rows: Rows) -> Found:
    hypothesis = contender.hypothesis
    nothing = hypothesis.rows(np.zeros(len(hypothesis.scale))) if hypothesis.alone else None
    absent = nothing[hypothesis.effect][0] if nothing else None
    row = rows[hypothesis.effect][0]
    if absent and any(math.isfinite(value) > math.isfinite(absent.values[name]) for name, value in row.values.items()):
        # what is rigid without it has no finite number there
        absent = None
    return Found(*hypothesis.key, row, contender.gain, absent)


def contenders(state: Search, parts: Sequence[Part], skip: Sequence[tuple[str, int]] = ()) -> list[Contender]:
    """Every hypothesis beside what was found, by evidence, the best first."""
    return ranked(_fits(state, skip), state.left, parts, state.slope)


def beside(state: Search, found: Sequence[Found]) -> list[Found]:
    """What might stand beside findings, as the measured motion has it, however little it shows of it.

    Each effect at a place once, the likeliest first, and every delay, of which a motion hardly knows.
    """
    problem, whiten, parts = state.problem, state.whiten, blocks(state.problem.evidence)
    other = Search(problem, whiten, signatures=state.signatures, scales=state.scales, banned=state.out)
    other.begin()
    if found:
        other.take(found, refined(problem, whiten, found, parts))
    likely: dict[tuple[str, int], Found] = {}
    late: list[Found] = []
    for contender in contenders(other, parts):
        rows = contender.hypothesis.rows(contender.beta)
        if rows is None:
            continue
        option = _found(contender, rows)
        if option.effect == "delay":
            late.append(option)
        elif option.key not in {item.key for item in found}:
            likely.setdefault(option.key, option)
    return [*late, *likely.values()]


def _fits(state: Search, skip: Sequence[tuple[str, int]] = ()) -> list[Fitting]:
    """Every hypothesis beside what was found: what would be left with none of it, and its slope.

    None is beside what no robot can have, as numbers may be that are moved to where they are without another finding.
    """
    problem = state.problem
    rows = rows_of(state.found)
    try:
        base = problem.residual(rows)
    except MbexportError:
        return []
    now = scales_of(problem, rows)
    if state.scales is None:
        state.scales = now
    # amounts stay those of the first round, for which signatures were worked out
    scales = replace(state.scales, residual=now.residual, turned=now.turned)
    done = (item.key for item in state.found if item.effect not in PARTIAL)
    taken = [*done, *sorted(state.out), *skip]
    numbers = _numbers(state.found)
    there = {item.key for item in state.found}
    named = {
        (one.effect, one.at, one.form): one
        for one in hypotheses(problem, rows, scales, taken)
        if one.key not in there or _more(one, numbers)
    }
    new = [name for name in named if name not in state.signatures]
    signatures = side_by_side(lambda name: _signature(problem, named[name], rows, base), new)
    for name, signature in zip(new, signatures, strict=True):
        if signature is not None:
            r0, slope = signature
            state.signatures[name] = state.whiten(r0 - base), state.whiten(slope)
    known = ((one, state.signatures[name]) for name, one in named.items() if name in state.signatures)
    return [(one, state.left + ahead, slope) for one, (ahead, slope) in known]


def _more(hypothesis: Hypothesis, numbers: set[tuple[str, int, str]]) -> bool:
    """Whether a form of an effect that was found has numbers that are not fitted yet."""
    row = hypothesis.rows(hypothesis.scale)
    columns = free_columns(hypothesis.effect, row[hypothesis.effect][0]) if row else []
    return any((*hypothesis.key, name) not in numbers for name in columns)


def ranked(fits: Sequence[Fitting], left: Vector, parts: Sequence[Part], basis: Vector) -> list[Contender]:
    """Hypotheses by evidence, judged by the spread that the best of them leaves.

    Args:
        fits: Each with what would be left with none of it, and its slope.
        left: What is left now, shape (N,).
        parts: Bands of it.
        basis: Slopes of what stays free beside them, shape (N, k).
    """
    if not fits:
        return []
    sigma = spread(left, parts)
    order: list[tuple[float, Hypothesis, Linear, Vector, float]] = []
    # what is left by the best so far tells what misfit is to be expected; a second round settles it
    for _ in range(2):
        frame = np.linalg.qr(basis / sigma[:, None])[0] if basis.shape[1] else None
        null = _beside(left / sigma, frame) * sigma
        order = []
        for hypothesis, r0, slope in fits:
            beside = _beside(slope / sigma[:, None], frame)
            fit = linear(_beside(r0 / sigma, frame), beside, hypothesis.scale, hypothesis.lower)
            prior = 0.5 * (fit.cost - _energy(fit.left))
            gain = gained(null, fit.left * sigma, sigma, parts) - prior - fit.volume
            shows = float(np.linalg.norm(slope * hypothesis.scale))
            order.append((gain, hypothesis, fit, fit.left * sigma, shows))
        order.sort(key=lambda entry: (-entry[0], entry[1].key, entry[1].form))
        if order[0][0] <= 0.0:
            break
        sigma = spread(order[0][3], parts)
    whole = _energy(left)
    # of pure noise nothing is explained
    energy = max(whole - len(left), 3.0 * math.sqrt(2.0 * len(left)))
    return [
        Contender(
            hypothesis,
            gain,
            float(np.clip((whole - _energy(rest)) / energy, 0.0, 1.0)),
            fit.beta,
            rest,
            shows,
            _most_gone(left, rest, parts),
            fit.told,
        )
        for gain, hypothesis, fit, rest, shows in order
    ]


def _most_gone(left: Vector, rest: Vector, parts: Sequence[Part]) -> float:
    """Part of what is left above noise of one channel that is gone, of the channel of which most is; of loud ones."""
    channels = np.array(edges_of(parts))
    count = channels[:, 1] - channels[:, 0]
    had, has = np.add.reduceat(np.stack([left, rest]) ** 2, channels[:, 0], axis=1)
    above = had - count
    taken = np.divide(had - has, above, out=np.zeros(len(above)), where=above > LOUD * np.sqrt(2.0 * count))
    return float(np.clip(np.max(taken), 0.0, 1.0))


def _beside(values: Vector, frame: Vector | None) -> Vector:
    """What of numbers or columns no amount of the others can say."""
    return values if frame is None else values - frame @ (frame.T @ values)


def _signature(problem: Problem, hypothesis: Hypothesis, rows: Rows, base: Vector) -> tuple[Vector, Vector] | None:
    """Residual at beta = 0 and its slope, by differences; None where there can be no such robot."""
    try:
        return _differences(problem, hypothesis, rows, base)
    except MbexportError:
        return None


def _differences(problem: Problem, hypothesis: Hypothesis, rows: Rows, base: Vector) -> tuple[Vector, Vector] | None:
    k = len(hypothesis.scale)
    zero = np.zeros(k)
    if hypothesis.alone:
        r0 = base
    else:
        start = hypothesis.rows(zero)
        if start is None:
            return None
        r0 = problem.residual(merged(rows, start))
    columns: list[Vector] = []
    for j in range(k):
        step = zero.copy()
        step[j] = STEP * hypothesis.scale[j]
        carried = hypothesis.carried and j > 0
        if carried:
            # a first moment needs a mass to be one of
            step[0] = STEP * hypothesis.scale[0]
        moved = hypothesis.rows(step)
        if moved is None:
            return None
        column = (problem.residual(merged(rows, moved)) - r0) / step[j]
        columns.append(column - columns[0] * step[0] / step[j] if carried else column)
    slope = np.column_stack(columns)
    return (r0, slope) if np.all(np.isfinite(slope)) and np.all(np.isfinite(r0)) else None


def _tried(
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
    tried: dict[int, tuple[Contender, Found, Refined]] = {}
    for contender in _few(likely, 2) + _few(good, MOST_TRIED):
        rows = contender.hypothesis.rows(contender.beta)
        if id(contender) in tried or rows is None or len(tried) == MOST_TRIED:
            continue
        item = _found(contender, rows)
        trial = [*state.found, item]
        fit = refined(state.problem, state.whiten, trial, parts)
        fit = beyond_catalogue(state.problem, state.whiten, trial, fit, parts, item, _energy(state.left))
        tried[id(contender)] = (contender, item, fit)
        if not state.found:
            state.alone[item.key] = min(_energy(fit.left), state.alone.get(item.key, math.inf))
    if not tried:
        return None
    least = min((fit.left for _, _, fit in tried.values()), key=_energy)
    sigma = spread(least, parts)
    scored = [
        (
            gained(state.left, fit.left, sigma, parts) - 2.0 * (contender.numbers + _numbers_beyond(fit, item)),
            contender,
            item,
            fit,
        )
        for contender, item, fit in tried.values()
    ]
    earning = [entry for entry in scored if entry[0] >= THRESHOLD]
    if not earning:
        return None
    if rings:
        return _by_own_noise(state, [(gain, item, fit) for gain, _, item, fit in earning], parts)
    # the largest cause first: what it leaves unexplained elsewhere is easily taken for small ones
    worth = [
        (_energy(state.left) - _energy(fit.left)) / (contender.price + DEARER * _numbers_beyond(fit, item))
        for _, contender, item, fit in earning
    ]
    most = max(worth)
    as_much = [entry for entry, one in zip(earning, worth, strict=True) if one >= most - SAME_ENERGY * abs(most)]
    best = max(as_much, key=lambda entry: entry[0])
    margin = SIMPLER * (_energy(state.left) - _energy(best[3].left))
    same = (
        entry
        for entry in as_much
        if entry[0] > best[0] - ALIKE or _energy(entry[3].left) < _energy(best[3].left) + margin
    )
    gain, _, item, fit = min(same, key=lambda entry: (len(entry[3].free), -entry[0]))
    return replace(item, row=fit.rows[item.key], gain=gain)


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
        likely -= 0.5 * _energy(own.left / sigma) + 2.0 * len(own.numbers_of(item.key))
        scored.append((likely, gain, item, fit))
    best = max(likely for likely, *_ in scored)
    _, gain, item, fit = min(
        (entry for entry in scored if entry[0] > best - ALIKE), key=lambda entry: (len(entry[3].free), -entry[0])
    )
    return replace(item, row=fit.rows[item.key], gain=gain)


def _numbers_beyond(fit: Refined, item: Found) -> int:
    """How many numbers more a law beyond the catalogue's has, 0 for one of it."""
    return how_many(item.effect) * int(number_of(item.effect, fit.rows[item.key]) > 0.0)


def _spring_instead(state: Search, parts: Sequence[Part]) -> tuple[list[Found], Refined] | None:
    """A spring that rings and explains more than all that was found instead, where much is left; and its fit.

    Alone, or in the place of the springs that were found: another may have been picked before the rest was there, and
    much of it for what that one left.
    """
    if not state.found or not _loud(state):
        return None
    rest = [item for item in state.found if item.effect not in SPRINGS]
    there = {item.key for item in state.found}
    best: tuple[list[Found], Refined] | None = None
    base = state
    for kept in [[], rest] if 0 < len(rest) < len(state.found) else [[]]:
        base = _in_place(base, kept, parts)
        picked = _ringing(base, parts, ())
        if not picked or picked[0].key in there:
            continue
        fit = refined(state.problem, state.whiten, [*kept, *picked], parts)
        if _energy(fit.left) < (_energy(best[1].left) if best else _energy(state.left)):
            best = [*kept, *picked], fit
    return best


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


def _loud(state: Search) -> float:
    """Energy of what is left above noise; 0 where it is no more than noise may have, or a crumb of the gap."""
    count = len(state.left)
    above, first = _above_noise(state)
    return above if above > max(LOUD * math.sqrt(2.0 * count), CRUMB * first) else 0.0


def _above_noise(state: Search) -> tuple[float, float]:
    """Energy above noise of what is left, and of the gap."""
    nothing = _nothing(state)
    return _energy(state.left) - len(state.left), _energy(nothing) - len(nothing)


def part_open(state: Search) -> float:
    """Part that is left of the gap's energy along the motion, above noise; 0 of a gap that is no louder than noise."""
    count = len(state.left)
    above, first = _above_noise(state)
    return max(above, 0.0) / first if first > count > 0 else 0.0


def _rings_first(state: Search, parts: Sequence[Part]) -> list[Found]:
    """The spring that rings, where it takes a good part of the gap and no other cause alone does; none or one.

    All that is picked before it would be made up of small parts of its noise.
    """
    if any(one.explains >= RINGS for one in state.first if one.earns and one.possible) or not (loud := _loud(state)):
        return []
    picked = _ringing(state, parts, ())
    if not picked:
        return []
    left = left_with(state.problem, state.whiten, rows_of(picked))
    return picked if _energy(state.left) - _energy(left) >= RINGS * loud else []


def _ringing(state: Search, parts: Sequence[Part], skip: Sequence[tuple[str, int]]) -> list[Found]:
    """The spring or play that explains most of what no signature does, where that is loud; none or one."""
    loud = _loud(state)
    if state.scales is None or not loud:
        return []
    rows, out = rows_of(state.found), {*state.out, *skip}
    options = springs(state.problem, rows, state.scales, out)
    rung = _rung(state, options)
    takes = _energy(state.left) - min((_energy(left) for _, left in rung), default=math.inf)
    if not state.found and HINTS * loud <= takes < RINGS * loud:
        # one that stiffens rings nowhere as straight ones do, but near them
        rung += _rung(state, [bent for one in options for bent in stiffening(state.problem, {}, one)])
    tried = _by_energy([*rung, *_rung(state, clearances(state.problem, rows, out))])
    if not tried:
        return []
    sigma = spread(tried[0][2], parts)
    good = [
        Contender(
            hypothesis,
            gained(state.left, left, sigma, parts),
            float(np.clip((_energy(state.left) - energy) / loud, 0.0, 1.0)),
            np.zeros_like(hypothesis.scale),
            left,
            0.0,
        )
        for energy, hypothesis, left in tried
    ]
    # where nothing else is there the nearest of them are tried
    good = [one for one in good if one.earns] or ([] if state.found else good)
    winner = _tried(state, good, good, parts, rings=True)
    return [winner] if winner else []


def _by_energy(rung: Sequence[tuple[Hypothesis, Vector]]) -> list[tuple[float, Hypothesis, Vector]]:
    """Springs with what they leave, and its energy, those that leave least first."""
    each = ((_energy(left), hypothesis, left) for hypothesis, left in rung)
    return sorted(each, key=lambda one: (one[0], one[1].key, one[1].form))


def _rung(state: Search, options: Sequence[Hypothesis]) -> list[tuple[Hypothesis, Vector]]:
    """What springs leave beside what was found: all of them the first time, then those of each place that come nearest.

    Which these are is told by what they changed before. What was found meanwhile moves resonances, but not by far.
    """
    rows = rows_of(state.found)
    places: dict[tuple[str, int], list[Hypothesis]] = {}
    for hypothesis in options:
        places.setdefault(hypothesis.key, []).append(hypothesis)
    out: list[tuple[Hypothesis, Vector]] = []
    for place in places.values():
        names = [(hypothesis.effect, hypothesis.at, hypothesis.form) for hypothesis in place]
        near = range(len(place))
        if all(name in state.rung for name in names):
            if rows == state.rung_beside:
                out += [(place[k], state.left + state.rung[names[k]]) for k in near]
                continue
            best = min(near, key=lambda k: _energy(state.left + state.rung[names[k]]))
            near = near[max(best - BESIDE, 0) : best + BESIDE + 1]
        elif not state.rung:
            state.rung_beside = rows
        for k in near:
            spring = place[k].rows(np.zeros_like(place[k].scale)) or {}
            left = state.whiten(state.problem.misfit(merged(rows, spring)))
            out.append((place[k], left))
            if rows == state.rung_beside:
                state.rung[names[k]] = left - state.left
    return out


def _few(order: Sequence[Contender], count: int) -> list[Contender]:
    """The first form of each of the first few names."""
    out: dict[tuple[str, int], Contender] = {}
    for contender in order:
        if len(out) == count:
            break
        out.setdefault(contender.hypothesis.key, contender)
    return list(out.values())


def _energy(left: Vector) -> float:
    return float(left @ left)


def prune(
    state: Search, found: Sequence[Found], fit: Refined, parts: Sequence[Part], keep: tuple[str, int] | None = None
) -> None:
    """Take these findings, but for what the others make needless; say what each adds to the others.

    Args:
        state: The search.
        found: Candidates.
        fit: All of their numbers, fitted.
        parts: Bands of what is left.
        keep: One that stays, needless or not.
    """
    state.take(found, fit)
    while state.found:
        needed = {item.key for item in state.found if item.key == keep or gives_alone(state.problem, state.found, item)}
        losses = [math.inf if item.key in needed else _loss(state, item, fit, parts) for item in state.found]
        worst = int(np.argmin(losses))
        if losses[worst] >= THRESHOLD:
            state.found = [replace(item, gain=loss) for item, loss in zip(state.found, losses, strict=True)]
            return
        rest = [item for k, item in enumerate(state.found) if k != worst]
        if rest:
            fit = refined(state.problem, state.whiten, rest, parts)
            state.take(rest, fit)
        else:
            state.begin()


def gives_alone(problem: Problem, found: Sequence[Found], item: Found) -> bool:
    """Whether nothing else gives before a clamped output, where another finding needs its motor to move."""
    return item.effect in GIVING and item.at in _stuck(problem, [other for other in found if other is not item])


def _stuck(problem: Problem, found: Sequence[Found]) -> set[int]:
    """Joints with clamped outputs before which nothing gives, where a finding needs the motor to move."""
    moving = {item.at for item in found if effect_named(item.effect).key == "joint" and clamped(problem, item.at)}
    return moving - {item.at for item in found if item.effect in GIVING}


def _loss(state: Search, item: Found, fit: Refined, parts: Sequence[Part]) -> float:
    """Log evidence that is lost without a finding, its price taken off: by its covariance, or tried."""
    price = 2.0 * len(fit.numbers_of(item.key))
    if item.absent is not None:
        return removal(fit, item.key, item.absent).loss - price
    if item.gain >= BEYOND_DOUBT:
        return item.gain
    others = [other for other in state.found if other is not item]
    rest = refined(state.problem, state.whiten, others, parts).left if others else _nothing(state)
    sigma = spread(fit.left, parts)
    loss = gained(rest, fit.left, sigma, parts) - price
    return loss if math.isfinite(loss) else 0.0


def _nothing(state: Search) -> Vector:
    return state.whiten(state.problem.residual({}))
