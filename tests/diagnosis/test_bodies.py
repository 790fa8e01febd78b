"""Loads and extra masses of arms: bodies that can be, by the likelier name."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.database.bodies import fault_of
from mbexport.core.diagnosis import bodies, diagnose
from mbexport.core.diagnosis import search as search_module
from mbexport.core.diagnosis.alike import Alike, alike
from mbexport.core.diagnosis.contender import Contender
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found, hung, without_bodies
from mbexport.core.diagnosis.hypotheses import hypotheses, twins_of
from mbexport.core.diagnosis.hypothesis import defaults
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.plain import Plain, at_a_point
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import left_with, refined
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.search import _likeliest
from mbexport.core.diagnosis.state import Search
from mbexport.core.diagnosis.told_apart import _called_first, told_apart
from mbexport.core.diagnosis.unseen import OTHER_FORM, judged, splits
from mbexport.core.effects import EffectRow
from mbexport.core.kinematics import dynamics
from mbexport.core.recording import Run
from mbexport.core.representation import Inertia

from .pendulums import INERTIA, pendulum_run
from .searching import COLUMNS, question


def test_a_body_that_cannot_be_is_no_finding():
    asked = question()
    hollow = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "mass": -0.1, "Izz": 5.0})
    assert without_bodies(asked, [Found("link_inertia", 1, hollow, 50.0)]) == {("link_inertia", 1)}
    # nor one that no robot can be assembled with
    empty = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "Izz": -50.0})
    assert without_bodies(asked, [Found("link_inertia", 1, empty, 50.0)]) == {("link_inertia", 1)}
    heavier = EffectRow(1, {**dict.fromkeys(COLUMNS, 0.0), "mass": 0.1})
    assert without_bodies(asked, [Found("link_inertia", 1, heavier, 50.0)]) == set()


def test_an_extra_mass_at_a_point_is_a_body():
    extra = {"mass": 0.4, "mx": 0.1, "my": -0.04, "mz": 0.02}
    about_origin = at_a_point(extra, 1e-3)
    x, y, z = (extra[name] / extra["mass"] for name in ("mx", "my", "mz"))
    point = Inertia(extra["mass"], (x, y, z), 1e-12, 1e-12, 1e-12)
    assert fault_of(point) is None
    # Steiner, by hand
    assert about_origin["Ixx"] == pytest.approx(0.4 * (y * y + z * z))
    assert about_origin["Ixy"] == pytest.approx(-0.4 * x * y)


@pytest.mark.parametrize(("thick", "plain"), [(0.0, True), (0.05, False)])
def test_a_load_whose_moments_say_nothing_is_a_point(monkeypatch, thick, plain):
    mass, out = 0.4, 0.42
    monkeypatch.setattr("tests.diagnosis.pendulums.INERTIA", INERTIA + mass * out**2 + thick)
    asked = question(lambda t, q, dq: mass * 9.81 * out * math.sin(q))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    row = EffectRow(0, dict(defaults("payload")) | {"mass": mass, "x": out - 0.5, "Izz": 0.05})
    found = [Found("payload", 0, row, 50.0)]
    fit = refined(asked, whiten, found, parts)
    options = list(bodies.plainer_loads(asked, whiten, found, fit, parts))
    assert [one[0].row.values["Izz"] for one in options] == ([0.0] if plain else [])
    if plain:
        assert options[0][0].row.values["mass"] == pytest.approx(mass, rel=0.02)
        monkeypatch.setattr(bodies, "refined", lambda *_: pytest.fail("a point needs no plainer fit"))
        there = replace(fit, rows={load_there.key: load_there.row for load_there in options[0]})
        assert list(bodies.plainer_loads(asked, whiten, options[0], there, parts)) == []
        monkeypatch.undo()
    # what the database knows of it is none of what is found
    known = replace(asked, known={"payload": (fit.rows["payload", 0],)})
    assert list(bodies.plainer_loads(known, whiten, found, fit, parts)) == []
    other = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.1}), 50.0)
    assert list(bodies.plainer_loads(asked, whiten, [other], refined(asked, whiten, [other], parts), parts)) == []


@pytest.mark.parametrize(("short", "kept"), [((3.0, 9.0), 1), ((9.0, 9.0), None), ((3.0, 3.0), 0)])
def test_the_plainest_load_that_holds_on_unseen_runs_is_told(monkeypatch, short, kept):
    """A point before a body without products; all of its moments where neither holds."""
    full = [Found("payload", 0, EffectRow(0, {"mass": 0.1}), 50.0)]
    plainer = [[Found("payload", 0, EffectRow(0, {"mass": mass}), 50.0)] for mass in (0.2, 0.3)]
    nats = {id(full): 0.0, id(plainer[0]): short[1], id(plainer[1]): short[0]}
    monkeypatch.setattr(diagnose, "plainer_loads", lambda *_: iter(plainer))
    monkeypatch.setattr(
        diagnose, "fall_short", lambda _, __, options, ___: [SimpleNamespace(nats=nats[id(one)]) for one in options]
    )
    asked = question()
    state, judge = (SimpleNamespace(problem=asked, whiten=None, whole=asked, ways=()) for _ in range(2))
    told = diagnose._plainer(state, judge, full, object())
    assert told == (None if kept is None else tuple(plainer[kept]))
    assert diagnose._plainer(state, judge, full, None) is None


def added(mass, x, **more):
    return EffectRow(1, dict.fromkeys(COLUMNS, 0.0) | {"mass": mass, "mx": mass * x} | more)


def test_more_of_the_last_arm_that_is_no_body_hangs_there_as_a_load():
    """With the same mass and first moments, beside what hangs there already and the arm's own surplus."""
    asked = question()
    arm = Found("link_inertia", 1, added(0.1, -0.2, Izz=5.0), 50.0)
    other = Found("torque_offset", 1, EffectRow(1, {"torque": 0.1}), 50.0)
    unreal = {arm.key}
    kept, load = hung(asked, [other, arm], unreal)
    assert kept is other
    assert (load.key, load.gain, load.absent) == (("payload", 0), 50.0, EffectRow(0, defaults("payload")))
    assert {name: load.row.values[name] for name in ("mass", "x", "y", "Izz")} == {
        "mass": pytest.approx(0.1),
        "x": pytest.approx(-0.2),
        "y": 0.0,
        "Izz": 0.0,
    }
    there = {"payload": (EffectRow(0, defaults("payload") | {"mass": 0.3, "x": 0.1, "Izz": 0.01}),)}
    known = replace(asked, known=there | {"link_inertia": (added(0.04, 0.0),)})
    (more,) = hung(known, [arm], unreal)
    assert more.row.values["mass"] == pytest.approx(0.36)
    assert more.row.values["x"] == pytest.approx((0.3 * 0.1 - 0.02) / 0.36)
    assert more.row.values["Izz"] == 0.01
    assert more.absent == there["payload"][0]
    # what is a body stays, what weighs less than nothing hangs nowhere, and one load is enough
    assert hung(asked, [arm], set()) is None
    assert hung(asked, [replace(arm, row=added(-0.1, -0.2))], unreal) is None
    assert hung(asked, [load, arm], unreal) is None
    assert hung(asked, [other], {("link_inertia", 1)}) is None


@pytest.mark.parametrize("mass", [0.1, -0.1])
def test_a_load_is_fitted_that_is_no_body_as_more_of_its_arm(monkeypatch, mass):
    """An arm that weighs less than it is said to is no load, and what cannot be is said to."""
    monkeypatch.setattr("tests.diagnosis.pendulums.INERTIA", INERTIA + mass * 0.3**2)
    swings = [pendulum_run(seed=seed, against=lambda t, q, dq: mass * 9.81 * 0.3 * math.sin(q)) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", swings)
    never = {("link_inertia", 1)}
    monkeypatch.setattr(bodies, "without_bodies", lambda _, found: never & {item.key for item in found})
    arm = Found("link_inertia", 1, added(mass, -0.2), 50.0)
    found, fit, unreal = bodies.fitted_as_bodies(asked, whitening(asked), [arm], blocks(asked.evidence))
    assert [item.key for item in found] == [("payload", 0) if mass > 0.0 else arm.key]
    assert unreal == (set() if mass > 0.0 else never)
    assert [*fit.rows] == [item.key for item in found]
    whole = left_with(asked, whitening(asked), {})
    assert float(fit.left @ fit.left) < 0.1 * float(whole @ whole)


@pytest.mark.parametrize("loud", ["payload", "joint_spring"])
def test_a_body_hides_no_small_cause_beside_it(monkeypatch, loud):
    """Friction beside what no cause says is a small part of what each makes; a spring may have another form."""
    mass, stiffness = (0.8, 0.0) if loud == "payload" else (0.0, 4.0)
    monkeypatch.setattr("tests.diagnosis.pendulums.INERTIA", INERTIA + mass * 0.4**2)

    def against(t, q, dq):
        return mass * 9.81 * 0.4 * math.sin(q) + stiffness * q + 0.08 * math.tanh(1e3 * dq) + 0.03 * math.sin(40.0 * q)

    asked = problem(load("pendulum"), "rigid", [pendulum_run(seed=seed, against=against) for seed in (1, 2)])
    row = (
        EffectRow(0, defaults("payload") | {"mass": 0.8, "x": -0.1})
        if loud == "payload"
        else EffectRow(1, {"stiffness": 4.0, "rest": 0.0})
    )
    found = [Found(loud, row.at, row, 50.0), Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.08}), 50.0)]
    worth = judged(asked, whitening(asked), found, splits(2, 0))
    assert min(worth.gains) > 50.0
    assert (worth.shares[1] > OTHER_FORM) is (loud == "payload")


@pytest.mark.parametrize("beside", [True, False])
def test_the_search_finds_a_load_that_was_picked_as_no_body(monkeypatch, beside):
    """Whether it is none from the beginning or only once what stood beside it has turned out needless."""
    swings = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.2 * math.sin(q)) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", swings)
    none = EffectRow(1, dict.fromkeys(COLUMNS, 0.0))
    arm = Found("link_inertia", 1, added(0.05, -0.2), 50.0, none)
    offset = Found("torque_offset", 1, EffectRow(1, {"torque": 1e-4}), 50.0, EffectRow(1, {"torque": 0.0}))
    picks = iter([[arm, offset] if beside else [arm]])

    def no_body(_, found):
        keys = {item.key for item in found}
        return {arm.key} & keys if len(keys) == 1 else set()

    for module in (bodies, search_module):
        monkeypatch.setattr(module, "without_bodies", no_body)
    monkeypatch.setattr(search_module, "_picked", lambda *_: next(picks, []))
    monkeypatch.setattr(search_module, "one_that_rings", lambda *_: [])
    state = Search(asked, whitening(asked))
    state.begin()
    search_module._gather(state, blocks(asked.evidence), None)
    assert [item.key for item in state.found] == [("payload", 0)]


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


@pytest.mark.parametrize(("z", "effect"), [(-0.07, "link_inertia"), (0.05, "payload")])
def test_more_mass_on_the_last_axis_behind_the_hand_is_the_arm_before(z, effect):
    """A point there does not turn with the last joint; the wrist has its mass there, a load is before the hand."""
    robot = build(load("imece2013"), "rigid")
    asked = SimpleNamespace(robots=lambda rows: [robot], evidence=SimpleNamespace(runs=[SimpleNamespace(q=np.eye(6))]))
    there = Found("payload", 0, EffectRow(0, {"mass": 0.2, "x": 0.0, "y": 0.001, "z": z}), 50.0)
    wrist, hand, spring = (
        Alike(Found(name, at, EffectRow(at, {}), 50.0), 0.0, 0.0, one_body=one_body)
        for name, at, one_body in (
            ("link_inertia", 5, False),
            ("link_inertia", 6, True),
            ("joint_spring", 6, False),
        )
    )
    nats = {id(one): 0.0 for one in (there, wrist.found, hand.found, spring.found)}
    others = [hand, spring, wrist]
    assert _called_first(asked, there, others, others, nats).effect == effect
    # where the arm before says something else a load is a load
    assert _called_first(asked, there, others, [hand, spring], nats) is there


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
