"""Joint spring: hoses and gravity compensators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import ArmSpring, Drive, Robot
from .effect import Column, Effect, EffectRow, with_drives


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

        def changed(drive: Drive, row: EffectRow) -> Drive:
            spring = ArmSpring(row.values["stiffness"], row.values["rest"])
            return replace(drive, arm_springs=(*drive.arm_springs, spring))

        return with_drives(robot, rows, changed)
