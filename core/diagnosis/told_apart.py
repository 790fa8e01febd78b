"""Which of a finding's names hold on runs that no fit saw, and which holds best."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..kinematics import arms_in_base, tool_in_base
from .alike import Alike
from .beyond import SPRINGS as STIFFNESSES
from .contender import THRESHOLD
from .found import Found
from .judge import Judge
from .problem import Problem
from .refine import ANGLES, BEARING, PLAY, SHORTEST_PART
from .tried import ALIKE, ALIKE_SHARE
from .unseen import fall_short

# part of an arm's length up to which it bends as good as at its joint: where a fit's lower bound is
AT_JOINT = 1.1 * SHORTEST_PART
# the ways in which a bearing may give
WAYS = STIFFNESSES[BEARING]


def told_apart(
    judge: Judge, found: Sequence[Found], names: Sequence[tuple[Alike, ...]]
) -> tuple[list[tuple[Alike, ...]], tuple[Found, ...] | None]:
    """Names that hold on runs that no fit saw, and the findings by those that hold best, where that are others."""
    kept: list[tuple[Alike, ...]] = []
    best = list(found)
    for k, (item, others) in enumerate(zip(found, names, strict=True)):
        if not others:
            kept.append(others)
            continue
        judge.tell(f"which name of {item.effect} at {item.place} holds on runs that no fit saw")
        options = (item, *(one.found for one in others))
        short = fall_short(
            judge.whole, judge.whiten, [[*found[:k], one, *found[k + 1 :]] for one in options], judge.ways
        )
        if short[0].nats > ALIKE and short[0].share > ALIKE_SHARE:
            best[k] = min(zip(options, short, strict=True), key=lambda pair: pair[1].nats)[0]
        alike = tuple(
            one
            for one, less in zip(others, short[1:], strict=True)
            if one.one_body or less.nats - short[0].nats < THRESHOLD or less.share - short[0].share < ALIKE_SHARE
        )
        nats = {id(one): less.nats for one, less in zip(options, short, strict=True)}
        best[k] = _called_first(judge.whole, best[k], others, alike, nats)
        kept.append(alike)
    if all(one is other for one, other in zip(best, found, strict=True)):
        return kept, None
    # the evidence is that of all names which say the same
    return kept, tuple(replace(one, gain=max(one.gain, other.gain)) for one, other in zip(best, found, strict=True))


def _called_first(
    problem: Problem, best: Found, others: Sequence[Alike], alike: Sequence[Alike], nats: Mapping[int, float]
) -> Found:
    """Of the name that holds best and those that say the same the likeliest.

    Args:
        problem: The question.
        best: The name that holds best.
        others: Every other one.
        alike: Those that hold as well.
        nats: By its identity, how far each falls short on runs that no fit saw.
    """

    def as_good(one: Found) -> bool:
        return nats[id(one)] - nats[id(best)] < ALIKE

    if best.effect != "payload":
        # of two names of one body the load's: more hangs at a hand than is wrong with its arm
        loads = (one.found for one in others if one.one_body and one.found.effect == "payload")
        best = next((load for load in loads if as_good(load)), best)
    if best.effect == "payload":
        best = next((one.found for one in alike if not one.one_body and _of_arm(problem, best, one.found)), best)
    if best.effect == "kinematic_error" and _has_angles(best):
        # of two names of an angle that is off the encoder's: its zero is set by hand, an arm is made to measure
        best = next((one.found for one in alike if one.found.effect == "encoder_offset"), best)
    if best.effect == PLAY:
        # an arm that its load never takes across is off by half of the play, and there may as well be none
        offsets = (one.found for one in alike if one.found.key == ("encoder_offset", best.at))
        best = next((offset for offset in offsets if as_good(offset)), best)
    if best.effect == "link_flexibility":
        # what bends where its joint is, or may as well, is a bearing that gives
        bearings = (one for one in alike if one.found.key == (BEARING, best.at))
        at_joint = best.row.values["at"] <= AT_JOINT
        best = next((one.found for one in bearings if at_joint or (one.worse < ALIKE and as_good(one.found))), best)
    if best.effect == BEARING and sum(math.isfinite(best.row.values[way]) for way in WAYS) == 1:
        # a bearing gives to all sides about as much, a drive to one
        best = next((one.found for one in alike if one.found.effect == "joint_compliance"), best)
    return best


def _has_angles(arm: Found) -> bool:
    """Whether an arm that is off is so by an angle, and not by its lengths alone."""
    known = arm.absent.values if arm.absent else dict.fromkeys(arm.row.values, 0.0)
    return any(arm.row.values[name] != known[name] for name in ANGLES[arm.effect])


def _of_arm(problem: Problem, load: Found, other: Found) -> bool:
    """Whether a load is more mass of an arm before the last one: nearer to where that has its own than to the tool.

    What says the same as a mass of another arm is on the axes between them, where arms have theirs, and loads by chance
    only or in front of a hand.

    Args:
        problem: The question.
        load: A load.
        other: What says the same.
    """
    if other.effect != "link_inertia":
        return False
    robot = problem.robots({})[0]
    q = np.mean([run.q.mean(axis=0) for run in problem.evidence.runs], axis=0)
    arms = arms_in_base(robot, q)
    there = arms[-1] @ np.array([*(load.row.values[axis] for axis in "xyz"), 1.0])
    own = arms[other.at - 1] @ np.array([*robot.stages[other.at - 1].arm.inertia.com, 1.0])
    tool = tool_in_base(robot, q)[:, 3]
    return bool(np.linalg.norm(there - own) < np.linalg.norm(there - tool))
