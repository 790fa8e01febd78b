"""A short motion that suits any robot: every joint goes out and back on quintics, within its limits."""

from __future__ import annotations

import math

import numpy as np

from ..kinematics import reach
from ..motion import MotionLaw, from_table
from ..motion.quintic import PEAK_SPEED
from ..representation import Robot
from ..simulation.backend import Vector

AMPLITUDE = 0.4
"""How far a revolute joint goes [rad]; a prismatic one goes this part of half the reach."""
FULL_DURATION = 2.0
"""Time that this takes [s]; a shorter exercise goes less far, so that nothing accelerates more."""


def exercise(robot: Robot, duration: float) -> MotionLaw:
    """From home out and back, at rest at both ends and in the middle; neighbouring joints go opposite ways.

    Args:
        robot: At any level.
        duration: Of the whole [s].
    """
    start, turn = exercise_ends(robot, duration)
    q = np.array([start, turn, start])
    return from_table([0.0, duration / 2, duration], q, np.zeros_like(q), np.zeros_like(q))


def exercise_ends(robot: Robot, duration: float) -> tuple[Vector, Vector]:
    """Where the exercise starts and where it turns, shapes (n,): it stays within limits of place and speed."""
    start = np.array(robot.home())
    turn = start.copy()
    for i, stage in enumerate(robot.stages):
        joint = stage.joint
        far = (
            AMPLITUDE
            * min(1.0, duration / FULL_DURATION) ** 2
            * (0.5 * reach(robot) if joint.kind == "prismatic" else 1.0)
        )
        if math.isfinite(joint.velocity):
            far = min(far, 0.9 * joint.velocity * (duration / 2) / PEAK_SPEED)
        # smaller from joint to joint, so that no two move alike
        far *= (-1.0) ** i * (1.0 - 0.5 * i / robot.n)
        if not joint.lower <= start[i] + far <= joint.upper:
            room = (joint.upper - start[i], start[i] - joint.lower)
            far = min(abs(far), 0.9 * max(room)) * (1.0 if room[0] >= room[1] else -1.0)
        turn[i] = start[i] + far
    return start, turn
