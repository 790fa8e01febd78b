"""Reading a database: all of it, or all that is wrong with it."""

from __future__ import annotations

from pathlib import Path

from ..effects import EffectRow
from ..errors import DatabaseError, Problem
from ..representation import JointKind
from .bodies import other_sign
from .convention import craig_in_standard, moved_inertias, moved_visuals, standard_base, standard_rows
from .database import Database, with_effects
from .frozen import FrozenMap
from .parts import TILT_OF_TAKEN_BASE, Parts, check_rivals, read_effect, read_parts, takes_up_base
from .problems import Problems
from .settings import Settings, read_settings
from .sources import find, gather, table_keys
from .suspicions import suspect
from .table import parse_table, read_text


def load(source: str | Path) -> Database:
    """Read a database.

    Args:
        source: A folder, a YAML file, or the name of a built-in robot.

    Raises:
        DatabaseError: With every problem of severity "error" that it has.
    """
    problems = Problems()
    database = _read(find(source), problems)
    if database is None:
        raise DatabaseError(problems.errors)
    return database


def check(source: str | Path) -> tuple[Problem, ...]:
    """All that is wrong (severity "error") or suspicious ("warning") in a database, errors first; () where nothing is.

    Args:
        source: A folder, a YAML file, or the name of a built-in robot.
    """
    problems = Problems()
    try:
        path = find(source)
    except DatabaseError as error:
        return error.problems
    database = _read(path, problems)
    if database is not None:
        suspect(database, problems)
    return tuple(sorted(problems.found, key=lambda problem: problem.severity != "error"))


def load_effects(folder: Path, database: Database, level: str = "full") -> FrozenMap[str, tuple[EffectRow, ...]]:
    """Effects' tables from a folder of `<effect>.dat`, for `with_effects`.

    Args:
        folder: Where the tables stand.
        database: The robot they are for.
        level: At which they are to stand beside the database's own.

    Raises:
        DatabaseError: With everything that is wrong with them, or with them beside the database's own.
        UsageError: No such level.
    """
    problems = Problems()
    tables = sorted(folder.glob("*.dat")) if folder.is_dir() else []
    if not tables:
        inner = folder / "effects"
        hint = f"; did you mean {inner}?" if inner.is_dir() else "."
        problems.error(f"this is no folder with tables of effects, <effect>.dat{hint}", str(folder))
    effects: dict[str, tuple[EffectRow, ...]] = {}
    kinds: list[JointKind] = [joint.kind for joint in database.joints]
    for path in tables:
        text = read_text(path, path.name, problems)
        raw = None if text is None else parse_table(text, path.name, problems)
        if raw is not None:
            effects[path.stem] = read_effect(path.stem, raw, database.n, kinds, problems)
            if path.stem == "base_tilt" and database.base_taken_up:
                problems.error(TILT_OF_TAKEN_BASE, path.name, raw.line, "robot")
    found = FrozenMap(sorted(effects.items()))
    there = with_effects(database, found, level)
    used = {name: there.effects[name] for name in there.level_effects(level)}
    check_rivals(used, kinds, {path.stem: path.name for path in tables}, problems)
    if problems.errors:
        raise DatabaseError(problems.errors)
    return found


def _read(path: Path, problems: Problems) -> Database | None:
    """The database at a path; None, with problems noted, where it has an error."""
    sources = gather(path, problems)
    settings = Settings(sources.settings_file)
    if sources.settings is not None:
        settings = read_settings(sources.settings, table_keys(sources.settings), sources.settings_file, problems)
    parts = read_parts(sources, settings, problems)
    for extra in sources.extra:
        problems.warning("this file is not part of a database and is not read.", extra)
    return None if problems.errors else _assembled(parts, settings, sources.folder)


def _assembled(parts: Parts, settings: Settings, folder: Path) -> Database:
    """The database in our own conventions."""
    kinematics, inertias, visuals, base = parts.kinematics, parts.inertias, parts.visuals, settings.base
    if settings.products_of_inertia == "integral":
        inertias = tuple(other_sign(inertia) for inertia in inertias)
    if settings.kinematics_convention == "modified":
        base = standard_base(base, kinematics[0])
        kinematics = standard_rows(kinematics)
        frames = craig_in_standard(kinematics)
        inertias = moved_inertias(inertias, frames)
        visuals = moved_visuals(visuals, frames) if visuals else ()
    levels = ((level.name, tuple(sorted({name for name, _ in level.effects}))) for level in settings.levels)
    return Database(
        name=settings.name,
        kinematics=kinematics,
        inertias=inertias,
        joints=parts.joints,
        corrections=parts.corrections,
        gravity=settings.gravity,
        base=base,
        tool=settings.tool,
        effects=FrozenMap(parts.effects),
        motions=FrozenMap(parts.motions),
        visuals=visuals,
        levels=FrozenMap(levels),
        dummy_inertia=settings.dummy_inertia,
        friction=settings.friction,
        tolerance=settings.tolerance,
        inertia_check=settings.inertia_check,
        source=settings.source,
        remarks=settings.remarks,
        products_of_inertia=settings.products_of_inertia,
        kinematics_convention=settings.kinematics_convention,
        base_taken_up=settings.kinematics_convention == "modified" and takes_up_base(parts.kinematics),
        folder=folder,
    )
