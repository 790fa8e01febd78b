"""Controller gain: the controller's gains are not what its log says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Robot
from .effect import Column, Effect, EffectRow


class ControllerGain(Effect):
    """Factors on the gains of the controller: kp KP (q_cmd - q) + kd KD (dq_cmd - dq).

    The joint PD of Takegaki and Arimoto (1981).
    """

    name = "controller_gain"
    key = "joint"
    columns = (
        Column("kp", default=1.0, minimum=0.0),
        Column("kd", default=1.0, minimum=0.0),
    )

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Multiplies the robot's factors."""
        kp = list(robot.kp_factor or (1.0,) * robot.n)
        kd = list(robot.kd_factor or (1.0,) * robot.n)
        for row in rows:
            kp[row.at - 1] *= row.values["kp"]
            kd[row.at - 1] *= row.values["kd"]
        return replace(robot, kp_factor=tuple(kp), kd_factor=tuple(kd))
