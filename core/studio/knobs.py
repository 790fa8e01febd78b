"""Sliders for the numbers of a database: where they go from and to, and in which units they are shown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from ..study.values import Place, free_correction, rows
from .bench import Bench

Reach = Literal["fine", "medium", "wide"]
REACHES: tuple[Reach, ...] = ("fine", "medium", "wide")

# a slider goes this part of its number to both sides
_PARTS: dict[Reach, float] = {"fine": 0.1, "medium": 1.0, "wide": 9.0}
# shown unit and how many SI units it is
_SHOWN = {"rad": ("deg", math.pi / 180.0), "m": ("mm", 1.0e-3)}
# how far sliders of numbers that are 0 go with reach medium, in shown units; ten times less or more with the others
_FROM_ZERO = {
    "deg": 2.0,
    "mm": 10.0,
    "kg": 5.0,
    "kg*m": 1.0,
    "kg*m^2": 1.0,
    "s": 0.01,
    "N*m": 20.0,
    "N": 100.0,
    "N*m*s/rad": 50.0,
    "N*m/rad": 1.0e4,
    "N/m": 1.0e5,
    "m/s^2": 2.0,
}
# where a number that may be infinite is so, its slider stands at its right end
_INFINITE_END = 1.0e7
_STEPS = 1000


@dataclass(frozen=True, slots=True)
class Knob:
    """A slider for one number.

    Attributes:
        place: The number.
        label: "joint_2", "arm_3", "robot".
        unit: As shown; "" for a plain number.
        scale: How many SI units that unit is.
        value: Where it stands now, in that unit, between low and high.
        low, high: Ends, in that unit.
        step: Smallest move, in that unit.
        free: Whether it may be moved: some corrections would change the joint's motion.
    """

    place: Place
    label: str
    unit: str
    scale: float
    value: float
    low: float
    high: float
    step: float
    free: bool = True

    def si(self, shown: float) -> float:
        """A shown number in SI."""
        return shown * self.scale


def knobs(bench: Bench, table: str, column: str, reach: Reach = "medium") -> tuple[Knob, ...]:
    """Sliders for one column of a table, one a row."""
    return tuple(_knob(bench, place, reach) for place in rows(table, column, bench.original))


def _knob(bench: Bench, place: Place, reach: Reach) -> Knob:
    unit, scale = shown_unit(place.unit(bench.original))
    column = place.definition()
    nominal, value = bench.nominal(place), bench.value(place)
    if not math.isfinite(nominal):
        low, high = _INFINITE_END / _STEPS, _INFINITE_END
    elif nominal == 0.0:
        half = _FROM_ZERO.get(unit, 1.0) * {"fine": 0.1, "medium": 1.0, "wide": 10.0}[reach]
        low, high = -half, half
    else:
        half = abs(nominal / scale) * _PARTS[reach]
        low, high = nominal / scale - half, nominal / scale + half
    low, high = _within(low, high, column.minimum / scale, column.maximum / scale, column.exclusive)
    # a number that was set with another reach stays where it is
    now = value / scale if math.isfinite(value) else high
    low, high = min(low, now), max(high, now)
    label = "robot" if place.key == "robot" else f"{place.key} {place.at}"
    free = free_correction(place, bench.original)
    return Knob(place, label, unit, scale, now, low, high, round_step((high - low) / _STEPS), free)


def shown_unit(unit: str) -> tuple[str, float]:
    """How people read a unit: degrees for radians, millimetres for metres; and how many SI units that is."""
    return _SHOWN.get(unit, (unit, 1.0))


def _within(low: float, high: float, minimum: float, maximum: float, exclusive: bool) -> tuple[float, float]:
    """The range cut by what a number may be; an excluded end is kept off by a step."""
    margin = (high - low) / _STEPS if exclusive else 0.0
    return max(low, minimum + margin), min(high, maximum - margin)


def round_step(step: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above a step."""
    if not step > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= step * (1.0 + 1.0e-9))
