"""What the documentation shows is what the program does: every example runs, every command exists."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest

from mbexport.core.cli import program

LANGUAGES = {"python", "sh", "text", "yaml", "toml", "xml", "json"}
MARKS = {"file", "run", "output"}

# runs a page's blocks in one process, so that engines load once; what it prints is handed back block by block
RUNNER = """
import contextlib, io, json, sys
from mbexport.core.cli import main
names, printed = {"__name__": "page"}, []
for kind, name, text in json.load(sys.stdin):
    out, status = io.StringIO(), 0
    with contextlib.redirect_stdout(out):
        if kind == "python":
            exec(compile(text, name, "exec"), names)
        else:
            try:
                main(text)
            except SystemExit as error:
                status = error.code or 0
    printed.append([out.getvalue(), status])
json.dump(printed, sys.stdout)
"""


def install_plugins(folder: Path) -> None:
    """Make the entry points of every pyproject.toml in a folder known, as an installed distribution has them."""
    for path in folder.rglob("pyproject.toml"):
        project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
        info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n", encoding="utf-8"
        )
        groups = project["entry-points"].items()
        lines = [line for group, names in groups for line in (f"[{group}]", *(f"{k} = {v}" for k, v in names.items()))]
        (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_examples_run(page, page_blocks, tmp_path):
    """Every block that is marked runs, in the page's order, and prints what the page says."""
    import json

    for block in page_blocks:
        if "file" in block.marks:
            path = tmp_path / block.marks["file"]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
    install_plugins(tmp_path)
    steps, expected = [], []
    for block in page_blocks:
        name = f"{page.name}:{block.line}"
        if "run" in block.marks and block.language == "python":
            steps.append(("python", name, "\n" * block.line + block.text))
            expected.append([name, None, "0"])
        elif "run" in block.marks:
            assert block.language == "sh", f"{name}: what language is this?"
            for command in block.commands:
                words = shlex.split(command, comments=True)
                assert words[0] == "mbexport", f"{name}: only mbexport runs here, not {command!r}"
                steps.append(("sh", name, words[1:]))
                expected.append([name, None, block.marks["run"] or "0"])
        elif "output" in block.marks:
            assert expected, f"{name}: output of what?"
            expected[-1][1] = block.text
    if not steps:
        pytest.skip("nothing on this page runs")
    done = subprocess.run(
        [sys.executable, "-c", RUNNER],
        input=json.dumps(steps),
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    for (name, output, status), (printed, code) in zip(expected, json.loads(done.stdout), strict=True):
        assert str(code) == status, f"{name} exits {code}: {printed}\n{done.stderr[-2000:]}"
        if output is not None:
            assert printed == output, name


def test_blocks_are_of_known_kinds(page, page_blocks):
    for block in page_blocks:
        place = f"{page.name}:{block.line}"
        assert block.language in LANGUAGES, f"{place}: language {block.language!r}"
        assert set(block.marks) <= MARKS, f"{place}: {block.marks}"


def test_commands_exist(page, page_blocks):
    """Every mbexport command on a page is one that the command line takes, options and all."""
    for block in page_blocks:
        if block.language == "sh":
            for command in block.commands:
                words = shlex.split(command, comments=True)
                if words[0] == "mbexport":
                    try:
                        parse(words[1:])
                    except click.ClickException as error:
                        pytest.fail(f"{page.name}:{block.line}: {command}: {error.format_message()}")


def parse(words: list[str]) -> None:
    """Parse a command without running it."""
    with click.Context(program, info_name="mbexport", **program.context_settings) as context:
        rest = program.parse_args(context, list(words))
        if context.resilient_parsing or not (context._protected_args or rest):
            return
        _, command, arguments = program.resolve_command(context, [*context._protected_args, *context.args])
        assert command is not None
        command.make_context(command.name, arguments, parent=context).close()


def test_python_is_python(page, page_blocks):
    for block in page_blocks:
        if block.language == "python":
            compile(block.text, f"{page.name}:{block.line}", "exec")


def test_a_wrong_example_would_be_found(parse_blocks, tmp_path):
    text = "```sh\nmbexport check --nonsense robot\n```\n\n~~~~python run\nassert False\n~~~~\n"
    shell, python = parse_blocks(tmp_path / "page.md", text)
    with pytest.raises(click.ClickException, match="nonsense"):
        parse(shlex.split(shell.commands[0])[1:])
    with pytest.raises(click.ClickException):
        parse(["no_such_verb"])
    assert python.language == "python"
    assert python.marks == {"run": ""}
    with pytest.raises(AssertionError):
        test_examples_run(Path("page.md"), [python], tmp_path)
