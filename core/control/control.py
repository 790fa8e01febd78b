"""How a robot is driven: the `control` part of a log.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import RunFileError
from .log_file import LogFile, read_log
from .log_values import Faults, is_number, nearest, numbers, one_of

Mode = Literal["motion", "pd", "torque", "unknown"]
Feedforward = Literal["none", "gravity", "inverse_dynamics"]

DEFAULT_RATE = 1000.0
HIGHEST_RATE = 1.0e6
# part of a tick that rounding may take from it
INSTANT = 1.0e-6
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
        every: The command that it follows changes at every so many ticks only. No log says so: it is suspected.
        differenced: Its speeds are differences of positions over so many ticks, half of them late, or part of the way
            there from those that are measured; 0: as measured. Suspected, too.
        ahead: It sees positions where they will be after so many ticks. Suspected, too.
        held: For how long a controller that is unknown holds the torque that is recorded [s]; 0: not at all.
    """

    mode: Mode = "motion"
    kp: tuple[float, ...] = ()
    kd: tuple[float, ...] = ()
    feedforward: Feedforward = "none"
    rate: float = DEFAULT_RATE
    torque_limit: tuple[float, ...] = ()
    every: int = 1
    differenced: float = 0.0
    ahead: float = 0.0
    held: float = 0.0

    def commanded_at(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """When the command was given that is followed at times t [s], same shape."""
        if self.every == 1:
            return t
        period = self.every / self.rate
        return np.floor(t / period + INSTANT) * period

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
        wrong = Faults(log or LogFile("control", {}, {}), "control")
        if not isinstance(data, Mapping) or "mode" not in data:
            wrong("mode", None, f"control must be a mapping that says its mode: {', '.join(get_args(Mode))}")
            raise RunFileError(wrong.problems)
        table = cast("Mapping[Any, Any]", data)
        for key in table:
            if key not in _KEYS:
                wrong(str(key), table[key], f"unknown key{nearest(str(key), _KEYS)}; known are {', '.join(_KEYS)}")
        mode = one_of(table["mode"], get_args(Mode), "mode", wrong)
        feedforward = one_of(table.get("feedforward", "none"), get_args(Feedforward), "feedforward", wrong)
        kp, kd = (numbers(table.get(key), n, key, wrong) for key in ("kp", "kd"))
        limit = numbers(table.get("torque_limit"), n, "torque_limit", wrong, infinite=True)
        if mode == "pd":
            for key in ("kp", "kd"):
                if table.get(key) is None:
                    wrong(key, None, f"mode pd needs {key}: {n} gains, one a joint")
        rate = table.get("rate", DEFAULT_RATE)
        if not is_number(rate) or not 0.0 < rate <= HIGHEST_RATE:
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
