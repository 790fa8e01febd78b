"""Torque constant: the motor gives another torque than its current says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow, with_drives


class TorqueConstant(Effect):
    """The motor gives gain times the torque after torque_limit; the reported tau is without the gain.

    A wrong joint drive gain (Gautier and Briot, 2011).
    """

    name = "torque_constant"
    key = "joint"
    columns = (Column("gain", minimum=0.0, exclusive=True),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Multiplies the drive's gain."""
        return with_drives(robot, rows, lambda drive, row: replace(drive, gain=drive.gain * row.values["gain"]))
