"""Transmission error: the gear's ratio wobbles with its angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..representation import Robot
from .backlash import STIFF
from .effect import Column, Effect, EffectRow, Law, with_drives


def error(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """e = amplitude sin(cycles theta + phase); q follows theta + e."""
    return p[0] * math.sin(p[1] * theta + p[2])


def error_slope(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """de/dtheta."""
    return p[0] * p[1] * math.cos(p[1] * theta + p[2])


class TransmissionError(Effect):
    """T = K (theta + e - q) + b (theta' (1 + de/dtheta) - q'); on the motor side (1 + de/dtheta) T: no power is lost.

    The kinematic error of harmonic drives, which comes back with the motor's turns (Tuttle and Seering, 1996).
    """

    name = "transmission_error"
    key = "joint"
    after = ("joint_compliance", "joint_compliance_6d", "backlash")
    columns = (
        Column("amplitude", "rad|m", minimum=0.0),
        Column("cycles", minimum=0.0, exclusive=True),
        Column("phase", "rad", default=0.0),
    )
    laws = (Law("error", error), Law("error_slope", error_slope))

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the laws; a rigid joint gets backlash's stiff contact, for engines know no wobbling constraint."""
        robot = super().apply(robot, rows)
        return with_drives(robot, rows, lambda drive, row: replace(drive, spring=drive.spring or STIFF))
