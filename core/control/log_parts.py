"""What a log.yaml says of a run beside its controller: noise of the sensors, payload, clamped joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from ..effects import effect_named
from ..errors import Problem, RunFileError
from .log_file import read_log
from .log_values import Faults, is_number, nearest, numbers

_CHANNELS = ("q", "dq", "q_link", "tau", "ee", "ee_rot", "tau_link")


def read_noise(path: Path, n: int) -> dict[str, tuple[float, ...]]:
    """One sigma of each channel from the `noise` part of a log.yaml: signal -> one a joint (ee, ee_rot: one).

    Raises:
        RunFileError: With all problems.
    """
    log = read_log(path)
    part = log.data.get("noise")
    if not isinstance(part, Mapping):
        raise RunFileError((log.problem("noise", part, "there is no noise part, e.g. noise: {q: 1.0e-5, tau: 0.5}"),))
    table = cast("Mapping[Any, Any]", part)
    wrong = Faults(log, "noise")
    noise: dict[str, tuple[float, ...]] = {}
    for key, value in table.items():
        if key not in _CHANNELS:
            wrong(str(key), value, f"unknown channel{nearest(str(key), _CHANNELS)}; known are {', '.join(_CHANNELS)}")
            continue
        count = 1 if str(key).startswith("ee") else n
        noise[str(key)] = numbers([value] * count if is_number(value) else value, count, str(key), wrong)
    if wrong.problems:
        raise RunFileError(wrong.problems)
    return noise


def read_payload(path: Path) -> dict[str, float]:
    """What a log.yaml declares to hang at the last arm: column of the effect payload -> value in SI; {} for nothing.

    Raises:
        RunFileError: With all problems.
    """
    log = read_log(path)
    part = log.data.get("payload")
    if part is None:
        return {}
    if not isinstance(part, Mapping):
        raise RunFileError((log.problem("payload", part, "must be a mapping, e.g. payload: {mass: 2.5, z: 0.1}"),))
    columns = effect_named("payload").columns
    known = {column.name for column in columns}
    problems: list[Problem] = []
    values = {column.name: column.default or 0.0 for column in columns}
    for key, value in cast("Mapping[Any, Any]", part).items():
        if key not in known:
            problems.append(log.problem(f"payload.{key}", value, f"unknown key; known are {', '.join(sorted(known))}"))
        elif not isinstance(value, float) or not math.isfinite(value) or (key == "mass" and value < 0.0):
            problems.append(log.problem(f"payload.{key}", value, "must be a number, a mass 0 or more"))
        else:
            values[str(key)] = value
    if problems:
        raise RunFileError(problems)
    return values if any(values.values()) else {}


def read_locked(path: Path) -> tuple[int, ...]:
    """Numbers of the joints (from 1) whose arm side a log.yaml says is clamped.

    Raises:
        RunFileError: It is no list of joints' numbers.
    """
    log = read_log(path)
    part: Any = log.data.get("locked") or []
    joints: list[int] = []
    for item in cast("list[Any]", part) if isinstance(part, list) else [None]:
        if not isinstance(item, float) or not item.is_integer() or item < 1:
            raise RunFileError((log.problem("locked", part, "must be a list of joints' numbers, e.g. locked: [1, 2]"),))
        joints.append(int(item))
    return tuple(joints)
