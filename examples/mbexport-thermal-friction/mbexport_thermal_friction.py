"""Thermal friction: a gear that warms up while it runs rubs less, for its oil gets thin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mbexport import Column, Effect, Law


def resistance(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """c exp(-T / S) theta', T = rise (1 - exp(-t / time)) (after Bittencourt and Gunnarsson, 2012)."""
    warmer = p[2] * (1.0 - math.exp(-t / p[3]))
    return p[1] * math.exp(-warmer / p[4]) * dtheta


def level(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """Fc (1 + drift T), sticking; T as for the viscous part."""
    warmer = p[2] * (1.0 - math.exp(-t / p[3]))
    return p[0] * (1.0 + p[5] * warmer)


class ThermalFriction(Effect):
    """Coulomb and viscous friction of a joint that is T = rise (1 - exp(-t / time)) warmer than at the run's start."""

    name = "thermal_friction"
    key = "joint"
    columns = (
        Column("torque", "N*m|N", default=0.0, minimum=0.0),
        Column("coefficient", "N*m*s/rad|N*s/m", minimum=0.0),
        Column("rise", "K"),
        Column("time", "s", minimum=0.0, exclusive=True),
        Column("softening", "K", minimum=0.0, exclusive=True),
        Column("drift", "1/K", default=0.0),
    )
    laws = (Law("resistance", resistance), Law("level", level))

    def check(self, values: Mapping[str, float]) -> str | None:
        """Coulomb friction never pulls."""
        last = 1.0 + values["drift"] * values["rise"]
        if last < 0.0:
            return f"drift times rise is {last - 1.0!r}; below -1 the Coulomb level would become negative"
        return None
