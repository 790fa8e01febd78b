"""Fenced blocks of the documentation, as the tests run them.

A block's first line says what becomes of it: `file=PATH` writes it to a file, `run` runs it (a shell line by line, or
Python, all blocks of a page in one namespace), `run=STATUS` a shell block that exits with that status, and `output`
is what the block run before it prints.
"""

from __future__ import annotations

import importlib.util
import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^(`{3,}|~{3,})(.*)$")


@dataclass(frozen=True)
class Block:
    page: Path
    line: int
    language: str
    marks: dict[str, str]
    text: str

    @property
    def commands(self) -> list[str]:
        """Shell lines, continued ones joined."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [line.removeprefix("$ ").strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


def blocks_of(page: Path, text: str | None = None) -> list[Block]:
    found: list[Block] = []
    fence, start, words, inside = "", 0, [""], []
    lines = (page.read_text(encoding="utf-8") if text is None else text).splitlines()
    for number, line in enumerate(lines, 1):
        match = FENCE.match(line)
        if not fence and match:
            fence, start, words, inside = match[1], number, shlex.split(match[2]) or [""], []
        elif fence and line.rstrip() == fence:
            marks = dict((*word.split("=", 1), "")[:2] for word in words[1:])
            found.append(Block(page, start, words[0], marks, "".join(f"{row}\n" for row in inside)))
            fence = ""
        elif fence:
            inside.append(line)
    assert not fence, f"{page.name}:{start}: the block does not end"
    return found


def pages() -> list[Path]:
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "page" in metafunc.fixturenames:
        metafunc.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())


@pytest.fixture
def page_blocks(page: Path) -> list[Block]:
    return blocks_of(page)


@pytest.fixture(scope="session")
def parse_blocks():
    return blocks_of


@pytest.fixture(scope="session")
def script():
    """script("generate"): a script of docs/ as a module."""

    def load(name):
        spec = importlib.util.spec_from_file_location(f"docs_{name}", ROOT / "docs" / f"{name}.py")
        module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture(scope="session")
def png_size():
    """Width and height of a PNG file, as its bytes."""
    return lambda path: path.read_bytes()[16:24]
