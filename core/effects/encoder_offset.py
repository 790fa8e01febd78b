"""Encoder offset: the joint's zero is not where the controller takes it to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot, Sensor
from .effect import Column, Effect, EffectRow, with_stage


class EncoderOffset(Effect):
    """Reported q = true + offset; the controller, and in mode motion the drive, follows the reported one.

    The joint offsets of calibration (Mooring, Roth and Driels, 1991).
    """

    name = "encoder_offset"
    key = "joint"
    columns = (Column("offset", "rad|m"),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds to the sensor's offset."""
        for row in rows:

            def change(sensor: Sensor, offset: float = row.values["offset"]) -> Sensor:
                return replace(sensor, position_offset=sensor.position_offset + offset)

            robot = with_stage(robot, row.at, lambda stage, change=change: replace(stage, sensor=change(stage.sensor)))
        return robot
