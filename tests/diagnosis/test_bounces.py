"""Arms that bounce in their play: what of a gap is no more than that makes of next to nothing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis import other_form
from mbexport.core.diagnosis.bounces import MOST_MADE, UNSAID, Bounces, bounces
from mbexport.core.diagnosis.diagnosis import Unexplained
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.hypothesis import defaults
from mbexport.core.diagnosis.judge import NO_CHANCE, Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.unseen import Unseen, splits
from mbexport.core.diagnosis.words import BOUNCES_SAID, open_in_words
from mbexport.core.effects import EffectRow

from .pendulums import INERTIA, rattling_run

GAP = 0.01
ROTOR = 4.0 * INERTIA
UPRIGHT = replace(
    load("pendulum"),
    gravity=(0.0, 0.0, 0.0),
    effects=FrozenMap({"rotor_inertia": (EffectRow(1, FrozenMap({"inertia": ROTOR})),)}),
)
RUBS = Found("viscous_friction", 1, EffectRow(1, FrozenMap({"coefficient": 0.1})), 50.0)


def play_of(gap):
    return Found("backlash", 1, EffectRow(1, FrozenMap(defaults("backlash") | {"gap": gap})), 50.0)


@pytest.fixture(scope="module")
def run():
    return rattling_run(GAP, ROTOR, seed=1, duration=4.0)


@pytest.mark.parametrize(("wider", "all_of_it"), [(1.035, True), (1.06, False), (1.2, False)])
def test_what_play_leaves_that_is_off_by_a_little_is_no_more_than_a_little_makes(run, wider, all_of_it):
    """Of a run by another integrator: as far off as nobody could know it, and farther."""
    bounced = bounces(UPRIGHT, "full", "mjcf", [(run, [play_of(wider * GAP)])])
    assert bounced is not None
    assert bounced.says_all is all_of_it
    assert bounced.makes > 1.0 if all_of_it else bounced.leaves > 0.4


def test_what_another_cause_leaves_is_more_than_that(run):
    """A torque that the sensor has too much, which bouncing makes none of."""
    off = replace(run, signals={**run.signals, "tau": run.signals["tau"] + 3.0 * np.std(run.signals["tau"])})
    bounced = bounces(UPRIGHT, "full", "mjcf", [(off, [play_of(GAP)])])
    assert bounced is not None
    assert bounced.leaves > 0.8
    assert not bounced.says_all


def test_where_nothing_has_play_or_no_engine_lets_it_bounce_nothing_is_said(run):
    assert bounces(UPRIGHT, "full", "mjcf", [(run, [RUBS])]) is None
    unknown = replace(run, control=replace(run.control, mode="unknown"))
    assert bounces(UPRIGHT, "full", "mjcf", [(unknown, [play_of(GAP)])]) is None


def test_what_is_loud_only_because_more_is_made_than_there_is_says_nothing():
    assert Bounces(0.0, 1.5).says_all
    assert not Bounces(0.0, 1.1 * MOST_MADE).says_all
    assert not Bounces(1.1 * UNSAID, 1.5).says_all


@pytest.fixture(scope="module")
def judge(run):
    runs = [run, rattling_run(GAP, ROTOR, seed=2)]
    asked = problem(UPRIGHT, "full", runs)
    return Judge(UPRIGHT, "full", "mjcf", ["mjcf"], lambda _: None, asked, whitening(asked), splits(2, 1), runs)


@pytest.mark.parametrize(
    ("gain", "bounced", "kept"),
    [
        (2.0 * NO_CHANCE, Bounces(0.1, 1.2), {("backlash", 1)}),
        (0.5 * NO_CHANCE, Bounces(0.1, 1.2), set()),
        (2.0 * NO_CHANCE, Bounces(0.6, 0.4), set()),
        (2.0 * NO_CHANCE, None, set()),
    ],
)
def test_a_simulation_that_no_arm_follows_does_not_judge_play(judge, monkeypatch, gain, bounced, kept):
    found = [play_of(GAP), RUBS]
    rows = (tuple(item.row for item in found),)
    unseen = Unseen((gain, 2.0 * NO_CHANCE), (20.0, 20.0), (0.2, 0.2), (1.0, 1.0), rows, 0.8, False, 1.0, (0.0, 0.0))
    monkeypatch.setattr(Judge, "bounces", lambda *_: bounced)
    assert judge._kept_anyway(found, unseen, SimpleNamespace(shrinks_by=-0.1)) == kept


def test_where_an_arm_began_that_nothing_presses_is_told(judge):
    """Who simulates the corrected model begins elsewhere."""
    (said,) = judge.said_of_play(SimpleNamespace(found=(play_of(GAP), RUBS)))
    assert said.startswith("Next to nothing presses the arm of joint 1 to a side of its play")
    assert judge.said_of_play(SimpleNamespace(found=(RUBS,))) == []


@pytest.mark.parametrize(
    ("by", "bounced", "said"),
    [
        (0.6, Bounces(0.05, 1.2), BOUNCES_SAID),
        # the corrected model is no better
        (-0.1, Bounces(0.05, 1.2), None),
        # a twentieth of the gap is left beyond it
        (0.2, Bounces(0.2, 1.2), None),
        (0.6, Bounces(0.6, 0.4), None),
    ],
)
def test_a_gap_that_play_makes_smaller_is_explained_where_the_rest_bounces(judge, monkeypatch, by, bounced, said):
    monkeypatch.setattr(Judge, "bounces", lambda *_: bounced)
    monkeypatch.setattr(other_form, "_form_of", lambda *_: None)
    held = SimpleNamespace(
        found=(play_of(GAP),), explains=False, adequate=False, by=by, open=(1.0 - by) ** 2, unseen=None, overlays=()
    )
    form = other_form.other_form(judge, held)
    assert (form.said if form else None) == said


def test_what_is_left_of_a_bouncing_arms_gap_is_told_as_that():
    rest = Unexplained(0.16, {"joint_1": 1.0}, f"backlash at joint 1, which {BOUNCES_SAID}")
    answer = SimpleNamespace(verdict="explained", unexplained=rest)
    assert open_in_words(answer) == (
        "Left in the corrected model: 16 % of the gap's energy, most of it at joint 1. An arm that bounces in its play "
        "goes another way each time: robots with nearly the same play come as far apart in simulation."
    )
    assert "Not explained" in open_in_words(SimpleNamespace(verdict="partly_explained", unexplained=rest))
