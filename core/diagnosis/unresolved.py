"""Torques that jump between two rows: where nobody knows the controller, what happened there cannot be compared.

A command that jumps, or a joint that sticks and breaks loose, makes a torque jump. A record whose rows lie milliseconds
apart shows neither when it did nor what followed at once, and inverse dynamics along it leave far more than noise.
Where a controller is known, a simulation knows it; elsewhere the rows about it are left out, and named.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording import LeftOut, Run
from .compared import mode_of
from .prepare import band_of, widened
from .sensed import noise_in
from .stamps import TORQUES

Vector = NDArray[np.float64]

# fourth differences, which pass what is faster than a third of the rate, and what they make of white noise
DIFFERENCES = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
OF_NOISE = float(np.sqrt(np.sum(DIFFERENCES**2)))
# so many times what noise makes of them is no noise, over so many rows of which half say how loud that is there
PLAIN, AROUND = 20.0, 51
# part of a torque's whole way over these rows from which on it is no motion that rows can follow
AT_ONCE = 0.5
# squares of these differences that a jump makes of its own, and part of its own that is left where nobody knows when
# between two rows it was; from how many times the noise's squares on that matters in a motor's torque, which is not
# compared about turns and rests anyway
OF_A_JUMP, MISSED = 20.0, 1.0 / 12.0
MATTERS = {"tau": 10.0, "tau_link": 0.0}
# part of a channel's rows that are no jumps, but a torque that is faster than the record
MOST = 0.5


def resolved(run: Run) -> Run:
    """The run of an unknown controller without rows about which a torque jumps; other runs as they are.

    Args:
        run: Known together with those beside it, as its noise is.
    """
    if mode_of(run) != "unknown" or run.locked:
        return run
    # what follows a jump rings on, as a rest's end does
    rings = int(np.ceil(run.rate / band_of(run)))
    signals, named = dict(run.signals), list(run.left_out)
    for name, matters in ((name, MATTERS[name]) for name in TORQUES if run.has(name)):
        values = run.signals[name].copy()
        for i in range(run.n):
            rows = _about_jumps(values[:, i], float(noise_in(run, name).sigma[i]), matters, rings)
            rows &= np.isfinite(values[:, i])
            if 0.0 < rows.mean() < MOST:
                named.append(_left_out(f"{name}_{i + 1}", run.t[rows]))
                values[rows, i] = np.nan
        signals[name] = values
    return replace(run, signals=signals, left_out=tuple(named)) if len(named) > len(run.left_out) else run


def _about_jumps(values: Vector, sigma: float, matters: float, rings: int) -> NDArray[np.bool_]:
    """Rows of a channel (m,) about its jumps.

    Args:
        values: The channel.
        sigma: Its noise's standard deviation.
        matters: From how many times the noise's squares on what jumps may leave matters.
        rings: Rows before and after them that go with them.
    """
    ndimage: Any = import_module("scipy.ndimage")
    about = np.zeros(len(values), dtype=bool)
    if len(values) < AROUND:
        return about
    beside = np.lib.stride_tricks.sliding_window_view(values, len(DIFFERENCES))
    fast = np.nan_to_num(np.abs(beside @ DIFFERENCES))
    # noise may be louder where a robot moves
    loud = np.maximum(OF_NOISE * sigma, 1.4826 * ndimage.median_filter(fast, size=AROUND))
    jumps = (fast > PLAIN * loud) & (fast > AT_ONCE * np.ptp(beside, axis=1))
    left = MISSED * float(np.sum(fast[jumps] ** 2)) / OF_A_JUMP
    if not left > matters * len(values) * sigma**2:
        return about
    reach = len(DIFFERENCES) // 2
    about[reach:-reach] = jumps
    return widened(about[:, None], reach + rings)[:, 0]


def _left_out(channel: str, t: Vector) -> LeftOut:
    first, last = float(t[0]), float(t[-1])
    message = (
        f"{channel} jumps between rows, from t = {first!r} s to t = {last!r} s, and nobody knows by which controller; "
        f"{len(t)} samples about jumps are left out"
    )
    return LeftOut(channel, "jump", first, last, len(t), message)
