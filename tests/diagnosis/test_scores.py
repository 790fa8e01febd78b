"""The joint-by-effect map: what each effect takes of a gap by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis.contender import Contender
from mbexport.core.diagnosis.hypotheses import hypotheses
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.scores import scores
from mbexport.core.diagnosis.state import Search

from .pendulums import pendulum_run

LOUD, QUIET = slice(0, 60), slice(60, 100)


def test_a_cause_takes_what_its_amount_of_least_energy_takes_whatever_a_quiet_channel_says():
    asked = problem(load("pendulum"), "rigid", [pendulum_run()])
    there = {one.effect: one for one in hypotheses(asked, {}, scales_of(asked, {}), ())}
    left = np.ones(100)
    left[LOUD] = 1000.0
    state = Search(SimpleNamespace(residual=lambda rows: left), lambda values: values)
    slopes = {"coulomb_friction": (-100.0, 1.0), "viscous_friction": (0.0, -1.0)}
    for effect, (loud, quiet) in slopes.items():
        hypothesis = there[effect]
        slope = np.zeros((100, 1))
        slope[LOUD], slope[QUIET] = loud / hypothesis.scale, quiet / hypothesis.scale
        state.first.append(Contender(hypothesis, 0.0, 0.0, np.zeros(1), left, 1.0))
        state.signatures[effect, 1, hypothesis.form] = (np.zeros(100), slope)
    found = scores(state, {("coulomb_friction", 1): 0.9})
    assert [(one.effect, one.at, one.probability) for one in found] == [
        ("coulomb_friction", "joint_1", 0.9),
        ("viscous_friction", "joint_1", 0.0),
    ]
    # ten of it, that leave as much again of the quiet one: 40 (1 + 10)^2 of 6e7
    assert found[0].explains == pytest.approx(1.0 - 40.0 * 11.0**2 / 6.0e7, abs=1e-4)
    assert found[1].explains == pytest.approx(0.0, abs=1e-5)
