"""Other names for a finding: what these runs cannot tell from it, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects import effect_named
from .fit import blocks, spread
from .refine import refined
from .search import ALIKE, ALIKE_SHARE, Contender, Found, Search, contenders

# how many other names are fitted with all their numbers free
TRIED = 5
# a first look that is linear may be off by this much of the gap's energy
FIRST_LOOK = 0.25


@dataclass(frozen=True, slots=True)
class Alike:
    """Another name for a finding.

    Attributes:
        found: It in the finding's place, with its best numbers.
        worse: Log evidence that it falls short by.
        leaves: What it leaves more, as part of the energy that the finding takes.
    """

    found: Found
    worse: float
    leaves: float

    @property
    def because(self) -> str:
        """The reason as a sentence's end."""
        if self.worse < 0.0:
            return "it fits these runs as well"
        if self.leaves < ALIKE_SHARE:
            return f"put in its place it leaves only {100.0 * max(self.leaves, 0.0):.2g} % of the gap's energy more"
        return (
            f"these runs favour the one named by no more than {self.worse:.1f} in log evidence, below the {ALIKE:g} "
            "that would tell them apart"
        )


def alike(before: Search, found: Sequence[Found], item: Found) -> tuple[Alike, ...]:
    """Everything that could stand in a finding's place, the best first.

    Args:
        before: The search that found it, with the runs and what was worked out of them.
        found: All findings, refined.
        item: The one that is asked about.
    """
    problem, whiten = before.problem, before.whiten
    parts = blocks(problem.evidence)
    others = [other for other in found if other is not item]
    whole = refined(problem, whiten, found, parts)
    state = Search(problem, whiten, found=others, signatures=before.signatures, scales=before.scales)
    if others:
        fit = refined(problem, whiten, others, parts)
        state.found = [replace(other, row=fit.rows[other.effect, other.at]) for other in others]
        state.left = fit.left
    else:
        state.left = whiten(problem.residual({}))
    sigma = spread(whole.left, parts)
    best = float(np.sum((whole.left / sigma) ** 2))
    energy = max(float(state.left @ state.left) - float(whole.left @ whole.left), 1e-9)
    ranked = contenders(state, parts, [(item.effect, item.at)])
    near: dict[tuple[str, int], Contender] = {}
    for contender in ranked:
        more = (float(contender.left @ contender.left) - float(whole.left @ whole.left)) / energy
        worse = 0.5 * (float(np.sum((contender.left / sigma) ** 2)) - best)
        if more < FIRST_LOOK or worse < 2.0 * ALIKE:
            near.setdefault(contender.hypothesis.key, contender)
    out: list[Alike] = []
    for contender in list(near.values())[:TRIED]:
        rows = contender.hypothesis.rows(contender.beta)
        if rows is None:
            continue
        key = contender.hypothesis.key
        start = [*state.found, Found(*key, rows[key[0]][0], contender.gain)]
        fit = refined(problem, whiten, start, parts)
        worse = 0.5 * (float(np.sum((fit.left / sigma) ** 2)) - best) + _numbers(key[0]) - _numbers(item.effect)
        leaves = (float(fit.left @ fit.left) - float(whole.left @ whole.left)) / energy
        if worse < ALIKE or leaves < ALIKE_SHARE:
            out.append(Alike(Found(*key, fit.rows[key], contender.gain), worse, leaves))
    return tuple(sorted(out, key=lambda one: (one.worse, one.found.effect, one.found.at)))


def _numbers(effect: str) -> float:
    """What an effect pays for its numbers: two nats each, as in the search."""
    return 2.0 * sum(column.default is None for column in effect_named(effect).columns)
