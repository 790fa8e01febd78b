"""The command line as a person calls it, in this process."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from mbexport.core.cli import main


@dataclass(frozen=True)
class Answer:
    status: int
    out: str
    err: str

    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def mbexport(capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """mbexport(words...) -> exit status and what it printed; no input may end in a traceback."""

    def call(*words: object) -> Answer:
        status = 0
        try:
            main([str(word) for word in words])
        except SystemExit as error:
            status = error.code if isinstance(error.code, int) else int(error.code is not None)
        printed = capsys.readouterr()
        assert "Traceback" not in printed.out + printed.err
        return Answer(status, printed.out, printed.err)

    return call


@pytest.fixture
def content() -> Callable[[Path], dict[str, bytes]]:
    """content(folder) -> relative path to bytes of every file in it."""

    def of(folder: Path) -> dict[str, bytes]:
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}

    return of
