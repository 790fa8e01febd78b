"""Which effects: on a pendulum that nothing of the package moves."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from mbexport.core.database import load
from mbexport.core.diagnosis import contender, refine
from mbexport.core.diagnosis.contender import Contender, _most_gone, ranked
from mbexport.core.diagnosis.fit import Part, blocks, gained, linear, unexpected
from mbexport.core.diagnosis.found import Found, rows_of
from mbexport.core.diagnosis.hypotheses import hypotheses
from mbexport.core.diagnosis.hypothesis import Hypothesis
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.state import Search, contenders, prune
from mbexport.core.effects import EffectRow
from mbexport.core.errors import MbexportError

from .pendulums import KD, KP, command, pendulum_run
from .searching import NO_SPRING, found, question, row


def test_a_perfect_model_leaves_unit_noise_and_nothing_is_found():
    asked = question()
    state, _ = found(asked)
    assert state.found == []
    assert np.mean(state.left**2) == pytest.approx(1.0, abs=0.2)


def test_viscous_friction_is_found_with_its_value():
    state, _ = found(question(lambda t, q, dq: 0.4 * dq))
    assert [(item.effect, item.place) for item in state.found] == [("viscous_friction", "joint_1")]
    assert state.found[0].row.values["coefficient"] == pytest.approx(0.4, rel=0.02)


def test_coulomb_friction_is_found_though_its_step_is_another():
    state, _ = found(question(lambda t, q, dq: 0.5 * math.tanh(dq / 2e-3)))
    assert state.found[0].effect == "coulomb_friction"
    assert state.found[0].row.values["torque"] == pytest.approx(0.5, rel=0.03)


def test_a_torque_limit_is_found_where_no_torque_was_recorded():
    most = 2.2

    def beyond(t, q, dq):
        wanted, faster, _ = command(t)
        asked = KP * (float(wanted) - q) + KD * (float(faster) - dq)
        return asked - min(max(asked, -most), most)

    runs = [pendulum_run("pd", seed=seed, against=beyond) for seed in (1, 2)]
    places = [replace(run, signals={k: v for k, v in run.signals.items() if k != "tau"}) for run in runs]
    state, _ = found(problem(load("pendulum"), "rigid", places))
    assert [(item.effect, item.place) for item in state.found] == [("torque_limit", "joint_1")]
    assert state.found[0].row.values["torque"] == pytest.approx(most, rel=0.02)


@pytest.mark.parametrize("rest", [0.8, 0.0])
def test_a_spring_says_where_it_rests_and_needs_no_torque_offset(rest):
    """It may have come beside an offset, and rest at 0 then."""
    asked = question(lambda t, q, dq: 0.5 * (q - rest), mode="unknown")
    whiten, parts = whitening(asked), blocks(asked.evidence)
    offset = Found(
        "torque_offset", 1, EffectRow(1, {"torque": -0.5 * rest or 1e-3}), 50.0, EffectRow(1, {"torque": 0.0})
    )
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 0.5, "rest": 1e-7}), 50.0, NO_SPRING)
    state = Search(asked, whiten)
    prune(state, [offset, spring], refined(asked, whiten, [offset, spring], parts), parts)
    assert [item.effect for item in state.found] == ["joint_spring"]
    assert state.found[0].row.values["rest"] == pytest.approx(rest, abs=0.02)


def test_an_arm_that_is_far_off_is_no_effect():
    """Half a radian, or a quarter of all arms' length: what is further off is another robot's."""
    asked = question()
    assert asked.farthest("theta") == 0.5
    assert asked.farthest("a") == pytest.approx(0.25 * 0.5)
    forms = [one for one in hypotheses(asked, {}, scales_of(asked, {}), []) if one.effect == "kinematic_error"]
    theta = next(one for one in forms if one.form == "theta")
    assert theta.rows(np.array([0.49])) is not None
    assert theta.rows(np.array([0.51])) is None
    assert refine.bounds_of(asked, "kinematic_error", 1, "theta") == (-0.5, 0.5)
    length = next(one for one in forms if one.form == "a")
    assert length.rows(np.array([0.12])) is not None
    assert length.rows(np.array([-0.13])) is None


def test_evidence_of_some_runs_is_part_of_the_whole():
    asked = question()
    both = asked.residual({})
    one = asked.only([1]).residual({})
    np.testing.assert_array_equal(one, both[asked.evidence.places([1])])
    assert 0 < len(one) < len(both)


def test_below_noise_nothing_is_gained():
    random = np.random.default_rng(0)
    noise, parts = random.normal(size=400), [Part(0, 400, 0, 400)]
    one = np.ones(400)
    # half of the noise is gone, as when a gain is turned down
    assert gained(noise, 0.5 * noise, one, parts) < 30.0
    assert 0.5 * (noise @ noise - 0.25 * noise @ noise) > 100.0
    # a gap that goes down to the noise counts in full
    assert gained(3.0 * noise, noise, one, parts) == pytest.approx(4.0 * noise @ noise)
    assert gained(noise, 3.0 * noise, one, parts) == -gained(3.0 * noise, noise, one, parts)


def test_a_small_amount_pays_for_its_choice_and_not_for_how_large_it_might_have_been():
    random = np.random.default_rng(0)
    slope = np.outer(random.normal(size=400), [1000.0])
    left = random.normal(size=400) + 0.01 * slope[:, 0]

    def gain(scale):
        fit = linear(left, slope, np.array([scale]), np.array([-np.inf]))
        return (
            0.5 * float(left @ left - fit.left @ fit.left) - 0.5 * (fit.cost - float(fit.left @ fit.left)) - fit.volume
        )

    assert gain(1.0) == pytest.approx(gain(0.1), abs=0.1)
    # what is at its bound leaves what was there
    none = linear(left, slope, np.ones(1), np.zeros(1))
    np.testing.assert_array_equal(none.left, left)


def test_without_torque_a_gain_and_a_motor_constant_are_not_both_named():
    """Only their product shows: 1.33 times 0.68 is 0.9."""
    runs = [pendulum_run(seed=seed) for seed in (1, 2)]
    runs = [
        replace(
            run,
            control=replace(run.control, kp=(KP / 0.9,), kd=(KD / 0.8,)),
            signals={name: run.signals[name] for name in ("q", "q_cmd", "dq_cmd")},
        )
        for run in runs
    ]
    state, _ = found(problem(load("pendulum"), "rigid", runs))
    (gain,) = state.found
    assert gain.effect == "controller_gain"
    assert gain.row.values == pytest.approx({"kp": 0.9, "kd": 0.8}, rel=1e-3)


def test_the_second_harmonic_of_a_wave_is_no_second_cause():
    asked = question(lambda t, q, dq: 0.3 * math.sin(20.0 * q) + 0.15 * math.sin(40.0 * q))
    state, _ = found(asked)
    assert [(item.effect, item.place) for item in state.found] == [("torque_ripple", "joint_1")]
    rows = rows_of(state.found)
    there = [h for h in hypotheses(asked, rows, scales_of(asked, rows), [("torque_ripple", 1)]) if "cycles" in row(h)]
    apart = 2.0 * np.pi / scales_of(asked, rows).way[0]
    assert all(abs(row(h)["cycles"] - 40.0) > 0.9 * apart for h in there)


def test_nothing_stands_beside_what_no_robot_can_have():
    """Where another finding goes a body may be moved to less than none: that ended a diagnosis."""
    asked = problem(load("pendulum"), "rigid", [pendulum_run(duration=1.0)])
    state = Search(asked, whitening(asked))
    state.begin()
    light = EffectRow(1, {"inertia": -5.0})
    rubs = EffectRow(1, {"torque": 0.1})
    state.found = (Found("rotor_inertia", 1, light, 50.0), Found("coulomb_friction", 1, rubs, 50.0))
    with pytest.raises(MbexportError, match="inertia"):
        asked.residual(rows_of(state.found))
    assert contenders(state, blocks(asked.evidence)) == []


def test_the_loudest_channel_does_not_drown_what_another_is_about():
    nothing = np.zeros(0)
    rubs = Hypothesis("coulomb_friction", 1, "", lambda beta: {}, np.ones(1), np.zeros(1))
    one = np.ones(1)
    assert not Contender(rubs, 50.0, 0.01, one, nothing, 1.0).earns
    assert Contender(rubs, 50.0, 0.01, one, nothing, 1.0, closes=0.5).earns
    assert not Contender(rubs, 5.0, 0.5, one, nothing, 1.0, closes=0.5).earns
    # two channels of 100: of the loud one nothing is taken, of the other three quarters
    left, rest = np.repeat([30.0, 3.0], 100), np.repeat([30.0, np.sqrt(3.0)], 100)
    parts = [Part(0, 100, 0, 100), Part(100, 200, 100, 200)]
    assert _most_gone(left, rest, parts) == pytest.approx(6.0 / 8.0)


@pytest.mark.parametrize(("there", "rest"), [(1.0, 0.0), (0.0, 0.0), (1.0, 8.0)])
def test_what_is_loud_in_a_few_coefficients_does_not_hide_its_own_cause(monkeypatch, there, rest):
    """A load is felt where a motion is slow: by its own spread there is nothing to be told apart from chance.

    Nor is a cause made of noise, or of what leaves most of the rest as it is.
    """
    random = np.random.default_rng(4)
    slow, channels = 5, range(0, 500, 100)
    bands = [(Part(k, k + slow, k, k + 100), Part(k + slow, k + 100, k, k + 100)) for k in channels]
    parts = [part for both in bands for part in both]
    count = parts[-1].last
    low = np.arange(count) % 100 < slow
    slope = np.where(low[:, None], 1e-3 * random.normal(size=(count, 4)), 0.0)
    left = np.where(low, 1.0, 1.0 + rest) * random.normal(size=count)
    left += there * slope @ np.array([3e3, -2e3, 3e3, 2e3])
    body = Hypothesis("link_inertia", 1, "mass", lambda beta: {}, np.full(4, 1e7), np.full(4, -np.inf))
    other = Hypothesis("backlash", 1, "", lambda beta: {}, np.ones(1), np.full(1, -np.inf))
    fits = [(body, left, slope), (other, left, 1e-3 * random.normal(size=(count, 1)))]
    nothing = np.zeros((count, 0))
    found = next(one for one in ranked(fits, left, parts, nothing) if one.hypothesis is body)
    assert found.earns == (there > 0.0 and rest == 0.0)
    if found.earns:
        assert found.explains > 0.9
        monkeypatch.setattr(contender, "_hiding", lambda *_: None)
        assert not any(one.earns for one in ranked(fits, left, parts, nothing))


def test_the_likelihood_of_what_may_be_louder_than_noise():
    """Of a normal spread that is known by what is left: by integration of its density's logarithm, as scipy has it."""
    random = np.random.default_rng(2)
    left = np.concatenate([5.0 * random.normal(size=300), 0.5 * random.normal(size=50)])
    parts = [Part(0, 300, 0, 350), Part(300, 350, 0, 350)]
    spreads = [np.sqrt((np.sum(left[:300] ** 2) + 2.0) / 302.0), 1.0]
    log = norm.logpdf(left[:300], scale=spreads[0]).sum() + norm.logpdf(left[300:], scale=spreads[1]).sum()
    assert -unexpected(left, parts) == pytest.approx(log + 0.5 * 350 * np.log(2.0 * np.pi))
