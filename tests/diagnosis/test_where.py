"""Where a gap lies, on residuals that are written down and on a pendulum that rubs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pendulums import pendulum_run

from mbexport.core.database import load
from mbexport.core.diagnosis.compared import residuals
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import Noise, noise_floor
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.diagnosis.where import explained_by, where

DATABASE = load("pendulum")


def rub(t, q, dq):
    return 0.3 * np.tanh(dq / 2e-3)


def test_dry_friction_follows_the_direction():
    run = pendulum_run("pd", rub)
    robot = robot_of(DATABASE, "rigid", run)
    left = residuals(run, resimulated(robot, robot, run, "mjcf"), robot)
    found = where([left], [noise_floor(DATABASE, "rigid", run)], [run], robot)
    assert found.joints["joint_1"].share == pytest.approx(1.0)
    assert found.depends_on[0].variable in {"sign(dq_1)", "dq_1"}
    by_name = {one.variable: one.strength for one in found.depends_on}
    assert by_name["sign(dq_1)"] > 0.55
    assert by_name["sign(dq_1)"] > by_name.get("q_1", 0.0) + 0.2
    assert found.signals["tau"].unit == "N*m"
    assert found.signals["q"].gap > 10.0
    assert sum(one.share for one in found.when) == pytest.approx(1.0)
    assert sum(one.share for one in found.bands) == pytest.approx(1.0)


def noise_like(left):
    ones = {name: np.ones(values.shape[1]) for name, values in left.items()}
    return Noise(ones, {name: 0.0 * one for name, one in ones.items()}, ones, ones)


def two_joints():
    """A run of two joints that move out of step, without any model."""
    run = pendulum_run("pd", duration=8.0)
    t = run.t
    signals = {name: np.column_stack([values[:, 0], np.sin(1.3 * t)]) for name, values in run.signals.items()}
    return replace(run, signals=signals, noise={"q": np.full(2, 2e-5), "tau": np.full(2, 0.01)})


def test_shares_phases_and_bands_of_a_known_residual():
    run = two_joints()
    arm = robot_of(load("planar2r"), "rigid", replace(run, payload={}))
    random = np.random.default_rng(1)
    left = {"tau": random.normal(size=(len(run.t), 2))}
    left["tau"][:, 1] += 6.0 * np.sin(2 * np.pi * 5.0 * run.t)
    found = where([left], [noise_like(left)], [run], arm)
    assert found.joints["joint_2"].share > 0.98
    low, high = found.joints["joint_2"].ci95
    assert low < np.sqrt(19.0) < high
    assert high - low < 1.0
    assert max(found.bands, key=lambda band: band.share).from_hz == 3.0
    # 5 Hz is none of the motion's own
    assert all(one.strength < 0.2 for one in found.depends_on)


def test_noise_alone_depends_on_nothing():
    run = two_joints()
    arm = robot_of(load("planar2r"), "rigid", replace(run, payload={}))
    left = {"tau": np.random.default_rng(2).normal(size=(len(run.t), 2))}
    found = where([left], [noise_like(left)], [run], arm)
    assert found.signals["tau"].gap < 0.3
    assert all(one.strength < 0.3 for one in found.depends_on)


def test_chance_is_taken_off():
    x = np.cumsum(np.random.default_rng(3).normal(size=3000))
    y = 4.0 * np.random.default_rng(4).normal(size=3000)
    assert explained_by([(x, y)], discrete=False) < 0.03
    assert explained_by([(x, 4.0 * np.sin(x / 10.0))], discrete=False) > 0.8
