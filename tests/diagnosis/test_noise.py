"""The noise of a channel, against runs of robots that are off within their tolerances or not at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pendulums import INERTIA, NOISE, WEIGHT, command, noisy_loop, pendulum_run
from scipy.integrate import quad
from scipy.signal import lfilter
from scipy.stats import chi2, norm

from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, Tolerance, load, with_effects
from mbexport.core.diagnosis.compared import residuals
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import (
    Noise,
    noise_floor,
    perturbed,
    significance,
    significant,
    tolerance_changes,
    tolerance_times,
)
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.effects import EffectRow
from mbexport.core.recording import Run, known_together

DATABASE = load("pendulum")


def left_of(run):
    robot = robot_of(DATABASE, "rigid", run)
    return residuals(run, resimulated(robot, robot, run, "mjcf"), robot)


def test_sensors_alone_where_nothing_is_off():
    floor = noise_floor(DATABASE, "rigid", pendulum_run("pd"))
    assert floor.sigma["q"] == pytest.approx([NOISE["q"]], rel=1e-3)
    assert floor.sigma["tau"] == pytest.approx([NOISE["tau"]], rel=1e-3)


def test_nothing_is_judged_of_a_channel_that_has_nothing():
    run = pendulum_run("pd")
    dead = replace(run, signals={**run.signals, "tau": np.full_like(run.signals["tau"], np.nan)})
    with np.errstate(all="raise"):
        floor = noise_floor(DATABASE, "rigid", dead)
        freedom, chance = floor.freedom("q"), floor.chance("tau", np.zeros(1))
    assert np.all(freedom > 100.0)
    assert chance[0] == pytest.approx(1.0, abs=0.01)


def test_a_controller_that_sees_its_sensors_noise_makes_torque_of_it():
    run = pendulum_run("pd")
    scatter = 0.05 * np.random.default_rng(8).normal(size=run.signals["tau"].shape)
    shaken = replace(run, signals={**run.signals, "tau": run.signals["tau"] + scatter})
    # stated is what the sensor adds, recorded is five times as much
    floor = noise_floor(DATABASE, "rigid", shaken).sigma["tau"][0]
    assert floor == pytest.approx(np.hypot(0.05, NOISE["tau"]), rel=0.3)


def test_the_noise_that_a_controller_makes_torque_of_is_felt_behind_the_motor():
    run = pendulum_run("pd")
    random = np.random.default_rng(8)
    scatter = 0.05 * random.normal(size=run.signals["tau"].shape)
    signals = {**run.signals, "tau": run.signals["tau"] + scatter, "tau_link": run.signals["tau"]}
    shaken = replace(run, signals=signals, noise={**run.noise, "tau_link": np.array([0.001])})
    floor = noise_floor(DATABASE, "rigid", shaken).sigma["tau_link"][0]
    assert floor == pytest.approx(0.05, rel=0.3)
    # a rotor that weighs as much as the arm keeps half of it
    geared = with_effects(DATABASE, {"rotor_inertia": (EffectRow(1, FrozenMap({"inertia": INERTIA})),)})
    assert noise_floor(geared, "full", shaken).sigma["tau_link"][0] == pytest.approx(0.025, rel=0.3)


def test_what_runs_beside_state_does_not_hide_a_loop():
    def shaken(seed, slow):
        run, random = pendulum_run("pd", seed=seed), np.random.default_rng(8 + seed)
        drift = lfilter([1.0], [1.0, -0.97], random.normal(size=run.signals["tau"].shape), axis=0)
        tau = run.signals["tau"] + 0.05 * random.normal(size=drift.shape) + slow * drift
        return replace(run, signals={**run.signals, "tau": tau})

    # what passes for slow noise is known better by the other run, but not by what its log says of the sensor alone
    drifting, _ = known_together([shaken(0, 0.05), shaken(1, 0.0)])
    assert noise_floor(DATABASE, "rigid", drifting).sigma["tau"][0] > 0.035


@pytest.mark.parametrize("rounded", [False, True])
def test_speeds_show_what_a_loud_torque_sensor_hides(rounded):
    sigma = {"q": 3.0e-4, "dq": 1.0e-4, "tau": 0.06}

    quiet, loud = noisy_loop(sigma, loud=False), noisy_loop(sigma)
    if rounded:
        loud = replace(loud, signals={**loud.signals, "tau": np.round(loud.signals["tau"] / 0.03) * 0.03})
    floor = noise_floor(DATABASE, "rigid", loud).sigma
    for name in ("q", "dq", "tau"):
        left = np.std((loud.signals[name] - quiet.signals[name])[1000:])
        assert 0.8 < floor[name][0] / left < 1.6


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


def test_a_mass_weighs_as_it_moves_behind_a_gear_that_errs():
    """An error of two milliradians that comes 27 times a turn turns the arm as hard as the motor does."""
    amplitude, cycles = 2.0e-3, 27.0
    err = {"transmission_error": (EffectRow(1, FrozenMap({"amplitude": amplitude, "cycles": cycles, "phase": 0.0})),)}
    run = pendulum_run("motion")
    robot = robot_of(DATABASE, "rigid", run, err)
    found = tolerance_changes(robot, Tolerance(mass=0.01), run)["tau"][0, :, 0]
    t = tolerance_times(run)
    motor, speed, turns = command(t)
    q = motor + amplitude * np.sin(cycles * motor)
    ddq = turns * (1.0 + amplitude * cycles * np.cos(cycles * motor))
    ddq -= amplitude * cycles**2 * speed**2 * np.sin(cycles * motor)
    exact = 0.01 * ((INERTIA - 8.0e-3) * ddq + WEIGHT * np.sin(q))
    inner = slice(5, -5)
    assert np.std((found - exact)[inner]) < 0.05 * np.std(exact[inner])


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


def test_all_angles_of_an_arm_may_be_off():
    """The misalignment of the paper's parameters too: it had been left out."""
    robot = robot_of(load("puma560"), "rigid", pendulum_run())
    angles = [
        (name, i)
        for other in perturbed(robot, Tolerance(angle=1e-4))
        for i, (one, new) in enumerate(zip(robot.stages, other.stages, strict=True))
        for name in ("alpha", "theta", "beta")
        if getattr(new.arm.link, name) - getattr(one.arm.link, name) == pytest.approx(1e-4, rel=1e-6)
    ]
    assert sorted(angles) == sorted((name, i) for name in ("alpha", "theta", "beta") for i in range(6))


def test_a_loop_shakes_an_arm_though_its_speed_is_not_recorded_nor_its_torques_noise_stated():
    """Slow noise of a position moves the motor as a command does; what sees the arm alone sees that."""
    sigma = {"q": 1.0e-3, "dq": 1.0e-9, "tau": 1.0e-3}
    run = noisy_loop(sigma, slope=0.99)
    calm = noisy_loop(sigma, slope=0.99, loud=False)
    arm = calm.signals["q"] + 1.0e-6 * np.random.default_rng(1).normal(size=(len(run.t), 1))
    known = {"q": run.signals["q"], "tau": run.signals["tau"], "q_link": arm}
    known |= {name: run.signals[name] for name in ("q_cmd", "dq_cmd")}
    seen = replace(run, signals=known, noise={"q": np.array([sigma["q"]])})
    quiet = noisy_loop(sigma, slope=0.99, heard=False)
    shaken = float(np.std(run.signals["q"] - quiet.signals["q"]))
    floor = noise_floor(DATABASE, "rigid", seen).sensor["q_link"][0]
    assert floor == pytest.approx(shaken, rel=0.3)


@pytest.mark.parametrize("hears", [True, False])
def test_one_joint_tells_of_a_loop_what_a_loud_torque_sensor_hides_at_the_other(hears):
    database, control = load("planar2r"), Control("pd", (900.0, 250.0), (40.0, 12.0))
    random, t = np.random.default_rng(5), np.arange(4001) / 1000.0
    asked = 0.3 * np.sin(np.outer(t, [1.0, 1.3]))
    off = 1.0e-4 * random.normal(size=asked.shape)

    def floor(own):
        scatter = own * random.normal(size=asked.shape) - hears * np.array(control.kp) * off
        signals = {"q": asked + off, "q_cmd": asked, "q_link": asked, "tau": scatter}
        noise = {"q": np.full(2, 1.0e-4), "q_link": np.full(2, 1.0e-6), "tau": np.array(own)}
        run = Run("stirs", t, signals, control, noise, (), {}, "", (), 1000.0)
        return noise_floor(database, "rigid", run).sensor["q_link"]

    told, hidden = floor([0.01, 0.002]), floor([0.01, 0.1])
    assert hidden == pytest.approx(told, rel=0.1)
    assert np.all(told > 2.0e-6) if hears else told == pytest.approx(1.0e-6, rel=0.2)


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
    gap = residuals(run, resimulated(true, tight, run, "mjcf"), tight)
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


def test_no_torque_is_compared_beside_a_hole_in_the_motion():
    run = pendulum_run("unknown", rate=1000.0)
    hole = (run.t > 1.5) & (run.t < 1.6)
    kept = {name: values[~hole] for name, values in run.signals.items()}
    torn = replace(run, t=run.t[~hole], signals=kept)
    # bridged by a straight line, the motion has no accelerations there, and jerks at both ends of it
    assert significant(left_of(torn), noise_floor(DATABASE, "rigid", torn)) > 0.05
    known, whole = (np.isfinite(left_of(one)["tau"][:, 0]) for one in (torn, run))
    assert not known[(torn.t > 1.48) & (torn.t < 1.62)].any()
    far = np.abs(torn.t - 1.55) > 0.3
    assert known[far].mean() > 0.8 * whole[~hole][far].mean()


def test_two_parts_of_a_mean_square_are_added_as_they_are():
    """Against an integral over the normal number that is off: sensors of 40 degrees of freedom beside it, or alone."""
    one, known = np.ones(2), np.array([40.0, 40.0])
    noise = Noise({"q": one}, {"q": np.array([0.5, 0.0])}, {"q": known}, {"q": one})

    def exact(square):
        def more(off):
            return 2.0 * norm.pdf(off) * chi2.sf(40.0 * (square - 0.25 * off**2), 40.0)

        return quad(more, 0.0, 12.0, limit=400)[0]

    for square in (1.0, 1.5, 2.5, 4.0, 8.0):
        found = noise.chance("q", np.array([square, square]))
        assert found[0] == pytest.approx(exact(square), rel=0.01)
        assert found[1] == pytest.approx(float(chi2.sf(40.0 * square, 40.0)), rel=1e-6, abs=1e-11)
    # one variable of the same spread would call it ten times as rare
    free = noise.freedom("q")[0]
    assert float(chi2.sf(free * 4.0 / 1.25, free)) < 0.1 * exact(4.0)


def _body(mass):
    return {"mass": mass, "x": 0.0, "y": 0.0, "z": 0.0} | dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0)
