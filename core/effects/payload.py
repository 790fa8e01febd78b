"""Payload: a body fixed to the last arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Inertia, Robot, Stage
from .effect import Column, Effect, EffectRow, with_stage

COLUMNS = (
    Column("mass", "kg", minimum=0.0),
    *(Column(name, "m", default=0.0) for name in ("x", "y", "z")),
    *(Column(name, "kg*m^2", default=0.0) for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")),
)


class Payload(Effect):
    """A body in the last arm's frame; it adds to that arm's mass properties, which is the same motion exactly.

    Where that arm bends, it stands whole behind the bend, where the frame is. Atkeson, An and Hollerbach (1985).
    """

    name = "payload"
    key = "robot"
    after = ("link_flexibility",)
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

            def change(stage: Stage, body: Inertia = body) -> Stage:
                bend = stage.bend and replace(stage.bend, carried=stage.bend.carried + body)
                return replace(stage, arm=replace(stage.arm, inertia=stage.arm.inertia + body), bend=bend)

            robot = with_stage(robot, robot.n, change)
        return robot
