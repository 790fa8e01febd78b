"""Motion tables of the database, and motions out of recorded runs, as motion laws."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..data_file import column_names, data_file_of, read_columns
from ..database import MotionTable
from ..errors import Problem, RunFileError
from .law import MotionLaw, from_table


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
    """The motion that a run's data file was asked for, or, where it says none, the one that it measured.

    As log.md has it: cubic Hermite pieces through q_cmd where dq_cmd is there, else an Akima spline; of a run without
    q_cmd, an Akima spline through the measured q. The first row becomes t = 0.

    Args:
        path: The run's data file (CSV or Parquet), or its folder.
        n: Number of joints.

    Raises:
        RunFileError: With file, row and column of what is wrong.
    """
    if path.is_dir():
        path = data_file_of(path)
    columns = read_columns(path, _wanted(column_names(path), path, n))
    for name, values in columns.items():
        whole = np.isfinite(values)
        if not whole.all():
            message = f"row {int(np.argmin(whole)) + 1} holds no number that a motion can have"
            raise RunFileError((Problem(message, file=str(path), column=name),))
    t, q, dq = columns["t"], [columns[name] for name in columns if name.startswith("q")], None
    if any(name.startswith("dq") for name in columns):
        dq = np.column_stack([columns[name] for name in columns if name.startswith("dq")])
    return from_table(t - t[:1], np.column_stack(q), dq, source=str(path))


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
