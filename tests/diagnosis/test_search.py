"""Which effects: on a pendulum that nothing of the package moves."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.build import assembled, build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.database.bodies import fault_of
from mbexport.core.diagnosis import instead, inverse, refine
from mbexport.core.diagnosis import judge as judging
from mbexport.core.diagnosis import ringing as by_ringing
from mbexport.core.diagnosis import tried as all_free
from mbexport.core.diagnosis.alike import ABOUT, BESIDE, Alike, _springs_instead, alike
from mbexport.core.diagnosis.contender import Contender, _most_gone
from mbexport.core.diagnosis.diagnose import _finding
from mbexport.core.diagnosis.diagnosis import Rejected
from mbexport.core.diagnosis.fit import Part, blocks, gained, linear, spread
from mbexport.core.diagnosis.forms import beyond_forms
from mbexport.core.diagnosis.found import Found, rows_of, without_bodies
from mbexport.core.diagnosis.held import CRUMB, GONE, MOST_LEFT, OTHER_LAW, TOO_FAST, WILD
from mbexport.core.diagnosis.hypotheses import hypotheses, twins_of
from mbexport.core.diagnosis.hypothesis import Hypothesis
from mbexport.core.diagnosis.instead import swapped
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.mimic import Model, Sizes, as_it_is
from mbexport.core.diagnosis.model import merged
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.orders import _periodic
from mbexport.core.diagnosis.plain import Plain, at_a_point
from mbexport.core.diagnosis.problem import FAR, FARTHEST, problem
from mbexport.core.diagnosis.refine import (
    SHORTEST_PART,
    bounds_of,
    covariance_of,
    left_with,
    refined,
    removal,
    stiffened,
    vanished,
)
from mbexport.core.diagnosis.resonance import NARROW, WIDE, clearances, springs
from mbexport.core.diagnosis.ringing import one_that_rings
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.search import _likeliest, search
from mbexport.core.diagnosis.state import Search, contenders, prune
from mbexport.core.diagnosis.told_apart import told_apart
from mbexport.core.diagnosis.tried import ALIKE
from mbexport.core.diagnosis.unseen import EARNS, Short, Split, Unseen, judged, splits
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.errors import MbexportError, RefusedError
from mbexport.core.kinematics import dynamics
from mbexport.core.motion import from_table
from mbexport.core.recording import Run
from mbexport.core.representation import Inertia
from mbexport.core.simulation import simulate

from .pendulums import INERTIA, KD, KP, WEIGHT, command, pendulum_run, soft_run

NO_SPRING = EffectRow(1, {"stiffness": 0.0, "rest": 0.0})
COLUMNS = [column.name for column in effect_named("link_inertia").columns]
RIGID_BEARING = dict.fromkeys(("kx", "ky", "kz", "krx", "kry", "krz"), math.inf)
RIGID_BEARING |= dict.fromkeys(("bx", "by", "bz", "brx", "bry", "brz"), 0.0)


def question(against=None, **options):
    runs = [pendulum_run(seed=seed, **({"against": against} if against else {}), **options) for seed in (1, 2)]
    return problem(load("pendulum"), "rigid", runs)


def found(asked):
    whiten = whitening(asked)
    state = Search(asked, whiten)
    state.begin()
    return search(state), whiten


def having(asked, whiten, parts, findings):
    """A search that has found these."""
    state = Search(asked, whiten)
    state.begin()
    state.take(findings, refined(asked, whiten, findings, parts))
    return state


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


def test_taking_a_finding_out_by_its_covariance_is_as_good_as_fitting_without_it():
    asked = question(lambda t, q, dq: 0.4 * dq + 0.5 * math.tanh(dq / 2e-3))
    state, whiten = found(asked)
    assert {item.effect for item in state.found} == {"viscous_friction", "coulomb_friction"}
    parts = blocks(asked.evidence)
    fit = refined(asked, whiten, state.found, parts)
    dry = next(item for item in state.found if item.effect == "coulomb_friction")
    rest = [item for item in state.found if item is not dry]
    quick = removal(fit, dry.key, dry.absent).rows["viscous_friction", 1].values["coefficient"]
    # by covariance the weights stay those of the whole fit, so that it is near, not the same
    sigma = spread(fit.left, parts)
    slope = fit.slope / sigma[:, None]
    at = [k for k, key in enumerate(fit.free) if key[0] == "viscous_friction"]
    base = asked.residual(rows_of([replace(item, row=item.absent) for item in rest]))
    left = whiten(base) / sigma
    exact = -float(slope[:, at[0]] @ left) / float(slope[:, at[0]] @ slope[:, at[0]])
    assert quick == pytest.approx(exact, rel=1e-3)


def test_a_spring_that_rests_far_away_goes_with_all_of_its_torque():
    asked = question(lambda t, q, dq: 0.05 * (q - 8.0))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 0.05, "rest": 8.0}), 50.0, NO_SPRING)
    fit = refined(asked, whiten, [spring], parts)
    nothing = whiten(asked.residual({}))
    loss = 0.5 * float(np.sum((nothing / spread(fit.left, parts)) ** 2) - len(nothing))
    assert removal(fit, spring.key, NO_SPRING).loss == pytest.approx(loss, rel=0.1)
    # stiffness and rest alone are hardly known
    assert not vanished(fit, spring)


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


def test_what_no_run_shows_is_known_within_a_few_times_its_size():
    """By a pseudo-inverse it would be known exactly, and could not be taken out for all the world."""
    asked = question(lambda t, q, dq: 0.4 * dq)
    whiten, parts = whitening(asked), blocks(asked.evidence)
    rubs = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)
    wave = {"amplitude": 1e-12, "cycles": 9.0, "phase": 0.0}
    nothing = Found("torque_ripple", 1, EffectRow(1, wave), 1.0, EffectRow(1, {**wave, "amplitude": 0.0}))
    fit = refined(asked, whiten, [rubs, nothing], parts)
    sigma = {(one[0], one[2]): math.sqrt(fit.covariance[k, k]) for k, one in enumerate(fit.free)}
    assert sigma["torque_ripple", "cycles"] > 9.0
    assert sigma["viscous_friction", "coefficient"] < 0.01
    assert removal(fit, nothing.key, nothing.absent).loss < 10.0


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


def test_evidence_of_some_runs_is_part_of_the_whole():
    asked = question()
    both = asked.residual({})
    one = asked.only([1]).residual({})
    np.testing.assert_array_equal(one, both[asked.evidence.places([1])])
    assert 0 < len(one) < len(both)


def test_a_body_that_cannot_be_is_no_finding():
    asked = question()
    hollow = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "mass": -0.1, "Izz": 5.0})
    assert without_bodies(asked, [Found("link_inertia", 1, hollow, 50.0)]) == {("link_inertia", 1)}
    # nor one that no robot can be assembled with
    empty = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "Izz": -50.0})
    assert without_bodies(asked, [Found("link_inertia", 1, empty, 50.0)]) == {("link_inertia", 1)}
    heavier = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "mass": 0.1})
    assert without_bodies(asked, [Found("link_inertia", 1, heavier, 50.0)]) == set()


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


def test_a_controller_that_does_nothing_explains_nothing():
    asked = question(lambda t, q, dq: 0.8 * math.sin(40.0 * q))
    whiten = whitening(asked)

    def asks(part):
        left = left_with(asked, whiten, {"controller_gain": (EffectRow(1, {"kp": part, "kd": part}),)})
        return sum(float(np.sum(left[c.first : c.last] ** 2)) for c in asked.evidence.channels if c.signal == "u")

    assert asks(0.05) > 2.0 * asks(1.0)


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


def test_the_cycles_of_a_gear_are_read_where_its_output_was_measured():
    """Its torque tells nothing here: there is none."""
    runs = [pendulum_run(seed=seed) for seed in (1, 2)]
    runs = [
        replace(run, signals=run.signals | {"q_link": gear(run.signals["q"])}, noise=dict(run.noise)) for run in runs
    ]
    asked = problem(load("pendulum"), "rigid", runs)
    cycles = [row(h)["cycles"] for h in hypotheses(asked, {}, scales_of(asked, {})) if h.effect == "transmission_error"]
    assert min(abs(one - 30.0) for one in cycles) < 0.5


def test_a_wave_goes_through_most_of_itself():
    """One that only bends over the whole way would take the place of a spring, and of every law of the position."""
    asked = question(lambda t, q, dq: 0.5 * (q - 0.4) * (1.0 + 0.3 * (q - 0.4) ** 2))
    fewest = bounds_of(asked, "torque_ripple", 1, "cycles")[0]
    assert fewest == pytest.approx(0.75 * 2.0 * np.pi / asked.way()[0])
    state, _ = found(asked)
    assert state.found[0].effect == "joint_spring"


def test_a_gear_error_of_few_cycles_on_short_ways_is_read_by_its_inertia_and_its_weight():
    t = np.arange(0.0, 4.0, 0.004)
    turn = 0.5 * np.sin(np.pi * t) + 0.2 * np.sin(2.3 * np.pi * t)
    runs, left = [], []
    for begin, way in ((0.2, 0.15), (1.9, 0.18)):
        q = begin + way * turn
        dq, ddq = (np.gradient(x, t) for x in (q, np.gradient(q, t)))
        error = 1e-3 * np.sin(7.0 * q + 0.4)
        # what no law of it says is told by differences
        bent = np.gradient(np.gradient(error, t), t)
        runs.append(SimpleNamespace(band=20.0, h=0.004, q=q[:, None], dq=dq[:, None], ddq=ddq[:, None]))
        left.append((0.3 * bent + 8.0 * error)[:, None])
    asked = SimpleNamespace(evidence=SimpleNamespace(runs=runs))
    grid = np.arange(2.0, 40.0, 0.25)

    def best(left, **parts):
        return grid[np.argmax(_periodic(asked, left, 0, grid, **parts))]

    assert best(left, itself=True, second=True) == 7.0
    # neither alone is what the motor feels
    assert best(left, itself=True, second=False) != 7.0
    assert best(left, itself=False, second=True) != 7.0
    assert not np.any(_periodic(asked, [0.0 * one for one in left], 0, grid, itself=True, second=True))


def test_a_screw_has_many_cycles_a_metre():
    """As radians: one of 6 mm makes 1047 of them, where no joint that turns has more than some hundred a turn."""
    arm = load("scara")
    t = np.arange(1001) / 250.0
    q = np.zeros((len(t), 4))
    q[:, 2] = 0.05 * (1.0 - np.cos(1.3 * t))
    tau = dynamics(build(arm, "rigid")).inverse_dynamics(q, np.gradient(q, t, axis=0), np.zeros_like(q))
    tau[:, 2] += 0.5 * np.sin(1047.0 * q[:, 2])
    tau += 0.01 * np.random.default_rng(1).normal(size=tau.shape)
    noise = {"q": np.full(4, 1e-6), "tau": np.full(4, 0.01)}
    run = Run("slides", t, {"q": q, "tau": tau}, Control("unknown"), noise, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    cycles = [row(h)["cycles"] for h in hypotheses(asked, {}, scales_of(asked, {})) if h.key == ("torque_ripple", 3)]
    assert min(abs(one - 1047.0) for one in cycles) < 0.1 * 2.0 * np.pi / 0.1


def gear(q):
    """What its output shows of a motor's position, with an error of 30 cycles a turn."""
    return q + 1e-4 * np.sin(30.0 * q)


def row(hypothesis: Hypothesis):
    return hypothesis.values(hypothesis.scale) or {}


def test_a_spring_that_rings_is_found_by_its_resonance():
    """Near a rigid joint its signature points elsewhere: at a ripple and an extra mass."""
    stiffness = INERTIA * 20.0**2
    asked = problem(load("pendulum"), "rigid", [soft_run(stiffness, 0.05, seed=seed) for seed in (1, 2)])
    state = Search(asked, whitening(asked), scales=scales_of(asked, {}))
    state.begin()
    (spring,) = one_that_rings(state, blocks(asked.evidence), ())
    assert (spring.effect, spring.place) == ("joint_compliance", "joint_1")
    assert spring.row.values["stiffness"] == pytest.approx(stiffness, rel=1e-3)
    assert spring.row.values["damping"] == pytest.approx(0.05, rel=0.02)


def test_play_is_found_among_widths_that_its_signature_near_none_says_nothing_of():
    """Where an arm flies from one side of a narrow play to the other is not where it does in a wide one."""
    runs = [soft_run(4000.0, 6.0, gap=0.04, seed=seed, duration=3.0) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    state = Search(asked, whitening(asked), scales=scales_of(asked, {}))
    state.begin()
    (play,) = one_that_rings(state, blocks(asked.evidence), ())
    assert (play.effect, play.place) == ("backlash", "joint_1")
    # how hard its contact is nobody told; simulation says how wide it is
    assert play.row.values["gap"] == pytest.approx(0.04, rel=0.25)
    widths = [one.rows(np.zeros(1))["backlash"][0].values["gap"] for one in clearances(asked, {}, ())]
    assert [widths[0], max(widths)] == pytest.approx([NARROW, WIDE])
    soft = {"joint_compliance": (EffectRow(1, {"stiffness": 400.0, "damping": 2.0}),)}
    assert clearances(asked, soft, ()) == clearances(asked, {}, {("backlash", 1)}) == []


@pytest.mark.parametrize(
    ("takes", "play", "another", "tried"),
    [
        (0.1, 0.9, 0.0, True),
        (0.5, 0.9, 0.0, False),
        (0.1, 0.9, 0.2, True),
        (0.1, 0.9, 0.5, False),
        (0.0, 0.01, 0.0, True),
        (0.0, 0.0, 0.0, False),
    ],
)
def test_springs_that_stiffen_are_tried_where_something_gives_and_nothing_takes_much(
    monkeypatch, takes, play, another, tried
):
    """But for play, which takes much of what one that stiffens leaves."""
    asked = problem(load("pendulum"), "rigid", [soft_run(INERTIA * 20.0**2, 0.05, duration=2.0)])
    state = Search(asked, whitening(asked), scales=scales_of(asked, {}))
    state.begin()
    rubs = next(one for one in hypotheses(asked, {}, state.scales) if one.effect == "viscous_friction")
    state.first = [Contender(rubs, 50.0, another, np.array([0.1]), state.left, 1.0)]
    loud = by_ringing.loudness(state)
    energy = float(state.left @ state.left)
    parts = {"joint_compliance": takes, "backlash": play}
    leaves = {name: math.sqrt(1.0 - part * loud / energy) for name, part in parts.items()}

    def rung(state, options):
        return [(one, leaves.get(one.effect, 1.0) * state.left) for one in options]

    asks = []
    monkeypatch.setattr(by_ringing, "_rung", rung)
    monkeypatch.setattr(by_ringing, "best_tried", lambda *_, **__: None)
    monkeypatch.setattr(by_ringing, "stiffening", lambda *words: asks.append(words) or [])
    assert one_that_rings(state, blocks(asked.evidence), ()) == []
    assert bool(asks) == tried


def test_a_drive_is_wound_up_by_its_arm_and_not_by_its_rotor():
    """A motor's torque may be a hundred times what goes through its drive."""
    t = np.arange(1000) / 250.0
    q, noise = 0.5 * np.sin(2.0 * t), {"q": np.array([1e-4]), "tau": np.array([0.01])}
    heavy = {"q": q[:, None], "tau": 300.0 * np.sin(2.0 * t)[:, None]}
    run = Run("swing", t, heavy, Control("motion"), noise, (), {}, "", (), 250.0)
    asked = problem(load("pendulum"), "rigid", [run])
    through = np.sqrt(np.mean((WEIGHT * np.sin(q) - INERTIA * 4.0 * q) ** 2))
    tried = [
        table.values["stiffness"]
        for one in springs(asked, {}, scales_of(asked, {}), ())
        if one.effect == "joint_compliance"
        for table in one.rows(np.zeros_like(one.scale))["joint_compliance"]
    ]
    assert through / np.array([max(tried), min(tried)]) == pytest.approx([3.0e-4, 0.1], rel=0.02)


def test_springs_tried_alone_are_remembered(monkeypatch):
    """A search that begins again tries them beside nothing once more: it knows what each leaves."""
    asked = problem(load("pendulum"), "rigid", [soft_run(INERTIA * 20.0**2, 0.05)])
    whiten = whitening(asked)
    state = Search(asked, whiten, scales=scales_of(asked, {}))
    state.begin()
    monkeypatch.setattr(by_ringing, "best_tried", lambda state, good, *_, **__: list(good))
    (first,) = one_that_rings(state, blocks(asked.evidence), ())
    counted = []
    monkeypatch.setattr(type(asked), "misfit", lambda self, rows: counted.append(rows))
    (again,) = one_that_rings(state.without(()), blocks(asked.evidence), ())
    assert not counted
    assert [one.gain for one in again] == pytest.approx([one.gain for one in first])


def test_what_springs_change_beside_another_says_nothing_of_what_they_change_in_its_place(monkeypatch):
    """An arm that bends, picked while it was all that said something, kept the drive that rings from being tried."""
    stiffness = INERTIA * 20.0**2
    asked = problem(load("pendulum"), "rigid", [soft_run(stiffness, 0.05, seed=seed) for seed in (1, 2)])
    whiten, parts = whitening(asked), blocks(asked.evidence)
    state = Search(asked, whiten, scales=scales_of(asked, {}))
    bends = {"ku": 40.0, "kv": 40.0, "bu": 0.5, "bv": 0.5, "at": 0.5}
    bend = Found("link_flexibility", 1, EffectRow(1, bends), 50.0)
    damps = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 1e-3}), 50.0, EffectRow(1, {"coefficient": 0.0}))
    state.take([bend, damps], refined(asked, whiten, [bend, damps], parts))
    monkeypatch.setattr(by_ringing, "loudness", lambda state: float(state.left @ state.left) - len(state.left))
    by_ringing._rung(state, springs(asked, rows_of(state.found), state.scales, ()))
    assert "link_flexibility" in state.rung_beside
    found, fit = by_ringing.spring_instead(state, parts)
    assert [item.effect for item in found if item.key != damps.key] == ["joint_compliance"]
    assert fit.rows["joint_compliance", 1].values["stiffness"] == pytest.approx(stiffness, rel=1e-3)


def test_a_bearing_that_gives_both_ways_is_not_half_of_one_and_the_next_joints_drive():
    """It tilts about the next joint's axis, where a drive says as much; another engine moves it."""
    puma = load("puma560")
    tilts = {"krx": 4.0e4, "kry": 4.0e4, "brx": 60.0, "bry": 60.0}
    bearing = EffectRow(1, {**RIGID_BEARING, **tilts})
    t = np.arange(751) / 250.0
    moves = np.array([0.5, 0.4, -0.5, 0.2, 0.2, 0.2]) * (1.0 - np.cos(np.outer(t, [2.1, 3.3, 2.7, 1.9, 2.3, 2.9])))
    law = from_table(t, moves)
    trace = simulate(assembled(puma, {"joint_compliance_6d": (bearing,)}), "exudyn", law, rate=250.0)
    q_cmd, dq_cmd, _ = law.at(trace.t)
    random = np.random.default_rng(4)
    noise = {"q": np.full(6, 1e-6), "tau": np.full(6, 0.02)}
    signals = {name: trace.joints[name] + noise[name] * random.normal(size=q_cmd.shape) for name in noise}
    signals |= {"q_cmd": q_cmd, "dq_cmd": dq_cmd}
    run = Run("tilts", trace.t, signals, Control(), noise, (), {}, "", (), 250.0)
    asked = problem(puma, "rigid", [run])
    whiten, parts = whitening(asked), blocks(asked.evidence)
    half = Found("joint_compliance_6d", 1, EffectRow(1, {**RIGID_BEARING, "krx": 4.2e4, "brx": 50.0}), 50.0)
    drive = Found("joint_compliance", 2, EffectRow(2, {"stiffness": 3.8e4, "damping": 50.0}), 50.0)
    state = Search(asked, whiten)
    state.take([half, drive], refined(asked, whiten, [half, drive], parts))
    state.scales = scales_of(asked, {})
    by_ringing.one_spring(state, parts)
    assert [item.key for item in state.found] == [("joint_compliance_6d", 1)]
    row = state.found[0].row.values
    assert [row["krx"], row["kry"]] == pytest.approx([4.0e4, 4.0e4], rel=0.02)


def test_of_springs_that_ring_each_is_judged_with_the_noise_that_it_makes(monkeypatch):
    """In the noise of a rigid robot the one that follows the noise a little better would win."""
    one, other = (Found(name, 1, EffectRow(1, {"stiffness": 1.0}), 0.0) for name in ("joint_compliance", "backlash"))
    rings = slice(20, 25)
    noise = {one.effect: np.ones(50), other.effect: np.ones(50)}
    noise[one.effect][rings] = 10.0
    # in units of the rigid robot's noise
    leaves = {one.effect: np.ones(50), other.effect: np.ones(50)}
    leaves[one.effect][rings], leaves[other.effect][rings] = 10.0, 6.0

    def heard_as(weights):
        evidence = SimpleNamespace(weights=weights)
        return SimpleNamespace(evidence=evidence, heard=lambda rows, exactly: heard_as(1.0 / noise[next(iter(rows))]))

    def fitted(asked, _, trial, parts):
        (item,) = trial
        left = leaves[item.effect] * asked.evidence.weights
        return SimpleNamespace(rows={item.key: item.row}, left=left, free=(1, 2), numbers_of=lambda key: [0, 1])

    monkeypatch.setattr(all_free, "refined", fitted)
    plain = heard_as(np.ones(50))
    whiten = SimpleNamespace(shrink=np.ones(0), told_by=lambda before, now: whiten)
    state = SimpleNamespace(problem=plain, whiten=whiten, found=[])
    tried = [(50.0, item, fitted(plain, whiten, [item], [])) for item in (one, other)]
    left = [float(fit.left @ fit.left) for *_, fit in tried]
    assert left[1] < left[0]
    assert all_free._by_own_noise(state, tried, [Part(0, 50, 0, 50)]).key == one.key
    noise[one.effect][:] = 1.0
    assert all_free._by_own_noise(state, tried, [Part(0, 50, 0, 50)]).key == other.key


def test_springs_whose_motion_cannot_be_worked_out_say_nothing(monkeypatch):
    """Two springs with nothing between them ended a diagnosis with a division by zero."""

    def divided(*_):
        raise ZeroDivisionError

    compiled = inverse._compiled
    monkeypatch.setattr(inverse, "_compiled", lambda name: divided if name == "arms_along" else compiled(name))
    asked = question()
    soft = Found("joint_compliance", 1, EffectRow(1, {"stiffness": 321.0, "damping": 0.5}), 50.0)
    assert np.all(asked.misfit(rows_of([soft])) == FAR)


def test_what_swings_itself_to_pieces_is_a_number_still(monkeypatch):
    """Squares of what such a spring leaves were infinite, and ended a diagnosis."""
    asked = question()
    monkeypatch.setattr(type(asked), "residual", lambda *_: np.array([1e200, -1e200, np.nan, 3.0]))
    left = asked.misfit({})
    assert np.isfinite(left @ left)
    assert left.tolist() == [FARTHEST, -FARTHEST, FAR, 3.0]


def test_springs_beside_what_was_found_meanwhile_are_tried_near_where_they_came_near():
    asked = problem(load("pendulum"), "rigid", [soft_run(INERTIA * 20.0**2, 0.05)])
    whiten = whitening(asked)
    state = Search(asked, whiten, scales=scales_of(asked, {}))
    state.begin()
    options = springs(asked, {}, state.scales, ())
    alone = {(one.key, one.form): left for one, left in by_ringing._rung(state, options)}
    assert len(alone) == len(options)
    weight = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "mass": 0.01})
    state.found = [Found("link_inertia", 1, weight, 100.0)]
    state.left = whiten(asked.residual(rows_of(state.found)))
    beside = {(one.key, one.form): left for one, left in by_ringing._rung(state, options)}
    assert len(beside) <= 3 * len({one.key for one in options})
    for (key, form), left in beside.items():
        spring = next(one for one in options if (one.key, one.form) == (key, form))
        both = merged(rows_of(state.found), spring.rows(np.zeros_like(spring.scale)))
        np.testing.assert_array_equal(left, whiten(asked.misfit(both)))
        assert not np.array_equal(left, alone[key, form])
    # what is found beside is small: what came nearest alone is among them
    for place in {one.key for one in options}:
        assert min((n for n in alone if n[0] == place), key=lambda name: alone[name] @ alone[name]) in beside


def test_a_bearing_is_rigid_where_nothing_tells_how_little_it_gives(monkeypatch):
    asked = question()
    parts = blocks(asked.evidence)
    noise = np.random.default_rng(1).normal(size=len(asked.evidence.weights))

    def left(problem, whiten, rows):
        """Only kx shows."""
        (there,) = rows["joint_compliance_6d"]
        return noise + np.where(np.arange(len(noise)) < 9, 500.0 / there.values["kx"] - 1.0, 0.0) * 5.0

    monkeypatch.setattr(refine, "left_with", left)
    rigid = {column.name: column.default for column in effect_named("joint_compliance_6d").columns}
    row = EffectRow(1, {**rigid, "kx": 500.0, "bx": 2.0, "krx": 900.0, "brx": 0.1, "kry": 700.0, "bry": 0.1})
    bearing = ("joint_compliance_6d", 1)
    firm = stiffened(asked, whitening(asked), {bearing: row}, parts)
    assert firm[bearing].values == {**rigid, "kx": 500.0, "bx": 2.0}
    # at least one direction stays
    only = {bearing: EffectRow(1, {**rigid, "krx": 900.0})}
    assert stiffened(asked, whitening(asked), only, parts) == only


def test_what_gives_is_plain_by_the_load_that_it_bears():
    """Solid round rods of 0.5 and 0.4 m; the second joint bears the second only."""
    robot = load("planar2r")
    t = np.arange(500) / 250.0
    q = np.column_stack([0.5 * np.sin(2.0 * t), 0.3 * np.sin(3.0 * t)])
    noise = {"q": np.full(2, 1e-4), "tau": np.full(2, 0.01)}
    run = Run("swing", t, {"q": q, "tau": np.zeros_like(q)}, Control("motion"), noise, (), {}, "", (), 250.0)
    scales = scales_of(problem(robot, "rigid", [run]), {})
    first, second = (inertia.mass for inertia in robot.inertias)
    assert scales.weight == pytest.approx(9.81 * np.array([first + second, second]))
    assert scales.lever == pytest.approx([0.9, 0.4])


def test_a_number_that_is_not_there_costs_nothing():
    least, nothing = np.array([0.0, 0.0, -np.inf]), np.zeros(0)
    bearing = Hypothesis("joint_compliance_6d", 1, "", lambda beta: {}, np.ones(3), least)
    contender = Contender(bearing, 50.0, 0.6, np.array([0.0, 0.5, 0.0]), nothing, 1.0)
    assert contender.numbers == 2
    assert contender.worth == pytest.approx(0.6 / 1.1)


def test_an_extra_mass_at_a_point_is_a_body():
    extra = {"mass": 0.4, "mx": 0.1, "my": -0.04, "mz": 0.02}
    about_origin = at_a_point(extra, 1e-3)
    x, y, z = (extra[name] / extra["mass"] for name in ("mx", "my", "mz"))
    point = Inertia(extra["mass"], (x, y, z), 1e-12, 1e-12, 1e-12)
    assert fault_of(point) is None
    # Steiner, by hand
    assert about_origin["Ixx"] == pytest.approx(0.4 * (y * y + z * z))
    assert about_origin["Ixy"] == pytest.approx(-0.4 * x * y)


def test_what_hangs_at_the_last_arm_is_called_a_load():
    asked = question()
    there = {(h.effect, h.form): h for h in hypotheses(asked, {}, scales_of(asked, {}))}
    nothing = np.zeros(0)

    def said(name, gain, explains):
        return Contender(there[name], gain, explains, np.ones(4), nothing, 1.0)

    arm = said(("link_inertia", "mass"), 100.0, 0.9)
    load, lighter = (said(("payload", "point"), 90.0, explains) for explains in (0.9, 0.7))
    assert _likeliest([arm, load], twins_of(asked)) is load
    assert _likeliest([arm, lighter], twins_of(asked)) is arm


def test_a_load_is_near_the_hand():
    plain = Plain.of(question(), tuple(("payload", 0, name) for name in ("mass", "x", "y", "z")))
    near, far = (float(np.sum(np.square(plain.apart(np.array([0.1, x, 0.0, 0.0]))))) for x in (0.05, 3.0))
    assert near < 1.0
    assert far > 50.0


def test_a_load_is_a_body():
    """A box of 3 by 4 by 5, turned; the same with a side whose square is below none; and a sphere."""
    plain = Plain.of(question(), tuple(("payload", 0, name) for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")))
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]

    def apart(squares):
        about = turn @ np.diag(np.sum(squares) - np.array(squares)) @ turn.T
        moments = [about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2]]
        return float(np.sum(plain.apart(1e-4 * np.array(moments)) ** 2))

    assert apart([9.0, 16.0, 25.0]) == apart([9.0, 16.0, 0.0]) == pytest.approx(0.0, abs=1e-12)
    # the largest moment is 25: its mass is hollow by a hundredth, ten standard deviations
    assert apart([9.0, 16.0, -0.25]) == pytest.approx(100.0)
    some = Plain.of(question(), (("payload", 0, "mass"), ("payload", 0, "Izz"), ("payload", 0, "Ixx")))
    assert float(np.sum(some.apart(np.array([1.0, 2e-4, 2e-4])) ** 2)) == pytest.approx(0.0, abs=1e-12)
    assert float(np.sum(some.apart(np.array([1.0, 4e-4, 2e-4])) ** 2)) > 1e4


def test_a_load_that_was_found_is_next_as_thick_as_it_is_wide():
    """One number for its moments: six are dearer than what they say of a load of the size of a fist."""
    asked = question()
    point = {"mass": 0.4, "x": 0.01, "y": 0.0, "z": 0.02}
    there = {"payload": (EffectRow(0, dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0) | point),)}
    forms = {h.form: h for h in hypotheses(asked, there, scales_of(asked, {})) if h.effect == "payload"}
    (ball,) = forms["ball"].rows(np.array([2.0e-4]))["payload"]
    assert [ball.values[name] for name in ("Ixx", "Iyy", "Izz", "Ixy")] == [2e-4, 2e-4, 2e-4, 0.0]
    assert {name: ball.values[name] for name in point} == point
    assert forms["ball"].lower == pytest.approx(0.0)
    assert "ball" not in {h.form for h in hypotheses(asked, {}, scales_of(asked, {})) if h.effect == "payload"}


def test_the_extra_mass_of_an_arm_is_near_the_arm():
    plain = Plain.of(question(), tuple(("link_inertia", 1, name) for name in ("mass", "mx", "my", "mz")))
    near, far = (float(np.sum(np.square(plain.apart(np.array([0.5, 0.5 * x, 0.0, 0.0]))))) for x in (0.05, 3.0))
    assert near < 1.0
    assert far > 50.0


def test_an_extra_mass_of_the_last_arm_is_called_a_load_where_it_can_be_one(monkeypatch):
    """Where it was found as that arm's extra mass; an arm that is lighter than it is said to be is no load."""
    for mass, name in ((0.1, "payload"), (-0.1, "link_inertia")):
        monkeypatch.setattr("tests.diagnosis.pendulums.INERTIA", INERTIA + mass * 0.3**2)
        runs = [
            pendulum_run(seed=seed, against=lambda t, q, dq, m=mass: m * 9.81 * 0.3 * math.sin(q)) for seed in (1, 2)
        ]
        asked = problem(load("pendulum"), "rigid", runs)
        whiten = whitening(asked)
        judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whiten, splits(2, 0), runs)
        none = dict.fromkeys(COLUMNS, 0.0)
        arm = Found("link_inertia", 1, EffectRow(1, none | {"mass": mass, "mx": -0.2 * mass}), 50.0)
        hung = dict.fromkeys(("x", "y", "z", *COLUMNS[4:]), 0.0) | {"mass": 0.1, "x": -0.2}
        twin = Alike(Found("payload", 0, EffectRow(0, hung), 50.0), 0.0, 0.0, one_body=True)
        _, better = told_apart(judge, [arm], [(twin,)])
        assert [item.effect for item in better or [arm]] == [name]


def test_an_arm_that_bends_where_its_joint_is_has_a_bearing_that_gives(monkeypatch):
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    rigid = {column.name: column.default for column in effect_named("joint_compliance_6d").columns}
    bearing = Found("joint_compliance_6d", 1, EffectRow(1, {**rigid, "krx": 800.0, "brx": 0.5}), 50.0)
    for at, nats, name in (
        (SHORTEST_PART, 3.0, "joint_compliance_6d"),
        (0.4, 3.0, "link_flexibility"),
        (SHORTEST_PART, 30.0, "link_flexibility"),
    ):
        short = (Short(0.0, 0.0), Short(nats, 0.05))
        monkeypatch.setattr("mbexport.core.diagnosis.told_apart.fall_short", lambda *_, short=short: short)
        bend = {"ku": 800.0, "kv": 900.0, "bu": 0.5, "bv": 0.5, "at": at}
        arm = Found("link_flexibility", 1, EffectRow(1, bend), 50.0)
        _, better = told_apart(judge, [arm], [(Alike(bearing, 0.0, 0.0),)])
        assert [item.effect for item in better or [arm]] == [name]


@pytest.mark.parametrize(
    ("ways", "nats", "name"),
    [
        (("kry",), 3.0, "joint_compliance"),
        (("krx", "kry"), 3.0, "joint_compliance_6d"),
        (("kry",), 30.0, "joint_compliance_6d"),
    ],
)
def test_what_gives_one_way_alone_is_a_drive_before_it_is_a_bearing(monkeypatch, ways, nats, name):
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    monkeypatch.setattr(
        "mbexport.core.diagnosis.told_apart.fall_short", lambda *_: (Short(0.0, 0.0), Short(nats, 0.05))
    )
    rigid = {column.name: column.default for column in effect_named("joint_compliance_6d").columns}
    bearing = Found("joint_compliance_6d", 1, EffectRow(1, {**rigid, **dict.fromkeys(ways, 800.0)}), 50.0)
    drive = Found("joint_compliance", 1, EffectRow(1, {"stiffness": 800.0, "damping": 0.5}), 50.0)
    _, better = told_apart(judge, [bearing], [(Alike(drive, 0.0, 0.0),)])
    assert [item.effect for item in better or [bearing]] == [name]


@pytest.mark.parametrize(("nats", "name"), [(3.0, "encoder_offset"), (30.0, "kinematic_error")])
def test_an_angle_that_is_off_is_the_encoders_before_it_is_the_arms(monkeypatch, nats, name):
    """Where runs that no fit saw tell them apart it is what they say."""
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    monkeypatch.setattr(
        "mbexport.core.diagnosis.told_apart.fall_short", lambda *_: (Short(0.0, 0.0), Short(nats, 0.05))
    )
    none = dict.fromkeys(("alpha", "a", "theta", "d", "beta"), 0.0)
    arm = Found("kinematic_error", 1, EffectRow(1, none | {"theta": 0.01}), 50.0)
    encoder = Found("encoder_offset", 1, EffectRow(1, {"offset": 0.01}), 50.0)
    _, better = told_apart(judge, [arm], [(Alike(encoder, 0.0, 0.0),)])
    assert [item.effect for item in better or [arm]] == [name]


def test_numbers_of_which_the_sum_alone_is_known_have_variances():
    """In units far from each other, and known by so many rows that a prior is lost to rounding."""
    for much in (1e6, 1e15, 1e18, 1e22):
        both = np.array([[1.0, 1.0 - 1e-16], [1.0 - 1e-16, 1.0]])
        units = np.array([1e-6, 1e4])
        plain = much * both + 0.1 * np.eye(2)
        covariance = covariance_of(plain / np.outer(units, units))
        assert np.all(np.diagonal(covariance) > 0.0)
        covariance /= np.outer(units, units)
        assert np.all(np.isfinite(covariance))
        assert much * np.sum(covariance) < 10.0
        if much < 1e9:
            np.testing.assert_allclose(covariance @ plain, np.eye(2), atol=1e-6)


def test_what_no_engine_can_simulate_once_another_went_goes_too(monkeypatch):
    """A friction may be all that keeps a wrong delay from ringing up."""
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    late = Found("delay", 0, EffectRow(0, {"time": 0.02}), 50.0)
    rubs = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)

    def how_far(self, found, unseen):
        if list(found) == [late]:
            raise RefusedError("the motion is no longer finite")
        return SimpleNamespace(shrinks_by=0.5), (), None

    def kept(self, found):
        return list(found), SimpleNamespace(gains=(1.0,) * len(found), rows=(), open=1.0, beyond=1.0), ()

    monkeypatch.setattr(Judge, "_kept", kept)
    monkeypatch.setattr(Judge, "_goes", lambda self, found, unseen, without, engine: found != [late] or without == 0)
    monkeypatch.setattr(Judge, "numbers", lambda *_, **__: ())
    monkeypatch.setattr(Judge, "_how_far", how_far)
    monkeypatch.setattr("mbexport.core.diagnosis.judge._idle", lambda found, *_: rubs if rubs in found else None)
    answer = judge.held([late, rubs])
    assert answer.found == ()
    assert [(item.effect, item.why) for item in answer.dropped] == [("viscous_friction", GONE), ("delay", WILD)]


def test_a_robot_that_cannot_be_mimics_nothing():
    """Its friction could not be given a stiffness to stick with."""
    asked = question()
    rubs = {"coulomb_friction": (EffectRow(1, {"torque": 0.1}),)}
    light = Found("link_inertia", 1, EffectRow(1, dict.fromkeys(COLUMNS, 0.0) | {"Izz": -10.0}), 50.0)
    assert np.all(Model(asked, rubs, light, (), Sizes(asked), as_it_is).said == FAR)


def test_moments_that_no_body_has_do_not_cost_the_mass(monkeypatch):
    monkeypatch.setattr(
        "mbexport.core.diagnosis.judge.without_bodies", lambda _, found: {f.key for f in found if f.row.values["Ixx"]}
    )
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.5 * math.sin(q)) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    values = dict.fromkeys(("y", "z", *COLUMNS[4:]), 0.0) | {"mass": 0.1, "x": 0.0, "Ixx": -1e-3}
    (load_there,) = judge.held([Found("payload", 0, EffectRow(0, values), 50.0)]).found
    assert load_there.row.values["Ixx"] == 0.0


def test_numbers_that_no_run_shows_are_not_said_to_be_known():
    """Where a pendulum's load is along its axis, and how thick it is across."""
    asked = question(lambda t, q, dq: 0.4 * math.sin(q))
    values = {"mass": 0.1, "x": 0.4, "y": 0.02, "z": 0.05} | dict.fromkeys(
        ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0
    )
    load = Found("payload", 0, EffectRow(0, values), 50.0)
    fit = refined(asked, whitening(asked), [load], blocks(asked.evidence))
    shown = {name: there for (_, _, name), there in zip(fit.free, fit.shown, strict=True)}
    assert shown["mass"] and shown["x"]
    assert not shown["z"]


def test_an_interval_ends_where_its_number_can():
    """No friction drives its joint, however little of it the runs show."""
    asked = question(lambda t, q, dq: 0.4 * dq)
    friction = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)
    fit = refined(asked, whitening(asked), [friction], blocks(asked.evidence))
    hardly = replace(fit, covariance=1e8 * fit.covariance)
    low, high = _finding(friction, "revolute", 50.0, hardly, ()).parameters["coefficient"].ci95
    assert low == 0.0
    assert high > 0.5


def test_what_simulation_takes_to_nothing_has_vanished():
    asked = question(lambda t, q, dq: 0.4 * dq)
    whiten = whitening(asked)
    columns = ("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}))
    friction = Found(*columns, 50.0, EffectRow(1, {"coefficient": 0.0}))
    fit = refined(asked, whiten, [friction], blocks(asked.evidence))
    assert not vanished(fit, friction)
    none = replace(fit, rows={friction.key: EffectRow(1, {"coefficient": 1e-6})})
    assert vanished(none, friction)


def test_a_delay_is_fitted_across_the_edge_of_a_tick():
    past: dict[int, float] = {}
    late = 0.0052

    def late_torque(t, q, dq):
        """What takes the torque away that is held now and gives the one of a while ago instead."""
        tick = int(t * 1000.0 + 1.0e-6)
        wanted = command(tick / 1000.0)
        past.setdefault(tick, KP * (float(wanted[0]) - q) + KD * (float(wanted[1]) - dq))
        return past[tick] - past.get(int(np.floor((t - late) * 1000.0 + 1.0e-6)), past[0])

    run = pendulum_run(against=late_torque)
    # its torque is the controller's, not what acted
    asked = problem(
        load("pendulum"), "rigid", [replace(run, signals={k: v for k, v in run.signals.items() if k != "tau"})]
    )
    start = Found("delay", 0, EffectRow(0, {"time": 0.0035}), 0.0)
    fit = refined(asked, whitening(asked), [start], blocks(asked.evidence))
    assert fit.rows["delay", 0].values["time"] == pytest.approx(late, abs=8e-4)


def test_what_closes_the_gap_in_simulation_is_no_crumb():
    """Friction that beside another is little along the motion, and half of what the loop shows."""
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.1 * dq + 0.1 * math.tanh(dq / 1e-3)) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    viscous = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.1}), 50.0)
    coulomb = Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.1}), 50.0)
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 0.01, "rest": 0.0}), 50.0)
    held = judge.held([viscous])
    assert not held.adequate
    assert [item.effect for item in judge._closed(held, [spring, coulomb]).found] == [
        "viscous_friction",
        "coulomb_friction",
    ]
    assert judge._closed(held, [spring]) is held


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


def test_a_tilt_may_close_the_gap_in_simulation_though_a_joints_law_may_have_another_form(monkeypatch):
    """It is felt at more joints than that one; of a spring at the joint nobody could tell."""
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.1 * dq) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    viscous = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.1}), 50.0)
    tilted = Found("base_tilt", 0, EffectRow(0, {"roll": 0.02, "pitch": 0.0}), 50.0)
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 0.1, "rest": -1.0}), 50.0)
    tame, offered = Judge._tame, []

    def first_alone(self, findings):
        found, unseen, dropped = tame(self, findings[:1])
        return found, unseen, (*dropped, *(Rejected(one.effect, one.place, OTHER_LAW) for one in findings[1:]))

    def closed(self, held, small):
        offered.extend(small)
        return held

    monkeypatch.setattr(Judge, "_tame", first_alone)
    monkeypatch.setattr(Judge, "_closed", closed)
    judge.held([viscous, tilted, spring])
    assert offered == [tilted]


RUBS = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)


def judge_of(count, coefficient=0.4):
    """Of some runs and a held-out one whose torque sensor hears next to nothing."""
    runs = [pendulum_run("motion", lambda t, q, dq: coefficient * dq, seed=k) for k in range(count + 1)]
    runs[-1] = replace(runs[-1], noise={"q": runs[-1].noise["q"], "tau": np.array([100.0])})
    asked = problem(load("pendulum"), "rigid", runs)
    ways = splits(count + 1, 1)
    return Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), ways, runs)


@pytest.mark.parametrize("count", [1, 2])
def test_what_held_out_runs_do_not_excite_is_judged_by_the_others_in_turn(count):
    """A torque limit that only the harder runs reach; one run alone is cut in time."""
    kept, unseen, _ = judge_of(count)._kept([RUBS])
    assert kept == [RUBS]
    assert unseen.gains[0] > 20.0
    kept, _, dropped = judge_of(count, 0.0)._kept([RUBS])
    assert kept == []
    assert dropped[0].why == "not excited by the held-out runs"


@pytest.mark.parametrize(
    ("in_turn", "kept"), [(0.3, ["viscous_friction", "torque_offset"]), (0.0, ["viscous_friction"])]
)
def test_a_crumb_of_the_held_out_runs_that_the_others_show_is_none(monkeypatch, in_turn, kept):
    """A tilted base of which the held-out run shows a little, and the others most, each left out in turn."""
    judge = judge_of(2)
    both = [RUBS, Found("torque_offset", 1, EffectRow(1, {"torque": 0.1}), 50.0)]

    def worth(whole, whiten, found, ways):
        rows = tuple(tuple(item.row for item in found) for _ in ways)
        gains, shares = ((1900.0, 1400.0), (1.0, in_turn)) if len(ways) > 1 else ((600.0, 9.0), (1.0, 0.0))
        few = slice(len(found))
        return Unseen(gains[few], (60.0, 7.0)[few], shares[few], (1.0, 1.0)[few], rows, open=0.0)

    monkeypatch.setattr(judging, "judged", worth)
    found, unseen, dropped = judge._kept(both)
    assert [item.effect for item in found] == kept
    if len(kept) == 2:
        assert unseen.gains[1] == 1400.0
    else:
        assert [item.why for item in dropped] == [CRUMB]


@pytest.mark.parametrize(
    ("second", "row"),
    [("torque_offset", {"torque": 0.1}), ("joint_spring", {"stiffness": 0.01, "rest": -10.0})],
)
@pytest.mark.parametrize(("steady", "kept"), [(0.1, 1), (0.4, 2)])
def test_friction_that_is_not_the_same_both_ways_is_no_second_cause(second, row, steady, kept):
    """A fifth more there than back is a steady torque while it moves; one nearly as large as the friction is none."""
    runs = [pendulum_run("motion", lambda t, q, dq: 0.5 * math.tanh(dq / 1e-3) + steady, seed=k) for k in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    row = {name: value * (steady / 0.1 if name in ("torque", "stiffness") else 1.0) for name, value in row.items()}
    both = [
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.5}), 50.0),
        Found(second, 1, EffectRow(1, row), 50.0),
    ]
    found, _, dropped = judge._kept(both)
    assert [item.effect for item in found] == [item.effect for item in both[:kept]]
    assert [item.why for item in dropped] == [OTHER_LAW] * (2 - kept)


@pytest.mark.parametrize(("weight", "its_own"), [(0.0, False), (1.5, True)])
def test_a_spring_that_stiffens_on_its_way_is_no_body_beside_it(weight, its_own):
    """A joint bears every arm behind it: what its law's form leaves is no arm's; a real one beside it is."""

    def against(t, q, dq):
        return 1.5 * q + 0.2 * q**3 + weight * (math.sin(q) + 0.05 * float(command(t)[2]))

    runs = [pendulum_run("motion", against, seed=k) for k in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    # weight that helps the spring where that is harder than in the mean
    arm = dict.fromkeys(COLUMNS, 0.0) | {"mx": 0.05 + weight / 9.81, "Iyy": 0.05 * weight, "Izz": 0.05 * weight}
    both = [
        Found("joint_spring", 1, EffectRow(1, {"stiffness": 2.0, "rest": 0.0}), 50.0),
        Found("link_inertia", 1, EffectRow(1, arm), 50.0),
    ]
    worth = judged(asked, whitening(asked), both, splits(2, 0))
    assert (worth.own[1] >= MOST_LEFT) == its_own


def test_what_takes_nothing_away_beside_a_law_that_may_say_the_same_has_nothing_of_its_own():
    """A wave that bends as a spring does in one run, where a straight one that is harder is all in the other."""
    bends, straight = (lambda t, q, dq, k=k, b=b: k * q + b * q**3 for k, b in ((1.5, 0.3), (2.2, 0.0)))
    asked = problem(load("pendulum"), "rigid", [pendulum_run("motion", bends), pendulum_run("motion", straight)])
    none = EffectRow(1, {"amplitude": 0.0, "cycles": 4.0, "phase": 0.0})
    both = [
        Found("joint_spring", 1, EffectRow(1, {"stiffness": 2.0, "rest": 0.0}), 50.0, NO_SPRING),
        Found("torque_ripple", 1, EffectRow(1, {**none.values, "amplitude": 0.1}), 50.0, none),
    ]
    assert judged(asked, whitening(asked), both, [Split((0,), (1,))]).own == (1.0, 0.0)


@pytest.mark.parametrize(("theta", "its_own"), [(0.0, False), (0.1, True)])
def test_a_spring_that_stiffens_on_its_way_is_no_geometry_beside_it(theta, its_own):
    """Nor an arm's, which turns what every joint bears."""

    def against(t, q, dq):
        return 1.5 * q + 0.2 * q**3 + WEIGHT * (math.sin(q + theta) - math.sin(q))

    runs = [pendulum_run("motion", against, seed=k) for k in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    off = dict.fromkeys(("alpha", "a", "theta", "d", "beta"), 0.0) | {"theta": 0.02 + theta}
    both = [
        Found("joint_spring", 1, EffectRow(1, {"stiffness": 2.0, "rest": 0.0}), 50.0),
        Found("kinematic_error", 1, EffectRow(1, off), 50.0),
    ]
    worth = judged(asked, whitening(asked), both, splits(2, 0))
    assert (worth.own[1] >= MOST_LEFT) == its_own


@pytest.mark.parametrize(
    ("coulomb", "kept"), [(0.0, ["viscous_friction"]), (0.3, ["viscous_friction", "coulomb_friction"])]
)
def test_what_bends_with_speed_is_no_friction_of_another_name(coulomb, kept):
    """A damper that yields by a third at its fastest; beside it, real dry friction stays."""

    def against(t, q, dq):
        return 0.5 * dq / (1.0 + 0.15 * abs(dq)) + coulomb * math.tanh(dq / 1e-3)

    runs = [pendulum_run("unknown", against, seed=k) for k in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    both = [
        Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0),
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.05 + coulomb}), 50.0),
    ]
    found, _, dropped = judge._kept(both)
    assert [item.effect for item in found] == kept
    assert [item.why for item in dropped] == [OTHER_LAW] * (2 - len(kept))


def test_no_other_form_of_a_law_stands_at_a_limit():
    asked = question(lambda t, q, dq: 0.5 * dq)
    both = [
        Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.5}), 50.0),
        Found("torque_limit", 1, EffectRow(1, {"torque": 5.0}), 50.0),
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.01}), 50.0),
    ]
    said = [beyond_forms(asked, whitening(asked), both, k) is None for k in range(3)]
    assert said == [True, True, False]


def test_a_drive_a_bearing_and_an_arm_as_stiff_as_an_arm_are_tried_in_its_place():
    asked = question()
    arm = {"ku": 900.0, "kv": math.inf, "bu": 0.5, "bv": 0.0, "at": 0.5, "stiffening": 7.0}
    tried = _springs_instead(asked, Found("link_flexibility", 1, EffectRow(1, arm), 50.0))
    stiff = [900.0 * times for times in (*ABOUT, *BESIDE)]
    count = len(stiff)
    assert [item.row.values["stiffness"] for item in tried[:count]] == stiff
    # what rings long is met within a few per cent of its own stiffness only
    ordered = np.sort(stiff)
    assert np.max((ordered[1:] / ordered[:-1])[1:-1]) < 1.8
    assert np.max((ordered[1:] / ordered[:-1])[3:6]) < 1.1
    drive, bearing, bend = tried[1::count]
    assert drive.key == ("joint_compliance", 1)
    assert drive.row.values == {"stiffness": 900.0, "damping": 0.5, "stiffening": 7.0}
    tilts = {"krx": 900.0, "kry": 900.0, "brx": 0.5, "bry": 0.5, "stiffening": 7.0}
    assert (bearing.key, bearing.row.values) == (("joint_compliance_6d", 1), RIGID_BEARING | tilts)
    bends = {"ku": 900.0, "kv": 900.0, "bu": 0.5, "bv": 0.5, "at": 0.5, "stiffening": 7.0}
    assert (bend.key, bend.row.values) == (("link_flexibility", 1), bends)
    slide = replace(
        asked, database=replace(asked.database, joints=(replace(asked.database.joints[0], kind="prismatic"),))
    )
    tried = _springs_instead(slide, Found("link_flexibility", 1, EffectRow(1, arm), 50.0))
    assert [item.effect for item in tried] == ["joint_compliance_6d"] * count + ["link_flexibility"] * count
    assert _springs_instead(asked, Found("viscous_friction", 1, EffectRow(1, {"coefficient": 1.0}), 50.0)) == []


def test_a_spring_that_rings_far_faster_than_the_record_is_not_simulated():
    """It would cut a run into many times as many steps, and none of it is recorded."""
    judge = judge_of(1)
    soft, hard = (
        Found("joint_compliance", 1, EffectRow(1, {"stiffness": stiffness, "damping": 0.3}), 50.0)
        for stiffness in (INERTIA * 30.0**2, INERTIA * 30.0**2 * 1e9)
    )
    assert judge._too_fast([soft, RUBS]) is None
    assert judge._too_fast([soft, hard, RUBS]) is hard
    held = judge.held([hard])
    assert held.found == ()
    assert held.dropped == (Rejected("joint_compliance", "joint_1", TOO_FAST),)


def test_a_number_that_stayed_where_it_began_has_not_been_judged():
    """It began where all runs together had it, the one to judge by among them."""
    judge = judge_of(1)
    loud, deaf = Split((1,), (0,)), Split((0,), (1,))
    worth = judged(judge.whole, judge.whiten, [RUBS], [loud, deaf])
    assert worth.gains[0] < EARNS
    (there,) = judged(judge.whole, judge.whiten, [RUBS], [loud]).gains
    assert there > 100.0


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


def test_what_would_gain_as_much_elsewhere_is_no_other_name(monkeypatch):
    """Friction of two joints that takes as much each: neither is a name of the other."""
    arm = load("planar2r")
    t = np.arange(1001) / 250.0
    q = np.column_stack([0.5 * np.sin(2.0 * t), 0.5 * np.sin(3.1 * t)])
    dq = np.column_stack([1.0 * np.cos(2.0 * t), 1.55 * np.cos(3.1 * t)])
    ddq = np.column_stack([-2.0 * np.sin(2.0 * t), -4.805 * np.sin(3.1 * t)])
    random = np.random.default_rng(3)
    tau = (
        dynamics(build(arm, "rigid")).inverse_dynamics(q, dq, ddq)
        + dq * (0.1, 0.0625)
        + 0.01 * random.normal(size=q.shape)
    )
    noise = {"q": np.full(2, 1e-6), "tau": np.full(2, 0.01)}
    q = q + 1e-6 * random.normal(size=q.shape)
    run = Run("swing", t, {"q": q, "tau": tau}, Control("unknown"), noise, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    state = Search(asked, whitening(asked))
    state.begin()
    one = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.1}), 50.0)
    fit = refined(asked, state.whiten, [one], blocks(asked.evidence))
    assert ("viscous_friction", 2) not in {other.found.key for other in alike(state, [one], fit, one)}
    monkeypatch.setattr("mbexport.core.diagnosis.fit.SAME", -2.0)
    assert ("viscous_friction", 2) in {other.found.key for other in alike(state, [one], fit, one)}
    # a name that says more of the same is one all the more
    lesser = Found("coulomb_friction", 2, EffectRow(2, {"torque": 0.06}), 50.0)
    names = alike(state, [lesser], refined(asked, state.whiten, [lesser], blocks(asked.evidence)), lesser)
    assert any(other.worse < -ALIKE for other in names)


def test_a_rotor_may_be_an_arm_that_has_more_mass():
    """About an upright axis: by moments of inertia alone, which fit best, the thin arm would be no body."""
    scara = load("scara")
    t = np.arange(1001) / 250.0
    speeds = 2.0 * np.array([1.0, 1.55, 0.4, 2.1])
    q = np.column_stack([0.5 * np.sin(w * t) for w in speeds]) * (1.0, 1.0, 0.1, 1.0)
    dq = np.column_stack([0.5 * w * np.cos(w * t) for w in speeds]) * (1.0, 1.0, 0.1, 1.0)
    ddq = np.column_stack([-0.5 * w**2 * np.sin(w * t) for w in speeds]) * (1.0, 1.0, 0.1, 1.0)
    random = np.random.default_rng(3)
    tau = dynamics(build(scara, "rigid")).inverse_dynamics(q, dq, ddq) + ddq * (0.2, 0.0, 0.0, 0.0)
    noise = {"q": np.full(4, 1e-6), "tau": np.full(4, 0.01)}
    signals = {"q": q + 1e-6 * random.normal(size=q.shape), "tau": tau + 0.01 * random.normal(size=q.shape)}
    run = Run("swing", t, signals, Control("unknown"), noise, (), {}, "", (), 250.0)
    asked = problem(scara, "rigid", [run])
    state = Search(asked, whitening(asked))
    state.begin()
    one = Found("rotor_inertia", 1, EffectRow(1, {"inertia": 0.2}), 50.0)
    fit = refined(asked, state.whiten, [one], blocks(asked.evidence))
    names = {other.found.key: other.found.row.values for other in alike(state, [one], fit, one)}
    assert names["link_inertia", 1]["mass"] > 0.0


@pytest.mark.parametrize(("first", "a_body"), [(0.005, True), (0.2, False)])
def test_an_arm_that_is_all_but_a_body_gets_what_its_moments_lack(first, a_body):
    """A flat arm was no body with any mass elsewhere, and its neighbours were named for it."""
    arm = load("planar2r")
    flat = Inertia(1.0, (0.0, 0.1, 0.0), 0.01, 0.02, 0.03)
    t = np.arange(1001) / 250.0
    q = 0.5 * np.sin(2.0 * t)[:, None] * (1.0, 0.8)
    run = Run("swing", t, {"q": q, "tau": q}, Control("unknown"), {}, (), {}, "", (), 250.0)
    asked = problem(replace(arm, inertias=(flat, *arm.inertias[1:])), "rigid", [run])
    key = ("link_inertia", 1)
    moved = dict.fromkeys(("mass", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0) | {"mz": first}
    row = EffectRow(1, moved)
    assert asked.impossible({"link_inertia": (row,)})[0]
    (whole,) = asked.rounded_out({key: row}).values()
    assert (asked.impossible({"link_inertia": (whole,)})[0] == "") is a_body
    more = [whole.values[name] - row.values[name] for name in ("Ixx", "Iyy", "Izz")]
    assert more == [more[0]] * 3
    assert 0.0 < more[0] < 0.011 * 0.03 if a_body else more[0] == 0.0
    # what was no body before need not be one
    never = replace(asked.bodies[0], inertias=(replace(flat, zz=0.0302), *arm.inertias[1:]))
    assert replace(asked, bodies=(never,)).rounded_out({key: row})[key] is row
    # a body stays as it is
    sound = {key: EffectRow(1, moved | {"mz": 0.0, "Ixx": 0.001})}
    assert asked.rounded_out(sound)[key] is sound[key]


def test_a_good_gears_play_is_within_a_factor_of_two_of_where_a_fit_begins():
    """Begun at two minutes of arc a fit left more than nothing did, and a play of one was never tried."""
    arm = load("planar2r")
    q = 0.5 * np.sin(2.0 * np.arange(1001) / 250.0)[:, None] * (1.0, 0.8)
    run = Run("swing", np.arange(1001) / 250.0, {"q": q, "tau": q}, Control("unknown"), {}, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    plays = [one for one in hypotheses(asked, {}, scales_of(asked, {}), ()) if one.key == ("backlash", 1)]
    begun = [one.rows(np.zeros(1))["backlash"][0].values["gap"] for one in plays]
    minute = math.radians(1.0 / 60.0)
    assert min(abs(math.log(gap / minute)) for gap in begun) < math.log(2.0)
