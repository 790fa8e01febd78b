"""Joints whose arm is clamped: what the motor feels of spring, play and friction, out of plain formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pendulums import pendulum_run

from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis.compared import compared
from mbexport.core.diagnosis.diagnose import diagnose
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.hypothesis import GIVING
from mbexport.core.diagnosis.inverse import clamped_at, said
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.prepare import creep_of, prepared
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.diagnosis.search import search
from mbexport.core.diagnosis.state import Search, prune
from mbexport.core.effects import EffectRow
from mbexport.core.errors import RefusedError

DATABASE = load("pendulum")
STIFFNESS, DRY, PLAY = 400.0, 1.5, 0.02
CLAMPED = 0.3


def spring(stretch, gap):
    return STIFFNESS * np.sign(stretch) * np.maximum(np.abs(stretch) - 0.5 * gap, 0.0)


def clamped_run(gap=0.0, seed=0, rate=250.0, duration=4.0, **signals):
    """A motor wound up and back, twice a run, before an arm that stands at CLAMPED."""
    t = np.arange(round(rate * duration)) / rate
    turns = 2.0 * np.pi / duration * (2.0 + 0.1 * seed)
    q = CLAMPED + 0.03 * np.sin(turns * t) + 0.002 * np.sin(7.0 * t)
    dq = 0.03 * turns * np.cos(turns * t) + 0.014 * np.cos(7.0 * t)
    tau = spring(q - CLAMPED, gap) + DRY * np.tanh(dq / 1e-4)
    random = np.random.default_rng(seed)
    noisy = {"q": q + 1e-6 * random.normal(size=len(t)), "tau": tau + 0.02 * random.normal(size=len(t))}
    return replace(
        pendulum_run(duration=0.1),
        name=f"clamped-{seed}",
        t=t,
        signals={name: values[:, None] for name, values in noisy.items()} | signals,
        control=Control("unknown"),
        noise={"q": np.array([1e-6]), "tau": np.array([0.02])},
        locked=(1,),
        rate=rate,
    )


def rubbing_run(seed):
    """A motor before so much clearance that no spring is felt, that dry friction and eight slipping springs hold."""
    run, stiffness, torque, slips = clamped_run(1.0, seed), 900.0, 2.5, 8
    q = run.signals["q"][:, 0]
    most = torque * np.arange(1, slips + 1) / (slips * (slips + 1) / 2)
    bent = np.zeros((len(q), slips))
    for row, step in enumerate(np.diff(q)):
        bent[row + 1] = np.clip(bent[row] + stiffness / slips * step, -most, most)
    return replace(run, signals={**run.signals, "tau": run.signals["tau"] + bent.sum(axis=1)[:, None]})


def robot(run, **rows):
    return robot_of(DATABASE, "rigid", run, {name: (EffectRow(1, FrozenMap(values)),) for name, values in rows.items()})


def spoken(run, **rows):
    grid = prepared(run)
    return grid, said(robot(run, **rows), grid, robot(run), creep_of(grid))


def test_a_rigid_motor_bears_neither_the_arms_weight_nor_its_inertia():
    _, speech = spoken(clamped_run())
    assert np.abs(speech.tau).max() == 0.0


def test_the_arm_stands_in_the_middle_of_what_the_motor_does_without_a_load():
    assert clamped_at(prepared(clamped_run()), 1) == pytest.approx(CLAMPED, abs=1e-3)
    # a second encoder knows better
    told = clamped_run(q_link=np.full((1000, 1), 0.31))
    assert clamped_at(prepared(told), 1) == pytest.approx(0.31, abs=1e-9)


@pytest.mark.parametrize("gap", [0.0, PLAY])
@pytest.mark.parametrize("rate", [100.0, 250.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_where_the_arm_stands_does_not_go_with_where_samples_happen_to_be(gap, rate, seed):
    """They are 1 mrad apart there; what is off is a torque wherever a spring is felt, and none in a play."""
    assert STIFFNESS * abs(clamped_at(prepared(clamped_run(gap, seed, rate)), 1) - CLAMPED) < 0.02


@pytest.mark.parametrize("gap", [0.0, PLAY])
def test_a_spring_and_its_clearance_are_felt_as_they_should_be(gap):
    run = clamped_run(gap)
    row = {"stiffness": STIFFNESS, "damping": 0.0}
    grid, speech = spoken(run, backlash={"gap": gap} | row) if gap else spoken(run, joint_compliance=row)
    expected = spring(grid.q - clamped_at(grid, 1), gap)
    assert np.abs(speech.tau - expected).max() < 1e-9
    assert np.ptp(speech.q_link) == 0.0


def test_what_a_clamped_robot_says_is_left_out_while_its_motor_stands():
    run = clamped_run()
    measured = compared(run, robot_of(DATABASE, "rigid", run))["tau"]
    still = np.abs(np.gradient(run.signals["q"][:, 0], run.t)) < 1e-4
    assert np.isnan(measured[still]).all()
    assert np.isfinite(measured).mean() > 0.7
    assert set(resimulated(robot(run), robot(run), run, "mjcf")) == {"tau"}


def test_without_a_torque_nothing_can_be_compared():
    run = clamped_run()
    with pytest.raises(RefusedError, match="torques"):
        noise_floor(DATABASE, "rigid", replace(run, signals={"q": run.signals["q"]}))


@pytest.mark.parametrize(
    ("gap", "giving", "rate"),
    [
        (0.0, "joint_compliance", 250.0),
        (0.0, "joint_compliance", 100.0),
        (PLAY, "backlash", 250.0),
        (PLAY, "backlash", 100.0),
    ],
)
def test_stiffness_play_and_friction_are_found(gap, giving, rate):
    asked = problem(DATABASE, "rigid", [clamped_run(gap, seed, rate) for seed in (1, 2)])
    state = Search(asked, whitening(asked))
    state.begin()
    found = {item.effect: item.row.values for item in search(state).found}
    assert set(found) == {giving, "coulomb_friction"}
    assert found[giving]["stiffness"] == pytest.approx(STIFFNESS, rel=0.03)
    assert found["coulomb_friction"]["torque"] == pytest.approx(DRY, rel=0.05)
    if gap:
        assert found["backlash"]["gap"] == pytest.approx(gap, rel=0.05)


def test_what_lets_a_clamped_motor_move_stays_beside_its_friction():
    # so much clearance that no spring is felt
    asked = problem(DATABASE, "rigid", [clamped_run(1.0, 1)])
    state, parts = Search(asked, whitening(asked)), blocks(asked.evidence)
    spring_row, none = ({"stiffness": k, "damping": 0.0} for k in (5.0, 0.0))
    found = [
        Found("joint_compliance", 1, EffectRow(1, spring_row), 0.0, EffectRow(1, none)),
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 1.0}), 0.0, EffectRow(1, {"torque": 0.0})),
    ]
    prune(state, found, refined(asked, state.whiten, found, parts), parts)
    assert [item.effect for item in state.found] == ["joint_compliance", "coulomb_friction"]


def test_what_lets_a_clamped_motor_move_gives_way_to_nothing_rigid():
    asked = problem(DATABASE, "rigid", [rubbing_run(seed) for seed in (1, 2)])
    state = Search(asked, whitening(asked))
    state.begin()
    found = {item.effect: item.row.values for item in search(state).found}
    assert {"coulomb_friction", "hysteresis"} < found.keys() <= {"coulomb_friction", "hysteresis", *GIVING}
    assert found["hysteresis"]["torque"] == pytest.approx(2.5, rel=0.05)


def test_it_stays_where_runs_are_judged_that_no_fit_saw():
    diagnosis = diagnose(DATABASE, [rubbing_run(1), rubbing_run(2)], holdout=[rubbing_run(3)])
    named = {finding.effect for finding in diagnosis.which}
    assert "hysteresis" in named
    assert named & {*GIVING}


def test_another_search_does_without_what_the_first_round_could_not_know():
    asked = problem(DATABASE, "rigid", [clamped_run(0.0, seed) for seed in (1, 2)])
    state = Search(asked, whitening(asked))
    state.begin()
    other = search(search(state).without({("coulomb_friction", "joint_1")}))
    assert "coulomb_friction" not in {item.effect for item in other.found}
