"""Numbers and words out of a log.yaml, every fault noted with its key and line."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from typing import Any, cast

from ..errors import Problem
from .log_file import LogFile


class Faults:
    """Collects what is wrong with one part of a log.yaml."""

    def __init__(self, log: LogFile, part: str) -> None:
        self.problems: list[Problem] = []
        self._log = log
        self._part = part

    def __call__(self, key: str, value: Any, message: str) -> None:
        self.problems.append(self._log.problem(f"{self._part}.{key}", value, message))


def nearest(name: str, known: Sequence[str]) -> str:
    """The known name that is nearest, as a question behind what is said; "" where none is near."""
    near = difflib.get_close_matches(name, known, 1)
    return f" (did you mean {near[0]}?)" if near else ""


def is_number(value: Any) -> bool:
    """Whether it is a number, infinite perhaps; a truth value is none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)


def one_of(value: Any, allowed: tuple[Any, ...], key: str, wrong: Faults) -> Any:
    """The value, noted where it is not allowed."""
    if value not in allowed:
        wrong(key, value, f"must be one of {', '.join(allowed)}")
    return value


def numbers(value: Any, n: int, key: str, wrong: Faults, *, infinite: bool = False) -> tuple[float, ...]:
    """A list of n numbers, 0 or more, one a joint; () where there is none."""
    if value is None:
        return ()
    items: list[Any] = list(cast("Sequence[Any]", value)) if isinstance(value, list | tuple) else []
    if len(items) != n or not all(is_number(item) for item in items):
        wrong(key, value, f"must be a list of {n} numbers, one a joint" if n > 1 else "must be a list of 1 number")
        return ()
    values = tuple(float(item) for item in items)
    for joint, number in enumerate(values, start=1):
        if number < 0.0 or (math.isinf(number) and not infinite):
            wrong(key, number, f"joint {joint}: must be 0 or more{'' if infinite else ', and finite'}")
    return values
