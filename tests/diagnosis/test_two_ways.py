"""Numbers of which the measured motion and simulation say two things."""

import math

import numpy as np
import pytest

from mbexport.core.diagnosis.refine import Refined
from mbexport.core.diagnosis.two_ways import reaching, ways_apart
from mbexport.core.effects import EffectRow

RIPPLE, SPRING, LATE = ("torque_ripple", 1), ("joint_compliance", 2), ("delay", 0)
FREE = (
    (*RIPPLE, "amplitude"), (*RIPPLE, "phase"), (*SPRING, "stiffness"), (*SPRING, "damping"), (*LATE, "time"),
)  # fmt: skip


def fit(amplitude, phase, stiffness, damping, time, covariance=None):
    rows = {
        RIPPLE: EffectRow(1, {"amplitude": amplitude, "cycles": 5.0, "phase": phase}),
        SPRING: EffectRow(2, {"stiffness": stiffness, "damping": damping}),
        LATE: EffectRow(0, {"time": time}),
    }
    covariance = np.eye(len(FREE)) if covariance is None else covariance
    return Refined(rows, np.zeros(3), FREE, covariance, np.zeros((3, len(FREE))), (True,) * len(FREE))


def test_how_far_two_ways_to_a_number_are_from_each_other():
    """Phases by less than a turn; a smoothed motion is no witness of damping and delays."""
    apart = ways_apart(fit(0.5, 3.1, 300.0, 2.0, 0.001), fit(0.4, -3.1, 310.0, 5.0, 0.003))
    assert apart == {
        FREE[0]: pytest.approx(0.1),
        FREE[1]: pytest.approx(2.0 * math.pi - 6.2),
        FREE[2]: pytest.approx(10.0),
    }


def test_an_interval_reaches_from_one_way_to_the_other():
    """And what goes together with it goes on to; what is known no better than that stays as it is."""
    both = np.diag([0.01, 1.0, 400.0, 1.0, 1.0])
    both[0, 1] = both[1, 0] = -0.09
    wide = reaching(fit(0.4, 0.0, 310.0, 5.0, 0.003, both), {FREE[0]: 0.2, FREE[2]: 10.0}).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(wide)), [0.2, 1.0, 20.0, 1.0, 1.0])
    assert wide[0, 1] == pytest.approx(-0.18)
