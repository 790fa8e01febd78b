"""What is told of each finding, and of what was looked at and is none."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..effects import effect_named
from ..representation import JointKind
from .alike import Alike
from .contender import THRESHOLD, Contender
from .diagnosis import Finding, Parameter, Rejected, Rival
from .found import Found
from .held import UNREAL, Held
from .how_far import name_of
from .placed import place_of
from .refine import Refined, range_of
from .state import Search
from .unseen import NOTHING

STUCK = "would never slip on these runs: a spring says the same"
# how often evidence beyond doubt is of something else: in 4 of 63 findings on the set of the blind bank for tuning
ELSEWHERE = 0.06
# of a number one standard deviation at least, as part of it: what another integrator's step and hold move it by
FINEST = 1.0e-3


def largest_first(held: Held) -> list[int]:
    """Places of the findings, that first without which the gap shrinks least where no fit saw it."""
    without = [held.how_far.without.get(name_of(item)) for item in held.found]
    return sorted(range(len(without)), key=lambda k: -math.inf if (by := without[k]) is None else by)


def finding(item: Found, kind: JointKind, gain: float, fit: Refined, others: Sequence[Alike]) -> Finding:
    """A finding with its numbers' intervals; numbers that no run shows have none, and are not told."""
    units = {column.name: column.unit_for(kind) for column in effect_named(item.effect).columns}
    parameters: dict[str, Parameter] = {}
    for k in fit.numbers_of(item.key):
        if fit.shown[k]:
            name = fit.free[k][2]
            value = item.row.values[name]
            half = 1.96 * math.hypot(math.sqrt(max(float(fit.covariance[k, k]), 0.0)), FINEST * value)
            least, most = range_of(item.effect, name)
            parameters[name] = Parameter(value, (max(value - half, least), min(value + half, most)), units[name])
    rivals = tuple(Rival(one.found.effect, one.found.place, one.because) for one in others)
    # along unseen motions a delay is hardly told from stamps: simulation judged it there
    unseen = math.inf if item.effect == "delay" else gain
    row = {name: value for name, value in item.row.values.items() if math.isfinite(value)}
    return Finding(item.effect, item.place, probability(item.gain, unseen), parameters, rivals, row)


def probability(seen: float, unseen: float) -> float:
    """That a finding is there, from the log evidence that it has where it was fitted and where it was not.

    However strong the evidence, it is evidence among the causes that were thought of.
    """
    nats = min(seen - 0.5 * THRESHOLD, unseen)
    return float((1.0 - ELSEWHERE) / (1.0 + math.exp(-min(nats, 30.0) / 2.0)))


def rejected(
    state: Search, found: Sequence[Found], dropped: Sequence[Rejected], names: Sequence[Sequence[Alike]]
) -> list[Rejected]:
    """Everything else that was looked at, by name and place."""
    said = {(item.effect, item.place) for item in found} | {(item.effect, item.at) for item in dropped}
    said |= {(one.found.effect, one.found.place) for others in names for one in others}
    out: list[Rejected] = []
    for (effect, at), contender in sorted(_best_forms(state).items()):
        place = place_of(effect, at)
        if (effect, place) in said:
            continue
        if (effect, at) in state.unreal:
            out.append(Rejected(effect, place, STUCK if effect == "hysteresis" else UNREAL))
        else:
            silent = contender.shows < NOTHING
            out.append(
                Rejected(effect, place, "not excited by these runs" if silent else "no gain beside what was found")
            )
    return out


def _best_forms(state: Search) -> dict[tuple[str, int], Contender]:
    """Of every effect at every place the form that did best alone."""
    best: dict[tuple[str, int], Contender] = {}
    for contender in state.first:
        best.setdefault(contender.hypothesis.key, contender)
    return best
