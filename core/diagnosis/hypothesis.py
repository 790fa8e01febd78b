"""An effect at a place in one of the forms in which it could be there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from .model import Rows
from .placed import Placed
from .problem import Problem

Vector = NDArray[np.float64]

Values = dict[str, float]
# how large an amount is tried, as part of what would be a plain effect
STEP = 0.02
TENSOR: tuple[str, ...] = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
# what lets a motor move before a clamped output
GIVING = ("backlash", "joint_compliance", "joint_compliance_6d")


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis(Placed):
    """One effect at one place in one form.

    Attributes:
        effect, at: What and where.
        form: Which of its forms, "" where there is one.
        values: beta -> the row's values; None where these are impossible.
        scale: What would be a plain amount of each number of beta; the spread of their prior.
        lower: Least value of each.
        alone: At beta = 0 it is as if the effect were not there.
        curved: Its signature holds near where it starts only.
        carried: Its other numbers say nothing without the first, as a first moment without a mass.
    """

    form: str
    values: Callable[[Vector], Values | None]
    scale: Vector
    lower: Vector
    alone: bool = True
    curved: bool = False
    carried: bool = False

    def rows(self, beta: Vector) -> Rows | None:
        """Its row as a table; None where these values are impossible."""
        values = self.values(beta)
        return None if values is None else {self.effect: (EffectRow(self.at, values),)}


def defaults(name: str) -> Values:
    """Every number of an effect's row as it is where the row says nothing, 0 where it has to say something."""
    return {column.name: 0.0 if column.default is None else column.default for column in effect_named(name).columns}


def clamped(problem: Problem, at: int) -> bool:
    """Whether a joint's arm is held in every run."""
    return all(at in run.run.locked for run in problem.evidence.runs)
