"""mbexport export (or mbexport --to ...): the main job."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import UsageError
from .common import (
    build_robot,
    control_option,
    force_option,
    json_option,
    level_options,
    load_database,
    print_json,
)

if TYPE_CHECKING:
    from ..representation import Robot
    from ..simulation.backend import Emission


@click.command("export", epilog="\b\nExample:\n  mbexport --to mjcf imece2013 --level compliant -o out --motion greca")
@click.argument("robot", default="imece2013")
@click.option("--to", "formats", multiple=True, required=True, metavar="NAME", help="Backend; repeatable, or all.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder (default: NAME-export).")
@level_options
@click.option("--motion", metavar="NAME", help="What an emitted script runs by itself (default: hold home).")
@control_option
@click.option("--strict", is_flag=True, help="What a format approximates or cannot say is an error.")
@force_option
@json_option
def command(
    robot: str,
    formats: tuple[str, ...],
    output: Path | None,
    level: str | None,
    with_: str | None,
    with_effects: Path | None,
    motion: str | None,
    control: Path | None,
    strict: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Emit a robot as models for simulators, each with a report of what its format could say."""
    from ..export import export
    from ..simulation.backends import backend_names

    known = backend_names()
    unknown = [name for name in formats if name != "all" and name not in known]
    if unknown:
        raise UsageError(f"--to {unknown[0]}: no such backend; installed: {', '.join(known)}, or all.")
    wanted = known if "all" in formats else formats
    database = load_database(robot, with_effects, level)
    built = build_robot(database, level, with_)
    law = rules = None
    if motion is not None:
        from ..motion import motion_named

        law = motion_named(built, motion, database=database)
    if control is not None:
        from ..control import read_control

        rules = read_control(control, built.n)
    folder = output or Path(f"{built.name}-export")
    emissions = export(
        built, wanted, folder, motion=law, control=rules, meshes=database.folder, strict=strict, force=force
    )
    if as_json:
        print_json(_facts(built, folder, emissions))
    else:
        _tell(built, folder, emissions)


def _facts(robot: Robot, folder: Path, emissions: dict[str, Emission]) -> dict[str, Any]:
    several = len(emissions) > 1
    return {
        "robot": robot.name,
        "level": robot.level,
        "effects": list(robot.effects),
        "source_hash": robot.source_hash,
        "exports": {
            name: {
                "folder": str(folder / name if several else folder),
                "main": emission.main,
                "files": [*emission.files, *emission.packed],
                "concepts": Counter(concept.status for concept in emission.concepts),
            }
            for name, emission in emissions.items()
        },
    }


def _tell(robot: Robot, folder: Path, emissions: dict[str, Emission]) -> None:
    """Where everything is, and what a format could not say."""
    for note in robot.notes:
        click.echo(f"note: {note}")
    for name, emission in emissions.items():
        where = folder / name if len(emissions) > 1 else folder
        click.echo(f"{name}: {where / emission.main}")
        rows = [concept for concept in emission.concepts if concept.status != "exact"]
        exact = len(emission.concepts) - len(rows)
        click.echo(f"  {exact} data exact, {len(rows)} not" + (":" if rows else ""))
        grouped: dict[tuple[str, str, str], list[str]] = {}
        for row in rows:
            grouped.setdefault((row.status, row.datum, row.how), []).append(row.at)
        for (status, datum, how), places in grouped.items():
            shown = places[0] if len(places) == 1 else f"{len(places)} places"
            click.echo(f"  {status:<12} {datum} ({shown}): {how}")
