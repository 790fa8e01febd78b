"""A recorded run made ready for inverse dynamics: one uniform grid, the motion smoothed, with its derivatives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording import Run
from .feedback import told
from .sensed import in_band, next_alike, noise_in

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

HIGHEST_RATE = 500.0
# samples a period of the highest frequency that is compared, lest jumps of friction between them be taken for something
# slower, and how many there are a second at least
SAMPLES, LOWEST_RATE = 12.0, 200.0
# what is compared ends below the smoothing's corner, where the filter takes nothing yet
KEPT = 0.6
LOWEST_BAND, HIGHEST_BAND = 6.0, 40.0
# a motion is told from its sensor's noise where its spectrum stands so far above it
ABOVE_NOISE = 10.0
# standard deviations of their sensors' noise by which motors may be off the motion that was asked for and be as told
AS_TOLD = 2.0
# a joint stands below this part of its own highest speed
CREEP = 0.01
ORDER = 4
# filters that are kept
_DESIGNED = 64
# rows at least that the filter can be run along both ways: all but one of them stand for what was before
FEWEST_FILTERED = 3 * (ORDER + 1) + 1
# the ends of a run, where the smoothing knows one side only, in periods of its corner: accelerations need twice what
# positions do
EDGE = 3.0
# a filter that was begun on a moving robot is let settle so many of its edges long
SETTLED = 2


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What a controller was told that acted on what is recorded.

    Attributes:
        joints: Whose controller did, shape (n,).
        q, dq: As recorded, smoothed as the rest, shape (m, n).
        taken: What part of the recorded speeds is taken for them, beside the slope of the positions, shape (n,).
    """

    joints: Mask
    q: Vector
    dq: Vector
    taken: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A run on a uniform grid of m times.

    Attributes:
        run: The run.
        t: Times [s], shape (m,).
        h: Their distance [s].
        band: What is compared lies below this frequency [Hz].
        q, dq, ddq: Reported motor motion, smoothed by a zero-phase Butterworth filter, or as it was asked for where it
            is known to be that, shape (m, n).
        measured: Signals as recorded, on the grid; holes are bridged, shape (m, n) or (m, 3); ee_rot: rows of the
            rotation matrix, shape (m, 9).
        missing: Where they were bridged, or are no data, shape as measured.
        edge: Samples at either end where the smoothing does not hold.
        told: What a controller acted on that was told the recorded positions and speeds, noise and all; None where no
            record shows it.
        moves_below: Frequency [Hz] above which its motion has nothing, where it is known exactly.
    """

    run: Run
    t: Vector
    h: float
    band: float
    q: Vector
    dq: Vector
    ddq: Vector
    measured: Mapping[str, Vector]
    missing: Mapping[str, Mask]
    edge: int
    told: Told | None = None
    moves_below: float = math.inf

    @property
    def first(self) -> int:
        """The sample from which on the run is compared."""
        return int(np.searchsorted(self.t, self.run.since))

    @property
    def pace(self) -> float:
        """Up to which frequency [Hz] its motion is told from noise, of what is compared."""
        return min(self.band, self.moves_below)

    @property
    def gains_act(self) -> bool:
        """Whether a motor's gain shows: not where a motion is imposed, but for a motor whose arm is clamped."""
        return self.run.control.mode != "motion" or bool(self.run.locked)

    def bridged(self, name: str) -> Mask:
        """Where a signal is smeared by what was bridged: as far from a hole as the smoothing reaches, shape (m, n)."""
        return widened(self.missing[name], self.edge)


def filtered(run: Prepared, values: Vector) -> Vector:
    """Values on a run's grid (m, n) behind the filter that what was measured is behind.

    There must be FEWEST_FILTERED rows or more.
    """
    signal: Any = import_module("scipy.signal")

    return np.asarray(signal.sosfiltfilt(_smoothing(run.band, 1.0 / run.h), values, axis=0))


def _corner(band: float, rate: float) -> float:
    """Of the filter that keeps a band of what is sampled at a rate [Hz]."""
    return min(band / KEPT, 0.45 * rate)


def _smoothing(band: float, rate: float) -> Vector:
    """That filter's second-order sections; it is run both ways."""
    return lowpass(ORDER, _corner(band, rate), rate)


@lru_cache(maxsize=_DESIGNED)
def lowpass(order: int, corner: float, rate: float) -> Vector:
    """Second-order sections of a Butterworth filter, made once: designing one takes as long as running it."""
    signal: Any = import_module("scipy.signal")

    return np.asarray(signal.butter(order, corner, fs=rate, output="sos"))


def creep_of(run: Prepared) -> Vector:
    """Speed of every joint below which it stands, shape (n,) [rad/s or m/s]."""
    fastest = np.abs(run.dq).max(axis=0)
    noise = noise_in(run.run, "q").sigma * 2.0 * np.pi * run.pace * np.sqrt(2.0 * run.pace / run.run.rate)
    return np.maximum(np.maximum(CREEP * fastest, 3.0 * noise), 1e-9)


def widened(flags: Mask, samples: float) -> Mask:
    """Flags (m, n) with so many samples before and after them."""
    ndimage: Any = import_module("scipy.ndimage")

    return np.asarray(ndimage.binary_dilation(flags, np.ones((2 * int(np.ceil(samples)) + 1, 1), dtype=bool)))


def band_of(run: Run) -> float:
    """Up to which frequency [Hz] a run's motion is more than its sensor's noise, within bounds that suit arms."""
    signal: Any = import_module("scipy.signal")

    q = run.signals["q"]
    noise = noise_in(run, "q")
    highest = min(HIGHEST_BAND, 0.2 * run.rate)
    found = LOWEST_BAND
    grid = np.arange(0.0, run.t[-1], 1.0 / run.rate)
    length = min(len(grid), int(2.0 * run.rate))
    for i in range(q.shape[1]):
        good = np.isfinite(q[:, i])
        if good.sum() < 16:
            continue
        values: Vector = np.asarray(np.interp(grid, run.t[good], q[good, i]), dtype=float)
        f, density = signal.welch(values, fs=run.rate, nperseg=length, detrend="linear")
        level = max(2.0 * float(noise.sigma[i]) ** 2 / run.rate, 1e-30)
        above = f[density > ABOVE_NOISE * level]
        if len(above):
            found = max(found, float(above[-1]))
    return min(found, highest)


@lru_cache(maxsize=256)
def follows(run: Run) -> bool:
    """Whether a run's motors are where they were told to be, as far as their sensors say: the motion is known exactly.

    Then torques are compared far above the frequencies of the motion itself, where positions differentiated twice have
    nothing but noise: what rings and what comes often in a turn is there.
    """
    if run.control.mode != "motion" or "q_cmd" not in run.signals or run.locked:
        return False
    asked, measured = run.signals["q_cmd"], run.signals["q"]
    if np.isnan(asked).all(axis=0).any() or np.isnan(measured).all(axis=0).any():
        return False
    rms = np.sqrt(np.nanmean((measured - asked) ** 2, axis=0))
    return bool(np.all(rms <= AS_TOLD * noise_in(run, "q").sigma))


def _as_told(run: Run, t: Vector) -> list[Vector]:
    """The motion that was asked for and its derivatives, shapes (m, n), by a spline of fifth order through its rows.

    The second derivative of pieces of third order is off by h^2 / 12 times the fourth one: more than the noise of a
    good torque sensor.
    """
    interpolate: Any = import_module("scipy.interpolate")

    q = run.signals["q_cmd"]
    whole = np.isfinite(q).all(axis=1)
    spline = interpolate.make_interp_spline(run.t[whole], q[whole], k=5, axis=0)
    return [np.asarray(spline(t, nu=nu)) for nu in range(3)]


def prepared(run: Run, band: float | None = None, disturbed: Mapping[str, Vector] | None = None) -> Prepared:
    """A run on its grid.

    Args:
        run: As read.
        band: Frequency below which runs are compared [Hz]; None: from the run.
        disturbed: Signals to which something is added first: name -> what, shapes as in the run (for noise); ee_rot:
            small turns about the base's axes, shape (m, 3). What a controller was told is as recorded but for "q_told"
            and "dq_told".
    """
    interpolate: Any = import_module("scipy.interpolate")
    signal: Any = import_module("scipy.signal")

    imposed = follows(run)
    width = band if band is not None else min(HIGHEST_BAND, 0.2 * run.rate) if imposed else band_of(run)
    fine = np.arange(int(np.floor(run.t[-1] * run.rate + 1e-6)) + 1) / run.rate
    slowest = HIGHEST_RATE if run.locked else max(SAMPLES * width, LOWEST_RATE)
    every = max(1, round(run.rate / HIGHEST_RATE), int(run.rate / slowest))
    t = fine[::every]
    sos = _smoothing(width, run.rate)
    signals = dict(run.signals)
    if "ee_rot" in signals:
        signals["ee_rot"] = turned(signals["ee_rot"], (disturbed or {}).get("ee_rot"))
    joints = told(run)
    for name in ("q", "dq") if joints is not None else ():
        signals[f"{name}_told"] = run.signals[name]
    for name, extra in (disturbed or {}).items():
        if name != "ee_rot":
            signals[name] = signals[name] + extra
    measured: dict[str, Vector] = {}
    missing: dict[str, Mask] = {}
    motion: list[Vector] = []
    for name, values in signals.items():
        if name in ("dq", "dq_cmd", "ddq_cmd", "q_cmd"):
            continue
        whole, hole = _on(fine, run, values)
        # friction of a clamped motor that turns back is left out sample by sample: smoothing would spread its steps
        smooth = whole if name == "tau" and run.locked else np.asarray(signal.sosfiltfilt(sos, whole, axis=0))
        if name == "q" and imposed:
            motion = _as_told(run, t)
        elif name == "q":
            spline = interpolate.make_interp_spline(fine, smooth, k=5, axis=0)
            motion = [np.asarray(spline(t, nu=nu)) for nu in range(3)]
        measured[name], missing[name] = smooth[::every], hole[::every]
    edge = int(np.ceil(EDGE / _corner(width, run.rate) / (t[1] - t[0])))
    q, dq, ddq = motion
    seen = None
    if joints is not None:
        seen = Told(joints, measured.pop("q_told"), measured.pop("dq_told"), _taken(run, width))
    below = band_of(run) if imposed else math.inf
    return Prepared(run, t, float(t[1] - t[0]), width, q, dq, ddq, measured, missing, edge, seen, below)


@lru_cache(maxsize=256)
def _taken(run: Run, band: float) -> Vector:
    """What part of recorded speeds tells best what a controller was told, beside the slope of positions, shape (n,).

    Noise of a row does not last until the next one; a slope has the noise of positions in it.
    """
    k = ticks_a_row(run)
    memory = np.array([next_alike(ar) for ar in noise_in(run, "dq").ar])
    lasts = np.mean(np.maximum(memory, 1e-12)[:, None] ** (np.arange(k) / k), axis=1)
    of_rows, of_slopes = in_band(run, "dq", band, 0), in_band(run, "q", band, 1)
    return np.asarray((lasts * of_rows + of_slopes) / np.maximum(of_rows + of_slopes, 1e-300))


def ticks_a_row(run: Run) -> int:
    """How many of its controller's ticks a row of a record stands for."""
    return max(1, round(run.control.rate / run.rate))


def turned(quaternions: Vector, by: Vector | None) -> Vector:
    """Rotation matrices of w, x, y, z (m, 4), row after row, turned by small angles (m, 3) [rad], shape (m, 9)."""
    rotation: Any = import_module("scipy.spatial.transform").Rotation

    out = np.full((len(quaternions), 9), np.nan)
    known = np.isfinite(quaternions).all(axis=1)
    if known.any():
        there = rotation.from_quat(quaternions[known][:, [1, 2, 3, 0]])
        if by is not None:
            there = rotation.from_rotvec(by[known]) * there
        out[known] = there.as_matrix().reshape(-1, 9)
    return out


def small_turn(rotation: Vector) -> Vector:
    """Rotation vectors of small turns (..., 3, 3), shape (..., 3) [rad]."""
    r = rotation
    return 0.5 * np.stack(
        [r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1
    )


def _on(grid: Vector, run: Run, values: Vector) -> tuple[Vector, Mask]:
    """Values on a grid by straight lines, and where there were none near: a hole, or a channel that is not there."""
    out = np.zeros((len(grid), values.shape[1]))
    hole = np.zeros(out.shape, dtype=bool)
    for i in range(values.shape[1]):
        good = np.isfinite(values[:, i])
        if good.sum() < 2:
            hole[:, i] = True
            continue
        times = run.t[good]
        out[:, i] = np.interp(grid, times, values[good, i])
        place = np.clip(np.searchsorted(times, grid), 1, len(times) - 1)
        hole[:, i] = (times[place] - times[place - 1]) > 3.5 / run.rate
    return out, hole


@lru_cache(maxsize=32)
def smoothed(run: Run) -> Prepared:
    """The run behind the zero-phase filter that mode unknown is compared through, made once a run."""
    return prepared(run)


def settled(grid: Prepared) -> slice:
    """What is compared, where the filter's ends are no longer felt."""
    edge = min(SETTLED * grid.edge, (len(grid.t) - grid.first) // 4)
    return slice(max(edge, grid.first), len(grid.t) - edge)
