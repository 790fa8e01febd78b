"""Arms behind springs along a recorded motion, against an integrator of SciPy's."""

import numpy as np
import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis.problem import problem
from mbexport.core.effects import EffectRow

from .pendulums import INERTIA, soft_run


@pytest.mark.parametrize("omega", [20.0, 45.0])
def test_seconds_of_ringing_stay_in_phase(omega):
    """Sampled at 250 Hz; a period that is too long by (omega h)^2 / 12 leaves many times the noise after 4 s."""
    stiffness, damping = INERTIA * omega**2, 0.05
    run = soft_run(stiffness, damping, noisy=False)
    asked = problem(load("pendulum"), "rigid", [run])
    row = EffectRow(1, {"stiffness": stiffness, "damping": damping})
    rigid, soft = (asked.residual(rows) for rows in ({}, {"joint_compliance": (row,)}))
    assert np.mean(rigid**2) > 100.0
    assert np.mean(soft**2) < 0.2


def test_a_spring_much_stiffer_than_the_record_is_fast_is_rigid():
    run = soft_run(INERTIA * 4000.0**2, 0.0, noisy=False)
    asked = problem(load("pendulum"), "rigid", [run])
    row = EffectRow(1, {"stiffness": INERTIA * 4000.0**2, "damping": 0.0})
    rigid, hard = (asked.residual(rows) for rows in ({}, {"joint_compliance": (row,)}))
    assert np.mean((hard - rigid) ** 2) < 0.1
