"""What is made ready once for all runs says what it says of each; the long way round says the same."""

from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.diagnosis import inverse
from mbexport.core.diagnosis.mechanism import Itself, mechanism_of, rubbing_of
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.prepare import creep_of, prepared
from mbexport.core.effects import EffectRow

from .jumping import PLANAR, recorded, smooth

SOFT = {"joint_compliance": (EffectRow(1, {"stiffness": 9.0e3, "damping": 8.0}),)}
RUBS = {
    "coulomb_friction": tuple(EffectRow(at, {"torque": 0.7 * at}) for at in (1, 2)),
    "hysteresis": (EffectRow(2, {"torque": 0.4, "stiffness": 60.0, "slips": 3}),),
}
PULLS = {"joint_spring": (EffectRow(1, {"stiffness": 20.0, "rest": 0.1}),)}
LEANS = {"load_friction": (EffectRow(1, {"coefficient": 0.02}),)}


@pytest.fixture(scope="module")
def run():
    return recorded(smooth)


def robot(run, *rows):
    return robot_of(PLANAR, "rigid", run, {name: row for more in rows for name, row in more.items()})


def spoken(asked, run):
    grid = prepared(run)
    return inverse.said(asked, grid, robot(run), creep_of(grid))


@pytest.mark.parametrize("rows", [(RUBS,), (RUBS, PULLS), (RUBS, SOFT)], ids=["rigid", "pulled", "soft"])
def test_each_joint_by_itself_rubs_as_all_together(run, rows, monkeypatch):
    apart = robot(run, *rows)
    assert len(mechanism_of(apart).by_motors) == PLANAR.n
    by_itself = spoken(apart, run)
    together = replace(mechanism_of(apart), by_motors=(), rubbing=rubbing_of(apart))
    monkeypatch.setattr(inverse, "mechanism_of", lambda _: together)
    for name in ("tau", "tau_link", "q_link"):
        np.testing.assert_array_equal(getattr(spoken(apart, run), name), getattr(by_itself, name))
    assert np.ptp(by_itself.tau - by_itself.tau_link, axis=0).min() > 0.5


@pytest.mark.parametrize("rows", [(SOFT, PULLS), (LEANS,), (SOFT, LEANS)])
def test_what_depends_on_the_arm_is_asked_with_it(run, rows):
    assert mechanism_of(robot(run, RUBS, *rows)).by_motors == ()


def test_robots_that_differ_in_friction_alone_have_the_same_bodies(run):
    bare, rubbing, soft = (mechanism_of(robot(run, *rows)) for rows in ((), (RUBS,), (RUBS, SOFT)))
    assert bare.bodies is rubbing.bodies
    assert soft.bodies is not bare.bodies


def test_what_is_equal_is_not_itself(run):
    one, other = robot(run), robot(run)
    assert one == other and one is not other
    assert Itself(one) == Itself(one) and hash(Itself(one)) == hash(Itself(one))
    assert Itself(one) != Itself(other)
