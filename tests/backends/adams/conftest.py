import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

NAMES = ("multibody", "expressions", "model", "dataset", "commands")


def load_readers():
    """The readers beside this file, by name; tests are no package, so they are loaded by their places."""
    for name in NAMES:
        full = f"adams_readers.{name}"
        if full not in sys.modules:
            spec = importlib.util.spec_from_file_location(full, Path(__file__).with_name(f"{name}.py"))
            module = importlib.util.module_from_spec(spec)
            sys.modules[full] = module
            spec.loader.exec_module(module)
    return SimpleNamespace(**{name: sys.modules[f"adams_readers.{name}"] for name in NAMES})


@pytest.fixture(scope="session")
def readers():
    return load_readers()
