"""Veitschegger-Wu (extended Denavit-Hartenberg) parameters of one arm."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pose import Pose


@dataclass(frozen=True, slots=True)
class VeitscheggerWu:
    """A = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), equations 1 and 2 of IMECE2013-64815.

    Attributes:
        alpha: Twist about x [rad].
        a: Shift along x [m].
        theta: Turn about z [rad]; a revolute joint's variable adds to it.
        d: Shift along z [m]; a prismatic joint's variable adds to it.
        beta: Misalignment about y [rad]; 0 is plain Denavit-Hartenberg.
    """

    alpha: float = 0.0
    a: float = 0.0
    theta: float = 0.0
    d: float = 0.0
    beta: float = 0.0

    def __add__(self, other: VeitscheggerWu) -> VeitscheggerWu:
        """Parameter by parameter, as kinematic_error adds."""
        return VeitscheggerWu(
            self.alpha + other.alpha,
            self.a + other.a,
            self.theta + other.theta,
            self.d + other.d,
            self.beta + other.beta,
        )

    def matrix(self) -> NDArray[np.float64]:
        """Homogeneous matrix of the arm's frame in the frame before it, shape (4, 4)."""
        ct, st = cos_sin(self.theta)
        ca, sa = cos_sin(self.alpha)
        cb, sb = cos_sin(self.beta)
        return np.array(
            [
                [ct * cb - st * sa * sb, -st * ca, ct * sb + st * sa * cb, self.a * ct],
                [st * cb + ct * sa * sb, ct * ca, st * sb - ct * sa * cb, self.a * st],
                [-ca * sb, sa, ca * cb, self.d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    def pose(self) -> Pose:
        """Pose of the arm's frame in the frame before it."""
        return Pose.from_matrix(self.matrix())


def cos_sin(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact at multiples of 90 degrees, where tables put most of their angles."""
    quarter = angle / (math.pi / 2)
    if quarter == round(quarter):
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    return math.cos(angle), math.sin(angle)
