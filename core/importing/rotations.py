"""Rotations in the ways that files write them."""

from __future__ import annotations

import math

import numpy as np

from ..representation import Pose, Vector3
from ..representation.veitschegger_wu import cos_sin


def of_quaternion(quaternion: tuple[float, float, float, float]) -> Pose:
    """Rotation of a quaternion (w, x, y, z) of any length above 0."""
    norm = math.hypot(*quaternion)
    w, x, y, z = (c / norm for c in quaternion)
    return Pose(
        rotation=(
            (w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
        )
    )


def about(axis: Vector3, angle: float) -> Pose:
    """Rotation about a unit axis (Rodrigues), exact at multiples of 90 degrees about a coordinate axis."""
    x, y, z = axis
    c, s = cos_sin(angle)
    t = 1.0 - c
    return Pose(
        rotation=(
            (c + t * x * x, t * x * y - s * z, t * x * z + s * y),
            (t * x * y + s * z, c + t * y * y, t * y * z - s * x),
            (t * x * z - s * y, t * y * z + s * x, c + t * z * z),
        )
    )


def of_euler(angles: Vector3, sequence: str) -> Pose:
    """Rotation of three angles [rad] about the axes of `sequence`: small letters turn with the body, capitals stay."""
    axes: dict[str, Vector3] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    rotation = Pose()
    for letter, angle in zip(sequence, angles, strict=True):
        turn = about(axes[letter.lower()], angle)
        rotation = rotation @ turn if letter.islower() else turn @ rotation
    return rotation


def onto_z(direction: Vector3) -> Pose:
    """The shortest rotation that takes the z axis to a unit direction; a half turn about x where that is -z."""
    x, y, z = direction
    if z < -1.0 + 1e-12:
        return Pose(rotation=((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))
    h = 1.0 + z
    return Pose(rotation=((1.0 - x * x / h, -x * y / h, x), (-x * y / h, 1.0 - y * y / h, y), (-x, -y, z)))


def of_x_and_y(x: Vector3, y: Vector3) -> Pose | None:
    """Rotation whose first axis is x and whose second lies with y in one half-plane of x; None where there is none."""
    first = np.array(x)
    length = float(np.linalg.norm(first))
    if length < 1e-10:
        return None
    first = first / length
    second = np.array(y) - (first @ np.array(y)) * first
    length = float(np.linalg.norm(second))
    if length < 1e-10:
        return None
    second = second / length
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack((first, second, np.cross(first, second)))
    return Pose.from_matrix(matrix)


def at(place: Vector3, rotation: Pose) -> Pose:
    """A rotation at a place."""
    return Pose(place, rotation.rotation)
