"""The loop in two pieces: an engine integrates the robot, the controller solves itself, and they communicate.

At a communication point the controller goes first: it reads position and speed of this instant, and gives its torque of
this instant. Until the next point each solves its own equations, with the other's signal held or extrapolated. With
"memory" the controller reads what was one communication step before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control import Control
from ..errors import UsageError
from ..simulation.backend import Backend, Engine, Program
from ..simulation.program import whole_program
from ..simulation.step import choose_step, poses_of
from .extrapolation import HIGHEST, Extrapolation
from .loop import Loop
from .partner import Running

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Coupling:
    """How the two communicate.

    Attributes:
        interval: Communication step [s].
        order: Of the extrapolation between communication points: 0 (held), 1 or 2.
        memory: The controller reads what was one communication step before.
    """

    interval: float
    order: int = 0
    memory: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no coupling.

        Raises:
            UsageError: The interval or the order is none.
        """
        if not 0.0 < self.interval < math.inf:
            raise UsageError(f"a communication step of {self.interval!r} s: it must be above 0.")
        if self.order not in range(HIGHEST + 1):
            raise UsageError(f"extrapolation of order {self.order!r}: it must be 0 (held), 1 or 2.")


@dataclass(frozen=True, slots=True, eq=False)
class CoupledRun:
    """A run in two pieces.

    Attributes:
        coupling: How they communicated.
        t: Communication points [s], shape (m,).
        q: Arm side of the driven joints, shape (m, n).
        torque: What the controller gave at each point, shape (m, n) [N m or N].
        tip: Tool centre point in the base, shape (m, 3) [m].
        step: Integration step of the robot, at most [s].
    """

    coupling: Coupling
    t: Vector
    q: Vector
    torque: Vector
    tip: Vector
    step: float


def engine_of(loop: Loop, backend: Backend, step: float | None = None) -> tuple[Engine, float]:
    """The robot in an engine, and the integration step [s] that it takes.

    Raises:
        RefusedError: The backend refuses this robot, or the step is unstable.
    """
    motion = loop.controller.motion
    plan = Program(motion, Control("torque"), loop.duration, backend.largest_step)
    backend.insist_on(loop.whole.robot, whole_program(loop.whole, plan))
    poses = loop.whole.spread(poses_of(loop.robot, motion))
    h = choose_step(loop.whole.robot, backend, imposed=False, poses=poses, step=step)
    program = Program(motion, Control("torque"), loop.duration, h)
    return backend.engine_for(loop.whole.robot, whole_program(loop.whole, program)), h


def run_coupled(loop: Loop, coupling: Coupling, backend: Backend, step: float | None = None) -> CoupledRun:
    """Run a loop in two pieces.

    Args:
        loop: What is coupled.
        coupling: How.
        backend: Whose engine integrates the robot.
        step: Its integration step, at most [s]; None: chosen from the largest eigenvalue.

    Raises:
        RefusedError: The backend refuses this robot, the step is unstable, or the motion is no longer finite.
    """
    engine, h = engine_of(loop, backend, step)
    try:
        return run_in(engine, loop, coupling, h)
    finally:
        engine.close()


def run_in(engine: Engine, loop: Loop, coupling: Coupling, h: float) -> CoupledRun:
    """`run_coupled` in an engine that is there already, with integration steps of h [s] at most.

    Raises:
        RefusedError: The motion is no longer finite.
    """
    interval = coupling.interval
    count = math.floor(loop.duration / interval + 1.0e-9)
    engine.reset(loop.start, None)
    running = loop.controller.running(interval, count, *loop.seen(loop.start))
    try:
        q, torque = _run_beside(engine, running, loop, coupling, count, h)
    finally:
        running.close()
    tip = engine.tools_in_base(q)[:, :3, 3]
    times: Vector = np.arange(count + 1, dtype=float) * interval
    return CoupledRun(coupling, times, q[:, list(loop.whole.driven)], torque, tip, h)


def _run_beside(
    engine: Engine, running: Running, loop: Loop, coupling: Coupling, count: int, h: float
) -> tuple[Vector, Vector]:
    """Arm side of all joints and torques of the driven ones at the communication points, shapes (count + 1, ...)."""
    interval, order, whole = coupling.interval, coupling.order, loop.whole
    steps = max(1, math.ceil(interval / h - 1.0e-6))
    pairs = max(1, math.ceil(0.5 * interval / h - 1.0e-6))
    state = loop.start
    before = now = loop.seen(state)
    heard = Extrapolation(order, interval, np.array(now))
    given = Extrapolation(order, interval, running.torque(*now))
    q: Vector = np.zeros((count + 1, whole.robot.n))
    torque: Vector = np.zeros((count + 1, len(whole.driven)))
    q[0] = state.q
    for k in range(count + 1):
        t = k * interval
        read = before if coupling.memory else now
        heard.hear(t, np.array(read))
        torque[k] = running.torque(*read)
        given.hear(t, torque[k])
        if k == count:
            break
        if order:
            for j in range(pairs):
                for held in given.held_twice(t + j * interval / pairs, interval / pairs):
                    engine.hold(whole.spread(held))
                    engine.advance(0.5 * interval / pairs, 1)
        else:
            engine.hold(whole.spread(torque[k]))
            engine.advance(interval, steps)
        running.advance(heard.at)
        state = engine.state()
        q[k + 1] = state.q
        before, now = now, loop.seen(state)
    return q, torque
