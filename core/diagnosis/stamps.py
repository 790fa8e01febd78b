"""Stamps that are off: everything measured, or the torque alone, was recorded earlier or later than they say."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..recording import Run, steps_of
from ..recording.run import MEASURED
from ..representation import Robot
from .compared import mode_of, residuals
from .noise import Noise
from .resample import linear

Vector = NDArray[np.float64]

TORQUES = ("tau", "tau_link")
# signals whose shift can be told: those of the motion, and torques
TOLD = ("q", "tau", "ee", "q_link", "tau_link")
# a shift is told where it stands so many standard errors above none, and is so many samples long
CLEAR, SHORTEST = 5.0, 0.1
# channels that say the same shift agree to this part of it, or of a sample
AGREE = 0.25
# of a gap that only one sensor's word makes one of stamps, the part that a shift may leave
LEAVES = 0.1
# part of the gap of the channel of which it leaves least that a shift of parts of a sample may leave
STAYS = 0.9
# stamps that are further off than so many samples are no matter of counting
FURTHEST = 3.0
# further than so many samples from both of its neighbours nothing was measured
HOLE = 0.6
# a shift so near to whole samples is one of whole samples
WHOLE = 0.1
# for how many samples of a record an unknown controller holds a torque at most, and how finely that is told
LONGEST_HELD, FINE = 1.0, 0.04
# of one channel alone, to which a drag says nearly the same: so near to whole samples, where it leaves such a part
ALONE, MOST_LEFT = 0.02, 0.25


@dataclass(frozen=True, slots=True)
class _Told:
    """What one channel says.

    Attributes:
        signal, joint: Which channel.
        shift: By how much it comes later than simulated [s].
        error: Its standard error [s].
        before, after: Energy above noise without and with that shift taken out.
    """

    signal: str
    joint: int
    shift: float
    error: float
    before: float
    after: float


def shift_of(run: Run, robot: Robot, simulated: Mapping[str, Vector], noise: Noise) -> float:
    """By how much measured signals come later than simulated ones, if all channels say the same [s]; else 0.

    A delay of the drives is another thing: there the torque is late against the controller, while position, torque
    and tool were recorded at one instant, so that their shifts differ.
    """
    told = _told(run, robot, simulated, noise)
    joints = {one.joint for one in told if one.signal != "ee"}
    if len(joints) == 1 and not run.has("tau"):
        # the arm side, its torque and the tool go with the motor, whatever holds that back
        return next((_alone(one, run.rate) for one in told if one.signal == "q"), 0.0)
    if len(told) < 2 or (run.has("tau") and not any(one.signal == "tau" for one in told)):
        return 0.0
    return _common(told, run.rate)


def torque_shift_of(run: Run, robot: Robot, simulated: Mapping[str, Vector], noise: Noise) -> float:
    """By how much motor torques come later than simulated, if they all say the same and no position does [s]; else 0.

    A motion follows its torque. A torque that is recorded after the motion that it makes is no physics; one that is
    recorded before it may be that of a slow motor, and is none of stamps.
    """
    told = _told(run, robot, simulated, noise)
    common = _common([one for one in told if one.signal == "tau"], run.rate)
    still = all(abs(one.shift) < 0.5 * common for one in told if one.signal not in TORQUES)
    # what is not counted may be a filter's
    whole = common * run.rate >= 1.0 - WHOLE and abs(common * run.rate - round(common * run.rate)) < WHOLE
    return common if whole and still else 0.0


def unshifted(run: Run, shift: float, names: Collection[str] = MEASURED) -> Run:
    """The run with what was measured put back by a shift [s]; the command stays where it is.

    What would lie before the record, after it or in a gap of it is left out.
    """
    if not shift:
        return run
    signals, steps = dict(run.signals), dict(run.steps)
    at = run.t + shift
    after = np.clip(np.searchsorted(run.t, at), 1, len(run.t) - 1)
    near = np.minimum(np.abs(run.t[after] - at), np.abs(at - run.t[after - 1])) < HOLE / run.rate
    there = near & (at >= run.t[0]) & (at <= run.t[-1] + HOLE / run.rate)
    for name in (name for name in names if run.has(name)):
        signals[name] = np.where(there[:, None], linear(run.t, run.signals[name], run.t + shift), np.nan)
        steps[name] = steps_of(run, name)
    return replace(run, signals=signals, steps=steps)


@lru_cache(maxsize=32)
def with_held_torque(run: Run, samples: float) -> Run:
    """The run whose unknown controller holds its torque for so many samples; kept, for what is simulated of it is."""
    return replace(run, control=replace(run.control, held=samples / run.rate)) if samples else run


def held_said(run: Run, samples: float) -> str:
    """What to say of a torque that is held for so many samples by a controller that nobody knows."""
    late = 0.5 * samples
    return (
        f"The torque in {run.name} acts {_milliseconds(late / run.rate)} ({late:.2f} samples) later than it is "
        "recorded, as one that is held does; that is taken out and is no effect."
    )


def shift_said(run: Run, shift: float) -> str:
    """What to say of stamps that are off by a shift [s]; of one joint's positions alone that they may be right."""
    alone = run.n == 1 and shift > 0.0 and not run.has("tau")
    return (
        f"All that was measured in {run.name} comes {_long(run, shift)} its stamps; that is taken out and is no effect."
        + (" Viscous friction would hold its one joint back alike: only a torque could tell." if alone else "")
    )


def torque_shift_said(run: Run, shift: float) -> str:
    """What to say of a torque whose stamps are off by a shift [s]."""
    return (
        f"The torque in {run.name} comes {_long(run, shift)} the motion that it makes; "
        "that is a matter of stamps, is taken out and is no effect."
    )


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3f} ms"


def _long(run: Run, shift: float) -> str:
    return f"{_milliseconds(abs(shift))} ({abs(shift) * run.rate:.2f} samples) {'after' if shift > 0.0 else 'before'}"


def _told(run: Run, robot: Robot, simulated: Mapping[str, Vector], noise: Noise) -> list[_Told]:
    """What every channel says that could tell a tenth of a sample."""
    if mode_of(run) in ("torque", "unknown"):
        # their simulation begins from what was measured
        return []
    left, sigma = residuals(run, simulated, robot), noise.sigma
    told: list[_Told] = []
    for name in (name for name in TOLD if name in left):
        rates: Vector = np.asarray(np.gradient(simulated[name], run.t, axis=0))
        for i in range(simulated[name].shape[1]):
            good = np.isfinite(left[name][:, i])
            kept: Vector = rates[good, i]
            rate: Vector = kept - (float(kept.mean()) if good.any() else 0.0)
            power = float(np.sum(rate**2))
            one = float(sigma[name][i])
            error = one / np.sqrt(power) if power > 0.0 else np.inf
            if error * run.rate < SHORTEST / 2.0:
                here: Vector = left[name][good, i]
                shift = -float(rate @ here) / power
                before, after = (float(np.sum(x**2)) / one**2 - len(here) for x in (here, here + shift * rate))
                told.append(_Told(name, i, shift, float(error), before, after))
    return told


def _alone(one: _Told, rate: float) -> float:
    """The shift that the only channel says [s], where it is one of whole samples, as a drag's is by chance only."""
    samples = round(one.shift * rate)
    whole = samples != 0 and abs(one.shift * rate - samples) < ALONE and abs(one.shift) < FURTHEST / rate
    return samples / rate if whole and one.after < MOST_LEFT * one.before else 0.0


def _common(told: Sequence[_Told], rate: float) -> float:
    """The shift that all of these say [s], of whole samples where it is nearly so; 0 where they say none or several."""
    if not told:
        return 0.0
    # the arm side, its torque and the tool go with the motors; what these are asked for is another witness
    witnesses = {(one.signal == "tau", one.joint) for one in told if one.signal != "ee"}
    values, spread = np.array([one.shift for one in told]), np.array([one.error for one in told])
    common = float(np.median(values))
    error = float(1.0 / np.sqrt(np.sum(1.0 / spread**2)))
    clear = abs(common) > max(CLEAR * error, SHORTEST / rate) and abs(common) < FURTHEST / rate
    near = np.abs(values - common) < np.maximum(AGREE * max(abs(common), SHORTEST / rate), 4.0 * spread)
    # alone, what holds a joint back looks late as well
    all_of_it = sum(one.after for one in told) < LEAVES * sum(one.before for one in told)
    sure = len(witnesses) > 1 or all_of_it
    if not (clear and sure and near.all()):
        return 0.0
    samples = common * rate
    if round(samples) and abs(samples - round(samples)) < WHOLE:
        return round(samples) / rate
    # what is not counted and leaves the gap what it is holds back by chance as a shift would: a limit does, and of one
    # joint and its torque what makes both late
    less = len(witnesses) > 2 and any(one.before > 0.0 and one.after < STAYS * one.before for one in told)
    return common if less or all_of_it else 0.0
