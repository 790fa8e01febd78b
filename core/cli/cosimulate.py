"""mbexport cosimulate: controller and robot with a solver each, and what their communication step costs."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import click

from .common import build_robot, force_option, json_option, level_options, load_database, on_terminal, print_json

EXAMPLE = """\b
Examples:
  mbexport cosimulate imece2013 --motion greca --level compliant --duration 1 --memory -o coupled
  mbexport cosimulate planar2r --motion excitation --level compliant --interval 0.002 --interval 0.001 -o coupled
"""


@click.command("cosimulate", epilog=EXAMPLE)
@click.argument("robot", default="imece2013")
@click.option("--backend", default="mjcf", show_default=True, metavar="NAME", help="Where the robot runs.")
@click.option("--motion", default="greca", show_default=True, metavar="NAME", help="As in simulate.")
@level_options
@click.option(
    "--control",
    type=click.Path(path_type=Path),
    help="A log.yaml or its control part, mode pd (default: gains that suit the robot).",
)
@click.option("--lag", type=float, default=1e-3, show_default=True, metavar="S", help="Lag of the current loops [s].")
@click.option("--integral", type=float, default=math.inf, metavar="S", help="Reset time of an integral part [s].")
@click.option(
    "--interval",
    "intervals",
    type=float,
    multiple=True,
    metavar="S",
    help="Communication step [s]; repeatable (default: 4, 2, 1, 0.5 and 0.25 ms).",
)
@click.option(
    "--order",
    "orders",
    type=click.IntRange(0, 2),
    multiple=True,
    metavar="N",
    help="What is between communication points: 0 held, 1 or 2 extrapolated; repeatable (default: all).",
)
@click.option("--memory", is_flag=True, help="Each once more with feedback that is one communication step late.")
@click.option("--duration", type=float, metavar="S", help="How long [s] (default: the motion's).")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the results.")
@force_option
@json_option
def command(
    robot: str,
    backend: str,
    motion: str,
    level: str | None,
    with_: str | None,
    with_effects: Path | None,
    control: Path | None,
    lag: float,
    integral: float,
    intervals: tuple[float, ...],
    orders: tuple[int, ...],
    memory: bool,
    duration: float | None,
    output: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Couple controller and robot, a solver each, and measure what their communication step costs the tip.

    Exit status 1: no communication step holds the loop together.
    """
    from ..control import default_pd, read_control
    from ..cosimulation import ContinuousController, loop_of, measure
    from ..cosimulation.study import ORDERS, STEPS
    from ..errors import UsageError
    from ..motion import motion_named
    from ..report.cosimulation import FILES, PAGE, answer_of, write_cosimulation
    from ..simulation import backend_named

    taken = [output / name for name in FILES if (output / name).exists()]
    if taken and not force:
        raise UsageError(f"{taken[0]} exists already; choose another place or give --force.")
    database = load_database(robot, with_effects)
    built = build_robot(database, level, with_)
    law = motion_named(built, motion, database=database)
    rules = read_control(control, built.n) if control else default_pd(built, feedforward="gravity")
    loop = loop_of(built, ContinuousController.of(built, rules, law, lag=lag, integral=integral), duration)

    def tell(doing: str) -> None:
        if on_terminal():
            click.echo(f"  {doing}", err=True)

    study = measure(loop, backend_named(backend), intervals or STEPS, orders or ORDERS, memory=memory, tell=tell)
    write_cosimulation(study, output, force=force)
    if as_json:
        print_json({"output": str(output), **study.to_json()})
    else:
        click.echo(f"{output}: {answer_of(study)}")
        for kind, found in study.observed_orders().items():
            click.echo(f"  {kind}: order {', '.join(f'{order:.2f}' for order in found) or 'not known'}")
        click.echo(f"  {output / PAGE}")
    if not any(one.stable for one in study.measured):
        sys.exit(1)
