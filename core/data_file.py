"""Columns of numbers out of a run's data file, CSV or Parquet: every digit, bounded in size, nothing executed."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import Problem, RunFileError

Array = NDArray[np.float64]

DATA_SUFFIXES = (".csv", ".parquet")

# half an hour at 1 kHz fits; what is larger is no motion of a robot
MOST_SAMPLES = 2_000_000
MOST_CELLS = 200_000_000
LARGEST_DATA = 2**31
LONGEST_LINE = 2**20
# how Arrow's kinds of numbers begin
_NUMBERS = ("int", "uint", "halffloat", "float", "double", "bool", "null")


def data_file_of(folder: Path) -> Path:
    """The data file of a run's folder.

    Raises:
        RunFileError: There is none, or more than one.
    """
    found = [folder / f"data{suffix}" for suffix in DATA_SUFFIXES if (folder / f"data{suffix}").is_file()]
    if not found:
        raise RunFileError((Problem("a run's folder has a data.csv or a data.parquet", file=str(folder)),))
    if len(found) > 1:
        message = f"holds {' and '.join(path.name for path in found)}; a run has one of them"
        raise RunFileError((Problem(message, file=str(folder)),))
    return found[0]


def column_names(path: Path) -> tuple[str, ...]:
    """Names of a data file's columns in its order.

    Raises:
        RunFileError: It cannot be read, is no such file, or is larger than a run may be.
    """
    _check_size(path)
    if path.suffix == ".parquet":
        return tuple(str(name) for name in _open_parquet(path).schema_arrow.names)
    try:
        _count_lines(path, most=1)
        with path.open(encoding="utf-8-sig", newline="") as stream:
            return tuple(name.strip() for name in next(csv.reader(stream, skipinitialspace=True), ()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _unreadable(path, error) from error


def read_columns(path: Path, names: Sequence[str]) -> dict[str, Array]:
    """Columns of a data file, each of shape (m,); a cell that is empty, nan or infinite is NaN.

    Args:
        path: CSV in UTF-8 whose first row names the columns, or Parquet.
        names: Which; they must be there (`column_names`).

    Raises:
        RunFileError: With file, row and column of what is wrong.
    """
    _check_size(path)
    columns = _from_parquet(path, names) if path.suffix == ".parquet" else _from_csv(path, names)
    for values in columns.values():
        values[~np.isfinite(values)] = math.nan
    return columns


def _check_size(path: Path) -> None:
    """Refuse what is no file, or is larger than any run."""
    if not path.is_file():
        raise RunFileError((Problem("is no file" if path.exists() else "there is no such file", file=str(path)),))
    size = path.stat().st_size
    if size > LARGEST_DATA:
        raise RunFileError((Problem(f"has {size} bytes; a run's data may have {LARGEST_DATA}", file=str(path)),))


def _check_length(path: Path, rows: int, columns: int) -> None:
    if rows > MOST_SAMPLES:
        raise RunFileError((Problem(f"has {rows} rows; a run may have {MOST_SAMPLES}", file=str(path)),))
    if rows * columns > MOST_CELLS:
        message = f"has {rows} rows of {columns} columns; a run may have {MOST_CELLS} numbers"
        raise RunFileError((Problem(message, file=str(path)),))


def _count_lines(path: Path, most: float = math.inf) -> int:
    """How many lines end in a file, up to about as many as asked for; none is longer than a line may be."""
    lines = since = 0
    with path.open("rb") as binary:
        while lines < most and (chunk := binary.read(LONGEST_LINE)):
            first, last = chunk.find(b"\n"), chunk.rfind(b"\n")
            since += first if first >= 0 else len(chunk)
            if since > LONGEST_LINE:
                message = f"the line has more than {LONGEST_LINE} bytes"
                raise RunFileError((Problem(message, file=str(path), line=lines + 1),))
            if first >= 0:
                lines += chunk.count(b"\n")
                since = len(chunk) - last - 1
    return lines


def _unreadable(path: Path, error: Exception) -> RunFileError:
    if isinstance(error, OSError):
        return RunFileError((Problem(f"cannot be read: {error.strerror or error}", file=str(path)),))
    return RunFileError((Problem(f"is no CSV file in UTF-8: {error}", file=str(path)),))


def _once(path: Path, header: Sequence[str], names: Sequence[str]) -> list[int]:
    """Places of columns in the header, each of which must stand there once."""
    for name in names:
        if header.count(name) > 1:
            raise RunFileError((Problem("the header names this column twice", file=str(path), column=name),))
    return [header.index(name) for name in names]


def _from_csv(path: Path, names: Sequence[str]) -> dict[str, Array]:
    try:
        lines = _count_lines(path)
        header = column_names(path)
        _check_length(path, lines - 1, len(header))
        places = _once(path, header, names)
        table = _plain_numbers(path, len(header)) if lines > 1 else None
        table = _cell_by_cell(path, header, places) if table is None else table[:, places]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _unreadable(path, error) from error
    return {name: np.ascontiguousarray(column) for name, column in zip(names, table.T, strict=True)}


def _plain_numbers(path: Path, columns: int) -> Array | None:
    """The whole table by the fast reader; None where it is more than numbers and equally long rows."""
    with path.open(encoding="utf-8-sig", newline="") as stream:
        next(csv.reader(stream))
        try:
            table = np.loadtxt(stream, delimiter=",", comments=None, quotechar='"', ndmin=2)
        except ValueError:
            return None
    return table if table.shape[1] == columns else None


def _cell_by_cell(path: Path, header: Sequence[str], places: Sequence[int]) -> Array:
    """The wanted columns by the reader that knows what is wrong, and where."""
    rows: list[list[float]] = []
    with path.open(encoding="utf-8-sig", newline="") as stream:
        reader = csv.reader(stream, skipinitialspace=True)
        next(reader, None)
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(header):
                message = f"the row has {len(cells)} cells, the header names {len(header)} columns"
                raise RunFileError((Problem(message, file=str(path), line=reader.line_num),))
            rows.append([_number(cells[place], path, reader.line_num, header[place]) for place in places])
    return np.array(rows, dtype=np.float64).reshape(-1, len(places))


def _number(text: str, path: Path, line: int, name: str) -> float:
    if not text.strip():
        return math.nan
    try:
        return float(text)
    except ValueError as error:
        message = "is no number (a sample that is missing is an empty cell or nan)"
        raise RunFileError((Problem(message, file=str(path), line=line, column=name, value=text),)) from error


def _open_parquet(path: Path) -> Any:
    try:
        parquet: Any = import_module("pyarrow.parquet")
    except ImportError as error:
        problem = Problem("Parquet needs pyarrow: pip install mbexport[parquet]", file=str(path))
        raise RunFileError((problem,)) from error
    try:
        return parquet.ParquetFile(path)
    except OSError as error:
        raise _unreadable(path, error) from error
    except (ValueError, TypeError) as error:
        # pyarrow's own errors of broken files are ValueErrors
        raise RunFileError((Problem(f"is no table of numbers: {error}", file=str(path)),)) from error


def _from_parquet(path: Path, names: Sequence[str]) -> dict[str, Array]:
    file = _open_parquet(path)
    # a file of a few kilobytes may unfold to any number of rows
    _check_length(path, file.metadata.num_rows, len(names))
    _once(path, [str(name) for name in file.schema_arrow.names], names)
    for name in names:
        # texts and lists may unfold to any size, and are no numbers
        kind = str(file.schema_arrow.field(name).type)
        if not kind.startswith(_NUMBERS):
            message = f"holds values of kind {kind[:40]}, not numbers"
            raise RunFileError((Problem(message, file=str(path), column=name),))
    try:
        frame = file.read(columns=list(names))
    except OSError as error:
        raise _unreadable(path, error) from error
    except (ValueError, TypeError) as error:
        raise RunFileError((Problem(f"is no table of numbers: {error}", file=str(path)),)) from error
    columns: dict[str, Array] = {}
    for name in names:
        try:
            columns[name] = np.array(np.asarray(frame[name]), dtype=np.float64)
        except (ValueError, TypeError) as error:
            raise RunFileError((Problem(f"is no column of numbers: {error}", file=str(path), column=name),)) from error
    return columns
