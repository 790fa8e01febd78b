"""Friction of wrists whose motors turn together: the motor of an axis is turned by the axis before it, too."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mbexport import Column, Effect, EffectRow, Law, Robot, UsageError


def viscous(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """c w, w = theta_i' + ratio theta_(i-1)' being what the motor turns with (Khalil and Dombre, 2002, section 9.2)."""
    return p[1] * dtheta


def coulomb(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """Fc tanh(w / velocity), w as for the viscous part; smooth, for what two joints share has no place to stick."""
    return p[1] * math.tanh(dtheta / p[2])


class _Coupled(Effect):
    """What the friction of such a motor's two parts have in common."""

    key = "joint"

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Its law at each row's joint; there must be one before it."""
        if any(row.at == 1 for row in rows):
            raise UsageError(f"{self.name}: joint_1 has no joint before it that could turn its motor.")
        return super().apply(robot, rows)


class CoupledViscousFriction(_Coupled):
    """Viscous friction of a motor that joints i and i - 1 turn, felt by both."""

    name = "coupled_viscous_friction"
    columns = (Column("ratio", default=1.0), Column("coefficient", "N*m*s/rad", minimum=0.0))
    laws = (Law("coupled", viscous),)


class CoupledCoulombFriction(_Coupled):
    """Coulomb friction of a motor that joints i and i - 1 turn, felt by both."""

    name = "coupled_coulomb_friction"
    columns = (
        Column("ratio", default=1.0),
        Column("torque", "N*m", minimum=0.0),
        Column("velocity", "rad/s", default=0.05, minimum=0.0, exclusive=True),
    )
    laws = (Law("coupled", coulomb),)
