"""How a run begins: at rest, or plainly in the midst of a motion, and where windows of it do."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..expansion import expanded
from ..kinematics import dynamics
from ..recording import Run
from ..representation import Robot
from ..simulation import MachineState
from ..simulation.drive_sheet import DriveSheet
from ..simulation.drives import Drives
from ..simulation.settle import sagged
from .prepare import Prepared, smoothed
from .sensed import noise_in

Vector = NDArray[np.float64]

# torque alone lets a simulation drift away: it is begun anew from what was measured
WINDOW = 0.5
# the first part of a run that tells whether it began at rest: seconds, and samples at least
BEGINNING, FEWEST = 0.02, 8
# how often its noise polynomials may miss a beginning, and of what degree these are: a controller's kick at rest is no
# even acceleration
MISSES, DEGREES = 3.0, range(2, 6)
# what moves so many standard deviations at the start, and such a part of the fastest, plainly moves
PLAIN, FAST = 8.0, 0.02
# how far a speed's noise may take it from what it is
SURELY = 3.0


def start_of(robot: Robot, run: Run) -> MachineState | None:
    """The measured state at the first row, where a run plainly does not begin at rest; None where it does.

    The arm sides stand behind their springs as gravity lets them, and move with the motor sides.
    """
    begun = moving_at_first(run)
    return state_at(robot, *begun) if begun else None


@lru_cache(maxsize=32)
def moving_at_first(run: Run) -> tuple[Vector, Vector] | None:
    """Measured positions and speeds (n,) at the first row of a run that plainly begins in motion."""
    first = (run.t <= BEGINNING) | (np.arange(len(run.t)) < FEWEST)
    q, dq, spread = np.empty(run.n), np.empty(run.n), np.empty(run.n)
    fastest = np.nanmax(np.abs(smoothed(run).dq), axis=0)
    for i, column in enumerate(run.signals["q"][first].T):
        good = np.isfinite(column)
        if good.sum() < 4:
            return None
        for degree in DEGREES:
            q[i], dq[i], spread[i], misses = _begun(run.t[first][good], column[good], degree)
            # noise is asked for where it matters: to know it takes as long as a simulation
            if abs(dq[i]) <= FAST * fastest[i] or misses <= MISSES * float(noise_in(run, "q").sigma[i]):
                break
    fast = np.abs(dq) > FAST * fastest
    moves = fast.any() and fast & (np.abs(dq) > PLAIN * spread * noise_in(run, "q").sigma) & _agrees(run, dq)
    return (q, dq) if np.any(moves) else None


def _begun(t: Vector, values: Vector, degree: int) -> tuple[float, float, float, float]:
    """Position and speed at t = 0 by a polynomial, the speed's error for noise of 1, and what it misses, rms.

    Nothing is missed where it has hardly fewer numbers than there are rows.
    """
    terms = np.vander(t / t[-1], degree + 1, increasing=True)
    covariance = np.linalg.inv(terms.T @ terms)
    amounts = covariance @ (terms.T @ values)
    left = values - terms @ amounts
    spare = len(t) - degree - 1
    misses = math.sqrt(float(left @ left) / spare) if spare > 1 else 0.0
    return float(amounts[0]), float(amounts[1]) / t[-1], math.sqrt(covariance[1, 1]) / t[-1], misses


def _agrees(run: Run, dq: Vector) -> NDArray[np.bool_]:
    """Whether the first recorded speed of each joint is not far below another, shape (n,); 0 is where slopes begin."""
    if not run.has("dq"):
        return np.ones(run.n, dtype=bool)
    first = run.signals["dq"][0]
    known = np.isfinite(first) & (first != 0.0)
    low = np.abs(np.where(known, first, 0.0)) + SURELY * noise_in(run, "dq").sigma < 0.5 * np.abs(dq)
    return ~(known & low)


def state_at(robot: Robot, reported: Vector, dtheta: Vector) -> MachineState:
    """The state of a robot whose motors report positions and speeds (n,), its arms where gravity lets them hang."""
    whole = expanded(robot, imposed=False)
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    theta, speed = whole.spread(reported - offsets), whole.spread(dtheta)
    q = sagged(whole.robot, dynamics(whole.robot, always_compiled=True), theta)
    passive = np.array([stage.drive.passive for stage in whole.robot.stages])
    return MachineState(0.0, q, speed, np.where(passive, q, theta), speed.copy())


def slips_at(robot: Robot, grid: Prepared, times: Vector) -> Vector | None:
    """Where the slip elements of hysteresis are fixed at times of a measured motion, shape (k, s); None: it has none.

    They are taken along where they slip, from a beginning with none of them bent.
    """
    if not any(stage.drive.slips for stage in robot.stages):
        return None
    drives = Drives(DriveSheet.of(robot))
    theta = grid.q - np.array([stage.sensor.position_offset for stage in robot.stages])
    drives.reset(MachineState(0.0, theta[0], grid.dq[0], theta[0], grid.dq[0]))
    fixed = np.empty((len(theta), len(drives.slip_anchor)))
    for k, t in enumerate(grid.t.tolist()):
        drives.evaluate(t, theta[k], grid.dq[k], theta[k], grid.dq[k], accept=True)
        fixed[k] = drives.slip_anchor
    return fixed[np.clip(np.searchsorted(grid.t, times, side="right") - 1, 0, len(grid.t) - 1)]


def window_edges(run: Run) -> list[float]:
    """Where the windows of mode torque begin, on ticks, and where the last one ends [s].

    Of a run that begins in the midst of a motion the filter's edge is left out: it knows no state there.
    """
    grid, rate, begin = smoothed(run), run.control.rate, 0.0
    if moving_at_first(run):
        begin = float(np.ceil(min(grid.edge * grid.h, run.duration / 4.0) * rate) / rate)
    spans = max(1, int(np.ceil((run.t[-1] - begin) / WINDOW - 1.0e-9)))
    return [round((begin + (run.duration - begin) * k / spans) * rate) / rate for k in range(spans + 1)]
