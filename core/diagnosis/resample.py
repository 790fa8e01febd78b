"""Values of one grid of times at others: a run's own stamps."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

# a stamp may be so much of a tick before it and mean it
EARLY = 0.05
# a stamp this near to a uniform clock is on it [s]
ON_CLOCK = 1.0e-7


def at_stamps(times: Vector, grid: Vector, signals: Mapping[str, Vector], *, held: bool) -> dict[str, Vector]:
    """Signals of a uniform grid at other times; a motor torque that is held between ticks stays held."""
    found: dict[str, Vector] = {}
    for name, values in signals.items():
        if name == "tau" and held:
            # a row whose stamp is a little before a tick was recorded at that tick
            early = EARLY * float(grid[1] - grid[0]) if len(grid) > 1 else 0.0
            at = np.searchsorted(grid, times + max(early, ON_CLOCK), side="right") - 1
            found[name] = values[np.clip(at, 0, len(grid) - 1)]
        elif name == "ee_rot":
            # neighbouring quaternions of one hemisphere
            flips = np.cumprod(np.where(np.sum(values[1:] * values[:-1], axis=1) < 0.0, -1.0, 1.0))
            near = between(grid, values * np.concatenate([[1.0], flips])[:, None], times)
            found[name] = near / np.linalg.norm(near, axis=1, keepdims=True)
        else:
            found[name] = between(grid, values, times)
    return found


def between(grid: Vector, values: Vector, times: Vector) -> Vector:
    """Cubic interpolation of what is smooth, shape (k, n)."""
    interpolate: Any = import_module("scipy.interpolate")

    if len(grid) < 4:
        return linear(grid, values, times)
    return np.asarray(interpolate.CubicSpline(grid, values)(times))


def linear(grid: Vector, values: Vector, times: Vector) -> Vector:
    """Linear interpolation, shape (k, n)."""
    out = np.empty((len(times), values.shape[1]))
    for i in range(values.shape[1]):
        out[:, i] = np.interp(times, grid, values[:, i])
    return out
