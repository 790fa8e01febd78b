"""The tables of a database as data: names, keys, columns, units, defaults, bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from ..effects import Column, Effect
from ..representation import JointKind
from ..signals import joint_unit

Key = Literal["arm", "joint", "robot", "t"]


@dataclass(frozen=True, slots=True)
class Choice:
    """A column of words.

    Attributes:
        name: As it stands in the header.
        words: What may stand there.
        default: Where the column is missing.
    """

    name: str
    words: tuple[str, ...]
    default: str


@dataclass(frozen=True, slots=True)
class Table:
    """What a table holds.

    Attributes:
        name: File without `.dat`, and key in the YAML form.
        key: Name of the column that tells rows apart.
        columns: All others.
        optional: The database may go without it.
    """

    name: str
    key: Key
    columns: tuple[Column | Choice, ...]
    optional: bool = True


_VEITSCHEGGER_WU = (
    Column("alpha", "rad"),
    Column("a", "m"),
    Column("theta", "rad"),
    Column("d", "m"),
    Column("beta", "rad", default=0.0),
)

KINEMATICS = Table("kinematics", "arm", _VEITSCHEGGER_WU, optional=False)

CORRECTIONS = Table(
    "corrections", "arm", tuple(Column(column.name, column.unit, default=0.0) for column in _VEITSCHEGGER_WU)
)

INERTIA = Table(
    "inertia",
    "arm",
    (
        # the sign of the mass depends on robot.yaml's inertia_check, so it is looked at with the inertia
        Column("mass", "kg"),
        *(Column(name, "m") for name in ("x", "y", "z")),
        *(Column(name, "kg*m^2") for name in ("Ixx", "Iyy", "Izz")),
        *(Column(name, "kg*m^2", default=0.0) for name in ("Ixy", "Ixz", "Iyz")),
    ),
    optional=False,
)

JOINTS = Table(
    "joints",
    "joint",
    (
        Choice("type", ("revolute", "continuous", "prismatic"), "revolute"),
        Column("lower", "rad|m", default=-math.inf, infinite=True),
        Column("upper", "rad|m", default=math.inf, infinite=True),
        Column("velocity", "rad/s|m/s", default=math.inf, minimum=0.0, exclusive=True, infinite=True),
        Column("effort", "N*m|N", default=math.inf, minimum=0.0, exclusive=True, infinite=True),
        # the default is the limits' middle where 0 is outside of them
        Column("home", "rad|m", default=0.0),
    ),
)

TABLES = (KINEMATICS, CORRECTIONS, INERTIA, JOINTS)


def effect_table(effect: Effect) -> Table:
    """The table `effects/<name>.dat`."""
    return Table(f"effects/{effect.name}", effect.key, effect.columns)


def motion_table(name: str, kinds: tuple[JointKind, ...]) -> Table:
    """The table `motions/<name>.dat` of a robot whose joints are of these kinds."""
    columns = tuple(
        Column(f"{quantity}{joint}", joint_unit(quantity, kind), default=default)
        for quantity, default in (("q", None), ("dq", 0.0), ("ddq", 0.0))
        for joint, kind in enumerate(kinds, 1)
    )
    return Table(f"motions/{name}", "t", columns)


def free_in_correction(kind: JointKind) -> tuple[str, ...]:
    """What a correction before a joint may have and not change its motion: along its axis, and sideways of a slide."""
    return ("theta", "d") if kind == "revolute" else ("a", "theta", "d")
