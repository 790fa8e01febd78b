"""Motors that give ever less of a higher torque: found along the motion, told, and handed on as a constant."""

import math
from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.database import load
from mbexport.core.diagnosis.beyond import DROOP, asked_to_give
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.forms import DROOPS_SAID
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_laws import beyond_catalogue, straightened
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.search import search
from mbexport.core.diagnosis.state import Search
from mbexport.core.effects import EffectRow

from .pendulums import friction_free, pendulum_run

MOST = 14.0


def saturates(asked):
    """Iron that saturates, by another law than that of the fits."""
    return MOST * math.tanh(1.05 * asked / MOST)


def rubs(t, q, dq):
    return 0.05 * math.tanh(1000.0 * dq)


def steadily(asked):
    return 0.9 * asked


def asks(gives, given):
    """What a motor is asked for that gives a torque."""
    return given / 0.9 if gives is steadily else MOST / 1.05 * np.arctanh(given / MOST)


def run_of(gives, seed, against=friction_free):
    """A run in whose record the motor's torque is what its current says it should be."""
    run = pendulum_run(gives=gives, against=against, seed=seed)
    return replace(run, signals=run.signals | {"tau": asks(gives, run.signals["tau"])})


def asked_of(gives, against=friction_free):
    return problem(load("pendulum"), "rigid", [run_of(gives, seed, against) for seed in (1, 2)])


def test_what_a_motor_is_asked_for_gives_what_it_gives():
    asked, gain, droop = np.linspace(-8.0, 8.0, 33)[:, None], np.array([1.1, 0.9]), np.array([0.01, 0.0])
    given = gain * asked / np.sqrt(1.0 + 2.0 * droop * asked**2)
    assert asked_to_give(given, gain, droop) == pytest.approx(np.hstack([asked, asked]))
    # none gives more than it can, and a fit may ask for it
    assert np.isfinite(asked_to_give(np.full((3, 2), 1e3), gain, droop)).all()


@pytest.mark.parametrize("against", [friction_free, rubs])
def test_a_motor_that_droops_is_found_and_so_is_what_stands_beside_it(against):
    asked = asked_of(saturates, against)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    state = Search(asked, whiten)
    state.begin()
    rows = {item.effect: item.row.values for item in search(state).found}
    assert set(rows) == {"torque_constant", *(("coulomb_friction",) if against is rubs else ())}
    assert rows["torque_constant"]["gain"] == pytest.approx(1.05, rel=0.02)
    # tanh x is x - x^3 / 3, and x / sqrt(1 + 2 c x^2) is x - c x^3
    assert rows["torque_constant"][DROOP] == pytest.approx((1.05 / MOST) ** 2 / 3.0, rel=0.3)
    if against is rubs:
        assert rows["coulomb_friction"]["torque"] == pytest.approx(0.05, rel=0.15)
    # a database and engines get the constant that is nearest
    fit = refined(asked, whiten, state.found, parts)
    plain = straightened(asked, whiten, state.found, fit, parts)
    assert set(plain.rows["torque_constant", 1].values) == {"gain"}
    assert len(plain.free) == len(fit.free) - 1
    assert 0.85 < plain.rows["torque_constant", 1].values["gain"] < 1.03


@pytest.mark.parametrize(("gives", "droops"), [(saturates, True), (steadily, False)])
def test_a_constant_that_droops_takes_the_place_of_one_that_does_not(gives, droops):
    asked = asked_of(gives)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    item = Found("torque_constant", 1, EffectRow(1, {"gain": 0.95}), 50.0)
    fit = refined(asked, whiten, [item], parts)
    nothing = float(np.sum(whiten(asked.residual({})) ** 2))
    other = beyond_catalogue(asked, whiten, [item], fit, parts, item, nothing)
    assert (DROOP in other.rows[item.key].values) == droops
    assert other is fit or float(other.left @ other.left) < 0.5 * float(fit.left @ fit.left)


def test_it_is_told_that_a_motor_droops():
    runs = [run_of(saturates, seed) for seed in (1, 2, 3)]
    answer = mbexport.diagnose("pendulum", runs[:2], runs[2:], level="rigid", backends=[])
    (found,) = answer.which
    assert (found.effect, found.at) == ("torque_constant", "joint_1")
    assert set(found.parameters) == set(found.row) == {"gain"}
    assert DROOPS_SAID in answer.unexplained.looks_like
    assert answer.verdict == "explained"
    # of what it is asked for most of the time it gives about as much as the constant says
    least, most = found.parameters["gain"].ci95
    assert least < 1.0 < most
