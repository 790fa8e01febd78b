"""Torque ripple: what cogging and a gear's teeth add to friction, periodic in the angle."""

from __future__ import annotations

import math
from typing import Any

from .effect import Column, Effect, Law


def resistance(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """amplitude sin(cycles theta + phase), against the motor."""
    return p[0] * math.sin(p[1] * theta + p[2])


class TorqueRipple(Effect):
    """Adds amplitude sin(cycles theta + phase) to the friction.

    One harmonic of a motor's cogging and ripple (Holtz and Springob, 1996), or of the teeth of its gear.
    """

    name = "torque_ripple"
    key = "joint"
    columns = (
        Column("amplitude", "N*m|N", minimum=0.0),
        Column("cycles", minimum=0.0, exclusive=True),
        Column("phase", "rad", default=0.0),
    )
    laws = (Law("resistance", resistance),)
