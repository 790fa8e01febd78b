"""Where the gap lies: by signal, joint, phase of motion and frequency, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording import Run
from ..representation import JointKind, Robot
from ..signals import joint_unit
from .blocks import Blocks
from .diagnosis import Band, Dependence, JointShare, Phase, SignalGap, Where
from .noise import Noise
from .prepare import smoothed
from .resample import linear

Vector = NDArray[np.float64]

EDGES = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
PHASES = ("reversal", "standstill", "constant_speed", "acceleration")
# of a joint's fastest speed: slower it stands; of its largest acceleration: less is constant speed
STILL, STEADY = 0.01, 0.15
# this long before and after a change of direction [s]
AROUND = 0.05
# a joint with a smaller share is not looked into
SMALLEST_SHARE = 0.03
# what explains less is not told
WEAKEST = 0.02
BINS = 24
# samples that a dependence is looked for in
SAMPLES = 4000
# what chance explains is told from so many shifts of the variable along the run
SHIFTS = 12


def where(
    residuals: Sequence[Mapping[str, Vector]], noises: Sequence[Noise], runs: Sequence[Run], robot: Robot
) -> Where:
    """Where measured minus simulated lies, over all runs together.

    Args:
        residuals: Measured minus simulated of each run, signal -> (m, n) or (m, 3).
        noises: Of each run.
        runs: What was measured.
        robot: For the units of its joints.
    """
    channels = _channels(residuals, noises)
    blocks = Blocks.of(residuals, noises, runs)
    sums = blocks.together()
    signals = {
        name: SignalGap(sums.rms(name), sums.noise(name), float(sums.gap(name)), unit_of(name, robot))
        for name in sums.signals
    }
    return Where(
        signals,
        _joints(blocks, robot.n),
        _phases(channels, runs),
        _bands(channels, runs),
        _dependences(channels, runs, robot),
    )


def unit_of(signal: str, robot: Robot) -> str:
    """SI unit of a signal's rms; of joints that turn and slide, both."""
    if signal == "ee":
        return "m"
    if signal == "ee_rot":
        return "rad"
    # turning joints first
    kinds: list[JointKind] = sorted({stage.joint.kind for stage in robot.stages}, reverse=True)
    return "|".join(joint_unit(signal, kind) for kind in kinds)


def _joints(blocks: Blocks, n: int) -> dict[str, JointShare]:
    """Energy above noise of each joint's channels, in units of noise; rms over its signals."""
    sums, drawn = blocks.together(), blocks.drawn()
    own = [name for name in sums.signals if not name.startswith("ee")]
    if not own:
        return {f"joint_{i + 1}": JointShare(0.0, 0.0) for i in range(n)}
    above = np.sum([sums.above(name) for name in own], axis=0)
    total = np.sqrt(np.mean([sums.relative(name) for name in own], axis=0))
    spread = np.sqrt(np.mean([drawn.relative(name) for name in own], axis=0))
    low, high = np.quantile(spread, [0.025, 0.975], axis=0)
    shares = above / max(float(np.sum(above)), 1e-300)
    return {
        f"joint_{i + 1}": JointShare(float(shares[i]), float(total[i]), (float(low[i]), float(high[i])))
        for i in range(n)
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Channel:
    """One channel of one run: measured minus simulated in units of noise (m,), of which joint (from 0; -1: none)."""

    run: int
    signal: str
    joint: int
    values: Vector

    def above(self) -> float:
        """Energy above noise: samples times mean square above 1."""
        good = self.values[np.isfinite(self.values)]
        return max(0.0, float(np.sum(np.square(good))) - len(good))


def _channels(residuals: Sequence[Mapping[str, Vector]], noises: Sequence[Noise]) -> list[_Channel]:
    found: list[_Channel] = []
    for k, (one, noise) in enumerate(zip(residuals, noises, strict=True)):
        sigma = noise.sigma
        for name, values in one.items():
            for i, column in enumerate(values.T):
                if np.isfinite(column).any():
                    joint = -1 if name.startswith("ee") else i
                    found.append(_Channel(k, name, joint, column / max(float(sigma[name][i]), 1e-300)))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """How a run moved, at its stamps, shapes (m, n)."""

    q: Vector
    dq: Vector
    ddq: Vector


def motion_of(run: Run) -> Motion:
    """The measured motion, smoothed without a lag."""
    grid = smoothed(run)
    return Motion(*(linear(grid.t, values, run.t) for values in (grid.q, grid.dq, grid.ddq)))


def phase_of(run: Run, motion: Motion) -> NDArray[np.int64]:
    """Number of the phase (in PHASES) of every joint at every sample, shape (m, n)."""
    fastest = np.maximum(np.quantile(np.abs(motion.dq), 0.99, axis=0), 1e-12)
    hardest = np.maximum(np.quantile(np.abs(motion.ddq), 0.99, axis=0), 1e-12)
    still = np.abs(motion.dq) < STILL * fastest
    phase = np.where(
        np.abs(motion.ddq) < STEADY * hardest, PHASES.index("constant_speed"), PHASES.index("acceleration")
    )
    phase = np.where(still, PHASES.index("standstill"), phase)
    for i in range(motion.dq.shape[1]):
        moving = np.flatnonzero(~still[:, i])
        turns = np.flatnonzero(np.diff(np.sign(motion.dq[moving, i])) != 0.0)
        for turn in turns:
            before, after = run.t[moving[turn]], run.t[moving[turn + 1]]
            # a rest between two directions is a rest
            if after - before <= 2.0 * AROUND:
                middle = 0.5 * (before + after)
                phase[np.abs(run.t - middle) <= AROUND, i] = PHASES.index("reversal")
    return phase


def _phases(channels: Sequence[_Channel], runs: Sequence[Run]) -> tuple[Phase, ...]:
    phases = [phase_of(run, motion_of(run)) for run in runs]
    energy = np.zeros(len(PHASES))
    for channel in (channel for channel in channels if channel.joint >= 0):
        at = phases[channel.run][:, channel.joint]
        for number in range(len(PHASES)):
            part = channel.values[at == number]
            part = part[np.isfinite(part)]
            energy[number] += float(np.sum(np.square(part))) - len(part)
    energy = np.maximum(energy, 0.0)
    total = float(np.sum(energy))
    if not total:
        return ()
    found = [Phase(name, float(part) / total) for name, part in zip(PHASES, energy, strict=True)]
    return tuple(sorted(found, key=lambda phase: -phase.share))


def bridged(t: Vector, values: Vector) -> Vector:
    """A channel (m,) with straight lines over what is missing."""
    good = np.isfinite(values)
    return values if good.all() else np.interp(t, t[good], values[good])


def _bands(channels: Sequence[_Channel], runs: Sequence[Run]) -> tuple[Band, ...]:
    """Welch's spectrum of every channel above that of white noise."""
    signal: Any = import_module("scipy.signal")

    highest = float(max(run.rate for run in runs)) / 2.0
    edges = [edge for edge in EDGES if edge < highest] + [highest]
    energy = np.zeros(len(edges) - 1)
    for channel in channels:
        run = runs[channel.run]
        grid = np.arange(int(run.since * run.rate), int(run.t[-1] * run.rate) + 1) / run.rate
        values = np.interp(grid, run.t, bridged(run.t, channel.values))
        length = min(len(values), int(4.0 * run.rate))
        f, density = signal.welch(values, fs=run.rate, nperseg=length, detrend=False)
        excess = (density - 2.0 / run.rate) * (f[1] - f[0]) * len(values)
        for k, (low, high) in enumerate(pairwise(edges)):
            energy[k] += float(np.sum(excess[(f >= low) & (f < high)]))
    energy = np.maximum(energy, 0.0)
    total = float(np.sum(energy))
    if not total:
        return ()
    return tuple(
        Band(low, high, float(part) / total) for low, high, part in zip(edges[:-1], edges[1:], energy, strict=True)
    )


def _dependences(channels: Sequence[_Channel], runs: Sequence[Run], robot: Robot) -> tuple[Dependence, ...]:
    """Share of the whole gap's energy that a binned function of one variable explains, less what chance would."""
    joint_channels = [channel for channel in channels if channel.joint >= 0]
    total = sum(channel.above() for channel in joint_channels)
    if total <= 0.0:
        return ()
    variables = [_variables(run) for run in runs]
    strengths: dict[str, float] = {}
    for joint in range(robot.n):
        own = [channel for channel in joint_channels if channel.joint == joint]
        if sum(channel.above() for channel in own) < SMALLEST_SHARE * total:
            continue
        for signal in sorted({channel.signal for channel in own}):
            parts = [channel for channel in own if channel.signal == signal]
            energy = sum(channel.above() for channel in parts)
            for name in candidates(joint, robot.n):
                pieces = [(variables[part.run].get(name), part.values) for part in parts]
                known = [(x, y) for x, y in pieces if x is not None]
                if known:
                    explained = explained_by(known, discrete=name.startswith("sign"))
                    strengths[name] = strengths.get(name, 0.0) + energy / total * explained
    found = [Dependence(name, min(1.0, value)) for name, value in strengths.items() if value >= WEAKEST]
    return tuple(sorted(found, key=lambda dependence: (-dependence.strength, dependence.variable)))


def candidates(joint: int, n: int) -> list[str]:
    """The variables that the gap of a joint (counted from 0) is held against, as a page can draw them."""
    own = joint + 1
    names = [f"sign(dq_{own})", f"dq_{own}", f"ddq_{own}", f"abs(tau_{own})", "t"]
    return [*names, *(f"q_{i + 1}" for i in range(n))]


def _variables(run: Run) -> dict[str, Vector]:
    motion = motion_of(run)
    found: dict[str, Vector] = {"t": run.t}
    for i in range(run.n):
        number = i + 1
        speed = motion.dq[:, i]
        standing = np.abs(speed) < STILL * max(float(np.quantile(np.abs(speed), 0.99)), 1e-12)
        found[f"q_{number}"], found[f"dq_{number}"] = motion.q[:, i], speed
        found[f"ddq_{number}"] = motion.ddq[:, i]
        found[f"sign(dq_{number})"] = np.where(standing, 0.0, np.sign(speed))
        if run.has("tau") and np.isfinite(run.signals["tau"][:, i]).any():
            found[f"abs(tau_{number})"] = np.abs(bridged(run.t, run.signals["tau"][:, i]))
    return found


def explained_by(pieces: Sequence[tuple[Vector, Vector]], *, discrete: bool) -> float:
    """Share of the energy of y, noise of 1 taken off, that a binned function of x explains, less what chance would.

    Args:
        pieces: (x, y) of each run, shapes (m,); y in units of noise, NaN where there is none.
        discrete: x has a few values, each a bin of its own.
    """
    every = max(1, sum(len(y) for _, y in pieces) // SAMPLES)
    thin = [(x[::every], y[::every]) for x, y in pieces]
    y = np.concatenate([y for _, y in thin])
    good = np.isfinite(y)
    energy = float(np.sum(np.square(y[good]))) - int(np.sum(good))
    if energy <= 0.0:
        return 0.0
    taken = _taken(np.concatenate([x for x, _ in thin]), y, good, discrete)
    rng = np.random.default_rng(0)
    chance: list[float] = []
    for _ in range(SHIFTS):
        moved = [np.roll(x, int(rng.uniform(0.15, 0.85) * len(x))) for x, _ in thin]
        chance.append(_taken(np.concatenate(moved), y, good, discrete))
    by_chance = min(float(np.median(chance)), 0.999 * energy)
    return float(np.clip((taken - by_chance) / (energy - by_chance), 0.0, 1.0))


def _taken(x: Vector, y: Vector, good: NDArray[np.bool_], discrete: bool) -> float:
    """Energy of y that means over bins of x take, noise of 1 a bin taken off."""
    values = np.where(good, y, 0.0)
    if discrete:
        _, place = np.unique(x, return_inverse=True)
    else:
        edges = np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)[1:-1])
        place = np.searchsorted(edges, x)
    count = np.bincount(place, weights=good.astype(np.float64))
    sums = np.bincount(place, weights=values)
    used = count > 0.0
    return float(np.sum(np.square(sums[used]) / count[used])) - int(np.sum(used))
