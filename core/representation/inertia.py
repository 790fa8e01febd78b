"""Mass properties of one rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pose import Pose, Vector3


@dataclass(frozen=True, slots=True)
class Inertia:
    """Ten inertial parameters, about the center of mass, axes parallel to the frame they are given in.

    Attributes:
        mass: [kg].
        com: Center of mass in the frame [m].
        xx, yy, zz: Moments of inertia about the center of mass [kg m^2].
        xy, xz, yz: Elements of the inertia tensor (minus the integral of x y dm) [kg m^2].
    """

    mass: float = 0.0
    com: Vector3 = (0.0, 0.0, 0.0)
    xx: float = 0.0
    yy: float = 0.0
    zz: float = 0.0
    xy: float = 0.0
    xz: float = 0.0
    yz: float = 0.0

    def tensor(self) -> NDArray[np.float64]:
        """Inertia tensor about the center of mass, shape (3, 3) [kg m^2]."""
        return np.array(
            [
                [self.xx, self.xy, self.xz],
                [self.xy, self.yy, self.yz],
                [self.xz, self.yz, self.zz],
            ]
        )

    @staticmethod
    def from_tensor(mass: float, com: NDArray[np.float64], tensor: NDArray[np.float64]) -> Inertia:
        """From a mass, a center of mass, shape (3,), and a tensor about it, shape (3, 3)."""
        x, y, z = (float(c) for c in com)
        i = np.asarray(tensor, dtype=float).tolist()
        return Inertia(mass, (x, y, z), i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2])

    def moved(self, here_in_new: Pose) -> Inertia:
        """The same body seen from another frame, in which this one stands at here_in_new."""
        rotation = here_in_new.rotation_matrix()
        com = rotation @ np.array(self.com) + np.array(here_in_new.xyz)
        return Inertia.from_tensor(self.mass, com, rotation @ self.tensor() @ rotation.T)

    def first_moments(self) -> NDArray[np.float64]:
        """Mass times center of mass, shape (3,) [kg m]."""
        return self.mass * np.array(self.com)

    def tensor_about_origin(self) -> NDArray[np.float64]:
        """Inertia tensor about the frame's origin, shape (3, 3) [kg m^2] (Steiner)."""
        return self.tensor() + self.mass * steiner(np.array(self.com))

    @staticmethod
    def from_origin(
        mass: float, first_moments: NDArray[np.float64], tensor_about_origin: NDArray[np.float64]
    ) -> Inertia:
        """From parameters about the frame's origin, in which bodies add up; mass may not be 0 unless all are."""
        if mass == 0.0:
            return Inertia.from_tensor(0.0, np.zeros(3), tensor_about_origin)
        com = first_moments / mass
        return Inertia.from_tensor(mass, com, tensor_about_origin - mass * steiner(com))

    def __add__(self, other: Inertia) -> Inertia:
        """Two bodies fixed to each other, given in the same frame."""
        if other == Inertia():
            return self
        if self == Inertia():
            return other
        return Inertia.from_origin(
            self.mass + other.mass,
            self.first_moments() + other.first_moments(),
            self.tensor_about_origin() + other.tensor_about_origin(),
        )

    def principal(self) -> tuple[Vector3, Pose]:
        """Principal moments, ascending [kg m^2], and the pose of their (right-handed) axes, at the center of mass."""
        moments, axes = np.linalg.eigh(self.tensor())
        if np.linalg.det(axes) < 0:
            axes[:, 2] = -axes[:, 2]
        matrix = np.eye(4)
        matrix[:3, :3] = axes
        matrix[:3, 3] = self.com
        a, b, c = (float(m) for m in moments)
        return (a, b, c), Pose.from_matrix(matrix)


def steiner(r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tensor of a unit mass at r about the origin: (r.r) 1 - r r^T, shape (3, 3) [m^2]."""
    return float(r @ r) * np.eye(3) - np.outer(r, r)
