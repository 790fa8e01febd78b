"""Energy that waves of an angle take, against least squares in which each run has a mean of its own."""

from __future__ import annotations

import numpy as np
import pytest

from mbexport.core.diagnosis.waves import Angle, periodic

RATE = 100.0


def turning(seed: int, count: int = 900) -> Angle:
    """A joint that goes to and fro, and noise with a wave of 31 cycles a turn in it."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) / RATE
    speeds, phases = rng.uniform(0.5, 3.0, 3), rng.uniform(0.0, 6.0, 3)
    q = np.sum([0.4 * np.sin(w * t + p) for w, p in zip(speeds, phases, strict=True)], axis=0)
    dq = np.sum([0.4 * w * np.cos(w * t + p) for w, p in zip(speeds, phases, strict=True)], axis=0)
    ddq = np.sum([-0.4 * w**2 * np.sin(w * t + p) for w, p in zip(speeds, phases, strict=True)], axis=0)
    left = 3.0 + rng.normal(size=count) + 0.5 * np.sin(31.0 * q + 0.3)
    return Angle(q, dq, ddq, left)


def taken(angles: list[Angle], cycles: float, *, itself: bool, second: bool) -> float:
    """What least squares takes, by differences of what is left; the second derivative is one of differences, too."""
    blocks, rest = [], []
    for q, dq, ddq, left in angles:
        columns = []
        if itself:
            columns += [np.cos(cycles * q), np.sin(cycles * q)]
        if second:
            h = 1e-4

            def along(by, q=q, dq=dq, ddq=ddq):
                return cycles * (q + by * dq + 0.5 * by**2 * ddq)

            columns += [(f(along(h)) - 2.0 * f(along(0.0)) + f(along(-h))) / h**2 for f in (np.cos, np.sin)]
        table = np.column_stack(columns)
        blocks.append(table - table.mean(axis=0))
        rest.append(left - left.mean())
    table, values = np.concatenate(blocks), np.concatenate(rest)
    found = np.linalg.lstsq(table, values, rcond=None)[0]
    return float(values @ values - np.sum((values - table @ found) ** 2))


@pytest.mark.parametrize(("itself", "second"), [(True, False), (False, True), (True, True)])
def test_what_waves_take_is_what_least_squares_says(itself, second):
    angles = [turning(1), turning(2, 700)]
    grid = np.arange(20.0, 40.0, 1.0)
    power = periodic(angles, grid, itself=itself, second=second)
    expected = [taken(angles, cycles, itself=itself, second=second) for cycles in grid]
    # each half of a wave is held by a hundredth of itself, which costs up to two hundredths of what it takes
    assert power == pytest.approx(expected, rel=0.03, abs=0.02 * max(expected))
    if itself:
        assert grid[int(np.argmax(power))] == 31.0


def test_a_run_with_nothing_left_says_nothing():
    silent = turning(1)._replace(left=np.zeros(900))
    grid = np.arange(20.0, 40.0, 1.0)
    one = periodic([turning(2)], grid, itself=True, second=False)
    assert periodic([silent, turning(2)], grid, itself=True, second=False) == pytest.approx(one)
