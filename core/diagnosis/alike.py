"""Other names for a finding: what these runs cannot tell from it, and why."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .beyond import SPRINGS, STIFFENING
from .contender import NUMBER, Contender
from .fit import blocks, gained, spread, takes_the_same
from .found import Found, never_slipping, rows_of, without_bodies
from .hypotheses import possible, twins_of
from .hypothesis import clamped, defaults
from .other_laws import beyond_catalogue
from .problem import Problem
from .refine import Refined, refined
from .resonance import DAMPING, TURNING
from .state import Search, contenders
from .tried import ALIKE, ALIKE_SHARE

Vector = NDArray[np.float64]

# how many other names are fitted with all their numbers free
TRIED = 5
# a first look by signatures may be off by this much of the gap's energy; of what is linear, this much
FIRST_LOOK, LINEAR_LOOK = 0.25, 0.1
# and springs about as stiff as one that was found: how many, and by what times its stiffness
MOST_SPRINGS, ABOUT = 3, (0.4, 1.0, 2.5)
# at its own place, where both turn the same bodies and what rings long is met near its own stiffness only
BESIDE = (0.7, 0.78, 0.86, 0.93, 1.07, 1.15, 1.24, 1.34, 1.5, 1.7)


@dataclass(frozen=True, slots=True)
class Alike:
    """Another name for a finding.

    Attributes:
        found: It in the finding's place, with its best numbers.
        worse: Log evidence that it falls short by.
        leaves: What it leaves more, as part of the energy that the finding takes.
        one_body: Both are names of one body.
    """

    found: Found
    worse: float
    leaves: float
    one_body: bool = False

    @property
    def because(self) -> str:
        """The reason as a sentence's end."""
        if self.one_body:
            return "what hangs at the last arm and that arm are one body, which no motion tells apart"
        if self.worse < 0.0:
            return "it fits these runs as well"
        if self.leaves < ALIKE_SHARE:
            return f"put in its place it leaves only {100.0 * max(self.leaves, 0.0):.2g} % of the gap's energy more"
        return (
            f"these runs favour the one named by no more than {self.worse:.1f} in log evidence, below the {ALIKE:g} "
            "that would tell them apart"
        )


def alike(before: Search, found: Sequence[Found], fit: Refined, item: Found) -> tuple[Alike, ...]:
    """Everything that could stand in a finding's place, the best first.

    Args:
        before: The search that found it, with the runs and what was worked out of them.
        found: All findings.
        fit: Their joint fit.
        item: The one that is asked about.
    """
    problem, whiten = before.problem, before.whiten
    parts = blocks(problem.evidence)
    others = [other for other in found if other is not item]
    # what could not be before others were found may be beside them
    state = Search(problem, whiten, signatures=before.signatures, scales=before.scales, banned=before.banned)
    if others:
        state.take(others, refined(problem, whiten, others, parts))
    else:
        state.begin()
    sigma = spread(fit.left, parts)
    whole = float(fit.left @ fit.left)
    energy = max(float(state.left @ state.left) - whole, 1e-9)
    near: dict[tuple[str, int], list[Contender]] = {}
    for contender in contenders(state, parts, [item.key]):
        more = (float(contender.left @ contender.left) - whole) / energy
        worse = gained(contender.left, fit.left, sigma, parts)
        twin = one_body(problem, contender.hypothesis.key, item.key)
        if twin or more < (FIRST_LOOK if contender.hypothesis.curved else LINEAR_LOOK) or worse < 2.0 * ALIKE:
            near.setdefault(contender.hypothesis.key, []).append(contender)
    # each name in its forms, the best first
    tried: list[list[Found]] = []
    for key in sorted(near, key=lambda key: not one_body(problem, key, item.key))[:TRIED]:
        rows = [(one.hypothesis.rows(one.beta), one.gain) for one in near[key]]
        forms = [Found(*key, row[key[0]][0], gain) for row, gain in rows if row is not None]
        tried += [forms] if forms else []
    there = {one.key for one in (*found, *(forms[0] for forms in tried))}
    nearest: list[tuple[float, Found]] = []
    for spring in _springs_instead(problem, item):
        if spring.key not in there:
            left = whiten(problem.misfit(rows_of([*state.found, spring])))
            nearest.append((float(left @ left), spring))
    for left, spring in sorted(nearest, key=lambda one: one[0]):
        if left - whole < FIRST_LOOK * energy and spring.key not in there and len(tried) < TRIED + MOST_SPRINGS:
            tried.append([spring])
            there.add(spring.key)

    def fitted(one: Found) -> tuple[Found, Refined]:
        trial = [*state.found, one]
        other = refined(problem, whiten, trial, parts)
        if STIFFENING in item.row.values:
            other = beyond_catalogue(problem, whiten, trial, other, parts, one, float(state.left @ state.left))
        return replace(one, row=other.rows[one.key]), other

    def may_be(named: Found) -> bool:
        twin = one_body(problem, named.key, item.key)
        return twin or not (without_bodies(problem, [named]) or never_slipping(problem, [named]))

    out: list[Alike] = []
    for forms in tried:
        # moments of inertia alone may be no body where a mass is one
        named, other = next((each for each in map(fitted, forms) if may_be(each[0])), (None, None))
        if named is None or other is None:
            continue
        more = len(other.numbers_of(named.key)) - len(fit.numbers_of(item.key))
        # a number costs what it does in the search
        worse = gained(other.left, fit.left, sigma, parts) + NUMBER * more
        leaves = (float(other.left @ other.left) - whole) / energy
        if one_body(problem, named.key, item.key):
            out.append(Alike(named, worse, leaves, one_body=True))
            continue
        # what takes something else away is no other name for it
        same = takes_the_same(state.left, fit.left, other.left, sigma)
        if same and (worse < ALIKE or leaves < ALIKE_SHARE):
            out.append(Alike(named, worse, leaves))
    return tuple(sorted(out, key=lambda one: (one.worse, one.found.effect, one.found.at)))


def _springs_instead(problem: Problem, item: Found) -> list[Found]:
    """Drives, bearings and arms about as stiff as a spring that was found: they ring nearly as it does.

    Signatures of springs hold near their own stiffness only, and those were hardly tried there. One before it turns
    more with the same stiffness than it does, and is harder where it rings as fast. At its own place one may be as
    stiff as any of its ways: of a spring that hardly gives one way, the runs know the other.
    """
    values = item.row.values
    ways = [
        (values[name], values[DAMPING[name]])
        for name in SPRINGS.get(item.effect, ())
        if name in DAMPING and math.isfinite(values[name])
    ]
    if not ways:
        return []
    plain = {STIFFENING: values[STIFFENING]} if STIFFENING in values else {}
    k, b = (float(np.mean([way[side] for way in ways])) for side in (0, 1))
    out: list[Found] = []
    for effect, columns in TURNING.items():
        about: list[tuple[tuple[float, float], int, float]] = []
        for at in range(1, problem.database.n + 1):
            own = at == item.at
            each = ways if own or effect == "joint_compliance" else [(k, b)]
            about += itertools.product(dict.fromkeys(each), [at], (*ABOUT, *BESIDE) if own else ABOUT)
        for (stiffness, damping), at, times in about:
            turns = effect != "joint_compliance" or problem.database.joints[at - 1].kind == "revolute"
            if not turns or clamped(problem, at) or not possible(problem, effect, at):
                continue
            if problem.row_at(effect, at, {}) is None:
                row = defaults(effect) | plain
                row |= dict.fromkeys(columns, times * stiffness) | {DAMPING[name]: times * damping for name in columns}
                out.append(Found(effect, at, EffectRow(at, row), item.gain))
    return out


def one_body(problem: Problem, one: tuple[str, int], other: tuple[str, int]) -> bool:
    """Whether two names are of one body, which no motion tells apart."""
    return {one, other} == twins_of(problem)
