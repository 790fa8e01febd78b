"""Formats for engines that are not here: written, never loaded."""

from __future__ import annotations

from typing import ClassVar

from ..core.errors import RefusedError
from ..core.representation import Robot
from ..core.simulation.backend import Backend, Emission, Engine, Program
from .common import weightless_motor


class EmittedOnly(Backend):
    """Base of the backends whose engine somebody else has.

    Attributes:
        elsewhere: What runs the files, as a clause.
    """

    elsewhere: ClassVar[str]
    runs: ClassVar[bool] = False

    def version(self) -> str:
        """None: the engine is not here."""
        return ""

    def refusal(self, robot: Robot, program: Program | None) -> str | None:
        """An elastic joint moved by torque needs an inertia between torque and spring."""
        return weightless_motor(robot, program)

    def load(self, emission: Emission) -> Engine:
        """Not here.

        Raises:
            RefusedError: Always.
        """
        raise RefusedError(f"{self.name}: emitted only; {self.elsewhere}")
