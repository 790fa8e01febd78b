"""Logs of real robots, where they lie beside the project: what examples/real makes of them fits their robots."""

from __future__ import annotations

import importlib.util
import sys
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import mbexport
from mbexport.core.database import load
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.prepare import prepared
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.search import search
from mbexport.core.diagnosis.state import Search
from mbexport.core.importing import import_model
from mbexport.core.kinematics import dynamics
from mbexport.core.recording import noise_of, read_runs

ROOT = Path(__file__).resolve().parents[2]
REAL = ROOT / "examples" / "real"
DATA = ROOT.parent / "shared" / "data"


def data(*parts: str) -> Path:
    path = DATA.joinpath(*parts)
    if not path.exists():
        # measured runs of other people's robots are no part of the project
        pytest.skip(f"there is no {path.relative_to(ROOT.parent)} beside the project")
    return path


def converter(name: str):
    spec = importlib.util.spec_from_file_location(name, REAL / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def head(source: Path, target: Path, lines: int) -> None:
    """The first lines of a text: as much of a long log as a test needs."""
    with source.open(encoding="utf-8") as file:
        target.write_text("".join(islice(file, lines)), encoding="utf-8")


def torques(run, database):
    """Measured and nominal torques, speeds and accelerations of a run, shapes (m, n)."""
    ready = prepared(run)
    whole = slice(ready.edge, len(ready.t) - ready.edge)
    q, dq, ddq = (np.ascontiguousarray(part[whole]) for part in (ready.q, ready.dq, ready.ddq))
    nominal = dynamics(robot_of(database, "rigid", run)).inverse_dynamics(q, dq, ddq)
    return ready.measured["tau"][whole], nominal, dq, ddq


def rubbed(tau, nominal, dq, ddq):
    """What is left per joint after viscous, Coulomb, rotor and offset are fitted, and their values, shape (4, n)."""
    left, values = [], []
    for i in range(tau.shape[1]):
        fast = 0.01 * np.abs(dq[:, i]).max()
        columns = np.column_stack([dq[:, i], np.tanh(dq[:, i] / fast), ddq[:, i], np.ones(len(dq))])
        fit = np.linalg.lstsq(columns, tau[:, i] - nominal[:, i], rcond=None)[0]
        values.append(fit)
        left.append(tau[:, i] - nominal[:, i] - columns @ fit)
    return np.column_stack(left), np.array(values).T


def relative(left, tau):
    return float(np.linalg.norm(left) / np.linalg.norm(tau))


def test_the_tx40(tmp_path):
    log = data("staubli_tx40")
    for name in ("pos_read_data.csv", "curr_data.csv"):
        head(log / "data" / name, tmp_path / name, 15001)
    converter("staubli_tx40").convert(tmp_path, tmp_path / "runs", 1)
    database = import_model(log / "urdf" / "tx40_mdh_modified.urdf", repair=True).database
    (run,) = read_runs([tmp_path / "runs"], database)
    assert run.left_out == ()
    assert (noise_of(run, "q").sigma < 1e-4).all()
    tau, nominal, dq, ddq = torques(run, database)
    left, values = rubbed(tau, nominal, dq, ddq)
    assert relative(tau - nominal, tau) > 0.7
    assert relative(left, tau) < 0.15
    # published: viscous and Coulomb friction of the first four axes
    assert values[0, :4] == pytest.approx([8.05, 5.53, 1.97, 1.11], rel=0.15)
    assert values[1, :4] == pytest.approx([7.14, 8.26, 6.34, 2.48], rel=0.2)


def test_the_servo_pendulums(tmp_path):
    converter("servo_pendulums").convert(data("bam"), tmp_path)
    database = load(tmp_path / "xl330" / "robot")
    (run,) = read_runs([tmp_path / "xl330" / "runs" / "sin_time_square-kp100"], database)
    assert {item.reason for item in run.left_out} == {"jitter"}
    error = run.signals["q_cmd"] - run.signals["q"]
    asked = run.control.kp[0] * error
    # what the servo's controller makes of the error is what it reports
    assert relative(run.signals["tau"] - 0.98 * asked, run.signals["tau"]) < 0.03
    (slow,) = read_runs([tmp_path / "sts3250" / "runs" / "sin_sin-kp32"], load(tmp_path / "sts3250" / "robot"))
    assert not slow.has("tau")


def test_what_a_servo_rubs_is_found(tmp_path):
    converter("servo_pendulums").convert(data("bam"), tmp_path)
    servo = tmp_path / "xl330"
    database = load(servo / "robot")
    asked = problem(database, "rigid", read_runs([servo / "runs" / "sin_time_square-kp400"], database))
    state = Search(asked, whitening(asked))
    state.begin()
    found = {item.effect: item.row.values for item in search(state).found}
    # on this run and another, over all of a diagnosis: 0.0469 N m s/rad and 0.44
    assert found["viscous_friction"]["coefficient"] == pytest.approx(0.047, rel=0.1)
    assert found["load_friction"]["coefficient"] == pytest.approx(0.44, rel=0.25)


def test_the_kr300(tmp_path):
    converter("kuka_kr300").convert(data("weigand_kuka", "data", "recorded_trajectories"), tmp_path, (150.0, 0.1))
    database = load(REAL / "kr300")
    (run,) = read_runs([tmp_path / "B"], database)
    assert {item.reason for item in run.left_out} == {"delay"}
    # behind stiff gears: 3 ms of lag at 0.4 rad/s would be 1.2 mrad
    apart = (run.signals["q_link"] - run.signals["q"])[:, :3]
    assert np.nanmax(np.abs(apart - np.nanmedian(apart, axis=0))) < 6.0e-4
    tau, nominal, dq, ddq = torques(run, database)
    for i in (0, 2, 3, 4):
        columns = np.column_stack([nominal[:, i], dq[:, i], np.sign(dq[:, i]), ddq[:, i], np.ones(len(dq))])
        assert 0.5 < np.linalg.lstsq(columns, tau[:, i], rcond=None)[0][0] < 1.5


def test_the_panda(tmp_path):
    log = data("panda_gaz", "matlab", "data", "Exciting_Traj", "Trajectory_1", "rbt_log")
    rows = 6000
    for name, width in (("time", 1), ("positions", 7), ("velocity", 7), ("torques", 7)):
        head(log / f"exciting_traj_{name}.txt", tmp_path / f"exciting_traj_{name}.txt", rows * width)
    converter("franka_panda").convert(tmp_path, tmp_path / "runs", 1)
    database = load(REAL / "panda")
    (run,) = read_runs([tmp_path / "runs"], database)
    assert np.abs(np.diff(run.t) * 1000.0 - np.round(np.diff(run.t) * 1000.0)).max() < 1e-6
    assert (noise_of(run, "q").sigma < 2e-5).all()
    tau, nominal, dq, ddq = torques(run, database)
    left, _ = rubbed(tau, nominal, dq, ddq)
    assert relative(tau - nominal, tau) < 0.06
    assert relative(left, tau) < 0.035


def test_the_cycloidal_actuator(tmp_path):
    log = data("jelmer_cycloidal", "test_data", "2024-07-19__11-35-25__torqueramp__split_onyx 8pre1.csv.gz")
    converter("cycloidal_actuator").convert(log, tmp_path)
    (run,) = read_runs([tmp_path / "runs" / "play-3"], load(tmp_path / "robot"))
    assert run.locked == (1,)
    q, tau = run.signals["q"][:, 0], run.signals["tau"][:, 0]
    # published for this preload: 0.30 degrees of play
    assert np.degrees(np.ptp(q[np.abs(tau) < 0.3])) == pytest.approx(0.30, abs=0.03)


def test_a_preloaded_gear_gives_as_a_spring_and_not_by_play(tmp_path):
    log = data("jelmer_cycloidal", "test_data", "2024-07-19__11-35-25__torqueramp__split_onyx 8pre1.csv.gz")
    converter("cycloidal_actuator").convert(log, tmp_path)
    runs = [tmp_path / "runs" / f"play-{k}" for k in (1, 2, 3)]
    diagnosis = mbexport.diagnose(tmp_path / "robot", runs[:2], holdout=runs[2:])
    assert diagnosis.verdict == "explained"
    assert {finding.effect for finding in diagnosis.which} == {"joint_compliance", "hysteresis"}
    (spring,) = (finding for finding in diagnosis.which if finding.effect == "joint_compliance")
    # least squares on the same ramps: 776 N m/rad with Coulomb friction alone beside it
    assert 500.0 < spring.parameters["stiffness"].value < 776.0
