"""Many robots: which cases there are, each diagnosed once, and one table of them all."""

import csv
import json
import pickle

import pytest
from click.testing import CliRunner

from mbexport.core.cli import program
from mbexport.core.errors import DatabaseError, PluginError, UsageError
from mbexport.core.fleet import cases_in, fleet_of, plan_fleet, run_fleet
from mbexport.core.report.diagnosis_page import diagnosis_page
from mbexport.core.report.fleet import fleet_page, write_fleet


def write_case(place, robot=True, holdout=False):
    for name in ["runs", *(["holdout"] if holdout else [])]:
        folder = place / name / "run-01"
        folder.mkdir(parents=True)
        (folder / "data.csv").write_text("t,q_1\n0,0\n")
    if robot:
        (place / "robot").mkdir()
        (place / "robot" / "robot.yaml").write_text(f"name: {place.name}\n")


def page(diagnosis):
    return f"<p>{diagnosis.verdict}</p>"


@pytest.fixture
def folder(tmp_path):
    for name, held in (("anna", False), ("bert", True), ("carl", False), ("dora", False)):
        write_case(tmp_path / "robots" / name, holdout=held)
    (tmp_path / "robots" / "notes").mkdir()
    return tmp_path / "robots"


@pytest.fixture
def answers(monkeypatch, explained, no_gap, unexplained):
    """What the diagnosis of each case gives; the calls that were made."""
    given = {"anna": explained, "bert": explained, "carl": no_gap, "dora": unexplained}
    calls = []

    def diagnose(robot, runs, holdout, **options):
        name = runs.parent.name
        calls.append((name, robot, runs, holdout, options))
        if isinstance(given[name], Exception):
            raise given[name]
        return given[name]

    monkeypatch.setattr("mbexport.core.diagnosis.named.diagnose", diagnose)
    return given, calls


def test_cases_are_folders_with_runs_and_a_robot(folder):
    cases = cases_in(folder)
    assert [case.name for case in cases] == ["anna", "bert", "carl", "dora"]
    assert [case.holdout is not None for case in cases] == [False, True, False, False]
    assert len({case.content_hash() for case in cases}) == 4


def test_robots_of_one_make_share_a_database(tmp_path):
    for name in ("a", "b"):
        write_case(tmp_path / name, robot=False)
    with pytest.raises(UsageError, match="has runs and no robot"):
        cases_in(tmp_path)
    (tmp_path / "robot.yaml").write_text("name: one\n")
    assert {case.robot for case in cases_in(tmp_path)} == {tmp_path / "robot.yaml"}


def test_no_fleet_is_one_error(tmp_path):
    with pytest.raises(UsageError, match="holds no case"):
        cases_in(tmp_path)
    with pytest.raises(UsageError, match="is no folder"):
        cases_in(tmp_path / "nowhere")
    with pytest.raises(PluginError, match="backend"):
        plan_fleet(page, backend="nowhere")


def test_one_table_says_what_all_are(folder, answers, tmp_path):
    cases, out = cases_in(folder), tmp_path / "out"
    failures = run_fleet(plan_fleet(page, backends=["mjcf"]), cases, out, workers=1)
    assert failures == {}
    assert [call[0] for call in answers[1]] == ["anna", "bert", "carl", "dora"]
    assert answers[1][1][3] == folder / "bert" / "holdout"
    fleet = fleet_of(cases, out)
    assert fleet.verdicts() == {"no_gap": 1, "explained": 2, "partly_explained": 0, "unexplained": 1, "failed": 0}
    (friction,) = fleet.common()
    assert (friction.effect, friction.at, friction.cases) == ("coulomb_friction", "joint_2", ("anna", "bert"))
    assert friction.medians["torque"] == (12.1, 12.1, 12.1, "N*m")
    write_fleet(fleet, out)
    with (out / "cases.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows] == ["explained", "explained", "no_gap", "unexplained"]
    assert float(rows[0]["shrinks_by"]) == 0.93
    assert rows[0]["joint"] == "joint_2"
    with (out / "findings.csv").open() as file:
        found = list(csv.DictReader(file))
    assert [(row["case"], row["value"], row["may_as_well_be"]) for row in found] == [
        (name, "12.1", "stribeck_friction joint_2; hysteresis joint_2") for name in ("anna", "bert")
    ]
    assert (out / "anna" / "report.html").read_text() == "<p>explained</p>"
    html = (out / "report.html").read_text()
    assert 'href="anna/report.html"' in html
    # who needs a person stands first
    assert html.index("dora") < html.index('href="anna') < html.index('href="carl')


def test_a_stopped_fleet_goes_on_and_makes_the_same(folder, answers, tmp_path):
    cases = cases_in(folder)
    _, calls = answers
    whole = tmp_path / "whole"
    run_fleet(plan_fleet(page), cases, whole, workers=1)
    out = tmp_path / "out"
    run_fleet(plan_fleet(page), cases[:2], out, workers=1)
    calls.clear()
    run_fleet(plan_fleet(page), cases, out, workers=1)
    assert [call[0] for call in calls] == ["carl", "dora"]
    for place in (whole, out):
        write_fleet(fleet_of(cases, place), place)
    files = sorted(path.relative_to(whole) for path in whole.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(out) for path in out.rglob("*") if path.is_file())
    for file in files:
        assert (whole / file).read_bytes() == (out / file).read_bytes(), file


def test_runs_that_changed_are_diagnosed_again(folder, answers, tmp_path):
    _, calls = answers
    run_fleet(plan_fleet(page), cases_in(folder), tmp_path / "out", workers=1)
    (folder / "carl" / "runs" / "run-01" / "data.csv").write_text("t,q_1\n0,1\n")
    calls.clear()
    run_fleet(plan_fleet(page), cases_in(folder), tmp_path / "out", workers=1)
    assert [call[0] for call in calls] == ["carl"]
    run_fleet(plan_fleet(page), cases_in(folder), tmp_path / "out", workers=1, force=True)
    assert len(calls) == 5


def test_a_case_that_fails_is_a_row_and_is_tried_again(folder, answers, tmp_path, explained):
    given, calls = answers
    cases, out = cases_in(folder), tmp_path / "out"
    given["bert"] = DatabaseError("its inertia is no body's")
    given["carl"] = ValueError("nobody thought of this")
    failures = run_fleet(plan_fleet(page), cases, out, workers=1)
    assert failures == {
        "bert": "refused: its inertia is no body's",
        "carl": "refused: ValueError: nobody thought of this",
    }
    fleet = fleet_of(cases, out)
    assert fleet.verdicts()["failed"] == 2
    assert "its inertia is no body" in fleet_page(fleet)
    given["bert"] = explained
    calls.clear()
    run_fleet(plan_fleet(page), cases, out, workers=1)
    assert [call[0] for call in calls] == ["bert", "carl"]
    assert fleet_of(cases, out).verdicts()["failed"] == 1


def test_a_case_that_fails_keeps_no_old_diagnosis(folder, answers, tmp_path):
    given, _ = answers
    out = tmp_path / "out"
    run_fleet(plan_fleet(page), cases_in(folder), out, workers=1)
    (folder / "anna" / "robot" / "robot.yaml").write_text("name: broken\n")
    given["anna"] = DatabaseError("broken")
    run_fleet(plan_fleet(page), cases_in(folder), out, workers=1)
    assert [path.name for path in (out / "anna").rglob("*") if path.is_file()] == ["case.json"]


def test_a_folder_of_another_fleet_is_refused(folder, answers, tmp_path):
    out = tmp_path / "out"
    run_fleet(plan_fleet(page), cases_in(folder), out, workers=1)
    with pytest.raises(UsageError, match="diagnosed with level 'full', not 'rigid'"):
        run_fleet(plan_fleet(page, level="rigid"), cases_in(folder), out, workers=1)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("mine")
    with pytest.raises(UsageError, match="holds no fleet"):
        run_fleet(plan_fleet(page), cases_in(folder), tmp_path / "mine", workers=1)
    with pytest.raises(UsageError, match="--workers"):
        run_fleet(plan_fleet(page), cases_in(folder), out, workers=2, dask="tcp://nowhere:1")


def test_from_the_command_line(folder, answers, tmp_path, monkeypatch):
    monkeypatch.setattr("mbexport.core.report.diagnosis_page.diagnosis_page", page)
    words = ["fleet", str(folder), "-o", str(tmp_path / "out"), "--workers", "1"]
    told = CliRunner().invoke(program, [*words, "--json"])
    assert told.exit_code == 0, told.output
    said = json.loads(told.stdout)
    assert said["verdicts"]["explained"] == 2
    assert said["causes"][0]["cases"] == ["anna", "bert"]
    told = CliRunner().invoke(program, words)
    assert "4 cases, 1 no gap, 2 explained, 1 unexplained" in told.stdout
    assert "2 coulomb_friction joint_2" in told.stdout


def test_where_nothing_could_be_diagnosed_the_answer_is_no(folder, answers, tmp_path):
    for name in answers[0]:
        answers[0][name] = DatabaseError("no robot has these numbers")
    told = CliRunner().invoke(program, ["fleet", str(folder), "-o", str(tmp_path / "out"), "--workers", "1"])
    assert told.exit_code == 1
    assert "anna: no robot has these numbers" in told.stdout


def test_the_work_travels_to_other_processes(folder):
    """What it runs there is what the study's tests hold; it must arrive, and with what makes pages."""
    work, (case, *_) = plan_fleet(diagnosis_page, backends=["mjcf"]), cases_in(folder)
    there, its_case = pickle.loads(pickle.dumps((work, case)))
    assert (there, its_case) == (work, case)
    # no robot, no runs: the same refusal as here
    assert there.run(0, its_case) == work.run(0, case)
    assert there.run(0, its_case).failed == "refused"
