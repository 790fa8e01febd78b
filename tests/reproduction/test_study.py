"""The study as a whole: what it says, its files, its command."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from mbexport.core.cli import main
from mbexport.core.errors import UsageError
from mbexport.core.report.paper_page import DRAWINGS, write_paper
from mbexport.core.reproduction import reproduce, statements
from mbexport.core.reproduction.case import corners_of, paper_case
from mbexport.core.reproduction.statements import length


def test_every_statement_holds_or_is_said_to_differ(study):
    found = statements(study)
    assert {one.verdict for one in found} == {"input", "reproduced", "differs", "cannot be compared"}
    assert sum(one.verdict == "reproduced" for one in found) == 10
    assert all(one.says and one.ours and "nan" not in one.ours for one in found)


def test_the_documentation_has_every_statement(study):
    page = (Path(__file__).resolve().parents[2] / "docs" / "paper.md").read_text(encoding="utf-8")
    for one in statements(study):
        assert f"| {one.where} | {one.says} | " in page
        assert f"| {one.verdict} |" in page
    assert "![" in page
    for name in DRAWINGS:
        assert f"(pictures/paper/{name}.png)" in page


def test_progress_counts_every_run(study, told):
    assert [done for _, done, _ in told] == list(range(len(told)))
    assert {total for _, _, total in told} == {len(told) - 1}


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper") / "out"
    write_paper(study, folder)
    return folder


def test_same_study_same_bytes(study, written):
    files = {path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file()}
    assert files == {"report.html", "paper.json", *(f"pictures/{name}.svg" for name in DRAWINGS)}
    for name in ("figures_3_and_4", "figure_13"):
        assert DRAWINGS[name](study).svg() == (written / "pictures" / f"{name}.svg").read_bytes()


def test_the_page_has_everything_inside(written):
    page = (written / "report.html").read_text(encoding="utf-8")
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == len(DRAWINGS)
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    assert "10 of 12 statements reproduced, 2 said to differ" in page
    assert "Only the first edges" in page


def test_the_json_has_all_numbers(written, study):
    data = json.loads((written / "paper.json").read_text(encoding="utf-8"))
    assert data == json.loads(json.dumps(study.to_json()))
    assert data["schema"] == "mbexport-paper/1"
    assert data["edges"] == 1
    assert [engine["backend"] for engine in data["engines"]] == ["mjcf", "urdf"]


def test_what_is_there_is_not_written_over(written, study, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["paper", "-o", str(written)])
    assert stopped.value.code == 2
    assert "exists already" in capsys.readouterr().err


def test_edges_that_are_none_are_refused():
    with pytest.raises(UsageError, match="the path has 16"):
        reproduce(("mjcf",), 17)
    assert len(paper_case(("mjcf",), None, lambda what, done, total: None).corners) == 17


def test_corners_are_where_all_joints_stand(case):
    assert corners_of(case.motion) == pytest.approx([0.0, 0.48, 0.96])


def test_lengths_for_people():
    assert [length(x) for x in (2.5, -0.0123, 4.5e-6, 3e-14)] == ["2.5 m", "-12.3 mm", "4.5 um", "3.0e-14 m"]
