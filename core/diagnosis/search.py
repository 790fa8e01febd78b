"""Which effects: all compete, the best is added, all are fitted again, until nothing earns its place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .fit import Linear, Part, blocks, linear, spread
from .hypotheses import STEP, Hypothesis, Scales, hypotheses, place_of, scales_of
from .nuisances import Whitening
from .problem import Problem, Rows, merged
from .refine import Refined, refined

Vector = NDArray[np.float64]

MOST_FINDINGS = 6
# log evidence that a finding needs: some hundreds compete, and a false name is worse than none
THRESHOLD = 10.0
# others are names of the same finding where their evidence is so near
ALIKE = 5.0
# what a name may leave more than the best one, as part of the gap's energy, and still not be told apart
ALIKE_SHARE = 0.01
# names that are fitted with all their numbers free before one is chosen
MOST_TRIED = 6
# names that explain the gap alike but for this part of its energy are told apart by likelihood
SAME_ENERGY = 0.02


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
    """

    hypothesis: Hypothesis
    gain: float
    explains: float
    beta: Vector
    left: Vector
    shows: float


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """An effect that was found.

    Attributes:
        effect, at: What and where.
        row: Its values.
        gain: Log evidence that it adds to the others.
        rivals: Others that do as well: (effect, at, gain below the best, share of the energy that it leaves more).
    """

    effect: str
    at: int
    row: EffectRow
    gain: float
    rivals: tuple[tuple[str, int, float, float], ...] = ()

    @property
    def place(self) -> str:
        """joint_N, arm_N or robot."""
        return place_of(self.effect, self.at)


@dataclass(slots=True)
class Search:
    """The search as it goes.

    Attributes:
        problem: The question.
        whiten: Nuisances.
        found: What was found, in order.
        left: What is left, whitened, in units of noise.
        first: Contenders of the first round, for the map of scores.
        signatures: What was worked out of a hypothesis before: how it begins apart from what is left, and its slope.
            What was found meanwhile changes them little, and the best are fitted in full.
        scales: Of the first round.
    """

    problem: Problem
    whiten: Whitening
    found: list[Found] = field(default_factory=list[Found])
    left: Vector = field(default_factory=lambda: np.zeros(0))
    first: list[Contender] = field(default_factory=list[Contender])
    signatures: dict[tuple[str, int, str], tuple[Vector, Vector]] = field(
        default_factory=dict[tuple[str, int, str], tuple[Vector, Vector]]
    )
    scales: Scales | None = None


def rows_of(found: Sequence[Found]) -> Rows:
    """Findings as tables."""
    out: dict[str, tuple[EffectRow, ...]] = {}
    for item in found:
        out = merged(out, {item.effect: (item.row,)})
    return out


def search(problem: Problem, whiten: Whitening, tell: Callable[[str], None] | None = None) -> Search:
    """Find the effects."""
    state = Search(problem, whiten)
    state.left = whiten(problem.residual({}))
    parts = blocks(problem.evidence)
    while len(state.found) < MOST_FINDINGS:
        ranked = contenders(state, parts)
        if not state.first:
            state.first = ranked
        if not ranked or ranked[0].gain < THRESHOLD:
            break
        best = _refit_best(state, ranked, parts)
        if best is None:
            break
        state.found, state.left = best
        if tell:
            tell(f"{state.found[-1].effect} at {state.found[-1].place}")
    _prune(state, parts)
    return state


def contenders(state: Search, parts: Sequence[Part], skip: Sequence[tuple[str, int]] = ()) -> list[Contender]:
    """Every hypothesis beside what was found, by evidence, the best first."""
    problem = state.problem
    rows = rows_of(state.found)
    taken = [(item.effect, item.at) for item in state.found]
    base = problem.residual(rows)
    fits: list[tuple[Hypothesis, Vector, Vector]] = []
    now = scales_of(problem, rows)
    if state.scales is None:
        state.scales = now
    # amounts stay those of the first round, for which signatures were worked out
    scales = replace(state.scales, residual=now.residual)
    for hypothesis in hypotheses(problem, rows, scales, [*taken, *skip]):
        name = (hypothesis.effect, hypothesis.at, hypothesis.form)
        known = state.signatures.get(name)
        if known is None:
            signature = _signature(problem, hypothesis, rows, base)
            if signature is None:
                continue
            r0, slope = signature
            known = (state.whiten(r0 - base), state.whiten(slope))
            state.signatures[name] = known
        fits.append((hypothesis, state.left + known[0], known[1]))
    return ranked(fits, state.left, parts)


def ranked(fits: Sequence[tuple[Hypothesis, Vector, Vector]], left: Vector, parts: Sequence[Part]) -> list[Contender]:
    """Hypotheses by evidence, judged by the spread that the best of them leaves."""
    if not fits:
        return []
    sigma = spread(left, parts)
    order: list[tuple[float, Hypothesis, Linear, Vector, float]] = []
    # what is left by the best so far tells what misfit is to be expected; two rounds settle it
    for _ in range(3):
        null = float(np.sum((left / sigma) ** 2))
        order = []
        for hypothesis, r0, slope in fits:
            fit = linear(r0 / sigma, slope / sigma[:, None], hypothesis.scale, hypothesis.lower)
            gain = 0.5 * (null - fit.cost) - fit.volume
            shows = float(np.linalg.norm(slope * hypothesis.scale))
            order.append((gain, hypothesis, fit, fit.left * sigma, shows))
        order.sort(key=lambda entry: (-entry[0], entry[1].key, entry[1].form))
        if order[0][0] <= 0.0:
            break
        sigma = spread(order[0][3], parts)
    energy = max(float(left @ left) - len(left), 1e-9)
    out: list[Contender] = []
    for gain, hypothesis, fit, rest, shows in order:
        explains = (float(left @ left) - float(rest @ rest)) / energy
        out.append(Contender(hypothesis, gain, float(np.clip(explains, 0.0, 1.0)), fit.beta, rest, shows))
    return out


def _signature(problem: Problem, hypothesis: Hypothesis, rows: Rows, base: Vector) -> tuple[Vector, Vector] | None:
    """Residual at beta = 0 and its slope, by differences."""
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
        moved = hypothesis.rows(step)
        if moved is None:
            return None
        if hypothesis.effect == "payload" and j:
            # a first moment needs a mass to be one of
            step[0] = STEP * hypothesis.scale[0]
            moved = hypothesis.rows(step)
            if moved is None:
                return None
            columns.append((problem.residual(merged(rows, moved)) - r0) / step[j] - columns[0] * step[0] / step[j])
            continue
        columns.append((problem.residual(merged(rows, moved)) - r0) / step[j])
    slope = np.column_stack(columns)
    return (r0, slope) if np.all(np.isfinite(slope)) and np.all(np.isfinite(r0)) else None


def _refit_best(state: Search, order: list[Contender], parts: Sequence[Part]) -> tuple[list[Found], Vector] | None:
    """The best few with all their numbers free, together with what was found: the one that leaves least."""
    good = [contender for contender in order if contender.gain >= THRESHOLD]
    most = sorted(good, key=lambda contender: -contender.explains)
    tried: dict[tuple[str, int], tuple[Contender, Refined]] = {}
    for contender in _few(good, MOST_TRIED // 3) + _few(most, MOST_TRIED):
        key = contender.hypothesis.key
        row = contender.hypothesis.rows(contender.beta)
        if key in tried or row is None or len(tried) == MOST_TRIED:
            continue
        start = [*state.found, Found(*key, row[key[0]][0], contender.gain)]
        tried[key] = (contender, refined(state.problem, state.whiten, start, parts))
    if not tried:
        return None
    sigma = spread(min((fit.left for _, fit in tried.values()), key=_energy), parts)
    null = float(np.sum((state.left / sigma) ** 2))
    scored = [
        (0.5 * (null - float(np.sum((fit.left / sigma) ** 2))) - _occam(contender), contender, fit)
        for contender, fit in tried.values()
    ]
    scored.sort(key=lambda entry: (-entry[0], entry[1].hypothesis.key))
    likely = [entry for entry in scored if entry[0] >= THRESHOLD]
    if not likely:
        return None
    # the largest cause first: what it leaves unexplained elsewhere is easily taken for small ones. Of those that
    # explain as much, the likeliest.
    least = min(_energy(fit.left) for _, _, fit in likely)
    margin = SAME_ENERGY * (_energy(state.left) - least)
    gain, winner, best = next(entry for entry in likely if _energy(entry[2].left) <= least + margin)
    rows, rest = best.rows, best.left
    energy = max(_energy(state.left) - len(state.left), 1e-9)
    rivals: dict[tuple[str, int], tuple[str, int, float, float]] = {}
    refits = {contender.hypothesis.key: (g, fit.left) for g, contender, fit in scored}
    for contender in order:
        key = contender.hypothesis.key
        if key == winner.hypothesis.key or key in rivals:
            continue
        g, r = refits.get(key, (contender.gain, contender.left))
        more = (_energy(r) - _energy(rest)) / energy
        if gain - g < ALIKE or more < ALIKE_SHARE:
            rivals[key] = (*key, gain - g, more)
    found = [replace(item, row=rows[item.effect, item.at]) for item in state.found]
    key = winner.hypothesis.key
    found.append(Found(*key, rows[key], gain, tuple(rivals.values())))
    return found, rest


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


def _occam(contender: Contender) -> float:
    """What a hypothesis pays for its numbers, as in the linear fit."""
    return 2.0 * len(contender.beta)


def _prune(state: Search, parts: Sequence[Part]) -> None:
    """Take out again what the others make needless."""
    for item in list(state.found):
        others = [other for other in state.found if other is not item]
        if not others:
            continue
        fit = refined(state.problem, state.whiten, others, parts)
        sigma = spread(state.left, parts)
        loss = 0.5 * (float(np.sum((fit.left / sigma) ** 2)) - float(np.sum((state.left / sigma) ** 2)))
        if loss < THRESHOLD:
            state.found = [replace(other, row=fit.rows[other.effect, other.at]) for other in others]
            state.left = fit.left
        elif not math.isfinite(loss):
            raise ArithmeticError(f"{item.effect} at {item.place}: the fit without it is {loss!r}")
