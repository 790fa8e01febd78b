"""The variants that are finished, on disk as they finish, so that a study goes on where it was stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ..errors import UsageError
from ..files import write_whole
from .experiment import NOMINAL, Outcome

if TYPE_CHECKING:
    from .study import Study

STUDY_FILE = "study.json"
TABLE_FILE, INDICES_FILE = "variants.parquet", "sensitivity.json"
PICTURE_FILE, PAGE_FILE = "study.png", "report.html"
_PATTERN = "finished-*.jsonl"


class Ledger:
    """A file of one line a finished variant, beside the study's own description.

    The file's name has the study's hash. Lines are only added; one that was cut off by a crash is not counted, and its
    variant runs again.
    """

    def __init__(self, folder: Path, study: Study, *, force: bool = False) -> None:
        """Open the study's folder; made if it is not there.

        Args:
            folder: Where the study's results go.
            study: Whose variants.
            force: Begin anew, whatever study was there.

        Raises:
            UsageError: The folder holds another study, or cannot be written.
        """
        facts = study.facts()
        self._path = folder / f"finished-{facts['study'][:16]}.jsonl"
        self._figures = len(facts["columns"]) - len(facts["parameters"])
        self._variants = facts["variants"]
        if not force:
            _check_same(folder, facts)
        text = json.dumps(facts, indent=1) + "\n"
        write_whole(folder, {STUDY_FILE: text}, force=force or (folder / STUDY_FILE).is_file())
        with _told(folder):
            for path in folder.glob(_PATTERN) if force else ():
                with path.open("ab") as file:
                    _lock(file, folder)
                path.unlink()

    def finished(self) -> dict[int, Outcome]:
        """Outcomes of the variants that are finished, by number."""
        found: dict[int, Outcome] = {}
        with _told(self._path.parent):
            lines = self._path.read_bytes().splitlines() if self._path.is_file() else []
        for line in lines:
            outcome = self._read(line)
            if outcome is not None:
                found[outcome.variant] = outcome
        return found

    @contextmanager
    def writing(self) -> Generator[Callable[[Outcome], None], None, None]:
        """A function that adds an outcome.

        Raises:
            UsageError: Another process writes into the same study.
        """
        folder = self._path.parent
        with _told(folder):
            file = self._path.open("ab")
        with file:
            _lock(file, folder)
            if file.tell() and not self._path.read_bytes().endswith(b"\n"):
                file.write(b"\n")

            def add(outcome: Outcome) -> None:
                with _told(folder):
                    file.write(_line(outcome))
                    file.flush()

            yield add

    def _read(self, line: bytes) -> Outcome | None:
        """The outcome of a line; None where the line is not whole."""
        try:
            data = json.loads(line)
        except ValueError:
            return None
        match data:
            case {"variant": int(variant), "figures": [*numbers]}:
                figures = tuple(number for number in cast("list[object]", numbers) if isinstance(number, float))
                whole = len(figures) == len(cast("list[object]", numbers)) == self._figures
                return Outcome(variant, figures) if whole and self._ours(variant) else None
            case {"variant": int(variant), "failed": str(failed), "reason": str(reason)}:
                return Outcome(variant, (), failed, reason) if self._ours(variant) else None
            case _:
                return None

    def _ours(self, variant: int) -> bool:
        return NOMINAL <= variant < self._variants


def _line(outcome: Outcome) -> bytes:
    data: dict[str, object] = {"variant": outcome.variant}
    data |= {"failed": outcome.failed, "reason": outcome.reason} if outcome.failed else {"figures": outcome.figures}
    return json.dumps(data).encode() + b"\n"


def _check_same(folder: Path, facts: dict[str, Any]) -> None:
    path = folder / STUDY_FILE
    if not path.exists():
        for name in (TABLE_FILE, INDICES_FILE, PICTURE_FILE, PAGE_FILE):
            if (folder / name).exists():
                raise UsageError(f"{folder / name} exists already and is of no study; choose another place or --force.")
        return
    try:
        there: Any = json.loads(path.read_text(encoding="utf-8"))
        name = there["study"]
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise UsageError(f"{path} is no study of ours; choose another folder, or --force to begin anew.") from error
    if name != facts["study"]:
        keys = [key for key in facts if key not in ("study", "versions", "columns") and there.get(key) != facts[key]]
        raise UsageError(
            f"{folder} holds another study (it differs in {', '.join(keys) or 'its samples or its motion'}); choose "
            "another folder, or --force to begin anew."
        )


@contextmanager
def _told(folder: Path) -> Generator[None, None, None]:
    try:
        yield
    except OSError as error:
        raise UsageError(f"cannot write into {folder}: {error.strerror or error}.") from error


def _lock(file: Any, folder: Path) -> None:
    """Keep other processes out for as long as the file is open, where the system can."""
    with suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UsageError(f"another process runs the study in {folder}.") from error
