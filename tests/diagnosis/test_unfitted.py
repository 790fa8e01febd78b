"""What numbers that a fit left out of a body, or of an arm that is off, would have said the others said for them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis.fit import Part, blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import Refined, refined
from mbexport.core.diagnosis.unfitted import with_geometry, with_moments
from mbexport.core.effects import EffectRow, effect_named

from .pendulums import INERTIA, pendulum_run

MASS, OUT, THICK = 0.1, 0.42, 1.0e-4


def loaded(monkeypatch, name, values):
    """A pendulum with a thick load and its fit by a body without moments: (problem, nuisances, fit)."""
    monkeypatch.setattr("tests.diagnosis.pendulums.INERTIA", INERTIA + MASS * OUT**2 + THICK)
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: MASS * 9.81 * OUT * math.sin(q)) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    whiten = whitening(asked)
    row = EffectRow(0 if name == "payload" else 1, {c.name: 0.0 for c in effect_named(name).columns} | values)
    return asked, whiten, refined(asked, whiten, [Found(name, row.at, row, 50.0)], blocks(asked.evidence))


def spread_of(fit, name):
    k = [column for _, _, column in fit.free].index(name)
    return math.sqrt(fit.covariance[k, k])


@pytest.mark.parametrize(
    ("name", "values"),
    [("payload", {"mass": MASS, "x": OUT - 0.5}), ("link_inertia", {"mass": MASS, "mx": MASS * (OUT - 0.5)})],
)
def test_an_interval_knows_of_moments_that_were_left_out(monkeypatch, name, values):
    asked, whiten, fit = loaded(monkeypatch, name, values)
    wider = with_moments(asked, whiten, fit, blocks(asked.evidence))
    assert spread_of(wider, "mass") > 2.0 * spread_of(fit, "mass")
    apart = abs(fit.rows[name, fit.free[0][1]].values["mass"] - MASS)
    assert apart > 1.96 * spread_of(fit, "mass")
    assert apart < 1.96 * spread_of(wider, "mass")


def test_what_moments_move_goes_together_whatever_was_widened_before(monkeypatch):
    """A mass and its first moment say the same of an axis: one that is known worse since does not part them."""
    asked, whiten, fit = loaded(monkeypatch, "link_inertia", {"mass": MASS, "mx": MASS * (OUT - 0.5)})
    more = np.linspace(1.0, 3.0, len(fit.free))
    wide = replace(fit, covariance=fit.covariance * np.outer(more, more))
    parts = blocks(asked.evidence)
    by_runs, by_wide = (with_moments(asked, whiten, one, parts).covariance - one.covariance for one in (fit, wide))
    assert np.abs(by_runs).max() > 0.0
    np.testing.assert_allclose(by_wide, by_runs, rtol=1e-6, atol=1e-9 * np.abs(by_runs).max())


def test_what_is_no_body_has_no_moments():
    runs = [pendulum_run(against=lambda t, q, dq: 0.4 * dq, seed=seed) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    whiten = whitening(asked)
    found = [Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)]
    fit = refined(asked, whiten, found, blocks(asked.evidence))
    same = with_moments(asked, whiten, fit, blocks(asked.evidence))
    np.testing.assert_array_equal(same.covariance, fit.covariance)


@pytest.mark.parametrize(
    ("alike", "seen", "wide"), [(1.0, 0.0, 1.0), (0.5, 0.0, 0.5), (1.0, 30.0, 1.0 / 30.0), (0.0, 30.0, 0.0)]
)
def test_an_interval_knows_of_geometry_that_may_be_off_as_well(monkeypatch, alike, seen, wide):
    """As far as another angle says the same, and no farther than what else it says lets it be there."""
    found, per = 0.02, 1.0 / 0.0001
    random = np.random.default_rng(7)
    same, other = np.linalg.qr(random.normal(size=(400, 2)))[0].T

    def left_with(_problem, _whiten, rows):
        values = rows["kinematic_error"][0].values
        # of the other angle as much as was found is seen so many standard deviations
        return (values["theta"] - found + alike * values["beta"]) * per * same + seen * values["beta"] / found * other

    monkeypatch.setattr("mbexport.core.diagnosis.unfitted.left_with", left_with)
    asked = problem(load("pendulum"), "rigid", [pendulum_run()])
    row = EffectRow(1, dict.fromkeys(("alpha", "a", "theta", "d", "beta"), 0.0) | {"theta": found})
    fit = Refined(
        {("kinematic_error", 1): row}, np.zeros(400), (("kinematic_error", 1, "theta"),), np.array([[1e-8]]),
        per * same[:, None], (True,),
    )  # fmt: skip
    wider = with_geometry(asked, None, fit, [Part(0, 400, 0, 400)])
    assert math.sqrt(wider.covariance[0, 0] - 1e-8) == pytest.approx(wide * found, rel=0.01, abs=1e-12)
    assert with_moments(asked, None, fit, [Part(0, 400, 0, 400)]).covariance == fit.covariance


@pytest.mark.parametrize(("name", "place"), [("payload", 0), ("link_inertia", 1)])
def test_an_interval_knows_of_products_that_were_left_out(monkeypatch, name, place):
    """Where a body is along an axis its product says as well, about the frame of an arm most of all."""
    along = {"payload": "z", "link_inertia": "mz"}[name]
    same = np.linalg.qr(np.random.default_rng(7).normal(size=(400, 1)))[0][:, 0]

    def left_with(_problem, _whiten, rows):
        values = rows[name][0].values
        return (values[along] + values["Ixz"]) * 1e4 * same

    monkeypatch.setattr("mbexport.core.diagnosis.unfitted.left_with", left_with)
    asked = problem(load("pendulum"), "rigid", [pendulum_run()])
    row = EffectRow(place, {c.name: 0.0 for c in effect_named(name).columns} | {"mass": 1.0, along: 0.3})
    fit = Refined(
        {(name, place): row}, np.zeros(400), ((name, place, along),), np.array([[1e-8]]), 1e4 * same[:, None], (True,)
    )
    wider = with_moments(asked, None, fit, [Part(0, 400, 0, 400)])
    # a quarter of m c^2 of a load; of an arm, first moment times how far its own mass is out; of both a half
    arm = asked.database.inertias[0]
    away = math.sqrt(math.hypot(*arm.com) ** 2 + 0.5 * (arm.xx + arm.yy + arm.zz) / arm.mass)
    usual = {"payload": 0.25 * 0.3**2, "link_inertia": max(0.3 * away, 0.3**2)}[name]
    assert math.sqrt(wider.covariance[0, 0] - 1e-8) == pytest.approx(0.5 * usual, rel=0.01)
