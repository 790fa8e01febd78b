"""From a table's text to numbers in SI, with every fault noted at its place."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

from ..effects import Column
from ..representation import JointKind
from .problems import Problems, listed, nearest
from .schema import Choice, Table
from .table import Heading, RawRow, RawTable
from .units import COMMON, UnknownUnitError, factor, to_si

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_INFINITE = {"inf": math.inf, "+inf": math.inf, "-inf": -math.inf}
_KEY = re.compile(r"[0-9]{1,9}")


@dataclass(frozen=True, slots=True)
class Place:
    """Where a cell stands, as `Problems` takes it."""

    file: str
    line: int
    column: str
    value: str | None


@dataclass(frozen=True, slots=True)
class Row:
    """A row that could be read.

    Attributes:
        at: Number of the arm or joint; 0 for the robot.
        values: Column to value in SI; a cell that is no number is not there.
        words: Column of words to its word.
        raw: The text.
        table: The table that it stands in.
    """

    at: int
    values: dict[str, float]
    words: dict[str, str]
    raw: RawRow
    table: RawTable

    def gives(self, column: str) -> bool:
        """Whether the file has this cell, not only the default."""
        return self._index(column) is not None

    def place(self, column: str) -> Place:
        """Where the cell of that column stands."""
        index = self._index(column)
        if index is None:
            return Place(self.table.file, self.raw.line, column, None)
        return Place(self.table.file, self.raw.line_of(index), column, self.raw.cells[index])

    def _index(self, column: str) -> int | None:
        for index, heading in enumerate(self.table.headings):
            if heading.name == column:
                return index if self.raw.cells[index] is not None else None
        return None


@dataclass(frozen=True, slots=True)
class Scale:
    """Unit of a column as written and as it should be, each by the kind of the row's joint."""

    revolute: tuple[str, str]
    prismatic: tuple[str, str]

    def of(self, kind: JointKind) -> Decimal | None:
        """Factor to SI; None where the unit does not fit joints of that kind.

        Asked for only when it is needed: the other kind's may need the units library, which takes its time.
        """
        return factor(*(self.revolute if kind == "revolute" else self.prismatic))


def read_number(text: str) -> float | None:
    """A finite number, inf or -inf; None where the text is none."""
    if _NUMBER.fullmatch(text):
        value = float(text)
        return value if math.isfinite(value) else None
    return _INFINITE.get(text.lower())


def read_rows(
    raw: RawTable,
    table: Table,
    problems: Problems,
    *,
    n: int | None,
    kinds: Sequence[JointKind] = (),
    first: int = 1,
    complete: bool = False,
) -> list[Row]:
    """All rows of a table, in SI.

    Args:
        raw: Its text.
        table: What it should hold.
        problems: Takes what is wrong.
        n: Number of joints; None where it is what this table says.
        kinds: Kind of each joint, for units that depend on it; a joint beyond them is taken as revolute.
        first: Smallest key.
        complete: Every key from 1 to n must be there.
    """
    # an empty list in YAML has no header that could be wrong
    indices = check_header(raw, table, problems) if raw.headings else {table.key: 0}
    if table.key not in indices:
        return []
    keyed = _read_keys(raw, table, indices[table.key], problems, n, first, complete)
    rows = [
        Row(
            at,
            {c.name: c.default for c in table.columns if isinstance(c, Column) and c.default is not None},
            {c.name: c.default for c in table.columns if isinstance(c, Choice)},
            raw_row,
            raw,
        )
        for at, raw_row in keyed
    ]
    for column in table.columns:
        if column.name not in indices:
            continue
        if isinstance(column, Choice):
            _read_words(rows, column, indices[column.name], problems)
        else:
            _read_numbers(rows, column, indices[column.name], raw, table, problems, kinds)
    return rows


def check_header(raw: RawTable, table: Table, problems: Problems) -> dict[str, int]:
    """Column to its place in the row; unknown and repeated ones are noted and left out."""
    known = {table.key, *(column.name for column in table.columns)}
    there = {heading.name for heading in raw.headings}
    missing = [
        name
        for name in (table.key, *(c.name for c in table.columns if isinstance(c, Column) and c.default is None))
        if name not in there
    ]
    lacks = f"lacks the column{'s' * (len(missing) > 1)} {listed(missing)}." if missing else ""
    indices: dict[str, int] = {}
    for index, heading in enumerate(raw.headings):
        if heading.name not in known:
            # what is missing is mostly what is misspelt, so both are told in one
            problems.error(
                f"{table.name} has no column {heading.name!r}; {nearest(heading.name, known)}"
                + (f" The table {lacks}" if lacks else ""),
                raw.file,
                raw.line,
                heading.name,
                str(heading),
            )
        elif heading.name in indices:
            problems.error(
                f"column {heading.name!r} is there twice; keep one.", raw.file, raw.line, heading.name, str(heading)
            )
        else:
            indices[heading.name] = index
    if missing and there <= known:
        problems.error(f"{table.name} {lacks}", raw.file, raw.line, missing[0])
    return indices


def _read_keys(
    raw: RawTable, table: Table, index: int, problems: Problems, n: int | None, first: int, complete: bool
) -> list[tuple[int, RawRow]]:
    """Rows whose key can be used, with it."""
    if raw.headings and raw.headings[index].unit is not None:
        problems.error(
            f"the key column {table.key!r} has no unit.", raw.file, raw.line, table.key, str(raw.headings[index])
        )
    if table.key == "robot":
        return _read_robot_key(raw, index, problems)
    last = n if n is not None else raw.length
    keyed: list[tuple[int, RawRow]] = []
    seen: dict[int, int] = {}
    for row in raw.rows:
        text, line = row.cells[index], row.line_of(index)
        if text is None or not _KEY.fullmatch(text):
            problems.error(
                f"the key {table.key} is a whole number from {first} to {last}.", raw.file, line, table.key, text or ""
            )
            continue
        key = int(text)
        if key in seen:
            problems.error(
                f"{table.key} {key} is there twice, first in line {seen[key]}.", raw.file, line, table.key, text
            )
        elif not first <= key <= last:
            problems.error(
                f"there is no {table.key} {key}; {_range(table.key, first, last)}.", raw.file, line, table.key, text
            )
        else:
            if seen and key < max(seen):
                problems.error(
                    f"{table.key} {key} stands after {table.key} {max(seen)}; rows go up.",
                    raw.file,
                    line,
                    table.key,
                    text,
                )
            seen[key] = line
            keyed.append((key, row))
    if complete:
        # a row that could not be used has been told already
        missing = [key for key in range(1, last + 1) if key not in seen]
        if missing and len(keyed) == len(raw.rows) and not raw.lost:
            problems.error(
                f"{table.key} {listed([str(key) for key in missing[:10]])} {'are' if len(missing) > 1 else 'is'} "
                f"missing; "
                f"{_range(table.key, first, last)}.",
                raw.file,
                raw.rows[-1].line if raw.rows else raw.line,
                table.key,
                None,
            )
    return keyed


def _range(key: str, first: int, last: int) -> str:
    return f"{key}s go from {first} to {last}" if last > first else f"the only {key} is {last}"


def _read_robot_key(raw: RawTable, index: int, problems: Problems) -> list[tuple[int, RawRow]]:
    keyed: list[tuple[int, RawRow]] = []
    for row in raw.rows:
        text, line = row.cells[index], row.line_of(index)
        if text != "robot":
            problems.error("the key of this table is the word robot.", raw.file, line, "robot", text or "")
        elif keyed:
            problems.error("robot is there twice; the table has one row.", raw.file, line, "robot", text)
        else:
            keyed.append((0, row))
    return keyed


def _read_words(rows: list[Row], column: Choice, index: int, problems: Problems) -> None:
    for row in rows:
        text = row.raw.cells[index]
        if text is None:
            continue
        if text in column.words:
            row.words[column.name] = text
        else:
            place = row.place(column.name)
            problems.error(
                f"{column.name} is one of {listed(column.words)}; {nearest(text, column.words)}",
                place.file,
                place.line,
                place.column,
                place.value,
            )


def _read_numbers(
    rows: list[Row],
    column: Column,
    index: int,
    raw: RawTable,
    table: Table,
    problems: Problems,
    kinds: Sequence[JointKind],
) -> None:
    heading = raw.headings[index]
    scale = column_scale(heading, column, raw, problems)
    misfit_told = False
    for row in rows:
        text = row.raw.cells[index]
        if text is None:
            if column.default is None:
                problems.error(f"{column.name} is missing.", raw.file, row.raw.line, column.name)
            continue
        value, fault = cell_value(text, column)
        if fault is not None:
            problems.error(fault, raw.file, row.raw.line_of(index), column.name, text)
            continue
        if scale is None:
            continue
        kind: JointKind = kinds[row.at - 1] if table.key == "joint" and 1 <= row.at <= len(kinds) else "revolute"
        by = scale.of(kind)
        if by is None:
            if not misfit_told:
                problems.error(
                    f"{heading.unit} is of the wrong kind for the {kind} {table.key} {row.at}; where joints of both "
                    f"kinds are in a table, name both units, as {column.name}[{column.unit}].",
                    raw.file,
                    raw.line,
                    column.name,
                    str(heading),
                )
            misfit_told = True
            continue
        value = to_si(text, value, by)
        fault = bounds_fault(value, column)
        if fault is not None:
            problems.error(fault, raw.file, row.raw.line_of(index), column.name, text)
        else:
            row.values[column.name] = value


def cell_value(text: str, column: Column) -> tuple[float, str | None]:
    """The number of a cell before its unit, and what is wrong with it as a sentence; bounds are not looked at."""
    value = read_number(text)
    if value is None:
        if text.lower().strip("+-") == "nan":
            return 0.0, f"nan is never a value; {column.name} is a number."
        return 0.0, f"{column.name} is a number, such as 0.25 or 1e-3, of at most 1e308."
    if math.isinf(value) and not column.infinite:
        return 0.0, f"{column.name} must be finite."
    return value, None


def bounds_fault(value: float, column: Column) -> str | None:
    """What a column's bounds say against a value in SI, as a sentence."""
    if value < column.minimum or (column.exclusive and value == column.minimum):
        return f"{column.name} must be {'above' if column.exclusive else 'at least'} {column.minimum!r}{_in(column)}."
    if value > column.maximum or (column.exclusive and value == column.maximum and not column.infinite):
        return f"{column.name} must be {'below' if column.exclusive else 'at most'} {column.maximum!r}{_in(column)}."
    return None


def _in(column: Column) -> str:
    return f" {column.unit}" if column.unit and column.minimum != 0.0 else ""


def column_scale(heading: Heading, column: Column, raw: RawTable, problems: Problems) -> Scale | None:
    """Factors of a column; None, with the problem noted, where its unit is none or of the wrong kind."""
    revolute_si, pair, prismatic_si = column.unit.partition("|")
    if not pair:
        prismatic_si = revolute_si
    unit = heading.unit
    if unit is None:
        return Scale((revolute_si, revolute_si), (prismatic_si, prismatic_si))
    revolute_unit, both, prismatic_unit = unit.partition("|")
    if not both:
        prismatic_unit = revolute_unit
    scale = Scale((revolute_unit, revolute_si), (prismatic_unit, prismatic_si))
    try:
        fits = [scale.of("revolute") is not None]
        if both or not fits[0]:
            fits.append(scale.of("prismatic") is not None)
    except UnknownUnitError as error:
        si = [text for text in dict.fromkeys((*column.unit.split("|"), column.unit)) if text]
        others = [text for text, (to, _) in COMMON.items() if to in si]
        problems.error(
            f"{str(error)[:60]!r} is no unit; {column.name} is "
            + (f"in {' or '.join((*si, *others))}." if si else "a plain number."),
            raw.file,
            raw.line,
            column.name,
            str(heading),
        )
        return None
    if (both and not (pair and all(fits))) or not any(fits):
        problems.error(
            f"{unit} is a unit of the wrong kind; {column.name} is "
            + (f"in {column.unit} or multiples of it." if column.unit else "a plain number."),
            raw.file,
            raw.line,
            column.name,
            str(heading),
        )
        return None
    return scale
