"""Link flexibility: an arm bends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Bend, Robot
from .effect import Column, Effect, EffectRow, with_stage


class LinkFlexibility(Effect):
    """Two bending springs, about u then v, at a fraction of the line between the arms' frames (lumped: Huston 1981).

    e points from frame i-1 to frame i, u = z_i x e (x_i x e where they are parallel), v = e x u; the arm's mass, first
    moments and inertia are split at : 1 - at.
    """

    name = "link_flexibility"
    key = "arm"
    columns = (
        Column("ku", "N*m/rad", minimum=0.0, exclusive=True),
        Column("kv", "N*m/rad", minimum=0.0, exclusive=True),
        Column("bu", "N*m*s/rad", default=0.0, minimum=0.0),
        Column("bv", "N*m*s/rad", default=0.0, minimum=0.0),
        Column("at", default=0.5, minimum=0.0, maximum=1.0, exclusive=True),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Gives the stages their bends."""
        for row in rows:
            v = row.values
            bend = Bend((v["ku"], v["kv"]), (v["bu"], v["bv"]), v["at"])
            robot = with_stage(robot, row.at, lambda stage, bend=bend: replace(stage, bend=bend))
        return robot
