from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mbexport.core.database import Database, load


@pytest.fixture(scope="session")
def database() -> Callable[[str], Database]:
    """A built-in robot's database."""
    return cache(load)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """A run's folder of columns and the text of its log.yaml."""

    def make(columns: Mapping[str, np.ndarray], log: str, name: str = "run") -> Path:
        folder = tmp_path / name
        folder.mkdir(parents=True)
        table = np.column_stack(list(columns.values()))
        text = "".join(",".join("" if np.isnan(x) else repr(x) for x in row) + "\n" for row in table.tolist())
        (folder / "data.csv").write_text(",".join(columns) + "\n" + text)
        (folder / "log.yaml").write_text(log)
        return folder

    return make
