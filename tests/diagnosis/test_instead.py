"""Other names in the place of findings."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.diagnosis import instead
from mbexport.core.diagnosis.contender import Contender
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found, rows_of
from mbexport.core.diagnosis.hypothesis import Hypothesis
from mbexport.core.diagnosis.instead import swapped
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.refine import left_with, refined
from mbexport.core.diagnosis.state import Search
from mbexport.core.effects import EffectRow

from .searching import COLUMNS, NO_SPRING, having, question


def test_a_name_that_says_more_beside_the_others_is_put_in_the_place_of_one_picked_before():
    """A mass at the arm's end, taken for a motor's constant while all of it stood beside friction alone."""
    asked = question(lambda t, q, dq: 0.3 * math.tanh(dq / 1e-3) + 0.2 * math.sin(q), mode="unknown")
    whiten, parts = whitening(asked), blocks(asked.evidence)
    both = [
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.3}), 50.0, EffectRow(1, {"torque": 0.0})),
        Found("torque_constant", 1, EffectRow(1, {"gain": 0.96}), 50.0, EffectRow(1, {"gain": 1.0})),
    ]
    state = having(asked, whiten, parts, both)
    before = float(state.left @ state.left)
    assert swapped(state, parts)
    assert {item.effect for item in state.found} & {"payload", "link_inertia"}
    assert "torque_constant" not in {item.effect for item in state.found}
    assert float(state.left @ state.left) < before - 20.0
    assert not swapped(state, parts)


@pytest.mark.parametrize("seems_to_leave", [0.0, 0.02])
@pytest.mark.parametrize("unreal", [False, True])
def test_the_plain_name_takes_the_place_of_one_with_more_numbers_that_says_the_same(
    monkeypatch, unreal, seems_to_leave
):
    """Friction that holds at once, taken for one that winds up a little first while something else was not fitted.

    Though it could not be before that was, and though it seems to leave a little more until all is fitted.
    """
    asked = question(lambda t, q, dq: 0.3 * math.tanh(dq / 1e-3) + 0.4 * dq)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    winds = {"torque": 0.3, "stiffness": 300.0, "slips": 8.0}
    both = [
        Found("hysteresis", 1, EffectRow(1, winds), 50.0, EffectRow(1, winds | {"torque": 1e-9})),
        Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0, EffectRow(1, {"coefficient": 0.0})),
    ]
    state = Search(asked, whiten)
    state.begin()
    whole = float(state.left @ state.left)
    state.take(both, refined(asked, whiten, both, parts))
    before = float(state.left @ state.left)
    if unreal:
        state.unreal.add(("coulomb_friction", 1))
    if seems_to_leave:
        all_of = instead.contenders

        def roughly(beside, *rest):
            more = np.sqrt(seems_to_leave * float(beside.left @ beside.left) / len(beside.left))
            return [replace(one, left=one.left + more) for one in all_of(beside, *rest)]

        monkeypatch.setattr(instead, "contenders", roughly)
    assert swapped(state, parts)
    assert [item.effect for item in sorted(state.found, key=lambda one: one.effect)] == [
        "coulomb_friction",
        "viscous_friction",
    ]
    # more may be left than before, but next to nothing beside what it explains
    assert float(state.left @ state.left) - before < 0.002 * whole


@pytest.mark.parametrize("something_else", [True, False])
def test_a_plain_name_that_explains_something_else_takes_no_ones_place(monkeypatch, something_else):
    """An offset takes much of a channel that nothing explains, and none of what a spring does."""
    asked = question(lambda t, q, dq: 0.3 * math.tanh(dq / 1e-3) + 1.0 * (q - 0.4))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    both = [
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.3}), 50.0, EffectRow(1, {"torque": 0.0})),
        Found("joint_spring", 1, EffectRow(1, {"stiffness": 1.0, "rest": 0.4}), 50.0, NO_SPRING),
    ]
    state = having(asked, whiten, parts, both)
    loud, fitted, left_of = 1e5 * np.ones(len(state.left)), refined, left_with
    offset = Hypothesis("torque_offset", 1, "", lambda beta: {"torque": 0.1}, np.ones(1), np.zeros(1))
    contender = Contender(offset, 90.0, 1.0, np.ones(1), np.zeros(len(loud)), 1.0)
    without_spring = left_of(asked, whiten, rows_of(both[:1]))

    def as_said(other, trial, *rest):
        other.found, other.slope = list(trial), np.ones((len(loud), 2))
        other.left = without_spring + 0.999 * loud if something_else else state.left + 0.9999 * loud

    monkeypatch.setattr(instead, "left_with", lambda *asked: left_of(*asked) + loud)
    monkeypatch.setattr(instead, "refined", lambda *asked: replace(fitted(*asked), left=state.left + loud))
    monkeypatch.setattr(instead, "contenders", lambda *beside: [contender])
    monkeypatch.setattr(instead, "prune", as_said)
    assert swapped(state, parts) == (not something_else)


@pytest.mark.parametrize(("says_more", "names"), [(0.0, 2), (60.0, 1)])
def test_one_cause_with_more_numbers_than_two_must_say_more_than_they_do(monkeypatch, says_more, names):
    """Two encoders that are off, for which one arm's geometry was named that says the same with five numbers."""
    asked = question(lambda t, q, dq: 0.3 * math.tanh(dq / 1e-3) + 0.4 * dq)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    both = [
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.3}), 50.0, EffectRow(1, {"torque": 0.0})),
        Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0, EffectRow(1, {"coefficient": 0.0})),
    ]
    state = having(asked, whiten, parts, both)
    values = dict.fromkeys(("alpha", "a", "theta", "d", "beta"), 0.01)
    one = Hypothesis("kinematic_error", 1, "all", lambda beta: values, np.ones(5), np.zeros(5))
    state.first = [Contender(one, 90.0, 1.0, np.ones(5), state.left, 1.0)]
    said = state.left * math.sqrt(1.0 - 2.0 * says_more / float(state.left @ state.left))

    def as_said(other, trial, fit, parts, keep=None):
        other.found, other.left, other.slope = list(trial)[:1], said, np.ones((len(said), 5))

    monkeypatch.setattr(instead, "refined", lambda *asked: None)
    monkeypatch.setattr(instead, "prune", as_said)
    monkeypatch.setattr(instead, "without_bodies", lambda *asked: set())
    instead.condense(state, parts)
    assert len(state.found) == names


def test_more_numbers_of_a_finding_in_the_place_of_another_are_no_second_one(monkeypatch):
    """Of an effect that may be found with some of its numbers."""
    asked = question()
    whiten, parts = whitening(asked), blocks(asked.evidence)
    body = EffectRow(1, dict.fromkeys(COLUMNS, 0.0) | {"mass": 0.05})
    both = [
        Found("link_inertia", 1, body, 50.0, EffectRow(1, dict.fromkeys(COLUMNS, 0.0))),
        Found("torque_offset", 1, EffectRow(1, {"torque": 0.1}), 50.0, EffectRow(1, {"torque": 0.0})),
    ]
    state = having(asked, whiten, parts, both)
    trials = []
    fuller = Hypothesis("link_inertia", 1, "all", lambda beta: dict(body.values), np.ones(1), np.zeros(1))
    contender = Contender(fuller, 90.0, 1.0, np.ones(1), state.left, 1.0)
    monkeypatch.setattr(instead, "contenders", lambda *beside: [contender])
    monkeypatch.setattr(instead, "prune", lambda other, trial, *rest: trials.append([item.key for item in trial]))
    assert not swapped(state, parts)
    assert [("link_inertia", 1)] in trials
    assert all(len(set(trial)) == len(trial) for trial in trials)


def test_a_plain_name_is_held_against_the_others_fitted_anew(monkeypatch):
    """Moved in a straight line for want of a finding, others may leave far more than nothing does."""
    asked = question(lambda t, q, dq: 0.3 * math.tanh(dq / 1e-3) + 0.3 * math.sin(20.0 * q))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    wave = {"amplitude": 0.3, "cycles": 20.0, "phase": 0.0}
    both = [
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.3}), 50.0, EffectRow(1, {"torque": 0.0})),
        Found("torque_ripple", 1, EffectRow(1, wave), 50.0, EffectRow(1, wave | {"amplitude": 0.0})),
    ]
    state = having(asked, whiten, parts, both)
    before = float(state.left @ state.left)
    offset = Hypothesis("torque_offset", 1, "", lambda beta: {"torque": 0.1}, np.ones(1), np.zeros(1))
    contender = Contender(offset, 90.0, 1.0, np.ones(1), np.zeros(len(state.left)), 1.0)
    monkeypatch.setattr(instead, "contenders", lambda *_: [contender])
    monkeypatch.setattr(instead, "left_with", lambda *asked: left_with(*asked) + 1e4)
    assert not swapped(state, parts)
    assert [item.effect for item in state.found] == ["coulomb_friction", "torque_ripple"]
    assert float(state.left @ state.left) == before
