"""Bad samples of single channels: not a number, stuck, saturated.

A channel that keeps one value exactly is not stuck by that: robots rest, and coarse sensors keep a value for long.
Positions, speeds and poses are stuck where another channel, or the nominal robot, says that they should have moved, and
by more than the two part over as long a time anywhere else in the run. A torque, which no other channel tells as well,
is stuck where it keeps a value far longer than it does elsewhere while its joint moves; coarse ones are not judged.
Where the value is the run's largest or smallest it is called saturated. A drive that is cut at its limit is neither:
the robot then really gets no more, as the nominal robot shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..build import build
from ..kinematics import dynamics, kinematics
from .noise import bridged, quantisation
from .run import LeftOut, Run, Vector
from .stamps import spans_of

if TYPE_CHECKING:
    from ..database import Database

Rows = NDArray[np.bool_]

# samples of one value in turn from which it is looked at: stuck, and saturated
_STUCK, _SATURATED = 10, 5
# how many times further than anywhere else a channel and its reference part, or how many times longer one value stays
_PARTS = 3.0
# of the run's largest motion or speed: what is below it is rest
_REST = 0.05
# steps of a coarse sensor, and part of a torque's range, that a reference must move by
_STEPS, _RANGE = 5.0, 0.02
# fewer values than these in a whole run: too coarse a torque to be judged
_LEVELS = 20
# over which a position is smoothed to tell speeds and accelerations [s]
_SMOOTH = 0.03


def bad_samples(run: Run, left_out: Sequence[LeftOut], database: Database) -> Run:
    """The run with its bad samples NaN and named, after those that are known already."""
    shifted = {item.channel: item.samples for item in left_out if item.reason == "delay"}
    named = list(left_out)
    for signal, values in run.signals.items():
        named += _not_numbers(signal, values, run.t, shifted)
    # positions first: what the others should do is told by them
    for signal in ("q", "q_link", "dq", "tau", "tau_link", "ee", "ee_rot"):
        if run.has(signal):
            known = _References(run, database)
            found = [fault for columns in _channels(run, signal) for fault in _stretches(known, signal, columns)]
            named += [fault.named(run) for fault in found]
            values = run.signals[signal].copy()
            for fault in found:
                values[fault.rows, fault.columns] = np.nan
            run = replace(run, signals={**run.signals, signal: values})
    return replace(run, left_out=tuple(named))


def _channels(run: Run, signal: str) -> list[slice]:
    """Columns of a signal that belong together: a joint's, or the tool's."""
    count = run.signals[signal].shape[1]
    return [slice(0, count)] if signal.startswith("ee") else [slice(i, i + 1) for i in range(count)]


def _not_numbers(signal: str, values: Vector, t: Vector, shifted: dict[str, int]) -> Iterator[LeftOut]:
    bad = np.isnan(values)
    if signal in ("ee", "ee_rot"):
        missing = bad.any(axis=1) & ~bad.all(axis=0).any()
        columns = {signal: missing}
    else:
        columns = {f"{signal}_{i + 1}": bad[:, i] for i in range(values.shape[1])}
    for name, missing in columns.items():
        count = int(missing.sum()) - shifted.get(name, 0)
        # a joint without the channel is not a joint with a bad one
        if count > 0 and not missing.all():
            message = f"{count} samples of {name} are not numbers; they are left out"
            span = t[missing]
            yield LeftOut(name, "not a number", float(span[0]), float(span[-1]), count, message)


@dataclass(frozen=True, slots=True)
class _Fault:
    """A stretch of rows in which columns of a signal do not tell the truth."""

    signal: str
    columns: slice
    rows: slice
    reason: str

    def named(self, run: Run) -> LeftOut:
        """The same with times, and as a sentence."""
        pose = self.signal.startswith("ee")
        channel = self.signal if pose else f"{self.signal}_{self.columns.start + 1}"
        first, last = float(run.t[self.rows.start]), float(run.t[self.rows.stop - 1])
        count = self.rows.stop - self.rows.start
        value = "one value" if pose else repr(float(run.signals[self.signal][self.rows.start, self.columns.start]))
        why = "its largest or smallest, " if self.reason == "saturated" else ""
        message = (
            f"{channel} stays at {value}, {why}from t = {first!r} s to {last!r} s though the robot moves on; "
            f"{count} samples are left out"
        )
        return LeftOut(channel, self.reason, first, last, count, message)


def _stretches(known: _References, signal: str, columns: slice) -> Iterator[_Fault]:
    values = known.run.signals[signal][:, columns]
    there: Rows = np.asarray(np.isfinite(values).all(axis=1))
    same = np.concatenate([[False], (values[1:] == values[:-1]).all(axis=1)])
    spans = [(first - 1, last) for first, last in spans_of(same) if last - first + 2 >= _SATURATED]
    if not spans:
        return
    cut = _ends(values)
    suspects = [span for span in spans if span[1] - span[0] + 1 >= _STUCK or float(values[span[0], 0]) in cut]
    torque = signal.startswith("tau")
    if not suspects or (torque and 1 < len(np.unique(values[there])) < _LEVELS):
        return
    bad: list[tuple[int, int]] = []
    if torque:
        ends = [span for span in suspects if float(values[span[0], 0]) in cut]
        bad += _long_ones(known, columns.start, values[:, 0], [span for span in suspects if span not in ends])
        # that a torque and its model part says something at the ends of its range only, where a drive is cut too
        suspects = ends
    step = max(quantisation(column) for column in values.T)
    for reference in known.of(signal, columns, values):
        outside = there.copy()
        moving = [span for span in suspects if _spread_in(reference.moves, span) > _STEPS * step]
        for first, last in moving:
            outside[max(0, first - 1) : last + 2] = False
        bad += [span for span in moving if span not in bad and _parts(reference, outside, *span)]
    for first, last in sorted(bad):
        saturated = float(values[first, 0]) in cut
        # the first of equal values was measured; of cut ones none, nor of a sensor that never says another
        dead = last - first + 1 == int(there.sum())
        rows = slice(first if saturated or dead else first + 1, last + 1)
        yield _Fault(signal, columns, rows, "saturated" if saturated else "stuck")


def _ends(values: Vector) -> set[float]:
    """Largest and smallest value of a channel (m, 1); of a pose, or where there is one value only, none."""
    if values.shape[1] > 1:
        return set()
    ends = {float(np.nanmin(values)), float(np.nanmax(values))}
    return ends if len(ends) == 2 else set()


def _long_ones(
    known: _References, i: int, values: Vector, suspects: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """Stretches where a torque (m,) stays far longer than in any other while its joint moves and the model's does."""
    nominal, speed = known.torque(i), known.speeds(i)
    moving = speed > _REST * float(speed.max(initial=0.0))
    repeats = np.concatenate([[False], (values[1:] == values[:-1]) & moving[1:]])
    stays = np.array(spans_of(repeats)).reshape(-1, 2)
    lengths = stays[:, 1] - stays[:, 0] + 1
    amount = max(_RANGE * float(np.nanmax(values) - np.nanmin(values)), _STEPS * quantisation(values))
    for first, last in suspects:
        within = (stays[:, 0] >= first) & (stays[:, 1] <= last)
        length, longest = int(lengths[within].sum()), int(lengths[~within].max(initial=0))
        far = length >= _STUCK and length > _PARTS * longest
        if far and _spread_in(nominal[:, None], (first, last)) > amount:
            yield first, last


@dataclass(frozen=True, slots=True, eq=False)
class _Reference:
    """What a channel should do.

    Attributes:
        moves: What should be seen of the motion, shape (m, k).
        apart: The channel less that, shape (m, k).
        usual: How far it goes in this run, the joint that goes furthest.
    """

    moves: Vector
    apart: Vector
    usual: float


def _spread_in(values: Vector, span: tuple[int, int]) -> float:
    """How far columns (m, k) go within a stretch of rows."""
    part = values[span[0] : span[1] + 1]
    part = part[np.isfinite(part).all(axis=1)]
    return float(np.linalg.norm(np.ptp(part, axis=0))) if len(part) else 0.0


def _parts(reference: _Reference, outside: Rows, first: int, last: int) -> bool:
    """Whether a channel and its reference part in a stretch as they do nowhere else."""
    if last - first + 1 == len(outside):
        # nothing else to compare with: a sensor that says one thing all the time
        return _spread_in(reference.moves, (first, last)) > _REST * reference.usual
    length = min(last - first + 1, max(_STUCK, int(outside.sum()) // 4))
    moved = _spread(reference.moves[first : last + 1], length)
    moved = moved[np.isfinite(moved)]
    elsewhere = _spread(np.where(outside[:, None], reference.apart, np.nan), length)
    elsewhere = elsewhere[np.isfinite(elsewhere)]
    return len(moved) > 0 and len(elsewhere) > 0 and float(moved.max()) > _PARTS * float(elsewhere.max())


def _spread(values: Vector, length: int) -> Vector:
    """Largest less smallest value in every window of a length, the columns' as one vector, NaN where one is missing."""
    filters: Any = import_module("scipy.ndimage")
    if len(values) < length:
        return np.zeros(0)
    missing: Rows = np.asarray(~np.isfinite(values).all(axis=1))
    filled = np.where(missing[:, None], 0.0, values)
    options = {"size": length, "axis": 0, "mode": "nearest"}
    spread = np.linalg.norm(
        filters.maximum_filter1d(filled, **options) - filters.minimum_filter1d(filled, **options), axis=1
    )
    spread[filters.maximum_filter1d(missing.astype(np.int8), size=length, mode="nearest") > 0] = np.nan
    return spread[length // 2 : len(values) - (length - 1) // 2]


class _References:
    """What other channels and the nominal robot say of a channel; worked out when it is asked for."""

    def __init__(self, run: Run, database: Database) -> None:
        self.run = run
        self._database = database

    def of(self, signal: str, columns: slice, values: Vector) -> Iterator[_Reference]:
        """References of columns of a signal, whose values are (m, k)."""
        if signal in ("ee", "ee_rot"):
            yield self._tool(signal, values)
            return
        i = columns.start
        for all_joints in self._tellers(signal):
            if np.isfinite(all_joints[:, i]).any():
                moves = all_joints[:, [i]]
                if signal.startswith("tau"):
                    moves = self._with_friction(moves, values, i)
                spans = np.nanmax(all_joints, axis=0, initial=0.0) - np.nanmin(all_joints, axis=0, initial=0.0)
                yield _Reference(moves, values - moves, float(spans.max()))

    def _tellers(self, signal: str) -> Iterator[Vector]:
        """What tells how a signal should go, each of shape (m, n)."""
        signals = self.run.signals
        if signal.startswith("tau"):
            yield self._nominal_torque
        elif signal == "dq":
            yield self._motion[1]
        elif signal == "q_link":
            yield signals["q"]
        else:
            yield from (signals[other] for other in ("q_link", "q_cmd") if other in signals)
            if "dq" in signals:
                step = np.diff(self.run.t, prepend=self.run.t[0])
                yield np.cumsum(np.nan_to_num(signals["dq"]) * step[:, None], axis=0)

    def _with_friction(self, nominal: Vector, values: Vector, i: int) -> Vector:
        """The nominal torque (m, 1) with what fits the measured one best of gain, friction, rotor and offset."""
        _, dq, ddq = (part[:, i] for part in self._motion)
        fast = np.abs(dq) / max(float(np.abs(dq).max()), 1e-300)
        features = np.column_stack([nominal[:, 0], np.tanh(fast / 0.01) * np.sign(dq), dq, ddq, np.ones_like(dq)])
        changes = np.concatenate([[True], values[1:, 0] != values[:-1, 0]])
        good = np.isfinite(values[:, 0]) & np.isfinite(features).all(axis=1) & changes
        if good.sum() < 10 * features.shape[1]:
            return nominal
        weights = np.linalg.lstsq(features[good], values[good, 0], rcond=1e-9)[0]
        return (features @ weights)[:, None]

    def torque(self, i: int) -> Vector:
        """Torque of a joint (from 0) in the nominal robot at the measured motion, shape (m,)."""
        return self._nominal_torque[:, i]

    def speeds(self, i: int) -> Vector:
        """Speed of a joint (from 0) without its sign [rad/s or m/s], shape (m,)."""
        return np.abs(self._motion[1][:, i])

    @cached_property
    def _motion(self) -> tuple[Vector, Vector, Vector]:
        """Smoothed positions, speeds and accelerations, shapes (m, n)."""
        smooth: Any = import_module("scipy.signal").savgol_filter
        t, h = self.run.t, 1.0 / self.run.rate
        q = np.column_stack([bridged(column, t) for column in self.run.signals["q"].T])
        window = max(5, 2 * round(0.5 * _SMOOTH / h) + 1)
        if len(q) <= window:
            return q, np.zeros_like(q), np.zeros_like(q)
        q, dq, ddq = (np.asarray(smooth(q, window, 3, deriv=order, delta=h, axis=0)) for order in range(3))
        return q, dq, ddq

    @cached_property
    def _nominal_torque(self) -> Vector:
        torque = dynamics(build(self._database, effects=())).inverse_dynamics(*self._motion)
        lost = np.isnan(self.run.signals["q"]).any(axis=1)
        width = max(2, round(_SMOOTH * self.run.rate))
        torque[np.convolve(lost, np.ones(2 * width + 1))[width:-width] > 0.5] = np.nan
        return torque

    def _tool(self, signal: str, values: Vector) -> _Reference:
        from scipy.spatial.transform import Rotation

        pose = kinematics(build(self._database, effects=())).tool_in_base(self._motion[0])
        if signal == "ee":
            reach = float(np.linalg.norm(np.ptp(pose[:, :3, 3], axis=0)))
            return _Reference(pose[:, :3, 3], values - pose[:, :3, 3], reach)
        nominal = Rotation.from_matrix(pose[:, :3, :3])
        whole: Rows = np.asarray(np.isfinite(values).all(axis=1))
        measured = Rotation.from_quat(np.roll(np.where(whole[:, None], values, [1.0, 0.0, 0.0, 0.0]), -1, axis=1))
        apart = (measured * nominal.inv()).as_rotvec()
        apart[~whole] = np.nan
        turned = (nominal * nominal[0].inv()).as_rotvec()
        return _Reference(turned, apart, float(np.linalg.norm(np.ptp(turned, axis=0))))
