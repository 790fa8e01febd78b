"""Intervals that reach from what the measured motion says of a number to what simulation says of it.

Both are of the same runs, and noise moves both alike: what keeps them apart is what one of them does not know, and a
number may be as far off as they are from each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .polish import DAMPING
from .refine import Refined, at_least

Apart = Mapping[tuple[str, int, str], float]


def ways_apart(along: Refined, simulated: Refined) -> dict[tuple[str, int, str], float]:
    """How far each number from simulation is from that along the measured motion [SI].

    But for those of which a smoothed motion is known to say little: how a spring is damped, and how long a delay is.
    """
    out: dict[tuple[str, int, str], float] = {}
    for effect, at, name in simulated.free:
        if effect != "delay" and name not in DAMPING.get(effect, ()):
            way = simulated.rows[effect, at].values[name] - along.rows[effect, at].values[name]
            out[effect, at, name] = abs(math.remainder(way, math.tau) if name == "phase" else way)
    return out


def reaching(fit: Refined, apart: Apart) -> Refined:
    """A fit each of whose numbers has at least these standard deviations [SI]."""
    least = np.array([apart.get(key, 0.0) for key in fit.free])
    return replace(fit, covariance=at_least(fit.covariance, least**2))
