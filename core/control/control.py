"""How a robot is driven: the `control` part of a log.yaml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

from ..errors import Problem, RunFileError

Mode = Literal["motion", "pd", "torque", "unknown"]
Feedforward = Literal["none", "gravity", "inverse_dynamics"]

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
    rate: float = 1000.0
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
    def from_mapping(data: Any, n: int, file: str | None = None) -> Control:
        """From the `control` part of a log.yaml.

        Args:
            data: As the YAML reader gave it.
            n: Number of joints.
            file: Where it stands, for messages.

        Raises:
            RunFileError: With all problems.
        """
        problems: list[Problem] = []

        def wrong(key: str, value: Any, message: str) -> None:
            problems.append(Problem(message, file=file, column=f"control.{key}", value=str(value)))

        if not isinstance(data, Mapping):
            raise RunFileError(
                (Problem("control must be a mapping with at least a mode", file=file, column="control"),)
            )
        table = cast("Mapping[Any, Any]", data)
        for key in table:
            if key not in _KEYS:
                wrong(str(key), table[key], f"unknown key; known are {', '.join(_KEYS)}")
        mode = _one_of(table.get("mode", "motion"), get_args(Mode), "mode", wrong)
        feedforward = _one_of(table.get("feedforward", "none"), get_args(Feedforward), "feedforward", wrong)
        kp, kd, limit = (_numbers(table.get(key), n, key, wrong) for key in ("kp", "kd", "torque_limit"))
        if mode == "pd":
            for key, gains in (("kp", kp), ("kd", kd)):
                if not gains and not any(problem.column == f"control.{key}" for problem in problems):
                    wrong(key, None, f"mode pd needs {n} gains, one a joint")
        rate = table.get("rate", 1000.0)
        if not _is_number(rate) or not 0.0 < rate < math.inf:
            wrong("rate", rate, "must be a number of Hz above 0")
        if problems:
            raise RunFileError(problems)
        return Control(mode, kp, kd, feedforward, float(rate), limit)


def read_control(path: Path, n: int) -> Control:
    """The controller of a log.yaml, or of a file that has its `control` part only.

    Raises:
        RunFileError: With all problems.
    """
    data = read_log(path)
    known_part = "control" in data
    return Control.from_mapping(data["control"] if known_part else data, n, str(path))


def read_noise(path: Path, n: int) -> dict[str, tuple[float, ...]]:
    """One sigma of each channel from the `noise` part of a log.yaml: signal -> one a joint (ee, ee_rot: one).

    Raises:
        RunFileError: With all problems.
    """
    part = read_log(path).get("noise")
    problems: list[Problem] = []

    def wrong(key: str, value: Any, message: str) -> None:
        problems.append(Problem(message, file=str(path), column=f"noise.{key}", value=str(value)))

    if not isinstance(part, Mapping):
        raise RunFileError((Problem("there is no noise part, e.g. noise: {q: 1.0e-5, tau: 0.5}", file=str(path)),))
    table = cast("Mapping[Any, Any]", part)
    noise: dict[str, tuple[float, ...]] = {}
    for key, value in table.items():
        if key not in ("q", "dq", "q_link", "tau", "ee", "ee_rot"):
            wrong(str(key), value, "unknown channel; known are q, dq, q_link, tau, ee, ee_rot")
            continue
        count = 1 if str(key).startswith("ee") else n
        sizes = _numbers([value] * count if _is_number(value) else value, count, str(key), wrong)
        if any(size < 0.0 for size in sizes):
            wrong(str(key), value, "a standard deviation is 0 or more")
        noise[str(key)] = sizes
    if problems:
        raise RunFileError(problems)
    return noise


def read_log(path: Path) -> dict[str, Any]:
    """The mapping of a YAML file, read safely.

    Raises:
        RunFileError: It cannot be read or is no mapping.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        data: Any = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFileError((Problem(f"cannot be read: {error.strerror}", file=str(path)),)) from error
    except (UnicodeDecodeError, YAMLError) as error:
        reason = " ".join(str(error).split())
        raise RunFileError((Problem(f"is no YAML file: {reason}", file=str(path)),)) from error
    if not isinstance(data, dict):
        raise RunFileError((Problem("must be a mapping, e.g. control: {mode: motion}", file=str(path)),))
    return {str(key): value for key, value in cast("dict[Any, Any]", data).items()}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)


def _one_of(value: Any, allowed: tuple[Any, ...], key: str, wrong: Any) -> Any:
    if value not in allowed:
        wrong(key, value, f"must be one of {', '.join(allowed)}")
    return value


def _numbers(value: Any, n: int, key: str, wrong: Any) -> tuple[float, ...]:
    if value is None:
        return ()
    if not isinstance(value, list | tuple):
        wrong(key, value, f"must be a list of {n} numbers, one a joint")
        return ()
    items = list(cast("list[Any]", value))
    if len(items) != n or not all(_is_number(item) for item in items):
        wrong(key, value, f"must be a list of {n} numbers, one a joint")
        return ()
    return tuple(float(item) for item in items)
