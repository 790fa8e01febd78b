"""The noise of a channel, against runs of robots that are off within their tolerances or not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pendulums import INERTIA, NOISE, WEIGHT, pendulum_run

from mbexport.core.database import FrozenMap, Tolerance, load
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor, perturbed, significance, significant
from mbexport.core.diagnosis.resimulate import residuals, resimulated
from mbexport.core.effects import EffectRow

DATABASE = load("pendulum")


def left_of(run):
    robot = robot_of(DATABASE, "rigid", run)
    return residuals(run, resimulated(robot, robot, run, "mjcf"))


def test_sensors_alone_where_nothing_is_off():
    floor = noise_floor(DATABASE, "rigid", pendulum_run("pd"))
    assert floor.sigma["q"] == pytest.approx([NOISE["q"]], rel=1e-3)
    assert floor.sigma["tau"] == pytest.approx([NOISE["tau"]], rel=1e-3)


def test_a_controller_that_sees_its_sensors_noise_makes_torque_of_it():
    run = pendulum_run("pd")
    scatter = 0.05 * np.random.default_rng(8).normal(size=run.signals["tau"].shape)
    shaken = replace(run, signals={**run.signals, "tau": run.signals["tau"] + scatter})
    # stated is what the sensor adds, recorded is five times as much
    floor = noise_floor(DATABASE, "rigid", shaken).sigma["tau"][0]
    assert floor == pytest.approx(np.hypot(0.05, NOISE["tau"]), rel=0.3)


def test_a_mass_that_is_a_percent_off_weighs_a_percent_of_the_weight():
    run = pendulum_run("motion")
    loose = replace(DATABASE, tolerance=Tolerance(mass=0.01))
    found = noise_floor(loose, "rigid", run).tolerance["tau"][0]
    q = run.signals["q"][:, 0]
    x = run.t
    ddq = 0.6 * 2.1**2 * np.cos(2.1 * x) + 0.25 * 5.3**2 * np.cos(5.3 * x)
    # the moment about the center of mass is not the mass's
    exact = 0.01 * ((INERTIA - 8.0e-3) * ddq + WEIGHT * np.sin(q))
    assert found == pytest.approx(np.sqrt(np.mean(exact**2)), rel=0.02)


def test_a_soft_controller_gives_way_to_what_is_off():
    run = pendulum_run("pd")
    loose = replace(DATABASE, tolerance=Tolerance(mass=0.05))
    floor = noise_floor(loose, "rigid", run)
    robot = robot_of(DATABASE, "rigid", run)
    heavier = next(perturbed(robot, Tolerance(mass=0.05)))
    one = resimulated(robot, robot, run, "mjcf")
    other = resimulated(heavier, robot, run, "mjcf")
    for name in ("q", "tau"):
        moved = np.sqrt(np.mean(np.square(other[name] - one[name])))
        assert floor.tolerance[name][0] == pytest.approx(moved, rel=0.15)


def test_noise_is_no_gap_and_a_faint_rub_is_one():
    quiet = [pendulum_run("pd", seed=seed) for seed in range(3)]
    floors = [noise_floor(DATABASE, "rigid", run) for run in quiet]
    assert significance([left_of(run) for run in quiet], floors) > 0.05
    rubbed = pendulum_run("pd", lambda t, q, dq: 0.01 * dq)
    assert significant(left_of(rubbed), noise_floor(DATABASE, "rigid", rubbed)) < 1e-3


def test_what_a_tolerance_explains_is_no_gap():
    run = pendulum_run("pd")
    true = robot_of(DATABASE, "rigid", run, {"payload": (EffectRow(0, FrozenMap(_body(0.02))),)})
    tight = robot_of(DATABASE, "rigid", run)
    gap = residuals(run, resimulated(true, tight, run, "mjcf"))
    assert significant(gap, noise_floor(DATABASE, "rigid", run)) < 1e-6
    assert significant(gap, noise_floor(replace(DATABASE, tolerance=Tolerance(mass=0.03)), "rigid", run)) > 0.05


def test_unknown_control_knows_what_derivatives_do_to_noise():
    run = pendulum_run("unknown", rate=1000.0)
    sigma = noise_floor(DATABASE, "rigid", run).sigma["tau"][0]
    left = left_of(run)["tau"]
    assert sigma == pytest.approx(np.sqrt(np.nanmean(np.square(left))), rel=0.3)


def test_torque_control_knows_how_a_start_drifts():
    run = pendulum_run("torque", rate=1000.0)
    sigma = noise_floor(DATABASE, "rigid", run).sigma["q"][0]
    left = left_of(run)["q"]
    assert 0.2 < np.sqrt(np.nanmean(np.square(left))) / sigma < 2.0


def _body(mass):
    return {"mass": mass, "x": 0.0, "y": 0.0, "z": 0.0} | dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0)
