"""Running a study: every variant once, wherever there is room, its results in the order of the variants."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..parallel import check_options, progress_bar, run_all
from .experiment import Outcome
from .ledger import Ledger

if TYPE_CHECKING:
    from .study import Study


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
    check_options(workers, dask)
    ledger = Ledger(folder, study, force=force)
    outcomes = ledger.finished()
    todo = [(variant, values) for variant, values in study.tasks() if variant not in outcomes]
    if todo:
        with ledger.writing() as add, progress_bar(progress, "variants", len(todo), len(outcomes), _failed) as tell:

            def keep(outcome: Outcome) -> None:
                outcomes[outcome.variant] = outcome
                add(outcome)
                tell(outcome)

            run_all(study.experiment, todo, keep, workers=workers, dask=dask)
    return {variant: outcomes[variant] for variant in sorted(outcomes)}


def _failed(outcome: Outcome) -> bool:
    return bool(outcome.failed)
