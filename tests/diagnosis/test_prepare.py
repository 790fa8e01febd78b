"""What is known of a recorded motion before any model is asked."""

from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis import prepare
from mbexport.core.diagnosis.evidence import gather
from mbexport.core.diagnosis.inverse import said
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.prepare import HIGHEST_BAND, HIGHEST_RATE, LOWEST_RATE, SAMPLES, band_of, follows, prepared
from mbexport.core.diagnosis.problem import problem
from mbexport.core.effects import EffectRow

from .pendulums import NOISE, command, pendulum_run


def away(run, by):
    """The run with its positions off."""
    return replace(run, signals={**run.signals, "q": run.signals["q"] + by})


def test_a_motion_that_is_followed_exactly_is_known_as_it_was_asked_for():
    """Positions with noise, differentiated twice, are off by thousands of times as much."""
    run = pendulum_run("motion")
    ready = prepared(run)
    inside = slice(ready.edge, -ready.edge)
    for known, asked in zip((ready.q, ready.dq, ready.ddq), command(ready.t), strict=True):
        assert known[inside, 0] == pytest.approx(asked[inside], abs=2e-4)
    assert ready.band == HIGHEST_BAND > 2.0 * ready.pace
    assert ready.pace == band_of(run)


def test_what_is_off_by_more_than_noise_was_not_as_asked():
    run = pendulum_run("motion")
    assert follows(run)
    assert not follows(away(run, 5.0 * NOISE["q"]))
    assert prepared(away(run, 5.0 * NOISE["q"])).band == band_of(run) < HIGHEST_BAND
    assert not follows(replace(run, locked=(1,)))
    assert not follows(pendulum_run("pd"))


def test_friction_is_left_out_for_as_long_about_a_reversal_as_the_motions_own_band_says():
    run = pendulum_run("motion")
    robot = robot_of(load("pendulum"), "rigid", run)
    known, guessed = (gather([one], [robot]) for one in (run, away(run, 5.0 * NOISE["q"])))
    left_out = [float(np.mean(one.masks[0]["tau"] == 0.0)) for one in (known, guessed)]
    assert left_out[0] == pytest.approx(left_out[1], abs=0.05)


def test_torque_above_the_motions_own_frequencies_is_seen():
    """A wave of 25 Hz in the torque, beyond what positions tell."""
    run = pendulum_run("motion", lambda t, q, dq: 0.02 * np.sin(2.0 * np.pi * 25.0 * t))
    robot = robot_of(load("pendulum"), "rigid", run)
    seen = gather([run], [robot])
    assert float(np.mean(seen.residual([robot]) ** 2)) > 1.5
    assert said(robot, seen.runs[0], robot, seen.creeps[0]).tau.shape == seen.runs[0].q.shape


def test_slow_motions_are_compared_at_no_more_samples_than_they_need(monkeypatch):
    """A friction's jumps are between two of them: as much of it is seen, and what is left of it is as little."""
    run = pendulum_run(
        "pd", lambda t, q, dq: 0.2 * np.tanh(dq / 1e-3), rate=1000.0, noise=dict.fromkeys(NOISE, 1e-3) | {"q": 1e-4}
    )
    row = EffectRow(1, {"torque": 0.2})

    def left(*found):
        asked = problem(load("pendulum"), "rigid", [run])
        left = whitening(asked)(asked.residual({"coulomb_friction": found} if found else {}))
        return float(left @ left) / len(left)

    few = prepared(run)
    assert 1.0 / few.h == pytest.approx(max(LOWEST_RATE, SAMPLES * few.band), rel=0.2)
    nothing, known = left(), left(row)
    monkeypatch.setattr(prepare, "SAMPLES", 1000.0)
    many = prepared(run)
    assert 1.0 / many.h == pytest.approx(HIGHEST_RATE)
    assert many.band == few.band
    assert nothing > 1000.0
    assert nothing == pytest.approx(left(), rel=0.1)
    assert known == pytest.approx(left(row), rel=0.1)
    assert known < 1.2
