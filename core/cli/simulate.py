"""mbexport simulate: run a robot in one engine and write what it records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import (
    build_robot,
    control_option,
    duration_option,
    effects_of,
    force_option,
    json_option,
    level_options,
    load_database,
    on_terminal,
    print_json,
    rate_option,
)

if TYPE_CHECKING:
    from ..representation import Robot

EXAMPLE = """\b
Examples:
  mbexport simulate imece2013 --backend mjcf --motion greca -o run-01
  mbexport simulate planar2r --backend mjcf --motion greca --controller pd.fmu -o run-02
"""


@click.command("simulate", epilog=EXAMPLE)
@click.argument("robot", default="imece2013")
@click.option("--backend", required=True, metavar="NAME", help="urdf (Pinocchio), mjcf (MuJoCo), exudyn, pybullet.")
@click.option(
    "--motion", required=True, metavar="NAME", help="A motion of the database, greca, excitation, hold, or a file."
)
@level_options
@control_option
@click.option(
    "--controller",
    type=click.Path(path_type=Path),
    metavar="FILE.fmu",
    help="A controller of others, a co-simulation unit of FMI 2.0; its native code is executed.",
)
@click.option(
    "--signals", type=click.Path(path_type=Path), help="What the controller's variables mean, where their names do not."
)
@duration_option
@rate_option
@click.option("--noise", is_flag=True, help="Add the noise that the log.yaml of --control states.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the noise.")
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder of the run.")
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
    controller: Path | None,
    signals: Path | None,
    duration: float | None,
    rate: float,
    noise: bool,
    seed: int,
    output: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Run a robot in one engine and write the run: what a simulated robot records.

    With --with-effects the controller's feedforward knows the robot as its database stands, as a real one's does.
    """
    from ..control import read_control, read_locked, read_noise, read_payload, read_signals, read_unit
    from ..effects import EffectRow, effect_named
    from ..errors import RefusedError, UsageError
    from ..motion import motion_named
    from ..simulation import simulate

    database = load_database(robot, with_effects, level)
    built = build_robot(database, level, with_)
    known = _as_it_stands(robot, level, with_) if with_effects else built
    law = motion_named(built, motion, database=database)
    rules = read_control(control, built.n) if control else None
    if signals and not controller:
        raise UsageError("--signals says what the variables of --controller mean; give one.")
    unit = read_unit(controller, built.n, read_signals(signals) if signals else None) if controller else None
    hanging = read_payload(control) if control else {}
    if hanging:
        built, known = (effect_named("payload").apply(one, (EffectRow(0, hanging),)) for one in (built, known))
    if control and read_locked(control):
        raise RefusedError(f"{control}: locked joints cannot be simulated; leave `locked` out to run the robot free.")
    if noise and control is None:
        raise UsageError("--noise takes its sizes from the log.yaml of --control; give one.")
    trace = simulate(
        built, backend, law, rules, duration=duration, rate=rate, unit=unit, nominal=known, progress=on_terminal()
    )
    if noise and control is not None:
        trace = trace.with_noise(read_noise(control, built.n), seed)
    if hanging:
        trace = replace(trace, facts={**trace.facts, "payload": hanging})
    trace.write(output, force=force)
    if as_json:
        print_json({"output": str(output), "warnings": list(trace.warnings), **trace.facts})
        return
    for warning in trace.warnings:
        click.echo(f"warning: {warning}")
    facts = trace.facts
    x, y, z = (float(value) for value in trace.tip[-1])
    click.echo(
        f"{output}: {len(trace.t)} samples; {facts['engine']} {facts['version']}, {facts['integrator']}, "
        f"step {facts['step']!r} s; tip at the end {x!r} {y!r} {z!r} m"
    )


def _as_it_stands(robot: str, level: str | None, with_: str | None) -> Robot:
    """The robot of the database alone, with those of the effects asked for that it has itself."""
    database = load_database(robot, None)
    asked = effects_of(level, with_)
    own = None if asked is None else ",".join(name for name in asked if name in database.effects)
    return build_robot(database, level, own)
