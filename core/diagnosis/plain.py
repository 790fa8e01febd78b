"""What numbers are where no run shows them, or a fit follows noise to where no robot is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .hypothesis import TENSOR
from .problem import Problem

Vector = NDArray[np.float64]

# one standard deviation of geometry [rad, and of an arm's length]; an arm's length, and how far from its frame what is
# more there is, as part of the robot's
STRAY, PART_OF_REACH = 0.05, 0.2
# where a spring's joint may rest [rad, and of the robot's length]
RESTS = math.pi, 1.0
# part of an arm's mass that may be elsewhere without more of it
SHIFTED = 0.1
# extra mass below which it has no center, and how thick it may be [masses of the arm, and times its length squared]
LEAST_MASS, THICK = 0.02, 0.01
# one standard deviation of how far a load's second moment of mass may be below none, as part of its largest moment
HOLLOW = 1.0e-3


@dataclass(frozen=True, slots=True, eq=False)
class Plain:
    """What numbers are where no run shows them, loosely: geometry as it is known, extra mass at a point near its frame.

    A spring's joint rests where it can be: beside a torque's offset a fit could go on with both for ever. And what
    hangs at an arm is a body: its mass is spread along every axis by no less than nothing.

    Attributes:
        small: Places of the errors of geometry, and of where a load is and a spring rests, among the numbers that are
            fitted.
        loose: Standard deviation of each.
        arms: Of each arm with an extra mass, the places of its numbers by their names, and the arm's own mass [kg].
        length: What is long for an arm [m].
        load: Number in TENSOR, and place, of each of a load's moments of inertia that is fitted.
    """

    small: tuple[int, ...]
    loose: Vector
    arms: tuple[tuple[dict[str, int], float], ...]
    length: float
    load: tuple[tuple[int, int], ...] = ()

    @staticmethod
    def of(problem: Problem, free: Sequence[tuple[str, int, str]]) -> Plain:
        length = usual_length(problem)
        deviations: dict[int, float] = {}
        for k, (effect, at, name) in enumerate(free):
            if effect == "joint_spring" and name == "rest":
                deviations[k] = rests(problem, at)
            elif effect == "kinematic_error":
                deviations[k] = stray(problem, name)
            elif effect == "payload" and name in ("x", "y", "z"):
                deviations[k] = length
        arms: dict[int, dict[str, int]] = {}
        for k, (effect, at, name) in enumerate(free):
            if effect == "link_inertia":
                arms.setdefault(at, {})[name] = k
        mass = {at: problem.database.inertias[at - 1].mass for at in arms}
        heavy = max(1e-3, *(body.mass for body in problem.database.inertias))
        small, loose = tuple(deviations), np.array(list(deviations.values()))
        load = tuple(
            (TENSOR.index(name), k)
            for k, (effect, _, name) in enumerate(free)
            if effect == "payload" and name in TENSOR
        )
        extra = tuple((names, max(mass[at], 0.05 * heavy)) for at, names in arms.items())
        return Plain(small, loose, extra, length, load)

    def apart(self, values: Vector) -> Vector:
        """By how many standard deviations numbers differ from that, shape (p,)."""
        parts = [values[list(self.small)] / self.loose]
        for names, mass in self.arms:
            there = {name: float(values[k]) for name, k in names.items()}
            if "mass" not in there:
                continue
            lever = max(abs(there["mass"]), SHIFTED * mass) * self.length
            parts.append(np.array([there[name] / lever for name in ("mx", "my", "mz") if name in there]))
            if "Ixx" not in there:
                continue
            point = at_a_point(there, LEAST_MASS * mass)
            size = THICK * mass * self.length**2
            parts.append(np.array([(there[name] - point[name]) / size for name in point if name in there]))
        if self.load:
            moments = np.zeros(len(TENSOR))
            for number, k in self.load:
                moments[number] = values[k]
            parts.append(_hollow(moments) / HOLLOW)
        return np.concatenate(parts)

    def usual(self, values: Vector) -> Vector:
        """How far from none a number may well be of which runs show nothing, 0 where it is not said, shape (k,)."""
        out = np.zeros(len(values))
        out[list(self.small)] = self.loose
        for names, mass in self.arms:
            extra = abs(float(values[names["mass"]])) if "mass" in names else 0.0
            lever = max(extra, SHIFTED * mass) * self.length
            for name, k in names.items():
                out[k] = mass if name == "mass" else lever if name.startswith("m") else lever * self.length
        return out


def stray(problem: Problem, name: str) -> float:
    """One standard deviation of an error of an arm's geometry [rad or m]."""
    return STRAY * usual_length(problem) if name in ("a", "d") else STRAY


def usual_length(problem: Problem) -> float:
    """What is long for an arm, or for how far from its frame is what is more there [m]."""
    return PART_OF_REACH * _reach(problem)


def rests(problem: Problem, at: int) -> float:
    """One standard deviation of where a spring's joint may rest [rad or m]."""
    return RESTS[1] * _reach(problem) if problem.database.joints[at - 1].kind == "prismatic" else RESTS[0]


def _reach(problem: Problem) -> float:
    """How long a robot's arms are together [m]."""
    return max(1e-2, sum(math.hypot(*row.pose().xyz) for row in problem.database.kinematics))


def _hollow(moments: Vector) -> Vector:
    """How far below none the second moments of mass are, as parts of the largest moment of inertia, shape (3,)."""
    xx, yy, zz, xy, xz, yz = moments
    principal = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    second = 0.5 * float(principal.sum()) - principal
    largest = max(float(np.abs(principal).max()), 1e-12)
    return np.maximum(-second, 0.0) / largest


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
