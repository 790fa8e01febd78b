"""The paper's "Memory" block: feedback that is one communication step old."""

from __future__ import annotations

from dataclasses import replace

from ..motion import MotionLaw
from ..representation import Robot


def late_feedback(robot: Robot, motion: MotionLaw, late: float) -> tuple[Robot, MotionLaw]:
    """A robot and a command that run as if the feedback came late by a time [s].

    tau(t) = kp (q_cmd(t) - q(t - late)) + kd (...): the effect `delay` holds the torque back, which makes the command
    late as well as the feedback; a command that is early by as much is then on time. The two are the same equation,
    but for the first `late` seconds, in which the robot stands.
    """
    return replace(robot, delay=robot.delay + late), MotionLaw(motion.knots - late, motion.coefficients)
