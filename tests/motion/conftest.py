from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from mbexport.core.build import build
from mbexport.core.database import Database, load
from mbexport.core.representation import Robot


@cache
def _database(name: str) -> Database:
    return load(name)


@pytest.fixture(scope="session")
def database() -> Callable[[str], Database]:
    """A built-in robot's database."""
    return _database


@pytest.fixture(scope="session")
def rigid() -> Callable[[str], Robot]:
    """A built-in robot without effects."""
    return cache(lambda name: build(_database(name), "rigid"))
