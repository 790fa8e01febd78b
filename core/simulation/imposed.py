"""Rigid joints whose motion is imposed while others are elastic: the torque that makes them follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .backend import Vector

# time constant [s] at which rounding errors of an imposed joint die out (Baumgarte, 1972)
CORRECTION_TIME = 5.0e-3


def imposed_acceleration(q: Vector, dq: Vector, q_cmd: Vector, dq_cmd: Vector, ddq_cmd: Vector) -> Vector:
    """Acceleration that follows a motion and takes rounding errors out, shape as given."""
    w = 1.0 / CORRECTION_TIME
    return ddq_cmd + 2.0 * w * (dq_cmd - dq) + w * w * (q_cmd - q)


def rigid_joint_torques(
    mass_matrix: Vector, bias: Vector, driven: Vector, rigid: NDArray[np.bool_], acceleration: Vector
) -> Vector:
    """Torques of all joints when those that are rigid accelerate as imposed.

    Args:
        mass_matrix: Of the arms, shape (n, n).
        bias: Gravity, Coriolis and centrifugal torques, shape (n,).
        driven: Torques on the arms that springs give, shape (n,).
        rigid: Where the joint is rigid, shape (n,), bool.
        acceleration: Imposed accelerations, used where rigid, shape (n,).

    Returns:
        driven, with what the drive must add at rigid joints, shape (n,).
    """
    elastic = ~rigid
    ddq = np.where(rigid, acceleration, 0.0)
    if elastic.any():
        rest = driven[elastic] - bias[elastic] - mass_matrix[np.ix_(elastic, rigid)] @ ddq[rigid]
        ddq[elastic] = np.linalg.solve(mass_matrix[np.ix_(elastic, elastic)], rest)
    torque = driven.copy()
    torque[rigid] = mass_matrix[rigid] @ ddq + bias[rigid]
    return torque
