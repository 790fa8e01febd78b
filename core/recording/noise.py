"""The noise of a channel: what no model could explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .colour import LENGTHS, Heard, coloured, heard
from .run import Run, Vector
from .stamps import JITTER

Rows = NDArray[np.bool_]

# before and after a reversal, where friction jumps, a motion is not smooth and a controller settles [s]
_BEFORE, _AFTER = 0.04, 0.08
# of two runs with one sensor, the one that seems slow and so much louder than one that is white, or that is slow as
# well, has its motion in its noise; a sensor that is no louder than this part of its steps' noise has hardly moved
_LOUDER, _MUCH_LOUDER, _MOVED = 1.5, 2.5, 1.05
# coefficients of an autoregression that add up to no more are white noise's
_WHITE = 0.2
# of the distances between neighbouring values, which may be one step: of a fast motion few are
_SMALLEST = (0.02, 0.003, 0.0)
# steps of time that differ by no more than this part of one are equal
_EVEN = 1.0e-6
# rows to either side from which slopes are taken, and steps beyond which a sample is too far away to be moved
_ASIDE, _AWAY = 4, 1.2


@dataclass(frozen=True, slots=True, eq=False)
class ChannelNoise:
    """Noise of a signal's channels: x_k = sum over j of ar_j x_(k-j) + innovation, of standard deviation sigma.

    Attributes:
        sigma: Standard deviation, at least the quantisation step / sqrt 12, shape (n,); ee_rot: about each axis [rad],
            shape (1,).
        ar: Coefficients of an autoregressive model, 0 where white, shape (n, p).
        step: Quantisation step, 0 where none was found, shape (n,).
        stated: Whether sigma is log.yaml's.
    """

    sigma: Vector
    ar: Vector
    step: Vector
    stated: bool

    @property
    def slow(self) -> Rows:
        """Which channels have noise that is not white, shape (n,)."""
        return np.abs(self.ar).sum(axis=1) > _WHITE


def known_together(runs: Sequence[Run]) -> list[Run]:
    """Runs that each know which of the others have the same control and rate, and so the same noise."""

    def alike(one: Run, other: Run) -> bool:
        return one is not other and one.control == other.control and abs(one.rate / other.rate - 1.0) < JITTER

    return [replace(run, beside=tuple(other for other in runs if alike(run, other))) for run in runs]


def noise_of(run: Run, signal: str) -> ChannelNoise:
    """Noise of a signal: stated where log.yaml has it, else estimated from what no model could explain.

    Estimated from the part of a channel's spectrum that stays once everything smooth is taken out, in stretches
    between reversals (colour.py); never from how well some model fits. The colour is estimated in any case. Noise that
    is slower than the motion cannot be told from it: sigma then is what is seen above the motion's frequencies, drawn
    on below by the autoregression, whose colour runs beside it tell as well. Of channels that seem slow, runs beside it
    may know that they are white, or far quieter: friction's steps and a motion's bends pass for slow noise, and nothing
    passes for noise that is less. Of three runs or more that seem slow and alike loud, the one in the middle is taken.

    Raises:
        KeyError: The run has no such signal.
    """
    own = _estimated(run, signal)
    slow = np.flatnonzero(own.slow)
    if not len(slow):
        return own
    runs = [own, *(_estimated(one, signal) for one in run.beside if one.has(signal))]
    terms = max(one.ar.shape[1] for one in runs)
    sigma, ar = own.sigma.copy(), np.pad(own.ar, ((0, 0), (0, terms - own.ar.shape[1])))
    for i in slow.tolist():
        best = _knows_best(runs, i)
        sigma[i], ar[i] = sigma[i] if own.stated else best.sigma[i], 0.0
        if best.slow[i]:
            ar[i, : best.ar.shape[1]] = best.ar[i]
    return replace(own, sigma=sigma, ar=ar)


def _knows_best(runs: Sequence[ChannelNoise], i: int) -> ChannelNoise:
    """Which of several runs, the first of which is asked about, knows a channel best that seems slow in that one."""
    own, others = runs[0], runs[1:]
    if own.stated:
        return next((one for one in others if not one.slow[i]), own)
    best = own
    for other in others:
        floor = _MOVED * float(other.step[min(i, len(other.step) - 1)]) / np.sqrt(12.0)
        less = own.sigma[i] / (_MUCH_LOUDER if other.slow[i] else _LOUDER)
        if floor < other.sigma[i] < min(less, best.sigma[i]):
            best = other
    if best is own and all(one.slow[i] for one in runs):
        # all that are not much louder draw on what they see, and are as often too low as too high
        less = _MUCH_LOUDER * min(float(one.sigma[i]) for one in runs)
        near = sorted((one for one in runs if one.sigma[i] <= less), key=lambda one: float(one.sigma[i]))
        best = near[(len(near) - 1) // 2] if len(near) > 2 else own
    return best


@lru_cache(maxsize=256)
def _estimated(run: Run, signal: str) -> ChannelNoise:
    """Noise of a signal, its colour as this run and those beside it tell it."""
    own = _heard(_Recorded(run), signal)
    stated = signal in run.noise
    size = run.signals[signal].shape[1]
    known = np.broadcast_to(np.square(run.noise[signal]) if stated else np.nan, size)
    others = [_heard(_Recorded(other), signal) for other in run.beside if other.has(signal)]
    beside = [one for other in others for one in other.channels.values()]
    found = coloured(list(own.channels.values()), [float(known[i]) for i in own.channels], beside)
    variance, colours = own.least.copy(), [np.zeros(0) for _ in range(size)]
    for i, noise in zip(own.channels, found, strict=True):
        variance[i], colours[i] = max(noise.variance, variance[i]), noise.ar
    step = own.step
    orders = max(1, *(len(one) for one in colours))
    ar = np.array([np.pad(one, (0, orders - len(one))) for one in colours])
    if signal == "ee_rot":
        # a turn by a small angle moves the quaternion by half of it, square to itself
        variance, ar, step = np.array([4.0 / 3.0 * variance.sum()]), ar[[int(np.argmax(variance))]], 2.0 * step[:1]
    sigma = np.sqrt(variance)
    if stated:
        sigma = np.broadcast_to(run.noise[signal], sigma.shape)
    return ChannelNoise(np.maximum(sigma, step / np.sqrt(12.0)), ar, step, stated)


@dataclass(frozen=True, slots=True, eq=False)
class _Signal:
    """A signal of a run, every channel heard by itself.

    Attributes:
        channels: Of those that have clean stretches what is heard there.
        least: Variance of every channel that quantisation makes, 0 where hardly anything was recorded, shape (n,).
        step: Quantisation step, likewise.
    """

    channels: dict[int, Heard]
    least: Vector
    step: Vector


class _Recorded:
    """What a run recorded, whatever is known of it and of those beside it."""

    def __init__(self, run: Run) -> None:
        self.run = run

    def __hash__(self) -> int:
        return hash((id(self.run.t), id(self.run.signals)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Recorded) and self.run.t is other.run.t and self.run.signals is other.run.signals


@lru_cache(maxsize=256)
def _heard(recorded: _Recorded, signal: str) -> _Signal:
    """Every channel of a signal by itself; made once."""
    run = recorded.run
    # moved samples are no multiples of a step any more
    steps = steps_of(run, signal)
    run = _evenly(run, signal)
    values, known = run.signals[signal], _motion_of(run)
    there = np.isfinite(values).sum(axis=0) >= LENGTHS[-1] // 2
    step = np.where(there, steps, 0.0)
    clean: dict[int, Vector] = {}
    for i in np.flatnonzero(there).tolist():
        stretches = _clean_stretches(run, values[:, i], known, i if values.shape[1] == run.n else None)
        if stretches is not None:
            clean[i] = stretches
    white = np.square(step) / 12.0
    found = heard([(stretches, float(white[i])) for i, stretches in clean.items()])
    return _Signal(dict(zip(clean, found, strict=True)), white, step)


def _evenly(run: Run, signal: str) -> Run:
    """A run whose steps of time differ, as it would be at even ones; nothing where rows are missing.

    What is at a time is the nearest sample, moved there along the motion's slope and bend, which are taken from far
    enough that no noise is averaged away.
    """
    steps = np.diff(run.t)
    usual = float(np.mean(steps[steps < 1.5 * np.median(steps)]))
    # a fast joint goes far beyond its sensor's noise in a small part of a step
    if np.abs(steps / usual - 1.0).max() < _EVEN or len(run.t) < 4 * _ASIDE:
        return run
    grid = np.arange(int(run.t[-1] / usual + 1.0e-6) + 1) * usual
    right = np.clip(np.searchsorted(run.t, grid), 1, len(run.t) - 1)
    near = np.where(grid - run.t[right - 1] < run.t[right] - grid, right - 1, right)
    away = grid - run.t[near]
    lost = np.abs(away) > _AWAY * usual
    signals: dict[str, Vector] = {}
    for name in {"q", signal, *({"q_cmd"} & run.signals.keys())}:
        slope = _slope(run.signals[name], run.t)
        bend = _slope(slope, run.t)
        even = run.signals[name][near] + away[:, None] * (slope[near] + 0.5 * away[:, None] * bend[near])
        even[lost] = np.nan
        signals[name] = even
    return replace(run, t=grid, signals=signals)


def _slope(values: Vector, t: Vector) -> Vector:
    """Change with time between samples some rows before and after, shape as values."""
    rows = np.arange(len(t))
    before, after = np.maximum(rows - _ASIDE, 0), np.minimum(rows + _ASIDE, len(t) - 1)
    return (values[after] - values[before]) / (t[after] - t[before])[:, None]


def steps_of(run: Run, signal: str) -> Vector:
    """Steps of which a signal's values are whole multiples, or were when they were recorded, shape (n,); 0: of none."""
    known = run.steps.get(signal)
    return np.array([quantisation(column) for column in run.signals[signal].T]) if known is None else known


def quantisation(values: Vector) -> float:
    """Step of a channel (m,) whose values are whole multiples of it; 0 where there is none.

    A ramp at one speed has every value once and all as far apart: that is its motion.
    """
    known = values[np.isfinite(values)]
    levels = np.unique(known)
    if len(levels) < 3:
        return 0.0
    apart = np.diff(levels)
    apart = apart[apart > 1.0e-9 * np.abs(levels).max()]
    if len(apart) == 0:
        return 0.0
    for part in _SMALLEST:
        step = float(np.quantile(apart, part))
        step = float(np.median(apart[apart < 1.5 * step]))
        whole = np.round(apart / step)
        if len(levels) == len(known) and whole.max() <= 1.0:
            continue
        if np.quantile(np.abs(apart / step - whole), 0.95) < 0.05:
            return float(apart.sum() / whole.sum())
    return 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """What is known of a run's motion.

    Attributes:
        reversals: Rows near a change of direction of each joint, shape (m, n).
        breaks: Rows before which time makes a jump, shape (m,).
    """

    reversals: Rows
    breaks: Rows


def _motion_of(run: Run) -> _Motion:
    q = run.signals.get("q_cmd")
    commanded = q is not None and bool(np.isfinite(q).all())
    step = 1.0 / run.rate
    if q is None or not commanded:
        q = np.column_stack([bridged(column, run.t) for column in run.signals["q"].T])
        q = _smoothed(q, max(5, 2 * round(0.02 / step) + 1))
    dq = np.gradient(q, run.t, axis=0)
    moving = np.abs(dq) > 1.0e-3 * np.abs(dq).max(axis=0, initial=1e-300)
    direction = np.where(moving, np.sign(dq), 0.0)
    turns = np.vstack([np.zeros((1, run.n), dtype=bool), direction[1:] != direction[:-1]])
    before, after = max(2, round(_BEFORE / step)), max(2, round(_AFTER / step))
    reach = np.ones(before + after + 1)
    reversals = np.column_stack([np.convolve(turn, reach)[before : before + len(turn)] > 0.5 for turn in turns.T])
    gaps = np.concatenate([[False], np.diff(run.t) > 2.5 * step])
    return _Motion(reversals, gaps)


def _clean_stretches(run: Run, values: Vector, known: _Motion, joint: int | None) -> Vector | None:
    """Stretches of a channel (m,) in which nothing turns back, shape (s, length); None where there are too few."""
    finite = np.isfinite(values)
    turned = known.reversals.any(axis=1) if joint is None else known.reversals[:, joint]
    # a motion that turns all the time leaves what it leaves
    avoided = ~finite | (turned if turned.mean() < 0.7 else np.zeros_like(turned))
    length, starts = _clean(avoided, known.breaks)
    if len(starts) < 3:
        length, starts = _clean(~finite, known.breaks)
    return np.array([values[k : k + length] for k in starts]) if len(starts) >= 3 else None


def _clean(avoided: Rows, breaks: Rows) -> tuple[int, list[int]]:
    """The longest length of which there are enough clean stretches, and where they start."""
    starts: list[int] = []
    for length in LENGTHS:
        starts = _stretches(avoided, breaks, length)
        if len(starts) >= 6 and len(starts) * length > 0.4 * (~avoided).sum():
            return length, starts
    return LENGTHS[-1], starts


def _stretches(avoided: Rows, breaks: Rows, length: int) -> list[int]:
    """First rows of stretches of a length that hold no row to avoid, and no jump of time inside.

    They fill what is between from its end on: what a reversal stirs up has time to die away.
    """
    # a jump of time is between two rows: the second may be the first of a stretch
    ends = np.flatnonzero(np.concatenate([avoided | breaks, [True]]))
    starts: list[int] = []
    first = 0
    for end in ends.tolist():
        starts += range(end - length, first - 1, -length)
        first = end if end < len(avoided) and not avoided[end] else end + 1
    return sorted(starts)


def bridged(values: Vector, t: Vector) -> Vector:
    """A channel (m,) with what is missing on straight lines between the others; zeros where nothing is there."""
    finite = np.isfinite(values)
    return np.interp(t, t[finite], values[finite]) if finite.any() else np.zeros_like(values)


def _smoothed(q: Vector, window: int) -> Vector:
    # SciPy's annotations leave its own types open
    smooth: Any = import_module("scipy.signal").savgol_filter
    return np.asarray(smooth(q, min(window, len(q) - (1 - len(q) % 2)), 3, axis=0), dtype=np.float64)
