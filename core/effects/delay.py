"""Delay: the commanded torque acts later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow


class Delay(Effect):
    """The torque command acts `time` later; the reported tau is the late one.

    tau(t) = tau_cmd(t - time), dead time (Smith, 1957).
    """

    name = "delay"
    key = "robot"
    columns = (Column("time", "s", minimum=0.0),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds to the robot's delay."""
        return replace(robot, delay=robot.delay + sum(row.values["time"] for row in rows))
