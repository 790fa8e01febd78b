"""Runs that no fit has seen: how they are set apart, and what each finding earns on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from ..recording import Run
from .beyond import number_of
from .fit import Part, blocks, edges_of, gained, spread
from .forms import Forms, beyond_forms
from .found import Found, rows_of
from .gap import loudest_along, shows_in_band
from .hypothesis import clamped
from .nuisances import Whitening
from .other_laws import straightened
from .problem import BODIES, FAR, Problem
from .refine import PLAY, Refined, left_with, refined, removal, widths_about

Vector = NDArray[np.float64]

# one run is cut into so many parts, more than two each at least this long [s]
PARTS, SHORTEST_PART = 3, 1.0
# for so long before a part its rows lead up to it [s]: what rings, sticks or was asked for before acts on
LEAD = 5.0
# more runs are left out several at a time
MOST_FOLDS = 4
# log evidence that a finding must earn where it was not fitted
EARNS = 3.0
# what a law of another form than the real one leaves of a signal's gap: less of it is no second cause
OTHER_FORM = 0.05
# mean squares in units of noise: of a channel that is closed, and of what goes there, which is most of what was left
CLOSED, CLEARLY, MOSTLY = 1.5, 3.0, 0.8
# a change of what is said, in standard deviations of everything together, that counts as nothing
NOTHING = 3.0


@dataclass(frozen=True, slots=True)
class Split:
    """Runs to fit on and runs to judge by, as numbers."""

    seen: tuple[int, ...]
    unseen: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Unseen:
    """What the findings are worth on runs that no fit saw.

    Attributes:
        gains: Log evidence that each finding earns there, beside the others.
        moves: By how many standard deviations each changes what is said there.
        shares: What part of a channel's gap each takes away there, of the channel of which it takes most; 1 where it is
            what closes one.
        own: What part of all that each takes away no other form of another finding's law can take, there or where it
            was fitted, of which the more: a law that has another form has it everywhere. 1 where there is none.
        rows: For each split, the rows that were fitted without its unseen runs.
        open: Part of the gap's energy along the motion, above noise, that all findings leave there.
        stands_out: Whether a band of what they leave there is far above noise.
        beyond: What part of `open` they leave with the laws beyond the catalogue's that they were found to have; 1
            where none has any.
        numbers_beyond: Each one's number of such a law; 0 where it has none.
    """

    gains: tuple[float, ...]
    moves: tuple[float, ...]
    shares: tuple[float, ...]
    own: tuple[float, ...]
    rows: tuple[tuple[EffectRow, ...], ...]
    open: float = 1.0
    stands_out: bool = False
    beyond: float = 1.0
    numbers_beyond: tuple[float, ...] = ()


def splits(count: int, held_out: int) -> tuple[Split, ...]:
    """The ways to set runs apart: the held-out ones (which stand last), or each in turn."""
    if held_out:
        return (Split(tuple(range(count - held_out)), tuple(range(count - held_out, count))),)
    parts = np.array_split(np.arange(count), min(count, MOST_FOLDS))
    return tuple(Split(tuple(k for k in range(count) if k not in part), tuple(int(k) for k in part)) for part in parts)


def in_parts(run: Run) -> tuple[Run, ...]:
    """A run cut in time, in two parts at least, each with what leads up to it and stamps from 0."""
    count = max(2, min(PARTS, int((run.duration - run.since) / SHORTEST_PART)))
    # of a part only what is compared there: the rest is for others to judge
    edges = np.linspace(np.argmax(run.judged), len(run.t), count + 1).astype(int)
    begins = np.searchsorted(run.t, run.t[edges[:-1]] - LEAD)
    return tuple(
        replace(
            run,
            name=f"{run.name} ({k + 1} of {count})",
            t=run.t[begin:b] - run.t[begin],
            signals={name: values[begin:b] for name, values in run.signals.items()},
            left_out=run.left_out if k == 0 else (),
            since=float(run.t[a] - run.t[begin]),
        )
        for k, (begin, (a, b)) in enumerate(zip(begins.tolist(), pairwise(edges.tolist()), strict=True))
    )


def judged(problem: Problem, whiten: Whitening, found: Sequence[Found], ways: Sequence[Split]) -> Unseen:
    """Fit the findings on the seen runs of every split and see what each is worth on the others.

    Args:
        problem: All runs.
        whiten: Nuisances of all runs.
        found: Findings with where to start.
        ways: The splits.
    """
    gains = np.zeros(len(found))
    moves = np.zeros(len(found))
    shares = np.zeros(len(found))
    # of each where it was not fitted and where it was: all that it takes away, and what of it no other form can
    taken, own = np.zeros((2, len(found))), np.zeros((2, len(found)))
    doubted = np.zeros(len(found), dtype=bool)
    rows: list[tuple[EffectRow, ...]] = []
    sums, stands_out = np.zeros(3), False
    numbers_beyond: tuple[float, ...] = ()
    for way in ways:
        seen, unseen = _Part.of(problem, whiten, way.seen), _Part.of(problem, whiten, way.unseen)
        fit = seen.fit(found)
        numbers_beyond = tuple(number_of(item.effect, fit.rows[item.key]) for item in found)
        straight = straightened(seen.problem, seen.whiten, found, fit, seen.parts)
        rows.append(tuple(straight.rows[item.key] for item in found))
        whole = _with(found, fit.rows)
        left = unseen.left(whole)
        sigma, fitted = spread(left, unseen.parts), spread(fit.left, seen.parts)
        nothing = unseen.left([])
        engines = left if straight is fit else unseen.left(_with(found, straight.rows))
        sums += [_energy(one) - len(one) for one in (nothing, engines, left)]
        stands_out = stands_out or shows_in_band(engines, unseen.parts)
        for k, item in enumerate(whole):
            others = [other for other in whole if other is not item]
            if len(ways) > 1 and _moved(seen.left(others), fit.left, fitted) < NOTHING:
                # its numbers stayed where they began, and that the runs to judge by have seen
                continue
            kept, rest = others, unseen.left(others)
            moves[k] += _moved(rest, left, sigma) ** 2
            # what play a little narrower or wider says as well is no second cause, where arms bounce in it
            loose = item.effect != PLAY and any(o.effect == PLAY and not clamped(problem, o.at) for o in others)
            if item.absent is not None:
                kept = _with(others, removal(fit, item.key, item.absent).rows)
                rest = unseen.left(kept)
            if others and (item.absent is None or float(np.mean(rest**2)) > 0.01 * FAR**2):
                # or where no such robot can be with the others as they would move
                kept = _with(others, seen.fit(others).rows)
                rest = unseen.left(kept)
            if loose:
                rest = min((rest, *map(unseen.left, of_other_widths(kept))), key=_energy)
            gains[k] += gained(rest, left, sigma, unseen.parts)
            # no body has another form of its law: what it takes hides no small cause beside it
            bodies = [other for other in others if other.effect in BODIES]
            beside = unseen.left(bodies) if bodies else nothing
            shares[k] = max(shares[k], _share(beside, rest, left, unseen.parts))
            for there, (part, without, beside) in enumerate(((unseen, rest, left), (seen, seen.left(kept), fit.left))):
                forms = beyond_forms(part.problem, part.whiten, whole, k)
                doubted[k] |= forms is not None
                taken[there, k] += (all_of_it := _energy(without) - _energy(beside))
                own[there, k] += all_of_it if forms is None else _energy(forms(without)) - _energy(forms(beside))
    nothing_taken = np.broadcast_to(np.where(doubted, 0.0, 1.0), taken.shape)
    alone = np.divide(own, taken, out=nothing_taken.copy(), where=taken > 0.0)
    most: Vector = np.maximum(alone[0], alone[1])
    loud, still, bends = sums.tolist()
    part = min(1.0, max(0.0, still / loud)) if loud > 0.0 else 1.0
    return Unseen(
        tuple(gains.tolist()),
        tuple(np.sqrt(moves).tolist()),
        tuple(shares.tolist()),
        # what takes nothing away there, beside a law that might say the same, has nothing of its own
        tuple(np.where(taken[0] > 0.0, most, alone[0]).tolist()),
        tuple(rows),
        part,
        stands_out,
        min(1.0, max(0.0, bends / still)) if any(numbers_beyond) and still > 0.0 else 1.0,
        numbers_beyond,
    )


def worth_by(
    problem: Problem,
    whiten: Whitening,
    found: Sequence[Found],
    ways: Sequence[Split],
    rows: Sequence[Sequence[EffectRow]],
    k: int,
) -> float:
    """Log evidence that one finding earns on unseen runs by other numbers than the evidence's own.

    Args:
        problem: All runs.
        whiten: Nuisances of all runs.
        found: Findings.
        ways: The splits.
        rows: For each split, the findings' rows.
        k: Which finding.
    """
    others = [item for j, item in enumerate(found) if j != k]
    gain = 0.0
    for way, there in zip(ways, rows, strict=True):
        seen, unseen = _Part.of(problem, whiten, way.seen), _Part.of(problem, whiten, way.unseen)
        left = unseen.left([replace(item, row=row) for item, row in zip(found, there, strict=True)])
        rest = unseen.left(_with(others, seen.fit(others).rows) if others else [])
        gain += gained(rest, left, spread(left, unseen.parts), unseen.parts)
    return gain


@dataclass(frozen=True, slots=True)
class Bent:
    """What other forms of the findings' laws make of what these leave where no fit saw it.

    Attributes:
        leaves: Part of its energy above noise that they leave of what another amount or phase of the laws would.
        place: Of the finding whose law has another form most clearly.
        said: What is said of it.
    """

    leaves: float
    place: int
    said: str


def bent(
    problem: Problem,
    whiten: Whitening,
    found: Sequence[Found],
    ways: Sequence[Split],
    rows: Sequence[Sequence[EffectRow]],
) -> Bent | None:
    """What other forms of the findings' laws say of what is left on runs that no fit saw; None where none has any.

    Args:
        problem: All runs.
        whiten: Nuisances of all runs.
        found: Findings.
        ways: The splits.
        rows: For each split, the findings' rows.
    """
    had, has = 0.0, 0.0
    largest: tuple[int, str] | None = None
    for way, fitted in zip(ways, rows, strict=True):
        seen, unseen = _Part.of(problem, whiten, way.seen), _Part.of(problem, whiten, way.unseen)
        whole = [replace(item, row=row) for item, row in zip(found, fitted, strict=True)]
        forms = Forms.of(seen.problem, seen.whiten, whole, seen.left(whole))
        if forms is None:
            return None
        largest = largest or forms.largest
        own, every = forms.beyond(unseen.problem, unseen.whiten, whole, unseen.left(whole))
        # channels whose noise is thought to be louder than it is would hide what is left in others
        loud = [(a, b) for a, b in edges_of(unseen.parts) if _energy(own[a:b]) > b - a]
        had, has = (
            total + sum(_energy(left[a:b]) - (b - a) for a, b in loud) for total, left in ((had, own), (has, every))
        )
    if largest is None or had <= 0.0:
        return None
    return Bent(min(1.0, max(0.0, has / had)), *largest)


@dataclass(frozen=True, slots=True)
class Along:
    """What findings leave of the gap along the measured motion, where no fit saw it.

    Attributes:
        share: Part of its energy above noise.
        loudest: Mean square of the channel that has most of it, in units of noise.
        joints: Part of what is left that is at each joint, those with any, the largest first.
    """

    share: float
    loudest: float
    joints: dict[str, float]


def along(problem: Problem, whiten: Whitening, found: Sequence[Found], ways: Sequence[Split]) -> Along:
    """What findings leave of the gap along the measured motion, on runs that no fit saw.

    Args:
        problem: All runs.
        whiten: Nuisances of all runs.
        found: Findings with their numbers.
        ways: The splits.
    """
    part = _Part.of(problem, whiten, sorted({k for way in ways for k in way.unseen}))
    nothing, left = part.left([]), part.left(found)
    loudest = loudest_along(left, part.parts)
    above = _energy(nothing) - len(nothing)
    share = (_energy(left) - len(left)) / above if above > 0.0 else 0.0
    joints: dict[str, float] = {}
    for channel in part.problem.evidence.channels:
        if not channel.signal.startswith("ee"):
            name = f"joint_{channel.index + 1}"
            over = _energy(left[channel.first : channel.last]) - (channel.last - channel.first)
            joints[name] = joints.get(name, 0.0) + over
    joints = {name: over for name, over in joints.items() if over > 0.0}
    whole = sum(joints.values())
    largest = sorted(joints.items(), key=lambda item: -item[1])
    return Along(min(1.0, max(0.0, share)), loudest, {name: over / whole for name, over in largest})


@dataclass(frozen=True, slots=True)
class Short:
    """How far a set of findings falls short of the best of several on runs that no fit saw.

    Attributes:
        nats: Log evidence.
        share: What it leaves more, as part of the gap's energy that the best takes.
    """

    nats: float
    share: float


def fall_short(
    problem: Problem, whiten: Whitening, named: Sequence[Sequence[Found]], ways: Sequence[Split]
) -> tuple[Short, ...]:
    """How far sets of findings fall short of the best of them on runs that no fit saw.

    Args:
        problem: All runs.
        whiten: Nuisances of all runs.
        named: Sets, each with where to start.
        ways: The splits.
    """
    nats, energy, nothing = np.zeros(len(named)), np.zeros(len(named)), 0.0
    for way in ways:
        seen, unseen = _Part.of(problem, whiten, way.seen), _Part.of(problem, whiten, way.unseen)
        left: list[Vector] = []
        for found in named:
            rows = seen.fit(found).rows
            left.append(unseen.left([replace(item, row=rows[item.key]) for item in found]))
        sigma = spread(min(left, key=lambda one: float(one @ one)), unseen.parts)
        nats += [gained(one, left[0], sigma, unseen.parts) for one in left]
        energy += [float(one @ one) for one in left]
        nothing += float(np.sum(unseen.left([]) ** 2))
    best = int(np.argmin(nats))
    share = (energy - energy[best]) / max(nothing - float(energy[best]), 1e-9)
    return tuple(Short(float(n - nats[best]), float(part)) for n, part in zip(nats, share, strict=True))


def of_other_widths(found: Sequence[Found]) -> list[list[Found]]:
    """Findings with each play a little narrower or wider."""
    return [
        [replace(other, row=row) if other is item else other for other in found]
        for item in found
        if item.effect == PLAY
        for row in widths_about(item.row)
    ]


def _with(found: Sequence[Found], rows: Mapping[tuple[str, int], EffectRow]) -> list[Found]:
    """Findings with these rows."""
    return [replace(item, row=rows[item.key]) for item in found]


def _energy(left: Vector) -> float:
    return float(left @ left)


def _moved(other: Vector, left: Vector, sigma: Vector) -> float:
    """By how many standard deviations of everything together another rest differs from what is left."""
    return float(np.linalg.norm((other - left) / sigma))


def _share(nothing: Vector, rest: Vector, left: Vector, parts: Sequence[Part]) -> float:
    """The largest part of a channel's gap, noise taken off, that goes from what the others leave to what all leave.

    1 where it is what closes one.
    """
    if _closes(rest, left, parts):
        return 1.0
    taken = 0.0
    for begin, end in edges_of(parts):
        gap = max(float(np.sum(nothing[begin:end] ** 2)), float(np.sum(rest[begin:end] ** 2))) - (end - begin)
        less = float(np.sum(rest[begin:end] ** 2) - np.sum(left[begin:end] ** 2))
        if less > 2.0 * EARNS and gap > 0.0:
            taken = max(taken, less / gap)
    return taken


def _closes(rest: Vector, left: Vector, parts: Sequence[Part]) -> bool:
    """Whether a channel that others leave well above noise goes down to it: what another form leaves no law closes."""
    for begin, end in edges_of(parts):
        before, after = float(np.mean(rest[begin:end] ** 2)), float(np.mean(left[begin:end] ** 2))
        if after < CLOSED and before - after > CLEARLY and before - after > MOSTLY * (before - 1.0):
            return True
    return False


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Some of the runs."""

    problem: Problem
    whiten: Whitening
    parts: Sequence[Part]

    @staticmethod
    def of(problem: Problem, whiten: Whitening, runs: Sequence[int]) -> _Part:
        part = problem.only(runs)
        return _Part(part, whiten.only(problem.evidence.places(runs)), blocks(part.evidence))

    def fit(self, found: Sequence[Found]) -> Refined:
        return refined(self.problem, self.whiten, found, self.parts)

    def left(self, found: Sequence[Found]) -> Vector:
        return left_with(self.problem, self.whiten, rows_of(found))
