"""mbexport cosimulate: controller and robot with a solver each, and what their communication step costs."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import UsageError
from .common import (
    build_robot,
    duration_option,
    force_option,
    json_option,
    level_options,
    load_database,
    on_terminal,
    print_json,
)

if TYPE_CHECKING:
    from ..cosimulation import Partner
    from ..motion import MotionLaw
    from ..representation import Robot

EXAMPLE = """\b
Examples:
  mbexport cosimulate imece2013 --motion greca --level compliant --duration 1 --memory -o coupled
  mbexport cosimulate planar2r --motion excitation --level compliant --interval 0.002 --interval 0.001 -o coupled
  mbexport cosimulate planar2r --motion excitation --controller pd.fmu -o coupled
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
@click.option(
    "--controller",
    "unit",
    type=click.Path(path_type=Path),
    metavar="FILE.fmu",
    help="A controller of others, a co-simulation unit of FMI 2.0; its native code is executed.",
)
@click.option(
    "--signals", type=click.Path(path_type=Path), help="What the controller's variables mean, where their names do not."
)
@click.option("--lag", type=float, metavar="S", help="Lag of the current loops [s] (default: 0.001).")
@click.option("--integral", type=float, metavar="S", help="Reset time of an integral part [s] (default: none).")
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
@duration_option
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
    unit: Path | None,
    signals: Path | None,
    lag: float | None,
    integral: float | None,
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
    from ..cosimulation import loop_of, measure
    from ..cosimulation.study import ORDERS, STEPS
    from ..files import insist_on_room
    from ..motion import motion_named
    from ..report.cosimulation import FILES, PAGE, answer_of, write_cosimulation
    from ..simulation import backend_named

    insist_on_room(output, FILES, force=force)
    database = load_database(robot, with_effects, level)
    built = build_robot(database, level, with_)
    law = motion_named(built, motion, database=database)
    if signals and not unit:
        raise UsageError("--signals says what the variables of --controller mean; give one.")
    if unit and (lag is not None or integral is not None):
        raise UsageError(f"--lag and --integral are those of mbexport's own controller; {unit.name} has its own law.")
    partner = _unit(built, law, control, unit, signals) if unit else _own(built, law, control, lag, integral)
    loop = loop_of(built, partner, duration)

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


def _own(robot: Robot, motion: MotionLaw, control: Path | None, lag: float | None, integral: float | None) -> Partner:
    """The controller of mbexport."""
    from ..control import default_pd, read_control
    from ..cosimulation import ContinuousController
    from ..cosimulation.controller import LAG

    rules = read_control(control, robot.n) if control else default_pd(robot, feedforward="gravity")
    lag, integral = LAG if lag is None else lag, math.inf if integral is None else integral
    return ContinuousController.of(robot, rules, motion, lag=lag, integral=integral)


def _unit(robot: Robot, motion: MotionLaw, control: Path | None, unit: Path, signals: Path | None) -> Partner:
    """A controller of others."""
    from ..control import read_control, read_signals, read_unit
    from ..cosimulation import UnitInLoop

    read = read_unit(unit, robot.n, read_signals(signals) if signals else None)
    return UnitInLoop.of(robot, read, motion, read_control(control, robot.n) if control else None)
