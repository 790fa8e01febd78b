"""Torque offset: the torque sensor's zero is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot, Sensor
from .effect import Column, Effect, EffectRow, with_stage


class TorqueOffset(Effect):
    """Added to the reported tau and to nothing else: a zero error, as metrology calls it (JCGM 200:2012)."""

    name = "torque_offset"
    key = "joint"
    columns = (Column("torque", "N*m|N"),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds to the sensor's offset."""
        for row in rows:

            def change(sensor: Sensor, torque: float = row.values["torque"]) -> Sensor:
                return replace(sensor, torque_offset=sensor.torque_offset + torque)

            robot = with_stage(robot, row.at, lambda stage, change=change: replace(stage, sensor=change(stage.sensor)))
        return robot
