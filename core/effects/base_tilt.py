"""Base tilt: the robot does not stand upright."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Pose, Robot
from .effect import Column, Effect, EffectRow


class BaseTilt(Effect):
    """The base's orientation becomes R_base Rx(roll) Ry(pitch); gravity stays.

    Two of the base's six parameters (Mooring, Roth and Driels, 1991): the two that gravity tells.
    """

    name = "base_tilt"
    key = "robot"
    columns = (Column("roll", "rad", default=0.0), Column("pitch", "rad", default=0.0))

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Turns the base."""
        for row in rows:
            roll = Pose.from_rpy((0.0, 0.0, 0.0), (row.values["roll"], 0.0, 0.0))
            pitch = Pose.from_rpy((0.0, 0.0, 0.0), (0.0, row.values["pitch"], 0.0))
            robot = replace(robot, base=robot.base @ roll @ pitch)
        return robot
