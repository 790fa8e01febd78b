"""Each database in tests/broken has one fault, and gives its one error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from mbexport.core.database import check, load
from mbexport.core.errors import DatabaseError

BROKEN = Path(__file__).parent.parent / "broken"
EXPECTED: dict[str, dict[str, Any]] = YAML(typ="safe").load(BROKEN / "expected.yaml")


def test_every_folder_is_expected():
    folders = {path.name for path in BROKEN.iterdir() if path.is_dir()}
    assert folders == {*EXPECTED, "none"}


def test_what_the_others_are_made_from_has_no_fault():
    assert check(BROKEN / "none") == ()


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_one_error_with_its_place(name: str):
    expected = EXPECTED[name]
    with pytest.raises(DatabaseError) as caught:
        load(BROKEN / name)
    (problem,) = caught.value.problems
    assert problem.severity == "error"
    assert (problem.file, problem.line) == (expected["file"], expected.get("line"))
    assert (problem.column, problem.value) == (expected.get("column"), expected.get("value"))
    for says in expected["says"]:
        assert says in problem.message
    # what a person reads holds the place too
    assert str(caught.value).startswith(expected["file"])
    errors = [p for p in check(BROKEN / name) if p.severity == "error"]
    assert errors == [problem]
