"""Link inertia: an error of an arm's ten inertial parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..representation import Inertia, Robot
from .effect import Column, Effect, EffectRow, with_stage


class LinkInertia(Effect):
    """Added to mass, first moments and tensor about the frame's origin, in which the dynamics are linear.

    Atkeson, An and Hollerbach (1986).
    """

    name = "link_inertia"
    key = "arm"
    columns = (
        Column("mass", "kg", default=0.0),
        *(Column(name, "kg*m", default=0.0) for name in ("mx", "my", "mz")),
        *(Column(name, "kg*m^2", default=0.0) for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Adds the rows to the arms' parameters."""
        for row in rows:
            v = row.values
            first = np.array([v["mx"], v["my"], v["mz"]])
            tensor = np.array(
                [
                    [v["Ixx"], v["Ixy"], v["Ixz"]],
                    [v["Ixy"], v["Iyy"], v["Iyz"]],
                    [v["Ixz"], v["Iyz"], v["Izz"]],
                ]
            )
            body = robot.stages[row.at - 1].arm.inertia
            total = Inertia.from_origin(
                body.mass + v["mass"], body.first_moments() + first, body.tensor_about_origin() + tensor
            )
            robot = with_stage(
                robot,
                row.at,
                lambda stage, total=total: replace(stage, arm=replace(stage.arm, inertia=total)),
            )
        return robot
