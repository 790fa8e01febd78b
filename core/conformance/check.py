"""One check of a backend, and what it says when it fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .subject import Subject

Refusals = Sequence[str]
"""What the backend refused by name, in its own words; () where it did all that was asked."""


class ConformanceError(AssertionError):
    """The backend does not do what its contract says."""


@dataclass(frozen=True, slots=True)
class Check:
    """One check.

    Attributes:
        name: What is checked.
        case: On what: a robot, an effect, a seed; "" where there is one case only.
        run: Raises ConformanceError where the backend fails.
        quick: Belongs to the part that a test suite has the time for.
    """

    name: str
    case: str
    run: Callable[[Subject], Refusals]
    quick: bool = False

    @property
    def id(self) -> str:
        """By which limits are declared: "statics-puma560"."""
        return f"{self.name}-{self.case}" if self.case else self.name


def must(condition: bool, text: str) -> None:
    """Fail with a sentence.

    Raises:
        ConformanceError: The condition does not hold.
    """
    if not condition:
        raise ConformanceError(text)
