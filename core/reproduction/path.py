"""Figure 11: the desired trajectory "Greca", with rigid joints and imposed motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .case import Case

Array = NDArray[np.float64]

# how finely the path is looked at [s]
SPACING = 1.0e-3
# rate of the record of the engines' rigid runs [Hz]
RIGID_RATE = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class DesiredPath:
    """The Greek key, as it is asked for and as rigid joints follow it.

    Attributes:
        t: Times [s], shape (m,).
        q, dq, ddq: Motion laws of the joints, shape (m, n) [rad, s].
        tip: Path of the tip in the base [m], shape (m, 3).
        corners: When the command is at each corner [s], shape (k,).
        places: Where the corners are [m], shape (k, 3).
        crooked: Largest distance of the path from the straight lines between its corners [m].
        tilt: Largest angle of the tool from the direction that it keeps [rad].
        engines: Backend -> largest distance of its rigid robot's tip from the path [m].
    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tip: Array
    corners: Array
    places: Array
    crooked: float
    tilt: float
    engines: dict[str, float]

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        extent = np.ptp(self.places, axis=0)
        return {
            "duration_s": float(self.corners[-1]),
            "corners_s": self.corners.tolist(),
            "corners_m": self.places.tolist(),
            "extent_m": extent.tolist(),
            "length_m": float(np.sum(np.linalg.norm(np.diff(self.places, axis=0), axis=1))),
            "largest_speed_m_s": float(np.max(np.linalg.norm(np.diff(self.tip, axis=0), axis=1) / np.diff(self.t))),
            "joint_range_rad": np.ptp(self.q, axis=0).tolist(),
            "joint_speed_rad_s": np.max(np.abs(self.dq), axis=0).tolist(),
            "joint_acceleration_rad_s2": np.max(np.abs(self.ddq), axis=0).tolist(),
            "off_the_straight_lines_m": self.crooked,
            "tool_tilt_rad": self.tilt,
            "rigid_robot_from_path_m": self.engines,
        }


def desired_path(case: Case) -> DesiredPath:
    """The path of figure 11; engines run the rigid robot along it."""
    from ..kinematics import kinematics

    t = np.linspace(0.0, case.motion.duration, round(case.motion.duration / SPACING) + 1)
    q, dq, ddq = case.motion.at(t)
    tool = kinematics(case.rigid).tool_in_base(q)
    places = case.command(case.corners)
    # the angle from its chord: the cosine of a small one has no digits
    chord = np.linalg.norm(tool[:, :3, 2] - tool[0, :3, 2], axis=1)
    engines: dict[str, float] = {}
    for name in case.backends:
        trace = case.run("figure 11", case.rigid, name, case.motion, duration=case.motion.duration, rate=RIGID_RATE)
        engines[name] = float(np.max(np.linalg.norm(trace.tip - case.command(trace.t), axis=1)))
    return DesiredPath(
        t,
        q,
        dq,
        ddq,
        tool[:, :3, 3],
        case.corners,
        places,
        _crooked(t, tool[:, :3, 3], case.corners, places),
        float(np.max(2.0 * np.arcsin(0.5 * chord))),
        engines,
    )


def _crooked(t: Array, tip: Array, corners: Array, places: Array) -> float:
    """Largest distance of a path from the straight lines between its corners [m]."""
    worst = 0.0
    for edge in range(len(corners) - 1):
        begin, end = places[edge], places[edge + 1]
        along = (end - begin) / np.linalg.norm(end - begin)
        on = (t >= corners[edge]) & (t <= corners[edge + 1])
        away = tip[on] - begin
        worst = max(worst, float(np.max(np.linalg.norm(away - np.outer(away @ along, along), axis=1))))
    return worst
