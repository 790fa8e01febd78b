"""The paper's study, shortened: one edge of the path, two engines."""

from __future__ import annotations

import pytest

from mbexport.core.reproduction import Reproduction, reproduce
from mbexport.core.reproduction.case import Case, paper_case


@pytest.fixture(scope="session")
def told() -> list[tuple[str, int, int]]:
    return []


@pytest.fixture(scope="session")
def study(told: list[tuple[str, int, int]]) -> Reproduction:
    return reproduce(("mjcf", "urdf"), 1, lambda what, done, total: told.append((what, done, total)))


@pytest.fixture(scope="session")
def case() -> Case:
    return paper_case(("mjcf",), 2, lambda what, done, total: None)
