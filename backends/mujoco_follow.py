"""A part of a controlled run in MuJoCo as one piece of compiled code: the controller's law between its own steps."""

from __future__ import annotations

import ctypes
import math
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.control.pd_law import cut, feedback, speed, tick
from ..core.simulation.compiled import as_it_stands, compile_text
from .mujoco_call import called

if TYPE_CHECKING:
    from ..core.control import PdTable
    from ..core.simulation.backend import Vector
    from ..core.simulation.timeline import Rows, Timeline

# a length of step that nothing else in MuJoCo's options has [s], and how far in front of gravity it may stand
_MARK, _FLOATS = 0.000271828182845904, 32


class Followed(NamedTuple):
    """What compiled code needs of an engine; n joints.

    Attributes:
        step: Address of mj_step.
        model, data: Addresses of its mjModel and mjData.
        timestep: MuJoCo's own length of step, shape (1,).
        clock: Time at which an advance began, and its step, shape (2,).
        calls: How often the callback was called since, shape (1,).
        position, speed: MuJoCo's coordinates, shape (nv,).
        motor, arm: Coordinates of each joint's motor side and of its arm, shape (n,).
        command: Held torque, shape (n,).
        q, dq, theta, dtheta, reported: Workspace, shape (n,).
    """

    step: int
    model: int
    data: int
    timestep: Any
    clock: Any
    calls: Any
    position: Any
    speed: Any
    motor: Any
    arm: Any
    command: Any
    q: Any
    dq: Any
    theta: Any
    dtheta: Any
    reported: Any


def timestep_of(model: Any) -> Vector | None:
    """MuJoCo's own length of step as an array of one: it stands in front of gravity, which is an array by itself.

    None where it is not found there.
    """
    before = model.opt.timestep
    gravity = model.opt.gravity.ctypes.data
    model.opt.timestep = _MARK
    try:
        places = [gravity - 8 * k for k in range(1, _FLOATS)]
        found = [place for place in places if ctypes.c_double.from_address(place).value == _MARK]
    finally:
        model.opt.timestep = before
    return np.ctypeslib.as_array((ctypes.c_double * 1).from_address(found[0])) if len(found) == 1 else None


@cache
def compiled_follow() -> Any:
    """`_follow`, compiled; it returns (number of the instant at which the state was not finite or -1, time)."""
    for helper in (tick, speed, feedback, cut):
        as_it_stands(helper)
    return compile_text(_follow)


def _follow(
    engine: Followed, time: float, offsets: Vector, timeline: Timeline, law: PdTable, rows: Rows
) -> tuple[int, float]:
    n = len(engine.q)
    for i in range(len(timeline.spans)):
        steps = timeline.steps[i]
        if steps > 0:
            engine.timestep[0] = timeline.spans[i] / steps
            engine.clock[0] = time
            engine.clock[1] = engine.timestep[0]
            engine.calls[0] = 0
            for _ in range(steps):
                called(engine.step, engine.model, engine.data)
            time += timeline.spans[i]
            # what is no number spreads to all coordinates of a chain within a step
            if not math.isfinite(engine.speed[0]):
                return i, time
        for j in range(n):
            motor, arm = engine.motor[j], engine.arm[j]
            engine.theta[j] = engine.q[j] = engine.position[motor]
            engine.dtheta[j] = engine.dq[j] = engine.speed[motor]
            if arm != motor:
                engine.q[j] += engine.position[arm]
                engine.dq[j] += engine.speed[arm]
            engine.reported[j] = engine.theta[j] + offsets[j]
        if timeline.ticks[i] >= 0:
            tick(law, timeline.ticks[i], engine.reported, engine.dtheta)
        if timeline.switches[i] >= 0:
            engine.command[:] = law.torques[timeline.switches[i]]
        row = timeline.rows[i]
        if row >= 0:
            rows.q[row] = engine.q
            rows.dq[row] = engine.dq
            rows.theta[row] = engine.theta
            rows.dtheta[row] = engine.dtheta
            rows.tau[row] = engine.command
    return -1, time
