"""The loop in one piece: robot and controller as one system of differential equations, solved to the last digits.

    (M(q) + J) q'' = gain tau + torques of the drives - h(q, q')           rigid joints
    M(q) q'' = T(theta - q, ...) - h(q, q'),   J theta'' = gain tau - T    elastic joints

with the controller's states beside them; Dormand and Prince's method of order 8 (SciPy) with steps of its own choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from ..kinematics import kinematics, rigid_body
from ..kinematics.compiled import compiled
from ..kinematics.dynamics import chain_table
from ..motion import evaluate
from ..simulation.compiled import compile_text
from ..simulation.drive_sheet import DriveSheet
from ..simulation.drives import Drives
from .controller import ContinuousController
from .loop import Loop

Vector = NDArray[np.float64]

TOLERANCE = 1.0e-10
"""Relative and absolute tolerance of the solver."""


@dataclass(frozen=True, slots=True, eq=False)
class OnePiece:
    """The motion of a loop that was solved in one piece.

    Attributes:
        t: Times [s], shape (m,).
        q: Arm side of the driven joints, shape (m, n).
        tip: Tool centre point in the base, shape (m, 3) [m].
        evaluations: How often the equations were evaluated.
    """

    t: Vector
    q: Vector
    tip: Vector
    evaluations: int


def run_monolithic(loop: Loop, t: Vector, tolerance: float = TOLERANCE) -> OnePiece:
    """Solve a loop in one piece.

    Args:
        loop: What is solved.
        t: Times to know it at [s], growing, from 0, shape (m,).
        tolerance: Of the solver.

    Raises:
        RefusedError: The loop is no system of differential equations; or the solver fails.
    """
    because, controller = why_not(loop), loop.controller
    if because or not isinstance(controller, ContinuousController):
        raise RefusedError(f"{loop.robot.name}: the loop cannot be solved in one piece: {because}.")
    system = _System(loop, controller)
    found = _scipy_integrate().solve_ivp(
        system.slopes, (0.0, float(t[-1])), system.start(), method="DOP853", t_eval=t, rtol=tolerance, atol=tolerance
    )
    if not found.success or not np.isfinite(found.y).all():
        raise RefusedError(f"{loop.robot.name}: the loop cannot be solved in one piece: {found.message}")
    q: Vector = np.ascontiguousarray(found.y[: system.n].T)
    tip = kinematics(loop.whole.robot).tool_in_base(q)[:, :3, 3]
    return OnePiece(t, q[:, list(loop.whole.driven)], tip, int(found.nfev))


def why_not(loop: Loop) -> str | None:
    """Why a loop is no system of differential equations; None where it is one."""
    if not isinstance(loop.controller, ContinuousController):
        return "the controller's unit does not show its equations"
    for stage in loop.whole.robot.stages:
        drive = stage.drive
        if drive.stick or drive.slips:
            effects = sorted({term.effect for term in drive.terms if term.kind == "level"})
            names = ", ".join([*effects, *(["hysteresis"] if drive.slips else [])])
            return f"{stage.joint.name} has friction with a memory ({names})"
    if Drives(DriveSheet.of(loop.whole.robot)).needs_load:
        return "load_friction at rigid joints is solved together with the accelerations"
    return None


def _scipy_integrate() -> Any:
    return import_module("scipy.integrate")


class _System:
    """The right-hand side over (q, theta of elastic joints, their speeds, z, tau)."""

    def __init__(self, loop: Loop, controller: ContinuousController) -> None:
        self._loop, self._controller = loop, controller
        robot = loop.whole.robot
        self.n = robot.n
        self._driven = list(loop.whole.driven)
        self._drives = Drives(DriveSheet.of(robot))
        table = self._drives.table
        self._elastic = table.elastic.astype(bool)
        sizes = (self.n, int(self._elastic.sum())) * 2 + (len(self._driven),) * 2
        ends = np.cumsum(sizes)
        self._parts = [slice(int(end) - size, int(end)) for size, end in zip(sizes, ends, strict=True)]
        self._motor: Vector = table.inertia[self._elastic]
        self._rotor = np.diag(np.where(self._elastic, 0.0, table.inertia))
        self._chain = chain_table(robot)
        functions = compiled(rigid_body.__name__)
        self._mass_matrices, self._inverse = functions["mass_matrices"], functions["inverse_dynamics_along"]
        self._motion_at = compile_text(evaluate.motion_at)
        self._motion = controller.motion.table()
        self._none = np.zeros((1, robot.n))

    def start(self) -> Vector:
        """State at t = 0."""
        loop, begin = self._loop, self._loop.start
        controller = self._controller
        zero = np.zeros(len(self._driven))
        q, dq = loop.seen(begin)
        tau = controller.asked(self._command(0.0), zero, q, dq)
        e = self._elastic
        return np.concatenate([begin.q, begin.theta[e], begin.dq, begin.dtheta[e], zero, tau])

    def slopes(self, t: float, x: Vector) -> Vector:
        """Derivative of the state."""
        q, motor, dq, speed, z, tau = (x[part] for part in self._parts)
        theta, dtheta = q.copy(), dq.copy()
        theta[self._elastic], dtheta[self._elastic] = motor, speed
        controller, loop = self._controller, self._loop
        seen, seen_speed = theta[self._driven] + loop.offsets, dtheta[self._driven]
        command = self._command(t)
        given = tau if controller.lag else controller.asked(command, z, seen, seen_speed)
        drives = self._drives
        drives.evaluate(t, q, dq, theta, dtheta)
        pushed = drives.table.gain * loop.whole.spread(given) - drives.friction
        passed = np.where(self._elastic, drives.transmitted, pushed) + drives.on_arm
        matrix, bias = np.empty((1, self.n, self.n)), np.empty((1, self.n))
        self._mass_matrices(self._chain, q[None], matrix)
        self._inverse(self._chain, q[None], dq[None], self._none, bias)
        torque: Vector = passed - bias[0]
        ddq: Vector = np.asarray(np.linalg.solve(matrix[0] + self._rotor, torque), dtype=float)
        ddtheta = (pushed - drives.reaction)[self._elastic] / self._motor
        return np.concatenate([dq, speed, ddq, ddtheta, *controller.slopes(command, z, tau, seen, seen_speed)])

    def _command(self, t: float) -> tuple[Vector, Vector, Vector]:
        """As `ContinuousController.commands` at one time, compiled: this is asked for thousands of times."""
        controller = self._controller
        q, dq, ddq, out = np.zeros((4, 1, len(self._driven)))
        self._motion_at(t, self._motion, q[0], dq[0], ddq[0])
        if controller.feedforward == "gravity":
            self._inverse(controller.arms.table, q, np.zeros_like(q), np.zeros_like(q), out)
        elif controller.feedforward == "inverse_dynamics":
            self._inverse(controller.arms.table, q, dq, ddq, out)
        return q[0], dq[0], out[0]
