"""Codes that differentiate the motion law by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from mbexport.core.motion import from_table
from mbexport.core.reproduction.derivatives import DIFFERENCE_STEP, backward, felt
from mbexport.core.reproduction.statics import damping, stiffness


def test_a_law_with_its_own_speed_is_felt_the_same(case):
    """K x + b x' of the law that stands for it is K theta + b s, where s are backward differences of theta."""
    law = from_table(case.motion.knots, case.motion.at(case.motion.knots)[0])
    stand_in = felt(case.compliant, law, DIFFERENCE_STEP)
    k, b = stiffness(case.compliant), damping(case.compliant)
    # beyond the start, where the stand-in's first moment is on its way
    t = np.linspace(0.1, law.duration, 997)
    x, dx, _ = stand_in.at(t)
    wanted = k * law.at(t)[0] + b * backward(law, t, DIFFERENCE_STEP)
    error = np.abs(k * x + b * dx - wanted).max(axis=0)
    # beside what the difference itself is
    difference = np.abs(b * (backward(law, t, DIFFERENCE_STEP) - law.at(t)[1])).max(axis=0)
    moving = difference > 1e-9
    assert moving.sum() == 5
    assert (error[moving] < 0.02 * difference[moving]).all()


def test_the_operators_differ_and_all_three_functions_do_not(study):
    found = {operator.name: operator for operator in study.derivatives.operators}
    assert found["all_three"].tip == 0.0
    assert found["cubic"].tip < found["akima"].tip
    for name in ("akima", "difference"):
        assert found[name].tip > 1e-5
        # the engines agree on one law, however poor it is
        assert found[name].engines < 1e-12
        # what springs and dampers at rest make of it, swung up at most twice
        assert 0.5 * found[name].expected < found[name].tip < 3.0 * found[name].expected
    assert study.derivatives.codes.max() > 1e-5


def test_backward_differences_lag_by_half_their_step(case):
    t = np.linspace(0.1, 0.4, 50)
    _, speed, acceleration = case.motion.at(t)
    lag = (speed - backward(case.motion, t, 1e-5)) / 1e-5
    assert lag == pytest.approx(0.5 * acceleration, abs=1e-2)
