"""Excitation: a band-limited motion of all joints at once that shows what a robot's numbers are."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..kinematics import reach
from ..representation import Robot
from .law import MotionLaw, from_table
from .quintic import risen

Array = NDArray[np.float64]

DURATION = 10.0
LOWEST, HIGHEST = 0.1, 1.0
"""Band of the harmonics [Hz]."""
AMPLITUDE = 0.6
"""Largest way from the centre [rad]; slides take the same part of the reach over pi."""
SPEED, ACCELERATION = 1.5, 8.0
"""Limits where the joint states none [rad/s, rad/s^2]; for slides as above."""
SHARE = 0.9
"""Part of every limit that is used."""
RAMP = 1.0
"""Time in which the motion grows from rest, and dies away [s]."""
KNOT_SPACING = 0.02


def excitation(
    robot: Robot,
    *,
    duration: float = DURATION,
    lowest: float = LOWEST,
    highest: float = HIGHEST,
    amplitude: float = AMPLITUDE,
    acceleration: float = ACCELERATION,
    seed: int = 0,
) -> MotionLaw:
    """Sums of sines with random phases (Swevers et al., 1997), from rest at home back to rest at home.

    q = home + w(t) (centre - home + A x(t)): x has the harmonics of the duration between two frequencies, the first
    strongest in position, all alike in speed; w grows from 0 to 1 and back on quintics, so that speed and
    acceleration are zero at both ends. As w blends two positions within the limits, what lies between is within them
    too. A is the largest that keeps SHARE of the limits of position, speed and acceleration.

    Args:
        robot: Whose limits are kept.
        duration: [s].
        lowest: Lower end of the band [Hz].
        highest: Upper end of the band [Hz].
        amplitude: Largest way from the centre [rad].
        acceleration: Limit of acceleration [rad/s^2]; joints state none.
        seed: Of the phases.

    Raises:
        UsageError: No harmonic lies in the band, or a number is not above 0.
    """
    if not all(value > 0.0 and math.isfinite(value) for value in (duration, highest, amplitude, acceleration)):
        raise UsageError("excitation: duration, frequencies, amplitude and acceleration must be above 0.")
    first, last = math.ceil(lowest * duration - 1.0e-9), math.floor(highest * duration + 1.0e-9)
    harmonics = np.arange(max(first, 1), last + 1)
    if len(harmonics) == 0:
        raise UsageError(
            f"excitation: {duration!r} s hold no whole period between {lowest!r} and {highest!r} Hz; "
            f"take {1.0 / highest!r} s or longer."
        )
    spacing = min(KNOT_SPACING, 0.02 / highest)
    count = max(8, math.ceil(duration / spacing))
    t = np.linspace(0.0, duration, count + 1)
    rng = np.random.default_rng(seed)
    blend = _blend(t, min(RAMP, duration / 3.0), duration)
    size = reach(robot) / math.pi
    columns: list[tuple[Array, Array, Array]] = []
    for stage in robot.stages:
        joint = stage.joint
        unit = 1.0 if joint.kind == "revolute" else size
        wave = _wave(t, harmonics, duration, rng)
        speed = SHARE * (joint.velocity if math.isfinite(joint.velocity) else SPEED * unit)
        bounds = (speed, SHARE * acceleration * unit)
        # where the limits leave less room than wanted, the centre moves away from the nearer one
        swing = min(amplitude * unit, 0.5 * SHARE * (joint.upper - joint.lower))
        margin = swing / SHARE
        way = min(max(joint.home, joint.lower + margin), joint.upper - margin) - joint.home
        # ... but not so far that getting there takes more than half of what speed and acceleration are allowed
        furthest = 0.5 * min(bound / float(np.max(np.abs(part))) for bound, part in zip(bounds, blend[1:], strict=True))
        way = min(max(way, -furthest), furthest)
        room = min(joint.home + way - joint.lower, joint.upper - joint.home - way)
        columns.append(_blended(wave, blend, joint.home, way, min(swing, SHARE * room), bounds))
    q, dq, ddq = (np.column_stack(parts) for parts in zip(*columns, strict=True))
    return from_table(t, q, dq, ddq)


def _wave(t: Array, harmonics: NDArray[np.int64], duration: float, rng: np.random.Generator) -> tuple[Array, ...]:
    """A sum of sines between -1 and 1 and its two derivatives, each of shape (m,)."""
    w = 2.0 * np.pi * harmonics / duration
    phase = rng.uniform(0.0, 2.0 * np.pi, size=len(w))
    angle = t[:, None] * w + phase
    a = np.array(1.0 / w, dtype=np.float64)
    x, dx, ddx = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w * w)
    peak = float(np.max(np.abs(x)))
    return x / peak, dx / peak, ddx / peak


def _blend(t: Array, ramp: float, duration: float) -> tuple[Array, Array, Array]:
    """From 0 to 1 in a ramp, and back to 0 in the last one; value and two derivatives, each of shape (m,)."""
    up, down = np.clip(t / ramp, 0.0, 1.0), np.clip((duration - t) / ramp, 0.0, 1.0)
    u = np.minimum(up, down)
    sign = np.where(up < down, 1.0, -1.0)
    value, slope, bend = risen(u)
    return value, sign * slope / ramp, bend / ramp**2


def _blended(
    wave: tuple[Array, ...],
    blend: tuple[Array, Array, Array],
    home: float,
    way: float,
    swing: float,
    bounds: tuple[float, float],
) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration of one joint, each of shape (m,), the swing reduced to keep the bounds."""
    (x, dx, ddx), (w, dw, ddw) = wave, blend
    moved = (w * x, dw * x + w * dx, ddw * x + 2.0 * dw * dx + w * ddx)
    for bound, part, derivative in zip(bounds, (dw, ddw), moved[1:], strict=True):
        # |way part + swing derivative| <= bound, whichever their signs
        fast = np.abs(derivative) > 1.0e-12
        swing = min(swing, float(np.min((bound - np.abs(way * part[fast])) / np.abs(derivative[fast]))))
    return home + way * w + swing * moved[0], way * dw + swing * moved[1], way * ddw + swing * moved[2]
