"""Where in its clearance an arm begins that nothing presses to a side: as a run's first moments have it."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import assembled
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis import resimulate
from mbexport.core.diagnosis.compared import residuals
from mbexport.core.diagnosis.inverse import arms_along
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.prepare import prepared
from mbexport.core.diagnosis.resimulate import free_arms, resimulated_once
from mbexport.core.diagnosis.starting_side import LATER, nearest_start, places_at_rest, rows_until_taken_along
from mbexport.core.effects import EffectRow
from mbexport.core.simulation import MachineState
from mbexport.core.simulation.settle import sagged

from .pendulums import INERTIA, NOISE, rattling_run

GAP = 0.02
ROTOR = 4.0 * INERTIA
PLAY = {"backlash": (EffectRow(1, FrozenMap({"gap": GAP, "stiffness": math.inf, "damping": math.inf})),)}
MOTOR = {"rotor_inertia": (EffectRow(1, FrozenMap({"inertia": ROTOR})),)}
HANGING = replace(load("pendulum"), effects=FrozenMap(MOTOR))
UPRIGHT = replace(HANGING, gravity=(0.0, 0.0, 0.0))


class Dynamics:
    """What holds a pendulum by a torque that goes with how far it is from hanging straight."""

    def __init__(self, most):
        self.most = most

    def gravity(self, q):
        return self.most * np.sin(q)


def at_rest(database, theta, most=0.0):
    robot = assembled(database, dict(MOTOR) | PLAY)
    theta, still = np.array([theta]), np.zeros(1)
    return robot, MachineState(0.0, sagged(robot, Dynamics(most), theta), still, theta, still)


def misses(run):
    """What is left of q_link at most times until the first reversal, in the sensor's own noise.

    At some it is more: after a blow the arm flies a little otherwise with another integrator.
    """
    robot, nominal = robot_of(UPRIGHT, "full", run, PLAY), robot_of(UPRIGHT, "full", run)
    left = residuals(run, resimulated_once(robot, nominal, run, "mjcf"), robot)["q_link"]
    return float(np.median(np.abs(left[run.t < 0.5]))) / NOISE["q_link"]


@pytest.mark.parametrize("side", [-1.0, 0.0, 1.0])
def test_an_arm_begins_where_the_first_moments_have_it(side, monkeypatch):
    """Of a run by another integrator, and without what the encoder behind the gear says of it."""
    run = rattling_run(GAP, ROTOR, duration=1.0, side=side)
    blind = replace(run, signals={name: values for name, values in run.signals.items() if name != "q_link"})
    monkeypatch.setattr(resimulate, "_start_in_play", placed_by(blind, resimulate._start_in_play))
    assert misses(run) < 1.5


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_where_no_side_is_looked_for_it_begins_in_the_middle(side, monkeypatch):
    monkeypatch.setattr(resimulate, "_start_in_play", lambda *_: None)
    assert misses(rattling_run(GAP, ROTOR, duration=1.0, side=side)) > 20.0


def placed_by(other, start_in_play):
    return lambda robot, nominal, run, *rest: start_in_play(robot, nominal, other, *rest)


@pytest.mark.parametrize("side", [-1.0, 0.0, 1.0])
@pytest.mark.parametrize("heard", [("q", "tau", "q_link"), ("q", "tau"), ("q",)])
def test_along_the_motion_too(side, heard):
    """By the encoder behind the gear, by what moved the motor, or by what its controller asked for."""
    run = rattling_run(GAP, ROTOR, duration=1.0, side=side)
    lost = {"q", "tau", "q_link"} - set(heard)
    known = replace(run, signals={name: values for name, values in run.signals.items() if name not in lost})
    robot, nominal = robot_of(UPRIGHT, "full", known, PLAY), robot_of(UPRIGHT, "full", known)
    grid = prepared(known)
    q, _ = arms_along(robot, grid, nominal)
    assert (q[0, 0] - grid.q[0, 0]) / (0.5 * GAP) == pytest.approx(side, abs=0.05)


def test_an_encoder_behind_another_gear_is_no_witness():
    """Of a joint that has none the torque is."""
    run = rattling_run(GAP, ROTOR, duration=1.0, side=1.0)
    robot, nominal = robot_of(UPRIGHT, "full", run, PLAY), robot_of(UPRIGHT, "full", run)
    grid = prepared(run)
    other = replace(
        grid,
        measured={**grid.measured, "q_link": 0.0 * grid.q},
        missing={**grid.missing, "q_link": np.ones_like(grid.missing["q_link"])},
    )
    for one in (grid, other):
        q, _ = arms_along(robot, one, nominal)
        assert (q[0, 0] - grid.q[0, 0]) / (0.5 * GAP) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("rate", [50.0, 100.0])
def test_along_the_motion_of_a_slow_record(rate):
    """That has fewer rows in these moments than a filter needs."""
    run = rattling_run(1e-4, ROTOR, duration=2.0, side=1.0, rate=rate)
    known = replace(run, signals={name: values for name, values in run.signals.items() if name != "q_link"})
    narrow = {"backlash": (EffectRow(1, FrozenMap({"gap": 1e-4, "stiffness": math.inf, "damping": math.inf})),)}
    robot, nominal = robot_of(UPRIGHT, "full", known, narrow), robot_of(UPRIGHT, "full", known)
    grid = prepared(known)
    q, _ = arms_along(robot, grid, nominal)
    assert np.all(np.isfinite(q))
    assert np.max(np.abs(q - grid.q)) < 1e-4


def test_along_a_motion_whose_ends_are_short():
    """As of an experiment that is compared up to near half of its rate."""
    run = rattling_run(1e-4, ROTOR, duration=2.0, side=1.0, rate=100.0)
    known = replace(run, signals={name: values for name, values in run.signals.items() if name != "q_link"})
    narrow = {"backlash": (EffectRow(1, FrozenMap({"gap": 1e-4, "stiffness": math.inf, "damping": math.inf})),)}
    robot, nominal = robot_of(UPRIGHT, "full", known, narrow), robot_of(UPRIGHT, "full", known)
    grid = prepared(known)
    few = replace(
        grid,
        edge=3,
        measured={name: values[:40] for name, values in grid.measured.items()},
        missing={name: values[:40] for name, values in grid.missing.items()},
        **{name: getattr(grid, name)[:40] for name in ("t", "q", "dq", "ddq")},
    )
    q, _ = arms_along(robot, few, nominal)
    assert np.max(np.abs(q - few.q)) < 1e-4


def test_along_the_motion_a_load_is_not_asked():
    """What hangs at one side is there, whatever a torque sensor says that is off."""
    run = rattling_run(GAP, ROTOR, duration=1.0, side=1.0)
    lifted = replace(run, signals={**run.signals, "q": run.signals["q"] + 0.5, "q_cmd": run.signals["q_cmd"] + 0.5})
    robot, nominal = robot_of(HANGING, "full", lifted, PLAY), robot_of(HANGING, "full", lifted)
    grid = prepared(lifted)
    q, _ = arms_along(robot, grid, nominal)
    assert q[0, 0] - grid.q[0, 0] == pytest.approx(-0.5 * GAP, rel=0.05)


def test_a_channel_that_was_not_measured_at_first_tells_nothing():
    """Nor does it keep the others from telling, or warn."""
    run = rattling_run(GAP, ROTOR, duration=1.0, side=1.0)
    tau = np.where(run.t[:, None] < 0.9, np.nan, run.signals["tau"])
    late = replace(run, signals={**run.signals, "tau": tau})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert misses(late) < 1.5


def test_who_simulates_begins_only_free_arms_elsewhere():
    run = rattling_run(GAP, ROTOR, duration=0.5)
    lifted = replace(run, signals={**run.signals, "q": run.signals["q"] + 0.5, "q_cmd": run.signals["q_cmd"] + 0.5})
    assert free_arms(robot_of(UPRIGHT, "full", run, PLAY), run) == (1,)
    assert free_arms(robot_of(UPRIGHT, "full", run), run) == ()
    assert free_arms(robot_of(HANGING, "full", lifted, PLAY), lifted) == ()


def test_an_arm_that_hangs_to_a_side_stands_there():
    robot, rest = at_rest(HANGING, 0.5, most=10.0)
    assert rest.theta[0] - rest.q[0] > 0.5 * GAP
    assert places_at_rest(robot, rest) == {}


def test_an_arm_that_next_to_nothing_presses_may_stand_elsewhere():
    """A hundredth of what presses it aside for sure; and none at all, in the middle of its play."""
    robot, rest = at_rest(HANGING, 0.5, most=1.0e-3)
    assert rest.q[0] == pytest.approx(0.5 - 0.5 * GAP, abs=1e-6)
    assert places_at_rest(robot, rest)[0] == pytest.approx((0.5, 0.5 + 0.5 * GAP), abs=1e-6)
    robot, rest = at_rest(UPRIGHT, 0.5)
    assert places_at_rest(robot, rest)[0] == pytest.approx((0.5 - 0.5 * GAP, 0.5 + 0.5 * GAP))


def test_rows_go_on_until_the_motor_has_taken_the_arm_along():
    t = np.arange(1001) / 1000.0
    # two clearances of 0.02 rad at 0.1 rad/s; the other joint has none
    moved = np.column_stack([0.1 * t, 0.0 * t])
    assert t[rows_until_taken_along(np.array([GAP, 0.0]), moved, t) - 1] == pytest.approx(0.4 + LATER, abs=2e-3)
    assert rows_until_taken_along(np.array([GAP, 0.0]), 0.01 * moved, t) == 1001


def test_arms_are_placed_one_after_the_other_and_left_where_they_settle_unless_that_is_nearer():
    rest = MachineState(0.0, np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2))
    places = {0: (-1.0, 1.0), 1: (-1.0, 1.0)}
    found = nearest_start(rest, places, lambda start: float(np.abs(start.q - [1.0, -0.2]).sum()))
    assert found.q.tolist() == [1.0, 0.0]
    assert nearest_start(rest, places, lambda _: 1.0) is rest
