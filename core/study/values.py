"""The numbers of a database by name: `joint_compliance.stiffness@joint_2`, `inertia.mass@arm_3`, `gravity.z@robot`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from ..database import FrozenMap, Placement
from ..database.bodies import fault_of
from ..database.problems import nearest
from ..database.rows import bounds_fault
from ..database.schema import CORRECTIONS, INERTIA, JOINTS, KINEMATICS, effect_table, free_in_correction
from ..effects import Column, EffectRow, catalogue, effect_named
from ..errors import PluginError, RefusedError, UsageError
from ..representation import FrictionModel

if TYPE_CHECKING:
    from ..database import Database

Key = Literal["joint", "arm", "robot"]

_XYZ, _RPY = ("x", "y", "z"), ("roll", "pitch", "yaw")
# limits bound the planning of motions and act in no run, so that of joints.dat only home is here
_FIXED_TABLES = {"kinematics": KINEMATICS, "corrections": CORRECTIONS, "inertia": INERTIA, "joints": JOINTS}
_SETTINGS: dict[str, tuple[Column, ...]] = {
    "gravity": tuple(Column(name, "m/s^2") for name in _XYZ),
    **{
        frame: (*(Column(name, "m") for name in _XYZ), *(Column(name, "rad") for name in _RPY))
        for frame in ("base", "tool")
    },
    "dummy_inertia": (Column("dummy_inertia", minimum=0.0, exclusive=True),),
    "friction": (Column("velocity", "rad/s", minimum=0.0, exclusive=True),),
}


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Where one number of a database stands.

    Attributes:
        table: Name of an effect, "kinematics", "corrections", "inertia", "joints", or a key of robot.yaml.
        column: Its column, or the part of the key: gravity x, tool yaw.
        key: What tells the table's rows apart.
        at: Number of the joint or arm; 0 for the robot, and for the row of the corrections that places joint 1.
    """

    table: str
    column: str
    key: Key
    at: int

    @property
    def name(self) -> str:
        """As a user writes it."""
        table = self.table if self.column == self.table else f"{self.table}.{self.column}"
        return f"{table}@{'robot' if self.key == 'robot' else f'{self.key}_{self.at}'}"

    def definition(self) -> Column:
        """The column's unit and bounds."""
        return next(column for column in columns(self.table) if column.name == self.column)

    def unit(self, database: Database) -> str:
        """SI unit of the number at this joint."""
        revolute, _, prismatic = self.definition().unit.partition("|")
        slides = self.key == "joint" and database.joints[self.at - 1].kind == "prismatic"
        return prismatic if slides and prismatic else revolute


def find_places(name: str, at: str, database: Database) -> tuple[Place, ...]:
    """The places that a name and "joint_2", "arm_1", "robot" or "all" mean.

    Args:
        name: Table and column with a dot between them; a key of robot.yaml that is one number by itself.
        at: Which row; "all": every row that an effect's table has, or every joint or arm.
        database: The robot.

    Raises:
        UsageError: There is none; the message has the nearest names.
    """
    table, dot, column = name.partition(".")
    column = column if dot else table
    known_columns = [entry.name for entry in columns(table)]
    if not known_columns:
        raise UsageError(f"{name!r}: a database has no table {table!r}; {nearest(table, tables())}")
    if column not in known_columns:
        raise UsageError(f"{name!r}: {table} has no column {column!r}; {nearest(column, known_columns)}")
    if table in _FIXED_TABLES and table != "joints" and database.kinematics_convention == "modified":
        raise UsageError(
            f"{name!r}: the tables of {database.name} are in the modified convention and are converted on reading; "
            "write the database in the standard one to vary them."
        )
    key = _key(table)
    rows = _rows_of(table, database)
    if at == "all":
        there = [row.at for row in database.effects.get(table, ())] or rows
        return tuple(Place(table, column, key, number) for number in there)
    known = ["robot"] if key == "robot" else [f"{key}_{number}" for number in rows]
    if at not in known:
        raise UsageError(f"{name!r} at {at!r}: {database.name} has {table} at {', '.join(known)} (or all).")
    return (Place(table, column, key, rows[known.index(at)]),)


def tables() -> tuple[str, ...]:
    """Every table, and every key of robot.yaml, that has numbers which a run depends on."""
    return (*_FIXED_TABLES, *_SETTINGS, *catalogue())


@cache
def columns(table: str) -> tuple[Column, ...]:
    """Columns of numbers that a run depends on; () where there is no such table."""
    if table in _SETTINGS:
        return _SETTINGS[table]
    if table == "joints":
        return tuple(column for column in JOINTS.columns if isinstance(column, Column) and column.name == "home")
    try:
        fixed = _FIXED_TABLES.get(table) or effect_table(effect_named(table))
    except PluginError:
        return ()
    return tuple(column for column in fixed.columns if isinstance(column, Column))


def rows(table: str, column: str, database: Database) -> tuple[Place, ...]:
    """Every place that a column may have in a robot, whether a row is there or not."""
    return tuple(Place(table, column, _key(table), at) for at in _rows_of(table, database))


def value_at(database: Database, place: Place) -> float | None:
    """The number that stands there, SI; None where an effect has no such row."""
    table, column = place.table, place.column
    if table == "kinematics":
        return getattr(database.kinematics[place.at - 1], column)
    if table == "corrections":
        return getattr(database.corrections[place.at], column)
    if table == "inertia":
        inertia = database.inertias[place.at - 1]
        if column in _XYZ:
            return inertia.com[_XYZ.index(column)]
        return getattr(inertia, column.removeprefix("I"))
    if table == "joints":
        return database.joints[place.at - 1].home
    if table == "gravity":
        return database.gravity[_XYZ.index(column)]
    if table in ("base", "tool"):
        frame: Placement = getattr(database, table)
        return (*frame.xyz, *frame.rpy)[(*_XYZ, *_RPY).index(column)]
    if table == "dummy_inertia":
        return database.dummy_inertia
    if table == "friction":
        return database.friction.velocity
    row = next((row for row in database.effects.get(table, ()) if row.at == place.at), None)
    return None if row is None else row.values[column]


def with_values(database: Database, places: Sequence[Place], values: Sequence[float]) -> Database:
    """The database with other numbers at some places; where an effect had no row, it has one with its defaults.

    Args:
        database: The robot.
        places: Where.
        values: SI, one a place.

    Raises:
        RefusedError: No robot can have these numbers; says which and why.
    """
    by_table: dict[str, dict[int, dict[str, float]]] = {}
    for place, value in zip(places, values, strict=True):
        if not math.isfinite(value):
            raise RefusedError(f"{place.name} = {value!r}: it must be finite.")
        fault = bounds_fault(value, place.definition())
        if fault is not None:
            raise RefusedError(f"{place.name} = {value!r}: {fault}")
        by_table.setdefault(place.table, {}).setdefault(place.at, {})[place.column] = value
    for table, rows in by_table.items():
        database = _with_table(database, table, rows)
    return database


def _with_table(database: Database, table: str, rows: Mapping[int, Mapping[str, float]]) -> Database:
    if table in ("kinematics", "corrections"):
        links = list(getattr(database, table))
        for at, new in rows.items():
            number = at - 1 if table == "kinematics" else at
            links[number] = replace(links[number], **new)
        change: dict[str, Any] = {table: tuple(links)}
        return replace(database, **change)
    if table == "inertia":
        return _with_inertias(database, rows)
    if table == "joints":
        return _with_homes(database, rows)
    if table in _SETTINGS:
        return _with_setting(database, table, rows[0])
    return _with_effect(database, table, rows)


def _with_inertias(database: Database, rows: Mapping[int, Mapping[str, float]]) -> Database:
    inertias = list(database.inertias)
    for at, new in rows.items():
        body = inertias[at - 1]
        com = tuple(new.get(name, old) for name, old in zip(_XYZ, body.com, strict=True))
        others = {name.removeprefix("I"): value for name, value in new.items() if name not in _XYZ}
        changed = replace(body, com=(com[0], com[1], com[2]), **others)
        if database.inertia_check == "error":
            fault = fault_of(changed)
            if changed.mass <= 0.0:
                raise RefusedError(f"inertia.mass@arm_{at} = {changed.mass!r}: a mass is above zero.")
            if fault is not None:
                raise RefusedError(f"inertia of arm_{at}: {fault}.")
        inertias[at - 1] = changed
    return replace(database, inertias=tuple(inertias))


def _with_homes(database: Database, rows: Mapping[int, Mapping[str, float]]) -> Database:
    joints = list(database.joints)
    for at, new in rows.items():
        joint = joints[at - 1]
        if not joint.lower <= new["home"] <= joint.upper:
            raise RefusedError(
                f"joints.home@joint_{at} = {new['home']!r} is outside of the limits, {joint.lower!r} to "
                f"{joint.upper!r}."
            )
        joints[at - 1] = replace(joint, home=new["home"])
    return replace(database, joints=tuple(joints))


def _with_setting(database: Database, table: str, new: Mapping[str, float]) -> Database:
    if table == "dummy_inertia":
        return replace(database, dummy_inertia=new["dummy_inertia"])
    if table == "friction":
        return replace(database, friction=FrictionModel(database.friction.model, new["velocity"]))
    if table == "gravity":
        x, y, z = (new.get(name, old) for name, old in zip(_XYZ, database.gravity, strict=True))
        return replace(database, gravity=(x, y, z))
    frame: Placement = getattr(database, table)
    x, y, z, roll, pitch, yaw = (
        new.get(name, old) for name, old in zip((*_XYZ, *_RPY), (*frame.xyz, *frame.rpy), strict=True)
    )
    change: dict[str, Any] = {table: Placement((x, y, z), (roll, pitch, yaw))}
    return replace(database, **change)


def _with_effect(database: Database, name: str, rows: Mapping[int, Mapping[str, float]]) -> Database:
    effect = effect_named(name)
    all_rows = {row.at: row for row in database.effects.get(name, ())}
    for at, new in rows.items():
        before: Mapping[str, float] = all_rows[at].values if at in all_rows else {}
        values: dict[str, float] = {}
        for column in effect.columns:
            value = new.get(column.name, before.get(column.name, column.default))
            if value is None:
                place = Place(name, column.name, effect.key, at).name
                raise RefusedError(f"{database.name} has no row of {name} there, so {place} must be given too.")
            values[column.name] = value
        fault = effect.check(values)
        if fault is not None:
            raise RefusedError(f"{name} at {effect.key} {at}: {fault}")
        all_rows[at] = EffectRow(at, FrozenMap(values))
    effects = {**database.effects, name: tuple(all_rows[at] for at in sorted(all_rows))}
    return replace(database, effects=FrozenMap(sorted(effects.items())))


def free_correction(place: Place, database: Database) -> bool:
    """Whether a correction may have this number and still not change the joint's motion (database.md)."""
    if place.table != "corrections" or place.at == database.n:
        return True
    return place.column in free_in_correction(database.joints[place.at].kind)


def _key(table: str) -> Key:
    if table in _SETTINGS:
        return "robot"
    if table in _FIXED_TABLES:
        return "joint" if table == "joints" else "arm"
    return effect_named(table).key


def _rows_of(table: str, database: Database) -> list[int]:
    """Numbers of the rows that the table may have."""
    if _key(table) == "robot":
        return [0]
    return list(range(0 if table == "corrections" else 1, database.n + 1))
