"""Measured minus said, as numbers of unit noise: the one vector in which all effects compete.

Each channel of each run is compared by its cosine transform (DCT-II, orthonormal) below the run's band, each
coefficient divided by the noise that it would have for a perfect model. The transform keeps white noise white, colours
become weights, and leaving frequencies out needs no filter. What sensors' noise does to a coefficient, on its way
through smoothing, differentiation and the controller's gains, is found by sending samples of it that way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..build import sticks
from ..parallel import side_by_side
from ..recording import ChannelNoise, Run
from ..representation import Robot
from .beyond import Beyond
from .inverse import REST, STANDS, Said, fed_back, said
from .prepare import Prepared, Told, creep_of, prepared, small_turn, ticks_a_row, widened
from .sensed import next_alike, noise_in, response_of

Vector = NDArray[np.float64]
# signal -> coefficients of each of its channels
Between = Mapping[str, Sequence[Vector]]

DRAWS = 4
# one sample in so many may be left out of a transform
FEW = 200
# part of a channel's rows that must count, or none does: a few beside what does not may be the tails of that
LEAST_COMPARED = 0.03
# neighbouring coefficients share their noise's estimate, over this part of the band at either side
NEIGHBOURS = 0.04
SEED = 20131115
# logarithm of the ratio up to which two estimates of noise are the same
ALIKE = 0.2
# samples until a coloured process is what it stays
LEAD = 500
# where every joint stands and its friction may bear anything, nothing can be compared along the motion
NONE: Vector = np.zeros(0)


@dataclass(frozen=True, slots=True)
class Channel:
    """One signal of one joint (or axis) in one run: its coefficients are values[first:last] of the whole."""

    run: int
    signal: str
    index: int
    first: int
    last: int


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """What other gains make of the noise of one joint's "u".

    Attributes:
        form: Mean squares and products, in units of that noise, of what the controller makes of its sensors' by
            position, by speed (both with the gains as stated), and of all else, shape (3, 3).
    """

    form: Vector

    def noise(self, kp: float, kd: float, rest: float = 1.0) -> float:
        """Power of the noise of "u" with so many times the gains, and so many times all else, in units of it."""
        factors = np.array([kp, kd, rest])
        return float(factors @ self.form @ factors)


@dataclass(frozen=True, slots=True, eq=False)
class Voice:
    """A robot that says what its sensors would have shown along a motion.

    Attributes:
        robot: Which one.
        nominal: The robot as it is known.
        creep: Speed below which joints stand, shape (n,).
        beyond: What it has beyond the catalogue's laws.
    """

    robot: Robot
    nominal: Robot
    creep: Vector
    beyond: Beyond = ()

    def says(self, run: Prepared) -> Said:
        """What the sensors of a run would have shown."""
        return said(self.robot, run, self.nominal, self.creep, self.beyond)


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Everything that is compared, and the weights.

    Attributes:
        runs: Prepared runs.
        nominals: Nominal robot of each run.
        channels: Where each channel's coefficients stand.
        weights: One over the noise of every coefficient.
        masks: Run -> signal -> what counts, shape (m, n) of 0 and 1.
        creeps: Run -> speed below which joints stand.
        mixes: Run -> for each joint, what part of the coefficients of "tau" goes with those of "u" by noise alone;
            {} where a run has not both. It is taken out of "u", so that both are known apart.
        asks: Run -> for each joint, what its controller makes of its sensors' noise; {} where no gains act.
        between: Run -> signal -> coefficients of what happens between its rows and no model is blamed for; {} where
            that is nothing, () where it is of no run.
    """

    runs: tuple[Prepared, ...]
    nominals: tuple[Robot, ...]
    channels: tuple[Channel, ...]
    weights: Vector
    masks: tuple[dict[str, Vector], ...]
    creeps: tuple[Vector, ...]
    mixes: tuple[Mapping[int, Vector], ...]
    asks: tuple[Mapping[int, Asked], ...]
    between: tuple[Between, ...] = ()

    def residual(self, robots: Sequence[Robot], beyond: Beyond = ()) -> Vector:
        """Measured minus said of these robots, one a run, in units of noise, shape (N,).

        Args:
            robots: With their effects.
            beyond: What they have beyond the catalogue's laws.
        """

        def raw(number: int) -> dict[str, list[Vector]]:
            return self._raw(number, robots[number], beyond)

        return self.weighed(side_by_side(raw, range(len(robots))))

    def weighed(self, raw: Sequence[Mapping[str, Sequence[Vector]]]) -> Vector:
        """Coefficients of every run's signals in units of noise, shape (N,)."""
        return np.concatenate([NONE, *(self._unmixed(raw[c.run], c) for c in self.channels)]) * self.weights

    def _unmixed(self, raw: Mapping[str, Sequence[Vector]], channel: Channel) -> Vector:
        values = raw[channel.signal][channel.index]
        mix = self.mixes[channel.run].get(channel.index) if channel.signal == "u" else None
        return values if mix is None else values - mix * raw["tau"][channel.index]

    def heard(self, robots: Sequence[Robot], beyond: Beyond = (), *, exactly: bool = False) -> Evidence:
        """The same evidence in units of the noise that other robots make of what sensors say; itself where it is alike.

        What rings makes many times its sensors' noise of it where it rings: there a robot that is known to ring is
        known no better.

        Args:
            robots: With their effects, one a run.
            beyond: What they have beyond the catalogue's laws.
            exactly: Where it is alike, too.
        """
        weights = np.ones_like(self.weights)
        mixes: list[dict[int, Vector]] = []
        asks: list[dict[int, Asked]] = []
        for number, (run, robot) in enumerate(zip(self.runs, robots, strict=True)):
            voice = Voice(robot, self.nominals[number], self.creeps[number], beyond)
            values = differences(run, voice.says(run))
            noise, mix, asked = _noise(run, voice, values, self.masks[number])
            mixes.append(mix)
            asks.append(asked)
            for channel in self.channels:
                if channel.run == number:
                    weights[channel.first : channel.last] = 1.0 / noise[channel.signal][channel.index]
        if not np.all(np.isfinite(weights)):
            return self
        if not exactly and np.all(np.abs(np.log(weights / self.weights)) < ALIKE):
            return self
        return replace(self, weights=weights, mixes=tuple(mixes), asks=tuple(asks))

    def told_by(self, other: Evidence, values: Vector) -> Vector:
        """In these units what is in those of the same evidence as it was heard otherwise, shape (N,) or (N, k)."""
        raw = values.T / other.weights
        starts = {(c.run, c.signal, c.index): c.first for c in self.channels}
        for c in self.channels:
            if c.signal == "u" and (c.run, "tau", c.index) in starts:
                first = starts[c.run, "tau", c.index]
                before, now = (one.mixes[c.run].get(c.index, 0.0) for one in (other, self))
                raw[..., c.first : c.last] += (before - now) * raw[..., first : first + c.last - c.first]
        return (raw * self.weights).T

    def places(self, chosen: Sequence[int]) -> NDArray[np.int64]:
        """Which coefficients belong to some of the runs."""
        parts = [np.arange(c.first, c.last) for c in self.channels if c.run in chosen]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)

    def only(self, chosen: Sequence[int]) -> Evidence:
        """The evidence of some of the runs, in their old order."""
        kept = sorted(chosen)
        channels: list[Channel] = []
        place = 0
        for c in self.channels:
            if c.run in kept:
                channels.append(Channel(kept.index(c.run), c.signal, c.index, place, place + c.last - c.first))
                place += c.last - c.first
        return Evidence(
            tuple(self.runs[k] for k in kept),
            tuple(self.nominals[k] for k in kept),
            tuple(channels),
            self.weights[self.places(kept)],
            tuple(self.masks[k] for k in kept),
            tuple(self.creeps[k] for k in kept),
            tuple(self.mixes[k] for k in kept),
            tuple(self.asks[k] for k in kept),
            tuple(self.between[k] for k in kept) if self.between else (),
        )

    def _raw(self, number: int, robot: Robot, beyond: Beyond) -> dict[str, list[Vector]]:
        run = self.runs[number]
        speech = Voice(robot, self.nominals[number], self.creeps[number], beyond).says(run)
        left = coefficients(run, differences(run, speech), self.masks[number])
        for name, columns in self.between_of(number).items():
            left[name] = [column - own for column, own in zip(left[name], columns, strict=True)]
        return left

    def between_of(self, number: int) -> Between:
        """What happens between the rows of a run; {} where that is nothing."""
        return self.between[number] if self.between else {}


def differences(run: Prepared, speech: Said) -> dict[str, Vector]:
    """Measured minus said of every signal that a run has, on its grid.

    "u" is what the controller asks for at the measured motion minus what that motion takes: often it knows the torque
    better than a torque sensor does.
    """
    measured = run.measured
    out: dict[str, Vector] = {}
    if "tau" in measured:
        out["tau"] = measured["tau"] - speech.tau
    if speech.u is not None:
        out["u"] = speech.u - speech.tau
    for name in ("tau_link", "q_link", "ee"):
        if name in measured:
            out[name] = measured[name] - getattr(speech, name)
    if "ee_rot" in measured:
        out["ee_rot"] = ahead(measured["ee_rot"], speech.ee_rot)
    return out


def ahead(one: Vector, other: Vector) -> Vector:
    """By what small angles about the base's axes one rotation is ahead of another, (m, 9) each, shape (m, 3) [rad]."""
    return small_turn(one.reshape(-1, 3, 3) @ other.reshape(-1, 3, 3).transpose(0, 2, 1))


# as what is said may be
@np.errstate(invalid="ignore")
def coefficients(run: Prepared, values: dict[str, Vector], masks: dict[str, Vector]) -> dict[str, list[Vector]]:
    """Cosine coefficients of each channel below the band."""
    fft: Any = import_module("scipy.fft")

    m, kept = _transformed(run), len(frequencies_of(run))
    compared = slice(run.first, run.first + m)
    out: dict[str, list[Vector]] = {}
    for name, series in values.items():
        # a channel's samples beside each other are transformed several times as fast
        spectrum = np.asarray(fft.dct((series * masks[name])[compared].T.copy(), type=2, norm="ortho", axis=1))
        out[name] = list(spectrum[:, :kept])
    return out


def frequencies_of(run: Prepared) -> Vector:
    """Of the coefficients of a run's channels that are compared [Hz]."""
    m = _transformed(run)
    return np.arange(max(4, int(2.0 * run.band * m * run.h))) / (2.0 * m * run.h)


def _transformed(run: Prepared) -> int:
    """How many samples are: the last few of an awkward number would take several times as long as all others."""
    m = len(run.t) - run.first
    return min(range(m - m // FEW, m + 1), key=lambda count: (_largest_factor(count), -count))


@cache
def _largest_factor(number: int) -> int:
    """The largest prime factor of a number."""
    factor, largest = 2, 1
    while number > 1:
        if factor * factor > number:
            return max(largest, number)
        while number % factor == 0:
            number, largest = number // factor, factor
        factor += 1
    return largest


def gather(runs: Sequence[Run], nominals: Sequence[Robot]) -> Evidence:
    """What can be compared in these runs.

    Args:
        runs: As read.
        nominals: Robot of each run before anything is found.
    """
    ready = tuple(prepared(run) for run in runs)
    creeps = tuple(creep_of(run) for run in ready)
    masks: list[dict[str, Vector]] = []
    channels: list[Channel] = []
    weights: list[Vector] = []
    mixes: list[dict[int, Vector]] = []
    asks: list[dict[int, Asked]] = []
    place = 0
    for number, (run, nominal, creep) in enumerate(zip(ready, nominals, creeps, strict=True)):
        voice = Voice(nominal, nominal, creep)
        values = differences(run, voice.says(run))
        mask = _masks(run, values, creep, sticking(nominal))
        masks.append(mask)
        noise, mix, asked = _noise(run, voice, values, mask)
        mixes.append(mix)
        asks.append(asked)
        for signal, columns in noise.items():
            for index, sigma in enumerate(columns):
                if mask[signal][:, index].mean() < LEAST_COMPARED:
                    continue
                channels.append(Channel(number, signal, index, place, place + len(sigma)))
                weights.append(1.0 / sigma)
                place += len(sigma)
    return Evidence(
        ready,
        tuple(nominals),
        tuple(channels),
        np.concatenate([NONE, *weights]),
        tuple(masks),
        creeps,
        tuple(mixes),
        tuple(asks),
    )


def sticking(robot: Robot) -> NDArray[np.bool_]:
    """Joints with friction that sticks, shape (n,)."""
    return np.array([sticks(stage.drive) for stage in robot.stages])


def _masks(run: Prepared, values: dict[str, Vector], creep: Vector, stuck: NDArray[np.bool_]) -> dict[str, Vector]:
    """What counts: no edges, no holes, and no joint that stands or turns back, where friction is between its levels."""
    masks: dict[str, Vector] = {}
    ndimage: Any = import_module("scipy.ndimage")
    stands = np.abs(run.dq) < creep
    turns = np.zeros_like(stands)
    turns[1:] = np.diff(np.signbit(run.dq), axis=0)
    # when it turns is known as well as the band tells times apart; a rest ends with a jerk, which rings on
    period = 1.0 / (run.pace * run.h)
    rests = ndimage.binary_opening(stands, np.ones((max(3, int(REST / run.h)), 1), dtype=bool))
    near = widened(stands | turns, 0.5 * period) | widened(rests, period)
    # a joint that stands all the time still shows its load, unless its friction may bear any of it
    unsure = near & ((stands.mean(axis=0) < STANDS) | stuck)
    for joint in run.run.locked:
        # behind a clamped output it creeps from rest to rest, and shows its load on the way alone
        unsure[:, joint - 1] = (stands | turns)[:, joint - 1]
    bridged = {name: run.bridged(name) for name in run.missing}
    for name, series in values.items():
        mask = np.ones(series.shape)
        mask[: max(run.first, run.edge)] = mask[len(mask) - run.edge :] = 0.0
        if name in ("ee", "ee_rot"):
            mask[bridged[name].any(axis=1) | bridged["q"].any(axis=1)] = 0.0
        else:
            # a joint's torque takes the motion of every joint
            mask[bridged["q"].any(axis=1)] = 0.0
            if name in bridged:
                mask[bridged[name]] = 0.0
            if name == "u" and run.told is not None:
                mask[(bridged["q_told"] | bridged["dq_told"]) & run.told.joints] = 0.0
        if name in ("tau", "u"):
            mask[unsure] = 0.0
        masks[name] = mask
    return masks


def _noise(
    run: Prepared, voice: Voice, values: dict[str, Vector], masks: dict[str, Vector]
) -> tuple[dict[str, list[Vector]], dict[int, Vector], dict[int, Asked]]:
    """Standard deviation of every coefficient for a perfect model, and of "u" what is "tau" and what is asked for.

    See `Evidence`.
    """
    ndimage: Any = import_module("scipy.ndimage")

    random = np.random.default_rng(SEED)
    total: dict[str, list[Vector]] = {}
    names = [name for name in ("q", "tau", "tau_link", "q_link", "ee", "ee_rot") if name in run.run.signals]
    models = {name: noise_in(run.run, name) for name in names}
    if "ee_rot" in models:
        # alike about all axes
        one = models["ee_rot"]
        models["ee_rot"] = replace(one, sigma=np.repeat(one.sigma, 3), ar=np.repeat(one.ar, 3, axis=0))
    plain = fed_back(run, voice.nominal)
    heard: list[dict[str, list[Vector]]] = []
    for _ in range(DRAWS):
        extra = {name: sample(models[name], len(run.run.t), random) for name in names}
        if run.told is not None:
            between = _between_rows(run.run, run.told, random)
            extra |= between | {"tau": extra["tau"] + between["tau"]}
        other = prepared(run.run, run.band, extra)
        changed = differences(other, voice.says(other))
        apart = {name: changed[name] - values[name] for name in values}
        parts = coefficients(run, apart, masks)
        drawn: dict[str, list[Vector]] = {
            name: [column**2 / DRAWS for column in columns] for name, columns in parts.items()
        }
        if plain is not None and (loud := fed_back(other, voice.nominal)) is not None:
            by_position, by_speed = (
                coefficients(run, {"u": there - here}, masks)["u"] for there, here in zip(loud, plain, strict=True)
            )
            heard.append(parts | {"by position": by_position, "by speed": by_speed})
        if "tau" in parts and "u" in parts:
            drawn["both"] = [a * b / DRAWS for a, b in zip(parts["tau"], parts["u"], strict=True)]
        for name, columns in drawn.items():
            before = total.get(name)
            total[name] = columns if before is None else [a + b for a, b in zip(before, columns, strict=True)]

    def level(power: Vector) -> Vector:
        span = max(3, int(2 * NEIGHBOURS * len(power)))
        return np.asarray(ndimage.uniform_filter1d(power, span, mode="nearest"))

    levels = {name: [level(power) for power in columns] for name, columns in total.items()}
    mix: dict[int, Vector] = {}
    for i, both in enumerate(levels.pop("both", [])):
        if masks["tau"][:, i].any():
            mix[i] = both / np.maximum(levels["tau"][i], 1e-300)
            levels["u"][i] = np.maximum(levels["u"][i] - mix[i] * both, 1e-4 * levels["u"][i])
    sigma = {
        name: [np.sqrt(np.maximum(power, 1e-30 + 1e-6 * float(power.max()))) for power in columns]
        for name, columns in levels.items()
    }
    asks = {i: _asked(voice, i, heard, sigma["u"][i], mix.get(i)) for i in range(run.run.n)} if heard else {}
    return sigma, mix, asks


def _asked(
    voice: Voice, i: int, heard: Sequence[Mapping[str, Sequence[Vector]]], sigma: Vector, mix: Vector | None
) -> Asked:
    """What a controller makes of a joint's noise, of coefficients that were drawn."""
    kp, kd = ((one or (1.0,) * voice.robot.n)[i] for one in (voice.robot.kp_factor, voice.robot.kd_factor))
    form = np.zeros((3, 3))
    for drawn in heard:
        place, rate, whole = (drawn[name][i] for name in ("by position", "by speed", "u"))
        whole = whole if mix is None else whole - mix * drawn["tau"][i]
        parts = np.stack([place, rate, whole - kp * place - kd * rate]) / sigma
        form += parts @ parts.T
    factors = np.array([kp, kd, 1.0])
    return Asked(form / max(float(factors @ form @ factors), 1e-300))


def _between_rows(run: Run, told: Told, random: np.random.Generator) -> dict[str, Vector]:
    """What a controller is told from one row of a record to the next and no row knows, drawn tick by tick.

    Returns:
        "q_told", "dq_told": What is told to it in rows less what it is told on the mean, of speeds for the part that is
        taken of them. "tau": What rows of torque have more than its mean.
    """
    signal: Any = import_module("scipy.signal")

    k, m = ticks_a_row(run), len(run.t)
    gains = {"q": run.control.kp, "dq": run.control.kd}
    parts = {"q": np.ones(run.n), "dq": np.maximum(told.taken, 1e-3)}
    out = {"tau": np.zeros((m, run.n))}
    for name, gain in gains.items():
        noise = noise_in(run, name)
        drawn = np.empty((m, k, run.n))
        for i, (sigma, ar) in enumerate(zip(noise.sigma, noise.ar, strict=True)):
            memory = max(next_alike(ar), 1e-12) ** (1.0 / k)
            white = random.normal(size=LEAD + m * k) * float(sigma) * np.sqrt(1.0 - memory**2)
            drawn[:, :, i] = np.asarray(signal.lfilter([1.0], [1.0, -memory], white))[LEAD:].reshape(m, k)
        row, mean = drawn[:, 0], drawn.mean(axis=1)
        out[f"{name}_told"] = row - mean / parts[name]
        out["tau"] -= np.where(told.joints, np.array(gain) * (row - mean), 0.0)
    return out


def sample(noise: ChannelNoise, m: int, random: np.random.Generator) -> Vector:
    """One sample of a channel's noise, shape (m, n)."""
    signal: Any = import_module("scipy.signal")

    columns: list[Vector] = []
    for sigma, ar in zip(noise.sigma, noise.ar, strict=True):
        white = random.normal(size=m + LEAD)
        coloured = np.asarray(signal.lfilter([1.0], np.concatenate([[1.0], -ar]), white)) if np.any(ar) else white
        # the gain of the filter at its stationary spread
        gain = _spread(ar)
        columns.append(coloured[LEAD:] * float(sigma) / gain)
    return np.column_stack(columns)


def _spread(ar: Vector) -> float:
    """Standard deviation of an autoregressive process driven by unit noise."""
    return float(np.linalg.norm(response_of(ar)))
