"""An effect at a place in one of the forms in which it could be there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from .model import Rows
from .problem import Problem

Vector = NDArray[np.float64]

Values = dict[str, float]
# how large an amount is tried, as part of what would be a plain effect
STEP = 0.02
TENSOR: tuple[str, ...] = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
# what lets a motor move before a clamped output
GIVING = ("backlash", "joint_compliance", "joint_compliance_6d")


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """One effect at one place in one form.

    Attributes:
        effect: Its name.
        at: Number of joint or arm, from 1; 0 for the robot.
        form: Which of its forms, "" where there is one.
        values: beta -> the row's values; None where these are impossible.
        scale: What would be a plain amount of each number of beta; the spread of their prior.
        lower: Least value of each.
        alone: At beta = 0 it is as if the effect were not there.
        curved: Its signature holds near where it starts only.
        carried: Its other numbers say nothing without the first, as a first moment without a mass.
    """

    effect: str
    at: int
    form: str
    values: Callable[[Vector], Values | None]
    scale: Vector
    lower: Vector
    alone: bool = True
    curved: bool = False
    carried: bool = False

    @property
    def place(self) -> str:
        """joint_N, arm_N or robot."""
        return place_of(self.effect, self.at)

    @property
    def key(self) -> tuple[str, int]:
        """What it is called in a verdict."""
        return (self.effect, self.at)

    def rows(self, beta: Vector) -> Rows | None:
        """Its row as a table; None where these values are impossible."""
        values = self.values(beta)
        return None if values is None else {self.effect: (EffectRow(self.at, values),)}


def place_of(effect: str, at: int) -> str:
    """joint_N, arm_N or robot."""
    key = effect_named(effect).key
    return "robot" if key == "robot" else f"{key}_{at}"


def defaults(name: str) -> Values:
    """Every number of an effect's row as it is where the row says nothing, 0 where it has to say something."""
    return {column.name: 0.0 if column.default is None else column.default for column in effect_named(name).columns}


def clamped(problem: Problem, at: int) -> bool:
    """Whether a joint's arm is held in every run."""
    return all(at in run.run.locked for run in problem.evidence.runs)
