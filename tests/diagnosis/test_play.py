"""Arms that cross their clearances along a recorded motion, against two bodies that hit each other in fine steps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pendulums import INERTIA, rattling_run
from scipy.integrate import solve_ivp

from mbexport.core.database import load
from mbexport.core.diagnosis import inverse, play
from mbexport.core.diagnosis.play import finer_steps, thrown_back
from mbexport.core.diagnosis.problem import problem
from mbexport.core.effects import EffectRow

GAP = 0.01
UPRIGHT = replace(load("pendulum"), gravity=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("ratio", [0.0, 0.15, 0.6, 0.9, 1.0, 1.5, 3.0])
def test_a_body_leaves_a_contact_as_fast_as_its_equation_has_it(ratio):
    def leaves(t, y):
        return y[0] + 2.0 * ratio * y[1] if t > 1e-3 else 1.0

    leaves.terminal, leaves.direction = True, -1.0
    path = solve_ivp(
        lambda t, y: [y[1], -y[0] - 2.0 * ratio * y[1]], (0.0, 60.0), [0.0, 1.0], rtol=1e-10, atol=1e-13, events=leaves
    )
    assert thrown_back(np.array([ratio]))[0] == pytest.approx(-path.y[1, -1], rel=2e-3)


def left_of(run, rotor, gap):
    """Mean square of what is left of each signal, in units of noise."""
    inverse._moved.cache_clear()
    asked = problem(UPRIGHT, "rigid", [run])
    rows = {"rotor_inertia": (EffectRow(1, {"inertia": rotor}),)}
    if gap:
        rows["backlash"] = (EffectRow(1, {"gap": gap, "stiffness": math.inf, "damping": math.inf}),)
    left = asked.residual(rows)
    return {c.signal: float(np.mean(left[c.first : c.last] ** 2)) for c in asked.evidence.channels}


def as_the_spring_has_it(stiffness, damping, arm, motor):
    return damping, np.zeros(len(damping), dtype=bool)


def never(stiffness, damping, arm, motor):
    return 6.0 * np.sqrt(stiffness * arm), np.ones(len(damping), dtype=bool)


@pytest.mark.parametrize(
    ("heavier", "wrong"), [(4.0, never), (2.0, never), (2.0, as_the_spring_has_it), (0.25, as_the_spring_has_it)]
)
def test_an_arm_is_thrown_back_by_a_motor_heavier_than_it_and_goes_on_with_a_lighter_one(monkeypatch, heavier, wrong):
    """Before a record that is far too slow for the blows, 500 rows a second for contacts of 500 Hz."""
    rotor = heavier * INERTIA
    run = rattling_run(GAP, rotor)
    rigid, known, narrow, wide = (left_of(run, rotor, width * GAP) for width in (0.0, 1.0, 0.8, 1.2))
    monkeypatch.setattr(play, "rebounding", wrong)
    other = left_of(run, rotor, GAP)
    assert known["q_link"] < 0.01 * rigid["q_link"]
    for signal in ("tau", "u"):
        assert known[signal] < 0.12 * rigid[signal]
        assert known[signal] < 0.4 * min(narrow[signal], wide[signal], other[signal])


def test_contacts_are_followed_in_steps_and_softer_where_these_would_be_too_many():
    stiffness, arm = np.array([2.5e6, 9.0, 1e12]), np.array([0.25, 1.0, 1.0])
    steps, followed = finer_steps(stiffness, arm, np.array([True, False, False]), 0.002)
    assert (steps, followed.tolist()) == (26, stiffness.tolist())
    steps, followed = finer_steps(stiffness, arm, np.array([True, False, True]), 0.002)
    assert steps == 128
    assert followed[2] == pytest.approx((0.25 * 128 / 0.002) ** 2)
    assert followed[:2].tolist() == stiffness[:2].tolist()
