"""Collecting all that is wrong with an input, instead of stopping at the first."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ..errors import Problem

# a file of a million wrong cells tells no more than its first hundred
MOST = 200


@dataclass(slots=True)
class Problems:
    """All problems found so far, in the order of finding."""

    found: list[Problem] = field(default_factory=list[Problem])

    def error(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        column: str | None = None,
        value: str | None = None,
    ) -> None:
        """Note something that stops the work."""
        self._add(Problem(message, file, line, column, shortened(value)))

    def warning(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        column: str | None = None,
        value: str | None = None,
    ) -> None:
        """Note something suspicious."""
        self._add(Problem(message, file, line, column, shortened(value), "warning"))

    def _add(self, problem: Problem) -> None:
        if len(self.found) < MOST:
            self.found.append(problem)
        elif len(self.found) == MOST:
            self.found.append(Problem(f"more than {MOST} problems; the others are not listed.", problem.file))

    @property
    def errors(self) -> tuple[Problem, ...]:
        """Those that stop the work."""
        return tuple(problem for problem in self.found if problem.severity == "error")


def shortened(text: str | None) -> str | None:
    """The text, cut where it would fill a page."""
    return text if text is None or len(text) <= 80 else text[:77] + "..."


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is nearest, as a question, or all of them."""
    names = sorted(known)
    near = difflib.get_close_matches(name[:80], names, 1)
    if near:
        return f"did you mean {near[0]!r}?"
    return f"known: {listed(names)}."


def listed(names: Sequence[str]) -> str:
    """Names separated by commas; "none" where there are none."""
    return ", ".join(names) or "none"
