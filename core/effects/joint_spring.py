"""Joint spring: hoses and gravity compensators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import ArmSpring, Robot
from .effect import Column, Effect, EffectRow, with_drive


class JointSpring(Effect):
    """-stiffness (q - rest) on the arm side, by Hooke's law (1678)."""

    name = "joint_spring"
    key = "joint"
    columns = (
        Column("stiffness", "N*m/rad|N/m", minimum=0.0),
        Column("rest", "rad|m", default=0.0),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the spring to the joint's arm side."""
        for row in rows:
            spring = ArmSpring(row.values["stiffness"], row.values["rest"])
            robot = with_drive(
                robot,
                row.at,
                lambda drive, spring=spring: replace(drive, arm_springs=(*drive.arm_springs, spring)),
            )
        return robot
