"""What a trace says of the signals that a run has."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kinematics import dynamics, jacobian
from ..recording import Run
from ..recording.run import MEASURED
from ..representation import Robot
from ..simulation import Trace
from .compared import mode_of

Vector = NDArray[np.float64]

# modes in which a simulation's motors move as they are told to
IMPOSED = ("motion", "unknown")
# samples at a simulation's end that may know of what is behind it
ENDS = 3


def signals_of(trace: Trace, run: Run, robot: Robot) -> dict[str, Vector]:
    """Those signals of a trace that the run has, of a robot whose rigid connections are rigid.

    An engine needs a spring where a rigid joint's gear wobbles. That spring is none of the robot's: what it gives under
    what it bears is many times a second encoder's noise, and is taken off; the tool's part of it by the Jacobian. Where
    motors move as they are told to, so is what it takes to move the arms by so much, which makes more of quick torques.
    """
    rotation: Any = import_module("scipy.spatial.transform").Rotation

    found = {name: trace.joints[name] for name in MEASURED if run.has(name) and name in trace.joints}
    give = _given(robot, trace)
    if give is not None and "q_link" in found:
        found["q_link"] = found["q_link"] + give[0]
    if give is not None and mode_of(run) in IMPOSED:
        takes = (dynamics(robot).mass_matrix(trace.joints["q_link"]) @ give[1][:, :, None])[:, :, 0]
        found |= {name: found[name] + takes for name in ("tau", "tau_link") if name in found}
    if not (run.has("ee") or run.has("ee_rot")):
        return found
    tip, turn = trace.tip, rotation.from_matrix(trace.tool_in_base[:, :3, :3])
    if give is not None:
        twist = (jacobian(robot, trace.joints["q_link"]) @ give[0][:, :, None])[:, :, 0]
        tip, turn = tip + twist[:, :3], rotation.from_rotvec(twist[:, 3:]) * turn
    if run.has("ee"):
        found["ee"] = tip
    if run.has("ee_rot"):
        found["ee_rot"] = turn.as_quat()[:, [3, 0, 1, 2]]
    return found


def _given(robot: Robot, trace: Trace) -> tuple[Vector, Vector] | None:
    """How far springs that stand for rigid connections give, and its second derivative; None where there are none.

    To second order in how fast their dampers follow: s = T / K - (b / K) (T / K)'. Shapes (m, n) [rad or m].
    """
    interpolate: Any = import_module("scipy.interpolate")

    there = _standing_in(robot)
    if not there.any():
        return None
    springs = [stage.drive.spring for stage in robot.stages]
    pairs = [(spring.stiffness, spring.damping) if spring else (math.inf, 0.0) for spring in springs]
    stiffness, damping = np.where(there, np.array(pairs).T, [[math.inf], [0.0]])
    still = trace.joints["tau_link"] / stiffness
    # a given motion stops at once behind its end, which no spline may see
    inside = trace.t[:-ENDS]
    curve = interpolate.CubicSpline(inside, still[:-ENDS])
    at = np.minimum(trace.t, inside[-1])
    return still - damping / stiffness * curve(at, nu=1), curve(at, nu=2)


def _standing_in(robot: Robot) -> Vector:
    """Whether a joint's spring stands for a rigid connection, shape (n,)."""
    return np.array([bool(stage.drive.spring and stage.drive.spring.stands_in) for stage in robot.stages])


def unasked(run: Run, robot: Robot) -> list[str]:
    """What a simulation need not record: the run has nothing to hold it against."""
    tool = run.has("ee") or run.has("ee_rot")
    passed = run.has("tau_link") or bool(_standing_in(robot).any())
    return [name for name, there in (("tau_link", passed), ("tool", tool)) if not there]
