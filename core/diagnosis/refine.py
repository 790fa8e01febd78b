"""All numbers of all findings fitted together, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from .fit import Part, spread
from .nuisances import Whitening
from .problem import Problem, merged

if TYPE_CHECKING:
    from .search import Found

Vector = NDArray[np.float64]

# numbers that only a form of the effect has, or that no run shows
_HELD = {"hysteresis": ("slips",), "link_flexibility": ("at",), "backlash": ("stiffness", "damping")}
_EVALUATIONS = 40
# of the speed below which a joint counts as standing: the least speed that friction can be told to vanish with
SLOWEST = 2.0
_FAR = 1.0e3


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """A joint fit.

    Attributes:
        rows: (effect, at) -> its row.
        left: What is left, whitened, in units of noise.
        cost: Its sum of squares over the spread that was assumed.
        free: (effect, at, column) of each number that was fitted.
        covariance: Of these numbers, SI.
    """

    rows: Mapping[tuple[str, int], EffectRow]
    left: Vector
    cost: float
    free: tuple[tuple[str, int, str], ...]
    covariance: Vector


def free_columns(effect: str, row: EffectRow) -> list[str]:
    """Which of a row's numbers are there to be fitted: those that differ from what they are by default."""
    columns = effect_named(effect).columns
    held = _HELD.get(effect, ())
    out = [
        c.name
        for c in columns
        if c.name not in held
        and np.isfinite(row.values[c.name])
        and (c.default is None or row.values[c.name] != c.default)
    ]
    if effect == "controller_gain":
        return ["kp", "kd"]
    if effect == "base_tilt":
        return ["roll", "pitch"]
    return out


def refined(problem: Problem, whiten: Whitening, found: Sequence[Found], parts: Sequence[Part]) -> Refined:
    """Fit all numbers of these findings, from where they are."""
    optimize: Any = import_module("scipy.optimize")

    free = tuple((item.effect, item.at, name) for item in found for name in free_columns(item.effect, item.row))
    start = np.array([_row(found, effect, at).values[name] for effect, at, name in free])
    size = np.array([_size(_row(found, effect, at), effect, name) for effect, at, name in free])
    bounds = [_bounds(problem, effect, at, name) for effect, at, name in free]
    low = np.array([b[0] for b in bounds]) / size
    high = np.array([b[1] for b in bounds]) / size

    def rows_at(x: Vector) -> dict[tuple[str, int], EffectRow]:
        values = {(item.effect, item.at): dict(item.row.values) for item in found}
        for (effect, at, name), value in zip(free, (x * size).tolist(), strict=True):
            values[effect, at][name] = value
        return {key: EffectRow(key[1], v) for key, v in values.items()}

    def residual(x: Vector) -> Vector:
        table: dict[str, tuple[EffectRow, ...]] = {}
        for (effect, _), row in rows_at(x).items():
            table = merged(table, {effect: (row,)})
        r = whiten(problem.residual(table))
        return np.where(np.isfinite(r), r, _FAR)

    def whitened(x: Vector, sigma: Vector) -> Vector:
        return residual(x) / sigma

    x = np.clip(start / size, low + 1e-12, high)
    sigma = spread(residual(x), parts)
    solution: Any = None
    for _ in range(2):
        solution = optimize.least_squares(
            whitened,
            x,
            bounds=(low, high),
            diff_step=1e-3,
            max_nfev=_EVALUATIONS,
            xtol=1e-6,
            ftol=1e-8,
            args=(sigma,),
        )
        x = np.asarray(solution.x)
        sigma = spread(np.asarray(solution.fun) * sigma, parts)
    left = residual(x)
    jacobian = np.asarray(solution.jac)
    covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True) * np.outer(size, size)
    return Refined(rows_at(x), left, float(np.sum((left / sigma) ** 2)), free, covariance)


def _row(found: Sequence[Found], effect: str, at: int) -> EffectRow:
    return next(item.row for item in found if (item.effect, item.at) == (effect, at))


def _size(row: EffectRow, effect: str, name: str) -> float:
    """What is much for a number: itself, or what its neighbours of the same kind are."""
    value = abs(row.values[name])
    unit = {c.name: c.unit for c in effect_named(effect).columns}
    same = [abs(row.values[c]) for c, u in unit.items() if u == unit[name] and np.isfinite(row.values[c])]
    return max(value, 0.1 * max(same, default=0.0), 1e-9)


def _bounds(problem: Problem, effect: str, at: int, name: str) -> tuple[float, float]:
    column = next(c for c in effect_named(effect).columns if c.name == name)
    if column.name == "phase":
        return (-np.inf, np.inf)
    low = max(column.minimum, 1e-12) if column.exclusive else column.minimum
    if (effect, name) == ("stribeck_friction", "velocity"):
        # slower than that a joint counts as standing
        low = max(low, *(SLOWEST * float(creep[at - 1]) for creep in problem.evidence.creeps))
    return (low, column.maximum)
