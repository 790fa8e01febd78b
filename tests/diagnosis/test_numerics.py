"""Suspects that are no physics: stamps that are off, a hold, a step; a delay of the drive is none of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pendulums import KD, KP, NOISE, command, pendulum_run

import mbexport
from mbexport.core.database import load
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.numerics import numerics, shift_of, shift_said, unshifted
from mbexport.core.diagnosis.resimulate import residuals, resimulated

DATABASE = load("pendulum")


def shift_in(run):
    robot = robot_of(DATABASE, "rigid", run)
    simulated = resimulated(robot, robot, run, "mjcf")
    return shift_of(run, simulated, noise_floor(DATABASE, "rigid", run))


@pytest.mark.parametrize("late", [0.004, 0.002])
def test_stamps_that_are_late_are_found_and_put_back(late):
    run = pendulum_run("pd", late=late)
    assert shift_in(run) == pytest.approx(late, rel=0.1)
    robot = robot_of(DATABASE, "rigid", run)
    back = unshifted(run, shift_in(run))
    left = residuals(back, resimulated(robot, robot, back, "mjcf"))["q"][5:-5]
    assert np.sqrt(np.nanmean(np.square(left))) < 3.0 * NOISE["q"]


def test_good_stamps_and_friction_are_no_shift():
    assert shift_in(pendulum_run("pd")) == 0.0
    assert shift_in(pendulum_run("pd", lambda t, q, dq: 0.4 * dq)) == 0.0
    assert shift_in(pendulum_run("pd", lambda t, q, dq: 0.3 * np.tanh(dq / 2e-3))) == 0.0


def test_positions_alone_tell_late_stamps_from_friction():
    def alone(run):
        """Where its arm side is, by a second sensor that says the same, and no torque."""
        return replace(run, signals={"q": run.signals["q"], "q_link": run.signals["q"], "q_cmd": run.signals["q_cmd"]})

    assert shift_in(alone(pendulum_run("pd", lambda t, q, dq: 0.3 * np.tanh(dq / 2e-3)))) == 0.0
    late = alone(pendulum_run("pd", late=0.004))
    assert shift_in(late) == pytest.approx(0.004, rel=0.1)
    # and what one joint's positions alone cannot tell is said
    assert "Viscous friction" in shift_said(late, 0.004)
    assert "Viscous friction" not in shift_said(pendulum_run("pd"), 0.004)


def test_a_late_drive_is_no_late_stamp():
    past: dict[float, float] = {}

    def late_torque(t, q, dq):
        """What takes the torque away that is held now and gives that of 4 ms ago instead."""
        wanted = float(command(t)[0])
        now = KP * (wanted - q) + KD * (float(command(t)[1]) - dq)
        past[round(t, 6)] = now
        before = past.get(round(t - 0.004, 6), now)
        return now - before

    assert shift_in(pendulum_run("pd", late_torque, duration=2.0)) == 0.0


def test_a_smooth_run_is_neither_its_step_nor_its_hold():
    run = pendulum_run("pd")
    robot = robot_of(DATABASE, "rigid", run)
    found = numerics(robot, robot, run, "mjcf", noise_floor(DATABASE, "rigid", run))
    assert found.step == pytest.approx(1e-3)
    assert found.step_error["q"][0] < 1e-3 * NOISE["q"]
    # the hold of one tick moves what a millisecond's lag of the damping moves, above nothing
    assert 0.0 < found.hold_error["q"][0] < 50.0 * NOISE["q"]
    assert len(found.notes) == 2


def test_a_gap_that_goes_with_the_hold_is_numerics():
    """The log says that a torque is held for 4 ms, it was held for one."""
    runs = [pendulum_run("pd", seed=seed) for seed in (1, 2)]
    runs = [replace(run, control=replace(run.control, rate=250.0)) for run in runs]
    answer = mbexport.diagnose("pendulum", runs, level="rigid", backends=[])
    assert answer.verdict == "no_gap"
    assert answer.which == ()
    assert any("without a hold" in note for note in answer.notes)
