"""Six-component joint compliance: the bearing gives in every direction, as the paper's outlook asks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..representation import Mount, Robot, Spring, Stage
from .effect import Column, Effect, EffectRow, with_stage

AXES = ("x", "y", "z", "rx", "ry", "rz")


class JointCompliance6d(Effect):
    """A six-component spring-damper at the joint's real place, on the arm's side of the drive.

    It stands in the frame that turns with the joint (z = axis); deflections follow one another in the order x y z rx
    ry, and rz is in series with the drive, as joint_compliance. inf or missing: rigid there.
    """

    name = "joint_compliance_6d"
    key = "joint"
    columns = (
        *(
            Column(f"k{axis}", "N*m/rad" if "r" in axis else "N/m", math.inf, 0.0, exclusive=True, infinite=True)
            for axis in AXES
        ),
        *(Column(f"b{axis}", "N*m*s/rad" if "r" in axis else "N*s/m", 0.0, 0.0) for axis in AXES),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Gives the stages their mounts, and the drives the spring about their axis."""
        for row in rows:
            k = [row.values[f"k{axis}"] for axis in AXES]
            b = [row.values[f"b{axis}"] for axis in AXES]
            mount = Mount((k[0], k[1], k[2], k[3], k[4]), (b[0], b[1], b[2], b[3], b[4]))
            about_axis = None if math.isinf(k[5]) else Spring(k[5], b[5])

            def change(stage: Stage, mount: Mount = mount, spring: Spring | None = about_axis) -> Stage:
                drive = stage.drive if spring is None else replace(stage.drive, spring=spring)
                return replace(stage, drive=drive, mount=mount)

            robot = with_stage(robot, row.at, change)
        return robot
