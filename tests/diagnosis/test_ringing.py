"""Springs that ring and play, which show near their own size only."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.build import assembled
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis import inverse
from mbexport.core.diagnosis import ringing as by_ringing
from mbexport.core.diagnosis import tried as all_free
from mbexport.core.diagnosis.contender import Contender
from mbexport.core.diagnosis.fit import Part, blocks
from mbexport.core.diagnosis.found import Found, rows_of
from mbexport.core.diagnosis.hypotheses import hypotheses
from mbexport.core.diagnosis.model import merged
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import FAR, problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.resonance import NARROW, WIDE, clearances, springs
from mbexport.core.diagnosis.ringing import one_that_rings
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.state import Search
from mbexport.core.effects import EffectRow
from mbexport.core.motion import from_table
from mbexport.core.recording import Run
from mbexport.core.simulation import simulate

from .pendulums import INERTIA, WEIGHT, soft_run
from .searching import COLUMNS, RIGID_BEARING, question


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
        (0.0, 0.0, 0.2, False),
        (0.0, 0.0, 0.05, True),
    ],
)
def test_springs_that_stiffen_are_tried_where_something_gives_or_nothing_says_a_tenth(
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
