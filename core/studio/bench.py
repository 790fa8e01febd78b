"""What is changed of a robot, and what acts: a database with other numbers and a choice of effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..build import build
from ..database import FrozenMap
from ..effects import EffectRow, catalogue, effect_named
from ..expansion import SHORTEST_BEND
from ..study.values import Place, columns, rows, tables, value_at, with_values

if TYPE_CHECKING:
    from ..database import Database
    from ..representation import Robot

# the level of a saved database that has the effects which acted
LEVEL = "studio"
# Where an effect begins that the database has no row of and whose column may not be 0: next to harmless
_STARTS = {"N*m/rad": 1.0e5, "rad/s": 0.1}
_ENOUGH_TORQUE = 1.0e4


@dataclass(frozen=True, slots=True)
class Bench:
    """A database, and what was changed of it; every change makes another bench.

    Attributes:
        original: The database as it was read.
        values: Numbers that were changed, SI.
        effects: Names of the effects that act, sorted.
    """

    original: Database
    values: FrozenMap[Place, float] = FrozenMap()
    effects: tuple[str, ...] = ()

    @classmethod
    def of(cls, database: Database, level: str = "full") -> Bench:
        """The bench of a database at a level.

        Raises:
            UsageError: It has no such level.
        """
        return cls(database, FrozenMap(), build(database, level).effects)

    def database(self) -> Database:
        """The database with everything that was changed.

        Raises:
            RefusedError: No robot can have these numbers.
        """
        database = self._with_tables()
        acting = {*self.original.effects, *self.effects}
        places = [place for place in self.values if place.table not in catalogue() or place.table in acting]
        return with_values(database, places, [self.values[place] for place in places])

    def robot(self) -> Robot:
        """The robot with the effects that act.

        Raises:
            RefusedError: No robot can have these numbers.
            UsageError: The effects turn an arm into what no body can be.
        """
        return build(self.database(), effects=self.effects)

    def value(self, place: Place) -> float:
        """The number that stands at a place; where there is no row, the one that it would begin with."""
        if place in self.values:
            return self.values[place]
        value = value_at(self._with_tables(), place)
        return self._start(place) if value is None else value

    def nominal(self, place: Place) -> float:
        """The number before any change."""
        return replace(self, values=FrozenMap()).value(place)

    def changed(self, place: Place, value: float) -> Bench:
        """With another number; an effect whose number is changed acts from then on."""
        values = dict(self.values)
        values[place] = value
        effects = self.effects
        if place.table in catalogue():
            if value_at(self.original, place) is None:
                for column in effect_named(place.table).columns:
                    other = replace(place, column=column.name)
                    if column.default is None and other not in values:
                        values[other] = self._start(other)
            effects = tuple(sorted({*effects, place.table}))
        if value == self.nominal(place) and value_at(self.original, place) is not None:
            del values[place]
        return replace(self, values=FrozenMap(sorted(values.items())), effects=effects)

    def switched(self, effect: str, on: bool) -> Bench:
        """With an effect that acts or does not."""
        kept = {name for name in self.effects if name != effect}
        return replace(self, effects=tuple(sorted(kept | {effect} if on else kept)))

    def to_save(self) -> Database:
        """The database with all changes, and a level of the effects that act."""
        database = self.database()
        return replace(database, levels=FrozenMap(sorted({**database.levels, LEVEL: self.effects}.items())))

    def _with_tables(self) -> Database:
        """The original with harmless tables of those effects that act without having one."""
        # those whose numbers were changed have the rows of these numbers
        known = {*self.original.effects, *(place.table for place in self.values)}
        new = {name: self._harmless(name) for name in self.effects if name not in known}
        if not new:
            return self.original
        return replace(self.original, effects=FrozenMap(sorted({**self.original.effects, **new}.items())))

    def _harmless(self, name: str) -> tuple[EffectRow, ...]:
        effect = effect_named(name)
        places = rows(name, effect.columns[0].name, self.original)
        return tuple(
            EffectRow(
                place.at,
                FrozenMap({column.name: self._start(replace(place, column=column.name)) for column in effect.columns}),
            )
            for place in places
            # an arm without length has no direction to bend across
            if name != "link_flexibility" or self._length(place.at) > SHORTEST_BEND
        )

    def _length(self, arm: int) -> float:
        return math.hypot(*self.original.kinematics[arm - 1].pose().xyz)

    def _start(self, place: Place) -> float:
        """What a number of an effect without a row begins with."""
        column = place.definition()
        if column.default is not None:
            return column.default
        if (place.table, place.column) == ("torque_limit", "torque"):
            effort = self.original.joints[place.at - 1].effort
            return effort if math.isfinite(effort) else _ENOUGH_TORQUE
        if column.minimum < 0.0 or not column.exclusive:
            return 0.0
        return _STARTS.get(column.unit.partition("|")[0], 1.0)


def tables_of(database: Database) -> dict[str, tuple[str, ...]]:
    """Tables and keys that have numbers to change, each with its columns."""
    # the numbers of tables in the modified convention are not those of the files
    fixed = ("kinematics", "corrections", "inertia") if database.kinematics_convention == "modified" else ()
    return {table: tuple(column.name for column in columns(table)) for table in tables() if table not in fixed}
