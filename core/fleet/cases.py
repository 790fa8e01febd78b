"""The cases of a fleet: folders of one robot and its runs each."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from ..errors import UsageError

ROBOT, RUNS, HOLDOUT = "robot", "runs", "holdout"


@dataclass(frozen=True, slots=True)
class Case:
    """One robot and its runs.

    Attributes:
        name: Of its folder.
        robot: Its database: a folder, or a YAML file.
        runs: Folder of its runs.
        holdout: Folder of the runs that no fit may see; None: each run is left out in turn.
    """

    name: str
    robot: Path
    runs: Path
    holdout: Path | None

    def content_hash(self) -> str:
        """SHA-256 of all files that are read for it, hex."""
        hashed = hashlib.sha256()
        for part in (self.robot, self.runs, self.holdout):
            if part is None:
                continue
            files = sorted(path for path in part.rglob("*") if path.is_file()) if part.is_dir() else [part]
            for path in files:
                name = path.relative_to(part).as_posix() if path != part else ""
                hashed.update(f"{part.name}/{name}\0{path.stat().st_size}\0".encode())
                with path.open("rb") as file:
                    hashed.update(hashlib.file_digest(file, "sha256").digest())
        return hashed.hexdigest()


def cases_in(folder: Path) -> tuple[Case, ...]:
    """The cases of a folder, by name.

    A case is a folder with `runs/` (runs as log.md has them), `robot/` or `robot.yaml` (a database; where it has none,
    the fleet folder's own counts for it: robots of one make), and `holdout/` where some runs are to be held out.

    Raises:
        UsageError: There is no such folder, no case in it, or a case has no robot.
    """
    if not folder.is_dir():
        raise UsageError(f"{folder} is no folder of robots and runs.")
    shared = _robot_in(folder)
    found: list[Case] = []
    for place in sorted(path for path in folder.iterdir() if (path / RUNS).is_dir()):
        robot = _robot_in(place) or shared
        if robot is None:
            raise UsageError(
                f"{place} has runs and no robot: it needs {ROBOT}/ or {ROBOT}.yaml, or {folder} has one for all."
            )
        held = place / HOLDOUT
        found.append(Case(place.name, robot, place / RUNS, held if held.is_dir() and any(held.iterdir()) else None))
    if not found:
        raise UsageError(
            f"{folder} holds no case: folders with {RUNS}/, and {ROBOT}/ or {ROBOT}.yaml in each or beside them."
        )
    return tuple(found)


def _robot_in(folder: Path) -> Path | None:
    if (folder / ROBOT).is_dir():
        return folder / ROBOT
    return folder / f"{ROBOT}.yaml" if (folder / f"{ROBOT}.yaml").is_file() else None
