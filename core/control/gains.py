"""Gains that suit any robot."""

from __future__ import annotations

import math

import numpy as np

from ..kinematics import dynamics
from ..representation import Robot
from .control import DEFAULT_RATE, Control, Feedforward

FREQUENCY = 5.0
DAMPING_RATIO = 0.7


def default_pd(
    robot: Robot,
    frequency: float = FREQUENCY,
    damping_ratio: float = DAMPING_RATIO,
    rate: float = DEFAULT_RATE,
    feedforward: Feedforward = "none",
) -> Control:
    """PD control that gives every joint by itself one frequency at home.

    kp = (2 pi f)^2 (M_ii + J), kd = 2 D (2 pi f) (M_ii + J).

    Args:
        robot: At its level; its drives' inertias count.
        frequency: f [Hz].
        damping_ratio: D.
        rate: Ticks a second [Hz].
        feedforward: What the controller adds.
    """
    w = 2.0 * math.pi * frequency
    diagonal = np.diag(dynamics(robot).mass_matrix(np.array(robot.home())))
    inertia = diagonal + np.array([stage.drive.inertia for stage in robot.stages])
    kp = tuple(float(w * w * value) for value in inertia)
    kd = tuple(float(2.0 * damping_ratio * w * value) for value in inertia)
    return Control("pd", kp, kd, feedforward, rate)
