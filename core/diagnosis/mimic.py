"""How well one cause mimics another along a motion: all of its numbers fitted to what the other would say."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import Column, EffectRow, effect_named
from .found import Found, rows_of
from .model import Rows, merged
from .problem import Problem
from .refine import free_columns

Vector = NDArray[np.float64]
Weigh = Callable[[Vector], Vector]

# numbers that only a form of the effect has
_HELD = {"hysteresis": ("slips",), "link_flexibility": ("at",), "backlash": ("stiffness", "damping")}
# effects that take many numbers, all of which may mimic
_WHOLE = ("payload", "link_inertia", "kinematic_error")
# what the recorded runs say of a number that is no amount (a speed, a stiffness): it stays within this factor, or
# Stribeck friction that never ends would be Coulomb's under another name
FAR = 3.0
_DIFFERENCE = 1e-3


def as_it_is(values: Vector) -> Vector:
    """No nuisances."""
    return values


class Model:
    """One cause beside what else was found, along one motion, with all its numbers."""

    def __init__(
        self, asked: Problem, rest: Rows, name: Found, others: Sequence[Found], sizes: Sizes, whiten: Weigh
    ) -> None:
        self.name = name
        self._asked = asked
        self._rows = merged(rest, rows_of([name]))
        self._whiten = whiten
        self._numbers = [
            _Number(item, column, sizes) for item in (name, *others) for column in _columns(item.effect, item.row)
        ]
        self._size = np.array([number.size for number in self._numbers])
        self._low = np.array([number.low for number in self._numbers]) / self._size
        self._high = np.array([number.high for number in self._numbers]) / self._size
        values = np.array([number.value for number in self._numbers])
        self._start = np.clip(values / self._size, self._low, self._high)
        self.said = self._at(self._start)
        self._slope: Vector | None = None

    def _at(self, x: Vector) -> Vector:
        """Measured minus said with these numbers, in units of noise; far off where there can be no such robot."""
        changed: dict[tuple[str, int], dict[str, float]] = {}
        for number, value in zip(self._numbers, (x * self._size).tolist(), strict=True):
            item = number.item
            changed.setdefault((item.effect, item.at), dict(item.row.values))[number.column.name] = value
        rows = self._rows
        for (effect, place), values in changed.items():
            rows = merged(rows, {effect: (EffectRow(place, values),)})
        return self._asked.misfit(rows)

    def _slopes(self, x: Vector, here: Vector) -> Vector:
        columns: list[Vector] = []
        for k in range(len(x)):
            side = _DIFFERENCE if x[k] + _DIFFERENCE <= self._high[k] else -_DIFFERENCE
            moved = x.copy()
            moved[k] += side
            columns.append((self._at(moved) - here) / side)
        return self._whiten(np.column_stack(columns))

    def mimicking(self, said: Vector | float, rounds: int) -> Vector:
        """What the best fit of this cause leaves, in units of noise, not whitened.

        Args:
            said: Residual that another cause has along this motion, shape (N,); 0: what was measured.
            rounds: Of Gauss and Newton; one takes what is said as linear in the numbers.
        """
        optimize: Any = import_module("scipy.optimize")

        x, here = self._start, self.said
        best = here - said
        cost = float(np.sum(self._whiten(best) ** 2))
        if self._slope is None:
            self._slope = self._slopes(x, here)
        slope = self._slope
        for number in range(rounds):
            if number:
                slope = self._slopes(x, here)
            # a little weight keeps what the motion does not show where it is
            ridge = 1e-6 * max(float(np.linalg.norm(slope, axis=0).max()), 1e-9)
            stacked = np.vstack([slope, ridge * np.eye(len(x))])
            target = np.concatenate([-self._whiten(best), np.zeros(len(x))])
            bounds = (np.minimum(self._low - x, -1e-12), np.maximum(self._high - x, 1e-12))
            step = np.asarray(optimize.lsq_linear(stacked, target, bounds=bounds).x)
            before = cost
            for part in (1.0, 0.5):
                tried = np.clip(x + part * step, self._low, self._high)
                there = self._at(tried)
                now = float(np.sum(self._whiten(there - said) ** 2))
                if now < cost:
                    x, here, best, cost = tried, there, there - said, now
                    break
            if cost > 0.99 * before:
                break
        return best


def _columns(effect: str, row: EffectRow) -> list[Column]:
    """A cause's numbers that a fit may move."""
    free = free_columns(effect, row)
    held = _HELD.get(effect, ())
    return [
        column
        for column in effect_named(effect).columns
        if column.name in free
        or (effect in _WHOLE and column.name not in held and math.isfinite(row.values[column.name]))
    ]


class Sizes:
    """What is much for a number whose value is 0, by its unit."""

    def __init__(self, problem: Problem) -> None:
        robot = problem.robots({})[0]
        mass = max(stage.arm.inertia.mass for stage in robot.stages)
        length = 0.2 * max(1e-2, sum(math.hypot(*stage.arm.link.pose().xyz) for stage in robot.stages))
        self._of = {"kg": mass, "kg*m": mass * length, "kg*m^2": mass * length**2, "m": length, "rad": 0.05}

    def __call__(self, unit: str) -> float:
        """A plain amount."""
        return self._of.get(unit.partition("|")[0], 1.0)


class _Number:
    """One number of one cause."""

    def __init__(self, item: Found, column: Column, sizes: Sizes) -> None:
        self.item = item
        self.column = column
        self.value = item.row.values[column.name]
        self.size = abs(self.value) if self.value else 0.1 * sizes(column.unit)
        self.low, self.high = column.minimum, column.maximum
        if column.exclusive:
            self.low = max(self.low, self.value / FAR)
            self.high = min(self.high, self.value * FAR)
