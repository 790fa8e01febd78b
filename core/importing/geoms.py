"""Mass properties of the solids that MJCF calls geoms, homogeneous, about their centers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..representation import Inertia, Pose

WATER = 1000.0
"""MJCF's default density [kg/m^3]."""


@dataclass(frozen=True, slots=True)
class Solid:
    """A shape and where it stands.

    Attributes:
        kind: "sphere" (radius), "capsule" and "cylinder" (radius, half length; axis z), "ellipsoid" (half axes),
            "box" (half lengths).
        size: As many lengths [m] as the kind has.
    """

    kind: str
    size: tuple[float, ...]

    def volume(self) -> float:
        """[m^3]."""
        s = self.size
        match self.kind:
            case "sphere":
                return 4.0 / 3.0 * math.pi * s[0] ** 3
            case "capsule":
                return math.pi * s[0] ** 2 * 2.0 * s[1] + 4.0 / 3.0 * math.pi * s[0] ** 3
            case "cylinder":
                return math.pi * s[0] ** 2 * 2.0 * s[1]
            case "ellipsoid":
                return 4.0 / 3.0 * math.pi * s[0] * s[1] * s[2]
            case _:
                return 8.0 * s[0] * s[1] * s[2]

    def inertia(self, mass: float) -> Inertia:
        """Of that mass, about the center, axes along the shape's."""
        s = self.size
        match self.kind:
            case "sphere":
                moments = (0.4 * mass * s[0] ** 2,) * 3
            case "capsule":
                # a cylinder and two half balls, each at its own center of mass (3/8 r from the flat face)
                r, h = s[0], 2.0 * s[1]
                ball = mass * (4.0 / 3.0 * r) / (4.0 / 3.0 * r + h)
                middle = mass - ball
                across = middle * (3.0 * r * r + h * h) / 12.0 + ball * (0.4 * r * r + 0.375 * r * h + 0.25 * h * h)
                moments = (across, across, 0.5 * middle * r * r + 0.4 * ball * r * r)
            case "cylinder":
                across = mass * (3.0 * s[0] ** 2 + 4.0 * s[1] ** 2) / 12.0
                moments = (across, across, 0.5 * mass * s[0] ** 2)
            case "ellipsoid":
                moments = _from_squares(mass / 5.0, s)
            case _:
                moments = _from_squares(mass / 3.0, s)
        return Inertia.from_tensor(mass, np.zeros(3), np.diag(moments))


SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
"""Kind to how many lengths it has."""


def _from_squares(factor: float, size: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = (factor * length * length for length in size)
    return (y + z, x + z, x + y)


def placed(solid: Solid, mass: float | None, density: float, in_body: Pose) -> Inertia:
    """A solid in its body's frame, by its mass or, where that is None, by its density [kg/m^3]."""
    return solid.inertia(density * solid.volume() if mass is None else mass).moved(in_body)
