"""mbexport check: all that is wrong or suspicious in a database."""

from __future__ import annotations

import sys
from dataclasses import asdict

import click

from .common import json_option, print_json


@click.command("check", epilog="\b\nExample:\n  mbexport check my_robot/")
@click.argument("robot")
@json_option
def command(robot: str, as_json: bool) -> None:
    """All that is wrong (exit 1) or suspicious (exit 0) in a database."""
    from ..database import check

    problems = check(robot)
    errors = [problem for problem in problems if problem.severity == "error"]
    if as_json:
        print_json({"robot": robot, "ok": not errors, "problems": [asdict(problem) for problem in problems]})
    else:
        for problem in problems:
            click.echo(f"{problem.severity}: {problem}")
        suspicious = len(problems) - len(errors)
        click.echo(f"{robot}: {len(errors)} wrong, {suspicious} suspicious")
    if errors:
        sys.exit(1)
