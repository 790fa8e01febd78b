"""The backend under test, what it is held against, and the robots it is tried on."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache

from ..build import build
from ..database import Database, load
from ..errors import RefusedError
from ..expansion import Expansion, expanded
from ..export import default_program
from ..representation import Robot
from ..simulation.backend import Backend, Emission, Engine, Program
from ..simulation.backends import backend_named
from ..simulation.program import whole_program

REFERENCES = ("urdf", "mjcf")
"""Backends that others are held against; one is not held against itself."""

ROBOTS = ("arm7", "imece2013", "pendulum", "planar2r", "puma560", "scara")
"""Built-in robots that every check of what is emitted, and of statics, goes through."""

DURATION = 1.0
"""Of a run [s] where nothing else is said."""


@dataclass(frozen=True, slots=True)
class Subject:
    """The backend under test.

    Attributes:
        backend: It.
        duration: Of every run [s].
    """

    backend: Backend
    duration: float = DURATION

    @property
    def reference(self) -> Backend:
        """A built-in backend of high order that is another one."""
        return backend_named(next(name for name in REFERENCES if name != self.backend.name))

    def whole(self, robot: Robot) -> Expansion:
        """A robot as the backend is asked to emit it: its elastic parts as joints."""
        return expanded(robot, imposed=self.backend.scripted)

    def emission(self, robot: Robot) -> Emission:
        """What the backend makes of a robot that holds home.

        Raises:
            RefusedError: The backend refuses the robot.
        """
        whole = self.whole(robot)
        reason = self.backend.refusal(whole.robot, None)
        if reason is not None:
            raise RefusedError(reason)
        return self.backend.emit(whole.robot, whole_program(whole, default_program(robot)))

    @contextmanager
    def engine(self, robot: Robot, program: Program | None = None) -> Generator[Engine]:
        """The robot running in the backend's engine, for a program (default: home is held by imposed motion)."""
        engine = self.backend.engine_for(robot, program or default_program(robot))
        try:
            yield engine
        finally:
            engine.close()


@cache
def database(name: str) -> Database:
    """A built-in database."""
    return load(name)


@cache
def robot(name: str, level: str = "full") -> Robot:
    """A built-in robot at a level."""
    return build(database(name), level)
