"""A search as it goes: what was found, what is left, what is known of the rest, and what is needless by now."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from ..errors import MbexportError
from ..parallel import side_by_side
from .contender import LOUD, NUMBER, THRESHOLD, Contender, Fitting, found_of, ranked, signature_of
from .fit import Part, blocks, energy_of, gained, spread
from .found import Found, gives_alone, numbers_in, rows_of
from .hypotheses import hypotheses
from .hypothesis import Hypothesis
from .model import Rows
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined, free_columns, refined, removal
from .scales import Scales, scales_of

Vector = NDArray[np.float64]

# part of the gap's energy that is next to nothing of it
CRUMB = 0.05
# effects with so many numbers that they may be found with some of them and need the others later
PARTIAL = ("kinematic_error", "link_inertia", "payload", "torque_constant")
# curved findings with so much evidence need not be taken out on trial
BEYOND_DOUBT = 100.0


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


def contenders(state: Search, parts: Sequence[Part], skip: Sequence[tuple[str, int]] = ()) -> list[Contender]:
    """Every hypothesis beside what was found, by evidence, the best first."""
    return ranked(fits_beside(state, skip), state.left, parts, state.slope)


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
        option = found_of(contender, rows)
        if option.effect == "delay":
            late.append(option)
        elif option.key not in {item.key for item in found}:
            likely.setdefault(option.key, option)
    return [*late, *likely.values()]


def fits_beside(state: Search, skip: Sequence[tuple[str, int]] = ()) -> list[Fitting]:
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
    numbers = numbers_in(state.found)
    there = {item.key for item in state.found}
    named = {
        (one.effect, one.at, one.form): one
        for one in hypotheses(problem, rows, scales, taken)
        if one.key not in there or _more(one, numbers)
    }
    new = [name for name in named if name not in state.signatures]
    signatures = side_by_side(lambda name: signature_of(problem, named[name], rows, base), new)
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


def loudness(state: Search) -> float:
    """Energy of what is left above noise; 0 where it is no more than noise may have, or a crumb of the gap."""
    count = len(state.left)
    above, first = _above_noise(state)
    return above if above > max(LOUD * math.sqrt(2.0 * count), CRUMB * first) else 0.0


def _above_noise(state: Search) -> tuple[float, float]:
    """Energy above noise of what is left, and of the gap."""
    nothing = _nothing(state)
    return energy_of(state.left) - len(state.left), energy_of(nothing) - len(nothing)


def part_open(state: Search) -> float:
    """Part that is left of the gap's energy along the motion, above noise; 0 of a gap that is no louder than noise."""
    count = len(state.left)
    above, first = _above_noise(state)
    return max(above, 0.0) / first if first > count > 0 else 0.0


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


def _loss(state: Search, item: Found, fit: Refined, parts: Sequence[Part]) -> float:
    """Log evidence that is lost without a finding, its price taken off: by its covariance, or tried."""
    price = NUMBER * len(fit.numbers_of(item.key))
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
