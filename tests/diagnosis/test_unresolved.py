"""Torques that jump between rows are left out where nobody knows the controller; what a band shows is a gap."""

from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.build import assembled
from mbexport.core.control import Control
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.unresolved import resolved

from .jumping import PLANAR, RUBS, T, loudest, recorded, smooth, steps, triangle


def unknown(motion, rows=None, seed=1):
    """A run of which nobody knows the controller."""
    run = recorded(motion, rows, seed)
    return replace(run, control=Control("unknown"))


@pytest.mark.parametrize("motion", [triangle, steps])
def test_rows_about_jumps_are_left_out_and_named(motion):
    run = unknown(motion)
    less = resolved(run)
    assert [(item.channel, item.reason) for item in less.left_out] == [("tau_1", "jump"), ("tau_2", "jump")]
    for i, item in enumerate(less.left_out):
        gone = np.isnan(less.signals["tau"][:, i])
        assert (item.samples, item.first, item.last) == (gone.sum(), run.t[gone][0], run.t[gone][-1])
        assert f"{gone.sum()} samples about jumps are left out" in item.message
        assert 0.05 < gone.mean() < 0.5
    assert np.array_equal(less.signals["q"], run.signals["q"])


@pytest.mark.parametrize("motion", [triangle, steps])
def test_they_would_be_far_more_than_noise_of_a_perfect_model(motion):
    run, robots = unknown(motion), [assembled(PLANAR, {})]
    assert loudest(problem(PLANAR, "rigid", [run]).evidence, robots) > 10.0
    assert loudest(problem(PLANAR, "rigid", [resolved(run)]).evidence, robots) < 3.0


def test_other_runs_stay_as_they_are():
    """A known controller, a smooth command, and noise that is loud here and there."""
    known, quiet = recorded(triangle), unknown(smooth)
    assert resolved(known) is known
    assert resolved(quiet) is quiet
    loud = np.where(np.abs(T - 1.0) < 0.3, 3.0, 0.05)[:, None] * np.random.default_rng(2).normal(size=(len(T), 2))
    noisy = replace(quiet, signals={**quiet.signals, "tau": quiet.signals["tau"] + loud})
    assert resolved(noisy) is noisy


def test_a_torque_that_is_faster_than_the_record_all_the_time_is_no_jump():
    run = unknown(smooth)
    fast = 20.0 * np.sin(2.0 * np.pi * 80.0 * T)[:, None] * np.ones(2)
    whole = replace(run, signals={**run.signals, "tau": run.signals["tau"] + fast})
    assert resolved(whole) is whole


@pytest.mark.parametrize("motion", [triangle, steps])
def test_jumps_of_an_unknown_controllers_command_are_no_gap(motion):
    answer = mbexport.diagnose("planar2r", [unknown(motion, seed=seed) for seed in (1, 2)], level="rigid", backends=[])
    assert (answer.verdict, answer.which) == ("no_gap", ())
    assert {item.reason for item in answer.left_out} == {"jump"}


def test_a_cause_is_found_between_them():
    runs = [unknown(triangle, RUBS, seed) for seed in (1, 2)]
    answer = mbexport.diagnose("planar2r", runs, level="rigid", backends=[])
    (found,) = answer.which
    assert (answer.verdict, found.effect, found.at) == ("explained", "coulomb_friction", "joint_1")
    low, high = found.parameters["torque"].ci95
    assert low < 1.6 < high < low + 0.2
    # a page draws the gap against the motion that was measured
    assert all("dq" in overlay.measured and "q_cmd" not in overlay.measured for overlay in answer.overlays)


def test_what_a_band_shows_is_a_gap_though_a_mean_square_hides_it():
    """A swing of the torque at 3 Hz that no effect makes, as large as the deviation of its noise."""
    runs = [unknown(smooth, seed=seed) for seed in (1, 2)]
    swings = [0.05 * np.sin(2.0 * np.pi * 3.1 * T + seed)[:, None] * np.array([1.0, 0.0]) for seed in (1, 2)]
    shaken = [
        replace(run, signals={**run.signals, "tau": run.signals["tau"] + swing})
        for run, swing in zip(runs, swings, strict=True)
    ]
    assert mbexport.diagnose("planar2r", runs, level="rigid", backends=[]).verdict == "no_gap"
    assert mbexport.diagnose("planar2r", shaken, level="rigid", backends=[]).verdict == "unexplained"
