"""mbexport sweep: many variants of one robot."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from .common import (
    control_option,
    duration_option,
    effects_of,
    force_option,
    goes_on,
    json_option,
    level_options,
    load_database,
    on_terminal,
    print_json,
    rate_option,
    workers_options,
)

if TYPE_CHECKING:
    from ..study import Sampling

# of core/study/design.py, which --help need not load
SAMPLINGS = ("grid", "random", "lhs", "sobol", "morris")

EXAMPLE = """\b
Examples:
  mbexport sweep imece2013 --vary joint_compliance.stiffness@joint_2=0.5:2:9 --level compliant -o study
  mbexport sweep imece2013 --vary joint_compliance.stiffness@all=0.5:2 --sample sobol --count 512 -o study
  mbexport sweep imece2013 --vary 'payload.mass[kg]@robot=0:10:5' -o study
"""


@click.command("sweep", epilog=EXAMPLE)
@click.argument("robot", default="imece2013")
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="NAME.COLUMN@PLACE=FROM:TO[:COUNT[:log]]",
    help="A number of the database and its range, in factors of its value; NAME.COLUMN[UNIT] for values. A list A,B,C "
    "for a grid. PLACE: joint_N, arm_N, robot, or all. Repeatable.",
)
@click.option(
    "--sample", type=click.Choice(SAMPLINGS), default="grid", show_default=True, help="How variants are chosen."
)
@click.option("--count", type=int, metavar="N", help="How many variants, for samples.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of samples.")
@click.option("--backend", default="mjcf", show_default=True, metavar="NAME", help="Where variants run.")
@click.option("--motion", default="greca", show_default=True, metavar="NAME", help="As in simulate.")
@level_options
@control_option
@duration_option
@rate_option
@workers_options
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the study.")
@force_option
@json_option
def command(
    robot: str,
    vary: tuple[str, ...],
    sample: str,
    count: int | None,
    seed: int,
    backend: str,
    motion: str,
    level: str | None,
    with_: str | None,
    with_effects: Path | None,
    control: Path | None,
    duration: float | None,
    rate: float,
    workers: int | None,
    dask: str | None,
    output: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Run many variants of a robot, and find what the tip's error owes to which parameter.

    A study that was stopped goes on where it was: give the same command again. Exit status 1: no variant ran.
    """
    from ..control import read_control
    from ..report.study import write_study
    from ..study import plan_study, results_of, run_study
    from ..study.table import arrow_modules

    effects = effects_of(level, with_)
    arrow_modules()
    database = load_database(robot, with_effects, level)
    study = plan_study(
        database,
        vary,
        level=level,
        effects=effects,
        backend=backend,
        motion=motion,
        control=None if control is None else read_control(control, database.n),
        duration=duration,
        rate=rate,
        sampling=cast("Sampling", sample),
        count=count,
        seed=seed,
    )
    if count is not None and len(study.design) != count and not as_json:
        click.echo(f"{sample}: {len(study.design)} variants make whole blocks of {study.design.block}")
    with goes_on(output):
        outcomes = run_study(study, output, workers=workers, dask=dask, force=force, progress=on_terminal())
    results = results_of(study, outcomes)
    write_study(results, output)
    summary = results.summary()
    if as_json:
        print_json({"output": str(output), **summary})
    else:
        _tell(output, summary)
    if summary["failed"] == summary["variants"]:
        sys.exit(1)


def _tell(output: Path, summary: dict[str, Any]) -> None:
    """The answer in a few lines: indices of the tip's error, the strongest parameter first."""
    nominal = summary["nominal"]
    stands = "" if nominal is None else f"; tip's error as the database stands {1e3 * nominal['tip_rms']:.4g} mm rms"
    click.echo(f"{output}: {summary['variants']} variants, {summary['failed']} failed{stands}")
    for row in summary["reasons"][:5]:
        click.echo(f"  {row['variants']} {row['reason']}")
    for one in summary["sensitivity"]:
        values = one["values"]
        ranked = next((name for name in ("total", "mean_effect", "first") if name in values), None)
        if ranked is None:
            click.echo(f"  {one['figure']}: no indices, {one['note']}")
            continue
        order = sorted(range(len(one["parameters"])), key=lambda i: -values[ranked][i])
        shown = ", ".join(f"{one['parameters'][i]} {values[ranked][i]:.3g}" for i in order[:3])
        click.echo(f"  {one['figure']} ({one['method']}, {ranked.replace('_', ' ')}): {shown}")
    click.echo(f"  {output / 'report.html'}")
