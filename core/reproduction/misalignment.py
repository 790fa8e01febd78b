"""What a joint's axis that is not where it should be does to the tip: a sweep of the paper's beta."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..build import build
from ..database import Database
from ..kinematics import kinematics
from ..representation import Robot
from .case import Case

Array = NDArray[np.float64]

ANGLES = tuple(float(np.radians(angle)) for angle in (-1.0, -0.5, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0))
"""Of the sweep [rad]."""
CHECKED = float(np.radians(1.0))
"""At which all engines run the robot, in all arms at once [rad]."""
RATE = 50.0


@dataclass(frozen=True, slots=True, eq=False)
class Misalignment:
    """The sweep, an arm at a time, with rigid joints along the path.

    Attributes:
        angles: beta [rad], shape (k,).
        t: Times [s], shape (m,).
        largest: Distance of the tip from the path at most [m], shape (n, k).
        mean: The same, mean along the path, shape (n, k).
        turned: Angle by which the tool is turned at most [rad], shape (n, k).
        per_degree: Tip's shift for one degree of each arm by the Jacobian, at the same time, shape (n, m, 3) [m].
        linear: Largest difference of the sweep from that [m], at its widest angle.
        engines: Backend -> largest distance of its tip from ours with all arms misaligned at once [m].
        together: How far that moves the tip at most [m].
    """

    angles: Array
    t: Array
    largest: Array
    mean: Array
    turned: Array
    per_degree: Array
    linear: float
    engines: dict[str, float]
    together: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        degree = np.linalg.norm(self.per_degree, axis=2)
        return {
            "beta_rad": self.angles.tolist(),
            "tip_largest_m": self.largest.tolist(),
            "tip_mean_m": self.mean.tolist(),
            "tool_turned_rad": self.turned.tolist(),
            "per_degree_m": {
                "mean": np.mean(degree, axis=1).tolist(),
                "largest": np.max(degree, axis=1).tolist(),
                "largest_by_axis": np.max(np.abs(self.per_degree), axis=1).tolist(),
            },
            "sweep_against_jacobian_m": self.linear,
            "all_arms_one_degree_m": self.together,
            "engines_against_ours_m": self.engines,
        }


def misalignment(case: Case) -> Misalignment:
    """The beta sweep along the path."""
    n = case.rigid.n
    t = np.linspace(0.0, case.motion.duration, round(case.motion.duration * RATE) + 1)
    q = case.motion.at(t)[0]
    straight = kinematics(case.rigid).tool_in_base(q)
    swept = np.array([[_tool(case.database, {arm: angle}, q) for angle in ANGLES] for arm in range(n)])
    shift = swept[..., :3, 3] - straight[:, :3, 3]
    away = np.linalg.norm(shift, axis=-1)
    rates = tip_per_angle(case.rigid, q)
    expected = ANGLES[-1] * rates
    crooked = with_beta(case.database, dict.fromkeys(range(n), CHECKED))
    ours = kinematics(crooked).tool_in_base(q)[:, :3, 3]
    engines: dict[str, float] = {}
    for name in case.backends:
        trace = case.run("misaligned axes", crooked, name, case.motion, duration=case.motion.duration, rate=RATE)
        engines[name] = float(np.max(np.linalg.norm(trace.tip - ours, axis=1)))
    return Misalignment(
        np.array(ANGLES),
        t,
        np.max(away, axis=2),
        np.mean(away, axis=2),
        np.max(_angles(swept[..., :3, :3], straight[:, :3, :3]), axis=2),
        np.radians(1.0) * rates,
        float(np.max(np.linalg.norm(shift[:, -1] - expected, axis=-1))),
        engines,
        float(np.max(np.linalg.norm(ours - straight[:, :3, 3], axis=1))),
    )


def with_beta(database: Database, beta: dict[int, float]) -> Robot:
    """The rigid robot with beta [rad] of some arms (from 0) added."""
    rows = [
        replace(row, beta=row.beta + beta[arm]) if arm in beta else row for arm, row in enumerate(database.kinematics)
    ]
    return build(replace(database, kinematics=tuple(rows)), "rigid")


def _tool(database: Database, beta: dict[int, float], q: Array) -> Array:
    return kinematics(with_beta(database, beta)).tool_in_base(q)


def tip_per_angle(robot: Robot, q: Array) -> Array:
    """How the tip moves with each arm's beta at beta 0 [m/rad], shape (n, m, 3): y_i x (p - o_i) of frame i."""
    chain = kinematics(robot)
    arms, tip = chain.arms_in_base(q), chain.tool_in_base(q)[:, :3, 3]
    lever = tip[:, None] - arms[:, :, :3, 3]
    return np.swapaxes(np.cross(arms[:, :, :3, 1], lever), 0, 1)


def _angles(one: Array, other: Array) -> Array:
    """Angle between orientations, shape (...) of (..., 3, 3) [rad], exact for small ones."""
    apart = np.linalg.norm(one - other, axis=(-2, -1))
    return 2.0 * np.arcsin(np.clip(apart / np.sqrt(8.0), 0.0, 1.0))
