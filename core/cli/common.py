"""What several verbs share: options, the robot they name, output for people and for machines."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
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
with_effects_option = click.option(
    "--with-effects",
    type=click.Path(path_type=Path),
    help="Folder of effect tables: they count at any level, and their rows replace the database's.",
)
control_option = click.option(
    "--control", type=click.Path(path_type=Path), help="A log.yaml or its control part (default: mode motion)."
)
duration_option = click.option("--duration", type=float, metavar="S", help="How long [s] (default: the motion's).")
rate_option = click.option(
    "--rate", type=float, default=1000.0, show_default=True, metavar="HZ", help="Rate of the record."
)


def level_options(command: Command) -> Command:
    """--level, --with and --with-effects."""
    for option in (
        with_effects_option,
        click.option(
            "--with",
            "with_",
            metavar="EFFECT,...",
            help="These effects alone, of the database and of --with-effects, instead of a level.",
        ),
        click.option("--level", metavar="NAME", help="Level of complexity: full (default), rigid, or one it names."),
    ):
        command = option(command)
    return command


def workers_options(command: Command) -> Command:
    """--workers and --dask: where many independent tasks run."""
    for option in (
        click.option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster instead, tcp://host:port."),
        click.option("--workers", type=int, metavar="N", help="Processes (default: one a core)."),
    ):
        command = option(command)
    return command


def backends_option(what: str) -> Callable[[Command], Command]:
    """--backends: what they do, in words."""
    return click.option(
        "--backends",
        default="all",
        show_default=True,
        metavar="NAME,...",
        help=f"{what}; all: every one that can run.",
    )


def names_of(text: str) -> list[str]:
    """Names that stand in an option, separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def backends_of(text: str) -> list[str] | None:
    """The backends of --backends; None: every one that can run."""
    return None if text == "all" else names_of(text)


def effects_of(level: str | None, with_: str | None) -> list[str] | None:
    """The effects of --with; None where a level counts.

    Raises:
        UsageError: --level and --with are both given.
    """
    if level is not None and with_ is not None:
        raise UsageError("--level and --with exclude each other; give one of them.")
    return None if with_ is None else names_of(with_)


def load_database(source: str, with_effects: Path | None, level: str | None = None) -> Database:
    """A database, with the rows of --with-effects in it and in what --level uses."""
    from ..database import load, load_effects
    from ..database import with_effects as replaced

    database, level = load(source), level or "full"
    if with_effects is None:
        return database
    return replaced(database, load_effects(with_effects, database, level), level)


def build_robot(database: Database, level: str | None, with_: str | None) -> Robot:
    """The robot at the level that the options say."""
    from ..build import build

    return build(database, level or "full", effects_of(level, with_))


def print_json(data: Any) -> None:
    """Data as JSON on standard output."""
    click.echo(json.dumps(data, indent=1))


def on_terminal() -> bool:
    """Whether a person watches: progress is shown only then."""
    return sys.stderr.isatty()


@contextmanager
def progress(work: str) -> Generator[Callable[[str, int, int], None]]:
    """A bar on a terminal, nothing elsewhere.

    Yields:
        To be called with what is being done, how much is done, and how much there is.
    """
    if not on_terminal():
        yield lambda what, done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(work)

        def tell(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total)

        yield tell


@contextmanager
def goes_on(output: Path) -> Generator[None]:
    """Say of work that is stopped by hand how it goes on."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"\nmbexport: stopped; what is finished is kept, the same command goes on in {output}.", err=True)
        raise
