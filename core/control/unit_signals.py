"""What the variables of a controller's unit mean: by their own names, or by a file that maps them.

inputs: {theta1: q_1, ref1: q_cmd_1, enable: 1.0}     # a signal, or a number that is held
outputs: {u1: tau_1}
parameters: {Kp: 40.0}                                # set before it starts
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ..errors import Problem, RunFileError
from .log_file import LogFile, read_log

INPUTS = ("q", "dq", "q_cmd", "dq_cmd", "ddq_cmd")
OUTPUT = "tau"
_PARTS = ("inputs", "outputs", "parameters")
# a joint's number behind a bar, as in a run's data, or in brackets, as arrays are exported
_SIGNAL = re.compile(rf"({'|'.join((*INPUTS, OUTPUT))})(?:_([1-9]\d{{0,3}})|\[([1-9]\d{{0,3}})\])")


@dataclass(frozen=True, slots=True)
class Port:
    """A signal of one joint.

    Attributes:
        signal: "q", "dq", "q_cmd", "dq_cmd", "ddq_cmd" or "tau", as in a run's data.
        joint: From 0.
    """

    signal: str
    joint: int


@dataclass(frozen=True, slots=True)
class Signals:
    """What a file says of a unit's variables.

    Attributes:
        inputs: Variable -> signal's name, or the number that it is held at.
        outputs: Variable -> signal's name.
        parameters: Variable -> its value.
    """

    inputs: Mapping[str, str | float] = field(default_factory=dict[str, str | float])
    outputs: Mapping[str, str] = field(default_factory=dict[str, str])
    parameters: Mapping[str, float] = field(default_factory=dict[str, float])


def port_named(name: str) -> Port | None:
    """The signal that a name means (`q_cmd_2`, `q_cmd[2]`); None where it means none."""
    match = _SIGNAL.fullmatch(name)
    return None if match is None else Port(match[1], int(match[2] or match[3]) - 1)


def read_signals(path: Path) -> Signals:
    """The file that maps a unit's variables.

    Raises:
        RunFileError: With all problems.
    """
    log = read_log(path)
    problems = [
        log.problem(str(key), None, f"unknown key; known are {', '.join(_PARTS)}")
        for key in log.data
        if key not in _PARTS
    ]
    inputs = _part(log, "inputs", problems)
    outputs = _part(log, "outputs", problems)
    parameters = _part(log, "parameters", problems)
    for name, value in inputs.items():
        port = port_named(value) if isinstance(value, str) else None
        if not isinstance(value, float) and (port is None or port.signal == OUTPUT):
            wanted = f"a signal ({', '.join(f'{signal}_1' for signal in INPUTS)}, ...) or a number"
            problems.append(log.problem(f"inputs.{name}", value, f"must be {wanted}"))
    for name, value in outputs.items():
        port = port_named(value) if isinstance(value, str) else None
        if port is None or port.signal != OUTPUT:
            problems.append(log.problem(f"outputs.{name}", value, f"must be {OUTPUT}_1, {OUTPUT}_2, ..."))
    for name, value in parameters.items():
        if not isinstance(value, float):
            problems.append(log.problem(f"parameters.{name}", value, "must be a number"))
    if problems:
        raise RunFileError(problems)
    return Signals(inputs, outputs, parameters)


def _part(log: LogFile, key: str, problems: list[Problem]) -> dict[str, Any]:
    part: Any = log.data.get(key) or {}
    if not isinstance(part, Mapping):
        problems.append(log.problem(key, part, "must be a mapping of the unit's variables"))
        return {}
    return {str(name): value for name, value in cast("Mapping[Any, Any]", part).items()}
