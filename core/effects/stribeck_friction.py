"""Stribeck friction: what break-away has above Coulomb, fading with speed."""

from __future__ import annotations

import math
from typing import Any

from .effect import Column, Effect, Law


def level(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """Fs exp(-(theta'/vs)^2), added to the level of Coulomb friction (Bo and Pavelescu, 1982, with exponent 2)."""
    ratio = dtheta / p[1]
    return p[0] * math.exp(-ratio * ratio)


class StribeckFriction(Effect):
    """Fs exp(-(theta'/vs)^2) sign(theta') (Stribeck, 1902; the formula: Bo and Pavelescu, 1982)."""

    name = "stribeck_friction"
    key = "joint"
    columns = (
        Column("torque", "N*m|N", minimum=0.0),
        Column("velocity", "rad/s|m/s", minimum=0.0, exclusive=True),
    )
    laws = (Law("level", level),)
