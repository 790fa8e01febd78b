"""mbexport agree: prove that all engines run the same robot, or say which one does not and why."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from .common import (
    backends_of,
    backends_option,
    effects_of,
    force_option,
    json_option,
    level_options,
    names_of,
    print_json,
    progress,
)

JSON_FILE = "agreement.json"
PAGE = "agreement.html"


@click.command("agree", epilog="\b\nExample:\n  mbexport agree imece2013 --level compliant -o report")
@click.argument("robot", default="imece2013")
@backends_option("Backends, separated by commas")
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
    from ..files import insist_on_room, write_whole
    from ..report import agreement_page

    effects, chosen = effects_of(level, with_), backends_of(backends)
    insist_on_room(output, (JSON_FILE, PAGE), force=force)
    with progress("comparing") as tell:
        answer = agree(
            robot,
            "all" if chosen is None else chosen,
            level or "full",
            effects=effects,
            with_effects=with_effects,
            quantities=None if only is None else names_of(only),
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
