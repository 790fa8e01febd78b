"""The command line: one file a verb, loaded only when it is called."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

import click

from ..errors import MbexportError, RefusedError

# verb -> what it does; kept here so that --help imports no verb
VERBS = {
    "export": "Emit a robot as URDF, MJCF, Exudyn or PyBullet model (mbexport --to FORMAT is short for it).",
    "list": "What is installed: backends, effects, robots.",
    "check": "All that is wrong or suspicious in a database.",
    "import": "Make a database from a URDF or an MJCF model.",
    "simulate": "Run a robot in one engine and write the run.",
    "cosimulate": "Couple controller and robot, a solver each: what their communication step costs.",
    "agree": "Prove that all engines run the same robot.",
    "diagnose": "Say where the gap to recorded runs lies, which effect causes it, how far it shrinks with it.",
    "sweep": "Run many variants of a robot: what the tip's error owes to which parameter.",
    "paper": "Do the paper's study again: its figures, and what ours says to its statements.",
    "fleet": "Diagnose many robots, and say what they have in common.",
    "studio": "Change a robot by sliders in the browser, and see what its tip makes of it.",
    "demo": "All of it on the built-in robot, in one go.",
}

EXAMPLE = """\b
Examples:
  mbexport --to urdf --to mjcf imece2013 -o out
  mbexport check my_robot/
  mbexport agree imece2013 --level compliant -o report
"""


class Verbs(click.Group):
    """Commands that are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the verbs in the order of a user's work."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The verb's command, from the module of its name."""
        if cmd_name not in VERBS:
            return None
        module = "import_model" if cmd_name == "import" else "list_installed" if cmd_name == "list" else cmd_name
        return import_module(f".{module}", __name__).command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The verbs with their one-line help, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(VERBS.items()))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """`mbexport --to urdf ...` is `mbexport export --to urdf ...`."""
        if args and args[0] not in {*VERBS, "--help", "-h", "--version"}:
            is_option = args[0].startswith("-")
            if is_option or any(word == "--to" or word.startswith("--to=") for word in args):
                args = ["export", *args]
        return super().parse_args(ctx, args)


def _version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        click.echo(f"mbexport {version('mbexport')}")
        ctx.exit()


@click.group(cls=Verbs, epilog=EXAMPLE, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--version", is_flag=True, callback=_version, expose_value=False, is_eager=True, help="Show the version.")
def program() -> None:
    """One robot database, every simulator, one answer.

    ROBOT is a database (a folder or a YAML file) or the name of a built-in robot.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the program; every error of ours becomes one message and an exit status.

    Exit status: 0 done, 1 the answer is no (disagreement, refusal, failed check), 2 wrong use or bad input.
    """
    try:
        program.main(args=None if arguments is None else list(arguments), prog_name="mbexport")
    except MbexportError as error:
        click.echo(f"mbexport: {error}", err=True)
        sys.exit(1 if isinstance(error, RefusedError) else 2)
