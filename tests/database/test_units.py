from __future__ import annotations

import math
import subprocess
import sys
from decimal import Decimal

import pytest

from mbexport.core.database.units import COMMON, UnknownUnitError, factor, factor_by_library, to_si
from mbexport.core.effects import catalogue, effect_named


@pytest.mark.parametrize("unit", sorted(COMMON))
def test_the_common_units_are_what_the_library_says(unit: str):
    si, by = COMMON[unit]
    assert factor_by_library(unit, si) == pytest.approx(by, rel=Decimal("1e-27"))


@pytest.mark.parametrize(
    ("unit", "si", "by"),
    [
        ("rpm", "rad/s", 2 * math.pi / 60),
        ("kg*mm^2", "kg*m^2", 1e-6),
        ("g*cm^2", "kg*m^2", 1e-7),
        ("kN/mm", "N/m", 1e6),
        ("N*m/deg", "N*m/rad", 180 / math.pi),
        ("kg*m^2/s/rad", "N*m*s/rad", 1.0),
        ("µm", "m", 1e-6),
        ("N·mm", "N*m", 1e-3),
        ("Nm", "N*m", 1.0),
        ("inch", "m", 0.0254),
        ("°", "rad", math.pi / 180),
        ("min", "s", 60.0),
        ("Hz", "1/s", 1.0),
        ("%", "", 0.01),
        ("N*m/(rad/s)", "N*m*s/rad", 1.0),
        ("N*m*s/rad", "kg*m^2/(s*rad)", 1.0),
        ("turn", "rad", 2 * math.pi),
    ],
)
def test_what_the_field_writes(unit: str, si: str, by: float):
    found = factor(unit, si)
    assert found is not None
    assert float(found) == pytest.approx(by, rel=1e-15)


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("N*m", "N*m/rad"),
        ("m", "rad"),
        ("", "rad"),
        ("deg", "m"),
        ("Hz", "rad/s"),
        ("kg*m", "kg*m^2"),
        ("N/m", "N*m/rad"),
    ],
)
def test_units_of_another_kind(unit: str, si: str):
    if unit:
        assert factor(unit, si) is None
    else:
        with pytest.raises(UnknownUnitError):
            factor(unit, si)


@pytest.mark.parametrize(
    "unit",
    [
        "mmm",
        "2*m",
        "m**9999999",
        "__import__",
        "m; m",
        "m'",
        "(" * 50,
        "x" * 500,
        "deg/",
        "**",
        "1e400*m",
        "λ",
        "m**m",
        "((m))",
        "m m",
    ],
)
def test_no_units(unit: str):
    with pytest.raises(UnknownUnitError):
        factor(unit, "m")


def test_conversion_rounds_once():
    # 72 * 0.001 is 0.07200000000000001 in doubles
    assert to_si("72", 72.0, COMMON["mm"][1]) == 0.072
    for degrees in range(-360, 361, 15):
        assert to_si(str(degrees), float(degrees), COMMON["deg"][1]) == pytest.approx(math.radians(degrees), rel=2e-16)
    assert to_si("90", 90.0, COMMON["deg"][1]) == math.pi / 2
    assert to_si("-inf", -math.inf, COMMON["deg"][1]) == -math.inf


def test_every_unit_of_the_catalogue_is_one_for_the_library():
    for name in catalogue():
        for column in effect_named(name).columns:
            for unit in filter(None, column.unit.split("|")):
                assert factor_by_library(unit, unit) == 1


def test_loading_the_paper_s_arm_needs_no_units_library():
    code = "import sys; from mbexport.core.database import load; load('imece2013'); load('puma560'); load('scara')"
    code += "; sys.exit('pint' in sys.modules or 'pandas' in sys.modules or 'scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
