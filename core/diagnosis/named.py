"""A diagnosis of what a user names: a robot by its name or folder, runs by their folders or files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..database import Database, load
from ..errors import UsageError
from ..recording import Run, read_runs
from .diagnosis import Diagnosis

Named = str | Path | Run


def diagnose(
    robot: str | Path | Database,
    runs: Named | Sequence[Named],
    holdout: Named | Sequence[Named] = (),
    *,
    level: str = "full",
    backend: str = "mjcf",
    backends: Sequence[str] | None = None,
    progress: bool = False,
) -> Diagnosis:
    """Where the gap between a robot and its model lies, which effects cause it, how far it shrinks with them.

    Args:
        robot: A database, or the path or name of one.
        runs: Recorded runs, or their folders or data files; a folder of runs counts as its runs.
        holdout: Runs that no fit may see; none: each run is left out in turn.
        level: Of the nominal model.
        backend: Engine in which candidates are simulated.
        backends: Where the corrected robot is simulated again; None: everywhere.
        progress: Show a progress bar on standard error.

    Raises:
        UsageError: There is no such robot, level or backend, or a run is among `runs` and held out.
        InputError: A database or a run is wrong.
    """
    from .diagnose import diagnose as search

    database = robot if isinstance(robot, Database) else load(robot)
    seen, unseen = runs_named(runs, database), runs_named(holdout, database)
    check_apart(seen, unseen)
    return search(database, seen, unseen, level=level, backend=backend, backends=backends, progress=progress)


def runs_named(runs: Named | Sequence[Named], database: Database) -> tuple[Run, ...]:
    """Runs, those given by their paths read.

    Raises:
        RunFileError: A run is wrong.
    """
    named = [runs] if isinstance(runs, str | Path | Run) else list(runs)
    if all(not isinstance(run, Run) for run in named):
        return read_runs([Path(run) for run in named if not isinstance(run, Run)], database)
    return tuple(
        found for run in named for found in ([run] if isinstance(run, Run) else read_runs([Path(run)], database))
    )


def check_apart(runs: Sequence[Run], holdout: Sequence[Run]) -> None:
    """Refuse a run that would be judged by itself.

    Raises:
        UsageError: There are no runs, or one is held out and is not.
    """
    if not runs:
        raise UsageError("there are no runs to diagnose; give at least one.")
    for held in holdout:
        for run in runs:
            if np.array_equal(held.t, run.t) and np.array_equal(held.signals["q"], run.signals["q"], equal_nan=True):
                name = f"{held.name!r}" if held.name == run.name else f"{run.name!r} and {held.name!r}"
                raise UsageError(f"the same record, {name}, is among the runs and held out; a fit must not see it.")
