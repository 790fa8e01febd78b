"""Viscous friction: a torque proportional to the motor side's speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow, with_drives


class ViscousFriction(Effect):
    """c theta', linear, so that engines take it natively (Armstrong-Helouvry, Dupont and Canudas de Wit, 1994)."""

    name = "viscous_friction"
    key = "joint"
    columns = (Column("coefficient", "N*m*s/rad|N*s/m", minimum=0.0),)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the coefficient to the drive's damping."""
        return with_drives(
            robot, rows, lambda drive, row: replace(drive, damping=drive.damping + row.values["coefficient"])
        )
