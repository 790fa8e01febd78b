"""Figure 13: the joints' rotations controlled by torque (closed loop), in every engine, with and without "Memory"."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..build import build
from ..control import Control
from ..kinematics import dynamics
from ..motion import MotionLaw
from ..representation import Robot
from ..simulation import Trace
from ..simulation.settle import settled
from .case import FREQUENCY, LEVEL, TICK, Case
from .memory import late_feedback
from .modes import Mode, loop_growth, loop_modes, nearest
from .open_loop import CALM, OpenLoop, apart, of_high_order, rms
from .peaks import Peak, pairs_of, peaks_of
from .ringing import ringing
from .statics import sagged_tip

Array = NDArray[np.float64]

LONGER_STEPS = (2, 5)
"""Communication steps of the comparison, in ticks, beside one."""
OTHER_FREQUENCIES = (5.0, 20.0)
"""Gains of the comparison [Hz]."""
NEGLIGIBLE_DUMMY = 0.02
"""Dummy part that is near what the paper has."""
OTHER_DUMMY = 0.3
"""Dummy part of the comparison: fraction of the arm's diagonal mass-matrix entry."""
OPEN = "open loop"
# a run is searched for the shift in time that fits it best, so far [s], and so finely
FURTHEST, FINENESS = 0.03, 1.0e-9
ITERATIONS = 50


@dataclass(frozen=True, slots=True, eq=False)
class Late:
    """What late feedback does to a run: a delay of a communication step.

    Attributes:
        late: How old the feedback is [s].
        shift: How much earlier the whole path is, by least squares [s].
        peaks: How much earlier each peak across an edge is [s].
        heights: How much higher each peak is [m].
    """

    late: float
    shift: float
    peaks: tuple[float, ...]
    heights: tuple[float, ...]

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "late_s": self.late,
            "path_earlier_s": self.shift,
            "peaks_compared": len(self.peaks),
            "peaks_earlier_s": {
                "mean": float(np.mean(self.peaks)) if self.peaks else None,
                "share_earlier": float(np.mean(np.array(self.peaks) > 0.0)) if self.peaks else None,
                "least": min(self.peaks, default=None),
                "most": max(self.peaks, default=None),
            },
            "peaks_higher_m": {
                "mean": float(np.mean(self.heights)) if self.heights else None,
                "largest": max((abs(height) for height in self.heights), default=None),
            },
        }


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """One choice that the paper leaves open, made otherwise.

    Attributes:
        what: In words.
        oscillation: Root of the mean square of the tip's distance from where it would rest [m].
        in_plane: Largest distance from the command in the level plane [m].
    """

    what: str
    oscillation: float
    in_plane: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {"what": self.what, "oscillation_m": self.oscillation, "in_plane_m": self.in_plane}


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLoop:
    """What the control makes of the path.

    Attributes:
        t: Times [s], shape (m,).
        moving: Those of them at which the command moves, shape (m,).
        command, resting: As in `OpenLoop`, shape (m, 3).
        control: The controller.
        tips: Backend -> its tip without Memory, shape (m, 3).
        memory_tips: The same with feedback that is one communication step late.
        peaks: Backend -> the peaks of its tip across the edges.
        memory: Backend -> what Memory does to it.
        on_torque: The same delay on the torque instead of on the feedback, in the reference engine.
        longer: Longer communication steps, along the first key, one step included.
        choices: Along the first key: the open loop, the choice made, and what the paper leaves open chosen otherwise.
        negligible: Growth from tick to tick of the loop whose dummy parts are near the paper's.
        measured: Oscillations of the last standstill, without and with Memory.
        predicted: The eigenvalues' that are nearest to them.
    """

    t: Array
    moving: NDArray[np.bool_]
    command: Array
    resting: Array
    control: Control
    tips: Mapping[str, Array]
    memory_tips: Mapping[str, Array]
    peaks: Mapping[str, tuple[Peak, ...]]
    memory: Mapping[str, Late]
    on_torque: Late
    longer: tuple[Late, ...]
    choices: tuple[Choice, ...]
    negligible: float
    measured: tuple[tuple[Mode, ...], tuple[Mode, ...]]
    predicted: tuple[tuple[Mode, ...], tuple[Mode, ...]]

    @property
    def tip(self) -> Array:
        """The reference engine's tip, shape (m, 3)."""
        return next(iter(self.tips.values()))

    def agreement_on_peaks(self) -> dict[str, dict[str, Any]]:
        """Backend -> how far its peaks are from the reference engine's: number, largest height and times."""
        names = list(self.peaks)
        first = self.peaks[names[0]]
        found: dict[str, dict[str, Any]] = {}
        for name in names[1:]:
            pairs = pairs_of(first, self.peaks[name])
            found[name] = {
                "peaks": len(pairs),
                "of": len(first),
                "height_m": max((abs(a.height - b.height) for a, b in pairs), default=None),
                "relative": max((abs(a.height - b.height) / abs(a.height) for a, b in pairs), default=None),
                "time_s": max((abs(a.t - b.t) for a, b in pairs), default=None),
            }
        return found

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        off = (self.tip - self.command)[self.moving]
        level = np.linalg.norm(off[:, :2], axis=1)
        heights = [abs(peak.height) for peak in next(iter(self.peaks.values()))]
        return {
            "control": self.control.to_mapping(),
            "communication_step_s": TICK,
            "in_plane_m": {"rms": rms(level), "largest": float(np.max(level))},
            "shift_z_m": {
                "mean": float(np.mean(off[:, 2])),
                "least": float(np.min(off[:, 2])),
                "most": float(np.max(off[:, 2])),
            },
            "oscillation_m": rms(np.linalg.norm((self.tip - self.resting)[self.moving], axis=1)),
            "peaks": {"number": len(heights), "highest_m": max(heights, default=None)},
            "agreement_on_peaks": self.agreement_on_peaks(),
            "engines_apart_m": apart(self.tips),
            "engines_of_high_order_apart_m": apart(of_high_order(self.tips)),
            "memory": {name: late.to_json() for name, late in self.memory.items()},
            "delay_on_torque": self.on_torque.to_json(),
            "longer_steps": [late.to_json() for late in self.longer],
            "choices": [choice.to_json() for choice in self.choices],
            "negligible_dummy": {"fraction": NEGLIGIBLE_DUMMY, "growth_per_tick": self.negligible},
            "ringing": {
                name: {
                    "measured": [mode.to_json() for mode in self.measured[k]],
                    "eigenvalues": [mode.to_json() for mode in self.predicted[k]],
                }
                for k, name in enumerate(("without_memory", "with_memory"))
            },
        }


def closed_loop(case: Case, open_loop: OpenLoop) -> ClosedLoop:
    """Figure 13 in all engines."""
    robot, control = case.compliant, case.control()
    late_robot, early = late_feedback(robot, case.motion, TICK)
    plain: dict[str, Trace] = {}
    memory: dict[str, Trace] = {}
    for name in case.backends:
        plain[name] = case.run("figure 13", robot, name, case.motion, control)
    for name in case.backends:
        memory[name] = case.run("figure 13, Memory", late_robot, name, early, control)
    first, corners = case.reference, case.corners
    places = case.command(corners)
    without, key = plain[first], case.first_key()
    key_corners = corners[corners <= key.duration]
    delayed = case.run("delay on the torque", late_robot, first, key, control, duration=key.duration)
    seen = [_modes(case, trace, control, late) for late, trace in enumerate((without, memory[first]))]
    return ClosedLoop(
        t=without.t,
        moving=open_loop.moving,
        command=open_loop.command,
        resting=open_loop.resting,
        control=control,
        tips={name: trace.tip for name, trace in plain.items()},
        memory_tips={name: trace.tip for name, trace in memory.items()},
        peaks={name: peaks_of(trace.t, trace.tip, corners, places) for name, trace in plain.items()},
        memory={name: _compared(TICK, plain[name], memory[name], corners, places) for name in case.backends},
        on_torque=_compared(TICK, without, delayed, key_corners, places),
        longer=tuple(_longer_steps(case, key, without, memory[first], control)),
        choices=tuple(_choices(case, key, without, open_loop)),
        negligible=_negligible(case),
        measured=(seen[0][0], seen[1][0]),
        predicted=(seen[0][1], seen[1][1]),
    )


def _compared(late: float, base: Trace, other: Trace, corners: Array, places: Array) -> Late:
    """What made a run earlier than another along the edges between some corners."""
    one, two = (peaks_of(trace.t, trace.tip, corners, places[: len(corners)]) for trace in (base, other))
    pairs = pairs_of(one, two)
    return Late(
        late,
        _earlier(base, other, float(corners[-1])),
        tuple(a.t - b.t for a, b in pairs),
        tuple(abs(b.height) - abs(a.height) for a, b in pairs),
    )


def _earlier(base: Trace, other: Trace, end: float) -> float:
    """The shift in time s [s] for which base.tip(t + s) fits other.tip(t) best, by Gauss and Newton."""
    from scipy.interpolate import CubicSpline

    path = CubicSpline(base.t, base.tip)
    inner = (other.t >= FURTHEST) & (other.t <= end - FURTHEST)
    t, tip, shift = other.t[inner], other.tip[inner], 0.0
    for _ in range(ITERATIONS):
        speed = np.asarray(path(t + shift, 1), dtype=np.float64)
        change = float(np.sum(speed * (tip - path(t + shift))) / np.sum(speed * speed))
        shift = float(np.clip(shift + change, -FURTHEST, FURTHEST))
        if abs(change) < FINENESS:
            break
    return shift


def _modes(case: Case, trace: Trace, control: Control, late: int) -> tuple[tuple[Mode, ...], tuple[Mode, ...]]:
    """Oscillations seen once the command stands, and the eigenvalues' that are nearest."""
    robot = case.compliant
    still = trace.t > case.motion.duration + CALM
    command = case.motion.at(case.motion.duration)[0]
    arms = dynamics(robot)
    rest, motors = settled(robot, arms, command, np.array(control.kp), arms.gravity(command))
    off = np.hstack([trace.joints["q_link"][still] - rest, trace.joints["q"][still] - motors])
    measured = ringing(trace.t[still], off)
    eigen = loop_modes(robot, rest, control, late)
    return measured, tuple(nearest(eigen, mode) for mode in measured)


def _longer_steps(case: Case, key: MotionLaw, without: Trace, memory: Trace, control: Control) -> Iterator[Late]:
    """One communication step and longer ones, along the first key."""
    corners = case.corners[case.corners <= key.duration]
    places = case.command(corners)
    yield _compared(TICK, without, memory, corners, places)
    for ticks in LONGER_STEPS:
        late = ticks * TICK
        robot, early = late_feedback(case.compliant, key, late)
        what = f"Memory of {ticks} steps"
        trace = case.run(what, robot, case.reference, early, control, duration=key.duration)
        yield _compared(late, without, trace, corners, places)


def _choices(case: Case, key: MotionLaw, without: Trace, open_loop: OpenLoop) -> Iterator[Choice]:
    """No control, the choice made, and others, along the first key."""
    yield _choice(case, key, OPEN, open_loop.t, open_loop.tip)
    fraction = case.database.dummy_inertia
    yield _choice(case, key, f"as run here: {FREQUENCY!r} Hz, dummy parts of {fraction!r}", without.t, without.tip)
    for frequency in OTHER_FREQUENCIES:
        control = case.control(frequency=frequency)
        what = f"gains of {frequency!r} Hz"
        trace = case.run(what, case.compliant, case.reference, key, control, duration=key.duration)
        yield _choice(case, key, what, trace.t, trace.tip)
    lighter = _with_dummy(case, OTHER_DUMMY)
    what = f"dummy parts of {OTHER_DUMMY!r}"
    trace = case.run(what, lighter, case.reference, key, case.control(lighter), duration=key.duration)
    yield _choice(case, key, what, trace.t, trace.tip)


def _with_dummy(case: Case, fraction: float) -> Robot:
    return build(replace(case.database, dummy_inertia=fraction), LEVEL)


def _negligible(case: Case) -> float:
    robot = _with_dummy(case, NEGLIGIBLE_DUMMY)
    return loop_growth(robot, case.motion.at(case.motion.duration)[0], case.control(robot))


def _choice(case: Case, key: MotionLaw, what: str, t: Array, tip: Array) -> Choice:
    along = t <= key.duration
    t, tip = t[along], tip[along]
    away = tip - sagged_tip(case.compliant, key.at(t)[0])
    off = (tip - case.command(t))[:, :2]
    return Choice(what, rms(np.linalg.norm(away, axis=1)), float(np.max(np.linalg.norm(off, axis=1))))
