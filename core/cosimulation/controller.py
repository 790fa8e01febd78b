"""The controller of a co-simulation: continuous in time, with states, and a solver of its own.

z'   = q_cmd - q
u    = kp (q_cmd - q) + kd (q_cmd' - q') + ki z + feedforward, cut by the torque limits
tau' = (u - tau) / lag                 (lag of the drives' current loops; none: tau = u)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..control import Control
from ..control.control import Feedforward
from ..errors import UsageError
from ..kinematics import dynamics
from ..kinematics.dynamics import Dynamics
from ..representation import Robot
from .partner import Seen

if TYPE_CHECKING:
    from ..motion import MotionLaw

Vector = NDArray[np.float64]

# time constant of the current loops where nothing is said [s]
LAG = 1.0e-3
# the solver's step, where nothing is said: this part of the lag
FINE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class ContinuousController:
    """Law, command and solver of the controller.

    Attributes:
        kp, kd: Gains on position and speed, shape (n,).
        ki: Gain on the integral of the position's error, shape (n,).
        lag: Time constant of the torque [s]; 0: the torque follows at once.
        limit: Largest torque, shape (n,); inf where there is none.
        step: Of its solver, at most [s].
        motion: The command.
        arms: The rigid bodies that the feedforward knows.
        feedforward: Which of their torques it adds.
    """

    kp: Vector
    kd: Vector
    ki: Vector
    lag: float
    limit: Vector
    step: float
    motion: MotionLaw
    arms: Dynamics
    feedforward: Feedforward

    @staticmethod
    def of(
        robot: Robot,
        control: Control,
        motion: MotionLaw,
        *,
        lag: float = LAG,
        integral: float = math.inf,
        step: float | None = None,
    ) -> ContinuousController:
        """The continuous controller that a sampled one stands for.

        Args:
            robot: Whose limits and gain factors act, and whose rigid bodies the feedforward knows.
            control: Mode pd; its rate counts nothing.
            motion: The command.
            lag: Time constant of the current loops [s].
            integral: Reset time Ti [s]: ki = kp / Ti.
            step: Of its solver, at most [s]; None: a tenth of the lag.

        Raises:
            UsageError: Another mode, or numbers that make no controller.
        """
        if control.mode != "pd":
            raise UsageError(f"a co-simulation couples a controller of mode pd, not {control.mode}.")
        if not 0.0 <= lag < math.inf:
            raise UsageError(f"a lag of {lag!r} s: it must be 0 or more.")
        if not integral > 0.0:
            raise UsageError(f"a reset time of {integral!r} s: it must be above 0.")
        if step is not None and not 0.0 < step < math.inf:
            raise UsageError(f"a step of {step!r} s for the controller: it must be above 0.")
        if motion.n != robot.n:
            raise UsageError(f"the motion has {motion.n} joints, {robot.name} has {robot.n}.")
        kp = np.array(control.kp) * np.array(robot.kp_factor or [1.0] * robot.n)
        kd = np.array(control.kd) * np.array(robot.kd_factor or [1.0] * robot.n)
        limit = np.minimum(
            np.array(control.torque_limit or [math.inf] * robot.n),
            [stage.drive.torque_limit for stage in robot.stages],
        )
        finest = step or (FINE * lag if lag else math.inf)
        arms = dynamics(robot, always_compiled=True)
        return ContinuousController(kp, kd, kp / integral, lag, limit, finest, motion, arms, control.feedforward)

    @property
    def still(self) -> bool:
        """It has no states: nothing to solve."""
        return not self.lag and not self.ki.any()

    def commands(self, t: Vector) -> tuple[Vector, Vector, Vector]:
        """Position, speed and feedforward at times (m,) [s], each of shape (m, n)."""
        q, dq, ddq = self.motion.at(t)
        if self.feedforward == "none":
            return q, dq, np.zeros_like(q)
        still = np.zeros_like(q)
        way = (still, still) if self.feedforward == "gravity" else (dq, ddq)
        return q, dq, self.arms.inverse_dynamics(q, *way)

    def feedforward_at_start(self) -> Vector:
        """Torque added at t = 0, shape (n,)."""
        return self.commands(np.zeros(1))[2][0]

    def asked(self, command: tuple[Vector, Vector, Vector], z: Vector, q: Vector, dq: Vector) -> Vector:
        """u, shape (n,).

        Args:
            command: Position, speed and feedforward at this time, each of shape (n,).
            z: Integral of the position's error, shape (n,).
            q: Reported position, shape (n,).
            dq: Speed, shape (n,).
        """
        wanted, speed, feedforward = command
        asked = self.kp * (wanted - q) + self.kd * (speed - dq) + self.ki * z + feedforward
        return np.minimum(np.maximum(asked, -self.limit), self.limit)

    def slopes(
        self, command: tuple[Vector, Vector, Vector], z: Vector, tau: Vector, q: Vector, dq: Vector
    ) -> tuple[Vector, Vector]:
        """z' and tau', shapes (n,); tau' is 0 where there is no lag."""
        if not self.lag:
            return command[0] - q, np.zeros_like(tau)
        return command[0] - q, (self.asked(command, z, q, dq) - tau) / self.lag

    def running(self, interval: float, count: int, q: Vector, dq: Vector) -> RunningController:
        """At rest with the torque that the law asks for at t = 0; arguments as `Partner.running`."""
        return RunningController(self, interval, count, q, dq)

    def in_words(self) -> str:
        """What it is."""
        integral = " with an integral part" if self.ki.any() else ""
        lag = f" behind a lag of {1e3 * self.lag:.4g} ms" if self.lag else ""
        return f"PD{integral}{lag}, solved by Runge-Kutta of order 4"

    def facts(self) -> dict[str, Any]:
        """What it is, as plain data."""
        return {
            "kp": self.kp.tolist(),
            "kd": self.kd.tolist(),
            "ki": self.ki.tolist(),
            "feedforward": self.feedforward,
            "lag": self.lag,
            "step": self.step if math.isfinite(self.step) else None,
        }


class RunningController:
    """The controller's own states, and its own solver: Runge-Kutta of order 4 with fixed steps.

    Attributes:
        z: Integral of the position's error, shape (n,).
        tau: Torque behind the lag, shape (n,).
    """

    def __init__(self, controller: ContinuousController, interval: float, count: int, q: Vector, dq: Vector) -> None:
        """At rest with the torque that the law asks for at t = 0, nothing integrated.

        Args:
            controller: Its law.
            interval: Communication step [s].
            count: How many there will be.
            q: Reported position at t = 0, shape (n,).
            dq: Speed, shape (n,).
        """
        self._controller = controller
        self._steps = 1 if controller.still else max(1, math.ceil(interval / controller.step - 1.0e-6))
        self._half = 0.5 * interval / self._steps
        # all of the commands that will be asked for, two rows a step of the solver
        self._times: Vector = np.arange(2 * self._steps * count + 1, dtype=float) * self._half
        self._commands = controller.commands(self._times)
        self._place = 0
        self.z: Vector = np.zeros(len(controller.kp))
        self.tau: Vector = controller.asked(self._command(0), self.z, q, dq)

    def torque(self, q: Vector, dq: Vector) -> Vector:
        """What it gives at the communication point, having read q and dq there, shape (n,)."""
        if self._controller.lag:
            return self.tau.copy()
        return self._controller.asked(self._command(0), self.z, q, dq)

    def advance(self, seen: Seen) -> None:
        """Solve over the communication step, with what it takes q and dq to be meanwhile."""
        if self._controller.still:
            self._place += 2
            return
        half = self._half
        for _ in range(self._steps):
            z, tau = self.z, self.tau
            total_z, total_tau = np.zeros_like(z), np.zeros_like(tau)
            slope_z, slope_tau = total_z, total_tau
            for weight, row, share in ((1.0, 0, 0.0), (2.0, 1, half), (2.0, 1, half), (1.0, 2, 2.0 * half)):
                q, dq = seen(float(self._times[self._place + row]))
                slope_z, slope_tau = self._controller.slopes(
                    self._command(row), z + share * slope_z, tau + share * slope_tau, q, dq
                )
                total_z, total_tau = total_z + weight * slope_z, total_tau + weight * slope_tau
            self.z = z + half / 3.0 * total_z
            self.tau = tau + half / 3.0 * total_tau
            self._place += 2

    def close(self) -> None:
        """It holds nothing that has to be given back."""

    def _command(self, ahead: int) -> tuple[Vector, Vector, Vector]:
        q, dq, feedforward = self._commands
        place = self._place + ahead
        return q[place], dq[place], feedforward[place]
