"""mbexport studio: a robot on the bench, in the browser."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from ..errors import UsageError
from .common import build_robot, json_option, level_options, load_database, print_json

EXAMPLE = """\b
Examples:
  mbexport studio imece2013
  mbexport studio my_robot/ --motion my_motion -o changed
"""


@click.command("studio", epilog=EXAMPLE)
@click.argument("robot", default="imece2013")
@level_options
@click.option("--motion", metavar="NAME", help="As in simulate (default: greca, or what the robot can do instead).")
@click.option("--backend", default="mjcf", show_default=True, metavar="NAME", help="Engine that runs the motion.")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to serve at; any other than this machine's own lets everybody who reaches it change and write.",
)
@click.option("--port", default=8080, show_default=True, type=click.IntRange(0, 65535), help="Port, or the next free.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Folder for saves and exports (default: NAME-studio)."
)
@click.option("--open/--no-open", "opened", default=True, help="Open the page in the browser.")
@json_option
def command(
    robot: str,
    level: str | None,
    with_: str | None,
    with_effects: Path | None,
    motion: str | None,
    backend: str,
    host: str,
    port: int,
    output: Path | None,
    opened: bool,
    as_json: bool,
) -> None:
    """Change a robot by sliders and switches, and see what its tip makes of it. Ctrl-C ends it."""
    from ..simulation.backends import backend_named
    from ..studio.bench import Bench
    from ..studio.page import Page, server_module

    server_module()
    if not backend_named(backend).runs:
        raise UsageError(f"--backend {backend}: it is emitted only; name one that runs here (mbexport list backends).")
    database = load_database(robot, with_effects, level)
    bench = Bench(database, effects=build_robot(database, level, with_).effects)
    folder = output or Path(f"{database.name}-studio")
    page = Page(bench, output=folder, host=host, port=port, backend=backend, motion=motion)
    if as_json:
        print_json({"robot": database.name, "address": page.address, "output": str(folder)})
    else:
        click.echo(f"{database.name}: {page.address} (Ctrl-C ends it)")
    if opened and _has_screen():
        click.launch(page.address)
    try:
        page.wait()
    except KeyboardInterrupt:
        click.echo("")
    finally:
        page.close()


def _has_screen() -> bool:
    """Whether a browser can open a window; on Linux, over a plain connection say, there may be no screen."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
