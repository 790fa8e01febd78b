"""From rest to rest on a quintic of time: position, speed and acceleration begin and end without a jump."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PEAK_SPEED = 1.875
"""Largest slope of `risen`, half way."""
PEAK_ACCELERATION = 5.774
"""Largest second derivative, 10 / sqrt(3), rounded up: what keeps to it keeps to the limit."""


def risen(s: Array) -> tuple[Array, Array, Array]:
    """10 u^3 - 15 u^4 + 6 u^5 with its first two derivatives by s, each of s' shape; u is s held between 0 and 1."""
    u = np.clip(s, 0.0, 1.0)
    return (
        u**3 * (10.0 - 15.0 * u + 6.0 * u**2),
        30.0 * u**2 * (1.0 - u) ** 2,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )
