"""Motion tables of the database, and motions out of recorded runs, as motion laws."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..database import MotionTable
from ..errors import Problem, RunFileError
from .law import MotionLaw, from_table

Array = NDArray[np.float64]

DATA_SUFFIXES = (".csv", ".parquet")

# half an hour at 1 kHz fits; what is larger is no motion of a robot
MOST_SAMPLES = 2_000_000
LARGEST_DATA = 2**31
_CHUNK = 2**20


def law_of_table(table: MotionTable, source: str | None = None) -> MotionLaw:
    """The law of a database's motion table: as many of q, dq, ddq as it has are kept at its knots.

    Raises:
        RunFileError: The table makes no motion.
    """
    return from_table(table.t, table.q, table.dq, table.ddq, source=source)


def table_of_law(law: MotionLaw) -> MotionTable:
    """A motion table with position, speed and acceleration at a law's knots.

    The same law comes back from it where the law's pieces are quintic and join with continuous acceleration.
    """
    q, dq, ddq = (tuple(tuple(row) for row in values.tolist()) for values in law.at(law.knots))
    return MotionTable(tuple(law.knots.tolist()), q, dq, ddq)


def read_run_motion(path: Path, n: int) -> MotionLaw:
    """The motion that a recorded run was asked for, or, where it says none, the one that it measured.

    As log.md has it: cubic Hermite pieces through q_cmd where dq_cmd is there, else an Akima spline; of a run without
    q_cmd, an Akima spline through the measured q. The first row becomes t = 0.

    Args:
        path: The run's data file (CSV or Parquet), or its folder.
        n: Number of joints.

    Raises:
        RunFileError: With file, row and column of what is wrong.
    """
    if path.is_dir():
        path = _data_file(path)
    _check_size(path)
    columns = _read_parquet(path, n) if path.suffix == ".parquet" else _read_csv(path, n)
    t, q, dq = columns["t"], [columns[name] for name in columns if name.startswith("q")], None
    if any(name.startswith("dq") for name in columns):
        dq = np.column_stack([columns[name] for name in columns if name.startswith("dq")])
    return from_table(t - t[:1], np.column_stack(q), dq, source=str(path))


def _data_file(folder: Path) -> Path:
    for suffix in DATA_SUFFIXES:
        if (folder / f"data{suffix}").is_file():
            return folder / f"data{suffix}"
    raise RunFileError((Problem("a run's folder has a data.csv or a data.parquet", file=str(folder)),))


def _check_size(path: Path) -> None:
    """Refuse what is no file, or is larger than any run."""
    if not path.is_file():
        raise RunFileError((Problem("is no file" if path.exists() else "there is no such file", file=str(path)),))
    size = path.stat().st_size
    if size > LARGEST_DATA:
        raise RunFileError((Problem(f"has {size} bytes; a run's data may have {LARGEST_DATA}", file=str(path)),))


def _too_long(path: Path, rows: int) -> RunFileError:
    return RunFileError((Problem(f"has {rows} rows; a motion may have {MOST_SAMPLES}", file=str(path)),))


def _wanted(names: Sequence[str], path: Path, n: int) -> list[str]:
    """Which of a run's columns make its motion: t, then positions, then speeds."""

    def signals(signal: str) -> list[str]:
        return [f"{signal}_{i + 1}" for i in range(n)]

    commanded = set(signals("q_cmd")) <= set(names)
    positions = signals("q_cmd" if commanded else "q")
    for name in ("t", *positions):
        if name not in names:
            message = (
                f"there is no column {name}; a motion of {n} joints needs t and q_cmd_1 ... q_cmd_{n} "
                f"(or q_1 ... q_{n})"
            )
            raise RunFileError((Problem(message, file=str(path), column=name),))
    extra = f"{positions[0][:-1]}{n + 1}"
    if extra in names:
        message = f"the file has a joint more than the robot's {n}"
        raise RunFileError((Problem(message, file=str(path), column=extra),))
    speeds = signals("dq_cmd")
    return ["t", *positions, *(speeds if commanded and set(speeds) <= set(names) else [])]


def _read_csv(path: Path, n: int) -> dict[str, Array]:
    """The columns of a motion, every digit of them."""
    try:
        with path.open("rb") as binary:
            lines = sum(chunk.count(b"\n") for chunk in iter(lambda: binary.read(_CHUNK), b""))
        if lines > MOST_SAMPLES + 1:
            raise _too_long(path, lines - 1)
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, skipinitialspace=True)
            names = [name.strip() for name in next(reader, ())]
            wanted = _wanted(names, path, n)
            places = [names.index(name) for name in wanted]
            rows: list[list[float]] = []
            for cells in reader:
                if not cells:
                    continue
                if len(cells) != len(names):
                    message = f"the row has {len(cells)} cells, the header names {len(names)} columns"
                    raise RunFileError((Problem(message, file=str(path), line=reader.line_num),))
                rows.append([_number(cells[place], path, reader.line_num, names[place]) for place in places])
    except OSError as error:
        raise RunFileError((Problem(f"cannot be read: {error.strerror or error}", file=str(path)),)) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunFileError((Problem(f"is no CSV file in UTF-8: {error}", file=str(path)),)) from error
    return dict(zip(wanted, np.array(rows).reshape(-1, len(wanted)).T, strict=True))


def _number(text: str, path: Path, line: int, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        message = "is no number that a motion can have"
        raise RunFileError((Problem(message, file=str(path), line=line, column=name, value=text),))
    return value


def _read_parquet(path: Path, n: int) -> dict[str, Array]:
    try:
        parquet: Any = import_module("pyarrow.parquet")
        file = parquet.ParquetFile(path)
        # a file of a few kilobytes may unfold to any number of rows
        if file.metadata.num_rows > MOST_SAMPLES:
            raise _too_long(path, file.metadata.num_rows)
        wanted = _wanted([str(name) for name in file.schema_arrow.names], path, n)
        frame = file.read(columns=wanted)
        columns: dict[str, Array] = {name: np.asarray(frame[name], dtype=np.float64) for name in wanted}
    except ImportError as error:
        problem = Problem("Parquet needs pyarrow: pip install mbexport[parquet]", file=str(path))
        raise RunFileError((problem,)) from error
    except OSError as error:
        raise RunFileError((Problem(f"cannot be read: {error.strerror or error}", file=str(path)),)) from error
    except (ValueError, TypeError) as error:
        # pyarrow's own errors of broken files are ValueErrors
        raise RunFileError((Problem(f"is no table of numbers: {error}", file=str(path)),)) from error
    for name, values in columns.items():
        finite = np.isfinite(values)
        if not finite.all():
            message = f"row {int(np.argmin(finite)) + 1} holds no number that a motion can have"
            raise RunFileError((Problem(message, file=str(path), column=name),))
    return columns
