"""Running a study: every variant once, wherever there is room, its results in the order of the variants."""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import UsageError
from .experiment import Outcome
from .ledger import Ledger
from .workers import Cluster, Processes, ThisProcess, Values, Workers, cores

if TYPE_CHECKING:
    from .study import Study

# variants that wait at each place where one runs: enough that none idles, few enough to stop at once
WAITING = 2

Tell = Callable[[Outcome], None]


def run_study(
    study: Study,
    folder: Path,
    *,
    workers: int | None = None,
    dask: str | None = None,
    force: bool = False,
    progress: bool = False,
) -> dict[int, Outcome]:
    """Run what of a study is not finished yet.

    Args:
        study: As planned.
        folder: Where finished variants are kept, and found again.
        workers: Processes of this machine; None: as many as it has cores.
        dask: Address of a Dask scheduler instead.
        force: Begin anew, whatever is in the folder.
        progress: Show a progress bar on standard error.

    Returns:
        The outcome of every variant, and of the database as it stands (`NOMINAL`), in order.

    Raises:
        UsageError: Options that do not fit together; the folder holds another study; no cluster.
    """
    if workers is not None and dask is not None:
        raise UsageError("--workers and --dask exclude each other; a cluster has its own.")
    if workers is not None and not 1 <= workers <= 1024:
        raise UsageError(f"--workers {workers}: it must be from 1 to 1024.")
    ledger = Ledger(folder, study, force=force)
    outcomes = ledger.finished()
    todo = [(variant, values) for variant, values in study.tasks() if variant not in outcomes]
    if todo:
        with ledger.writing() as add, _bar(progress, len(todo), len(outcomes)) as tell:

            def keep(outcome: Outcome) -> None:
                outcomes[outcome.variant] = outcome
                add(outcome)
                tell(outcome)

            # none more than there is to do
            staff = _staff(study, min(workers or cores(), len(todo)), dask)
            try:
                _run_all(staff, todo, keep)
            finally:
                staff.close()
    return {variant: outcomes[variant] for variant in sorted(outcomes)}


def _staff(study: Study, workers: int, dask: str | None) -> Workers:
    experiment = study.experiment
    if dask is not None:
        return Cluster(experiment, dask)
    return Processes(experiment, workers) if workers > 1 else ThisProcess(experiment)


def _run_all(staff: Workers, todo: list[tuple[int, Values]], keep: Tell) -> None:
    waiting = iter(todo)
    running: dict[Future[Outcome], tuple[int, Values]] = {}

    def fill() -> None:
        while len(running) < WAITING * staff.slots:
            task = next(waiting, None)
            if task is None:
                return
            running[staff.submit(*task)] = task

    try:
        fill()
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            died: list[tuple[int, Values]] = []
            for future in done:
                task = running.pop(future)
                try:
                    keep(future.result())
                except staff.deaths:
                    died.append(task)
            if died:
                # whoever ran beside it died too: each again, alone, tells which it was
                died += _left_over(running, staff, keep)
                staff.restart()
                for task in sorted(died):
                    keep(_alone(staff, task))
            fill()
    except KeyboardInterrupt:
        # what runs is let finish, and kept
        for future in running:
            if not future.cancel() and not future.exception():
                keep(future.result())
        raise


def _left_over(
    running: dict[Future[Outcome], tuple[int, Values]], staff: Workers, keep: Tell
) -> list[tuple[int, Values]]:
    """Takes what runs after a death; gives back the tasks that it took along."""
    died: list[tuple[int, Values]] = []
    for future, task in running.items():
        try:
            keep(future.result())
        except staff.deaths:
            died.append(task)
    running.clear()
    return died


def _alone(staff: Workers, task: tuple[int, Values]) -> Outcome:
    try:
        return staff.submit(*task).result()
    except staff.deaths:
        staff.restart()
        return Outcome(task[0], (), "crashed", "the process that ran it died.")


@contextmanager
def _bar(wanted: bool, total: int, before: int) -> Generator[Tell, None, None]:
    """A function that is told each outcome, with or without a bar."""
    if not wanted:
        yield _say_nothing
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("variants", total=total + before, completed=before)
        failed = 0

        def advance(outcome: Outcome) -> None:
            nonlocal failed
            failed += bool(outcome.failed)
            progress.update(task, advance=1, description=f"variants ({failed} failed)" if failed else "variants")

        yield advance


def _say_nothing(outcome: Outcome) -> None:
    """No bar."""
