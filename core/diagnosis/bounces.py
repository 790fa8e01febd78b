"""An arm that bounces in its play: of two that are all but alike each soon goes its own way, and no model says which.

What is left of such a gap though its cause is known is told by simulation itself: how far robots come apart whose play
is a little narrower or wider than was found, by less than anybody could know it. The robot that was measured is one
more of them (as a weather forecast's error is no larger than its ensemble's spread where the model is right).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..database import Database
from ..errors import RefusedError
from ..recording import Run
from .blocks import Blocks, Sums
from .compared import mode_of, residuals
from .found import Found, rows_of
from .model import robot_of
from .noise import noise_floor
from .refine import PLAY, as_wide
from .resimulate import resimulated

Vector = NDArray[np.float64]

# how wide play is, as parts of what was found: what does not bounce hardly knows the difference
WIDTHS = (0.97, 0.985, 1.0, 1.015, 1.03)
# what bouncing may leave of what is left to be all of it, and how much more it may make than that
UNSAID, MOST_MADE = 0.25, 4.0


@dataclass(frozen=True, slots=True)
class Bounces:
    """What bouncing in play makes of next to nothing, beside what is left.

    Attributes:
        leaves: Part of the squared gap that is left beyond it.
        makes: It, as part of the squared gap that is left.
    """

    leaves: float
    makes: float

    @property
    def says_all(self) -> bool:
        """Whether what is left is no more than that, and no less than a part of it."""
        return self.leaves < UNSAID and self.makes < MOST_MADE


def bounces(
    database: Database, level: str, backend: str, judged: Sequence[tuple[Run, Sequence[Found]]]
) -> Bounces | None:
    """How far robots with nearly the same play come apart; None where nothing has play, or no engine lets it bounce.

    Args:
        database: The robot as it is known.
        level: Of the nominal model.
        backend: Engine.
        judged: Runs, each with findings whose fit has not seen it.
    """
    if any(mode_of(run) == "unknown" or not any(item.effect == PLAY for item in found) for run, found in judged):
        return None
    left: list[Mapping[str, Vector]] = []
    apart: list[list[Mapping[str, Vector]]] = []
    try:
        for run, found in judged:
            nominal = robot_of(database, level, run)
            robots = [robot_of(database, level, run, rows_of(_as_wide(found, part))) for part in WIDTHS]
            each = [residuals(run, resimulated(robot, nominal, run, backend), robot) for robot in robots]
            left.append(each[WIDTHS.index(1.0)])
            apart.append([{name: a[name] - b[name] for name in a} for a, b in itertools.combinations(each, 2)])
    except RefusedError:
        return None
    runs = [run for run, _ in judged]
    noises = [noise_floor(database, level, run) for run in runs]
    rest = Blocks.of(left, noises, runs).together()
    spread = [Blocks.of(pair, noises, runs).together() for pair in zip(*apart, strict=True)]
    made = {name: np.stack([one.relative(name) for one in spread]).mean(axis=0) for name in rest.signals}
    loud = {name: rest.relative(name) - 1.0 for name in rest.signals}
    had = _squared_gap(loud, rest)
    if not had > 0.0:
        return None
    beyond = {name: loud[name] - made[name] for name in rest.signals}
    return Bounces(_squared_gap(beyond, rest) / had, _squared_gap(made, rest) / had)


def _as_wide(found: Sequence[Found], part: float) -> list[Found]:
    """Findings with every play wider by a factor."""
    return [replace(item, row=as_wide(item.row, part)) if item.effect == PLAY else item for item in found]


def _squared_gap(powers: Mapping[str, Vector], sums: Sums) -> float:
    """Square of a gap in units of noise: mean over signals, of the mean over channels of what is above nothing."""
    channels = {name: np.maximum(values, 0.0)[sums.counts[name] > 0.0] for name, values in powers.items()}
    return sum(float(values.mean()) if len(values) else 0.0 for values in channels.values()) / max(len(channels), 1)
