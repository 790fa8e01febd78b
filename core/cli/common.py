"""What several verbs share: options, the robot they name, output for people and for machines."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..errors import UsageError

if TYPE_CHECKING:
    from ..database import Database
    from ..representation import Robot

Command = TypeVar("Command", bound=Callable[..., Any])

force_option = click.option("--force", is_flag=True, help="Write over files that are there.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON for machines.")


def level_options(command: Command) -> Command:
    """--level, --with and --with-effects."""
    for option in (
        click.option(
            "--with-effects",
            type=click.Path(path_type=Path),
            help="Folder of effect tables whose rows replace the database's.",
        ),
        click.option("--with", "with_", metavar="EFFECT,...", help="Effects of the database instead of a level."),
        click.option("--level", metavar="NAME", help="Level of complexity: full (default), rigid, or one it names."),
    ):
        command = option(command)
    return command


def load_database(source: str, with_effects: Path | None) -> Database:
    """A database, with the rows of --with-effects in it."""
    from ..database import load, load_effects
    from ..database import with_effects as replaced

    database = load(source)
    return database if with_effects is None else replaced(database, load_effects(with_effects, database))


def build_robot(database: Database, level: str | None, with_: str | None) -> Robot:
    """The robot at the level that the options say."""
    from ..build import build

    if level is not None and with_ is not None:
        raise UsageError("--level and --with exclude each other; give one of them.")
    if with_ is not None:
        return build(database, effects=[name.strip() for name in with_.split(",") if name.strip()])
    return build(database, level or "full")


def print_json(data: Any) -> None:
    """Data as JSON on standard output."""
    click.echo(json.dumps(data, indent=1))


def on_terminal() -> bool:
    """Whether a person watches: progress is shown only then."""
    return sys.stderr.isatty()
