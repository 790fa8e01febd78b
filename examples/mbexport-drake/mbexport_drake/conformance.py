"""What the conformance kit of mbexport asks of a backend's author: the backend, and where it ends."""

import pytest

from .backend import DrakeBackend


@pytest.fixture(scope="session")
def backend_under_test():
    return DrakeBackend()


@pytest.fixture(scope="session")
def declared_limits():
    return {}
