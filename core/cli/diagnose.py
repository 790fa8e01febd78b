"""mbexport diagnose: where the gap to recorded runs lies, which effect causes it, how far it shrinks with it."""

from __future__ import annotations

from pathlib import Path

import click

from .common import (
    backends_of,
    backends_option,
    force_option,
    json_option,
    load_database,
    on_terminal,
    print_json,
    with_effects_option,
)

EXAMPLE = """\b
Examples:
  mbexport diagnose my_robot/ runs/01 runs/02 --holdout runs/03 -o diagnosis
  mbexport --to mjcf my_robot/ --with-effects diagnosis/effects
"""

_COLOURS = {"no_gap": "green", "explained": "green", "partly_explained": "yellow", "unexplained": "red"}


class RunsCommand(click.Command):
    """Takes several runs after one --holdout, as a shell's pattern gives them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """`ROBOT RUN... --holdout A B` is `ROBOT RUN... --holdout A --holdout B`."""
        return super().parse_args(ctx, _spread_holdout(self, ctx, args))


def _spread_holdout(command: click.Command, ctx: click.Context, args: list[str]) -> list[str]:
    """Each word after --holdout as an option of its own, once the robot and a run stand before it."""
    takes_value = {
        name
        for parameter in command.get_params(ctx)
        if isinstance(parameter, click.Option) and not parameter.is_flag
        for name in parameter.opts
    }
    spread: list[str] = []
    placed, in_holdout, value_of = 0, False, ""
    for word in args:
        if value_of:
            spread.append(word)
            in_holdout = value_of == "--holdout"
            value_of = ""
        elif word.startswith("-") and word != "-":
            spread.append(word)
            in_holdout = word.startswith("--holdout=")
            value_of = word if word in takes_value else ""
        elif in_holdout and placed >= 2:
            spread += ["--holdout", word]
        else:
            spread.append(word)
            placed += 1
    return spread


@click.command("diagnose", cls=RunsCommand, epilog=EXAMPLE)
@click.argument("robot")
@click.argument("runs", nargs=-1, required=True, metavar="RUN...", type=click.Path(path_type=Path))
@click.option(
    "--holdout",
    multiple=True,
    metavar="RUN...",
    type=click.Path(path_type=Path),
    help="Runs that no fit may see (default: each run is left out in turn).",
)
@click.option("--level", default="full", show_default=True, metavar="NAME", help="Level of the nominal model.")
@with_effects_option
@click.option("--backend", default="mjcf", show_default=True, metavar="NAME", help="Where candidates are simulated.")
@backends_option("Where the corrected robot is simulated again")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the diagnosis.")
@force_option
@json_option
def command(
    robot: str,
    runs: tuple[Path, ...],
    holdout: tuple[Path, ...],
    level: str,
    with_effects: Path | None,
    backend: str,
    backends: str,
    output: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Say where the gap between a robot and its model lies, which effect causes it, how far it shrinks with it.

    Writes diagnosis.json, report.html, the effects found as tables, and the motion of the next experiment. A RUN is a
    run's folder or data file, or a folder of runs. Exit status 0 whatever the verdict.
    """
    from ..diagnosis.named import diagnose
    from ..diagnosis.words import summary
    from ..diagnosis.written import PAGE_FILE, check_place, files_of, write_files
    from ..report.diagnosis_page import diagnosis_page

    check_place(output, force=force)
    found = diagnose(
        load_database(robot, with_effects, level),
        runs,
        holdout,
        level=level,
        backend=backend,
        backends=backends_of(backends),
        progress=on_terminal(),
    )
    files = files_of(found, diagnosis_page(found))
    write_files(output, files, force=force)
    if as_json:
        print_json(found.to_json())
        return
    headline, *lines = summary(found).splitlines()
    click.secho(headline, fg=_COLOURS[found.verdict], bold=True)
    for line in lines:
        click.echo(line)
    click.echo(f"  {output / PAGE_FILE}")
