"""How many cycles a turn a wave could have: the highest peaks of the power of what is left over a joint's angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..representation import JointKind
from .problem import Problem
from .scales import Scales
from .waves import Angle, periodic

Vector = NDArray[np.float64]

CYCLES = 3
# cycles beside the strongest that are tried, and how far they are apart [1 / way]
BESIDE, APART = 4, 0.6
FINEST_CYCLES = 0.25
# the most of them: a turn (a gear of 100 and its motor's four), or as radians a metre (six a turn of a screw of 5 mm)
MOST_CYCLES: Mapping[JointKind, float] = {"revolute": 400.0, "prismatic": 8000.0}
# times the median power of all orders that a wave's is
STANDS_OUT = 8.0


def orders_of(problem: Problem, scales: Scales, at: int, *, second: bool) -> list[float]:
    """Cycles a turn at which the residual is periodic in the joint's angle, the strongest first."""
    i = at - 1
    way = scales.way[i]
    fastest = max(float(np.abs(run.dq[:, i]).max()) for run in problem.evidence.runs)
    band = min(run.band for run in problem.evidence.runs)
    highest = min(MOST_CYCLES[problem.database.joints[i].kind], 2.0 * np.pi * band / max(0.3 * fastest, 1e-9))
    finest = max(FINEST_CYCLES, 0.5 * np.pi / way)
    lowest = problem.fewest_cycles(at)
    if highest <= lowest:
        return []
    grid = np.arange(lowest, highest, finest)
    powers = [_periodic(problem, scales.residual, i, grid, itself=not second, second=second)]
    if second:
        # inertia takes a gear's error twice differentiated, weight as it is; and where an arm side's position was
        # measured, it stands there
        powers.append(_periodic(problem, scales.residual, i, grid, itself=True, second=True))
        powers.append(_periodic(problem, scales.turned, i, grid, itself=True, second=False))
    chosen: list[float] = []
    for power in sorted(powers, key=_clear, reverse=True):
        # of the clearest its highest, of the others what stands out most, unless a fit that begins there comes to it
        for cycles in _peaks(power, grid, way)[: 1 if chosen else CYCLES]:
            if all(abs(cycles - c) > np.pi / way for c in chosen):
                chosen.append(cycles)
    if not chosen:
        return []
    # a wave over this way is told from its neighbours so far apart, and what else is left moves the peak a little
    near = [chosen[0] + k * APART / way for k in range(-BESIDE, BESIDE + 1) if k]
    # of an error that comes twice a turn as well the second is the louder one, by the square of how often it comes
    once = [] if any(abs(0.5 * chosen[0] - c) * way < 0.5 * np.pi for c in chosen) else [0.5 * chosen[0]]
    return [*chosen, *(float(cycles) for cycles in (*once, *near) if cycles >= lowest)]


def _peaks(power: Vector, grid: Vector, way: float) -> list[float]:
    """Cycles of the highest peaks of a power that these runs tell apart, the highest first."""
    peaks: list[float] = []
    noise = STANDS_OUT * float(np.median(power))
    for k in np.argsort(-power):
        if power[k] <= noise or len(peaks) == CYCLES:
            # no more than the highest of so many of noise
            break
        if all(abs(grid[k] - c) > 2.0 * np.pi / way for c in peaks):
            peaks.append(float(grid[k]))
    return peaks


def _periodic(problem: Problem, left: Sequence[Vector], i: int, grid: Vector, *, itself: bool, second: bool) -> Vector:
    """Energy that a wave of each number of cycles a turn takes of what is left of every run (m, n) at joint i, (g,)."""
    angles: list[Angle] = []
    for run, values in zip(problem.evidence.runs, left, strict=True):
        # as many samples as the band needs
        every = max(1, int(1.0 / (8.0 * run.band * run.h)))
        angles.append(Angle(*(x[::every, i] for x in (run.q, run.dq, run.ddq, values))))
    return periodic(angles, grid, itself=itself, second=second)


def _clear(power: Vector) -> float:
    """How far the highest of powers stands out of all."""
    return float(power.max()) / max(float(np.median(power)), 1e-300)
