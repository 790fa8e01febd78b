"""What is compared: nothing that smoothing smears, and a delay to a part of a tick."""

from dataclasses import replace

import numpy as np
import pytest
from pendulums import KD, KP, command, pendulum_run
from scipy.spatial.transform import Rotation

from mbexport.core.database import load
from mbexport.core.diagnosis import prepare
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.search import Search, search
from mbexport.core.kinematics import kinematics

DATABASE = load("pendulum")


def left_by_nothing(runs):
    """Mean square that a perfect model leaves in each channel, in units of noise."""
    asked = problem(DATABASE, "rigid", runs)
    left = asked.residual({})
    return [float(np.mean(left[c.first : c.last] ** 2)) for c in asked.evidence.channels]


def without(run, begin, end):
    """The run with its rows between two times missing."""
    kept = (run.t < begin) | (run.t > end)
    return replace(run, t=run.t[kept], signals={name: values[kept] for name, values in run.signals.items()})


def test_a_hole_in_the_record_is_no_gap_of_the_model():
    assert max(left_by_nothing([without(pendulum_run(), 1.8, 2.0)])) < 1.5


def test_a_run_that_ends_in_motion_is_no_gap_of_the_model(monkeypatch):
    run = pendulum_run(duration=3.8)
    assert abs(float(command(3.8)[1])) > 0.5
    assert max(left_by_nothing([run])) < 1.5
    # the ends are what this is about: kept, they show
    monkeypatch.setattr(prepare, "EDGE", 0.1)
    assert max(left_by_nothing([run])) > 3.0


def test_a_delay_is_found_to_a_part_of_a_tick():
    late = 0.0044
    past: dict[int, float] = {}

    def late_torque(t, q, dq):
        """What takes the torque away that is held now and gives the one of a while ago instead."""
        tick = int(t * 1000.0 + 1.0e-6)
        asked = command(tick / 1000.0)
        past.setdefault(tick, KP * (float(asked[0]) - q) + KD * (float(asked[1]) - dq))
        before = past.get(int(np.floor((t - late) * 1000.0 + 1.0e-6)), past[0])
        return past[tick] - before

    runs: list = []
    for seed in (1, 2):
        past.clear()
        run = pendulum_run(against=late_torque, seed=seed)
        # its torque is the controller's, not what acted
        runs.append(replace(run, signals={k: v for k, v in run.signals.items() if k != "tau"}))
    asked = problem(DATABASE, "rigid", runs)
    state = Search(asked, whitening(asked))
    state.begin()
    found = search(state).found
    assert [item.effect for item in found] == ["delay"]
    assert found[0].row.values["time"] == pytest.approx(late, abs=6e-4)


def test_where_the_tool_points_is_compared():
    """An axis that leans turns the tool and moves it nowhere: positions alone would not see it."""
    run = pendulum_run("motion")
    half = 0.5 * command(run.t)[0]
    # the built-in pendulum's tool in its base, by its own frames
    base = kinematics(robot_of(DATABASE, "rigid", run)).tool_in_base(np.zeros((1, 1)))[0, :3, :3]
    random = np.random.default_rng(3)
    axis = kinematics(robot_of(DATABASE, "rigid", run)).joints_in_base(np.zeros((1, 1)))[0, 0, :3, 2]
    swung = Rotation.from_rotvec(np.outer(2.0 * half, axis)) * Rotation.from_matrix(base)

    def left(lean):
        turn = Rotation.from_rotvec(random.normal(size=(len(run.t), 3)) * 1e-4) * Rotation.from_rotvec(lean) * swung
        signals = run.signals | {"ee_rot": np.roll(turn.as_quat(), 1, axis=1)}
        asked = problem(
            DATABASE, "rigid", [replace(run, signals=signals, noise=run.noise | {"ee_rot": np.array([1e-4])})]
        )
        rest = asked.residual({})
        return [float(np.mean(rest[c.first : c.last] ** 2)) for c in asked.evidence.channels if c.signal == "ee_rot"]

    assert len(left(np.zeros(3))) == 3
    assert max(left(np.zeros(3))) < 2.0
    assert max(left(np.array([1e-3, 0.0, 0.0]))) > 50.0
