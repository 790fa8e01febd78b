"""All numbers of all findings fitted together, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from .beyond import DROOP, RANGES, SECOND_PHASE
from .fit import Part, spread
from .model import Rows, tables
from .nuisances import Whitening
from .plain import Plain
from .problem import Problem
from .slopes import Sloped, differences

if TYPE_CHECKING:
    from .found import Found

Vector = NDArray[np.float64]

# numbers that only a form of the effect has, or that no run shows
_HELD = {"hysteresis": ("slips",), "backlash": ("damping",)}
# numbers that are fitted even where they are what they are by default
_ALWAYS = {"base_tilt": ("roll", "pitch"), "controller_gain": ("kp", "kd"), "link_flexibility": ("at",)}
# numbers that say how an effect goes, not how much of it there is
SHAPES = ("phase", "cycles", "velocity", "rest", "slips", "at", *(name for name in RANGES if name != DROOP))
_EVALUATIONS = 25
# change of the sum of squares, or of the numbers, from which a fit has come to its end
ROUGHLY, CLOSELY = 1.0e-4, 1.0e-6
# factors on what a drive is said to do, and how far from 1 they may be
_FACTORS = (("controller_gain", "kp"), ("controller_gain", "kd"), ("torque_constant", "gain"))
MOST_TIMES = 20.0
# what both gains together, or what they make of noise, come to at least
LEAST_GAIN = MOST_TIMES**-2
# of the speed below which a joint counts as standing: the least speed that friction can be told to vanish with
SLOWEST = 2.0
# and the largest, as part of the fastest that the joint goes
FASTEST = 0.5
# part of a tick at either end of it that a delay keeps from
EDGE = 0.005
# and where it begins in the next; how far it goes so, as long as so much of the sum of squares goes each time
BEYOND, MOST_TICKS, BETTER = 0.1, 5, 2.0
_ON_TIME = EffectRow(0, {"time": 0.0})
# part of an arm's mass that may be too much
LIGHTEST = 0.9
# part of an arm's length on the shorter side of its bend
SHORTEST_PART = 0.05
# numbers that a turn leaves what they are, beside phases
ANGLES = {"base_tilt": ("roll", "pitch"), "kinematic_error": ("alpha", "theta", "beta")}
BEARING = "joint_compliance_6d"
PLAY = "backlash"
# how wide play may be, as parts of what a fit came to
ABOUT: tuple[float, ...] = tuple(np.geomspace(0.9, 1.1, 11).tolist())
# what a bearing's direction must add to the log evidence not to be rigid
GIVES = 1.0
# one standard deviation of a number that no run shows, in its size
TIMES = 3.0
# how strongly a number stays where it began, in noise by its size: next to nothing beside what a run says of it, and
# enough where none does, or rounding would take it anywhere
STAYS = 1.0e-3
# part of what is usual of a number that is least for its size: one that begins at nothing would stay there
LITTLE = 0.01
# of what is known of a number the part that the runs must say
RESOLVED = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """A joint fit.

    Attributes:
        rows: (effect, at) -> its row.
        left: What is left, whitened, in units of noise.
        free: (effect, at, column) of each number that was fitted.
        covariance: Of these numbers, SI, shape (k, k).
        slope: Change of what is left with them, shape (N, k).
        shown: Which of them the runs show; the others are what is plain (the diagonal of the resolution matrix, Backus
            and Gilbert 1968, above RESOLVED).
    """

    rows: Mapping[tuple[str, int], EffectRow]
    left: Vector
    free: tuple[tuple[str, int, str], ...]
    covariance: Vector
    slope: Vector
    shown: tuple[bool, ...]

    def numbers_of(self, key: tuple[str, int]) -> list[int]:
        """Places of a finding's numbers, by its effect and the number of its place."""
        return [k for k, (effect, at, _) in enumerate(self.free) if (effect, at) == key]


@dataclass(frozen=True, slots=True, eq=False)
class Removal:
    """A fit with one finding taken out, by its covariance.

    Attributes:
        loss: Log evidence that goes with it.
        rows: The others, moved to where they then fit best.
    """

    loss: float
    rows: Mapping[tuple[str, int], EffectRow]


def removal(fit: Refined, key: tuple[str, int], absent: EffectRow) -> Removal:
    """What a joint fit becomes without one finding, as far as it is linear.

    Args:
        fit: With it.
        key: Effect and number of its place.
        absent: Its row where it is as if it were not there.
    """
    own = fit.numbers_of(key)
    other = [k for k in range(len(fit.free)) if k not in own]
    change = _gone(fit, key, absent, own)
    weight = _precision(fit, own) @ change
    moved = fit.covariance[np.ix_(other, own)] @ weight
    values = {place: dict(one.values) for place, one in fit.rows.items() if place != key}
    for k, step in zip(other, moved.tolist(), strict=True):
        effect, at, name = fit.free[k]
        low, high = range_of(effect, name)
        values[effect, at][name] = min(max(values[effect, at][name] + step, low), high)
    rows = {place: EffectRow(place[1], one) for place, one in values.items()}
    return Removal(0.5 * float(change @ weight), rows)


def _gone(fit: Refined, key: tuple[str, int], absent: EffectRow, own: Sequence[int]) -> Vector:
    """What becomes of a finding's own numbers where it goes: how it went stays, for none of it goes in any way."""
    values, names = fit.rows[key].values, [fit.free[k][2] for k in own]
    return np.array([0.0 if name in SHAPES else absent.values.get(name, 0.0) - values[name] for name in names])


def covariance_of(information: Vector) -> Vector:
    """Inverse of an information matrix (k, k), whatever its units: no number is known from others but for rounding.

    Plainly inverted, numbers that only their sum is known of come out with variances below 0.
    """
    size = np.sqrt(np.diagonal(information))
    known, axes = np.linalg.eigh(information / np.outer(size, size))
    least = len(known) * np.finfo(float).eps * np.max(known, initial=0.0)
    return np.asarray((axes / np.maximum(known, least)) @ axes.T / np.outer(size, size), dtype=np.float64)


def at_least(covariance: Vector, variance: Vector) -> Vector:
    """A covariance (k, k) whose variances are at least these (k,); what goes together goes on to."""
    own = np.maximum(np.diagonal(covariance), 1e-300)
    more = np.sqrt(np.maximum(variance / own, 1.0))
    return covariance * np.outer(more, more)


def taken_up(fit: Refined, change: Vector, sigma: Vector) -> Vector:
    """How far a fit's numbers go to say what else changes what is left, by least squares along the runs, shape (k, c).

    By the runs themselves: a covariance that was widened since would pull numbers that go together apart. Numbers that
    no run shows stay where they are.

    Args:
        fit: Its numbers.
        change: Of what is left, a column each, shape (N, c).
        sigma: Spread by which it is judged, shape (N,).
    """
    shown = np.flatnonzero(fit.shown)
    moved = np.zeros((len(fit.free), change.shape[1]))
    moved[shown] = np.linalg.lstsq(fit.slope[:, shown] / sigma[:, None], change / sigma[:, None], rcond=None)[0]
    return moved


def _precision(fit: Refined, own: Sequence[int]) -> Vector:
    """Inverse of the covariance of some numbers, whatever their units."""
    covariance = fit.covariance[np.ix_(own, own)]
    size = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
    inverse = np.linalg.pinv(covariance / np.outer(size, size), hermitian=True)
    return np.asarray(inverse / np.outer(size, size), dtype=np.float64)


def vanished(fit: Refined, item: Found) -> bool:
    """Whether the 95 % interval of every amount, as the finding goes, holds what it is where there is none of it."""
    absent = _ON_TIME if item.effect == "delay" else item.absent
    own = fit.numbers_of(item.key)
    # what no run shows may be anything, and so may be what shows with it alone
    amounts = [j for j, k in enumerate(own) if fit.free[k][2] not in SHAPES and fit.shown[k]]
    if absent is None or not amounts:
        return False
    # a spring may be soft and far away or hard and near: its torque is known far better than both
    known = np.linalg.pinv(_precision(fit, own)[np.ix_(amounts, amounts)], hermitian=True)
    away = _gone(fit, item.key, absent, own)[amounts]
    return bool(np.all(np.abs(away) <= 1.96 * np.sqrt(np.maximum(np.diagonal(known), 0.0))))


def free_columns(effect: str, row: EffectRow) -> list[str]:
    """Which of a row's numbers are there to be fitted: those that differ from what they are by default.

    And those without which the others would be wrong: where an arm bends is known as little as how much.
    """
    columns = effect_named(effect).columns
    held, always = _HELD.get(effect, ()), _ALWAYS.get(effect, ())
    beyond = [name for name in RANGES if row.values.get(name, 0.0)]
    return beyond + [
        c.name
        for c in columns
        if c.name not in held
        and np.isfinite(row.values[c.name])
        and (c.default is None or c.name in always or row.values[c.name] != c.default)
    ]


def refined(problem: Problem, whiten: Whitening, found: Sequence[Found], parts: Sequence[Part]) -> Refined:
    """Fit all numbers of these findings, from where they are; a delay may go on to the next tick."""
    best = _within(problem, whiten, found, parts)
    late = next((item for item in found if item.effect == "delay"), None)
    for _ in range(MOST_TICKS):
        there = _beyond(problem, best.rows[late.key]) if late else None
        if there is None:
            break
        moved = [replace(item, row=there if item is late else best.rows[item.key]) for item in found]
        other = _within(problem, whiten, moved, parts)
        if best.left @ best.left - other.left @ other.left < BETTER:
            break
        best = other
    rows = stiffened(problem, whiten, best.rows, parts)
    if any(rows[key] is not row for key, row in best.rows.items()):
        best = _within(problem, whiten, [replace(item, row=rows[item.key]) for item in found], parts)
    whole = problem.rounded_out(best.rows)
    if whole is best.rows or all(whole[key] is row for key, row in best.rows.items()):
        return best
    return replace(best, rows=whole, left=left_with(problem, whiten, tables(whole)))


def as_wide(row: EffectRow, part: float) -> EffectRow:
    """Play so many times as wide."""
    return EffectRow(row.at, {**row.values, "gap": row.values["gap"] * part})


def widths_about(row: EffectRow) -> list[EffectRow]:
    """Play a little narrower and wider: of an arm that bounces no motion tells the width exactly."""
    return [as_wide(row, part) for part in ABOUT]


def at_its_width(
    problem: Problem, whiten: Whitening, found: Sequence[Found], fit: Refined, parts: Sequence[Part], at: int
) -> Refined:
    """The fit with play at a joint as wide as leaves least of some widths about its own, where that leaves less.

    What leads down to the truth is a narrow well where arms bounce.
    """
    key = PLAY, at
    row = fit.rows[key]
    widths = widths_about(row)
    left = [left_with(problem, whiten, tables({**fit.rows, key: width})) for width in widths]
    energies = [float(one @ one) for one in left]
    best = int(np.argmin(energies))
    if energies[best] >= float(fit.left @ fit.left):
        return fit
    rows = {**fit.rows, key: widths[best]}
    other = refined(problem, whiten, [replace(item, row=rows[item.key]) for item in found], parts)
    return min(fit, other, key=lambda one: float(one.left @ one.left))


def stiffened(
    problem: Problem, whiten: Whitening, fitted: Mapping[tuple[str, int], EffectRow], parts: Sequence[Part]
) -> dict[tuple[str, int], EffectRow]:
    """Rows whose bearings are rigid wherever nothing tells how little they give, the stiffest direction first."""
    rows = dict(fitted)
    for key in [key for key in rows if key[0] == BEARING]:
        left = left_with(problem, whiten, tables(rows))
        sigma = spread(left, parts)
        for name in _gives(rows[key])[:-1]:
            rigid = EffectRow(key[1], {**rows[key].values, name: math.inf, "b" + name[1:]: 0.0})
            rest = left_with(problem, whiten, tables({**rows, key: rigid}))
            if 0.5 * float(np.sum((rest / sigma) ** 2) - np.sum((left / sigma) ** 2)) < GIVES:
                rows[key] = rigid
    return rows


def in_one_turn(fit: Refined) -> Refined:
    """The fit with phases, and angles that a turn leaves what they are, from -pi to pi."""

    def turned(effect: str, row: EffectRow) -> EffectRow:
        angles = {"phase", *ANGLES.get(effect, ())} & row.values.keys()
        return EffectRow(
            row.at, {**row.values, **{name: math.remainder(row.values[name], math.tau) for name in angles}}
        )

    return replace(fit, rows={key: turned(key[0], row) for key, row in fit.rows.items()})


def _gives(bearing: EffectRow) -> list[str]:
    """Directions in which a bearing is not rigid, the stiffest first."""
    finite = [name for name, value in bearing.values.items() if name.startswith("k") and math.isfinite(value)]
    return sorted(finite, key=lambda name: -bearing.values[name])


def _beyond(problem: Problem, delay: EffectRow) -> EffectRow | None:
    """A delay on the other side of the edge of a tick that it has come to; None where it has come to none."""
    tick = tick_of(problem)
    number, part = divmod(delay.values["time"] / tick, 1.0)
    if min(part, 1.0 - part) > 2.0 * EDGE:
        return None
    time = (number + 1.0 + BEYOND if part > 0.5 else number - BEYOND) * tick
    return EffectRow(delay.at, {**delay.values, "time": time}) if time > 0.0 else None


def tick_of(problem: Problem) -> float:
    """Longest period of a controller [s]."""
    return 1.0 / min(run.run.control.rate for run in problem.evidence.runs)


def _within(problem: Problem, whiten: Whitening, found: Sequence[Found], parts: Sequence[Part]) -> Refined:
    optimize: Any = import_module("scipy.optimize")

    undamped = all(not run.run.control.kd or not any(run.run.control.kd) for run in problem.evidence.runs)
    free = tuple(
        (item.effect, item.at, name)
        for item in found
        for name in free_columns(item.effect, item.row)
        if not (undamped and (item.effect, name) == ("controller_gain", "kd"))
    )
    way, named = problem.way(), {item.key: item for item in found}
    start = np.array([named[effect, at].row.values[name] for effect, at, name in free])
    held = Plain.of(problem, free)
    size = np.array([_size(named[effect, at], name, float(way[at - 1])) for effect, at, name in free])
    size = np.maximum(size, LITTLE * held.usual(start))
    bounds = [bounds_of(problem, *key, value) for key, value in zip(free, start.tolist(), strict=True)]
    low = np.array([b[0] for b in bounds]) / size
    high = np.array([b[1] for b in bounds]) / size

    def rows_at(x: Vector) -> dict[tuple[str, int], EffectRow]:
        values = {(item.effect, item.at): dict(item.row.values) for item in found}
        for (effect, at, name), value in zip(free, (x * size).tolist(), strict=True):
            values[effect, at][name] = value
        return {key: EffectRow(key[1], v) for key, v in values.items()}

    def whitened(x: Vector, sigma: Vector) -> Vector:
        return np.concatenate([residual.at(x) / sigma, held.apart(x * size), STAYS * (x - begun)])

    def slopes(x: Vector, sigma: Vector) -> Vector:
        apart = differences(lambda there: held.apart(there * size), x, high)
        return np.vstack([residual.slopes(x) / sigma[:, None], apart, STAYS * np.eye(len(x))])

    residual = Sloped(lambda x: left_with(problem, whiten, tables(rows_at(x))), high)
    x = begun = np.clip(start / size, low + 1e-12, high)
    sigma = spread(residual.at(x), parts)
    sigma_last = sigma
    solution: Any = None
    # the first time only the spread is to be settled
    for enough in (ROUGHLY, CLOSELY):
        solution = optimize.least_squares(
            whitened,
            x,
            slopes,
            bounds=(low, high),
            max_nfev=_EVALUATIONS,
            xtol=enough,
            ftol=enough,
            args=(sigma,),
        )
        x = np.asarray(solution.x)
        sigma_last = sigma
        sigma = spread(np.asarray(solution.fun)[: len(sigma)] * sigma, parts)
    left = residual.at(x)
    jacobian = np.asarray(solution.jac)
    # what no run shows is known within a few times its size, for what would otherwise be anything
    loosely = TIMES * np.maximum(np.maximum(np.abs(x), 1.0), held.usual(x * size) / size)
    inverse = covariance_of(jacobian.T @ jacobian + np.diag(loosely**-2.0))
    told = jacobian[: len(left)]
    known = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    resolved = np.diagonal(known @ (told.T @ told)) > RESOLVED
    slope = told * sigma_last[:, None] / size
    return Refined(rows_at(x), left, free, inverse * np.outer(size, size), slope, tuple(resolved.tolist()))


def left_with(problem: Problem, whiten: Whitening, rows: Rows) -> Vector:
    """What is left with these rows, whitened, in units of noise, shape (N,).

    What the motion takes and the controller did not ask for is smaller, whatever its cause, for a controller that is
    said to ask for less, and so may be what it makes of its sensors' noise, and what a lighter arm makes of that of
    accelerations. There both count by what that robot makes of them, or one that does next to nothing would explain
    everything; a louder one's noise does not, for then one that asks wildly would.
    """
    left = whiten(problem.misfit(rows))
    weaker = {
        row.at: (row.values["kp"], row.values["kd"])
        for row in rows.get("controller_gain", ())
        if row.values["kp"] * row.values["kd"] < 1.0
    }
    lighter = problem.lighter(rows) if weaker else ()
    for channel in problem.evidence.channels:
        gains = weaker.get(channel.index + 1) if channel.signal == "u" else None
        asked = problem.evidence.asks[channel.run].get(channel.index)
        if gains and asked:
            here = left[channel.first : channel.last]
            square = float(np.mean(here**2))
            # one that asks for nothing, as a gain that was moved may, counts as one that asks for next to nothing
            kept = float(lighter[channel.index])
            noise = min(max(asked.noise(*gains, kept), LEAST_GAIN), 1.0)
            # and a lighter arm takes less by itself
            part = min(max(gains[0] * gains[1] / max(kept, 1.0 / MOST_TIMES) ** 2, LEAST_GAIN), 1.0)
            counts = 1.0 + (square / noise - 1.0) / part if square > noise else square / noise
            here *= math.sqrt(counts / max(square, 1e-300))
    return left


def _size(item: Found, name: str, way: float) -> float:
    """What is much for a number: itself, or what its neighbours of the same kind or it without the finding are.

    Where a spring rests and a wave begins may well be 0: there it is the joint's way, or a radian. By itself such a
    spring could not come to where it makes a torque offset needless that was found before it.
    """
    values = item.row.values
    value = abs(values[name])
    if name in RANGES and name != SECOND_PHASE:
        return value
    if name in ("rest", "phase", SECOND_PHASE):
        return max(value, way if name == "rest" else 1.0, 1e-9)
    unit = {c.name: c.unit for c in effect_named(item.effect).columns}
    same = [abs(values[c]) for c, u in unit.items() if u == unit[name] and np.isfinite(values[c])]
    before = abs(item.absent.values[name]) if item.absent else 0.0
    return max(value, 0.1 * max([before, *same]), 1e-9)


def bounds_of(problem: Problem, effect: str, at: int, name: str, start: float | None = None) -> tuple[float, float]:
    """Least and largest value of a number, and of a delay that starts somewhere those within that tick.

    Along a motion, where a delay becomes another whole number of ticks, what is reported jumps.
    """
    low, high = range_of(effect, name)
    if effect == "delay" and start is not None:
        tick = tick_of(problem)
        number = np.floor(start / tick)
        # differences are taken upwards
        low, high = max(low, (number + EDGE) * tick), (number + 1.0 - EDGE) * tick
    if (effect, name) == ("stribeck_friction", "velocity"):
        # slower than that a joint counts as standing; faster than it ever goes by far is Coulomb's law
        low = max(low, *(SLOWEST * float(creep[at - 1]) for creep in problem.evidence.creeps))
        fastest = max(float(np.abs(run.dq[:, at - 1]).max()) for run in problem.evidence.runs)
        high = max(FASTEST * fastest, 2.0 * low)
    if (effect, name) == ("link_flexibility", "at"):
        # both parts of an arm that bends have a length and a mass
        low, high = SHORTEST_PART, 1.0 - SHORTEST_PART
    if (effect, name) in _FACTORS:
        # what is said of a drive is of its order
        low, high = 1.0 / MOST_TIMES, MOST_TIMES
    if name == "cycles":
        # what only bends over the whole way would take the place of every law of the position
        low = problem.fewest_cycles(at)
    if (effect, name) == ("link_inertia", "mass"):
        # an arm has a mass
        low = max(low, -LIGHTEST * problem.database.inertias[at - 1].mass)
    if effect == "kinematic_error":
        known = problem.row_at(effect, at, {})
        middle = known.values[name] if known else 0.0
        low, high = middle - problem.farthest(name), middle + problem.farthest(name)
    return (low, high)


def range_of(effect: str, name: str) -> tuple[float, float]:
    """Between what a number of an effect can be [SI]; a phase is free to turn."""
    if name in RANGES:
        return RANGES[name]
    column = next(c for c in effect_named(effect).columns if c.name == name)
    if column.name == "phase":
        return (-np.inf, np.inf)
    return (max(column.minimum, 1e-12) if column.exclusive else column.minimum, column.maximum)
