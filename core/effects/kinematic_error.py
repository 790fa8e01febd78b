"""Kinematic error: what the real arm's geometry is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot, VeitscheggerWu
from .effect import Column, Effect, EffectRow, with_stage


class KinematicError(Effect):
    """Added to the arm's five Veitschegger-Wu parameters (Veitschegger and Wu, 1986)."""

    name = "kinematic_error"
    key = "arm"
    columns = (
        Column("alpha", "rad", default=0.0),
        Column("a", "m", default=0.0),
        Column("theta", "rad", default=0.0),
        Column("d", "m", default=0.0),
        Column("beta", "rad", default=0.0),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the rows to the arms' parameters."""
        for row in rows:
            error = VeitscheggerWu(**row.values)
            robot = with_stage(
                robot,
                row.at,
                lambda stage, error=error: replace(stage, arm=replace(stage.arm, link=stage.arm.link + error)),
            )
        return robot
