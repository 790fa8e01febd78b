"""What held-out runs do not confirm: whether some are cut in time and all fitted, so that parts of them may."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..recording import Run
from ..signals import joint_unit
from .diagnosis import Unexplained, Verdict
from .found import Found
from .model import Rows
from .nuisances import Whitening
from .problem import Problem
from .state import Search, part_open
from .unseen import Split
from .words import listed, percent

Vector = NDArray[np.float64]

# part of the energy above noise of some runs that is next to nothing in others: of held-out ones, a coefficient, in the
# fitted ones, and of the one that is loudest in all others
NEARLY_STILL = 0.05
# part of the gap's energy that a name may leave which no run of its own confirms, if no other form of its law says that
UNDERSTOOD = 0.35
# part of a loud gap that findings may leave in the fitted runs if these and parts of the others are to confirm them:
# they would have to leave no more than UNDERSTOOD of it there
CONFIRMABLE = 0.5
# causes after which that is known
FIRST_CAUSES = 3
# part of a gap that is worth a second question, where most of it is at a joint that held-out runs move farther
MUCH = 0.15
# how many times as far held-out runs must move a joint for the others to know little of what goes with its position
FARTHER = 2.0
# part of a way that is no motion but a sensor's noise
STANDS = 0.01
ALONE = "The gap stands in the held-out runs alone: the others show no more than noise of it where their joints move."
MOVES_FARTHER = "Most is left at {joint}, which moves over {far:.3g} {unit} in the held-out runs, {near} in the others."
MANY_MOVE_FARTHER = (
    "Most is left at joints that move much farther in the held-out runs: {joint} over {far:.3g} {unit}, in the others "
    "over {near}."
)
FAILS = "The held-out runs confirm nothing that the others show."
SEEN_APART = (
    "{why} So {cut} cut in time and all runs were fitted, each part and each other run judged by fits that had not "
    "seen it. Hold out a run that moves like one that is fitted to have the answer confirmed."
)
NOWHERE_ELSE = (
    "Fitted to all runs, {names} would leave {part} of the gap along their motion, but parts of them that no fit saw "
    "confirm none of it. Record a run that asks the same of the robot."
)


@dataclass(frozen=True, slots=True)
class Unconfirmed:
    """Why an answer is asked again with some runs cut in time and all fitted, or what that did not confirm.

    Attributes:
        why: In sentences.
        cut: Names of the runs to cut; () where they were.
    """

    why: str
    cut: tuple[str, ...] = ()

    @property
    def said(self) -> str:
        """What an answer that was found so says of it."""
        return SEEN_APART.format(why=self.why, cut=f"{listed(self.cut)} {'was' if len(self.cut) == 1 else 'were'}")


def unconfirmed(
    whole: Problem,
    runs: Sequence[Run],
    way: Split,
    state: Search,
    verdict: Verdict,
    unexplained: Unexplained,
    *,
    alone: bool,
) -> Unconfirmed | None:
    """Why an answer by held-out runs is asked again, and with which runs in parts; None where that is vain.

    Args:
        whole: All runs.
        runs: They.
        way: Which of them were held out.
        state: What was found in the others.
        verdict: The answer's.
        unexplained: What it leaves.
        alone: The held-out runs alone show that.
    """
    held_out = tuple(runs[k].name for k in way.unseen)
    if alone:
        return Unconfirmed(ALONE, held_out)
    if unexplained.share > MUCH and (why := moves_farther(whole, way, unexplained)):
        return Unconfirmed(why, held_out)
    if verdict == "unexplained" and part_open(state) <= CONFIRMABLE:
        return Unconfirmed(FAILS, those_that_show(whole, runs, way))
    return None


def nearly_alone(whole: Problem, whiten: Whitening, way: Split, rows: Rows) -> bool:
    """Whether the held-out runs show nearly all that rows leave: joints that stand are not compared."""
    fitted = whiten.only(whole.evidence.places(way.seen))(whole.only(way.seen).residual(rows))
    there = whiten.only(whole.evidence.places(way.unseen))(whole.only(way.unseen).residual(rows))
    loud, quiet = (float(one @ one) / max(len(one), 1) - 1.0 for one in (there, fitted))
    return len(there) > 0 and loud > 0.0 and quiet < NEARLY_STILL * loud


def those_that_show(whole: Problem, runs: Sequence[Run], way: Split) -> tuple[str, ...]:
    """Names of the runs to cut: the fitted one that has nearly all of the gap, or those that were held out."""
    left = whole.residual({})
    places = (whole.evidence.places([k]) for k in range(len(runs)))
    above = [max(float(np.sum(left[there] ** 2 - 1.0)), 0.0) for there in places]
    loudest = int(np.argmax(above))
    alone = sum(above) - above[loudest] < NEARLY_STILL * above[loudest]
    return tuple(runs[k].name for k in ((loudest,) if alone and loudest in way.seen else way.unseen))


def moves_farther(whole: Problem, way: Split, unexplained: Unexplained) -> str:
    """That held-out runs move joints where half is left or more far farther than the fitted ones; "" if they do not."""
    near, far = (_moved(whole.only(runs)) for runs in (way.seen, way.unseen))
    joints = {f"joint_{k + 1}": k for k in np.flatnonzero(far > FARTHER * near).tolist()}
    farther = {joint: share for joint, share in unexplained.joints.items() if joint in joints}
    if not farther or sum(farther.values()) < 0.5 * sum(unexplained.joints.values()):
        return ""
    joint = max(farther, key=lambda name: farther[name])
    k = joints[joint]
    unit = joint_unit("q", whole.database.joints[k].kind)
    said = MOVES_FARTHER if len(farther) == 1 else MANY_MOVE_FARTHER
    less = f"{near[k]:.3g}" if near[k] > STANDS * far[k] else "next to nothing"
    return said.format(joint=joint, far=far[k], near=less, unit=unit)


def _moved(some: Problem) -> Vector:
    """How far every joint moves in the run in which it moves farthest [rad or m], shape (n,)."""
    return np.max([np.ptp(run.q, axis=0) for run in some.evidence.runs], axis=0)


def leaves_most(state: Search) -> bool:
    """Whether the first causes leave most of the gap: more of them confirm nothing in parts of runs."""
    return len(state.found) >= FIRST_CAUSES and part_open(state) > CONFIRMABLE


def nowhere_else(state: Search) -> Unconfirmed | None:
    """What would explain runs that are fitted and parts of them do not confirm; None where it leaves much."""
    part = part_open(state)
    if not state.found or part > UNDERSTOOD:
        return None
    return Unconfirmed(NOWHERE_ELSE.format(names=named_as(state.found), part=percent(part)))


def named_as(found: Sequence[Found]) -> str:
    """Findings by their names and places in the database."""
    return listed(f"{item.effect} at {item.place}" for item in found)
