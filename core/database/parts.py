"""The tables of one database, understood one after the other, with every fault noted at its place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..effects import EffectRow, catalogue, effect_named
from ..errors import PluginError
from ..representation import Inertia, Joint, JointKind, VeitscheggerWu, is_label
from .bodies import fault_of, other_sign
from .database import MotionTable, Visual, home_within, joint_name
from .frozen import FrozenMap
from .motions import read_motion_rows
from .problems import Problems, listed, nearest
from .rows import Row, read_rows
from .schema import CORRECTIONS, INERTIA, JOINTS, KINEMATICS, Table, effect_table, free_in_correction
from .settings import LARGEST_MESH, Notes, Settings, read_visuals
from .sources import SETTINGS_FILE, Sources
from .table import RawTable

# what a correction may be off the joint's axis [rad, m]
CORRECTION_SLACK = 1e-9

# the component of joint_compliance_6d that is in series with a joint's drive, where joint_compliance's stiffness is too
_IN_THE_DRIVE: dict[JointKind, str] = {"revolute": "krz", "prismatic": "kz"}

_FIVE = ("alpha", "a", "theta", "d", "beta")


@dataclass(slots=True)
class Parts:
    """What the tables say: SI, in the file's own conventions of frames and signs.

    Attributes:
        n: Number of arms.
        kinematics: From each joint to the next, base to tool, one an arm.
        corrections: n + 1: of the base's frame, then one an arm.
        inertias: One an arm, in the arm's own frame.
        joints: One an arm.
        effects: Effect to its rows.
        motions: Name to what is sampled.
        visuals: What is drawn, a tuple an arm; () where the database says nothing of it.
    """

    n: int = 0
    kinematics: tuple[VeitscheggerWu, ...] = ()
    corrections: tuple[VeitscheggerWu, ...] = ()
    inertias: tuple[Inertia, ...] = ()
    joints: tuple[Joint, ...] = ()
    effects: dict[str, tuple[EffectRow, ...]] = field(default_factory=dict[str, tuple[EffectRow, ...]])
    motions: dict[str, MotionTable] = field(default_factory=dict[str, MotionTable])
    visuals: tuple[tuple[Visual, ...], ...] = ()


TILT_OF_TAKEN_BASE = (
    "base_tilt turns the base before the first row's alpha and a of the modified convention, which the base takes up "
    "on reading, so it would turn about other axes; write all in the standard convention, or make them 0."
)


def takes_up_base(modified: tuple[VeitscheggerWu, ...]) -> bool:
    """Whether the first row of Craig's convention moves the base on reading."""
    return bool(modified) and (modified[0].alpha != 0.0 or modified[0].a != 0.0)


def read_parts(sources: Sources, settings: Settings, problems: Problems) -> Parts:
    """All tables of a database; what could not be read stands at its default, and is noted."""
    parts = Parts()
    _read_kinematics(sources, parts, settings, problems)
    _read_joints(sources, parts, problems)
    _read_corrections(sources, parts, settings, problems)
    _read_inertias(sources, parts, settings, problems)
    kinds: list[JointKind] = [joint.kind for joint in parts.joints]
    for name, raw in sorted(sources.effects.items()):
        parts.effects[name] = read_effect(name, raw, parts.n, kinds, problems)
        if settings.kinematics_convention == "modified" and _key_of(name) == "arm":
            problems.error(
                f"{name} is keyed by arm, which the modified convention does not allow; write all in the standard one.",
                raw.file,
                raw.line,
                "arm",
            )
        if name == "base_tilt" and settings.kinematics_convention == "modified" and takes_up_base(parts.kinematics):
            problems.error(TILT_OF_TAKEN_BASE, raw.file, raw.line, "robot")
    check_rivals(parts.effects, kinds, {name: raw.file for name, raw in sources.effects.items()}, problems)
    for name, raw in sorted(sources.motions.items()):
        if not is_label(name):
            problems.error(
                "a motion's name is made of at most 64 letters, digits, _ and -.", raw.file, raw.line, "motions", name
            )
        motion = read_motion_rows(name, raw, kinds, problems)
        if motion is not None:
            parts.motions[name] = motion
    if sources.visuals is not None:
        node, file = sources.visuals
        parts.visuals = read_visuals(node, parts.n, Notes(problems, file))
        _check_meshes(parts.visuals, sources.folder, file, problems)
    _check_levels(sources, settings, problems)
    return parts


def _note(problems: Problems, row: Row, column: str, message: str, *, warning: bool = False) -> None:
    place = row.place(column)
    note = problems.warning if warning else problems.error
    note(message, place.file, place.line, place.column, place.value)


def _table(sources: Sources, table: Table, problems: Problems) -> RawTable | None:
    """A fixed table's text; where it must be there and is not, that is noted."""
    raw = sources.tables.get(table.name)
    if raw is not None or table.optional or {table.name, sources.settings_file} & sources.unread:
        return raw
    near = [extra for extra in sources.extra if extra.lower().startswith(table.name[:5])]
    problems.error(
        f"the table {table.name} is missing{f' (is it {near[0]}?)' if near else ''}; it has the columns {table.key}, "
        f"{listed([column.name for column in table.columns])}.",
        f"{table.name}.dat" if sources.settings_file == SETTINGS_FILE else sources.settings_file,
    )
    return None


def _read_kinematics(sources: Sources, parts: Parts, settings: Settings, problems: Problems) -> None:
    raw = _table(sources, KINEMATICS, problems)
    if raw is None:
        # so that the other tables are still looked at
        parts.n = max((table.length for name, table in sources.tables.items() if name != "corrections"), default=0)
        return
    parts.n = raw.length
    if not parts.n:
        problems.error("the robot has no arm.", raw.file, raw.line)
        return
    rows = read_rows(raw, KINEMATICS, problems, n=None, complete=True)
    if settings.kinematics_convention == "modified":
        for row in rows:
            if row.values.get("beta", 0.0) != 0.0:
                _note(
                    problems, row, "beta", "the modified convention has no beta; write the tables in the standard one."
                )
    by_arm = {row.at: _veitschegger_wu(row) for row in rows}
    parts.kinematics = tuple(by_arm.get(arm, VeitscheggerWu()) for arm in range(1, parts.n + 1))


def _veitschegger_wu(row: Row) -> VeitscheggerWu:
    return VeitscheggerWu(*(row.values.get(name, 0.0) for name in _FIVE))


def _read_joints(sources: Sources, parts: Parts, problems: Problems) -> None:
    raw = _table(sources, JOINTS, problems)
    joints = [Joint(joint_name(number)) for number in range(1, parts.n + 1)]
    if raw is not None:
        # the kinds stand in the table itself, and its numbers need them for their units
        kinds: list[JointKind] = ["revolute"] * parts.n
        for row in read_rows(raw, JOINTS, Problems(), n=parts.n):
            kinds[row.at - 1] = "prismatic" if row.words["type"] == "prismatic" else "revolute"
        for row in read_rows(raw, JOINTS, problems, n=parts.n, kinds=kinds, complete=True):
            joints[row.at - 1] = _joint(row, kinds[row.at - 1], problems)
    parts.joints = tuple(joints)


def _joint(row: Row, kind: JointKind, problems: Problems) -> Joint:
    lower, upper = row.values["lower"], row.values["upper"]
    plain = Joint(joint_name(row.at), kind)
    if row.words["type"] == "continuous":
        for name in ("lower", "upper"):
            if math.isfinite(row.values[name]):
                _note(problems, row, name, "a continuous joint has no limits; leave them out, or write revolute.")
    if lower > upper:
        _note(problems, row, "lower", f"lower is above upper: {lower!r} > {upper!r} in SI.")
        return plain
    if lower == math.inf or upper == -math.inf:
        _note(problems, row, "lower" if lower == math.inf else "upper", "no position lies within these limits.")
        return plain
    home = row.values["home"] if row.gives("home") else home_within(lower, upper)
    if not lower <= home <= upper:
        _note(problems, row, "home", f"home is outside of the limits, {lower!r} to {upper!r} in SI.")
        return plain
    return Joint(joint_name(row.at), kind, lower, upper, row.values["velocity"], row.values["effort"], home)


def _read_corrections(sources: Sources, parts: Parts, settings: Settings, problems: Problems) -> None:
    raw = _table(sources, CORRECTIONS, problems)
    corrections = [VeitscheggerWu()] * (parts.n + 1)
    if raw is not None:
        for row in read_rows(raw, CORRECTIONS, problems, n=parts.n, first=0, complete=True):
            corrections[row.at] = _veitschegger_wu(row)
            if settings.kinematics_convention == "modified" and corrections[row.at] != VeitscheggerWu():
                _note(
                    problems,
                    row,
                    "arm",
                    "the modified convention has no corrections; write the tables in the standard one.",
                )
            elif row.at < parts.n:
                _check_correction(row, corrections[row.at], parts.joints[row.at], problems)
    parts.corrections = tuple(corrections)


def _check_correction(row: Row, correction: VeitscheggerWu, joint: Joint, problems: Problems) -> None:
    """A correction may turn and shift the joint's frame along its axis, and a prismatic one's anywhere, but no more."""
    free = free_in_correction(joint.kind)
    wrong = [name for name in _FIVE if name not in free and abs(getattr(correction, name)) > CORRECTION_SLACK]
    if not wrong:
        return
    angle, distance = _axis_change(correction)
    moved = f"turns its axis by {math.degrees(angle):.6g} deg"
    if joint.kind == "revolute":
        moved += f" and moves it by {distance:.6g} m"
    _note(
        problems,
        row,
        wrong[0],
        f"the correction would change the motion of the {joint.kind} {joint.name}: it {moved}; "
        f"only {listed(free)} may be non-zero.",
    )


def _axis_change(correction: VeitscheggerWu) -> tuple[float, float]:
    """Angle between the z axes before and after, and the distance between the two lines [rad, m]."""
    matrix = correction.matrix().tolist()
    (zx, zy, zz), (x, y) = (matrix[0][2], matrix[1][2], matrix[2][2]), (matrix[0][3], matrix[1][3])
    across = math.hypot(zx, zy)
    # the common normal of the lines is z x z' = (-zy, zx, 0)
    distance = abs(-zy * x + zx * y) / across if across > 1e-12 else math.hypot(x, y)
    return math.atan2(across, zz), distance


def _read_inertias(sources: Sources, parts: Parts, settings: Settings, problems: Problems) -> None:
    raw = _table(sources, INERTIA, problems)
    inertias = [Inertia()] * parts.n
    if raw is not None:
        open_signs: list[Row] = []
        for row in read_rows(raw, INERTIA, problems, n=parts.n, complete=True):
            v = row.values
            if any(column.name not in v for column in INERTIA.columns):
                continue
            tensor = tuple(v[name] for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"))
            inertia = Inertia(v["mass"], (v["x"], v["y"], v["z"]), *tensor)
            inertias[row.at - 1] = inertia
            if _check_body(row, inertia, settings, problems) and all(tensor[3:]):
                open_signs.append(row)
        if open_signs and "products_of_inertia" not in settings.given:
            _note(
                problems,
                open_signs[0],
                "Ixy",
                "the sign of the products of inertia is open: both conventions give possible bodies, and robot.yaml "
                "does not say products_of_inertia: tensor or integral (tensor is taken).",
                warning=True,
            )
    parts.inertias = tuple(inertias)


def _check_body(row: Row, inertia: Inertia, settings: Settings, problems: Problems) -> bool:
    """Whether both sign conventions give a possible body; faults are noted as inertia_check says."""
    tolerated = settings.inertia_check == "warn"
    asked = "" if tolerated else "; inertia_check: warn takes published data as they stand"
    if inertia.mass < 0.0:
        _note(problems, row, "mass", "a mass is above zero.")
    elif inertia.mass == 0.0:
        _note(problems, row, "mass", f"a mass is above zero{asked}.", warning=tolerated)
    other = other_sign(inertia)
    # the file's numbers are one convention's, and which one matters only where all three products are non-zero
    fault = fault_of(other if settings.products_of_inertia == "integral" else inertia)
    other_fault = fault_of(inertia if settings.products_of_inertia == "integral" else other)
    if fault is not None:
        name = "tensor" if settings.products_of_inertia == "integral" else "integral"
        cure = (
            f"the other sign convention, products_of_inertia: {name}, would cure it"
            if other_fault is None
            else f"the other sign convention (products_of_inertia: {name}) would not cure it"
        )
        column = min(("Ixx", "Iyy", "Izz"), key=lambda name: row.values[name])
        if "not positive" not in fault:
            column = max(("Ixx", "Iyy", "Izz"), key=lambda name: row.values[name])
        _note(problems, row, column, f"{fault}; {cure}{asked}.", warning=tolerated)
    return fault is None and other_fault is None


def _key_of(name: str) -> str:
    try:
        return effect_named(name).key
    except PluginError:
        return ""


def read_effect(
    name: str, raw: RawTable, n: int, kinds: Sequence[JointKind], problems: Problems
) -> tuple[EffectRow, ...]:
    """The rows of an effect's table.

    Args:
        name: Name of the effect.
        raw: The table's text.
        n: Number of arms.
        kinds: Kind of each joint.
        problems: Takes what is wrong.
    """
    try:
        effect = effect_named(name)
    except PluginError as error:
        installed = catalogue()
        message = str(error)
        if name not in installed:
            message = (
                f"no effect {name[:80]!r} is installed; {nearest(name, installed)} Installed: {listed(installed)}."
            )
        problems.error(message, raw.file, raw.line)
        return ()
    rows: list[EffectRow] = []
    for row in read_rows(raw, effect_table(effect), problems, n=n, kinds=kinds):
        if any(column.name not in row.values for column in effect.columns):
            continue
        values = FrozenMap((column.name, row.values[column.name]) for column in effect.columns)
        fault = effect.check(values)
        if fault is not None:
            problems.error(fault, raw.file, row.raw.line, effect.key)
        rows.append(EffectRow(row.at, values))
    if not raw.rows:
        problems.warning("the table has no rows, so the effect acts nowhere.", raw.file, raw.line)
    return tuple(rows)


def check_rivals(
    effects: Mapping[str, Sequence[EffectRow]], kinds: Sequence[JointKind], files: Mapping[str, str], problems: Problems
) -> None:
    """Notes joints to which two effects would give the one spring that a drive has."""
    one, other = "joint_compliance", "joint_compliance_6d"
    sprung = {row.at for row in effects.get(one, ())}
    for row in effects.get(other, ()):
        column = _IN_THE_DRIVE[kinds[row.at - 1]]
        value = row.values.get(column, math.inf)
        if row.at in sprung and math.isfinite(value):
            problems.error(
                f"{joint_name(row.at)} has {one} and a finite {column} of {other}, which are the same spring; keep one "
                f"({column} is rigid with inf).",
                files.get(other),
                None,
                column,
                repr(value),
            )


def _check_meshes(visuals: Sequence[Sequence[Visual]], folder: Path, file: str, problems: Problems) -> None:
    root = folder.resolve()
    for arm, shapes in enumerate(visuals, 1):
        for shape in shapes:
            if not shape.mesh:
                continue
            path = (root / shape.mesh).resolve()
            column = f"visuals.{arm}.mesh"
            if not path.is_relative_to(root):
                problems.error("the mesh's path leaves the database's folder.", file, None, column, shape.mesh)
            elif not path.is_file():
                problems.error("there is no such mesh in the database's folder.", file, None, column, shape.mesh)
            elif (size := path.stat().st_size) > LARGEST_MESH:
                message = f"the mesh has {size} bytes; it may have {LARGEST_MESH}."
                problems.error(message, file, None, column, shape.mesh)


def _check_levels(sources: Sources, settings: Settings, problems: Problems) -> None:
    tables = sorted({*sources.effects, *sources.unread})
    for level in settings.levels:
        for name, line in level.effects:
            if name not in tables:
                what = "has no table here" if name in catalogue() else "is not installed"
                problems.error(
                    f"the effect {name[:80]!r} {what}; {nearest(name, sources.effects)}",
                    settings.file,
                    line,
                    f"levels.{level.name}",
                    name,
                )
