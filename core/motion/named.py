"""Motions by name: those of the database, those built in, and those in files."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..representation import Robot
from .law import MotionLaw, hold

if TYPE_CHECKING:
    from ..database import Database

BUILT_IN = ("greca", "excitation", "hold")
HOLD_DURATION = 1.0


def motion_names(database: Database | None = None) -> tuple[str, ...]:
    """Names that `motion_named` knows, without files: the database's first."""
    own = tuple(database.motions) if database is not None else ()
    return (*own, *(name for name in BUILT_IN if name not in own))


def motion_named(robot: Robot, name: str, database: Database | None = None) -> MotionLaw:
    """The motion of a name: a table of the database, "greca", "excitation", "hold" (home), or a file.

    A file is a motion table (`.dat`), a run's data file (`.csv`, `.parquet`) or a run's folder.

    Args:
        robot: Who moves; built-in motions keep its limits.
        name: Of the motion, or a path.
        database: Whose motion tables count; they go before built-in names.

    Raises:
        UsageError: No such motion; the message lists those there are. Or the robot cannot do it.
        RunFileError: The file holds no motion of this robot.
    """
    if database is not None and name in database.motions:
        from .tables import law_of_table

        return law_of_table(database.motions[name], f"motion {name} of {database.name}")
    if name == "greca":
        from .greca import greca

        return greca(robot)
    if name == "excitation":
        from .excitation import excitation

        return excitation(robot)
    if name == "hold":
        return hold(robot.home(), HOLD_DURATION)
    path = Path(name)
    if path.exists():
        return _from_file(path, robot)
    known = motion_names(database)
    near = difflib.get_close_matches(name, known, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    raise UsageError(
        f"{robot.name} has no motion {name!r}, and there is no such file.{hint} Known: {', '.join(known)}, a motion "
        "table (.dat), or a run (its folder or data file)."
    )


def _from_file(path: Path, robot: Robot) -> MotionLaw:
    from ..data_file import DATA_SUFFIXES
    from ..database import load_motion
    from .tables import law_of_table, read_run_motion

    if path.is_dir() or path.suffix in DATA_SUFFIXES:
        return read_run_motion(path, robot.n)
    return law_of_table(load_motion(path, [stage.joint for stage in robot.stages]), str(path))
