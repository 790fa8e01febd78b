"""Torque limits that are felt before they are reached: found along the motion, told, and handed on as ones that cut."""

import math

import numpy as np
import pytest

import mbexport
from mbexport.core.database import load
from mbexport.core.diagnosis.beyond import KNEE, cut_softly
from mbexport.core.diagnosis.cutting import cutting
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.forms import SOFTLY_SAID
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_laws import beyond_catalogue, straightened
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.diagnosis.stamps import shift_of
from mbexport.core.effects import EffectRow

from .pendulums import pendulum_run

LIMIT = 5.6


def cuts(asked):
    """The catalogue's law."""
    return max(-LIMIT, min(LIMIT, asked))


def rounded(asked, corner=0.15 * LIMIT):
    """A limit with a parabola for its corner."""
    size = abs(asked)
    if size <= LIMIT - corner:
        return asked
    given = LIMIT if size >= LIMIT + corner else size - (size - LIMIT + corner) ** 2 / (4.0 * corner)
    return math.copysign(given, asked)


def saturated(asked):
    """A limit as of iron that saturates."""
    return asked / (1.0 + (asked / LIMIT) ** 8) ** 0.125


def fitted(gives):
    """A pendulum's question, its parts, the fit of a limit that cuts, and what is there without it."""
    asked = problem(load("pendulum"), "rigid", [pendulum_run(gives=gives, seed=seed) for seed in (1, 2)])
    whiten, parts = whitening(asked), blocks(asked.evidence)
    item = Found("torque_limit", 1, EffectRow(1, {"torque": LIMIT}), 50.0)
    fit = refined(asked, whiten, [item], parts)
    return (asked, whiten), parts, fit, item, float(np.sum(whiten(asked.residual({})) ** 2))


def test_a_knee_of_no_width_cuts():
    torque = np.linspace(-3.0, 3.0, 61)
    assert np.array_equal(cut_softly(torque, 2.0), np.clip(torque, -2.0, 2.0))
    assert np.allclose(cut_softly(torque, 2.0, 1e-4), np.clip(torque, -2.0, 2.0), atol=2e-4)
    assert np.array_equal(cut_softly(torque, math.inf, 0.1), torque)
    # a motor that gives nothing has no knee
    assert np.array_equal(cut_softly(torque, 0.0, 0.1), np.zeros_like(torque))


def test_over_a_knee_a_motor_gives_ever_less_the_same_both_ways():
    torque = np.linspace(-9.0, 9.0, 181)
    given = cut_softly(torque, 2.0, 0.1)
    assert np.allclose(given, -given[::-1])
    slope = np.diff(given) / np.diff(torque)
    assert np.all(slope >= 0.0)
    assert np.all(np.diff(slope[90:]) <= 1e-12)
    assert given[-1] == pytest.approx(2.0)
    # log 2 of its width is missing where it would be reached
    assert cut_softly(np.array([2.0]), 2.0, 0.1)[0] == pytest.approx(2.0 - 0.2 * math.log(2.0), rel=1e-6)


@pytest.mark.parametrize("gives", [rounded, saturated])
def test_a_fit_finds_the_knee_of_another_form(gives):
    question, parts, cut, item, before = fitted(gives)
    fit = beyond_catalogue(*question, [item], cut, parts, item, before)
    values = fit.rows[item.key].values
    assert 0.02 < values[KNEE] < 0.2
    assert values["torque"] == pytest.approx(LIMIT, rel=0.02)
    excess = [float(one.left @ one.left) - len(one.left) for one in (fit, cut)]
    assert excess[0] < 0.1 * excess[1]


def test_a_limit_that_cuts_stays_one():
    question, parts, cut, item, before = fitted(cuts)
    assert beyond_catalogue(*question, [item], cut, parts, item, before) is cut
    assert cut.rows[item.key].values["torque"] == pytest.approx(LIMIT, rel=1e-3)


def test_a_database_gets_one_that_cuts_where_the_knee_comes_to():
    question, parts, cut, item, before = fitted(saturated)
    soft = beyond_catalogue(*question, [item], cut, parts, item, before)
    handed = straightened(*question, [item], soft, parts)
    assert handed.rows[item.key].values == {"torque": soft.rows[item.key].values["torque"]}
    assert handed.free == (("torque_limit", 1, "torque"),)
    # no more is known of it than with its knee
    assert handed.covariance == pytest.approx(soft.covariance[[[1]], [[1]]])
    assert handed.left == pytest.approx(question[1](question[0].residual({"torque_limit": (handed.rows[item.key],)})))
    assert straightened(*question, [item], cut, parts) is cut


def cut_at(gives, top):
    """Where a limit that comes to `top` [N m] is cut for engines, by what two simulated runs say."""
    runs = [pendulum_run(gives=gives, seed=seed) for seed in (1, 2)]
    rows = {("torque_limit", 1): EffectRow(1, {"torque": top})}
    handed = cutting(load("pendulum"), "rigid", runs, rows, [1], "mjcf")
    return handed["torque_limit", 1].values["torque"]


def test_engines_get_a_lower_limit_only_where_it_is_plainly_nearer():
    assert cut_at(cuts, LIMIT) == LIMIT
    assert cut_at(cuts, LIMIT / 0.9) == pytest.approx(LIMIT)
    # reached nowhere, all are alike
    assert cut_at(float, 20.0 * LIMIT) == 20.0 * LIMIT


def test_a_limit_is_no_matter_of_stamps():
    """What it holds back looks late, in position and torque alike, and leaves the gap what it is."""
    run = pendulum_run(gives=rounded, seed=1)
    robot = robot_of(load("pendulum"), "rigid", run)
    simulated = resimulated(robot, robot, run, "mjcf")
    assert shift_of(run, robot, simulated, noise_floor(load("pendulum"), "rigid", run)) == 0.0


@pytest.mark.parametrize("gives", [rounded, saturated])
def test_a_diagnosis_names_it_and_says_that_it_is_felt_before(gives):
    runs = [pendulum_run(gives=gives, seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose(load("pendulum"), runs, level="rigid", backends=["mjcf"])
    (found,) = answer.which
    assert (found.effect, found.at) == ("torque_limit", "joint_1")
    assert answer.verdict == "explained"
    assert SOFTLY_SAID in answer.unexplained.looks_like
    assert set(answer.effects["torque_limit"][0].values) == {"torque"}
    assert answer.how_far.shrinks_by > 0.5
    assert not any("stamps" in note for note in answer.notes)
