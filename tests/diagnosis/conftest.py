"""Tests are no package, so what several of them share is loaded by its place, before they are."""

import importlib.util
import sys
from pathlib import Path

if "pendulums" not in sys.modules:
    spec = importlib.util.spec_from_file_location("pendulums", Path(__file__).with_name("pendulums.py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules["pendulums"] = module
    spec.loader.exec_module(module)
