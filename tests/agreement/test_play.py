"""Play that opens and closes: what a run may be off there, and what has no one answer."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.core.agreement import agree
from mbexport.core.agreement.compare import compare_runs, orders
from mbexport.core.agreement.gates import OPEN, PAPER_REACH
from mbexport.core.agreement.runs import run_all
from mbexport.core.agreement.scenarios import scenarios
from mbexport.core.build import build
from mbexport.core.database import FrozenMap, load
from mbexport.core.effects import EffectRow
from mbexport.core.simulation import backend_named

GAP, STIFFNESS, DAMPING = 2.0e-3, 2000.0, 1.0
# the built-in pendulum by hand: inertia about its axis; lying, it weighs nothing
INERTIA = 8.0e-3 + 1.2 * 0.45**2
LYING = {"base_tilt": (EffectRow(0, {"roll": math.pi / 2, "pitch": 0.0}),)}
ENGINES = ("urdf", "mjcf", "exudyn", "pybullet")


def lying(gap=GAP, **more):
    """A pendulum without weight, with play."""
    row = EffectRow(1, {"gap": gap, "stiffness": STIFFNESS, "damping": DAMPING})
    effects = FrozenMap({**LYING, "backlash": (row,), **more})
    return replace(load("pendulum"), effects=effects, levels=FrozenMap({}))


@pytest.fixture(scope="module")
def scenario():
    (made,) = scenarios(build(lying()), ["compliant_motion"], 0.5)
    return made


@pytest.fixture(scope="module")
def runs(scenario):
    return [run for name in ("urdf", "pybullet") for run in run_all(scenario, backend_named(name))]


@pytest.fixture(scope="module")
def truth(scenario, runs):
    """truth(shift of the start) -> arm's side at every sample, by an integrator that finds every contact itself."""

    @cache
    def solved(shift=0.0):
        def rate(t, x):
            theta, dtheta, _ = (float(row[0]) for row in scenario.motion.at(np.array(t)))
            stretch = theta - x[0]
            torque = 0.0
            if abs(stretch) > GAP / 2:
                torque = STIFFNESS * (stretch - math.copysign(GAP / 2, stretch)) + DAMPING * (dtheta - x[1])
                torque = torque if torque * stretch > 0.0 else 0.0
            return [x[1], torque / INERTIA]

        start = [runs[0].q_link[0, 0] + shift, 0.0]
        found = solve_ivp(
            rate, (0.0, 0.5), start, method="DOP853", rtol=1e-9, atol=1e-12, t_eval=runs[0].t, max_step=2e-3
        )
        return found.y[0]

    return solved


def test_a_run_has_one_answer(truth):
    moved = np.abs(truth(1e-8) - truth())
    # what a little at the start becomes: not more than a little
    assert 1e-9 < moved.max() < 1e-6


def test_halving_the_step_tells_how_far_a_run_is_off(runs, truth):
    exact = truth()
    for voice in ("urdf", "pybullet"):
        whole, half = (
            next(run for run in runs if run.voice == voice and run.half == wanted and run.manner != "extrapolated")
            for wanted in (False, True)
        )
        assert whole.knocks and half.knocks
        stretch = whole.theta[:, 0] - exact
        assert stretch.min() < -GAP / 2 and stretch.max() > GAP / 2
        left_open = np.max(np.abs(whole.q_link - half.q_link))
        assert 1e-3 * np.ptp(stretch) > np.max(np.abs(half.q_link[:, 0] - exact)) < OPEN * left_open
    extrapolated = next(run for run in runs if run.manner == "extrapolated")
    assert extrapolated.knocks


def test_voices_that_meet_the_edges_otherwise_are_held_at_half_their_steps(scenario, runs):
    figures = compare_runs(scenario, runs, PAPER_REACH)
    assert all(figure.passed for figure in figures)
    assert {figure.manner for figure in figures} >= {"halved"}
    assert not any(order.judged for order in orders(scenario, runs))
    # without a step to halve there is no such gate
    bare = [run for run in runs if not run.half]
    assert not all(figure.passed for figure in compare_runs(scenario, bare, PAPER_REACH))


def test_more_play_than_there_should_be_is_not_taken_for_a_step(scenario, runs):
    """Three quarters more of it; less is told at rest, to 1e-10."""
    (other,) = scenarios(build(lying(1.75 * GAP)), ["compliant_motion"], 0.5)
    wrong = [run for run in runs if run.voice == "urdf"] + list(run_all(other, backend_named("pybullet")))
    failed = [figure for figure in compare_runs(scenario, wrong, PAPER_REACH) if not figure.passed]
    assert "deflection" in {figure.signal for figure in failed}
    answer = agree(lying(), ["urdf", "mjcf"], quantities=["compliant_motion"], duration=0.1)
    assert answer.agreed


def test_an_arm_without_load_stands_for_all_its_places_by_the_middle_of_its_play():
    amplitude, cycles, phase = 4.0e-3, 3.0, 0.4
    wobble = EffectRow(1, {"amplitude": amplitude, "cycles": cycles, "phase": phase})
    answer = agree(
        lying(transmission_error=(wobble,)), ENGINES, quantities=["static_sag", "drive_torque", "acceleration"],
        states=8,
    )  # fmt: skip
    assert answer.agreed, answer.sentences
    error = amplitude * np.sin(cycles * answer.evidence.states.q[:8, 0] + phase)
    # an error larger than the play itself: the arm is carried along by it
    assert np.max(np.abs(error)) > GAP
    for name in ENGINES:
        np.testing.assert_allclose(answer.evidence.answers[name]["static_sag"][:, 0], error, atol=1e-12)
