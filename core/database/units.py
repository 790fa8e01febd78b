"""Units of the tables' columns: how many SI units one of them is.

pint reads them, with a registry of our own in which the angle is a dimension, so that N*m and N*m/rad are told apart.
The few spellings that most tables use are listed here, so that reading them does not pay for loading pint (0.25 s);
a test holds the list against pint. Factors are decimal and so is the multiplication: 72 mm and 0.072 m are the same
double.
"""

from __future__ import annotations

import re
from decimal import Decimal
from functools import cache
from typing import Any

DEGREE = Decimal("0.01745329251994329576923690768")

COMMON: dict[str, tuple[str, Decimal]] = {
    "deg": ("rad", DEGREE),
    "deg/s": ("rad/s", DEGREE),
    "mm": ("m", Decimal("0.001")),
    "mm/s": ("m/s", Decimal("0.001")),
    "g": ("kg", Decimal("0.001")),
    "ms": ("s", Decimal("0.001")),
    "kg*mm^2": ("kg*m^2", Decimal("1e-6")),
    "N/mm": ("N/m", Decimal("1e3")),
}
"""Unit to its SI unit and how many of that it is."""

DEFINITIONS = """
    nano- = 1e-9 = n-
    micro- = 1e-6 = µ- = μ- = u-
    milli- = 1e-3 = m-
    centi- = 1e-2 = c-
    deci- = 1e-1 = d-
    kilo- = 1e3 = k-
    mega- = 1e6 = M-
    giga- = 1e9 = G-
    meter = [length] = m = metre
    second = [time] = s = sec
    gram = [mass] = g
    radian = [angle] = rad
    ampere = [current] = A
    kelvin = [temperature] = K
    degree = 0.01745329251994329576923690768 * radian = deg = °
    arcminute = degree / 60 = arcmin
    arcsecond = degree / 3600 = arcsec
    turn = 360 * degree = _ = revolution = rev
    percent = 0.01 = %
    minute = 60 * second = min
    hour = 3600 * second = h
    hertz = 1 / second = Hz
    rpm = turn / minute
    tonne = 1000 * kilogram = t
    newton = kilogram * meter / second ** 2 = N
    newton_meter = newton * meter = Nm
    newton_millimeter = newton * millimeter = Nmm
    joule = newton * meter = J
    watt = joule / second = W
    volt = watt / ampere = V
    inch = 0.0254 * meter = in
    foot = 12 * inch = ft
    pound = 0.45359237 * kilogram = lb
    pound_force = 4.4482216152605 * newton = lbf
"""

# names with small powers, multiplied and divided, in brackets once: what else the library's parser of expressions
# would take, or stumble over, is no unit of a table
_POWER = r"(?:1|[A-Za-zµμ°%]+(?:(?:\^|\*\*)-?[0-9]{1,2})?)"
_PRODUCT = rf"{_POWER}(?:[*/·⋅]{_POWER}){{0,9}}"
_FACTOR = rf"(?:{_POWER}|\({_PRODUCT}\))"
_UNIT = re.compile(rf"{_FACTOR}(?:[*/·⋅]{_FACTOR}){{0,9}}")


class UnknownUnitError(ValueError):
    """The text names no unit."""


@cache
def factor(unit: str, si: str) -> Decimal | None:
    """How many `si` one `unit` is; None where it is of another kind.

    Args:
        unit: As written in a header, e.g. "deg".
        si: Unit of the column, e.g. "rad"; "" for a plain number.

    Raises:
        UnknownUnitError: `unit` names no unit.
    """
    if unit == si:
        return Decimal(1)
    common = COMMON.get(unit)
    if common is not None and common[0] == si:
        return common[1]
    return factor_by_library(unit, si)


def factor_by_library(unit: str, si: str) -> Decimal | None:
    """The same as `factor`, always by pint."""
    import pint

    if len(unit) > 60 or not _UNIT.fullmatch(unit):
        raise UnknownUnitError(unit)
    registry = _registry()
    try:
        read = registry.parse_units(unit)
        wanted = registry.parse_units(si)
        if registry.get_dimensionality(read) != registry.get_dimensionality(wanted):
            return None
        one = registry.Quantity(Decimal(1), read)
        return Decimal(one.to(wanted).magnitude)
    except (pint.PintError, ArithmeticError, ValueError) as error:
        raise UnknownUnitError(unit) from error


@cache
def _registry() -> Any:
    import pint

    # pint's annotations know neither a registry without a file nor numbers other than floats
    make: Any = pint.UnitRegistry
    registry = make(None, non_int_type=Decimal)
    registry.load_definitions([line.strip() for line in DEFINITIONS.strip().splitlines()])
    return registry


def to_si(text: str, value: float, by: Decimal) -> float:
    """`value`, which `text` says, times `by`, rounded once."""
    if by == 1 or value == 0.0 or value in {float("inf"), float("-inf")}:
        return value
    try:
        return float(Decimal(text) * by)
    except ArithmeticError:
        return value * float(by)
