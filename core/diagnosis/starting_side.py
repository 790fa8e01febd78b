"""Where in its clearance an arm begins a run: one that nothing presses on to a side was left at any place between them.

No log says it, and until its motor has taken it along such an arm is somewhere else in simulation than it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..representation import Robot
from ..simulation import MachineState
from ..simulation.settle import terms_at_rest

Vector = NDArray[np.float64]

# a lever of the robot's whole weight whose torque nobody knows: what presses on an arm less may as well pull [m]
LIGHT = 1.0e-3
# an arm is taken along by the time that its motor has moved by so many clearances, and a little later [s]
TAKEN_ALONG, LATER = 2.0, 0.1


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


def light_load(robot: Robot) -> float:
    """What presses on an arm and may as well pull [N m or N]."""
    weight = sum(stage.arm.inertia.mass for stage in robot.stages) * float(np.linalg.norm(robot.gravity))
    return LIGHT * weight


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
