"""Where in its clearance an arm begins a run: one that nothing presses on to a side was left at any place between them.

No log says it, and until its motor has taken it along such an arm is somewhere else in simulation than it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kinematics import Dynamics
from ..representation import Robot, Stage
from ..simulation import MachineState
from ..simulation.settle import terms_at_rest, weight_of
from .prepare import FEWEST_FILTERED, Prepared, filtered

Vector = NDArray[np.float64]

# a lever of the robot's whole weight whose torque nobody knows: what presses on an arm less may as well pull [m]
LIGHT = 1.0e-3
# an arm is taken along by the time that its motor has moved by so many clearances, and a little later [s]
TAKEN_ALONG, LATER = 2.0, 0.1
# the part of a run that may tell where arms began along its motion: play is tried that is as wide as all of that
FIRST_PART = 0.25
# a part of a light load that is none
WEIGHTLESS = 1.0e-6


def places_at_rest(robot: Robot, rest: MachineState) -> Mapping[int, tuple[float, ...]]:
    """Where else in its clearance an arm may stand, by joint (from 0): in the middle, and at either side.

    Args:
        robot: All joints of its expansion.
        rest: Its state of rest.
    """
    light = light_load(robot)
    found: dict[int, tuple[float, ...]] = {}
    for i, stage in enumerate(robot.stages):
        spring = stage.drive.spring
        if spring is None or spring.gap <= 0.0:
            continue
        theta, q = float(rest.theta[i]), float(rest.q[i])
        middle = theta + terms_at_rest(stage.drive, "error", theta, q)
        pressed = spring.stiffness * max(abs(middle - q) - 0.5 * spring.gap, 0.0)
        if pressed <= light:
            places = (middle - 0.5 * spring.gap, middle, middle + 0.5 * spring.gap)
            # a state of rest is at one of them but for what a contact gives
            here = int(np.argmin([abs(place - q) for place in places]))
            found[i] = tuple(place for k, place in enumerate(places) if k != here)
    return found


def clearance_of(stage: Stage) -> float:
    """The clearance before an arm [rad or m]."""
    return stage.drive.spring.gap if stage.drive.spring else 0.0


def light_load(robot: Robot) -> float:
    """What presses on an arm and may as well pull [N m or N]."""
    return LIGHT * weight_of(robot)


def rows_until_taken_along(gaps: Vector, theta: Vector, t: Vector) -> int:
    """How many rows tell where arms began.

    Args:
        gaps: Clearances of the joints whose arms are free, 0 of others, shape (n,).
        theta: Motor sides at the rows, shape (m, n).
        t: Their times [s], shape (m,).
    """
    moved = np.maximum.accumulate(np.abs(theta - theta[0]), axis=0)
    behind = np.any(moved < TAKEN_ALONG * gaps, axis=1)
    until = float(t[-1] if behind.all() else t[int(np.argmin(behind))]) + LATER
    return int(np.searchsorted(t, until, side="right"))


@dataclass(frozen=True, slots=True, eq=False)
class Witness:
    """What shows where in their clearances arms began; shapes (m, k) of all joints.

    Attributes:
        q_link: Arm sides, where they were measured; NaN of joints at which they were not.
        torque: What moved the motors but for the friction that was known, else.
    """

    q_link: Vector | None
    torque: Vector | None

    def sides(
        self,
        robot: Robot,
        arms: Dynamics,
        run: Prepared,
        loose: NDArray[np.bool_],
        motion: tuple[Vector, Vector, Vector],
        across: Callable[[Vector, int], tuple[Vector, Vector, Vector]],
    ) -> Vector:
        """At which side each free arm began, from -1 to 1, shape (k,); NaN of those that a load presses to one.

        Args:
            robot: All joints of its expansion.
            arms: Its rigid bodies.
            run: Whose motion it is.
            loose: Joints with a clearance, shape (k,).
            motion: Of the motor sides (with transmission errors).
            across: Motion of the arms that begin at these sides (k,), of so many rows.
        """
        theta, _, ddtheta = motion
        side = np.full(len(loose), np.nan)
        pull = np.array(
            [
                sum(spring.stiffness * (x - spring.rest) for spring in stage.drive.arm_springs)
                for stage, x in zip(robot.stages, theta[0], strict=True)
            ]
        )
        load = arms.gravity(theta[0]) + pull
        free = loose & (np.abs(load) <= light_load(robot))
        gaps = np.array([clearance_of(stage) for stage in robot.stages])
        rows = rows_until_taken_along(np.where(free, gaps, 0.0), theta, run.t)
        # the filter needs both of its ends
        rows = max(min(rows, int(FIRST_PART * len(theta))), 2 * run.edge, FEWEST_FILTERED)

        def missed(tried: Vector, i: int) -> float:
            q, dq, ddq = across(tried, rows)
            if self.q_link is not None and np.isfinite(self.q_link[:rows, i]).all():
                return float(np.mean(np.abs(self.q_link[:rows, i] - q[:, i])))
            if self.torque is None:
                return 0.0
            takes = robot.stages[i].drive.inertia * ddtheta[:rows, i] + arms.inverse_dynamics(q, dq, ddq)[:, i]
            beside = filtered(run, (self.torque[:rows, i] - takes)[:, None])
            # steady friction is no witness, nor what a blow is like that comes at its time
            return float(np.mean(np.abs(beside - np.median(beside))))

        for i in np.flatnonzero(free):
            # where nothing tells, it is where its load has it
            settled = float(np.sign(load[i])) if abs(load[i]) > WEIGHTLESS * light_load(robot) else 0.0
            places = sorted((0.0, -1.0, 1.0), key=lambda place, settled=settled: abs(place - settled))
            options = [np.where(np.arange(len(side)) == i, place, side) for place in places]
            side = min(options, key=lambda tried, i=int(i): missed(tried, i))
        return side


def nearest_start(
    rest: MachineState, places: Mapping[int, tuple[float, ...]], missed: Callable[[MachineState], float]
) -> MachineState:
    """The state of rest with the arms where a run's first moments are missed least, one joint after the other.

    Args:
        rest: Where arms settle.
        places: Joint (from 0) -> where else its arm may stand.
        missed: How far a simulation that begins there misses the run.
    """
    best, least = rest, missed(rest)
    for i, others in places.items():
        for place in others:
            q = best.q.copy()
            q[i] = place
            tried = replace(best, q=q)
            if (left := missed(tried)) < least:
                best, least = tried, left
    return best


def rattles(robot: Robot) -> bool:
    """Whether an arm may fly across a clearance."""
    return any(clearance_of(stage) > 0.0 for stage in robot.stages)
