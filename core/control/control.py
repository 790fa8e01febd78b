"""How a robot is driven: the `control` part of a log.yaml."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from ..errors import Problem, RunFileError
from .log_file import LogFile, read_log

Mode = Literal["motion", "pd", "torque", "unknown"]
Feedforward = Literal["none", "gravity", "inverse_dynamics"]

DEFAULT_RATE = 1000.0
HIGHEST_RATE = 1.0e6
_CHANNELS = ("q", "dq", "q_link", "tau", "ee", "ee_rot", "tau_link")
_KEYS = ("mode", "kp", "kd", "feedforward", "rate", "torque_limit")


@dataclass(frozen=True, slots=True)
class Control:
    """The controller of a run; torques follow tau = kp (q_cmd - q) + kd (dq_cmd - dq) + feedforward.

    Attributes:
        mode: "motion": the drives follow q_cmd exactly; "pd"; "torque": tau_cmd is applied; "unknown".
        kp: Gains on position [N m/rad or N/m], one a joint; () where the mode has none.
        kd: Gains on speed [N m s/rad or N s/m].
        feedforward: Torques of the nominal rigid bodies at the command that are added.
        rate: Ticks a second [Hz]; the torque is held between them.
        torque_limit: Cut of the controller's torque [N m or N], one a joint; () is none.
    """

    mode: Mode = "motion"
    kp: tuple[float, ...] = ()
    kd: tuple[float, ...] = ()
    feedforward: Feedforward = "none"
    rate: float = DEFAULT_RATE
    torque_limit: tuple[float, ...] = ()

    def to_mapping(self) -> dict[str, Any]:
        """The `control` part of a log.yaml."""
        if self.mode in ("motion", "unknown"):
            return {"mode": self.mode}
        data: dict[str, Any] = {"mode": self.mode, "rate": self.rate}
        if self.mode == "pd":
            data |= {"kp": list(self.kp), "kd": list(self.kd), "feedforward": self.feedforward}
        if self.torque_limit:
            data["torque_limit"] = list(self.torque_limit)
        return data

    @staticmethod
    def from_mapping(data: Any, n: int, log: LogFile | None = None) -> Control:
        """From the `control` part of a log.yaml.

        Args:
            data: The part: a mapping.
            n: Number of joints.
            log: Where it stands, for messages.

        Raises:
            RunFileError: With all problems.
        """
        wrong = _Faults(log or LogFile("control", {}, {}), "control")
        if not isinstance(data, Mapping) or "mode" not in data:
            wrong("mode", None, f"control must be a mapping that says its mode: {', '.join(get_args(Mode))}")
            raise RunFileError(wrong.problems)
        table = cast("Mapping[Any, Any]", data)
        for key in table:
            if key not in _KEYS:
                wrong(str(key), table[key], f"unknown key{_nearest(str(key), _KEYS)}; known are {', '.join(_KEYS)}")
        mode = _one_of(table["mode"], get_args(Mode), "mode", wrong)
        feedforward = _one_of(table.get("feedforward", "none"), get_args(Feedforward), "feedforward", wrong)
        kp, kd = (_numbers(table.get(key), n, key, wrong) for key in ("kp", "kd"))
        limit = _numbers(table.get("torque_limit"), n, "torque_limit", wrong, infinite=True)
        if mode == "pd":
            for key in ("kp", "kd"):
                if table.get(key) is None:
                    wrong(key, None, f"mode pd needs {key}: {n} gains, one a joint")
        rate = table.get("rate", DEFAULT_RATE)
        if not _is_number(rate) or not 0.0 < rate <= HIGHEST_RATE:
            wrong("rate", rate, f"must be a number of Hz above 0, {HIGHEST_RATE:.0f} or less")
        if wrong.problems:
            raise RunFileError(wrong.problems)
        return Control(mode, kp, kd, feedforward, float(rate), limit)


def read_control(path: Path, n: int) -> Control:
    """The controller of a log.yaml, or of a file that has its `control` part only.

    Raises:
        RunFileError: With all problems.
    """
    log = read_log(path)
    if "control" in log.data:
        return Control.from_mapping(log.data["control"], n, log)
    if "mode" not in log.data:
        raise RunFileError((log.problem("control", None, "there is no control part, e.g. control: {mode: motion}"),))
    lines = {f"control.{key}": line for key, line in log.lines.items()}
    return Control.from_mapping(log.data, n, LogFile(log.file, log.data, lines))


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
    wrong = _Faults(log, "noise")
    noise: dict[str, tuple[float, ...]] = {}
    for key, value in table.items():
        if key not in _CHANNELS:
            wrong(str(key), value, f"unknown channel{_nearest(str(key), _CHANNELS)}; known are {', '.join(_CHANNELS)}")
            continue
        count = 1 if str(key).startswith("ee") else n
        noise[str(key)] = _numbers([value] * count if _is_number(value) else value, count, str(key), wrong)
    if wrong.problems:
        raise RunFileError(wrong.problems)
    return noise


class _Faults:
    """Collects what is wrong with one part of a log.yaml."""

    def __init__(self, log: LogFile, part: str) -> None:
        self.problems: list[Problem] = []
        self._log = log
        self._part = part

    def __call__(self, key: str, value: Any, message: str) -> None:
        self.problems.append(self._log.problem(f"{self._part}.{key}", value, message))


def _nearest(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, 1)
    return f" (did you mean {near[0]}?)" if near else ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)


def _one_of(value: Any, allowed: tuple[Any, ...], key: str, wrong: _Faults) -> Any:
    if value not in allowed:
        wrong(key, value, f"must be one of {', '.join(allowed)}")
    return value


def _numbers(value: Any, n: int, key: str, wrong: _Faults, *, infinite: bool = False) -> tuple[float, ...]:
    """A list of n numbers, 0 or more, one a joint; () where there is none."""
    if value is None:
        return ()
    items: list[Any] = list(cast("Sequence[Any]", value)) if isinstance(value, list | tuple) else []
    if len(items) != n or not all(_is_number(item) for item in items):
        wrong(key, value, f"must be a list of {n} numbers, one a joint" if n > 1 else "must be a list of 1 number")
        return ()
    numbers = tuple(float(item) for item in items)
    for joint, number in enumerate(numbers, start=1):
        if number < 0.0 or (math.isinf(number) and not infinite):
            wrong(key, number, f"joint {joint}: must be 0 or more{'' if infinite else ', and finite'}")
    return numbers


def read_payload(path: Path) -> dict[str, float]:
    """What a log.yaml declares to hang at the last arm: column of the effect payload -> value in SI; {} for nothing.

    Raises:
        RunFileError: With all problems.
    """
    from ..effects import effect_named

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
