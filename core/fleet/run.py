"""Running a fleet: every case once, kept as it is done, so that a fleet that was stopped goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

from ..diagnosis.diagnosis import Diagnosis
from ..diagnosis.written import JSON_FILE, write_files
from ..errors import UsageError
from ..files import write_whole
from ..parallel import check_options, progress_bar, run_all
from ..simulation import backend_named
from .cases import Case
from .work import Diagnosing, Outcome

SCHEMA = "mbexport-fleet/1"
FLEET_FILE = "fleet.json"
# beside each case's diagnosis: what it was made of, and why there is none
RECORD = "case.json"


def plan_fleet(
    page: Callable[[Diagnosis], str],
    *,
    level: str = "full",
    backend: str = "mjcf",
    backends: Sequence[str] | None = None,
) -> Diagnosing:
    """How every case is diagnosed.

    Args:
        page: Diagnosis to its page as HTML; a function that other processes can import.
        level: Of the nominal models.
        backend: Engine in which candidates are simulated.
        backends: Where corrected robots are simulated again; None: everywhere.

    Raises:
        PluginError: No such backend.
    """
    for name in (backend, *(backends or ())):
        backend_named(name)
    return Diagnosing(level, backend, None if backends is None else tuple(backends), page)


def run_fleet(
    work: Diagnosing,
    cases: Sequence[Case],
    folder: Path,
    *,
    workers: int | None = None,
    dask: str | None = None,
    force: bool = False,
    progress: bool = False,
) -> dict[str, str]:
    """Diagnose what of a fleet is not done yet; FOLDER/<case>/ gets what a diagnosis writes.

    A case is done where its robot and runs are those that its diagnosis was made of; one that failed is tried again.

    Args:
        work: How.
        cases: Which.
        folder: Where diagnoses go.
        workers: Processes of this machine; None: as many as it has cores.
        dask: Address of a Dask scheduler instead; its workers see the cases under the same paths.
        force: Begin anew, whatever is in the folder.
        progress: Show a progress bar on standard error.

    Returns:
        Name of each case that failed -> why.

    Raises:
        UsageError: Options that do not fit together; the folder holds a fleet diagnosed otherwise; no cluster.
    """
    check_options(workers, dask)
    conditions = {"level": work.level, "backend": work.backend, "backends": work.backends and list(work.backends)}
    _check_same(folder, conditions, force=force)
    facts = {"schema": SCHEMA, **conditions, "versions": work.versions()}
    write_whole(
        folder, {FLEET_FILE: json.dumps(facts, indent=1) + "\n"}, force=force or (folder / FLEET_FILE).is_file()
    )
    hashes = [case.content_hash() for case in cases]
    todo = [
        (number, case)
        for number, (case, content) in enumerate(zip(cases, hashes, strict=True))
        if force or not _done(folder / case.name, content)
    ]
    failures: dict[str, str] = {}

    def keep(outcome: Outcome) -> None:
        case = cases[outcome.number]
        record = {"content": hashes[outcome.number], "failed": outcome.failed, "reason": outcome.reason}
        # the record last: a case without one is not done
        (folder / case.name / RECORD).unlink(missing_ok=True)
        write_files(folder / case.name, dict(outcome.files), force=True)
        write_whole(folder / case.name, {RECORD: json.dumps(record, indent=1) + "\n"}, force=True)
        if outcome.failed:
            failures[case.name] = f"{outcome.failed}: {outcome.reason}"

    with progress_bar(progress, "cases", len(todo), len(cases) - len(todo), _failed) as tell:

        def keep_and_tell(outcome: Outcome) -> None:
            keep(outcome)
            tell(outcome)

        run_all(work, todo, keep_and_tell, workers=workers, dask=dask)
    return dict(sorted(failures.items()))


def _failed(outcome: Outcome) -> bool:
    return bool(outcome.failed)


def _done(folder: Path, content: str) -> bool:
    record = read_json(folder / RECORD)
    return record.get("content") == content and not record.get("failed") and (folder / JSON_FILE).is_file()


def read_json(path: Path) -> dict[str, Any]:
    """A mapping from a file; {} where it holds none."""
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return cast("dict[str, Any]", data) if isinstance(data, dict) else {}


def _check_same(folder: Path, conditions: dict[str, Any], *, force: bool) -> None:
    if force or not folder.exists():
        return
    path = folder / FLEET_FILE
    if not path.exists():
        if any(folder.iterdir()):
            raise UsageError(f"{folder} is not empty and holds no fleet; choose another folder, or --force.")
        return
    there = read_json(path)
    if there.get("schema") != SCHEMA:
        raise UsageError(f"{path} is no fleet of ours; choose another folder, or --force to begin anew.")
    for key, value in conditions.items():
        if there.get(key) != value:
            raise UsageError(
                f"{folder} holds a fleet that was diagnosed with {key} {there.get(key)!r}, not {value!r}; choose "
                "another folder, or --force to begin anew."
            )
