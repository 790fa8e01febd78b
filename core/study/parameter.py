"""What a study varies, as a user writes it: `joint_compliance.stiffness@joint_2=0.5:2:9`."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..database.rows import bounds_fault, read_number
from ..database.units import UnknownUnitError, factor
from ..errors import UsageError
from .values import Place, find_places, free_correction, value_at

if TYPE_CHECKING:
    from ..database import Database

Array = NDArray[np.float64]

SYNTAX = "NAME.COLUMN@PLACE=FROM:TO[:COUNT[:log]], such as joint_compliance.stiffness@joint_2=0.5:2:9"
MOST_STEPS = 100_000

_SPEC = re.compile(r"(?P<name>[\w.]+)(?:\[(?P<unit>[^\[\]]*)\])?@(?P<at>\w+)=(?P<range>[^=]+)", re.ASCII)
_COUNT = re.compile(r"[1-9][0-9]{0,5}")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of the database that varies, value = scale x with x in a range.

    Attributes:
        place: Where it stands.
        unit: SI unit of the value.
        scale: The database's value, where the range is of factors; else how many SI units the range's unit is.
        factors: Whether the range is of factors.
        low, high: Ends of x; equal where the parameter only has another value than the database.
        count: Steps of a grid, ends included; 0 where none were given.
        spacing: "linear" or "log": x, or log x, is spread evenly.
        listed: The grid's x, where they are listed; () else.
    """

    place: Place
    unit: str
    scale: float
    factors: bool
    low: float
    high: float
    count: int = 0
    spacing: str = "linear"
    listed: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """As in the study's table."""
        return self.place.name

    @property
    def fixed(self) -> bool:
        """Whether it has one value in all variants."""
        return self.low == self.high

    def grid(self) -> Array:
        """The x of a grid, shape (k,)."""
        if self.listed:
            return np.array(self.listed)
        if self.fixed:
            return np.array([self.low])
        return self.spread(np.linspace(0.0, 1.0, self.count))

    def spread(self, u: ArrayLike) -> Array:
        """The x of numbers u in [0, 1], 0 at low and 1 at high, same shape."""
        u = np.asarray(u, dtype=np.float64)
        x = (
            self.low + (self.high - self.low) * u
            if self.spacing == "linear"
            else self.low * (self.high / self.low) ** u
        )
        # the ends as they were written, without rounding
        return np.where(u == 0.0, self.low, np.where(u == 1.0, self.high, x))


def parse_vary(text: str, database: Database) -> tuple[Parameter, ...]:
    """The parameters of one `--vary`; several where its place is "all".

    Without a unit the range is of factors on the database's value; with one in brackets, as in a table's header, it is
    of values in that unit, [SI] being the column's own.

    Args:
        text: As the user wrote it.
        database: The robot.

    Raises:
        UsageError: What is wrong with it, with the nearest names.
    """
    found = _SPEC.fullmatch(text.strip())
    if found is None:
        raise UsageError(f"--vary {text!r} is not {SYNTAX}.")
    low, high, count, spacing, listed = _read_range(text, found["range"])
    parameters: list[Parameter] = []
    for place in find_places(found["name"], found["at"], database):
        unit = place.unit(database)
        given = found["unit"]
        scale = _nominal(place, unit, database) if given is None else _unit_scale(place, given, unit)
        parameter = Parameter(place, unit, scale, given is None, low, high, count, spacing, tuple(listed))
        _check_bounds(parameter, database)
        parameters.append(parameter)
    if not parameters:
        raise UsageError(f"--vary {text!r}: {database.name} has no such row.")
    return tuple(parameters)


def _read_range(text: str, given: str) -> tuple[float, float, int, str, list[float]]:
    """(low, high, count, spacing, listed) of a range or a list."""

    def number(part: str) -> float:
        value = read_number(part.strip())
        if value is None or not math.isfinite(value):
            raise UsageError(f"--vary {text!r}: {part.strip()!r} is no finite number.")
        return value

    parts = given.split(":")
    if len(parts) == 1:
        listed = [number(part) for part in given.split(",")]
        if len(set(listed)) != len(listed):
            raise UsageError(f"--vary {text!r}: a value is there twice.")
        return min(listed), max(listed), 0, "linear", listed
    if len(parts) > 4:
        raise UsageError(f"--vary {text!r}: a range is FROM:TO[:COUNT[:log]].")
    low, high = number(parts[0]), number(parts[1])
    if not low < high:
        raise UsageError(f"--vary {text!r}: a range goes up, and {low!r} is not below {high!r}.")
    spacing = "linear"
    if len(parts) > 2 and parts[-1] == "log":
        spacing = parts.pop()
    if len(parts) == 4:
        raise UsageError(f"--vary {text!r}: what may follow the count is log, not {parts[3]!r}.")
    if spacing == "log" and low <= 0.0:
        raise UsageError(f"--vary {text!r}: a range with log is above 0.")
    count = 0
    if len(parts) == 3:
        if not _COUNT.fullmatch(parts[2]) or not 2 <= int(parts[2]) <= MOST_STEPS:
            raise UsageError(f"--vary {text!r}: the count is a whole number from 2 to {MOST_STEPS}, not {parts[2]!r}.")
        count = int(parts[2])
    return low, high, count, spacing, []


def _nominal(place: Place, unit: str, database: Database) -> float:
    """The database's value, which factors act on."""
    value = value_at(database, place)
    if value is not None and value != 0.0 and math.isfinite(value):
        return value
    what = "no value" if value is None else f"the value {value!r}"
    name, _, at = place.name.partition("@")
    raise UsageError(
        f"{place.name}: {database.name} has {what} there, which factors cannot vary; give values with their unit: "
        f"'{name}[{unit or 'SI'}]@{at}=FROM:TO:COUNT'."
    )


def _unit_scale(place: Place, given: str, unit: str) -> float:
    """How many SI units the given one is."""
    if given == "SI":
        return 1.0
    try:
        by: Decimal | None = factor(given, unit)
    except UnknownUnitError:
        by = None
    if by is None:
        raise UsageError(
            f"{place.name}: [{given}] is no unit of {place.column}, which is "
            + (f"in {unit}, [SI] for short, or multiples of it." if unit else "a plain number: write [SI].")
        )
    return float(by)


def _check_bounds(parameter: Parameter, database: Database) -> None:
    """Both ends must be values that the column may have."""
    place = parameter.place
    for x in (parameter.low, parameter.high):
        value = parameter.scale * x
        fault = bounds_fault(value, place.definition())
        if fault is not None:
            raise UsageError(f"{place.name} would be {value!r} {parameter.unit}".rstrip() + f": {fault}")
        if value != 0.0 and not free_correction(place, database):
            raise UsageError(f"{place.name}: a correction other than 0 there would change the joint's motion.")
