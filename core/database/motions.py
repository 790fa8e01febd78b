"""Motion tables: times and the joints' positions, speeds and accelerations at the knots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..effects import Column
from ..errors import RunFileError
from ..representation import Joint, JointKind
from .database import MotionTable
from .problems import Problems, listed
from .rows import cell_value, check_header, column_scale
from .schema import Table, motion_table
from .table import RawTable, parse_table, read_text
from .units import to_si


def parse_motion(text: str, joints: Sequence[Joint], file: str = "motion") -> MotionTable:
    """A motion table from its text.

    Args:
        text: As a file `motions/<name>.dat` has it.
        joints: The robot's joints; they say the units.
        file: Name for the messages.

    Raises:
        RunFileError: With everything that is wrong with it.
    """
    problems = Problems()
    raw = parse_table(text, file, problems)
    kinds: list[JointKind] = [joint.kind for joint in joints]
    motion = None if raw is None else read_motion_rows(file, raw, kinds, problems)
    if motion is None or problems.errors:
        raise RunFileError(problems.errors)
    return motion


def load_motion(path: Path, joints: Sequence[Joint]) -> MotionTable:
    """A motion table from a file.

    Raises:
        RunFileError: With everything that is wrong with it.
    """
    problems = Problems()
    text = read_text(path, str(path), problems)
    if text is None:
        raise RunFileError(problems.errors)
    return parse_motion(text, joints, str(path))


def read_motion_rows(name: str, raw: RawTable, kinds: Sequence[JointKind], problems: Problems) -> MotionTable | None:
    """A motion table from its rows; None, with problems noted, where it has an error.

    Args:
        name: Of the motion.
        raw: Its text.
        kinds: Kind of each joint.
        problems: Takes what is wrong.
    """
    before = len(problems.errors)
    table = motion_table(name, tuple(kinds))
    indices = _check_header(raw, table, kinds, problems)
    columns: dict[str, tuple[float, ...]] = {}
    time = Column("t", "s")
    for column in (time, *(c for c in table.columns if isinstance(c, Column))):
        if column.name in indices:
            columns[column.name] = _values(raw, indices[column.name], column, problems)
    if len(raw.rows) < 2:
        problems.error("a motion has at least two rows.", raw.file, raw.line)
    if len(problems.errors) > before:
        return None
    t = columns["t"]
    for row, earlier, later in zip(raw.rows[1:], t, t[1:], strict=False):
        if later <= earlier:
            text = row.cells[indices["t"]]
            problems.error(
                f"times must grow: {later!r} s comes after {earlier!r} s.",
                raw.file,
                row.line_of(indices["t"]),
                "t",
                text,
            )
    if len(problems.errors) > before:
        return None
    joints = range(1, len(kinds) + 1)

    def together(quantity: str) -> tuple[tuple[float, ...], ...] | None:
        if f"{quantity}1" not in columns:
            return None
        return tuple(zip(*(columns[f"{quantity}{joint}"] for joint in joints), strict=True))

    return MotionTable(t, together("q") or (), together("dq"), together("ddq"))


def _check_header(raw: RawTable, table: Table, kinds: Sequence[JointKind], problems: Problems) -> dict[str, int]:
    indices = check_header(raw, table, problems)
    for quantity in ("dq", "ddq"):
        names = [f"{quantity}{joint}" for joint in range(1, len(kinds) + 1)]
        missing = [name for name in names if name not in indices]
        if missing and len(missing) < len(names):
            problems.error(
                f"{quantity} is there for some joints only; {listed(missing)} {'are' if len(missing) > 1 else 'is'} "
                "missing.",
                raw.file,
                raw.line,
                missing[0],
            )
    if "ddq1" in indices and "dq1" not in indices:
        problems.error("accelerations need the speeds dq1 ... beside them.", raw.file, raw.line, "ddq1")
    return indices


def _values(raw: RawTable, index: int, column: Column, problems: Problems) -> tuple[float, ...]:
    """A column in SI; a cell that is no number is noted and left out."""
    scale = column_scale(raw.headings[index], column, raw, problems)
    by = None if scale is None else scale.of("revolute")
    values: list[float] = []
    for row in raw.rows:
        text = row.cells[index]
        if text is None:
            problems.error(f"{column.name} is missing.", raw.file, row.line, column.name)
            continue
        value, fault = cell_value(text, column)
        if fault is not None:
            problems.error(fault, raw.file, row.line_of(index), column.name, text)
        elif by is not None:
            values.append(to_si(text, value, by))
    return tuple(values)
