"""Rigid transforms: where a frame stands in another one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector3 = tuple[float, float, float]
Rows3 = tuple[Vector3, Vector3, Vector3]

_IDENTITY: Rows3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of a frame (child) in another (parent): p_parent = rotation p_child + xyz.

    Attributes:
        xyz: Origin of the child in the parent [m].
        rotation: Rotation matrix, by rows; its columns are the child's axes in the parent.
    """

    xyz: Vector3 = (0.0, 0.0, 0.0)
    rotation: Rows3 = _IDENTITY

    @staticmethod
    def from_matrix(matrix: NDArray[np.float64]) -> Pose:
        """Pose from a homogeneous matrix, shape (4, 4)."""
        m = np.asarray(matrix, dtype=float).tolist()
        return Pose(
            (m[0][3], m[1][3], m[2][3]),
            (
                (m[0][0], m[0][1], m[0][2]),
                (m[1][0], m[1][1], m[1][2]),
                (m[2][0], m[2][1], m[2][2]),
            ),
        )

    @staticmethod
    def from_rpy(xyz: Vector3, rpy: Vector3) -> Pose:
        """Pose from fixed-axis roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF."""
        (cr, cp, cy), (sr, sp, sy) = (tuple(f(a) for a in rpy) for f in (math.cos, math.sin))
        return Pose(
            xyz,
            (
                (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
                (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
                (-sp, cp * sr, cp * cr),
            ),
        )

    def matrix(self) -> NDArray[np.float64]:
        """Homogeneous matrix, shape (4, 4)."""
        x, y, z = self.xyz
        first, second, third = self.rotation
        return np.array([[*first, x], [*second, y], [*third, z], [0.0, 0.0, 0.0, 1.0]])

    def rotation_matrix(self) -> NDArray[np.float64]:
        """Rotation matrix, shape (3, 3)."""
        return np.array(self.rotation)

    def __matmul__(self, other: Pose) -> Pose:
        """Pose of other's child in this pose's parent."""
        return Pose.from_matrix(self.matrix() @ other.matrix())

    def inverse(self) -> Pose:
        """Pose of the parent in the child."""
        first, second, third = self.rotation
        x, y, z = self.xyz
        columns = tuple(zip(first, second, third, strict=True))
        a, b, c = (-(column[0] * x + column[1] * y + column[2] * z) for column in columns)
        return Pose((a, b, c), (columns[0], columns[1], columns[2]))

    def rpy(self) -> Vector3:
        """Fixed-axis roll, pitch, yaw [rad] whose matrix is this rotation to rounding, gimbal lock included.

        Near pitch = +-90 deg an arcsine loses half of the digits and roll and yaw are told apart by noise only.
        Pitch comes from atan2, yaw from the first column, and roll from what is left once yaw is taken out.
        """
        r = self.rotation
        cos_pitch = math.hypot(r[0][0], r[1][0])
        pitch = math.atan2(-r[2][0], cos_pitch)
        yaw = math.atan2(r[1][0], r[0][0]) if cos_pitch > 1e-9 else 0.0
        cy, sy = math.cos(yaw), math.sin(yaw)
        # second row of Rz(-yaw) R is (0, cos(roll), -sin(roll)), exact at any pitch
        roll = math.atan2(sy * r[0][2] - cy * r[1][2], cy * r[1][1] - sy * r[0][1])
        return (roll, pitch, yaw)

    def quaternion(self) -> tuple[float, float, float, float]:
        """Unit quaternion (w, x, y, z), w >= 0, by the largest-component method of Shepperd (1978)."""
        r = self.rotation
        trace = r[0][0] + r[1][1] + r[2][2]
        squares = (trace, r[0][0], r[1][1], r[2][2])
        largest = squares.index(max(squares))
        if largest == 0:
            q = [1.0 + trace, r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]]
        else:
            i = largest - 1
            j, k = (i + 1) % 3, (i + 2) % 3
            q = [0.0, 0.0, 0.0, 0.0]
            q[0] = r[k][j] - r[j][k]
            q[1 + i] = 1.0 + r[i][i] - r[j][j] - r[k][k]
            q[1 + j] = r[j][i] + r[i][j]
            q[1 + k] = r[k][i] + r[i][k]
        norm = math.copysign(math.sqrt(sum(c * c for c in q)), q[0])
        w, x, y, z = (c / norm for c in q)
        return (w, x, y, z)
