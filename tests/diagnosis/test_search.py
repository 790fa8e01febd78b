"""Which effects: on a pendulum that nothing of the package moves."""

import math

import numpy as np
import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.search import search

from .pendulums import pendulum_run


def question(against=None, **options):
    runs = [pendulum_run(seed=seed, **({"against": against} if against else {}), **options) for seed in (1, 2)]
    return problem(load("pendulum"), "rigid", runs)


def found(asked):
    whiten = whitening(asked)
    return search(asked, whiten), whiten


def test_a_perfect_model_leaves_unit_noise_and_nothing_is_found():
    asked = question()
    state, _ = found(asked)
    assert state.found == []
    assert np.mean(state.left**2) == pytest.approx(1.0, abs=0.2)


def test_viscous_friction_is_found_with_its_value():
    state, _ = found(question(lambda t, q, dq: 0.4 * dq))
    assert [(item.effect, item.place) for item in state.found] == [("viscous_friction", "joint_1")]
    assert state.found[0].row.values["coefficient"] == pytest.approx(0.4, rel=0.02)


def test_coulomb_friction_is_found_though_its_step_is_another():
    state, _ = found(question(lambda t, q, dq: 0.5 * math.tanh(dq / 2e-3)))
    assert state.found[0].effect == "coulomb_friction"
    assert state.found[0].row.values["torque"] == pytest.approx(0.5, rel=0.03)
