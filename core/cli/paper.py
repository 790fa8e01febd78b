"""mbexport paper: the study of IMECE2013-64815 done again."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import click

from .common import force_option, json_option, on_terminal, print_json


@click.command("paper", epilog="\b\nExample:\n  mbexport paper -o paper")
@click.option(
    "--backends",
    default="all",
    show_default=True,
    metavar="NAME,...",
    help="Backends, separated by commas; all: every one that can run.",
)
@click.option("--edges", type=int, metavar="N", help="Only the first edges of the path (default: all 16).")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the report.")
@force_option
@json_option
def command(backends: str, edges: int | None, output: Path, force: bool, as_json: bool) -> None:
    """Do the paper's study again on its arm: its figures, and what ours says to its statements.

    Writes report.html, paper.json and pictures/. Exit status 1 where a statement that can be judged is not reproduced.
    """
    from ..errors import UsageError
    from ..report.paper_page import DRAWINGS, JSON_FILE, PAGE_FILE, PICTURES, write_paper
    from ..reproduction import reproduce, statements

    if not force:
        names = (PAGE_FILE, JSON_FILE, *(f"{PICTURES}/{name}.svg" for name in DRAWINGS))
        in_the_way = [output / name for name in names if (output / name).exists()]
        if in_the_way:
            # before the minutes of work, not after them
            raise UsageError(f"{in_the_way[0]} exists already; choose another place or give --force.")
    began = time.perf_counter()
    chosen = None if backends == "all" else [name.strip() for name in backends.split(",") if name.strip()]
    with _progress() as tell:
        study = reproduce(chosen, edges, tell)
    write_paper(study, output, force=force)
    answers = statements(study)
    counts = Counter(statement.verdict for statement in answers)
    if as_json:
        print_json(study.to_json())
    else:
        for name, reason in study.case.left_out:
            click.echo(f"left out: {name}: {reason}")
        for statement in answers:
            click.echo(f"{statement.verdict:<20}{statement.where}: {statement.says}")
            click.echo(f"{'':<20}{statement.ours}")
        click.echo(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
        click.echo(f"{output / PAGE_FILE} ({time.perf_counter() - began:.0f} s)")
    if counts["not reproduced"]:
        sys.exit(1)


@contextmanager
def _progress() -> Generator[Callable[[str, int, int], None]]:
    """A bar on a terminal, nothing elsewhere."""
    if not on_terminal():
        yield lambda what, done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("running")

        def tell(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total)

        yield tell
