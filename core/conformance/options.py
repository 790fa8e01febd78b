"""What pytest loads at its start: one option, and only where this suite is asked for by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

SUITE = "mbexport.core.conformance"


def pytest_load_initial_conftests(early_config: pytest.Config, parser: pytest.Parser, args: list[str]) -> None:
    """Add the options and the suite; a conftest of a package is not read before the command line is."""
    if any(argument.split("::")[0].startswith(SUITE) for argument in args):
        early_config.pluginmanager.import_plugin(f"{SUITE}.hooks")
