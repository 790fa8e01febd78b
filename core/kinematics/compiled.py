"""Plain Python text, compiled by Numba on first use and kept on disk for the next process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from types import FunctionType
from typing import Any, cast


@cache
def compiled(module: str) -> Mapping[str, Callable[..., Any]]:
    """Every function that a module defines, by name, compiled; they call each other compiled.

    The module itself is left as it is, so that its text runs without Numba too. Numba compiles a function at its
    first call; what it makes is cached beside the module's file (or in the user's cache, where that is read-only).

    Args:
        module: Full name of a module whose functions are all written in the subset that Numba compiles.
    """
    from numba import njit

    text = import_module(module)
    names = dict(vars(text))
    functions = {name: value for name, value in names.items() if isinstance(value, FunctionType)}
    own = {name: value for name, value in functions.items() if value.__module__ == module}
    compile_one = cast(Callable[[FunctionType], Callable[..., Any]], njit(cache=True, nogil=True, error_model="numpy"))
    made = {
        # a copy that looks its callees up among the compiled ones; its code keeps file and line, by which Numba caches
        name: compile_one(FunctionType(value.__code__, names, name, value.__defaults__, value.__closure__))
        for name, value in own.items()
    }
    names.update(made)
    return made
