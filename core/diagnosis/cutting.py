"""Where a limit that cuts, as engines have it, does most nearly what one with a knee does."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..database import Database
from ..effects import EffectRow
from ..errors import RefusedError
from ..recording import Run
from .beyond import LIMIT
from .model import tables
from .polish import simulated_left

# parts of what the one with a knee comes to
LOWER = (0.95, 0.9, 0.85, 0.8)
# part of what that one leaves that a lower one may leave: where it is reached for long it costs far more than it gains
CLEARLY = 0.75


def cutting(
    database: Database,
    level: str,
    runs: Sequence[Run],
    rows: Mapping[tuple[str, int], EffectRow],
    joints: Sequence[int],
    backend: str,
) -> dict[tuple[str, int], EffectRow]:
    """Rows with each of these joints' torque limit where the runs, simulated, are nearest to what was measured.

    Along the motion the nearest is one that cuts lower; simulated, a robot lags behind that would follow.

    Args:
        database: The robot as it is known.
        level: Of the nominal model.
        runs: That were fitted.
        rows: Effect and place -> row; those of the limits at what their knee comes to.
        joints: Numbers of the joints with a knee.
        backend: The engine.
    """
    best = dict(rows)
    for joint in joints:
        key = (LIMIT, joint)
        top = rows[key].values["torque"]
        options = [EffectRow(joint, {**rows[key].values, "torque": part * top}) for part in (1.0, *LOWER)]
        left = [_misses(database, level, runs, {**best, key: row}, backend) for row in options]
        least = int(np.argmin(left))
        if left[least] < CLEARLY * left[0]:
            best[key] = options[least]
    return best


def _misses(
    database: Database, level: str, runs: Sequence[Run], rows: Mapping[tuple[str, int], EffectRow], backend: str
) -> float:
    """Sum of squares of what is left of simulated runs, in units of their sensors' noise; infinity where none goes."""
    try:
        return sum(float(np.sum(simulated_left(database, level, run, tables(rows), backend) ** 2)) for run in runs)
    except RefusedError:
        return math.inf
