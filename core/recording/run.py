"""A recorded run in memory: channels in SI on one time base, and by name what of them is left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import RunFileError
from ..motion import MotionLaw, from_table

if TYPE_CHECKING:
    from ..control import Control

Vector = NDArray[np.float64]

MEASURED = ("q", "dq", "q_link", "tau", "tau_link", "ee", "ee_rot")


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Samples of a channel that are not to be used, or stamps that are not what they should be.

    Attributes:
        channel: "q_2", "tau_3", "ee", "t"; "row" where a whole row is meant.
        reason: "not a number", "stuck", "saturated", "repeat", "gap", "jitter", "delay" (shifted beyond the record),
            "jump" (of a torque between rows, where no controller is known).
        first, last: Times that it spans [s], from the run's first row.
        samples: How many samples are left out; of a gap, how many are missing.
        message: The same as a sentence.
    """

    channel: str
    reason: str
    first: float
    last: float
    samples: int
    message: str


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What one run recorded.

    Attributes:
        name: Of its folder or file.
        t: Times [s], strictly growing, the first is 0, shape (m,).
        signals: Signal of log.md without its number -> values in SI, radians, shape (m, n), for those that the run
            has; "ee": tool centre point in the base (m, 3); "ee_rot": its orientation as unit quaternions w x y z
            (m, 4). NaN where a sample is left out or a joint has no such channel.
        control: How the robot was driven.
        noise: Signal -> stated standard deviations, shape (n,), ee (3,), ee_rot (1,); {} where none is stated.
        locked: Joints (from 1) whose arm side is clamped.
        payload: What is known to hang there: column of the effect payload -> value in SI; {} for nothing.
        source: Who measured it.
        left_out: Bad samples and stamps.
        rate: Median sampling rate [Hz].
        beside: Other runs of the same sensors under the same control, by which noise is known better.
        steps: Signal -> what its values were whole multiples of when they were recorded, shape (n,), 0 where of none,
            for signals that were changed since; of others it is found.
        since: Time from which on it is compared [s]; its rows before that lead up to it.
    """

    name: str
    t: Vector
    signals: Mapping[str, Vector]
    control: Control
    noise: Mapping[str, Vector]
    locked: tuple[int, ...]
    payload: Mapping[str, float]
    source: str
    left_out: tuple[LeftOut, ...]
    rate: float
    beside: tuple[Run, ...] = ()
    steps: Mapping[str, Vector] = field(default_factory=dict[str, Vector])
    since: float = 0.0

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.signals["q"].shape[1]

    @property
    def duration(self) -> float:
        """From the first to the last row [s]."""
        return float(self.t[-1])

    @property
    def judged(self) -> NDArray[np.bool_]:
        """Rows that are compared, shape (m,)."""
        return self.t >= self.since

    def has(self, signal: str) -> bool:
        """Whether the run has a signal at one joint at least."""
        return signal in self.signals

    def motion(self) -> MotionLaw:
        """The command as log.md interpolates it: cubic Hermite pieces where dq_cmd is there, else an Akima spline.

        Joints without q_cmd take the measured q, samples that are left out are bridged.

        Raises:
            RunFileError: Fewer than two rows are whole.
        """
        measured = self.signals["q"]
        q = self.signals.get("q_cmd", measured)
        silent = np.isnan(q).all(axis=0)
        columns = [np.where(silent, measured, q)]
        speeds = self.signals.get("dq_cmd")
        if speeds is not None and not silent.any() and not np.isnan(speeds).all(axis=0).any():
            columns.append(speeds)
        whole = np.isfinite(np.hstack(columns)).all(axis=1)
        if whole.sum() < 2:
            raise RunFileError(f"run {self.name}: fewer than two rows give the position of every joint.")
        return from_table(self.t[whole], *(values[whole] for values in columns), source=f"run {self.name}")
