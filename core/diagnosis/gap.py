"""How large the gap of some runs is, and how surely it is more than noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..recording import Run
from ..representation import Robot
from .diagnosis import Where
from .fit import Part, edges_of
from .noise import Noise, loudest, significance
from .where import where

Vector = NDArray[np.float64]

# how rarely a perfect model may be called wrong
LEVEL = 0.01
# mean squares, in units of noise, that are more than noise not well known: of a channel, and of one of its bands
SHOWS, SHOWS_IN_BAND, SHORTEST_BAND = 2.0, 5.0, 6
# of a channel, what no noise is known so badly as to leave, and of a band where it is stated
PLAIN, PLAIN_IN_BAND = 40.0, 12.0


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """Measured minus simulated of all runs, and how surely that is more than noise.

    Attributes:
        where: The gap's places.
        chance: Probability that a perfect model would leave as much.
        loudest: Largest mean square of a channel in units of noise.
    """

    where: Where
    chance: float
    loudest: float

    @property
    def is_noise(self) -> bool:
        """Whether a perfect model might leave it: by chance, or because no noise is known that well."""
        return self.chance >= LEVEL or self.loudest <= SHOWS


def gap_of(
    left: Sequence[Mapping[str, Vector]],
    noises: Sequence[Noise],
    runs: Sequence[Run],
    robot: Robot,
    judged_by: Sequence[Noise] | None = None,
) -> Gap:
    """The gap of runs.

    Args:
        left: Measured minus simulated of each.
        noises: What a perfect model would leave of each.
        runs: The runs.
        robot: As it was simulated.
        judged_by: The noises by which it is more than noise or not; None: the same.
    """
    by = noises if judged_by is None else judged_by
    return Gap(where(left, noises, runs, robot), significance(left, by), loudest(left, by))


def shows(left: Vector, parts: Sequence[Part]) -> bool:
    """Whether the measured motion itself takes what the model does not say.

    A controller that acts on its sensors' noise moves the robot by what no simulation knows, and nobody knows noise
    exactly; along the measured motion neither is a gap.
    """
    return loudest_along(left, parts) > SHOWS or shows_in_band(left, parts)


def shows_plainly(left: Vector, parts: Sequence[Part]) -> bool:
    """Whether it does so beyond any doubt, though a simulation under a controller may hide it in that one's noise."""
    return loudest_along(left, parts) > PLAIN


def loudest_along(left: Vector, parts: Sequence[Part]) -> float:
    """Largest mean square of a channel of what the measured motion takes, in units of noise; 0 without channels."""
    return max((float(np.mean(left[a:b] ** 2)) for a, b in edges_of(parts)), default=0.0)


def shows_in_band(left: Vector, parts: Sequence[Part], least: float = SHOWS_IN_BAND) -> bool:
    """Whether a band of the measured motion's torques alone is far above noise, which is loud in others."""
    return any(
        float(np.mean(left[part.first : part.last] ** 2)) > least
        for part in parts
        if part.last - part.first >= SHORTEST_BAND
    )
