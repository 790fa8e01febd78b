"""Motions that each show one thing of a robot: small experiments, all from rest at one posture back to rest there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..kinematics import reach
from ..representation import Robot
from .excitation import excitation
from .law import MotionLaw, from_table
from .quintic import PEAK_ACCELERATION, PEAK_SPEED, risen

Vector = NDArray[np.float64]

SPACING = 0.02
"""Time between knots [s], less where a motion is fast."""
SPEEDS = (0.03, 0.1, 0.3, 1.0)
"""Of a sweep at several speeds, as parts of the highest."""
SLOW = 0.06
"""Of a slow sweep, as part of the highest speed."""
FREQUENCIES = (1.0, 3.0, 7.0)
"""Of single sines [Hz]."""
SMALL = 0.35
"""Size of a sine's first half, as part of its second: what has a clearance tells them apart."""
BANDS = ((0.1, 1.0), (0.3, 3.0))
"""Of motions of all joints [Hz]."""
UNDERNEATH = (0.1, 0.5)
"""Of the slow motion of the others beneath a joint's own [Hz]."""
SEEDS = (0, 1)
POSES = 5
GROWTH = 1.0
"""Time in which a sine grows and dies away [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """What a motion may take.

    Attributes:
        centre: Where every motion begins and ends [rad or m], shape (n,).
        swing: Largest way from there, to either side.
        speed: Largest speed [rad/s or m/s].
        acceleration: Largest acceleration [rad/s^2 or m/s^2].
    """

    centre: Vector
    swing: Vector
    speed: Vector
    acceleration: Vector

    def smaller(self, by: float) -> Room:
        """The same with a part of the way."""
        return replace(self, swing=by * self.swing)


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """One small experiment.

    Attributes:
        words: What the robot does, as a clause: "joint 2 goes slowly to and fro".
        make: Its motion for a room and a duration [s].
    """

    words: str
    make: Callable[[Room, float], MotionLaw]


def probes(robot: Robot, joints: Sequence[int], highest: Sequence[float], *, tool: bool) -> Iterator[Probe]:
    """The library, for questions about some joints; the richest first.

    Args:
        robot: Who moves.
        joints: About which the question is, from 0.
        highest: Frequency up to which each joint can follow a sine [Hz], one of `joints` each.
        tool: The tool's position is measured: standing at several poses says something.
    """
    whole = "all joints move {} at once" if robot.n > 1 else "the joint moves {}"
    for (low, high), how in zip(BANDS, ("slowly", "quickly"), strict=True):
        for seed in SEEDS:
            motion = _together(robot, low, max(2.0 * low, min(high, *highest)), seed)
            yield Probe(f"{whole.format(how)} on sums of sines", motion)
    for j, limit in zip(joints, highest, strict=True):
        name = f"joint {j + 1}"
        yield Probe(f"{name} goes slowly to and fro", _of_joint(j, _slow))
        yield Probe(f"{name} goes to and fro at several constant speeds", _of_joint(j, _several))
        for f in FREQUENCIES:
            if f <= limit:
                yield Probe(f"{name} swings at {f:g} Hz, gently and then widely", _of_joint(j, _sine(f)))
        if robot.n > 1:
            yield Probe(
                f"{name} swings at {min(1.0, limit):.2g} Hz while the others carry it through many poses",
                _in_poses(robot, j, _sine(min(1.0, limit))),
            )
            yield Probe(
                f"{name} goes to and fro at several speeds while the others change its load",
                _in_poses(robot, j, _several),
            )
    if robot.n > 1:
        yield Probe("all joints go slowly to and fro, one after the other", _in_turn(robot.n))
    if tool:
        yield Probe(f"the robot stands at {POSES} poses", _stands(robot))


def units(robot: Robot) -> Vector:
    """What of a slide's way compares with a radian of a turning joint [m], 1 for these, shape (n,)."""
    size = reach(robot) / math.pi
    return np.array([1.0 if stage.joint.kind == "revolute" else size for stage in robot.stages])


def one_after_the_other(first: Probe, second: Probe) -> Probe:
    """Half of the time for each of two."""

    def make(room: Room, duration: float) -> MotionLaw:
        return _joined(first.make(room, 0.5 * duration), second.make(room, 0.5 * duration))

    return Probe(f"{first.words}, then {second.words}", make)


def stretched(law: MotionLaw, by: float) -> MotionLaw:
    """The same way in a longer time."""
    powers = np.arange(len(law.coefficients) - 1, -1, -1)
    return MotionLaw(law.knots * by, law.coefficients / by ** powers[:, None, None])


Profile = Callable[[float, float, float, float], tuple[Vector, Vector, Vector, Vector]]
"""(swing, speed, acceleration, duration) -> times and one joint's way from the centre with its two derivatives."""


def _of_joint(j: int, profile: Profile) -> Callable[[Room, float], MotionLaw]:
    """One joint moves, the others stand."""

    def make(room: Room, duration: float) -> MotionLaw:
        t, *way = profile(float(room.swing[j]), float(room.speed[j]), float(room.acceleration[j]), duration)
        q, dq, ddq = (np.zeros((len(t), len(room.centre))) for _ in range(3))
        for values, column in zip((q, dq, ddq), way, strict=True):
            values[:, j] = column
        return from_table(t, q + room.centre, dq, ddq)

    return make


def _in_turn(n: int) -> Callable[[Room, float], MotionLaw]:
    def make(room: Room, duration: float) -> MotionLaw:
        law = _of_joint(0, _slow)(room, duration / n)
        for j in range(1, n):
            law = _joined(law, _of_joint(j, _slow)(room, duration / n))
        return law

    return make


def _in_poses(robot: Robot, j: int, profile: Profile) -> Callable[[Room, float], MotionLaw]:
    """One joint as the profile has it, the others on slow sums of sines."""

    def make(room: Room, duration: float) -> MotionLaw:
        slow = _together(robot, *UNDERNEATH, SEEDS[0])(room, duration)
        own = _of_joint(j, profile)(room, duration)
        t = np.union1d(slow.knots, own.knots)
        # knots that rounding makes two of one
        t = t[np.concatenate([[True], np.diff(t) > 1e-6])]
        parts = [values.copy() for values in slow.at(t)]
        for values, column in zip(parts, own.at(t), strict=True):
            values[:, j] = column[:, j]
        return from_table(t, *parts)

    return make


def _together(robot: Robot, low: float, high: float, seed: int) -> Callable[[Room, float], MotionLaw]:
    def make(room: Room, duration: float) -> MotionLaw:
        unit = units(robot)
        stages = tuple(
            replace(stage, joint=replace(stage.joint, lower=c - s, upper=c + s, velocity=v, home=c))
            for stage, c, s, v in zip(
                robot.stages, room.centre.tolist(), room.swing.tolist(), room.speed.tolist(), strict=True
            )
        )
        try:
            return excitation(
                replace(robot, stages=stages),
                duration=duration,
                lowest=max(low, 1.0 / duration),
                highest=high,
                amplitude=float(np.max(room.swing / unit)),
                acceleration=float(np.min(room.acceleration / unit)),
                seed=seed,
            )
        except UsageError:
            # a time too short for one period
            return _of_joint(0, _slow)(room, duration)

    return make


def _stands(robot: Robot) -> Callable[[Room, float], MotionLaw]:
    """Rest to rest on quintics, half of the time at rest."""

    def make(room: Room, duration: float) -> MotionLaw:
        random = np.random.default_rng(SEEDS[0])
        places = [room.centre]
        places += [room.centre + room.swing * random.uniform(-1.0, 1.0, robot.n) for _ in range(POSES)]
        places.append(room.centre)
        knots, rows = [0.0], [room.centre]
        for before, after in pairwise(places):
            way = np.abs(after - before)
            needed = max(
                float(np.max(PEAK_SPEED * way / room.speed)),
                float(np.max(np.sqrt(PEAK_ACCELERATION * way / room.acceleration))),
            )
            knots += [knots[-1] + max(needed, 0.5 * duration / POSES)]
            rows += [after]
            knots += [knots[-1] + 0.5 * duration / POSES]
            rows += [after]
        still = np.zeros((len(rows), robot.n))
        return from_table(knots, np.array(rows), still, still)

    return make


def _joined(first: MotionLaw, second: MotionLaw) -> MotionLaw:
    """One law after the other; the second begins where the first ends, at rest."""
    order = max(len(first.coefficients), len(second.coefficients))
    parts = [np.pad(law.coefficients, ((order - len(law.coefficients), 0), (0, 0), (0, 0))) for law in (first, second)]
    knots = np.concatenate([first.knots, first.knots[-1] + (second.knots[1:] - second.knots[0])])
    return MotionLaw(knots, np.concatenate(parts, axis=1))


def _slow(swing: float, speed: float, acceleration: float, duration: float) -> tuple[Vector, Vector, Vector, Vector]:
    return _swept(swing, [SLOW * speed], acceleration, duration)


def _several(swing: float, speed: float, acceleration: float, duration: float) -> tuple[Vector, Vector, Vector, Vector]:
    return _swept(swing, [part * speed for part in SPEEDS], acceleration, duration)


def _swept(
    swing: float, speeds: Sequence[float], acceleration: float, duration: float
) -> tuple[Vector, Vector, Vector, Vector]:
    """To and fro at constant speeds, an equal time for each; speeds change on cubics of time."""
    t, x, dx = [0.0], [0.0], [0.0]
    time = duration / len(speeds)
    for speed in speeds:
        # to one side, to the other and back takes three ramps down and up
        ramp = 1.5 * speed / acceleration
        cycles = max(1, math.floor(time / (4.0 * (swing / speed + ramp)) + 1e-9))
        far = min(swing, max(speed * (0.25 * time / cycles - ramp), 0.25 * speed * time / cycles * 0.5))
        turns = [far if k % 2 == 0 else -far for k in range(2 * cycles)]
        for target in [*turns, 0.0]:
            _leg(t, x, dx, target, speed, acceleration)
    still = np.zeros(len(t))
    return np.array(t), np.array(x), np.array(dx), still


def _leg(t: list[float], x: list[float], dx: list[float], target: float, speed: float, acceleration: float) -> None:
    """From rest to rest: knots where a constant speed begins and ends. Cubics of speed are quintic pieces exactly."""
    way = target - x[-1]
    v = min(speed, math.sqrt(abs(way) * acceleration / 1.5))
    if v <= 0.0:
        return
    ramp = 1.5 * v / acceleration
    cruise = abs(way) / v - ramp
    side = math.copysign(1.0, way)
    steps = [(ramp, 0.5 * v * ramp, v), (ramp, 0.5 * v * ramp, 0.0)]
    if cruise > 1e-9:
        steps.insert(1, (cruise, v * cruise, v))
    for time, length, after in steps:
        t.append(t[-1] + time)
        x.append(x[-1] + side * length)
        dx.append(side * after)
    x[-1] = target


def _sine(frequency: float) -> Profile:
    def profile(
        swing: float, speed: float, acceleration: float, duration: float
    ) -> tuple[Vector, Vector, Vector, Vector]:
        w = 2.0 * math.pi * frequency
        ramp = min(GROWTH, 0.25 * duration)
        # a growing sine is a little faster than one that has grown
        faster = 1.0 + PEAK_SPEED / (w * ramp)
        size = min(swing, speed / (w * faster), acceleration / (w * w * faster**2))
        t = np.linspace(0.0, duration, 1 + math.ceil(duration / min(SPACING, 0.05 / frequency)))
        rise, middle, end = (risen((t - at) / ramp) for at in (0.0, 0.5 * duration, duration - ramp))
        scale = (1.0, 1.0 / ramp, 1.0 / ramp**2)
        e, de, dde = (
            size * s * (SMALL * a + (1.0 - SMALL) * b - c) for s, a, b, c in zip(scale, rise, middle, end, strict=True)
        )
        sine, cosine = np.sin(w * t), np.cos(w * t)
        return (
            t,
            e * sine,
            de * sine + w * e * cosine,
            dde * sine + 2.0 * w * de * cosine - w * w * e * sine,
        )

    return profile
