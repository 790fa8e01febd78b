"""What closes the gap in simulation though the measured motion hardly shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import RefusedError
from ..signals import JOINT_SIGNALS
from .compared import mode_of, residuals
from .contender import THRESHOLD
from .fit import blocks
from .found import Found, as_hard_as_a_contact, rows_of
from .held import HELPS, MOST_LEFT, MOSTLY, Held
from .judge import Judge, rows_of_splits
from .model import robot_of
from .noise import noise_floor
from .polish import closing
from .refine import refined, vanished
from .resimulate import resimulated
from .resonance import springs
from .state import Search, beside
from .unseen import OTHER_FORM, judged

# drives that give are tried where most of a gap is open and one closes most of it from afar: at how many of the loudest
# joints, each with every so manieth softness
SOFT_JOINTS, SOFTER = 3, 4
# causes that are tried in simulation where it leaves much of which the measured motion shows little: how many, what one
# may leave of the fitted runs to be tried on the others, how many are, and what it may leave there of what was open
MOST_OPTIONS, MOST_LATE, CLOSING, MOST_CLOSING, CLOSES = 12, 2, 0.5, 3, 0.25


def closed_in_simulation(judge: Judge, held: Held, state: Search) -> Held:
    """With the cause that closes the gap in simulation, where one does that the measured motion hardly shows.

    A loop makes much of what is small along the motion: of a delay, which stamps may be as well; of an inertia
    beside friction. Those that take most of what is left of the fitted runs are tried on the others.
    """
    told = not held.found or held.how_far.shrinks_by is not None
    if held.adequate or not told or not any(mode_of(run) == "pd" for run in judge.runs):
        return held
    # where a law that no engine has leaves next to nothing along the motion, what simulation leaves is its own
    said = held.unseen.beyond < MOST_LEFT and held.unseen.open * held.unseen.beyond < OTHER_FORM
    for option in _closing(judge, held, state):
        found = (*held.found, option)
        if as_hard_as_a_contact(judge.whole, found):
            continue
        unseen = judged(judge.whole, judge.whiten, found, judge.ways)
        # nor is what another form of a law at its joint would leave a second cause here
        bends = option.at > 0 and unseen.own[-1] < MOST_LEFT
        if option.effect != "delay" and (said or bends or unseen.gains[-1] < 0.0):
            continue
        numbers = judge.numbers(found, unseen, far=True)
        if any(vanished(number, item) for number in numbers for item in found):
            # several that together may be anything close any gap
            continue
        for fitted in (numbers, ()) if numbers else ((),):
            rows = replace(unseen, rows=rows_of_splits(found, fitted)) if fitted else unseen
            other = judge.with_one_more(held, found, rows, fitted)
            if other is None or not other.adequate or other.open >= CLOSES * held.open:
                continue
            if other.by > held.by + HELPS:
                return replace(other, rings=option.effect == "joint_compliance")
    return held


def _closing(judge: Judge, held: Held, state: Search) -> list[Found]:
    """What simulated takes most of what findings leave of the runs that were fitted, the best first.

    With the log evidence that it has there for its gain, which must be that of a finding: of a gap that is next to
    none most is soon taken.
    """
    rows = held.unseen.rows[0] if held.found else ()
    found = [replace(item, row=row) for item, row in zip(held.found, rows, strict=True)]
    options = beside(state, found)
    late = [option for option in options if option.effect == "delay"][:MOST_LATE]
    tried = [*late, *[option for option in options if option.effect != "delay"][:MOST_OPTIONS]]
    if held.open > MOSTLY:
        tried += _soft_drives(judge, state, found)
    now, left = _left_with(judge, found, tried)
    best: dict[tuple[str, int], Found] = {}
    count = len(judge.whole.evidence.places(judge.ways[0].seen))
    for energy, k in sorted((energy, k) for k, energy in enumerate(left) if energy < CLOSING * now):
        spread = 1.0 + max(energy, 0.0) / count
        gain = 0.5 * (now - energy) / spread
        if gain >= THRESHOLD:
            best.setdefault(tried[k].key, replace(tried[k], gain=gain))
    return list(best.values())[:MOST_CLOSING]


def late_in_simulation(judge: Judge, state: Search) -> Found | None:
    """The delay that closes most of the gap in simulation, where one does.

    Under a command that jumps, what happens between rows is later with it, and hides it from the measured motion. What
    the shortest leaves, as far as it goes on in a line, says whether any of them may close it.
    """
    late = (option for option in beside(state, ()) if option.effect == "delay")
    tried = sorted(late, key=lambda option: option.row.values["time"])
    now, left = _left_with(judge, (), tried[:1])
    if left and left[0] < CLOSING * now:
        now, left = _left_with(judge, (), tried)
    best = min(range(len(left)), key=lambda k: left[k], default=None)
    return tried[best] if best is not None and left[best] < CLOSES * now else None


def _left_with(judge: Judge, found: Sequence[Found], tried: Sequence[Found]) -> tuple[float, Sequence[float]]:
    """Sum of squares above noise that simulated fitted runs leave with findings, and with each of some options more.

    0 and () where the engine refuses, or would take longer than anybody waits.
    """
    judge.tell("what would close the gap in simulation")
    seen = judge.ways[0].seen
    part, whiten = judge.whole.only(seen), judge.whiten.only(judge.whole.evidence.places(seen))
    fit = refined(part, whiten, found, blocks(part.evidence))
    options = [rows_of([option]) for option in tried]
    try:
        return closing(part, judge.level, [judge.runs[k] for k in seen], fit, options, judge.backend)
    except RefusedError:
        return 0.0, ()


def _soft_drives(judge: Judge, state: Search, found: Sequence[Found]) -> list[Found]:
    """Drives of the loudest joints that give, from hard to soft.

    Along the motion one that rings long shows near its own stiffness only, and there less than its noise.
    """
    if state.scales is None:
        return []
    loud = _loudest_joints(judge)[:SOFT_JOINTS]
    options = springs(judge.whole, rows_of(found), state.scales, state.out)
    soft = [one for one in options if one.effect == "joint_compliance"][::SOFTER]
    rows = ((one, one.rows(np.zeros_like(one.scale)) or {}) for one in soft if one.at in loud)
    return [Found(one.effect, one.at, row[one.effect][0], 0.0) for one, row in rows]


def _loudest_joints(judge: Judge) -> list[int]:
    """Joints, from 1, the one first whose gap stands farthest above noise in the runs that are fitted first."""
    total = np.zeros(judge.database.n)
    for run in (judge.runs[k] for k in judge.ways[0].seen):
        robot = robot_of(judge.database, judge.level, run)
        sensor = noise_floor(judge.database, judge.level, run).sensor
        for name, left in residuals(run, resimulated(robot, robot, run, judge.backend), robot).items():
            if name in JOINT_SIGNALS:
                total += np.nansum(np.square(left / sensor[name]), axis=0)
    return [int(i) + 1 for i in np.argsort(-total, kind="stable")]
