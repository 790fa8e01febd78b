"""What a page writes: each time a new folder in the one that it was given, so that nothing is written over."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..database import write
from ..errors import UsageError
from ..export import export
from .bench import Bench

if TYPE_CHECKING:
    from ..motion import MotionLaw

# folders of one kind that a page may write
MOST_FOLDERS = 999


def save_database(bench: Bench, output: Path) -> Path:
    """Write the database with all changes; the folder it is in.

    Raises:
        RefusedError: No robot can have these numbers.
        UsageError: The system refuses to write.
    """
    # numbers that fit their columns may still make no robot
    bench.robot()
    folder = free_folder(output, "database")
    write(bench.to_save(), folder)
    return folder


def export_robot(bench: Bench, backends: Sequence[str], motion: MotionLaw, output: Path) -> Path:
    """Write the robot's models, whose scripts run the motion; the folder they are in.

    Raises:
        RefusedError: A backend refuses the robot.
        UsageError: No backend was chosen, or the system refuses to write.
    """
    if not backends:
        raise UsageError("choose a format to export.")
    folder = free_folder(output, "export")
    export(bench.robot(), backends, folder, motion=motion, meshes=bench.original.folder)
    return folder


def free_folder(output: Path, kind: str) -> Path:
    """The first folder of a kind, numbered from 1, that is not there yet.

    Raises:
        UsageError: There are too many.
    """
    for number in range(1, MOST_FOLDERS + 1):
        folder = output / f"{kind}-{number}"
        if not folder.exists():
            return folder
    raise UsageError(f"{output} has {MOST_FOLDERS} folders {kind}-N already; move some away.")
