"""The contract of a physical effect: its table's columns, what it changes in the robot, and its laws.

An effect is one file in this package, or an entry point of the group `mbexport.effects` in any distribution. It is
a class with

- `name`, `key` and `columns`: the table `effects/<name>.dat` of a database;
- `apply`: what its rows change in the neutral robot (the default adds its laws to the joint of each row);
- `laws`: plain functions of numbers that Numba can compile, for what no engine has by itself. They are compiled once
  and used by every engine, and their source goes verbatim into the scripts that are emitted.
"""

from __future__ import annotations

import dis
import math
from abc import ABC
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, Literal, cast

from ..representation import Drive, JointKind, Robot, Stage, Term, TermKind

LawFunction = Callable[[Any, float, float, float, float, float, float], float]
"""law(p, t, theta, dtheta, q, dq, load) -> value. p: the term's parameters, indexable, SI; t [s]; theta, dtheta: motor
side; q, dq: arm side; load: what the drive passes to the arm [N m or N]. Only arithmetic and the module `math`."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of an effect's table.

    Attributes:
        name: As it stands in the table's header.
        unit: SI unit; "revolute|prismatic" where it depends on the joint, e.g. "N*m|N"; "" for a plain number.
        default: Value where the column is missing; None: the column must be there.
        minimum, maximum: Bounds of what is possible.
        exclusive: The bounds themselves are excluded.
        infinite: inf is a value.
    """

    name: str
    unit: str = ""
    default: float | None = None
    minimum: float = -math.inf
    maximum: float = math.inf
    exclusive: bool = False
    infinite: bool = False

    def unit_for(self, kind: JointKind) -> str:
        """The unit at a revolute or a prismatic joint."""
        return self.unit.split("|")[-1 if kind == "prismatic" else 0]


@dataclass(frozen=True, slots=True)
class Law:
    """A function of an effect and what its value means (see `representation.Term.kind`)."""

    kind: TermKind
    function: LawFunction
    uses_load: bool = False  # at a rigid joint `load` must then be solved with the accelerations

    @property
    def name(self) -> str:
        """Name by which a Term finds it."""
        return self.function.__name__

    @property
    def reads_arm(self) -> bool:
        """Whether q or dq stands in it, whatever it calls them."""
        return not {*self.function.__code__.co_varnames[4:6]}.isdisjoint(_read_by(self.function))


@cache
def _read_by(function: LawFunction) -> frozenset[str]:
    """Names that a function reads."""
    names: set[str] = set()
    for step in dis.get_instructions(function):
        # later Pythons read two variables in one step
        read = cast("tuple[Any, ...]", step.argval if isinstance(step.argval, tuple) else (step.argval,))
        names |= {name for name in read if isinstance(name, str)}
    return frozenset(names)


@dataclass(frozen=True, slots=True)
class EffectRow:
    """One row of an effect's table.

    Attributes:
        at: Number of the joint or arm, from 1; 0 for the robot.
        values: Column name to value, SI, every column of the effect present.
    """

    at: int
    values: Mapping[str, float]


class Effect(ABC):
    """Base of every effect; see the module's text."""

    name: ClassVar[str]
    key: ClassVar[Literal["joint", "arm", "robot"]]
    columns: ClassVar[tuple[Column, ...]]
    laws: ClassVar[tuple[Law, ...]] = ()
    after: ClassVar[tuple[str, ...]] = ()  # effects that are applied before this one

    def check(self, values: Mapping[str, float]) -> str | None:
        """What is wrong with a row beyond its columns' bounds, as a sentence; None where nothing is."""
        return None

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """The robot with this effect at the rows' places. Default: each row's values become each law's parameters.

        Args:
            robot: The robot so far; effects are applied by name, but each after those it names in `after`.
            rows: This effect's rows.
        """

        def changed(drive: Drive, row: EffectRow) -> Drive:
            parameters = tuple(row.values[column.name] for column in self.columns)
            terms = tuple(Term(self.name, law.name, law.kind, parameters) for law in self.laws)
            return replace(drive, terms=drive.terms + terms)

        return with_drives(robot, rows, changed)


def in_order(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects sorted by name, each after those that it names in `after`."""
    waiting = sorted(effects, key=lambda effect: effect.name)
    ordered: list[Effect] = []
    while waiting:
        names = {effect.name for effect in waiting}
        # a circle of plugins that each want to be last is cut at its first name
        ready = next((effect for effect in waiting if not names & set(effect.after)), waiting[0])
        waiting.remove(ready)
        ordered.append(ready)
    return tuple(ordered)


def with_stage(robot: Robot, at: int, change: Callable[[Stage], Stage]) -> Robot:
    """The robot with the stage of number `at` (from 1) changed."""
    stages = list(robot.stages)
    stages[at - 1] = change(stages[at - 1])
    return replace(robot, stages=tuple(stages))


def with_drives(robot: Robot, rows: Sequence[EffectRow], change: Callable[[Drive, EffectRow], Drive]) -> Robot:
    """The robot with the drives changed at the joints of the rows, each by its row, in their order."""
    stages = list(robot.stages)
    for row in rows:
        stage = stages[row.at - 1]
        stages[row.at - 1] = replace(stage, drive=change(stage.drive, row))
    return replace(robot, stages=tuple(stages))


def with_drive(robot: Robot, at: int, change: Callable[[Drive], Drive]) -> Robot:
    """The robot with the drive of joint `at` (from 1) changed."""
    return with_stage(robot, at, lambda stage: replace(stage, drive=change(stage.drive)))
