"""Runs from disk: log.md's own names, foreign columns, the faults of files."""

from __future__ import annotations

import math
import shutil

import numpy as np
import pytest

from mbexport.core.errors import RunFileError
from mbexport.core.recording import read_run, read_runs

T = 5.0 + np.arange(400) * 0.005
PD = "control: {mode: pd, kp: [50, 40], kd: [5, 4], rate: 500}\n"
UNKNOWN = "control: {mode: unknown}\n"


def joints(**signals):
    """Columns of two joints that swing; each signal is a factor, and None leaves it out."""
    columns = {"t": T}
    for i, w in enumerate((1.0, 2.0), start=1):
        values = {
            "q_cmd": np.sin(w * T),
            "dq_cmd": w * np.cos(w * T),
            "q": np.sin(w * T) + 0.01,
            "tau": 10.0 * np.cos(3.0 * w * T),
        }
        columns |= {f"{name}_{i}": column for name, column in values.items()}
    return {
        name: column for name, column in columns.items() if name.rpartition("_")[0] not in signals.get("without", ())
    }


def test_a_run_as_log_md_has_it(write, database):
    columns = joints()
    log = (
        PD + "noise: {q: 1.0e-5, tau: [0.5, 0.25], ee: 1.0e-4, ee_rot: 1.0e-3}\nlocked: [2]\n"
        "payload: {mass: 2, z: 0.1}\nsource: a bench\n"
    )
    run = read_run(write(columns, log), database("planar2r"))
    assert (run.name, run.n, run.locked, run.source, run.left_out) == ("run", 2, (2,), "a bench", ())
    assert run.control.kp == (50.0, 40.0)
    assert run.payload["mass"] == 2.0
    assert run.t[0] == 0.0
    assert run.duration == pytest.approx(399 * 0.005)
    assert run.rate == pytest.approx(200.0)
    assert np.array_equal(run.signals["q"], np.column_stack([columns["q_1"], columns["q_2"]]))  # every digit
    assert {name: values.tolist() for name, values in run.noise.items()} == {
        "q": [1e-5, 1e-5],
        "tau": [0.5, 0.25],
        "ee": [1e-4] * 3,
        "ee_rot": [1e-3],
    }
    assert run.has("tau")
    assert not run.has("q_link")


def test_the_command_is_hermite_with_speeds_and_akima_without(write, database):
    law = read_run(write(joints(), PD), database("planar2r")).motion()
    between = np.linspace(0.0, 1.99, 333)
    want = np.column_stack([np.sin(w * (5.0 + between)) for w in (1.0, 2.0)])
    assert len(law.coefficients) == 4
    assert np.allclose(law.at(between)[0], want, rtol=0, atol=1e-9)
    speedless = read_run(write(joints(without=("dq_cmd",)), PD, "akima"), database("planar2r")).motion()
    assert np.allclose(speedless.at(between)[0], want, rtol=0, atol=1e-5)
    assert not np.array_equal(speedless.coefficients, law.coefficients)
    measured = read_run(write(joints(without=("q_cmd", "dq_cmd")), UNKNOWN, "measured"), database("planar2r")).motion()
    assert np.allclose(measured.at(between)[0], want + 0.01, rtol=0, atol=1e-5)


def test_foreign_columns_are_mapped(write, database):
    """value = sign * column / gear, in SI, + offset; sums of columns; time from a rate."""
    columns = joints()
    foreign = {
        "pos_a": np.degrees(-(columns["q_1"] - 0.3)) * 50.0,
        "m5": columns["q_2"] - 0.5 * columns["tau_1"],
        "m6": columns["tau_1"],
        "current": columns["tau_1"] / 0.07,
        "comment": np.zeros(400),
    }
    log = UNKNOWN + (
        "signals:\n"
        "  t: {rate: 200}\n"
        "  q_1: {column: pos_a, unit: deg, sign: -1, gear: 50, offset: 0.3}\n"
        "  q_2: {column: {m5: 1.0, m6: 0.5}}\n"
        "  tau_1: {column: current, gear: 14.285714285714286}\n"
    )
    run = read_run(write(foreign, log), database("planar2r"))
    for i in range(2):
        assert np.allclose(run.signals["q"][:, i], columns[f"q_{i + 1}"], rtol=0, atol=1e-12)
    assert np.allclose(run.signals["tau"][:, 0], columns["tau_1"], rtol=1e-12)
    # the second joint has no such channel, which is no fault
    assert np.isnan(run.signals["tau"][:, 1]).all()
    assert run.left_out == ()
    assert np.allclose(run.t, T - 5.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("delay", [0.015, 0.0031, -0.0031])
def test_a_late_channel_is_put_back(write, database, delay):
    columns = joints()
    late = columns | {"q_link_1": np.sin(T - delay)}
    log = UNKNOWN + f"signals: {{q_link_1: {{column: q_link_1, delay: {delay!r}}}}}\n"
    run = read_run(write(late, log), database("planar2r"))
    known = np.isfinite(run.signals["q_link"][:, 0])
    assert np.allclose(run.signals["q_link"][known, 0], np.sin(T[known]), rtol=0, atol=1e-8)
    (lost,) = run.left_out
    assert (lost.channel, lost.reason) == ("q_link_1", "delay")
    assert lost.samples == (~known).sum() == math.ceil(abs(delay) / 0.005)


def test_the_tool_comes_with_unit_quaternions(write, database):
    columns = joints() | {f"ee_{axis}": np.cos(T) for axis in "xyz"}
    columns |= {"ee_qw": 2.0 * np.cos(T), "ee_qx": 2.0 * np.sin(T), "ee_qy": 0.0 * T, "ee_qz": 0.0 * T}
    run = read_run(write(columns, PD), database("planar2r"))
    assert run.signals["ee"].shape == (400, 3)
    assert np.allclose(run.signals["ee_rot"][:, 0], np.cos(T), rtol=0, atol=1e-15)


def test_parquet_and_a_file_with_yaml_beside_it(write, database, tmp_path):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    csv = read_run(write(joints(), PD), database("planar2r"))
    pd.DataFrame(joints()).to_parquet(tmp_path / "swing.parquet")
    (tmp_path / "swing.yaml").write_text(PD)
    run = read_run(tmp_path / "swing.parquet", database("planar2r"))
    assert run.name == "swing"
    for name, values in run.signals.items():
        assert np.array_equal(values, csv.signals[name])
    assert read_run(tmp_path / "run" / "data.csv", database("planar2r")).name == "data"


def test_a_folder_of_runs_is_its_runs(write, database, tmp_path):
    for name in ("b", "a"):
        write(joints(), PD, f"all/{name}")
    shutil.copy(tmp_path / "all" / "a" / "data.csv", tmp_path / "all" / "c.csv")
    (tmp_path / "all" / "c.yaml").write_text(PD)
    (tmp_path / "all" / "notes").mkdir()
    assert [run.name for run in read_runs([tmp_path / "all"], database("planar2r"))] == ["a", "b", "c"]
    with pytest.raises(RunFileError, match="given twice"):
        read_runs([tmp_path / "all", tmp_path / "all" / "b"], database("planar2r"))
    with pytest.raises(RunFileError, match="notes: holds no run"):
        read_runs([tmp_path / "all" / "notes"], database("planar2r"))
    with pytest.raises(RunFileError, match="there is no such run"):
        read_runs([tmp_path / "nothing"], database("planar2r"))


@pytest.mark.parametrize(
    ("log", "message"),
    [
        ("control: {mode: pd}\n", "mode pd needs kp"),
        (UNKNOWN + "sgnals: {}\n", r"log\.yaml:2, column sgnals: unknown key \(did you mean signals\?\)"),
        (UNKNOWN + "locked: [3]\n", "the robot has joints 1 to 2"),
        (UNKNOWN + "signals: {q_3: {column: q_1}}\n", "there is no joint 3"),
        (UNKNOWN + "signals: {speed: {column: q_1}}\n", r"column signals\.speed: is no signal"),
        (UNKNOWN + "signals: {q_1: {column: q_l}}\n", r"value 'q_l'.*did you mean q_\d"),
        (UNKNOWN + "signals: {q_1: {column: q_1, unit: kg}}\n", "does not convert to rad"),
        (UNKNOWN + "signals: {q_1: {column: q_1, unit: dgr}}\n", "is no unit"),
        (UNKNOWN + "signals: {q_1: {column: q_1, sign: 2}}\n", "must be 1 or -1"),
        (UNKNOWN + "signals: {q_1: {column: q_1, gear: 0}}\n", "must not be 0"),
        (UNKNOWN + "signals: {q_1: {column: q_1, ofset: 0}}\n", "unknown key; known are column"),
        (UNKNOWN + "signals: {t: {rate: 0}}\n", "number of Hz above 0"),
        (UNKNOWN + "signals: {q_1: q_1}\n", "must be a mapping"),
        ("control: {mode: torque}\n", "mode torque needs tau_cmd_1"),
    ],
)
def test_wrong_logs(write, database, log, message):
    with pytest.raises(RunFileError, match=message):
        read_run(write(joints(), log), database("planar2r"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("\n5.01,", "\n5.01,oops", 1), r"data\.csv:4, column q_cmd_1, value 'oops"),
        (lambda text: text.replace("\n5.01,", "\n4.99,", 1), r"data\.csv:4, column t, value '4\.99'.*back in row 3"),
        (lambda text: text + "1,2\n", r"data\.csv:402: the row has 2 cells, the header names 9"),
        (lambda text: text.replace("t,", "time,", 1), "there is no column t; where the file has no time"),
        (lambda text: text.replace("q_2", "q_3"), "there is no joint 3"),
        (lambda text: text.replace(",q_2", ",p_2"), "column q_2: a run of 2 joints has the measured positions"),
        (lambda text: text.replace("tau_2", "tau_1"), "column tau_1: the header names this column twice"),
        (lambda text: text.split("\n")[0] + "\n", "two rows or more with a time, not 0"),
        (lambda text: "", "no column t"),
        (lambda text: text.replace("tau", "torque").replace("q_cmd", "p_cmd"), "a run has one of q_cmd, tau_cmd"),
        (lambda text: "\xff\xfe" + text, r"data\.csv"),
    ],
)
def test_wrong_data(write, database, change, message):
    folder = write(joints(), UNKNOWN)
    text = (folder / "data.csv").read_text()
    (folder / "data.csv").write_bytes(change(text).encode("latin-1"))
    with pytest.raises(RunFileError, match=message):
        read_run(folder, database("planar2r"))


def test_files_that_are_not_there(write, database, tmp_path):
    folder = write(joints(), PD)
    (folder / "log.yaml").unlink()
    with pytest.raises(RunFileError, match=r"log\.yaml: there is no such file"):
        read_run(folder, database("planar2r"))
    (folder / "log.yaml").write_text(PD)
    (folder / "data.parquet").write_text("")
    with pytest.raises(RunFileError, match="a run has one of them"):
        read_run(folder, database("planar2r"))
    with pytest.raises(RunFileError, match="there is no such run"):
        read_run(tmp_path / "x", database("planar2r"))
