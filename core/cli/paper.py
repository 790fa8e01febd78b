"""mbexport paper: the study of IMECE2013-64815 done again."""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

import click

from .common import backends_of, backends_option, force_option, json_option, print_json, progress


@click.command("paper", epilog="\b\nExample:\n  mbexport paper -o paper")
@backends_option("Backends, separated by commas")
@click.option("--edges", type=int, metavar="N", help="Only the first edges of the path (default: all 16).")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the report.")
@force_option
@json_option
def command(backends: str, edges: int | None, output: Path, force: bool, as_json: bool) -> None:
    """Do the paper's study again on its arm: its figures, and what ours says to its statements.

    Writes report.html, paper.json and pictures/. Exit status 1 where a statement that can be judged is not reproduced.
    """
    from ..files import insist_on_room
    from ..report.paper_page import DRAWINGS, JSON_FILE, PAGE_FILE, PICTURES, write_paper
    from ..reproduction import reproduce, statements

    insist_on_room(output, (PAGE_FILE, JSON_FILE, *(f"{PICTURES}/{name}.svg" for name in DRAWINGS)), force=force)
    began = time.perf_counter()
    with progress("running") as tell:
        study = reproduce(backends_of(backends), edges, tell)
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
        click.echo(", ".join(f"{verdict}: {count}" for verdict, count in counts.items()))
        click.echo(f"{output / PAGE_FILE} ({time.perf_counter() - began:.0f} s)")
    if counts["not reproduced"]:
        sys.exit(1)
