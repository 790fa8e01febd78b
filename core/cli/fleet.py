"""mbexport fleet: many robots and their runs diagnosed."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from .common import (
    backends_of,
    backends_option,
    force_option,
    goes_on,
    json_option,
    on_terminal,
    print_json,
    workers_options,
)

EXAMPLE = """\b
Examples:
  mbexport fleet robots/ -o fleet
  mbexport fleet robots/ -o fleet --backends mjcf --dask tcp://host:8786
"""


@click.command("fleet", epilog=EXAMPLE)
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--level", default="full", show_default=True, metavar="NAME", help="Level of the nominal models.")
@click.option("--backend", default="mjcf", show_default=True, metavar="NAME", help="Where candidates are simulated.")
@backends_option("Where corrected robots are simulated again")
@workers_options
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the fleet's results.")
@force_option
@json_option
def command(
    folder: Path,
    level: str,
    backend: str,
    backends: str,
    workers: int | None,
    dask: str | None,
    output: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Diagnose many robots, each as `diagnose` does, and say what they have in common.

    DIR holds a folder a case: runs/, robot/ (or robot.yaml; one beside the cases counts for those that have none), and
    holdout/ where some runs are to be held out. Writes a folder a case, cases.csv, findings.csv and report.html. A
    fleet that was stopped goes on where it was: give the same command again. Exit status 1: no case could be diagnosed.
    """
    from ..fleet import cases_in, fleet_of, plan_fleet, run_fleet
    from ..report.diagnosis_page import diagnosis_page
    from ..report.fleet import PAGE_FILE, WORDS, write_fleet

    cases = cases_in(folder)
    work = plan_fleet(diagnosis_page, level=level, backend=backend, backends=backends_of(backends))
    with goes_on(output):
        run_fleet(work, cases, output, workers=workers, dask=dask, force=force, progress=on_terminal())
    fleet = fleet_of(cases, output)
    write_fleet(fleet, output)
    summary = fleet.summary()
    if as_json:
        print_json({"output": str(output), **summary})
    else:
        said = ", ".join(f"{number} {WORDS[name]}" for name, number in fleet.verdicts().items() if number)
        click.echo(f"{output}: {len(cases)} {'case' if len(cases) == 1 else 'cases'}, {said}")
        for one in fleet.common():
            click.echo(f"  {len(one.cases)} {one.effect} {one.at}")
        for row in summary["failed"]:
            click.echo(f"  {row['case']}: {row['reason']}")
        click.echo(f"  {output / PAGE_FILE}")
    if len(summary["failed"]) == len(cases):
        sys.exit(1)
