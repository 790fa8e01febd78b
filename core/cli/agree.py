"""mbexport agree: prove that all engines run the same robot, or say which one does not and why."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import click

from ..errors import UsageError
from .common import force_option, json_option, level_options, on_terminal, print_json

JSON_FILE = "agreement.json"
PAGE = "agreement.html"


@click.command("agree", epilog="\b\nExample:\n  mbexport agree imece2013 --level compliant -o report")
@click.argument("robot", default="imece2013")
@click.option(
    "--backends",
    default="all",
    show_default=True,
    metavar="NAME,...",
    help="Backends, separated by commas; all: every one that can run.",
)
@level_options
@click.option(
    "--only",
    metavar="NAME,...",
    help="Only these quantities and runs (see docs/agreement.md); the page shows what there is.",
)
@click.option("--duration", type=float, default=2.0, show_default=True, metavar="S", help="Of every run; 2 s or less.")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the report.")
@force_option
@json_option
def command(
    robot: str,
    backends: str,
    level: str | None,
    with_: str | None,
    with_effects: Path | None,
    only: str | None,
    duration: float,
    output: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Hold all engines, and the text of the tables, against one another: at rest and in runs.

    Writes agreement.json and agreement.html. Exit status 1 where they do not agree.
    """
    from ..agreement import agree
    from ..files import write_whole
    from ..report import agreement_page

    if level is not None and with_ is not None:
        raise UsageError("--level and --with exclude each other; give one of them.")
    if not force:
        in_the_way = [output / name for name in (JSON_FILE, PAGE) if (output / name).exists()]
        if in_the_way:
            # before the minutes of work, not after them
            raise UsageError(f"{in_the_way[0]} exists already; choose another place or give --force.")
    with _progress() as tell:
        answer = agree(
            robot,
            "all" if backends == "all" else _names(backends),
            level or "full",
            effects=None if with_ is None else _names(with_),
            with_effects=with_effects,
            quantities=None if only is None else _names(only),
            duration=duration,
            tell=tell,
        )
    data = answer.to_json()
    write_whole(output, {JSON_FILE: json.dumps(data, indent=1) + "\n", PAGE: agreement_page(answer)}, force=force)
    if as_json:
        print_json(data)
    else:
        for omission in answer.left_out:
            where = "" if omission.scenario == "everything" else f" in {omission.scenario}"
            click.echo(f"left out{where}: {omission.voice}: {omission.reason}")
        for sentence in answer.sentences:
            click.echo(sentence)
        click.echo(f"{output / PAGE}")
    if not answer.agreed:
        sys.exit(1)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


@contextmanager
def _progress() -> Generator[Callable[[str, int, int], None] | None]:
    """A bar on a terminal, nothing elsewhere."""
    if not on_terminal():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("comparing")

        def tell(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total)

        yield tell
