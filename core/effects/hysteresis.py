"""Hysteresis: pre-sliding friction with memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..representation import Drive, Robot, Slip
from .effect import Column, Effect, EffectRow, with_drives

MOST_SLIPS = 1000


class Hysteresis(Effect):
    """m Maxwell-slip elements in parallel on theta, stiffness K/m each; element i slips at F i / (m (m + 1) / 2).

    Iwan (1966); the levels add up to F, and the loop in torque against angle does not depend on the speed.
    """

    name = "hysteresis"
    key = "joint"
    columns = (
        Column("torque", "N*m|N", minimum=0.0),
        Column("stiffness", "N*m/rad|N/m", minimum=0.0, exclusive=True),
        Column("slips", default=8.0, minimum=1.0, maximum=MOST_SLIPS),
    )

    def check(self, values: Mapping[str, float]) -> str | None:
        """The number of elements is whole."""
        slips = values["slips"]
        return None if slips == int(slips) else f"slips is {slips!r}; a whole number of elements would be right"

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the elements to the drive."""

        def changed(drive: Drive, row: EffectRow) -> Drive:
            m = int(row.values["slips"])
            torque, stiffness = row.values["torque"], row.values["stiffness"]
            slips = tuple(Slip(stiffness / m, torque * i / (m * (m + 1) / 2)) for i in range(1, m + 1))
            return replace(drive, slips=drive.slips + slips)

        return with_drives(robot, rows, changed)
