"""Torque constant: the motor gives another torque than its current says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow, with_drive


class TorqueConstant(Effect):
    """The motor gives gain times the torque after torque_limit; the reported tau is without the gain.

    A wrong joint drive gain (Gautier and Briot, 2011).
    """

    name = "torque_constant"
    key = "joint"
    columns = (Column("gain", minimum=0.0, exclusive=True),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Multiplies the drive's gain."""
        for row in rows:
            gain = row.values["gain"]
            robot = with_drive(robot, row.at, lambda drive, gain=gain: replace(drive, gain=drive.gain * gain))
        return robot
