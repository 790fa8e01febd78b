"""Intervals beside tolerances that show nothing along a nominal robot's motion: a level arm on a base that tilts."""

from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import assembled, build
from mbexport.core.control import Control
from mbexport.core.database import Tolerance, load
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.nuisances import Whitening, whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.tolerated import with_tolerances
from mbexport.core.effects import EffectRow
from mbexport.core.kinematics import dynamics
from mbexport.core.recording import Run

from .pendulums import INERTIA, soft_run

TILT, HEAVIER = 0.03, 0.01
NOISE = 1e-4


def fitted(heavier, tolerance):
    """The tilt of a SCARA whose arms are all heavier, of which its database knows so much, before and after."""
    arm = replace(load("scara"), tolerance=Tolerance(mass=tolerance))
    t = np.arange(1001) / 250.0
    sizes, rates = (0.8, 0.6, 0.02, 0.5), (2.0, 3.1, 2.3, 4.1)
    q = np.column_stack([size * np.sin(rate * t) for size, rate in zip(sizes, rates, strict=True)])
    dq = np.column_stack([size * rate * np.cos(rate * t) for size, rate in zip(sizes, rates, strict=True)])
    ddq = np.column_stack([-size * rate**2 * np.sin(rate * t) for size, rate in zip(sizes, rates, strict=True)])
    tilted = assembled(arm, {"base_tilt": (EffectRow(0, {"roll": TILT, "pitch": 0.0}),)})
    level = dynamics(build(arm, "rigid"))
    there, still = dynamics(tilted), np.zeros_like(q)
    # weight goes with mass; what the arms take to be moved does so too
    weight = (1.0 + heavier) * (there.gravity(q) - level.gravity(q))
    random = np.random.default_rng(2)
    tau = level.inverse_dynamics(q, dq, ddq) + weight + NOISE * random.normal(size=q.shape)
    assert np.allclose(level.inverse_dynamics(q, still, still), level.gravity(q))
    noise = {"q": np.full(4, 1e-7), "tau": np.full(4, NOISE)}
    run = Run("swing", t, {"q": q, "tau": tau}, Control("unknown"), noise, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    whiten, parts = whitening(asked), blocks(asked.evidence)
    item = Found("base_tilt", 0, EffectRow(0, {"roll": 0.9 * TILT, "pitch": 1e-3}), 50.0)
    fit = refined(asked, whiten, [item], parts)
    return fit, with_tolerances(asked, whiten, fit, parts)


@pytest.mark.parametrize(("heavier", "tolerance"), [(HEAVIER, HEAVIER), (0.0, 0.0)])
def test_a_tilt_is_known_no_better_than_the_masses_that_it_weighs(heavier, tolerance):
    """It was told to a tenth of that: a mass shows nothing on a level base."""
    before, after = fitted(heavier, tolerance)
    roll = before.rows["base_tilt", 0].values["roll"]
    assert roll == pytest.approx((1.0 + heavier) * TILT, rel=1e-3)
    sigma, wider = (float(np.sqrt(fit.covariance[0, 0])) for fit in (before, after))
    assert sigma < 0.1 * HEAVIER * TILT
    if tolerance:
        # each arm's own mass is off by itself: together by less than all of them at once
        assert 0.3 * HEAVIER * TILT < wider < HEAVIER * TILT
    else:
        assert wider == sigma


def test_a_spring_that_rings_is_known_no_better_than_what_it_moves():
    """As hard again as its mass is heavy; other effects' numbers are left alone where nobody asks for them."""
    loose = replace(load("pendulum"), tolerance=Tolerance(mass=HEAVIER))
    row = {"stiffness": INERTIA * 30.0**2, "damping": 0.3}
    asked = problem(loose, "rigid", [soft_run(**row, seed=seed) for seed in (1, 2)])
    whiten, parts = whitening(asked), blocks(asked.evidence)
    fit = refined(asked, whiten, [Found("joint_compliance", 1, EffectRow(1, row), 50.0)], parts)
    wider = with_tolerances(asked, whiten, fit, parts, ("joint_compliance",))
    known, told = (float(np.sqrt(one.covariance[0, 0])) / row["stiffness"] for one in (fit, wider))
    assert known < 0.1 * HEAVIER
    assert told == pytest.approx(HEAVIER, rel=0.1)
    assert with_tolerances(asked, whiten, fit, parts, ("payload",)) is fit


def test_amounts_of_nuisances_scatter_as_they_are_said_to():
    """By drawing amounts and noise anew: what is found differs from what was drawn by one standard error."""
    random = np.random.default_rng(3)
    columns = np.column_stack([3.0 * random.normal(size=50), random.normal(size=50), 0.05 * random.normal(size=50)])
    whiten = Whitening(np.zeros((50, 0)), np.zeros(0), ("loud", "plain", "silent"), columns)
    drawn = random.normal(size=(2000, 3))
    found = [whiten.amounts(random.normal(size=50) - columns @ one) for one in drawn]
    off = np.array([list(one.values()) for one in found]) - drawn
    said = whiten.unsure()
    assert list(said) == list(whiten.names)
    np.testing.assert_allclose(np.std(off, axis=0), list(said.values()), rtol=0.06)
