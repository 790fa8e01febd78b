"""Backlash: clearance between motor side and arm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..representation import Drive, Robot, Spring
from .effect import Column, Effect, EffectRow, with_drives

# what a contact without numbers of its own is: chosen in build, from the inertias on both sides
STIFF = Spring(math.inf, math.inf)


class Backlash(Effect):
    """T = 0 while abs(theta - q) < gap/2, spring and damper beyond; the damper never pulls.

    A dead zone before a spring-damper, whose damping alone would at times give torque of the wrong sign (Nordin, Galic
    and Gutman, 1997).
    """

    name = "backlash"
    key = "joint"
    after = ("joint_compliance", "joint_compliance_6d")
    columns = (
        Column("gap", "rad|m", minimum=0.0),
        Column("stiffness", "N*m/rad|N/m", default=math.inf, minimum=0.0, exclusive=True, infinite=True),
        Column("damping", "N*m*s/rad|N*s/m", default=math.inf, minimum=0.0, infinite=True),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Gives the drive's spring a gap; a contact's own numbers replace the compliance's."""

        def changed(drive: Drive, row: EffectRow) -> Drive:
            spring, k, b = drive.spring or STIFF, row.values["stiffness"], row.values["damping"]
            contact = spring.stiffness if math.isinf(k) else k, spring.damping if math.isinf(b) else b
            return replace(drive, spring=Spring(*contact, spring.gap + row.values["gap"]))

        return with_drives(robot, rows, changed)
