"""The controller at its ticks, and the torque that is held between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..kinematics import dynamics
from ..representation import Robot
from .control import Control

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
        self._q_cmd, self._dq_cmd, ddq_cmd = motion.at(control.commanded_at(self.tick_times))
        self._feedforward = feedforward_along(nominal, control, self._q_cmd, self._dq_cmd, ddq_cmd)
        pd = control.mode == "pd"
        self.kp: Vector = np.array(control.kp if pd else [0.0] * n) * np.array(robot.kp_factor or [1.0] * n)
        self.kd: Vector = np.array(control.kd if pd else [0.0] * n) * np.array(robot.kd_factor or [1.0] * n)
        if torque is not None:
            if torque.ndim != 2 or torque.shape[1] != n or len(torque) < count:
                raise UsageError(f"the commanded torque has shape {torque.shape}; ({count}, {n}) is needed.")
            self._feedforward = np.array(torque[:count], dtype=float)
        # both limits cut alike on either side, so the smaller one does; the delay between them changes no value
        limit = np.array(control.torque_limit or [math.inf] * n)
        self._highest: Vector = np.minimum(limit, [stage.drive.torque_limit for stage in robot.stages])
        self._lowest: Vector = -self._highest
        self._limited = bool(np.isfinite(self._highest).any())
        self._torques: Vector = np.zeros((count, n))
        self._part: Vector = np.zeros(n)
        self._differenced, self._rate = control.differenced, control.rate
        # positions of the ticks before, where speeds are differences of them
        self._seen: Vector = np.zeros((count if control.differenced else 0, n))

    def reset(self) -> None:
        """Forget the last run."""
        self._torques[:] = 0.0

    def feedforward_at_start(self) -> Vector:
        """Torque added at t = 0, shape (n,)."""
        return self._feedforward[0]

    def tick(self, k: int, q: Vector, dq: Vector) -> None:
        """Tick k sees the motors' reported position and their speed, shapes (n,)."""
        tau = self._torques[k]
        if self._differenced:
            self._seen[k] = q
            ticks = min(k, self._differenced)
            dq = self._rate / ticks * (q - self._seen[k - ticks]) if ticks else dq
        self.torque(k, q, dq, tau)
        if self._limited:
            np.minimum(tau, self._highest, out=tau)
            np.maximum(tau, self._lowest, out=tau)

    def torque(self, k: int, q: Vector, dq: Vector, out: Vector) -> None:
        """The law: torque of tick k before any limit, into `out`, all shapes (n,)."""
        part = self._part
        np.subtract(self._q_cmd[k], q, out=part)
        np.multiply(self.kp, part, out=out)
        np.subtract(self._dq_cmd[k], dq, out=part)
        np.multiply(self.kd, part, out=part)
        np.add(out, part, out=out)
        np.add(out, self._feedforward[k], out=out)

    def held(self, k: int) -> Vector:
        """Torque of tick k, as it acts from switch_times[k] on, shape (n,)."""
        return self._torques[k]


def feedforward_along(nominal: Robot, control: Control, q: Vector, dq: Vector, ddq: Vector) -> Vector:
    """Torque of the nominal rigid bodies at the command, shape (m, n)."""
    if control.mode != "pd" or control.feedforward == "none":
        return np.zeros_like(q)
    arms = dynamics(nominal)
    return arms.gravity(q) if control.feedforward == "gravity" else arms.inverse_dynamics(q, dq, ddq)
