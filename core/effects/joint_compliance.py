"""Joint compliance: a torsional spring-damper between motor side and arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Drive, Robot, Spring
from .effect import Column, Effect, EffectRow, with_drives


class JointCompliance(Effect):
    """T = K (theta - q) + b (theta' - q'), equation 5 of IMECE2013-64815 with the torque's reaction on the motor."""

    name = "joint_compliance"
    key = "joint"
    columns = (
        Column("stiffness", "N*m/rad|N/m", minimum=0.0, exclusive=True),
        Column("damping", "N*m*s/rad|N*s/m", default=0.0, minimum=0.0),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Puts the spring into the drive, keeping a clearance that another effect gave it."""

        def changed(drive: Drive, row: EffectRow) -> Drive:
            gap = drive.spring.gap if drive.spring else 0.0
            return replace(drive, spring=Spring(row.values["stiffness"], row.values["damping"], gap))

        return with_drives(robot, rows, changed)
