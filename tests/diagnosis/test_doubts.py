"""Intervals of laws of another form: they hold what else a number may be, and no more where there is no such form."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

import mbexport
from mbexport.core.database import load
from mbexport.core.diagnosis import diagnose
from mbexport.core.diagnosis.beyond import SECOND, SECOND_PHASE
from mbexport.core.diagnosis.doubts import _widths, doubted, doubts_of, untold
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.hypothesis import defaults
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_laws import beyond_catalogue, straightened
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import Refined, refined
from mbexport.core.effects import EffectRow

from .pendulums import INERTIA, WEIGHT, command, pendulum_run, soft_run

DAMPS = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)
SPRING = {"stiffness": INERTIA * 30.0**2, "damping": 0.3}
SOFT = Found("joint_compliance", 1, EffectRow(1, SPRING), 50.0)
PLACE = ("viscous_friction", 1, "coefficient")


def asked_of(runs):
    asked = problem(load("pendulum"), "rigid", runs)
    return asked, whitening(asked), blocks(asked.evidence)


def damped(bend):
    """Viscous friction fitted to a resistance of another form, how far it may be another number, its least squares."""
    runs = [pendulum_run("motion", lambda t, q, dq: bend(dq), seed=seed) for seed in (1, 2)]
    asked, whiten, parts = asked_of(runs)
    fit = refined(asked, whiten, [DAMPS], parts)
    doubts = doubts_of(asked, whiten, [DAMPS], fit, fit, parts)
    speed = command(np.linspace(0.0, 4.0, 4001))[1]
    torque = np.array([bend(v) for v in speed.tolist()])
    return fit, doubts, float(speed @ torque / (speed @ speed))


def test_numbers_that_do_the_same_go_nowhere_together_for_a_law_of_another_form():
    """A rotor's inertia and its arm's are one number to a motor: by how much each is, other forms do not say."""

    def bend(t, q, dq):
        return 0.5 * dq / (1.0 + 0.15 * abs(dq))

    asked, whiten, parts = asked_of([pendulum_run("motion", bend, seed=seed) for seed in (1, 2)])
    turns = Found("rotor_inertia", 1, EffectRow(1, {"inertia": 0.01}), 20.0)
    heavy = Found("link_inertia", 1, EffectRow(1, {**defaults("link_inertia"), "Izz": 0.01}), 20.0)
    found = [DAMPS, turns, heavy]
    fit = refined(asked, whiten, found, parts)
    doubts = doubts_of(asked, whiten, found, fit, fit, parts)
    assert doubts[PLACE] > 0.01
    for place in fit.free:
        assert doubts[place] < 0.2


def half_of(fit, place):
    k = fit.free.index(place)
    return 1.96 * math.sqrt(fit.covariance[k, k])


def test_friction_that_yields_is_one_number_near_rest_and_another_at_speed():
    fit, doubts, nearest = damped(lambda dq: 0.5 * dq / (1.0 + 0.15 * abs(dq)))
    value = fit.rows["viscous_friction", 1].values["coefficient"]
    half = half_of(doubted(fit, doubts), PLACE)
    assert half_of(fit, PLACE) < 0.02 < half
    for other in (0.5, nearest):
        assert abs(value - other) < half


def test_friction_of_the_catalogue_is_one_number():
    fit, doubts, nearest = damped(lambda dq: 0.5 * dq)
    assert fit.rows["viscous_friction", 1].values["coefficient"] == pytest.approx(0.5, rel=0.01)
    assert nearest == pytest.approx(0.5)
    assert doubts.get(PLACE, 0.0) < 0.01
    assert half_of(doubted(fit, doubts), PLACE) < 0.02


def test_a_spring_that_stiffens_has_as_many_stiffnesses_as_it_is_asked_for():
    stiffening = 0.5 / (WEIGHT / SPRING["stiffness"]) ** 2
    asked, whiten, parts = asked_of([soft_run(**SPRING, stiffening=stiffening, seed=seed) for seed in (1, 2)])
    question = (asked, whiten, [SOFT])
    straight = refined(*question, parts)
    before = float(np.sum(whiten(asked.residual({})) ** 2))
    bent = beyond_catalogue(*question, straight, parts, SOFT, before)
    nearest = straightened(*question, bent, parts)
    wide = doubted(nearest, doubts_of(*question, bent, nearest, parts))
    value = nearest.rows[SOFT.key].values
    # the straight one whose torque is nearest along the stretches that its weight makes
    stretch = np.linspace(-1.0, 1.0, 201) * WEIGHT / SPRING["stiffness"]
    torque = SPRING["stiffness"] * stretch * (1.0 + stiffening * stretch**2)
    chord = float(torque @ stretch / (stretch @ stretch))
    for name, other in (("stiffness", chord), ("damping", SPRING["damping"])):
        place = (*SOFT.key, name)
        assert half_of(nearest, place) < half_of(wide, place)
        assert abs(value[name] - other) < half_of(wide, place)


def test_a_straight_spring_has_one():
    asked, whiten, parts = asked_of([soft_run(**SPRING, seed=seed) for seed in (1, 2)])
    fit = refined(asked, whiten, [SOFT], parts)
    assert straightened(asked, whiten, [SOFT], fit, parts) is fit
    assert doubts_of(asked, whiten, [SOFT], fit, fit, parts) == {}
    assert doubted(fit, {}) is fit


def test_a_law_that_is_nearest_where_noise_is_low_is_not_the_one_that_is_nearest():
    """Slow noise hides that friction is more one way: along the motion it is more on average."""

    def law(speed):
        return 0.5 * (1.0 + 0.2 * np.sign(speed)) * np.tanh(speed / 1.0e-3)

    def slowly_loud(seed):
        run = pendulum_run("motion", lambda t, q, dq: law(dq), seed=seed, duration=2.2)
        white = np.random.default_rng(seed).normal(size=(len(run.t) + 2000, 1))
        slow = lfilter([math.sqrt(1.0 - 0.99**2)], [1.0, -0.99], white, axis=0)[2000:]
        return replace(run, signals={**run.signals, "tau": run.signals["tau"] + 0.05 * slow})

    asked, whiten, parts = asked_of([slowly_loud(1), slowly_loud(2)])
    rubs = Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.5}), 50.0)
    fit = refined(asked, whiten, [rubs], parts)
    doubts = doubts_of(asked, whiten, [rubs], fit, fit, parts)
    sides = np.sign(command(np.linspace(0.0, 2.2, 2201))[1])
    (place,) = fit.free
    half = half_of(doubted(fit, doubts), place)
    for other in (0.5, 0.5 * (1.0 + 0.2 * float(np.mean(sides)))):
        assert abs(fit.rows[rubs.key].values["torque"] - other) < half
    assert half < 0.15


def test_a_wave_goes_otherwise_where_what_comes_twice_as_often_is_left_out():
    """Over a turn and a half of it the two are not apart: the plain one that is nearest is another one."""
    cycles, phase = 6.0, 0.4
    values = {"amplitude": 0.3, "cycles": cycles, "phase": phase, SECOND: 0.35, SECOND_PHASE: 2.0 * phase + 0.7}

    def wave(q):
        return 0.3 * (np.sin(cycles * q + phase) + 0.35 * np.sin(2.0 * (cycles * q + phase) + 0.7))

    runs = [pendulum_run("motion", lambda t, q, dq: float(wave(q)), seed=seed) for seed in (1, 2)]
    asked, whiten, parts = asked_of(runs)
    ripples = Found("torque_ripple", 1, EffectRow(1, values), 50.0)
    fit = refined(asked, whiten, [ripples], parts)
    nearest = straightened(asked, whiten, [ripples], fit, parts)
    wide = doubted(nearest, doubts_of(asked, whiten, [ripples], fit, nearest, parts))
    q = command(np.linspace(0.0, 4.0, 4001))[0]
    sine, cosine = np.linalg.lstsq(np.column_stack([np.sin(cycles * q), np.cos(cycles * q)]), wave(q), rcond=None)[0]
    plain = nearest.rows[ripples.key].values
    for name, other in (("amplitude", math.hypot(sine, cosine)), ("phase", math.atan2(cosine, sine))):
        place = (*ripples.key, name)
        assert half_of(nearest, place) < abs(plain[name] - other) < half_of(wide, place)


def test_play_in_which_an_arm_bounces_is_known_no_better_than_bouncing_lets_it_be():
    run = pendulum_run(duration=1.0)
    held = replace(run, locked=(1,))
    play = Found("backlash", 1, EffectRow(1, {**defaults("backlash"), "gap": 0.02}), 50.0)
    fit = SimpleNamespace(rows={play.key: play.row})
    assert _widths(problem(load("pendulum"), "rigid", [run]), [play, DAMPS], fit) == {(*play.key, "gap"): 0.0003}
    assert _widths(problem(load("pendulum"), "rigid", [held]), [play, DAMPS], fit) == {}


def test_a_diagnosis_tells_the_wider_interval():
    runs = [pendulum_run("motion", lambda t, q, dq: 0.5 * dq / (1.0 + 0.15 * abs(dq)), seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose(load("pendulum"), runs, level="rigid", backends=["mjcf"])
    (found,) = answer.which
    assert found.effect == "viscous_friction"
    least, most = found.parameters["coefficient"].ci95
    assert least < 0.4 < 0.5 < most


def rubbing_and_heavy(size):
    """Friction and a rotor that is hardly there, fitted together, each number known to within so much of itself."""
    runs = [pendulum_run("motion", lambda t, q, dq: 0.4 * dq, seed=seed) for seed in (1, 2)]
    asked, whiten, parts = asked_of(runs)
    found = [DAMPS, Found("rotor_inertia", 1, EffectRow(1, {"inertia": 0.01}), 20.0)]
    fit = refined(asked, whiten, found, parts)
    numbers = [fit.rows[key[:2]].values[key[2]] for key in fit.free]
    return asked, found, replace(fit, covariance=np.diag((size * np.array(numbers)) ** 2))


@pytest.mark.parametrize(("size", "lost"), [(0.4, []), (0.6, ["viscous_friction", "rotor_inertia"])])
def test_what_may_as_well_be_nothing_is_not_told_from_it(size, lost):
    asked, found, fit = rubbing_and_heavy(size)
    assert [item.effect for item in untold(asked, found, fit, fit, {})] == lost


@pytest.mark.parametrize(("first", "shown"), [(1.0, True), (0.0, False)])
def test_two_numbers_of_which_the_sum_is_known_are_told_from_nothing(first, shown):
    """Neither is known alone; nor is one that shows with what no run shows, and that is as it may be."""
    asked = problem(load("pendulum"), "rigid", [pendulum_run("motion"), pendulum_run("motion", seed=2)])
    heavy = Found("link_inertia", 1, EffectRow(1, {"mass": 1.0, "mx": first}), 50.0)
    fit = Refined(
        {heavy.key: heavy.row},
        np.zeros(10),
        (("link_inertia", 1, "mass"), ("link_inertia", 1, "mx")),
        np.array([[4.0, -3.99], [-3.99, 4.0]]),
        np.zeros((10, 2)),
        (True, shown),
    )
    assert untold(asked, [heavy], fit, fit, {}) == []
    loose = replace(fit, covariance=np.diag(np.diag(fit.covariance)))
    assert untold(asked, [heavy], loose, loose, {}) == [heavy]


def test_moments_that_were_left_out_put_others_in_doubt_and_not_their_own_body():
    """There are none without it."""
    asked = problem(load("pendulum"), "rigid", [pendulum_run("motion"), pendulum_run("motion", seed=2)])
    load_there = Found("payload", 0, EffectRow(0, {"mass": 1.0}), 50.0)
    rotor = Found("rotor_inertia", 1, EffectRow(1, {"inertia": 1.0}), 50.0)
    free = (("payload", 0, "mass"), ("rotor_inertia", 1, "inertia"))
    rows = {item.key: item.row for item in (load_there, rotor)}
    fit = Refined(rows, np.zeros(10), free, 0.01 * np.eye(2), np.zeros((10, 2)), (True, True))
    wide = replace(fit, covariance=np.eye(2))
    assert untold(asked, [load_there, rotor], fit, fit, {}) == []
    assert untold(asked, [load_there, rotor], fit, wide, {}) == [rotor]


def test_a_spring_whose_torque_is_known_is_told_from_nothing():
    """Soft and far away, or hard and near."""
    asked = problem(load("pendulum"), "rigid", [pendulum_run("motion"), pendulum_run("motion", seed=2)])
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 4.0, "rest": 3.0}), 50.0)
    free = tuple(("joint_spring", 1, name) for name in ("stiffness", "rest"))
    together = np.array([[16.0, -11.9], [-11.9, 9.0]])
    fit = Refined({spring.key: spring.row}, np.zeros(10), free, together, np.zeros((10, 2)), (True, True))
    assert untold(asked, [spring], fit, fit, {}) == []
    loose = replace(fit, covariance=np.diag(np.diag(together)))
    assert untold(asked, [spring], loose, loose, {}) == [spring]


def test_a_law_of_another_form_is_there_whatever_one_number_of_it_is():
    """Friction that yields is what was known of it at one speed; a rotor's inertia has no form to be another one."""
    asked, found, fit = rubbing_and_heavy(0.6)
    own = {key: 0.5 * fit.rows[key[:2]].values[key[2]] for key in fit.free}
    assert [item.effect for item in untold(asked, found, fit, fit, own)] == ["rotor_inertia"]


def test_a_finding_of_which_nothing_is_known_is_not_named(monkeypatch):
    """The other one is fitted again without it."""
    monkeypatch.setattr(diagnose, "untold", lambda asked, found, fit, whole, doubts: list(found[1:]))
    runs = [pendulum_run(against=lambda t, q, dq: 0.4 * dq + 2.0 * math.sin(q - 0.3), seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose("pendulum", runs, level="rigid", backends=[])
    (found,) = answer.which
    gone = [item for item in answer.rejected if "told from nothing" in item.why]
    assert len(gone) >= 1
    assert (found.effect, found.at) not in {(item.effect, item.at) for item in gone}
    assert answer.verdict == "partly_explained"
