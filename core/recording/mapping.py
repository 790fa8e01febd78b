"""How the columns of a data file make signals: log.md's names, or the `signals` part of a log.yaml."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..control import LogFile
from ..control.log_values import nearest
from ..database.units import UnknownUnitError, factor
from ..errors import Problem, RunFileError
from ..representation import Joint
from ..signals import JOINT_SIGNALS, POSITION_SIGNALS, TURN_SIGNALS, joint_unit

Vector = NDArray[np.float64]

_KEYS = ("column", "unit", "sign", "gear", "offset", "delay")
_TIME_KEYS = ("rate", "column", "unit", "offset")
_NUMBERED = re.compile(rf"({'|'.join(sorted(JOINT_SIGNALS, key=len, reverse=True))})_([0-9]+)")


@dataclass(frozen=True, slots=True)
class Recipe:
    """value = (sum of columns times their factors) * scale + offset, as it was a delay earlier.

    Attributes:
        columns: Column of the file -> its factor.
        scale: Sign, unit and gear in one.
        offset: In SI.
        delay: How much later than the others the file has this channel [s].
        rate: Of t only: rows a second [Hz] where the file has no time; 0: it has.
    """

    columns: Mapping[str, float]
    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    rate: float = 0.0

    def values(self, file: Mapping[str, Vector]) -> Vector:
        """Values (m,) in SI out of a file's columns, not shifted."""
        parts = [file[name] if weight == 1.0 else weight * file[name] for name, weight in self.columns.items()]
        total = sum(parts[1:], start=parts[0])
        # a column that is taken as it stands keeps every bit
        scaled = total if self.scale == 1.0 else total * self.scale
        return scaled if self.offset == 0.0 else scaled + self.offset


def recipes_of(log: LogFile, header: Sequence[str], joints: Sequence[Joint], file: str) -> dict[str, Recipe]:
    """What of a run is where: "t", "q_1", "ee_x" ... -> recipe; a signal that the log maps is taken from there.

    Args:
        log: The run's log.yaml.
        header: The data file's columns.
        joints: The robot's.
        file: The data file, for messages.

    Raises:
        RunFileError: With all problems.
    """
    problems: list[Problem] = []
    recipes = {name: Recipe({name: 1.0}) for name in header if _kind(name, joints, file, problems) is not None}
    part: Any = log.data.get("signals")
    if part is not None and not isinstance(part, Mapping):
        problems.append(log.problem("signals", part, "must be a mapping, e.g. q_1: {column: pos_j1, unit: deg}"))
        part = None
    for name, entry in cast("Mapping[str, Any]", part or {}).items():
        recipe = _Entry(log, name, header, problems).recipe(entry, joints)
        if recipe is not None:
            recipes[name] = recipe
    if "t" not in recipes and not problems:
        message = "there is no column t; where the file has no time, say its rate: signals: {t: {rate: 1000}}"
        problems.append(Problem(message, file=file, column="t"))
    if problems:
        raise RunFileError(problems)
    return recipes


def _kind(name: str, joints: Sequence[Joint], file: str, problems: list[Problem]) -> str | None:
    """SI unit of a signal of log.md; None for any other column."""
    if name == "t":
        return "s"
    if name in POSITION_SIGNALS:
        return "m"
    if name in TURN_SIGNALS:
        return ""
    match = _NUMBERED.fullmatch(name)
    if match is None:
        return None
    number = int(match[2])
    if not 1 <= number <= len(joints):
        message = f"there is no joint {number}: the robot has {len(joints)}, numbered from 1"
        problems.append(Problem(message, file=file, column=name))
        return None
    return joint_unit(match[1], joints[number - 1].kind)


class _Entry:
    """One line of the `signals` part."""

    def __init__(self, log: LogFile, name: str, header: Sequence[str], problems: list[Problem]) -> None:
        self._log, self._name, self._header, self._problems = log, name, header, problems

    def recipe(self, entry: Any, joints: Sequence[Joint]) -> Recipe | None:
        """What it says; None, with problems noted, where it cannot be."""
        before = len(self._problems)
        si = _kind(self._name, joints, self._log.file, self._problems)
        if si is None and len(self._problems) == before:
            self._wrong("", None, f"is no signal; known are t, {', '.join(JOINT_SIGNALS)} (with _1, _2 ...) and ee_x")
        if not isinstance(entry, Mapping):
            self._wrong("", entry, "must be a mapping, e.g. {column: pos_j1, unit: deg, sign: -1}")
        if len(self._problems) > before or si is None:
            return None
        table = cast("Mapping[str, Any]", entry)
        keys = _TIME_KEYS if self._name == "t" else _KEYS
        for key in table:
            if key not in keys:
                self._wrong(key, table[key], f"unknown key; known are {', '.join(keys)}")
        if "rate" in table and self._name == "t":
            rate = self._number(table, "rate", 0.0)
            if not rate > 0.0 or len(table) > 1:
                self._wrong("rate", table["rate"], "must be a number of Hz above 0, and stands alone")
            return Recipe({}, rate=rate)
        columns = self._columns(table.get("column"))
        sign, gear = self._number(table, "sign", 1.0), self._number(table, "gear", 1.0)
        if sign not in (1.0, -1.0):
            self._wrong("sign", table.get("sign"), "must be 1 or -1")
        if gear == 0.0:
            self._wrong("gear", table.get("gear"), "must not be 0: the column is divided by it")
        scale = sign * self._unit(table.get("unit"), si) / (gear or 1.0)
        offset, delay = self._number(table, "offset", 0.0), self._number(table, "delay", 0.0)
        return Recipe(columns, scale, offset, delay) if len(self._problems) == before else None

    def _wrong(self, key: str, value: Any, message: str) -> None:
        dotted = f"signals.{self._name}.{key}" if key else f"signals.{self._name}"
        self._problems.append(self._log.problem(dotted, value, message))

    def _number(self, table: Mapping[str, Any], key: str, default: float) -> float:
        value = table.get(key, default)
        if not isinstance(value, float) or not math.isfinite(value):
            self._wrong(key, value, "must be a finite number")
            return default or 1.0
        return value

    def _columns(self, value: Any) -> dict[str, float]:
        weights: dict[str, Any] = {}
        if isinstance(value, Mapping) and value:
            weights = dict(cast("Mapping[str, Any]", value))
        elif isinstance(value, str | float):
            # a column that is named by a number
            weights = {str(int(value)) if isinstance(value, float) and value.is_integer() else str(value): 1.0}
        else:
            self._wrong("column", value, "must name a column, or columns with their factors: {m6: 1.0, m5: 0.031}")
        for name, weight in weights.items():
            if name not in self._header:
                self._wrong("column", name, f"the data file has no such column{nearest(name, self._header)}")
            elif not isinstance(weight, float) or not math.isfinite(weight):
                self._wrong(f"column.{name}", weight, "must be a finite number: the column's factor in the sum")
        return weights

    def _unit(self, value: Any, si: str) -> float:
        if value is None:
            return 1.0
        try:
            by = factor(str(value), si)
        except UnknownUnitError:
            self._wrong("unit", value, f"is no unit; {si or 'a plain number'} and what converts to it are")
            return 1.0
        if by is None:
            self._wrong("unit", value, f"does not convert to {si or 'a plain number'}")
            return 1.0
        return float(by)
