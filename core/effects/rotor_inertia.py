"""Rotor inertia: what the motor's rotor and the gear weigh at the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow, with_drives


class RotorInertia(Effect):
    """J theta'' = tau - friction - T: kinetic energy J theta'^2 / 2 (an armature; no gyroscopic part, Spong 1987)."""

    name = "rotor_inertia"
    key = "joint"
    columns = (Column("inertia", "kg*m^2|kg", minimum=0.0),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Sets the drive's inertia; the dummy part of an elastic joint is thereby replaced."""
        return with_drives(robot, rows, lambda drive, row: replace(drive, inertia=row.values["inertia"], dummy=False))
