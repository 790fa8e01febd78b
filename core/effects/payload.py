"""Payload: a body fixed to the last arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Inertia, Robot
from .effect import Column, Effect, EffectRow, with_stage

COLUMNS = (
    Column("mass", "kg", minimum=0.0),
    *(Column(name, "m", default=0.0) for name in ("x", "y", "z")),
    *(Column(name, "kg*m^2", default=0.0) for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")),
)


class Payload(Effect):
    """A body in the last arm's frame; it adds to that arm's mass properties, which is the same motion exactly."""

    name = "payload"
    key = "robot"
    columns = COLUMNS

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the bodies to the last arm."""
        for row in rows:
            v = row.values
            body = Inertia(
                v["mass"],
                (v["x"], v["y"], v["z"]),
                *(v[name] for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")),
            )
            robot = with_stage(
                robot,
                robot.n,
                lambda stage, body=body: replace(stage, arm=replace(stage.arm, inertia=stage.arm.inertia + body)),
            )
        return robot
