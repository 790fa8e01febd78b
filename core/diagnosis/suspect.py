"""Suspects that are no physics: what no log says of a controller, of an integrator or of stamps, and runs put right.

A controller may act without a hold; follow a command that changes at every few of its ticks only; take differences of
positions for speeds, which are half a tick late. Without a hold and with such speeds a record is what an integrator of
first order makes, one step a tick: q[k+1] - 2 q[k] + q[k-1] = h^2 ddq[k], and its speeds are those differences (Hairer,
Lubich and Wanner, Geometric Numerical Integration, 2006, I.1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from ..recording import Run
from .stamps import unshifted
from .words import listed, percent

# a controller that ticks so much faster is nearly a continuous one
FASTER = 8
# what is recorded with positions
_PLACES = ("q", "q_link", "ee", "ee_rot", "tau_link")


@lru_cache(maxsize=4)
def without_hold(run: Run) -> Run:
    """The run of a controller that ticks FASTER times as fast, nearly a continuous one; made once."""
    return replace(run, control=replace(run.control, rate=FASTER * run.control.rate))


def with_differences(run: Run, ticks: float = 1.0) -> Run:
    """The run of a controller whose speeds are as late as differences of positions over so many of its ticks are.

    Those recorded are put right.
    """
    return replace(_with_speeds_in_time(run, ticks), control=replace(run.control, differenced=ticks))


def with_coarse_steps(run: Run) -> Run:
    """The run of an integrator of first order, one step a tick."""
    control = replace(run.control, rate=FASTER * run.control.rate, differenced=FASTER)
    return replace(_with_speeds_in_time(run), control=control)


def with_steps(run: Run, ticks: float) -> Run:
    """The run of an integrator of first order whose steps are so many ticks long, less than one.

    Its speeds are those of half a step ago, and a torque acts half a step before its tick. With a clock that is half a
    step behind, torques and speeds are in time, positions come half a step early, and the controller sees them so.
    """
    back = unshifted(run, -0.5 * ticks / run.control.rate, _PLACES)
    return replace(back, control=replace(run.control, ahead=0.5 * ticks))


def _with_speeds_in_time(run: Run, ticks: float = 1.0) -> Run:
    return unshifted(run, 0.5 * ticks / run.control.rate, ("dq",))


def with_held_command(run: Run, ticks: int) -> Run:
    """The run of a controller whose command changes at every so many ticks."""
    return replace(run, control=replace(run.control, every=ticks))


@dataclass(frozen=True, slots=True)
class Suspect:
    """Something that a log does not say of its controller or of its stamps.

    Attributes:
        name: In a sentence, what goes with it.
        change: A run to the same run of such a controller, or with its stamps put right.
        exact: What is left then is no part of it.
        lags: It makes all that was measured come later, as friction does at one joint.
        everywhere: It acts in every joint alike.
        fitted: How much of it there is was chosen, so that it has to leave next to nothing.
    """

    name: str
    change: Callable[[Run], Run]
    exact: bool = False
    lags: bool = False
    everywhere: bool = False
    fitted: bool = False

    def said(self, runs: Sequence[Run]) -> str:
        """A sentence on runs whose gap goes with it."""
        return f"The gap in {_names(runs)} is that of {self.name}. That is numerics and no effect."

    def half_said(self, runs: Sequence[Run]) -> str:
        """A sentence on runs whose gap goes with it for the most part."""
        return (
            f"More than half of the gap in {_names(runs)}, or of most joints' own, is that of {self.name}. That is "
            "numerics: no effect is looked for before it is put right."
        )

    def outdone_said(self, runs: Sequence[Run], part: float) -> str:
        """A sentence on runs of which it would leave so much of the gap, where effects leave next to nothing."""
        return (
            f"The gap in {_names(runs)} is not taken for numerics: what was found leaves next to nothing of it, and "
            f"{percent(part)} would be left by {self.name}."
        )

    def beside_said(self, runs: Sequence[Run]) -> str:
        """A sentence on runs where it stands beside effects, and was put right before these were looked for again."""
        return (
            f"What effects leave of {_names(runs)} is that of {self.name}. That is numerics: it was put right, and "
            "the effects were looked for again."
        )


def _names(runs: Sequence[Run]) -> str:
    return listed(run.name for run in runs)


NO_HOLD = Suspect(
    f"a controller that acts without a hold: it is compared with one that ticks {FASTER} times as fast",
    without_hold,
    everywhere=True,
)
DIFFERENCES = Suspect(
    "a controller whose speeds are differences of positions, half a tick late", with_differences, everywhere=True
)
COARSE_STEPS = Suspect("an integrator of first order with one step a tick", with_coarse_steps, everywhere=True)


def held_command(ticks: int) -> Suspect:
    """A command that changes at every so many ticks only."""
    return Suspect(
        f"a controller whose command changes at every {ticks} ticks only",
        lambda run: with_held_command(run, ticks),
        lags=True,
    )


def late_speeds(ticks: float) -> Suspect:
    """Speeds that are as late as differences of positions over so many ticks."""
    return Suspect(
        f"a controller whose speeds are {0.5 * ticks:.2g} ticks late, as those of a filter are",
        lambda run: with_differences(run, ticks),
        fitted=True,
    )


def fine_steps(ticks: float) -> Suspect:
    """An integrator of first order with steps of so many ticks, less than one."""
    return Suspect(
        f"an integrator of first order with steps of {ticks:.2g} ticks", lambda run: with_steps(run, ticks), fitted=True
    )


LATE = Suspect(
    "stamps that are one sample early: all that was measured is put back",
    lambda run: unshifted(run, 1.0 / run.rate),
    exact=True,
    lags=True,
)
LATE_TORQUE = Suspect(
    "a torque that is stamped one sample after the motion that it makes: it is put back",
    lambda run: unshifted(run, 1.0 / run.rate, ("tau",)),
    exact=True,
)
