"""Arms that cross their clearances along a recorded motion, against two bodies that hit each other in fine steps."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pendulums import INERTIA, rattling_run
from scipy.integrate import solve_ivp

from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis import inverse, other_form, play, refine, unseen
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found, rows_of
from mbexport.core.diagnosis.how_far import Fold, how_far
from mbexport.core.diagnosis.hypothesis import defaults
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.play import finer_steps, thrown_back
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import Refined, at_its_width, left_with
from mbexport.core.diagnosis.resonance import clearances
from mbexport.core.diagnosis.ringing import _loudest, one_that_rings
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.diagnosis.state import Search
from mbexport.core.diagnosis.unseen import splits
from mbexport.core.effects import EffectRow

GAP = 0.01
UPRIGHT = replace(load("pendulum"), gravity=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("ratio", [0.0, 0.15, 0.6, 0.9, 1.0, 1.5, 3.0])
def test_a_body_leaves_a_contact_as_fast_as_its_equation_has_it(ratio):
    def leaves(t, y):
        return y[0] + 2.0 * ratio * y[1] if t > 1e-3 else 1.0

    leaves.terminal, leaves.direction = True, -1.0
    path = solve_ivp(
        lambda t, y: [y[1], -y[0] - 2.0 * ratio * y[1]], (0.0, 60.0), [0.0, 1.0], rtol=1e-10, atol=1e-13, events=leaves
    )
    assert thrown_back(np.array([ratio]))[0] == pytest.approx(-path.y[1, -1], rel=2e-3)


def left_of(run, rotor, gap):
    """Mean square of what is left of each signal, in units of noise."""
    inverse._moved.cache_clear()
    asked = problem(UPRIGHT, "rigid", [run])
    rows = {"rotor_inertia": (EffectRow(1, {"inertia": rotor}),)}
    if gap:
        rows["backlash"] = (EffectRow(1, {"gap": gap, "stiffness": math.inf, "damping": math.inf}),)
    left = asked.residual(rows)
    return {c.signal: float(np.mean(left[c.first : c.last] ** 2)) for c in asked.evidence.channels}


def as_the_spring_has_it(stiffness, damping, arm, motor):
    return damping, np.zeros(len(damping), dtype=bool)


def never(stiffness, damping, arm, motor):
    return 6.0 * np.sqrt(stiffness * arm), np.ones(len(damping), dtype=bool)


@pytest.mark.parametrize(
    ("heavier", "wrong"), [(4.0, never), (2.0, never), (2.0, as_the_spring_has_it), (0.25, as_the_spring_has_it)]
)
def test_an_arm_is_thrown_back_by_a_motor_heavier_than_it_and_goes_on_with_a_lighter_one(monkeypatch, heavier, wrong):
    """Before a record that is far too slow for the blows, 500 rows a second for contacts of 500 Hz."""
    rotor = heavier * INERTIA
    run = rattling_run(GAP, rotor)
    rigid, known, narrow, wide = (left_of(run, rotor, width * GAP) for width in (0.0, 1.0, 0.8, 1.2))
    monkeypatch.setattr(play, "rebounding", wrong)
    other = left_of(run, rotor, GAP)
    assert known["q_link"] < 0.01 * rigid["q_link"]
    for signal in ("tau", "u"):
        assert known[signal] < 0.12 * rigid[signal]
        assert known[signal] < 0.4 * min(narrow[signal], wide[signal], other[signal])


def test_contacts_are_followed_in_steps_and_softer_where_these_would_be_too_many():
    stiffness, arm = np.array([2.5e6, 9.0, 1e12]), np.array([0.25, 1.0, 1.0])
    steps, followed = finer_steps(stiffness, arm, np.array([True, False, False]), 0.002)
    assert (steps, followed.tolist()) == (26, stiffness.tolist())
    steps, followed = finer_steps(stiffness, arm, np.array([True, False, True]), 0.002)
    assert steps == 128
    assert followed[2] == pytest.approx((0.25 * 128 / 0.002) ** 2)
    assert followed[:2].tolist() == stiffness[:2].tolist()


@pytest.fixture(scope="module")
def rattles():
    """Two runs of an arm behind a motor four times as heavy, and the question they put to a robot with that rotor."""
    rotor = 4.0 * INERTIA
    robot = replace(UPRIGHT, effects=FrozenMap({"rotor_inertia": (EffectRow(1, FrozenMap({"inertia": rotor})),)}))
    runs = [rattling_run(GAP, rotor, seed=seed) for seed in (1, 2)]
    return robot, runs, problem(robot, "full", runs)


def play_of(gap):
    return Found("backlash", 1, EffectRow(1, FrozenMap(defaults("backlash") | {"gap": gap})), 50.0)


def test_a_fit_of_play_that_is_caught_beside_the_truth_comes_out_at_it(rattles):
    _, _, asked = rattles
    whiten, parts, beside = whitening(asked), blocks(asked.evidence), play_of(1.09 * GAP)
    there = rows_of([beside])
    caught = Refined({("backlash", 1): beside.row}, left_with(asked, whiten, there), (), np.zeros((0, 0)), (), ())
    fit = at_its_width(asked, whiten, [beside], caught, parts, 1)
    assert fit.rows["backlash", 1].values["gap"] == pytest.approx(GAP, rel=0.01)
    assert fit.left @ fit.left < 0.2 * caught.left @ caught.left
    assert at_its_width(asked, whiten, [replace(beside, row=fit.rows["backlash", 1])], fit, parts, 1) is fit


def test_widths_are_tried_finely_where_most_is_left(rattles):
    _, _, asked = rattles
    state = Search(asked, whitening(asked), scales=scales_of(asked, {}))
    state.begin()
    assert _loudest(state) == [1]
    coarse, fine = clearances(asked, {}, ()), clearances(asked, {}, (), [1])
    assert (len(coarse), len(fine)) == (13, 61)
    (play,) = one_that_rings(state, blocks(asked.evidence), ())
    assert (play.effect, play.row.values["gap"]) == ("backlash", pytest.approx(GAP, rel=0.01))


def test_the_measured_motion_does_not_speak_against_play_that_is_a_little_wider(rattles, monkeypatch):
    robot, runs, asked = rattles
    ways = splits(2, 1)
    judge = Judge(robot, "full", "mjcf", ["mjcf"], lambda _: None, asked, whitening(asked), ways, runs)
    monkeypatch.setattr(other_form, "CONTRADICTS", 0.01)

    def against(gap):
        held = SimpleNamespace(found=(play_of(gap),), adequate=True, unseen=SimpleNamespace(beyond=1.0), rings=False)
        return other_form.contradicted(judge, held)

    assert against(GAP) is None
    assert against(1.07 * GAP) is None
    assert against(1.5 * GAP) is not None
    monkeypatch.setattr(refine, "ABOUT", ())
    assert against(1.07 * GAP) is not None


def test_where_nothing_is_known_of_a_controller_play_is_judged_along_the_motion(rattles):
    """An engine that moves the motor as it was seen to go lets the arm hit it like a wall."""
    robot, (run, _), _ = rattles
    unknown = replace(
        run,
        signals={name: values for name, values in run.signals.items() if name not in ("q_cmd", "dq_cmd", "q_link")},
        control=Control("unknown"),
    )
    row = play_of(GAP).row
    folds = [Fold((Found("backlash", 1, row, 50.0),), (unknown,), {})]
    answer, _ = how_far(robot, "full", folds, "mjcf", ["mjcf", "exudyn"])
    assert answer.shrinks_by > 0.7
    assert answer.backends == {}
    assert sorted(answer.refused) == ["exudyn", "mjcf"]
    assert all("walls" in why for why in answer.refused.values())


@pytest.mark.parametrize(("offset", "second"), [(0.0, False), (1.0, True)])
def test_beside_play_only_what_no_other_width_says_is_a_second_cause(rattles, monkeypatch, offset, second):
    """What a fit of play that is caught beside the truth leaves, something else takes a little of."""
    robot, runs, _ = rattles
    biased = [replace(run, signals={**run.signals, "tau": run.signals["tau"] + offset}) for run in runs]
    asked = problem(robot, "full", biased)
    bias = Found("torque_offset", 1, EffectRow(1, FrozenMap({"torque": offset or 0.02})), 50.0)
    found = [play_of(1.05 * GAP), bias]
    caught = Refined({item.key: item.row for item in found}, np.zeros(0), (), np.zeros((0, 0)), np.zeros((0, 0)), ())

    def fitted(part, some):
        left = left_with(part.problem, part.whiten, rows_of(some))
        return replace(caught, rows={item.key: item.row for item in some}, left=left)

    monkeypatch.setattr(unseen._Part, "fit", fitted)
    monkeypatch.setattr(unseen, "straightened", lambda problem, whiten, found, fit, parts: fit)
    worth = unseen.judged(asked, whitening(asked), found, splits(2, 1))
    assert (worth.gains[1] > unseen.EARNS) is second
    # an arm that is clamped does not bounce
    monkeypatch.setattr(unseen, "clamped", lambda *_: True)
    easier = unseen.judged(asked, whitening(asked), found, splits(2, 1))
    assert easier.gains[1] > worth.gains[1] + 10.0
    assert easier.gains[0] == pytest.approx(worth.gains[0])
