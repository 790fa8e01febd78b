"""All errors that mbexport raises on purpose. A message says what is wrong, where, and what would be right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault of an input, with its place.

    Attributes:
        message: What is wrong and what would be right, in one sentence.
        file: File as the user named it, relative to the input's folder where there is one.
        line: Line in the file, from 1.
        column: Name of the column or key.
        value: The offending text as it stands in the file.
        severity: "error" stops the work, "warning" is only told.
    """

    message: str
    file: str | None = None
    line: int | None = None
    column: str | None = None
    value: str | None = None
    severity: str = "error"

    def __str__(self) -> str:
        place = self.file or ""
        if self.line is not None:
            place += f":{self.line}"
        parts = [place] if place else []
        if self.column is not None:
            parts.append(f"column {self.column}")
        if self.value is not None:
            parts.append(f"value {self.value!r}")
        told = (", ".join(parts) + ": " if parts else "") + self.message
        # what a stranger's file is made of may not steer the terminal that tells of it
        return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in told)


class MbexportError(Exception):
    """Base of every error that is the input's or the user's, not the program's."""


class InputError(MbexportError):
    """An input file is wrong; carries every problem found, not only the first.

    Attributes:
        problems: All problems of severity "error".
    """

    def __init__(self, problems: Sequence[Problem] | str) -> None:
        if isinstance(problems, str):
            problems = (Problem(problems),)
        self.problems: tuple[Problem, ...] = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class DatabaseError(InputError):
    """A universal database does not hold what its contract asks."""


class ModelFileError(InputError):
    """A URDF or MJCF file cannot be turned into a database."""


class RunFileError(InputError):
    """A recorded run, its log.yaml or a motion table is wrong."""


class UsageError(MbexportError):
    """Options that do not fit together, unknown names, files that are in the way."""


class PluginError(MbexportError):
    """A backend or effect plugin is missing, broken or rival to another."""


class RefusedError(MbexportError):
    """An engine or format cannot do what was asked and says so instead of doing something else."""
