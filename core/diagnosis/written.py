"""A diagnosis on disk: verdict and page, the effects found as tables of a database, the next motion as one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from ..database import FrozenMap
from ..database.write import folder_texts
from ..errors import UsageError
from ..files import insist_on_room, write_whole
from .as_json import MOTION_FILE, as_json
from .diagnosis import Diagnosis

JSON_FILE, PAGE_FILE, EFFECTS = "diagnosis.json", "report.html", "effects"


def files_of(diagnosis: Diagnosis, page: str) -> dict[str, str]:
    """Relative path to text of everything that a diagnosis writes.

    Args:
        diagnosis: What was found.
        page: The report as HTML.
    """
    following = diagnosis.next_experiment
    motion_name = Path(MOTION_FILE).stem
    # the database's own writer: the tables read back to the last bit, as any of its tables do
    found = replace(
        diagnosis.corrected,
        effects=FrozenMap(sorted(diagnosis.effects.items())),
        motions=FrozenMap({} if following is None else {motion_name: following.motion}),
    )
    tables = {name: text for name, text in folder_texts(found).items() if "/" in name}
    verdict = json.dumps(as_json(diagnosis), indent=1, allow_nan=False) + "\n"
    return {JSON_FILE: verdict, PAGE_FILE: page, **tables}


def check_place(folder: Path, *, force: bool) -> None:
    """Refuse a folder that holds a diagnosis, or tables that would be taken for one's, before the minutes of work.

    Raises:
        UsageError: Something is in the way, or nothing can be written there.
    """
    insist_on_room(folder, (), force=force)
    there = _there(folder)
    if there and not force:
        raise UsageError(f"{folder / there[0]} exists already; choose another place or give --force.")


def write_files(folder: Path, files: dict[str, str], *, force: bool = False) -> None:
    """Write the files of a diagnosis, whole or not at all; with `force` those of an earlier one go.

    Raises:
        UsageError: Something is in the way, or the system refuses to write.
    """
    check_place(folder, force=force)
    # an effect that was found before and is not any more must not stay among the tables
    old = [name for name in _there(folder) if name not in files]
    write_whole(folder, files, force=force, without=old)


def _there(folder: Path) -> list[str]:
    """What a diagnosis has written into a folder, relative to it."""
    names = [JSON_FILE, PAGE_FILE, MOTION_FILE, *(f"{EFFECTS}/{path.name}" for path in folder.glob(f"{EFFECTS}/*.dat"))]
    return sorted(name for name in names if (folder / name).exists())
