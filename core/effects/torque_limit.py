"""Torque limit: the amplifier cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow, with_drives


class TorqueLimit(Effect):
    """tau is cut at +-torque, after the delay: a saturation of slope 1 (Khalil, Nonlinear Systems, 2002)."""

    name = "torque_limit"
    key = "joint"
    columns = (Column("torque", "N*m|N", minimum=0.0),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Sets the drive's limit."""
        return with_drives(robot, rows, lambda drive, row: replace(drive, torque_limit=row.values["torque"]))
