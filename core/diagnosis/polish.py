"""The last step of a fit: numbers brought into line with the simulation itself, on the runs that were fitted.

Inverse dynamics along a smoothed motion says which effects there are, and their numbers to a few parts in a hundred.
A simulation knows holds, ticks and a loop's own answer exactly; from where the numbers are it is nearly linear in them,
so that one Gauss-Newton step is enough. Only in a delay it is not: a record made at ticks jumps where a delay becomes
another whole number of them, and so several are tried before. What rings faster than a smoothed motion shows seems to
be damped there: less damping is tried, too. And a play's impacts, which smoothing takes away, say how wide it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..database import Database
from ..effects import EffectRow
from ..errors import MbexportError, RefusedError
from ..recording import Run
from ..representation import Robot
from .blocks import BLOCK
from .compared import compared, mode_of, residuals
from .model import Rows, merged, robot_of, tables
from .noise import noise_floor, tolerance_changes, tolerance_times
from .problem import Problem
from .refine import MOST_TICKS, Refined, at_least, bounds_of, tick_of
from .resample import linear
from .resimulate import each_simulated, resimulated, resimulated_once, steps_of

Vector = NDArray[np.float64]

# rounds of it, and where the numbers are so far off that simulated they help nothing
ROUNDS, ROUNDS_FROM_AFAR = 1, 4
# simulations that are worth it, a round, and where there may be many rounds; along a given motion they take little
MOST_SIMULATIONS, MOST_FROM_AFAR, MOST_ALONG = 40, 25, 160
# steps of an engine that are, a round: a bearing that hardly gives would take minutes
MOST_STEPS = 1.0e6
# and all that are tried to close a gap
MOST_CLOSING_STEPS = 5.0e6
# what the evidence along the motion knows holds a number this many of its standard deviations loosely, or from afar
LOOSE, LOOSER = 10.0, 100.0
# what springs' damping may be, as parts of what the smoothed motion says
RINGS = (1.0, 0.1, 0.01)
DAMPING = {
    "joint_compliance": ("damping",),
    "joint_compliance_6d": ("bx", "by", "bz", "brx", "bry", "brz"),
    "link_flexibility": ("bu", "bv"),
}
# how wide a play may be, as parts of what the smoothed motion says, which is no nearer than these are to each other;
# and how much nearer to the best of them others are tried, one step after the other
WIDTHS = (0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2)
NEARER = (0.025, 0.0125, 0.006)
PLAY = ("backlash", "gap")
# how many times as many steps as without it an engine may need for a cause that is tried
STIFFER = 4.0
# how many times as much of a cause there may be as the measured motion has it, for which it tells little of it
MOST_OF_IT = 3.0
# of a step that overshoots
PARTS = (1.0, 0.5, 0.25)
# numbers are moved by their standard deviation to see what changes, within these parts of their size
LEAST_STEP, LARGEST_STEP = 1.0e-3, 0.05
# slopes hold for numbers up to so many of these steps away, or as far as one standard deviation, within which nothing
# tells one number from another
NEAR = 3.0
# which is at least this, or what no run shows would be held by a weight beyond all numbers
LEAST_SIZE = 1.0e-9


class KnownSlopes:
    """What runs' residuals change by with numbers, of fits to some of the runs each, which hardly differ."""

    def __init__(self) -> None:
        """Nothing known."""
        self._known: dict[tuple[Run, Sequence[tuple[str, int, str]]], tuple[Vector, Vector]] = {}

    def of(
        self, run: Run, free: Sequence[tuple[str, int, str]], x: Vector, near: Vector, make: Callable[[], Vector]
    ) -> Vector:
        """A run's slopes at numbers x (k,), shape (m, channels, k): those at numbers as near as that (k,), or made."""
        key = run, tuple(free)
        known = self._known.get(key)
        if known is None or np.any(np.abs(x - known[0]) > near):
            known = self._known[key] = x.copy(), make()
        return known[1]

    def there(self, run: Run, free: Sequence[tuple[str, int, str]]) -> Vector | None:
        """A run's slopes with numbers, shape (m, channels, k); None where none were taken."""
        known = self._known.get((run, tuple(free)))
        return None if known is None else known[1]


def unsure(database: Database, level: str, runs: Sequence[Run], fit: Refined, known: KnownSlopes) -> dict[str, Vector]:
    """Mean square that the uncertainty of a fit's numbers makes in each channel of a run like those that were fitted.

    Args:
        database: The robot's.
        level: Of the nominal model.
        runs: That were fitted.
        fit: Its numbers, with their covariance.
        known: What these runs change by with them.

    Returns:
        Signal -> (n,), SI; {} where no slopes are known.
    """
    squares: dict[str, list[Vector]] = {}
    for run in runs:
        slopes = known.there(run, fit.free)
        if slopes is None:
            return {}
        sensor, first = noise_floor(database, level, run).sensor, 0
        each = np.einsum("mck,kl,mcl->c", slopes, fit.covariance, slopes, optimize=True) / len(slopes)
        for name in sorted(compared(run, robot_of(database, level, run))):
            last = first + len(sensor[name])
            squares.setdefault(name, []).append(each[first:last] * np.square(sensor[name]))
            first = last
    return {name: np.mean(some, axis=0) for name, some in squares.items()}


def polished(
    problem: Problem,
    level: str,
    runs: Sequence[Run],
    fit: Refined,
    backend: str,
    *,
    far: bool = False,
    known: KnownSlopes | None = None,
) -> Refined | None:
    """A fit with its numbers from simulation; None where that takes too long, cannot be, or gains nothing.

    What the database's tolerances may do is taken out, as along the measured motion.

    Args:
        problem: The question, of these runs.
        level: Of the nominal model.
        runs: That were fitted.
        fit: Along their measured motion.
        backend: The engine.
        far: The numbers are expected to be far off.
        known: Slopes of other fits of the same numbers, and of this one.

    Returns:
        The fit with other rows, and intervals that are wide enough for how the simulation's residual scatters.
    """
    along = all(mode_of(run) in ("motion", "unknown") for run in runs)
    most = MOST_ALONG if along else MOST_FROM_AFAR if far else MOST_SIMULATIONS
    each = len(fit.free) + 2
    if not fit.free or each * len(runs) > most or any(run.locked for run in runs):
        return None
    try:
        robots = [robot_of(problem.database, level, run, tables(fit.rows)) for run in runs]
        if each * sum(steps_of(robot, run, backend) for robot, run in zip(robots, runs, strict=True)) > MOST_STEPS:
            return None
    except MbexportError:
        return None
    along_motion, sigma = _numbers(fit)
    start = along_motion
    loose = _Loose.of([_tolerances(problem.database, level, run, tables(fit.rows)) for run in runs])

    def left_of(run: Run, x: Vector) -> Vector:
        return simulated_left(problem.database, level, run, tables(rows_at(fit, x)), backend, resimulated)

    def moved(run: Run, x: Vector) -> Vector:
        # what a slope takes is asked for once, and must not push out what is asked for again
        return simulated_left(problem.database, level, run, tables(rows_at(fit, x)), backend, resimulated_once)

    def left(x: Vector) -> list[Vector]:
        return each_simulated(lambda run: left_of(run, x), runs, backend)

    def energy(x: Vector) -> float:
        return loose.energy(left(x))

    def cost(values: Sequence[Vector], x: Vector) -> float:
        return loose.energy(values) + float(np.sum((weight * (x - start)) ** 2))

    late = next((k for k, (effect, _, _) in enumerate(fit.free) if effect == "delay"), None)
    # where numbers go far, or what is recorded jumps with them, each round has slopes of its own
    memory = known if known and late is None and not far else KnownSlopes()
    rounds, parts = (ROUNDS, PARTS[:1]) if late is None and not far else (ROUNDS_FROM_AFAR, PARTS)
    try:
        before = energy(start)
        start = _wide(fit, _ringing(fit, start, energy), energy)
        step = _step(start, sigma)
        near = np.maximum(NEAR * step, sigma)
        weight = 1.0 / np.maximum((LOOSER if far else LOOSE) * sigma, 1e-3 * step)
        if late is not None:
            tick = tick_of(problem)
            ticks = _right_tick(lambda at: energy(_with(start, late, tick * at)), start[late] / tick)
            start, weight = _with(start, late, tick * ticks), _with(weight, late, 1.0 / tick)
        # what is recorded jumps where a delay is a whole number of ticks
        limits = _limits(problem, fit, start)
        x, now = start, left(start)
        slopes: list[Vector] = []
        for _ in range(rounds):
            slopes = [
                memory.of(run, fit.free, x, near, partial(_slopes, partial(moved, run), one, x, step, limits, backend))
                for run, one in zip(runs, now, strict=True)
            ]
            normal, gradient = _normal(loose, now, slopes, weight, x - start)
            way: Vector = np.asarray(-np.linalg.solve(normal, gradient), dtype=float)
            better = _better(left, cost, cost(now, x), x, way, limits, parts)
            if better is None:
                break
            x, now = better
    except RefusedError:
        return None
    if cost(now, x) >= before:
        return None
    scatter = _scatter(loose, now, slopes, runs, weight)
    # where impacts are is sudden: two ways to a width are as far apart as either may be from the truth
    scatter = np.maximum(scatter, np.where(_plays(fit), np.square(x - along_motion), 0.0))
    rows = problem.rounded_out(rows_at(fit, x))
    return replace(fit, rows=rows, covariance=at_least(fit.covariance, scatter))


def closing(
    problem: Problem, level: str, runs: Sequence[Run], fit: Refined, options: Sequence[Rows], backend: str
) -> tuple[float, list[float]]:
    """Sum of squares above noise that a fit leaves simulated, and what it would leave with each of some options.

    The fit's numbers and how much there is of an option give way to each other, as far as they are linear; what the
    database's tolerances may do is taken out. Infinity where there can be no such robot, and where an engine
    refuses the option or would take far longer, as for what hardly gives and closes nothing.

    Args:
        problem: The question, of these runs.
        level: Of the nominal model.
        runs: To simulate.
        fit: What was found, along their measured motion.
        options: Rows of one cause more each.
        backend: The engine.

    Raises:
        RefusedError: The engine refuses the robot without an option, or would take far too long for all of them.
    """
    rows = tables(fit.rows)
    loose = _Loose.of([_tolerances(problem.database, level, run, rows) for run in runs])
    count = sum(
        int(np.isfinite(values).sum())
        for run in runs
        for values in compared(run, robot_of(problem.database, level, run)).values()
    )
    start, sigma = _numbers(fit)
    step = _step(start, sigma)
    limits = _limits(problem, fit, start)

    def left_of(run: Run, x: Vector) -> Vector:
        return simulated_left(problem.database, level, run, tables(rows_at(fit, x)), backend, resimulated_once)

    def steps(effects: Rows) -> float:
        return sum(steps_of(robot_of(problem.database, level, run, effects), run, backend) for run in runs)

    each = steps(rows)
    if (1 + len(start) + len(options)) * each > MOST_CLOSING_STEPS:
        raise RefusedError(f"what closes the gap would take {each:.1g} steps to try, each: nobody awaits it.")
    most = STIFFER * each
    now = [simulated_left(problem.database, level, run, rows, backend, resimulated) for run in runs]
    own = [
        _slopes(partial(left_of, run), one, start, step, limits, backend) for run, one in zip(runs, now, strict=True)
    ]

    def energy(option: Rows) -> float:
        try:
            if steps(merged(rows, option)) > most:
                raise RefusedError("it would take too long")
            there = [
                simulated_left(problem.database, level, run, merged(rows, option), backend, resimulated_once)
                for run in runs
            ]
        except MbexportError:
            # nor may a body be so light
            return math.inf
        slopes = [
            np.concatenate([slope, (values - before)[:, :, None]], axis=2)
            for slope, values, before in zip(own, there, now, strict=True)
        ]
        weight = np.append(1.0 / (LOOSER * np.maximum(sigma, LEAST_SIZE)), 1.0 / MOST_OF_IT)
        normal, gradient = _normal(loose, now, slopes, weight, np.zeros(len(weight)))
        x = np.linalg.solve(normal, gradient)
        # the step's own gain, less what numbers would have to move from where they are
        return min(loose.energy(there), loose.energy(now) - float(gradient @ x)) - count

    return loose.energy(now) - count, each_simulated(energy, options, backend)


def _ringing(fit: Refined, x: Vector, energy: Callable[[Vector], float]) -> Vector:
    """Numbers with as much of their springs' damping as leaves least energy."""
    damped = np.array([name in DAMPING.get(effect, ()) for effect, _, name in fit.free])
    return min((np.where(damped, part * x, x) for part in RINGS), key=energy) if damped.any() else x


def _plays(fit: Refined) -> NDArray[np.bool_]:
    """Which of a fit's numbers are widths of play, shape (k,)."""
    return np.array([(effect, name) == PLAY for effect, _, name in fit.free], dtype=bool)


def _wide(fit: Refined, x: Vector, energy: Callable[[Vector], float]) -> Vector:
    """Numbers with each play as wide as leaves least energy."""
    for k in np.flatnonzero(_plays(fit)).tolist():
        tried = [(energy(there), there) for there in (_with(x, k, part * x[k]) for part in WIDTHS)]
        least, x = min(tried, key=lambda one: one[0])
        for part in NEARER:
            for there in (_with(x, k, (1.0 - part) * x[k]), _with(x, k, (1.0 + part) * x[k])):
                if (left := energy(there)) < least:
                    least, x = left, there
    return x


def _right_tick(energy: Callable[[float], float], ticks: float) -> float:
    """The middle of the tick that leaves least energy of a delay, from that where it is on, all in ticks."""
    energy = cache(energy)
    here = math.floor(ticks) + 0.5
    for way in (1.0, -1.0):
        while 0.0 < here + way <= ticks + MOST_TICKS and energy(here + way) < energy(here):
            here += way
    return here


def _with(x: Vector, k: int, value: float) -> Vector:
    """Numbers with another one."""
    out = x.copy()
    out[k] = value
    return out


def _better(
    left: Callable[[Vector], list[Vector]],
    cost: Callable[[Sequence[Vector], Vector], float],
    least: float,
    x: Vector,
    way: Vector,
    limits: Vector,
    parts: Sequence[float],
) -> tuple[Vector, list[Vector]] | None:
    """Numbers on the way of a step that cost less, and what they leave; None where none do."""
    for part in parts:
        there = np.minimum(np.maximum(x + part * way, limits[:, 0]), limits[:, 1])
        trial = left(there)
        if cost(trial, there) < least:
            return there, trial
    return None


def _numbers(fit: Refined) -> tuple[Vector, Vector]:
    """A fit's numbers and their standard deviations along the motion, shape (k,)."""
    sigma = np.sqrt(np.maximum(np.diagonal(fit.covariance), 0.0))
    return np.array([fit.rows[effect, at].values[name] for effect, at, name in fit.free]), sigma


def _step(start: Vector, sigma: Vector) -> Vector:
    """By how much numbers are moved to see what changes, shape (k,)."""
    size = np.maximum(np.maximum(np.abs(start), sigma), LEAST_SIZE)
    return np.minimum(np.maximum(sigma, LEAST_STEP * size), LARGEST_STEP * size)


def _limits(problem: Problem, fit: Refined, start: Vector) -> Vector:
    """Between what numbers stay, shape (k, 2)."""
    within = [bounds_of(problem, *key, value) for key, value in zip(fit.free, start.tolist(), strict=True)]
    return np.array(within, dtype=float).reshape(-1, 2)


def _normal(
    loose: _Loose, now: Sequence[Vector], slopes: Sequence[Vector], weight: Vector, moved: Vector
) -> tuple[Vector, Vector]:
    """Normal matrix (k, k) and gradient (k,) of what is left where numbers are held by a weight and moved already."""
    normal, gradient = np.diag(weight**2), weight**2 * moved
    for part, slope, free in zip(now, slopes, loose.without(slopes), strict=True):
        normal = normal + np.einsum("mck,mcl->kl", slope, free)
        gradient = gradient + np.einsum("mck,mc->k", free, part)
    return normal, gradient


def rows_at(fit: Refined, x: Vector) -> dict[tuple[str, int], EffectRow]:
    """The fit's rows with other numbers."""
    values = {key: dict(row.values) for key, row in fit.rows.items()}
    for (effect, at, name), value in zip(fit.free, x.tolist(), strict=True):
        values[effect, at][name] = value
    return {key: EffectRow(key[1], one) for key, one in values.items()}


def simulated_left(
    database: Database,
    level: str,
    run: Run,
    effects: Rows,
    backend: str,
    simulated: Callable[[Robot, Robot, Run, str], Mapping[str, Vector]] = resimulated_once,
) -> Vector:
    """Measured minus simulated of a run in units of noise, 0 where nothing was measured, shape (m, channels)."""
    robot = robot_of(database, level, run, effects)
    apart = residuals(run, simulated(robot, robot_of(database, level, run), run, backend), robot)
    sigma = noise_floor(database, level, run).sensor
    return np.column_stack([np.nan_to_num(apart[name] / np.maximum(sigma[name], 1e-300)) for name in sorted(apart)])


def _slopes(
    left: Callable[[Vector], Vector], now: Vector, x: Vector, step: Vector, limits: Vector, backend: str
) -> Vector:
    """Change of what is left of a run (m, channels) with each number, shape (m, channels, k)."""

    def slope(k: int) -> Vector:
        moved = _with(x, k, float(x[k] + (step[k] if x[k] + step[k] <= limits[k, 1] else -step[k])))
        return (left(moved) - now) / float(moved[k] - x[k])

    each = each_simulated(slope, range(len(x)), backend)
    return np.stack(each, axis=-1) if each else np.zeros((*now.shape, 0))


@dataclass(frozen=True, slots=True, eq=False)
class _Loose:
    """What the database's numbers may be off by, as directions in what is left.

    Attributes:
        columns: Of each run, what one standard deviation of each does, in units of noise, shape (m, channels, p).
        inner: (1 + A^T A)^-1 of all of them, shape (p, p).
    """

    columns: Sequence[Vector]
    inner: Vector

    @staticmethod
    def of(columns: Sequence[Vector]) -> _Loose:
        gram = np.sum([np.einsum("mcp,mcq->pq", one, one) for one in columns], axis=0)
        return _Loose(columns, np.asarray(np.linalg.inv(np.eye(len(gram)) + gram), dtype=np.float64))

    def along(self, values: Sequence[Vector]) -> Vector:
        """What of residuals (m, channels) or slopes (m, channels, k) lies along them, shape (p,) or (p, k)."""
        found = [
            np.tensordot(one, value, axes=((0, 1), (0, 1))) for one, value in zip(self.columns, values, strict=True)
        ]
        return np.sum(found, axis=0)

    def without(self, values: Sequence[Vector]) -> list[Vector]:
        """Residuals or slopes without what they may have put there: (1 + A A^T)^-1 of it."""
        taken = self.inner @ self.along(values)
        return [value - one @ taken for one, value in zip(self.columns, values, strict=True)]

    def energy(self, values: Sequence[Vector]) -> float:
        """Sum of squares of residuals that they make least, with their own."""
        along = self.along(values)
        return sum(float(np.sum(value**2)) for value in values) - float(along @ self.inner @ along)


def _tolerances(database: Database, level: str, run: Run, effects: Rows) -> Vector:
    """What one standard deviation of each of the database's numbers changes, as what is left has it, (m, channels, p).

    Of the robot with what was found: what is off by a part changes what a tilt or a payload makes of it.
    """
    robot = robot_of(database, level, run, effects)
    changes = tolerance_changes(robot, database.tolerance, run)
    sigma = noise_floor(database, level, run).sensor
    times = tolerance_times(run)
    columns: list[Vector] = []
    for name, measured in sorted(compared(run, robot).items()):
        there: NDArray[np.bool_] = np.isfinite(measured)
        if name == "ee_rot":
            there = np.repeat(there.all(axis=1, keepdims=True), 3, axis=1)
        change = changes.get(name, np.zeros((0, len(times), there.shape[1])))
        at = np.stack([linear(times, one, run.t) for one in change], axis=-1) if len(change) else None
        part = np.zeros((*there.shape, 0)) if at is None else at
        columns.append(part * there[:, :, None] / np.maximum(sigma[name], 1e-300)[:, None])
    return np.concatenate(columns, axis=1)


def _scatter(
    loose: _Loose, left: Sequence[Vector], slopes: Sequence[Vector], runs: Sequence[Run], weight: Vector
) -> Vector:
    """Variance of each number by how blocks of time pull at it, and by tolerances, shape (k,).

    Sandwich of Huber (1967), blocks as Newey and West (1987); few blocks as Cameron and Miller (2015), by Student's t.
    """
    stats: Any = import_module("scipy.stats")
    normal = np.diag(weight**2)
    pulls: list[Vector] = []
    for part, slope, beside, run in zip(loose.without(left), slopes, loose.without(slopes), runs, strict=True):
        normal = normal + np.einsum("mck,mcl->kl", slope, beside)
        count = max(1, round((run.duration - run.since) / BLOCK))
        for rows in np.array_split(np.flatnonzero(run.judged), count):
            pulls.append(np.einsum("mck,mc->k", beside[rows], part[rows]))
    gathered = np.array(pulls)
    shared = loose.inner @ loose.along(slopes)
    spread = gathered.T @ gathered * len(pulls) / max(1, len(pulls) - 1) + shared.T @ shared
    inverse = np.linalg.inv(normal)
    few = float(stats.t.ppf(0.975, max(1, len(pulls) - 1)) / stats.norm.ppf(0.975))
    return few**2 * np.diagonal(inverse @ spread @ inverse)
