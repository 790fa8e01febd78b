"""Springs that stiffen: found along the motion as what they are, told, and handed on as straight ones."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.build import assembled
from mbexport.core.database import load
from mbexport.core.diagnosis import resonance
from mbexport.core.diagnosis.beyond import STIFFENING, places
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.forms import STIFFENS_SAID
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.hypothesis import defaults
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_laws import beyond_catalogue, straightened
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.resonance import springs, stiffening
from mbexport.core.diagnosis.ringing import RINGS, SMALL, rings_first, stiffens_instead
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.state import Search
from mbexport.core.effects import EffectRow
from mbexport.core.expansion import expanded

from .pendulums import INERTIA, WEIGHT, soft_run
from .searching import having

OMEGA = 30.0
SPRING = {"stiffness": INERTIA * OMEGA**2, "damping": 0.3}
# half as stiff again at the stretch that its weight makes
STIFFER = 0.5 / (WEIGHT / SPRING["stiffness"]) ** 2


def asked_of(stiffening, **options):
    runs = [soft_run(**SPRING, stiffening=stiffening, seed=seed, **options) for seed in (1, 2)]
    return problem(load("pendulum"), "rigid", runs)


def spring(**values):
    return Found("joint_compliance", 1, EffectRow(1, SPRING | values), 50.0)


def fitted(stiffening):
    """A pendulum's question, its parts and the straight spring's fit, and what is there without it."""
    asked = asked_of(stiffening)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    return (
        (asked, whiten),
        parts,
        refined(asked, whiten, [spring()], parts),
        float(np.sum(whiten(asked.residual({})) ** 2)),
    )


def test_the_motion_behind_it_is_that_of_another_integrator():
    asked = asked_of(STIFFER, noisy=False)
    straight, stiff = (
        float(np.mean(asked.residual({"joint_compliance": (row,)}) ** 2))
        for row in (spring().row, spring(**{STIFFENING: STIFFER}).row)
    )
    assert stiff < 0.2
    assert straight > 1e3 * stiff


def test_it_hangs_where_its_torque_bears_the_weight():
    """At rest K s (1 + stiffening s^2) is the weight's moment there."""
    asked = asked_of(STIFFER, noisy=False)
    row = {"joint_compliance": (spring(**{STIFFENING: STIFFER}).row,)}
    begin = asked.spoken(row)[0]
    stretch = asked.evidence.runs[0].q[0, 0] - begin.q_link[0, 0]
    assert SPRING["stiffness"] * stretch * (1.0 + STIFFER * stretch**2) == pytest.approx(
        WEIGHT * math.sin(begin.q_link[0, 0]), rel=1e-6, abs=1e-9
    )


def test_a_fit_finds_how_much_it_stiffens():
    question, parts, straight, before = fitted(STIFFER)
    fit = beyond_catalogue(*question, [spring()], straight, parts, spring(), before)
    values = fit.rows["joint_compliance", 1].values
    assert values[STIFFENING] == pytest.approx(STIFFER, rel=0.02)
    assert values["stiffness"] == pytest.approx(SPRING["stiffness"], rel=0.01)
    assert float(np.mean(fit.left**2)) < 1.5 < 100.0 < float(np.mean(straight.left**2))


def test_a_spring_that_is_thrown_beyond_all_numbers_stretches_by_nothing_that_counts(monkeypatch):
    """And nobody is warned of it: such springs are tried, and given up."""
    asked = asked_of(0.0)
    monkeypatch.setattr(resonance, "stretch_of", lambda *_: np.full(3, 1e200))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert resonance.stretch_along(asked, {}, "joint_compliance", 1) == 0.0


def test_a_straight_spring_stays_one():
    question, parts, straight, before = fitted(0.0)
    assert beyond_catalogue(*question, [spring()], straight, parts, spring(), before) is straight


@pytest.mark.parametrize("stiffening", [STIFFER, 0.0])
def test_a_spring_that_stiffens_takes_the_place_of_a_straight_one_and_what_is_small_beside_it(stiffening):
    """And not where a straight one and the other say more."""
    offset = 0.0 if stiffening else 0.02
    runs = [soft_run(**SPRING, stiffening=stiffening, seed=seed) for seed in (1, 2)]
    runs = [replace(one, signals={**one.signals, "tau": one.signals["tau"] + offset}) for one in runs]
    asked = problem(load("pendulum"), "rigid", runs)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    small = Found("torque_offset", 1, EffectRow(1, {"torque": 0.02}), 0.5 * SMALL * spring().gain)
    state = having(asked, whiten, parts, [spring(), small])
    bent = stiffens_instead(state, parts)
    if not stiffening:
        assert bent is None
        return
    kept, fit = bent
    assert [item.effect for item in kept] == ["joint_compliance"]
    assert fit.rows["joint_compliance", 1].values[STIFFENING] == pytest.approx(STIFFER, rel=0.02)
    # another cause that is as large stays
    large = having(asked, whiten, parts, [spring(), replace(small, gain=2.0 * SMALL * spring().gain)])
    assert stiffens_instead(large, parts) is None


def test_what_is_no_spring_has_no_stiffening():
    question, parts, _, before = fitted(STIFFER)
    damps = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)
    fit = refined(*question, [damps], parts)
    assert beyond_catalogue(*question, [damps], fit, parts, damps, before) is fit


def test_a_database_gets_the_straight_spring_that_is_nearest():
    question, parts, straight, before = fitted(STIFFER)
    bent = beyond_catalogue(*question, [spring()], straight, parts, spring(), before)
    handed = straightened(*question, [spring()], bent, parts)
    values = handed.rows["joint_compliance", 1].values
    assert STIFFENING not in values
    # between its own at rest and the steepest there is
    assert SPRING["stiffness"] < values["stiffness"] < 4.0 * SPRING["stiffness"]
    assert np.sum(handed.left**2) < 1.01 * np.sum(straight.left**2)
    assert straightened(*question, [spring()], straight, parts) is straight


def test_a_diagnosis_names_it_and_says_that_it_stiffens(tmp_path):
    runs = [soft_run(**SPRING, stiffening=STIFFER, seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose(load("pendulum"), runs, level="rigid", backends=["mjcf"])
    (found,) = answer.which
    assert (found.effect, found.at) == ("joint_compliance", "joint_1")
    assert answer.verdict == "explained"
    assert STIFFENS_SAID in answer.unexplained.looks_like
    # the corrected model is one that every engine takes
    assert set(answer.effects["joint_compliance"][0].values) == {"stiffness", "damping"}


@pytest.mark.parametrize(
    ("omega", "times"),
    [
        # it rings nowhere as a straight one does: no straight one leaves clearly less
        (20.0, 1.0),
        # the straight one that is nearest makes the simulation no better
        (12.0, 3.0),
    ],
)
def test_it_is_named_where_no_straight_spring_helps(omega, times):
    """A spring that its weight makes stiffer by so many times."""
    values = {"stiffness": INERTIA * omega**2, "damping": 0.05}
    stiffening = times / (WEIGHT / values["stiffness"]) ** 2
    runs = [soft_run(**values, stiffening=stiffening, seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose(load("pendulum"), runs, level="rigid", backends=["mjcf"])
    assert [(found.effect, found.at) for found in answer.which] == [("joint_compliance", "joint_1")]
    assert STIFFENS_SAID in answer.unexplained.looks_like
    # which is told as what it is worth
    assert answer.how_far.shrinks_by < 0.25
    assert answer.unexplained.share > 0.5
    helps = answer.how_far.shrinks_by > 0.01
    assert any("the corrected model is not" in note for note in answer.notes) is not helps
    assert helps is (omega == 20.0)


@pytest.mark.parametrize(("times", "straight"), [(0.0, True), (3.0, False)])
def test_one_that_stiffens_rings_nowhere_as_a_straight_one_does(times, straight):
    """Its weight makes it stiffer by so many times: it is found as it stiffens, before small parts of its noise are."""
    values = {"stiffness": INERTIA * 12.0**2, "damping": 0.05}
    stiffens = times / (WEIGHT / values["stiffness"]) ** 2
    asked = problem(load("pendulum"), "rigid", [soft_run(**values, stiffening=stiffens, seed=seed) for seed in (1, 2)])
    state = Search(asked, whitening(asked))
    state.begin()
    state.scales = scales_of(asked, {})
    loud = float(state.left @ state.left)

    def least(options):
        left = [state.whiten(asked.misfit(one.rows(np.zeros_like(one.scale)) or {})) for one in options]
        return min(float(rest @ rest) for rest in left) / loud

    drives = [one for one in springs(asked, {}, state.scales, ()) if one.effect == "joint_compliance"]
    takes = least(drives) < 1.0 - RINGS
    assert takes is straight
    bent = [other for one in drives for other in stiffening(asked, {}, one)]
    assert straight or least(bent) < 0.9 * least(drives)
    (found,) = rings_first(state, blocks(asked.evidence))
    assert found.key == ("joint_compliance", 1)
    assert (found.row.values.get(STIFFENING, 0.0) > 0.0) is not straight


@pytest.mark.parametrize(
    ("effect", "values", "ends"),
    [
        ("joint_compliance_6d", {"krx": 1e4, "kry": 2e4}, ("_rx", "_ry")),
        ("link_flexibility", {"ku": 1e4, "kv": 2e4}, ("_u", "_v")),
    ],
)
def test_its_places_are_the_directions_that_give(effect, values, ends):
    robot = assembled(load("imece2013"), {effect: (EffectRow(2, defaults(effect) | values),)})
    whole = expanded(robot, imposed=True)
    own = whole.driven[1]
    names = [whole.robot.stages[k].joint.name for k in places(robot, whole, effect, 2) if k != own]
    assert tuple(name[-len(end) :] for name, end in zip(names, ends, strict=True)) == ends
    assert {name.split("_")[1] for name in names} == {"2"}
