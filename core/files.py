"""Writing files whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

from .errors import UsageError


def write_whole(
    folder: Path, files: Mapping[str, str | bytes], *, force: bool = False, without: Iterable[str] = ()
) -> tuple[Path, ...]:
    """Write files into a folder; all of them appear, complete, or none does.

    Everything is written beside its place under a hidden name first and moved only when all of it is there.

    Args:
        folder: Where to; made if it is not there.
        files: Relative POSIX path to content; text is written as UTF-8.
        force: Replace files that are there.
        without: Relative paths of files that go when the others are there.

    Returns:
        The paths written, in the order given.

    Raises:
        UsageError: A file is in the way, a path leaves the folder, or the system refuses to write.
    """
    targets: list[tuple[Path, bytes]] = []
    for name, content in files.items():
        relative = PurePosixPath(name)
        if relative.is_absolute() or ".." in relative.parts:
            raise UsageError(f"{name!r} would be written outside of {folder}; names must stay inside the folder.")
        targets.append((folder / relative, content.encode("utf-8") if isinstance(content, str) else content))
    insist_on_room(folder, files, force=force)
    made = _missing_parents([path for path, _ in targets])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=".mbexport-", dir=folder))
        try:
            for number, (_, content) in enumerate(targets):
                (staging / str(number)).write_bytes(content)
            _move_all(staging, [path for path, _ in targets], [folder / name for name in without])
        finally:
            shutil.rmtree(staging, ignore_errors=True)
    except BaseException as error:
        # an interrupt leaves as little behind as a full disk does
        for path in made:
            shutil.rmtree(path, ignore_errors=True)
        if isinstance(error, OSError):
            raise UsageError(f"cannot write into {folder}: {error.strerror or error}.") from error
        raise
    return tuple(path for path, _ in targets)


def insist_on_room(folder: Path, names: Iterable[str], *, force: bool) -> None:
    """Refuse files that are in the way of new ones; by itself for what is asked before minutes of work.

    Args:
        folder: Where new files go.
        names: Their relative POSIX paths.
        force: Files may be replaced; a folder in the place of one may not.

    Raises:
        UsageError: Something is in the way, or nothing can be written there.
    """
    ground = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not ground.is_dir():
        raise UsageError(f"cannot write into {folder}: {ground} is no folder.")
    if not os.access(ground, os.W_OK | os.X_OK):
        raise UsageError(f"cannot write into {folder}: {ground} is not yours to write into.")
    places = [folder / name for name in names]
    in_the_way = [place for place in places if place.exists() and (not force or place.is_dir())]
    if in_the_way:
        shown = ", ".join(str(place) for place in in_the_way[:3]) + (" ..." if len(in_the_way) > 3 else "")
        raise UsageError(f"{shown} exists already; choose another place or give --force.")


def _move_all(staging: Path, places: list[Path], going: list[Path]) -> None:
    """Move the files that were staged by number to their places; where one cannot be moved, put back what was there.

    Args:
        staging: Where they are; what was there before goes here too.
        places: One a file.
        going: Files that go.
    """
    moved: list[tuple[Path, Path | None]] = []
    try:
        for number, place in enumerate(places):
            place.parent.mkdir(parents=True, exist_ok=True)
            old: Path | None = None
            if place.exists():
                old = staging / f"old-{number}"
                place.replace(old)
            moved.append((place, old))
            (staging / str(number)).replace(place)
        for number, place in enumerate(going, start=len(places)):
            old = staging / f"old-{number}"
            place.replace(old)
            moved.append((place, old))
    except BaseException:
        for place, old in reversed(moved):
            place.unlink(missing_ok=True)
            if old is not None:
                old.replace(place)
        raise


def _missing_parents(paths: list[Path]) -> list[Path]:
    """Topmost folders that writing the paths would make."""
    missing: set[Path] = set()
    for path in paths:
        top: Path | None = None
        for parent in path.parents:
            if parent.exists():
                break
            top = parent
        if top is not None:
            missing.add(top)
    return sorted(missing)
