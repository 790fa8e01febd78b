"""What jumps between the rows of a record is no gap of the model, and hides no cause."""

from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.build import assembled
from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis import in_simulation
from mbexport.core.diagnosis.between_rows import between_rows, hides
from mbexport.core.diagnosis.polish import closing
from mbexport.core.diagnosis.problem import problem
from mbexport.core.effects import EffectRow

from .jumping import PLANAR, RUBS, loudest, recorded, smooth, steps, swings, triangle


@pytest.mark.parametrize("motion", [triangle, steps])
def test_what_a_perfect_model_leaves_between_rows_is_taken_off(motion):
    run = recorded(motion)
    evidence, robots = problem(PLANAR, "rigid", [run]).evidence, [assembled(PLANAR, {})]
    less = between_rows(PLANAR, "rigid", [run], evidence, {}, "mjcf")
    assert loudest(evidence, robots) > 30.0
    assert loudest(less, robots) < 3.0
    assert hides(less) and not hides(evidence)
    assert between_rows(PLANAR, "rigid", [run], less, {}, "mjcf") is less
    assert loudest(less.only([0]), robots) == loudest(less, robots)


def test_it_is_that_of_the_robot_with_what_was_found():
    """A load goes on otherwise behind a jump of an arm whose drives give, by more than most causes are."""
    database = load("scara")
    point = {"mass": 1.0} | dict.fromkeys(("x", "y", "z", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0)
    rows = {"payload": (EffectRow(0, FrozenMap(point)),)}
    control = Control("pd", (2853.0, 668.0, 16112.0, 10.0), (114.0, 26.7, 644.0, 0.4), "gravity", 1000.0)
    run = recorded(swings, rows, control=control, database=database, level="full")
    asked = problem(database, "full", [run])
    robots = asked.robots(rows)
    before = between_rows(database, "full", [run], asked.evidence, {}, "mjcf")
    assert loudest(before, robots, ("tau",)) > 1000.0
    assert loudest(between_rows(database, "full", [run], before, rows, "mjcf"), robots, ("tau",)) < 3.0


def test_of_a_smooth_command_there_is_next_to_nothing():
    """A held torque acts half a tick later than rows have it, no more."""
    run = recorded(smooth)
    evidence, robots = problem(PLANAR, "rigid", [run]).evidence, [assembled(PLANAR, {})]
    less = between_rows(PLANAR, "rigid", [run], evidence, {}, "mjcf")
    assert not hides(less)
    change = less.residual(robots) - evidence.residual(robots)
    assert float(np.mean(change**2)) < 0.2


def test_without_a_controller_none_is_known_and_with_play_or_what_is_far_stiffer_no_other():
    run = recorded(steps)
    evidence = problem(PLANAR, "rigid", [run]).evidence
    plays = {"backlash": (EffectRow(1, FrozenMap({"gap": 0.002, "stiffness": 1e5, "damping": 10.0})),)}
    assert between_rows(PLANAR, "rigid", [run], evidence, plays, "mjcf") is evidence
    before = between_rows(PLANAR, "rigid", [run], evidence, {}, "mjcf")
    hard = {"joint_compliance": (EffectRow(1, FrozenMap({"stiffness": 1e9, "damping": 1.0})),)}
    for rows in (plays, hard):
        assert between_rows(PLANAR, "rigid", [run], before, rows, "mjcf") is before
    unknown = replace(run, control=Control("unknown"))
    evidence = problem(PLANAR, "rigid", [unknown]).evidence
    assert between_rows(PLANAR, "rigid", [unknown], evidence, {}, "mjcf") is evidence


@pytest.mark.parametrize("motion", [triangle, steps])
def test_jumps_of_a_command_are_no_gap(motion):
    answer = mbexport.diagnose("planar2r", [recorded(motion, seed=seed) for seed in (1, 2)], level="rigid", backends=[])
    assert (answer.verdict, answer.which) == ("no_gap", ())


def test_a_cause_is_found_under_commands_that_jump(monkeypatch):
    """And of all delays the shortest alone is simulated, which closes nothing."""
    tried: list[int] = []

    def counted(part, level, runs, fit, options, backend):
        tried.append(len(options))
        return closing(part, level, runs, fit, options, backend)

    monkeypatch.setattr(in_simulation, "closing", counted)
    runs = [recorded(steps, RUBS, seed) for seed in (1, 2)]
    answer = mbexport.diagnose("planar2r", runs, level="rigid", backends=[])
    (found,) = answer.which
    assert tried == [1]
    assert (answer.verdict, found.effect, found.at) == ("explained", "coulomb_friction", "joint_1")
    low, high = found.parameters["torque"].ci95
    assert low < 1.6 < high < low + 0.2


def test_a_delay_that_moves_what_happens_between_rows_is_found():
    """Along the motion the true delay leaves more than none, until what happens between rows is that with it."""
    rows = {"delay": (EffectRow(0, FrozenMap({"time": 0.003})),)}
    runs = [recorded(steps, rows, seed, level="friction") for seed in (1, 2)]
    answer = mbexport.diagnose("planar2r", runs, level="friction", backends=[])
    (found,) = answer.which
    assert (answer.verdict, found.effect) == ("explained", "delay")
    assert found.parameters["time"].value == pytest.approx(0.003, abs=2e-5)
