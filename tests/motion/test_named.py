"""Motions by name: the database's, the built-in ones, and files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mbexport.core.database import Database, FrozenMap, MotionTable, write
from mbexport.core.errors import RunFileError, UsageError
from mbexport.core.motion import excitation, from_table, motion_named, motion_names
from mbexport.core.motion.tables import law_of_table, table_of_law
from mbexport.core.representation import Robot

TABLE = MotionTable((0.0, 1.0, 3.0), ((0.0, 0.1), (0.5, 0.2), (0.3, 0.4)), ((0.0, 0.0), (0.1, 0.2), (0.0, 0.0)))


def test_the_databases_own_go_first(database: Callable[[str], Database], rigid: Callable[[str], Robot]) -> None:
    mine = replace(database("planar2r"), motions=FrozenMap({"greca": TABLE, "wave": TABLE}))
    assert motion_names(mine) == ("greca", "wave", "excitation", "hold")
    law = motion_named(rigid("planar2r"), "greca", mine)
    assert np.array_equal(law.at(1.0)[0], [0.5, 0.2])
    assert np.array_equal(law.at(1.0)[1], [0.1, 0.2])
    shipped = motion_named(rigid("imece2013"), "greca", database("imece2013"))
    assert len(shipped.coefficients) == 6  # speeds and accelerations are there


def test_built_in(rigid: Callable[[str], Robot]) -> None:
    robot = rigid("pendulum")
    assert np.array_equal(motion_named(robot, "excitation").coefficients, excitation(robot).coefficients)
    still = motion_named(robot, "hold")
    assert np.array_equal(still.at(0.5)[0], robot.home())
    assert still.duration == 1.0


def test_unknown_lists_the_known(database: Callable[[str], Database], rigid: Callable[[str], Robot]) -> None:
    with pytest.raises(UsageError, match=r"no motion 'grecca'.*'greca'\? Known: greca, excitation, hold, a"):
        motion_named(rigid("imece2013"), "grecca", database("imece2013"))


def test_motion_table_from_a_file(
    tmp_path: Path, database: Callable[[str], Database], rigid: Callable[[str], Robot]
) -> None:
    write(replace(database("planar2r"), motions=FrozenMap({"wave": TABLE})), tmp_path / "robot")
    law = motion_named(rigid("planar2r"), str(tmp_path / "robot" / "motions" / "wave.dat"))
    assert np.array_equal(law.coefficients, law_of_table(TABLE).coefficients)
    (tmp_path / "bad.dat").write_text("t[s] q1[rad] q2[rad]\n0 0 0\n0 1 1\n")
    with pytest.raises(RunFileError, match=r"bad\.dat:3.*times must grow"):
        motion_named(rigid("planar2r"), str(tmp_path / "bad.dat"))


def test_table_of_law_and_back() -> None:
    law = from_table(TABLE.t, TABLE.q, TABLE.dq, TABLE.dq)
    again = law_of_table(table_of_law(law))
    t = np.linspace(0, 3, 50)
    for got, want in zip(again.at(t), law.at(t), strict=True):
        assert np.allclose(got, want, rtol=0, atol=1e-13)


def run_text(columns: dict[str, np.ndarray]) -> str:
    rows = np.column_stack(list(columns.values()))
    return ",".join(columns) + "\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())


def recorded() -> dict[str, np.ndarray]:
    t = 5.0 + np.arange(0, 1, 0.01)
    columns = {"t": t}
    for i, w in enumerate((1.0, 2.0), start=1):
        columns[f"q_cmd_{i}"] = np.sin(w * t)
        columns[f"dq_cmd_{i}"] = w * np.cos(w * t)
        columns[f"q_{i}"] = np.sin(w * t) + 0.01
    return columns


def test_run_as_a_motion(tmp_path: Path, rigid: Callable[[str], Robot]) -> None:
    """log.md: cubic Hermite where dq_cmd is there, else Akima; measured positions where nothing was commanded."""
    robot, columns = rigid("planar2r"), recorded()
    folder = tmp_path / "run-01"
    folder.mkdir()
    (folder / "data.csv").write_text(run_text(columns))
    law = motion_named(robot, str(folder))
    assert law.knots[0] == 0.0
    assert len(law.coefficients) == 4
    t = np.linspace(0, 0.99, 300)
    want = np.column_stack([np.sin(w * (5.0 + t)) for w in (1.0, 2.0)])
    assert np.allclose(law.at(t)[0], want, rtol=0, atol=1e-8)
    assert np.array_equal(law.at(law.knots[:-1])[0][:, 1], columns["q_cmd_2"][:-1])  # every digit is read

    without_speeds = {name: values for name, values in columns.items() if not name.startswith("dq")}
    (tmp_path / "a.csv").write_text(run_text(without_speeds))
    akima = motion_named(robot, str(tmp_path / "a.csv"))
    commanded = np.column_stack([columns["q_cmd_1"], columns["q_cmd_2"]])
    assert np.array_equal(akima.coefficients, from_table(akima.knots, commanded).coefficients)

    measured = {name: values for name, values in columns.items() if "cmd" not in name}
    (tmp_path / "m.csv").write_text(run_text(measured))
    assert np.allclose(motion_named(robot, str(tmp_path / "m.csv")).at(t)[0], want + 0.01, rtol=0, atol=1e-5)


def test_run_in_parquet(tmp_path: Path, rigid: Callable[[str], Robot]) -> None:
    pytest.importorskip("pyarrow")
    import pandas as pd

    pd.DataFrame(recorded()).to_parquet(tmp_path / "data.parquet")
    law = motion_named(rigid("planar2r"), str(tmp_path / "data.parquet"))
    assert np.array_equal(motion_named(rigid("planar2r"), str(tmp_path)).coefficients, law.coefficients)
    holed = pd.DataFrame(recorded())
    holed.loc[3, "q_cmd_2"] = np.nan
    holed.to_parquet(tmp_path / "holed.parquet")
    with pytest.raises(RunFileError, match="column q_cmd_2: row 4 holds no number"):
        motion_named(rigid("planar2r"), str(tmp_path / "holed.parquet"))
    (tmp_path / "text.parquet").write_text("no parquet")
    with pytest.raises(RunFileError, match=r"text\.parquet: is no table of numbers"):
        motion_named(rigid("planar2r"), str(tmp_path / "text.parquet"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda text: text.replace("q_cmd_2", "x").replace("q_2", "y"),
            r"csv, column q_2: there is no column q_2",
        ),
        (lambda text: text.replace("t,", "time,", 1), "no column t"),
        (
            lambda text: text.replace("\n5.02,", "\n5.02,oops", 1),
            r"csv:4, column q_cmd_1, value 'oops.*no number",
        ),
        (lambda text: text.replace("\n5.02,", "\n5.01,", 1), r"times must grow: row 3"),
        (lambda text: text.replace("q_1", "q_cmd_3", 1), "a joint more than the robot's 2"),
        (lambda text: "", "no column t"),
        (lambda text: text + "1,2,3\n", r"csv:102: the row has 3 cells, the header names 7 columns"),
        (lambda text: text.split("\n")[0], "two times or more, not 0"),
    ],
)
def test_broken_runs(tmp_path: Path, rigid: Callable[[str], Robot], change: Callable[[str], str], message: str) -> None:
    (tmp_path / "data.csv").write_text(change(run_text(recorded())))
    with pytest.raises(RunFileError, match=message):
        motion_named(rigid("planar2r"), str(tmp_path / "data.csv"))


def test_folder_without_a_run(tmp_path: Path, rigid: Callable[[str], Robot]) -> None:
    with pytest.raises(RunFileError, match=r"a run's folder has a data\.csv"):
        motion_named(rigid("planar2r"), str(tmp_path))
