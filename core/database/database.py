"""The universal database of one robot, as it stands in memory: SI, standard convention, nothing left to default."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from ..effects import EffectRow
from ..errors import UsageError
from ..representation import FrictionModel, Inertia, Joint, Pose, Shape, Vector3, VeitscheggerWu
from .frozen import FrozenMap

STANDARD_GRAVITY: Vector3 = (0.0, 0.0, -9.81)


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a frame stands in another one, in the numbers of the file.

    Attributes:
        xyz: Origin [m].
        rpy: Fixed-axis roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll).
    """

    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)

    def pose(self) -> Pose:
        """The same as a pose."""
        return Pose.from_rpy(self.xyz, self.rpy)


@dataclass(frozen=True, slots=True)
class MotionTable:
    """A motion law at its knots.

    Attributes:
        t: Times [s], growing, shape (k,).
        q: Joint positions [rad or m], shape (k, n).
        dq: Joint speeds [rad/s or m/s], shape (k, n), or None.
        ddq: Joint accelerations [rad/s^2 or m/s^2], shape (k, n), or None.
    """

    t: tuple[float, ...]
    q: tuple[tuple[float, ...], ...]
    dq: tuple[tuple[float, ...], ...] | None = None
    ddq: tuple[tuple[float, ...], ...] | None = None


@dataclass(frozen=True, slots=True)
class Tolerance:
    """One sigma of what the numbers may be off.

    Attributes:
        mass: Of masses, relative.
        com: Of centers of mass [m].
        inertia: Of moments of inertia, relative.
        length: Of lengths [m].
        angle: Of angles [rad].
    """

    mass: float = 0.0
    com: float = 0.0
    inertia: float = 0.0
    length: float = 0.0
    angle: float = 0.0


@dataclass(frozen=True, slots=True)
class Visual:
    """Something to look at, fixed to an arm; it has no mass.

    Attributes:
        kind: "box" (size: x, y, z lengths), "cylinder" (radius, length; axis z), "sphere" (radius),
            "mesh" (size: scale along x, y, z).
        size: Lengths [m], or the scale of a mesh.
        placement: In the arm's Veitschegger-Wu frame.
        mesh: File of the mesh relative to the database's folder, else "".
        rgba: Colour, each 0 to 1.
    """

    kind: Literal["box", "cylinder", "sphere", "mesh"]
    size: tuple[float, ...]
    placement: Placement = Placement()
    mesh: str = ""
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)

    def shape(self) -> Shape:
        """The same as the representation has it; the mesh stays relative to the database's folder."""
        return Shape(self.kind, self.size, self.placement.pose(), self.mesh, self.rgba)


@dataclass(frozen=True, slots=True)
class Database:
    """One robot. Equal databases have equal content; both forms on disk load to the same object.

    Attributes:
        name: Safe as a file name and an identifier.
        kinematics: Veitschegger-Wu parameters, one an arm, joint variables at zero; n of them.
        inertias: Mass properties, one an arm, in the arm's own Veitschegger-Wu frame; products of inertia are the
            tensor's elements, whatever the file's convention was.
        joints: Kind and limits, one a joint.
        corrections: n + 1 geometry corrections: row 0 places joint 1 in the base, row i, after arm i, places joint
            i + 1 on it, row n the flange (drawn only).
        gravity: In the world [m/s^2].
        base: Base in the world.
        tool: Tool centre point in the last arm's Veitschegger-Wu frame.
        effects: Name of an effect to its rows, in the order of their places; names sorted.
        motions: Name to motion table; names sorted.
        visuals: Shapes, a tuple an arm; () where nothing was given for any arm.
        levels: Name to the effects that it uses, sorted; without `full`, which is always there, and without `rigid`,
            unless `with_effects` gave it some.
        dummy_inertia: Fraction of the diagonal mass-matrix entry that the motor side of an elastic joint without
            rotor inertia gets.
        friction: How sign() of friction is realised.
        tolerance: What the numbers may be off.
        inertia_check: "error", or "warn": data that no body can have stand as published.
        source: Where the numbers come from.
        remarks: What a user of the numbers should know.
        products_of_inertia, kinematics_convention: What the files said, for the record; the numbers here are always
            tensor and standard, so these take no part in comparisons.
        base_taken_up: The base holds the first row's alpha and a of the modified convention; not compared.
        folder: Folder that the meshes are relative to, None for a database made in memory; not compared.
    """

    name: str
    kinematics: tuple[VeitscheggerWu, ...]
    inertias: tuple[Inertia, ...]
    joints: tuple[Joint, ...]
    corrections: tuple[VeitscheggerWu, ...]
    gravity: Vector3 = STANDARD_GRAVITY
    base: Placement = Placement()
    tool: Placement = Placement()
    effects: FrozenMap[str, tuple[EffectRow, ...]] = FrozenMap()
    motions: FrozenMap[str, MotionTable] = FrozenMap()
    visuals: tuple[tuple[Visual, ...], ...] = ()
    levels: FrozenMap[str, tuple[str, ...]] = FrozenMap()
    dummy_inertia: float = 1.0
    friction: FrictionModel = FrictionModel()
    tolerance: Tolerance = Tolerance()
    inertia_check: Literal["error", "warn"] = "error"
    source: str = ""
    remarks: tuple[str, ...] = ()
    products_of_inertia: Literal["tensor", "integral"] = field(default="tensor", compare=False)
    kinematics_convention: Literal["standard", "modified"] = field(default="standard", compare=False)
    base_taken_up: bool = field(default=False, compare=False)
    folder: Path | None = field(default=None, compare=False, repr=False)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.kinematics)

    def shapes(self) -> tuple[tuple[Shape, ...], ...]:
        """What is drawn, a tuple an arm; a mesh's file stays relative to `folder`."""
        if not self.visuals:
            return ((),) * self.n
        return tuple(tuple(visual.shape() for visual in arm) for arm in self.visuals)

    def level_effects(self, level: str) -> tuple[str, ...]:
        """Names of the effects that a level uses, sorted. `full`: every table, `rigid`: none of the database's own.

        Raises:
            UsageError: No such level.
        """
        if level == "full":
            return tuple(sorted(self.effects))
        known = {"rigid": (), **self.levels}
        if level not in known:
            raise UsageError(f"{self.name} has no level {level!r}; it has: {', '.join(sorted({'full', *known}))}.")
        return known[level]

    def content_hash(self) -> str:
        """SHA-256 of the content in SI, hex: the same for the folder and the YAML form."""
        from .write import yaml_text

        return hashlib.sha256(yaml_text(self).encode()).hexdigest()


def joint_name(number: int) -> str:
    """Name of joint `number`, from 1."""
    return f"joint_{number}"


def home_within(lower: float, upper: float) -> float:
    """The home position where none is given: 0, or the limits' middle where 0 is outside."""
    if lower <= 0.0 <= upper:
        return 0.0
    if math.isinf(lower) or math.isinf(upper):
        return lower if math.isinf(upper) else upper
    return 0.5 * (lower + upper)


def with_effects(database: Database, rows: Mapping[str, tuple[EffectRow, ...]], level: str = "full") -> Database:
    """The database with rows of effects replaced, or added where there was none at that place.

    Args:
        database: The robot.
        rows: As `load_effects` gives them.
        level: It uses them from now on; of a table that it has not used before it has these rows and no others.

    Raises:
        UsageError: No such level.
    """
    used = database.level_effects(level)
    effects = dict(database.effects)
    for name, new in rows.items():
        merged = {row.at: row for row in effects.get(name, ()) if name in used} | {row.at: row for row in new}
        effects[name] = tuple(merged[at] for at in sorted(merged))
    levels = database.levels
    if level != "full":
        levels = FrozenMap(sorted({**levels, level: tuple(sorted({*used, *rows}))}.items()))
    return replace(database, effects=FrozenMap(sorted(effects.items())), levels=levels)
