"""What of a run is held against a simulation of it, and what that leaves."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from ..recording import Run
from ..recording.run import MEASURED
from ..representation import Robot
from .beginning import window_edges
from .evidence import sticking
from .inverse import STANDS
from .prepare import Prepared, creep_of, settled, smoothed, widened
from .resample import ON_CLOCK, between, linear

Vector = NDArray[np.float64]

# what is near the turn of a given motion, and of one that a given torque makes, whose time is not known as well [s]
TURN, TURNED = 0.004, 0.01
# a command is known through a gap of so many samples; times kd / kp until a controller has caught up with one
GAP, CAUGHT_UP = 5.5, 6.0


def mode_of(run: Run) -> str:
    """How a run is held against a model: as its control says, and along its motion where joints are clamped.

    Raises:
        RefusedError: Joints are clamped, and no torque was measured.
    """
    if not run.locked:
        return run.control.mode
    if not (run.has("tau") or run.has("tau_link")):
        raise RefusedError(f"{run.name}: with joints clamped only torques can be compared, and it has none measured.")
    return "unknown"


def compared(run: Run, robot: Robot) -> dict[str, Vector]:
    """What was measured of each signal that a simulation is held against, shapes as `resimulated`; NaN where nothing.

    In mode unknown that is torque alone, behind the filter that the motion was smoothed with, and not where that feels
    a hole of the record: what is bridged there has no accelerations. Where a motion is given, a joint's torque at the
    turn of its way is not compared: which sample friction changes its sign at nobody knows; nor is, in mode torque,
    what drives pass on there and as a window begins. What was commanded in a gap of the record is not known either, and
    nothing is compared behind it until the controller has caught up, or a window begins anew.

    Args:
        run: As read.
        robot: With all that it is thought to have: friction that sticks bears anything where a joint stands.
    """
    judged = run.judged[:, None]
    return {name: np.where(judged, values, np.nan) for name, values in _of_all_rows(run, robot).items()}


def _of_all_rows(run: Run, robot: Robot) -> dict[str, Vector]:
    """The same of all rows."""
    stuck = sticking(robot)
    if mode_of(run) == "motion":
        turns = near_turns(smoothed(run), run.t, TURN, stuck)
        return {
            name: np.where(turns, np.nan, run.signals[name]) if name in ("tau", "tau_link") else run.signals[name]
            for name in MEASURED
            if run.has(name)
        }
    if mode_of(run) == "torque":
        # a window begins with friction's bristles unbent, and turns when its start's noise lets it
        loose = near_turns(smoothed(run), run.t, TURNED, stuck)
        begun: Vector = np.array(window_edges(run))[:, None] - ON_CLOCK
        loose |= np.any((run.t >= begun) & (run.t < begun + TURNED), axis=0)[:, None]
        lost = _beyond_command(run)[:, None]
        return {
            name: np.where(lost | loose if name == "tau_link" else lost, np.nan, run.signals[name])
            for name in MEASURED
            if run.has(name)
        }
    if mode_of(run) != "unknown":
        lost = _beyond_command(run)[:, None]
        return {name: np.where(lost, np.nan, run.signals[name]) for name in MEASURED if run.has(name)}
    grid = smoothed(run)
    found: dict[str, Vector] = {}
    known = settled(grid)
    inside = (run.t >= grid.t[known][0]) & (run.t <= grid.t[known][-1])
    none = np.zeros(run.signals["q"].shape, dtype=bool)
    loose = none if run.locked else near_turns(grid, run.t, 0.5 / grid.band, stuck)
    moved = grid.bridged("q").any(axis=1, keepdims=True)
    for name in ("tau", "tau_link"):
        if run.has(name):
            values = between(grid.t, grid.measured[name], run.t)
            bridged = _nearest(grid, grid.bridged(name) | moved, run.t)
            there = np.isfinite(run.signals[name]) & inside[:, None] & ~loose & ~bridged
            found[name] = np.where(there, values, np.nan)
    if run.locked and "tau" in found:
        # while the motor before a clamped output stands, friction takes whatever there is to take
        stands = linear(grid.t, (np.abs(grid.dq) < creep_of(grid)).astype(float), run.t) > 0.0
        for joint in run.locked:
            found["tau"][stands[:, joint - 1], joint - 1] = np.nan
    return found


def _beyond_command(run: Run) -> NDArray[np.bool_]:
    """Rows behind a gap in which what was commanded there still acts, shape (m,).

    A controller makes up for it; where torque is commanded, the motion is lost until a window begins anew.
    """
    lost = np.zeros(len(run.t), dtype=bool)
    gaps = np.flatnonzero(np.diff(run.t) * run.rate > GAP) + 1
    if run.control.mode == "torque":
        edges, reach = window_edges(run), smoothed(run).edge * smoothed(run).h
        lost |= run.t < edges[0] - ON_CLOCK
        for row, (begin, end) in product(gaps, pairwise(edges)):
            before, after = run.t[row - 1], run.t[row]
            if before < end and begin < after + reach:
                # a start beside the gap has the bridge's motion
                first = begin if begin > before - reach else after
                lost |= (run.t >= first - ON_CLOCK) & (run.t < end - ON_CLOCK)
    if run.control.mode == "pd":
        gains = zip(run.control.kd, run.control.kp, strict=True)
        # a damped loop settles within some of these
        settled = CAUGHT_UP * max((kd / kp for kd, kp in gains if kp > 0.0), default=0.0)
        for row in gaps:
            lost |= (run.t >= run.t[row]) & (run.t < run.t[row] + settled)
    return lost


def near_turns(grid: Prepared, times: Vector, reach: float, stuck: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where joints turn or (nearly) stand: friction is between its levels and no motion tells it, shape (k, n).

    A joint that stands most of the time still shows its load, unless its friction may bear any of it.

    Args:
        grid: The motion.
        times: At which to tell [s], shape (k,).
        reach: What is near it, before and after [s].
        stuck: Joints with friction that sticks, shape (n,).
    """
    stands = np.abs(grid.dq) < creep_of(grid)
    stands |= np.vstack([np.zeros((1, stands.shape[1]), dtype=bool), np.diff(np.signbit(grid.dq), axis=0)])
    near = widened(stands, reach / grid.h)
    near &= (stands.mean(axis=0) < STANDS) | stuck
    return _nearest(grid, near, times)


def _nearest(grid: Prepared, flags: NDArray[np.bool_], times: Vector) -> NDArray[np.bool_]:
    """Flags of the grid's times (m, n) at other times (k,)."""
    return flags[np.clip(np.searchsorted(grid.t, times), 0, len(grid.t) - 1)]


def residuals(run: Run, simulated: Mapping[str, Vector], robot: Robot) -> dict[str, Vector]:
    """Measured minus simulated of each signal; ee_rot as rotation vectors in the base (m, 3) [rad].

    Of a simulation that ends early, of its rows. Mode torque: arms are held against their motors, for both drift away
    together.
    """
    left: dict[str, Vector] = {}
    for name, whole in compared(run, robot).items():
        measured = whole[: len(simulated[name])] if name in simulated else whole
        if name == "ee_rot":
            left[name] = _turn(measured, simulated[name])
        elif name in simulated:
            left[name] = measured - simulated[name]
    if mode_of(run) == "torque" and {"q", "q_link"} <= left.keys():
        left["q_link"] = left["q_link"] - left["q"]
    return left


def _turn(measured: Vector, simulated: Vector) -> Vector:
    rotation: Any = import_module("scipy.spatial.transform").Rotation

    known = np.isfinite(measured).all(axis=1)
    left = np.full((len(measured), 3), np.nan)
    order = [1, 2, 3, 0]
    if known.any():
        real, ours = rotation.from_quat(measured[known][:, order]), rotation.from_quat(simulated[known][:, order])
        left[known] = (real * ours.inv()).as_rotvec()
    return left
