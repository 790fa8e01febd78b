"""The whole suite: every check by its id."""

from __future__ import annotations

from functools import cache

from . import behaviour, effects, emission, together
from .check import Check

# in the order in which a fault shows
_MODULES = (emission, together, effects, behaviour)


@cache
def checks() -> dict[str, Check]:
    """Id to check."""
    return {check.id: check for module in _MODULES for check in module.checks()}
