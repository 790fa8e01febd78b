"""Tests are no package, so what several of them share is loaded by its place, before they are."""

import importlib
import importlib.util
import sys
from pathlib import Path

import pytest

if "pendulums" not in sys.modules:
    spec = importlib.util.spec_from_file_location("pendulums", Path(__file__).with_name("pendulums.py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules["pendulums"] = module
    spec.loader.exec_module(module)

BANK = Path(__file__).resolve().parents[2] / "benchmarks" / "blind"


@pytest.fixture(scope="module")
def bank_module():
    """Import a program of the blind bank by its name."""
    sys.path.insert(0, str(BANK))
    yield importlib.import_module
    sys.path.remove(str(BANK))
