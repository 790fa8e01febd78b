"""Coulomb friction: a constant torque against the motion."""

from __future__ import annotations

from typing import Any

from .effect import Column, Effect, Law


def level(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """Fc, sticking: at rest friction takes any value in [-Fc, Fc] (Coulomb, 1785)."""
    return p[0]


class CoulombFriction(Effect):
    """Fc sign(theta') on the motor side; how it sticks is the robot's FrictionModel.

    Coulomb (1785).
    """

    name = "coulomb_friction"
    key = "joint"
    columns = (Column("torque", "N*m|N", minimum=0.0),)
    laws = (Law("level", level),)
