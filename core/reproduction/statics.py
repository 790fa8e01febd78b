"""Where the tip of the elastic arm would stand if it came to rest at every point of the path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kinematics import dynamics, kinematics
from ..representation import Robot

Array = NDArray[np.float64]

TOLERANCE = 1.0e-14
ITERATIONS = 100


def stiffness(robot: Robot) -> Array:
    """K of every joint [N m/rad], shape (n,)."""
    return np.array([stage.drive.spring.stiffness if stage.drive.spring else np.inf for stage in robot.stages])


def damping(robot: Robot) -> Array:
    """b of every joint [N m s/rad], shape (n,)."""
    return np.array([stage.drive.spring.damping if stage.drive.spring else 0.0 for stage in robot.stages])


def sagged_positions(robot: Robot, theta: Array) -> Array:
    """Arm sides at rest, shape (m, n), with motor sides held at theta (m, n): q = theta - K^-1 g(q), iterated.

    Runs find their start by Newton's method on the engine's own gravity (`simulation.settle`); this is another way to
    the same point.
    """
    arms, k = dynamics(robot), stiffness(robot)
    q = theta
    for _ in range(ITERATIONS):
        following = theta - arms.gravity(q) / k
        moved = float(np.max(np.abs(following - q)))
        q = following
        if moved < TOLERANCE:
            break
    return q


def sagged_tip(robot: Robot, theta: Array) -> Array:
    """Tip in the base [m], shape (m, 3), of the arm at rest on motor sides theta (m, n)."""
    return kinematics(robot).tool_in_base(sagged_positions(robot, theta))[:, :3, 3]


def linear_sag(robot: Robot, theta: Array) -> Array:
    """The tip's sag by the Jacobian, -J K^-1 g(theta), shape (m, 3) [m]: the estimate of a text book."""
    shift = dynamics(robot).gravity(theta) / stiffness(robot)
    return -np.einsum("mij,mj->mi", kinematics(robot).jacobian(theta)[:, :3], shift)
