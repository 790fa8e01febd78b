"""The controller at its ticks, and the torque that is held between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..kinematics import dynamics
from ..representation import Robot
from . import pd_law
from .control import Control
from .pd_law import PdTable

if TYPE_CHECKING:
    from ..motion import MotionLaw

Vector = NDArray[np.float64]


class Controller:
    """Torques of a run: command -> log.yaml's limit -> delay -> the drive's limit -> held.

    Everything that depends on the command alone is there before the run starts; a tick is a few array operations.

    Attributes:
        kp, kd: Gains with the robot's factors, shape (n,); zeros in mode torque.
        tick_times: When it looks at the robot [s], shape (m,); the first is 0.
        switch_times: When the torque of each tick begins to act [s], shape (m,): a delay later.
    """

    def __init__(
        self,
        nominal: Robot,
        robot: Robot,
        control: Control,
        motion: MotionLaw,
        duration: float,
        torque: Vector | None = None,
    ) -> None:
        """Prepare a run.

        Args:
            nominal: Whose rigid bodies the feedforward knows.
            robot: Whose delay, limits and gain factors act.
            control: Mode pd or torque.
            motion: The command.
            duration: Of the run [s].
            torque: Mode torque: torque of each tick, shape (m or more, n).
        """
        n = robot.n
        count = math.floor(duration * control.rate + 1.0e-9 * control.rate) + 1
        self.tick_times: Vector = np.arange(count) / control.rate
        self.switch_times: Vector = self.tick_times + robot.delay
        q_cmd, dq_cmd, ddq_cmd = motion.at(control.commanded_at(self.tick_times))
        feedforward = feedforward_along(nominal, control, q_cmd, dq_cmd, ddq_cmd)
        pd = control.mode == "pd"
        self.kp: Vector = np.array(control.kp if pd else [0.0] * n) * np.array(robot.kp_factor or [1.0] * n)
        self.kd: Vector = np.array(control.kd if pd else [0.0] * n) * np.array(robot.kd_factor or [1.0] * n)
        if torque is not None:
            if torque.ndim != 2 or torque.shape[1] != n or len(torque) < count:
                raise UsageError(f"the commanded torque has shape {torque.shape}; ({count}, {n}) is needed.")
            feedforward = np.array(torque[:count], dtype=float)
        # both limits cut alike on either side, so the smaller one does; the delay between them changes no value
        limit = np.array(control.torque_limit or [math.inf] * n)
        highest: Vector = np.minimum(limit, [stage.drive.torque_limit for stage in robot.stages])
        differenced = math.ceil(control.differenced)
        self._table = PdTable(
            q_cmd=np.ascontiguousarray(q_cmd),
            dq_cmd=np.ascontiguousarray(dq_cmd),
            feedforward=np.ascontiguousarray(feedforward),
            kp=self.kp,
            kd=self.kd,
            lowest=-highest,
            highest=highest,
            limited=bool(np.isfinite(highest).any()),
            differenced=differenced,
            blend=control.differenced / max(differenced, 1),
            ahead=control.ahead / control.rate,
            rate=float(control.rate),
            seen=np.zeros((count if differenced else 0, n)),
            torques=np.zeros((count, n)),
            part=np.zeros(n),
        )

    def reset(self) -> None:
        """Forget the last run."""
        self._table.torques[:] = 0.0

    def table(self) -> PdTable | None:
        """All of it as arrays, for loops that are compiled; None where the law is another one."""
        return self._table

    def feedforward_at_start(self) -> Vector:
        """Torque added at t = 0, shape (n,)."""
        return self._table.feedforward[0]

    def tick(self, k: int, q: Vector, dq: Vector) -> None:
        """Tick k sees the motors' reported position and their speed, shapes (n,)."""
        pd_law.tick(self._table, k, q, dq)

    def held(self, k: int) -> Vector:
        """Torque of tick k, as it acts from switch_times[k] on, shape (n,)."""
        return self._table.torques[k]


def feedforward_along(nominal: Robot, control: Control, q: Vector, dq: Vector, ddq: Vector) -> Vector:
    """Torque of the nominal rigid bodies at the command, shape (m, n)."""
    if control.mode != "pd" or control.feedforward == "none":
        return np.zeros_like(q)
    arms = dynamics(nominal)
    return arms.gravity(q) if control.feedforward == "gravity" else arms.inverse_dynamics(q, dq, ddq)
