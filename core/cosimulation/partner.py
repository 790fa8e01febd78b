"""What a loop needs to know of a controller: before a run, and while it runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ..motion import MotionLaw

Vector = NDArray[np.float64]
Seen = Callable[[float], Vector]
"""What the controller takes position and speed to be at a time [s], shape (2, n)."""


class Running(Protocol):
    """A controller in a run, between two communication points."""

    def torque(self, q: Vector, dq: Vector) -> Vector:
        """What it gives at the communication point, having read q and dq there, shape (n,)."""
        ...

    def advance(self, seen: Seen) -> None:
        """Go on to the next communication point, with what it takes q and dq to be meanwhile."""
        ...

    def close(self) -> None:
        """The run has ended."""
        ...


class Partner(Protocol):
    """A controller that can be coupled to a robot.

    Attributes:
        kp: Gains on position at the start, shape (n,); zeros where they are not known.
        motion: The command.
    """

    @property
    def kp(self) -> Vector: ...

    @property
    def motion(self) -> MotionLaw: ...

    def feedforward_at_start(self) -> Vector:
        """Torque added at t = 0, shape (n,)."""
        ...

    def running(self, interval: float, count: int, q: Vector, dq: Vector) -> Running:
        """The controller at the beginning of a run.

        Args:
            interval: Communication step [s].
            count: How many there will be.
            q: Reported position at t = 0, shape (n,).
            dq: Speed, shape (n,).
        """
        ...

    def in_words(self) -> str:
        """What it is."""
        ...

    def facts(self) -> dict[str, Any]:
        """What it is, as plain data."""
        ...
