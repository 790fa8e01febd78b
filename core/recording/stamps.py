"""Faults of a record's rows: time that stands or runs back, rows written twice, gaps, stamps that jitter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import Problem, RunFileError
from .run import LeftOut

Vector = NDArray[np.float64]
Rows = NDArray[np.bool_]

# a step this many times the usual one means that rows are missing
GAP = 2.5
# stamps that scatter by more than this part of a step are told; clocks of whole microseconds stay below
JITTER = 0.02
# rows on either side that say how often a channel repeats a value by itself
_AROUND = 200
# how many rows of an honest record may be taken for copies
_BY_CHANCE = 1.0e-4


def rows_in_order(t: Vector, file: str) -> tuple[Rows, list[LeftOut]]:
    """Which rows of a file have a stamp of their own, shape (m,), and what the others are.

    Args:
        t: Stamps as the file has them [s], NaN where it has none.
        file: For messages.

    Raises:
        RunFileError: Time runs back, or there are fewer than two stamps.
    """
    stamped = np.isfinite(t)
    if stamped.sum() < 2:
        raise RunFileError((Problem(f"a run has two rows or more with a time, not {stamped.sum()}", file=file),))
    rows = np.flatnonzero(stamped)
    steps = np.diff(t[rows])
    if (steps < 0.0).any():
        at = int(np.argmax(steps < 0.0))
        later, earlier = float(t[rows[at + 1]]), float(t[rows[at]])
        message = f"time runs back in row {rows[at + 1] + 1}: {later!r} s after {earlier!r} s"
        # the header is the first line
        line = int(rows[at + 1]) + 2
        raise RunFileError((Problem(message, file=file, line=line, column="t", value=repr(float(t[rows[at + 1]]))),))
    start = float(t[rows[0]])
    left_out: list[LeftOut] = []
    if not stamped.all():
        lost = (_filled(t) - start)[~stamped]
        message = f"{len(lost)} rows have no time; they are left out"
        left_out.append(LeftOut("t", "not a number", float(lost.min()), float(lost.max()), len(lost), message))
    keep = stamped.copy()
    same = rows[1:][steps == 0.0]
    keep[same] = False
    if len(same):
        message = f"{len(same)} rows have the time of the row before them; they are left out"
        left_out.append(_over_all("t", "repeat", t[same] - start, message))
    return keep, left_out


def copied_rows(t: Vector, measured: Vector, positions: Vector) -> tuple[Rows, list[LeftOut]]:
    """Rows that repeat the one before them in every measured channel though the robot moved on, shape (m,).

    A resting robot repeats itself too, with coarse sensors for long. A row is taken for a copy where its channels,
    by how often each repeats its value in the rows around, would hardly ever do so all at once and positions go on
    in the same direction after it; or, of several equal rows in turn, where positions jump after them.

    Args:
        t: Times, growing [s], shape (m,).
        measured: All measured channels, shape (m, k).
        positions: Those of them that are positions, shape (m, p).
    """
    m = len(t)
    copied = np.zeros(m, dtype=bool)
    if measured.shape[1] == 0 or m < 8:
        return copied, []
    same = (measured[1:] == measured[:-1]) | (np.isnan(measured[1:]) & np.isnan(measured[:-1]))
    equal = np.concatenate([[False], same.all(axis=1)])
    starts = np.flatnonzero(equal & ~np.concatenate([[False], equal[:-1]]))
    ends = np.flatnonzero(equal & ~np.concatenate([equal[1:], [False]]))
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        if first < 2 or last + 2 > m - 1:
            continue
        before = positions[first - 1] - positions[first - 2]
        after = positions[last + 1] - positions[last]
        beyond = positions[last + 2] - positions[last + 1]
        onward = (before * after > 0.0) & (after * beyond > 0.0)
        if last - first < 2:
            near = np.r_[max(0, first - 1 - _AROUND) : first - 1, last : min(m - 1, last + _AROUND)]
            own = (same[near] & ~equal[near + 1, None]).sum(axis=0)
            chance = float(np.exp(np.log((own + 0.5) / (len(near) + 1.0)).sum()))
            copied[first : last + 1] = chance * m < _BY_CHANCE and bool(onward.any())
        else:
            # who rests sets out slowly: the first step is not the largest
            jump = np.abs(after) > 2.5 * np.maximum(np.abs(before), np.abs(beyond))
            copied[first : last + 1] = bool((jump & onward).any())
    if not copied.any():
        return copied, []
    message = f"{copied.sum()} rows repeat the row before them in every measured channel; they are left out"
    return copied, [_over_all("row", "repeat", t[copied], message)]


def uneven_steps(t: Vector) -> list[LeftOut]:
    """Gaps and jitter of stamps, growing [s], shape (m,). Nothing is left out for them, but it is told."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    left_out: list[LeftOut] = []
    # a clock that stutters as a rule has no gaps
    wide = steps > GAP * max(usual, float(np.quantile(steps, 0.95)) / 1.5)
    for at in np.flatnonzero(wide).tolist():
        missing = max(1, round(float(steps[at]) / usual) - 1)
        first, last = float(t[at]), float(t[at + 1])
        message = f"{missing} rows are missing between t = {first!r} s and {last!r} s"
        left_out.append(LeftOut("t", "gap", first, last, missing, message))
    # a row that was left out makes a step of twice the length; that is no jitter
    whole = np.maximum(1.0, np.round(steps[~wide] / usual))
    scatter = float(np.sqrt(np.mean((steps[~wide] - whole * usual) ** 2))) if (~wide).any() else 0.0
    if scatter > JITTER * usual:
        message = (
            f"steps of time scatter by {scatter!r} s about {usual!r} s (from {float(steps.min())!r} to "
            f"{float(steps.max())!r} s); no sample is left out"
        )
        left_out.append(LeftOut("t", "jitter", float(t[0]), float(t[-1]), 0, message))
    return left_out


def spans_of(bad: Rows) -> list[tuple[int, int]]:
    """First and last index of each stretch of True."""
    edges = np.diff(np.concatenate([[0], bad.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def _filled(t: Vector) -> Vector:
    """Times (m,) with those that are missing on straight lines between the others."""
    known = np.isfinite(t)
    return np.interp(np.arange(len(t)), np.flatnonzero(known), t[known])


def _over_all(channel: str, reason: str, t: Vector, message: str) -> LeftOut:
    return LeftOut(channel, reason, float(t[0]), float(t[-1]), len(t), message)
