"""What numbers are where no run shows them, or a fit follows noise to where no robot is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import Problem

Vector = NDArray[np.float64]

# one standard deviation of geometry [rad, and of an arm's length]; an arm's length as part of the robot's
STRAY, PART_OF_REACH = 0.05, 0.2
# extra mass below which it has no center, and how thick it may be [masses of the arm, and times its length squared]
LEAST_MASS, THICK = 0.02, 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Plain:
    """What numbers are where no run shows them, loosely: geometry as it is known, an arm's extra mass at a point.

    Attributes:
        geometry: Places of the errors of geometry among the numbers that are fitted.
        loose: Standard deviation of each.
        arms: Of each arm with an extra mass, the places of its numbers by their names, and the arm's own mass [kg].
        length: What is long for an arm [m].
    """

    geometry: tuple[int, ...]
    loose: Vector
    arms: tuple[tuple[dict[str, int], float], ...]
    length: float

    @staticmethod
    def of(problem: Problem, free: Sequence[tuple[str, int, str]]) -> Plain:
        length = PART_OF_REACH * max(1e-2, sum(math.hypot(*row.pose().xyz) for row in problem.database.kinematics))
        geometry = tuple(k for k, (effect, _, _) in enumerate(free) if effect == "kinematic_error")
        loose = np.array([STRAY * length if free[k][2] in ("a", "d") else STRAY for k in geometry])
        arms: dict[int, dict[str, int]] = {}
        for k, (effect, at, name) in enumerate(free):
            if effect == "link_inertia":
                arms.setdefault(at, {})[name] = k
        mass = {at: problem.database.inertias[at - 1].mass for at in arms}
        heavy = max(1e-3, *(body.mass for body in problem.database.inertias))
        return Plain(geometry, loose, tuple((names, max(mass[at], 0.05 * heavy)) for at, names in arms.items()), length)

    def apart(self, values: Vector) -> Vector:
        """By how many standard deviations numbers differ from that, shape (p,)."""
        parts = [values[list(self.geometry)] / self.loose]
        for names, mass in self.arms:
            if "mass" not in names or "Ixx" not in names:
                continue
            there = {name: float(values[k]) for name, k in names.items()}
            point = at_a_point(there, LEAST_MASS * mass)
            size = THICK * mass * self.length**2
            parts.append(np.array([(there[name] - point[name]) / size for name in point if name in there]))
        return np.concatenate(parts)


def at_a_point(body: Mapping[str, float], least: float) -> dict[str, float]:
    """Moments of inertia about the frame's origin of an extra mass at its center.

    Args:
        body: mass and first moments mx, my, mz.
        least: Mass below which it has no center.
    """
    mass = body["mass"]
    x, y, z = (body.get(name, 0.0) for name in ("mx", "my", "mz"))
    by = math.copysign(max(abs(mass), least), mass)
    square = x * x + y * y + z * z
    return {
        "Ixx": (square - x * x) / by,
        "Iyy": (square - y * y) / by,
        "Izz": (square - z * z) / by,
        "Ixy": -x * y / by,
        "Ixz": -x * z / by,
        "Iyz": -y * z / by,
    }
