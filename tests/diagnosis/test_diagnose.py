"""The whole diagnosis: on a pendulum that nothing of the package moves."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import mbexport
from mbexport.core.control import Control
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis import diagnose, in_simulation, unconfirmed, verdict
from mbexport.core.diagnosis.diagnosis import HowFar, Rejected, Unexplained
from mbexport.core.diagnosis.findings import largest_first
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.forms import SOFTLY_SAID
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.gap import Gap
from mbexport.core.diagnosis.growing import without_growing
from mbexport.core.diagnosis.held import NOT_EXCITED, Held
from mbexport.core.diagnosis.in_simulation import _closing, closed_in_simulation
from mbexport.core.diagnosis.judge import Judge, _least_helpful
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_form import contradicted
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.state import Search, contenders
from mbexport.core.diagnosis.unseen import LEAD, Bent, Split, Unseen, in_parts, judged, splits
from mbexport.core.diagnosis.verdict import outside_names, unheld, verdict_of
from mbexport.core.diagnosis.words import NEXT_TO_NOTHING
from mbexport.core.effects import EffectRow
from mbexport.core.errors import RunFileError

from .pendulums import pendulum_run, ringing_run, soft_run


def runs(against=None, seeds=(1, 2), **options):
    return [pendulum_run(seed=seed, **({"against": against} if against else {}), **options) for seed in seeds]


def test_no_gap_where_there_is_none():
    answer = mbexport.diagnose("pendulum", runs(), level="rigid", backends=[])
    assert answer.verdict == "no_gap"
    assert answer.which == ()
    assert answer.effects == {}


def test_a_missing_friction_is_named_measured_and_shown_to_close_the_gap():
    answer = mbexport.diagnose("pendulum", runs(lambda t, q, dq: 0.4 * dq), level="rigid", backends=["urdf"])
    assert answer.verdict == "explained"
    (found,) = answer.which
    assert (found.effect, found.at) == ("viscous_friction", "joint_1")
    low, high = found.parameters["coefficient"].ci95
    assert low < 0.4 < high
    assert high - low < 0.02
    assert found.parameters["coefficient"].unit == "N*m*s/rad"
    assert answer.how_far.shrinks_by > 0.97
    assert answer.how_far.backends["urdf"] > 0.97
    assert answer.how_far.without["viscous_friction joint_1"] == pytest.approx(0.0, abs=1e-12)
    json.dumps(answer.to_json(), allow_nan=False)
    corrected = answer.corrected.effects["viscous_friction"]
    assert corrected[0].values["coefficient"] == found.parameters["coefficient"].value
    # built at the level that was diagnosed it is the robot that closes the gap
    assert mbexport.build(answer.corrected, level=answer.level).effects == ("viscous_friction",)


@pytest.mark.parametrize(("against", "found"), [(None, []), (lambda t, q, dq: 0.4 * dq, ["viscous_friction"])])
def test_runs_without_any_noise_are_no_trap(against, found):
    """As a simulation writes them: nothing is a gap that interpolating its rows makes."""
    clean = [replace(run, noise={}) for run in runs(against, noise={"q": 0.0, "tau": 0.0}, rate=1000.0)]
    answer = mbexport.diagnose("pendulum", clean, level="rigid", backends=[])
    assert [item.effect for item in answer.which] == found
    assert answer.verdict in (("no_gap",) if against is None else ("explained", "partly_explained"))


def test_what_is_in_no_catalogue_is_not_explained():
    # a torque that grows with time, such as no effect makes
    answer = mbexport.diagnose(
        "pendulum", runs(lambda t, q, dq: 0.8 * np.sin(11.0 * t) * t, duration=2.5), level="rigid", backends=[]
    )
    assert answer.verdict in ("unexplained", "partly_explained")
    assert answer.unexplained.share > 0.3


def test_a_gap_in_the_held_out_run_alone_is_said_to_be_one():
    """And no cause is named that the other runs do not have."""
    seen, (rubs,) = runs(duration=2.0), runs(lambda t, q, dq: 0.4 * dq, seeds=(3,), duration=2.0)
    answer = mbexport.diagnose("pendulum", seen, [rubs], level="rigid", backends=[])
    assert (answer.verdict, answer.which) == ("unexplained", ())
    assert answer.holdout == (rubs.name,)
    assert any("held-out runs alone" in note for note in answer.notes)


def test_what_the_fitted_run_does_not_show_is_found_in_parts_of_the_held_out_one():
    answer = mbexport.diagnose("pendulum", *noisy_and_quiet(), level="rigid", backends=[])
    (found,) = answer.which
    low, high = found.parameters["coefficient"].ci95
    assert (found.effect, low < 0.4 < high) == ("viscous_friction", True)
    assert len(answer.runs) == 2
    assert answer.holdout == ()
    assert any("cut in time and all runs were fitted" in note for note in answer.notes)


@pytest.mark.parametrize(
    ("word", "not_understood", "named"),
    [("partly_explained", 0.4, False), ("partly_explained", 0.3, True), ("explained", 0.4, True)],
)
def test_what_no_held_out_run_confirms_is_named_only_where_it_explains(monkeypatch, word, not_understood, named):
    """What is left may be another form of its law."""
    whole = diagnose.concluded

    def half(asked, judge, held, found):
        end = whole(asked, judge, held, found)
        return replace(end, verdict=word, not_understood=not_understood) if held.found else end

    monkeypatch.setattr(diagnose, "concluded", half)
    answer = mbexport.diagnose("pendulum", *noisy_and_quiet(), level="rigid", backends=[])
    found = [item.effect for item in answer.which]
    assert (answer.verdict, found) == ((word, ["viscous_friction"]) if named else ("unexplained", []))


@pytest.mark.parametrize("form", [None, Bent(0.1, 0, SOFTLY_SAID)])
def test_what_a_law_that_no_engine_has_says_along_the_motion_is_understood(monkeypatch, form):
    """A limit that is felt before it is reached, in a run alone, was not named: the one that cuts closed no gap."""
    whole, ends = diagnose.concluded, []

    def concluded(asked, judge, held, found):
        ends.append((whole(asked, judge, held, found), held.unseen.open))
        return ends[-1][0]

    monkeypatch.setattr(verdict, "other_form", lambda judge, held: form)
    monkeypatch.setattr(diagnose, "concluded", concluded)
    rubbing = runs(lambda t, q, dq: 0.4 * dq + 0.2 * math.tanh(50.0 * math.sin(7.0 * t)), seeds=(1, 2))
    mbexport.diagnose("pendulum", rubbing[:1], rubbing[1:], level="rigid", backends=[])
    end, along = ends[0]
    assert 0.0 < along < 1.0
    assert end.unexplained.share > 0.0
    assert end.not_understood == (0.1 * along if form else end.unexplained.share)


def test_what_fails_on_held_out_runs_is_asked_of_all_runs_in_parts(monkeypatch):
    whole = diagnose._Diagnosing._of

    def fails(self, ask):
        answer = whole(self, ask)
        failed = replace(answer.diagnosis, verdict="unexplained", which=(), notes=())
        told = unconfirmed.Unconfirmed(unconfirmed.FAILS, tuple(run.name for run in ask.holdout))
        return replace(answer, diagnosis=failed, again=told, open=1.0) if ask.holdout else answer

    monkeypatch.setattr(diagnose._Diagnosing, "_of", fails)
    rubbing = runs(lambda t, q, dq: 0.4 * dq, seeds=(1, 2))
    answer = mbexport.diagnose("pendulum", rubbing[:1], rubbing[1:], level="rigid", backends=[])
    assert (answer.verdict, [item.effect for item in answer.which]) == ("explained", ["viscous_friction"])
    assert answer.notes[-1].startswith(
        "The held-out runs confirm nothing that the others show. So swing was cut in time"
    )


@pytest.mark.parametrize(("left", "taken"), [(0.3, True), (0.2, False)])
def test_what_parts_of_runs_leave_open_as_well_changes_no_answer(monkeypatch, left, taken):
    whole = diagnose._Diagnosing._of

    def partly(self, ask):
        answer = whole(self, ask)
        told = unconfirmed.Unconfirmed("It is asked again.", tuple(run.name for run in ask.holdout))
        part = left if ask.holdout else 0.25
        said = replace(answer.diagnosis, verdict="partly_explained", unexplained=Unexplained(part, {}, ""))
        return replace(answer, diagnosis=said, again=told if ask.holdout else None, open=part)

    monkeypatch.setattr(diagnose._Diagnosing, "_of", partly)
    rubbing = runs(lambda t, q, dq: 0.4 * dq, seeds=(1, 2))
    answer = mbexport.diagnose("pendulum", rubbing[:1], rubbing[1:], level="rigid", backends=[])
    assert (answer.unexplained.share, answer.holdout == ()) == (0.25 if taken else 0.2, taken)


def test_what_one_passage_of_one_run_alone_shows_is_told_and_not_named():
    """A torque limit that is reached once: nothing confirms it, and it may be what it is."""

    def gives(torque):
        return max(-5.4, min(5.4, torque))

    seen, held_out = (pendulum_run(seed=k, duration=long, gives=gives) for k, long in ((1, 0.9), (2, 3.0)))
    answer = mbexport.diagnose("pendulum", [seen], [held_out], level="rigid", backends=[])
    assert (answer.verdict, answer.which) == ("unexplained", ())
    assert answer.notes[-1].startswith("Fitted to all runs, torque_limit at joint_1 would leave 0 % of the gap")


def test_what_only_the_held_out_run_moves_far_enough_to_show_is_found_in_parts_of_it():
    """Of a wave of four a turn half a second's way shows less than half, which may be a spring as well."""
    seen, held_out = (
        pendulum_run(against=lambda t, q, dq: 0.3 * math.sin(4.0 * q + 0.4), seed=k, duration=long)
        for k, long in ((1, 0.5), (2, 3.0))
    )
    answer = mbexport.diagnose("pendulum", [seen], [held_out], level="rigid", backends=[])
    (found,) = answer.which
    low, high = found.parameters["cycles"].ci95
    assert (answer.verdict, found.effect, low < 4.0 < high) == ("explained", "torque_ripple", True)
    assert answer.notes[-1].startswith("Most is left at joint_1, which moves over 1.57 rad in the held-out runs, 0.73")


def test_parts_of_runs_are_not_searched_on_where_the_first_causes_leave_most(monkeypatch):
    """No answer is named there that leaves more than a third."""
    asked, whole = [], diagnose.search

    def search(state, tell=None, vain=None):
        found = whole(state, tell, vain)
        asked.append((vain is not None, len(found.found)))
        return found

    monkeypatch.setattr(diagnose, "search", search)
    monkeypatch.setattr(unconfirmed, "FIRST_CAUSES", 1)
    quiet, held_out = runs(duration=1.5)[0], runs(lambda t, q, dq: 2.0 * np.sin(40.0 * t) * t, duration=2.0)[0]
    answer = mbexport.diagnose("pendulum", [quiet], [held_out], level="rigid", backends=[])
    assert answer.verdict == "unexplained"
    assert [count for apart, count in asked if apart] == [1]


def test_what_no_cause_explains_on_loud_fitted_runs_is_asked_once(monkeypatch):
    """Parts of the held-out run would make it no clearer, and take as long again."""
    asked, whole = [], diagnose._Diagnosing._of

    def once(self, ask):
        asked.append(len(ask.holdout))
        return whole(self, ask)

    monkeypatch.setattr(diagnose._Diagnosing, "_of", once)
    driven = runs(lambda t, q, dq: 2.0 * math.sin(11.0 * t + 4.0 * math.sin(1.7 * t)))
    answer = mbexport.diagnose("pendulum", driven[:1], driven[1:], level="rigid", backends=[])
    assert (answer.verdict, answer.which) == ("unexplained", ())
    assert asked == [1]


def noisy_and_quiet():
    """A run whose sensors drown friction, and one whose do not."""
    (quiet,) = runs(lambda t, q, dq: 0.4 * dq, seeds=(2,))
    return runs(lambda t, q, dq: 0.4 * dq, seeds=(1,), noise={"q": 0.03, "tau": 20.0}), [quiet]


def test_a_short_run_is_judged_in_parts_too():
    (found,) = mbexport.diagnose(
        "pendulum", runs(lambda t, q, dq: 0.4 * dq, seeds=(1,), duration=1.2), level="rigid", backends=[]
    ).which
    assert found.effect == "viscous_friction"


def test_a_run_too_short_to_compare_is_refused_by_its_name():
    with pytest.raises(RunFileError, match=r"run .*: 16 rows over 0\.06 s .* at least 50 rows and 0\.5 s"):
        mbexport.diagnose("pendulum", runs(seeds=(1,), duration=0.06), level="rigid", backends=[])


def test_a_torque_below_the_noise_of_accelerations_is_found_where_it_is():
    """The noise of differentiated positions is in high bands; a torque that stands still is not."""
    answer = mbexport.diagnose("pendulum", loud(lambda t, q, dq: 0.05), level="rigid", backends=[])
    assert [item.effect for item in answer.which] == ["torque_offset"]
    low, high = answer.which[0].parameters["torque"].ci95
    assert low < 0.05 < high
    assert mbexport.diagnose("pendulum", loud(), level="rigid", backends=[]).verdict == "no_gap"


def test_what_is_left_below_the_noise_of_accelerations_is_open():
    """Drag is not quite viscous friction, which a mean square takes for noise."""
    drags = loud(lambda t, q, dq: 0.02 * dq * abs(dq), torque=0.002)
    answer = mbexport.diagnose("pendulum", drags, level="rigid", backends=[])
    assert [item.effect for item in answer.which] == ["viscous_friction"]
    assert answer.how_far.after["tau"] < 1.1 * answer.how_far.noise["tau"]
    assert answer.verdict == "partly_explained"
    assert 0.05 < answer.unexplained.share < 0.3


def test_a_torque_that_acts_a_little_later_is_no_gap_where_nobody_knows_its_controller():
    """A tick that a record does not tell of: half of it is the hold's, and the rest a drive's."""
    held = runs(lambda t, q, dq: 0.4 * dq, mode="unknown", torque_late=-1e-3, noise={"q": 2e-5, "tau": 0.002})
    answer = mbexport.diagnose("pendulum", held, level="rigid", backends=[])
    assert [item.effect for item in answer.which] == ["viscous_friction"]
    assert answer.verdict == "explained"
    assert answer.how_far.shrinks_by > 0.98
    assert answer.how_far.after["tau"] < 1.1 * answer.how_far.noise["tau"]
    assert any("The torque in swing acts 1.5" in note for note in answer.notes)


def loud(against=None, torque=0.01):
    """Recorded motions with loud positions; nothing is known of a controller."""
    return runs(against, mode="unknown", noise={"q": 6e-4, "tau": torque})


def test_a_robot_that_stands_and_sticks_leaves_nothing_to_compare():
    """Its friction bears any load: where it stands is all that there is."""
    random = np.random.default_rng(3)
    pose = np.tile([0.0, 0.7, 3.0, 0.0, 0.5, 0.0], (500, 1))
    control = Control("pd", kp=(2000.0,) * 6, kd=(100.0,) * 6)
    stand = [
        replace(
            run,
            t=np.arange(500) / 250.0,
            signals={"q_cmd": pose, "q": pose + 1e-5 * random.normal(size=pose.shape)},
            control=control,
            noise={},
        )
        for run in runs()
    ]
    answer = mbexport.diagnose("puma560", stand, backends=[])
    assert (answer.verdict, answer.which) == ("unexplained", ())
    assert any("Every joint stands" in note for note in answer.notes)


def test_one_run_is_judged_in_parts():
    (run,) = runs(seeds=(3,))
    parts = in_parts(run)
    assert len(parts) == 3
    assert sum(int(part.judged.sum()) for part in parts) == len(run.t)
    assert all(part.t[0] == 0.0 for part in parts)
    assert np.array_equal(np.concatenate([part.signals["q"][part.judged] for part in parts]), run.signals["q"])


def test_what_leads_up_to_a_part_is_as_long_as_anything_acts_on():
    (run,) = runs(seeds=(3,), duration=24.0)
    first, second, third = in_parts(run)
    assert first.since == 0.0
    assert (second.since, third.since) == (pytest.approx(LEAD, abs=2.0 / run.rate),) * 2
    assert np.array_equal(third.signals["tau"], run.signals["tau"][-len(third.t) :])


def test_what_rings_on_from_one_part_of_a_run_to_the_next_is_no_damping():
    """Parts that began at rest were said to be damped two hundred times as much."""
    answer = mbexport.diagnose("pendulum", [soft_run(150.0, 0.02, seed=1)], level="rigid", backends=[])
    (found,) = answer.which
    (low, high), (least, most) = (found.parameters[name].ci95 for name in ("stiffness", "damping"))
    assert (answer.verdict, found.effect) == ("explained", "joint_compliance")
    assert low < 150.0 < high < 1.01 * low
    assert 0.015 < least < most < 0.03


def test_what_leads_up_to_a_part_is_not_drawn():
    answer = mbexport.diagnose("pendulum", runs(seeds=(1,)), level="rigid", backends=[])
    first, second, third = answer.overlays
    assert (first.t[0], second.t[0]) == (0.0, pytest.approx(first.t[-1] + 0.004))
    assert sum(len(overlay.t) for overlay in answer.overlays) == 1001
    for overlay in (first, second, third):
        for signals in (overlay.measured, overlay.before, overlay.after):
            assert {len(values) for values in signals.values()} == {len(overlay.t)}
        assert all(np.isfinite(values).all() for values in overlay.measured.values())


def test_a_run_is_put_right_before_it_is_cut():
    """A part of it alone tells less of its stamps, and might tell other ones."""
    answer = mbexport.diagnose("pendulum", runs(seeds=(1,), late=0.004), level="rigid", backends=[])
    assert answer.verdict == "no_gap"
    (said,) = [note for note in answer.notes if "(1.00 samples) after its stamps" in note]
    assert said.startswith("All that was measured in swing comes")


def test_every_run_is_left_out_once():
    ways = splits(3, 0)
    assert sorted(k for way in ways for k in way.unseen) == [0, 1, 2]
    assert all(not set(way.seen) & set(way.unseen) for way in ways)
    assert splits(3, 1)[0].unseen == (2,)


def test_a_run_cannot_judge_itself():
    (run,) = runs(seeds=(1,))
    with pytest.raises(mbexport.UsageError, match="held out"):
        mbexport.diagnose("pendulum", [run], [run])


def test_what_a_law_of_another_form_leaves_is_told_and_not_open():
    # friction that rises a little more slowly than a law of the catalogue has it
    answer = mbexport.diagnose("pendulum", runs(lambda t, q, dq: 1.2 * dq - 0.02 * dq**3), level="rigid", backends=[])
    assert answer.which[0].effect == "viscous_friction"
    assert answer.verdict == "explained"
    assert 0.0 <= answer.unexplained.share < 0.05
    if answer.unexplained.share:
        told = answer.unexplained.share >= NEXT_TO_NOTHING
        assert ("no more than a law leaves" if told else "less than 1 % of the gap's energy") in answer.summary()


def test_what_rings_outside_the_catalogue_is_told_beside_a_bearing():
    """A mount under the base and a load that sloshes look like one."""
    bearing, friction = (Found(name, 1, EffectRow(1, {}), 50.0) for name in ("joint_compliance_6d", "viscous_friction"))
    assert any("sloshes" in note for note in outside_names([friction, bearing], [Control("motion")]))
    assert outside_names([friction], [Control("motion")]) == []


def test_a_drive_that_lags_is_told_beside_a_damping_gain_that_is_less_than_logged():
    """Of a slow error it makes of both gains what its response makes of them."""
    late, slow, logged = 0.0075, 2.0, (1705.0, 101.2)
    response = (logged[0] + 1j * slow * logged[1]) / (1.0 + 1j * slow * late)
    kp, kd = response.real / logged[0], response.imag / slow / logged[1]
    control = Control("pd", (50.0, logged[0]), (5.0, logged[1]))

    def said(kp, kd, *controls):
        gain = Found("controller_gain", 2, EffectRow(2, {"kp": kp, "kd": kd}), 50.0)
        return outside_names([gain], controls or [control])

    (note,) = said(kp, kd)
    assert "at joint 2" in note and "a lag of 7.50 ms" in note
    # what a lag does not: more damping, the other gain off as well, nothing of a controller known, other gains
    assert said(1.0, 1.1) == said(0.8, kd) == said(kp, kd, Control("unknown")) == []
    assert said(kp, kd, control, Control("pd", (50.0, 900.0), (5.0, 101.2))) == []


def far(total, without, sure):
    nothing = {}
    return HowFar(nothing, nothing, nothing, total, sure, nothing, without=without)


def test_what_does_not_help_unseen_runs_is_dropped():
    row = EffectRow(1, {"torque": 1.0})
    one, other = Found("coulomb_friction", 1, row, 50.0), Found("torque_offset", 1, row, 50.0)
    names = ("coulomb_friction joint_1", "torque_offset joint_1")
    helped = dict(zip(names, (0.3, 0.6), strict=True))
    assert _least_helpful([one, other], (20.0, 20.0), far(0.9, helped, (0.8, 0.95))) is None
    harmful = dict(zip(names, (0.3, 0.95), strict=True))
    assert _least_helpful([one, other], (20.0, 20.0), far(0.9, harmful, (0.8, 0.95))) is other
    # a little more is not enough where the evidence is thin
    idle = dict(zip(names, (0.3, 0.899), strict=True))
    assert _least_helpful([one, other], (20.0, 5.0), far(0.9, idle, (0.8, 0.95))) is other
    assert _least_helpful([one, other], (20.0, 20.0), far(0.9, idle, (0.8, 0.95))) is None
    # nor is a gain that may be none
    assert _least_helpful([one, other], (20.0, 20.0), far(0.1, helped, (-0.1, 0.3))) is not None
    # where evidence is beyond doubt it may be little known how far it helps
    plain = dict(zip(names, (0.1, 0.2), strict=True))
    assert _least_helpful([one, other], (20.0, 20.0), far(0.4, plain, (-0.1, 0.7))) is None
    assert _least_helpful([one, other], (20.0, 5.0), far(0.4, plain, (-0.1, 0.7))) is not None
    # and where one moment decides how far, but nothing gets worse
    once = dict(zip(names, (0.02, 0.08), strict=True))
    assert _least_helpful([one, other], (20.0, 20.0), far(0.1, once, (-0.001, 0.2))) is None
    assert _least_helpful([one, other], (20.0, 5.0), far(0.1, once, (-0.001, 0.2))) is not None
    crumb = dict(zip(names, (0.02, 0.03), strict=True))
    assert _least_helpful([one, other], (20.0, 20.0), far(0.04, crumb, (-0.001, 0.2))) is not None


@pytest.mark.parametrize("effect", ["delay", "joint_compliance", "joint_compliance_6d", "link_flexibility"])
def test_delays_and_springs_go_where_simulation_has_no_gap_for_them_to_close(effect):
    late = Found(effect, 0 if effect == "delay" else 1, EffectRow(1, {}), 50.0)
    rubs = Found("coulomb_friction", 1, EffectRow(1, {"torque": 1.0}), 50.0)
    assert _least_helpful([rubs, late], (20.0, math.inf), far(None, {}, None)) is late
    assert _least_helpful([rubs], (20.0,), far(None, {}, None)) is None


@pytest.mark.parametrize(
    ("effect", "gain", "left", "total", "stays"),
    [
        ("backlash", 90.0, 0.3, None, True),
        ("link_flexibility", 90.0, 0.3, None, True),
        ("backlash", 30.0, 0.3, None, False),
        ("backlash", 90.0, 0.7, None, False),
        ("delay", 90.0, 0.3, None, False),
        ("backlash", 90.0, 0.3, 0.0, False),
    ],
)
def test_what_gives_stays_where_only_simulation_hides_the_gap_that_it_closes(
    effect, gain, left, total, stays, monkeypatch
):
    """Half of what the motion of unseen runs has, by evidence that no chance makes, is no ringing of noise."""
    monkeypatch.setattr(Judge, "bounces", lambda *_: None)
    asked = problem(load("pendulum"), "rigid", [pendulum_run(duration=1.0)])
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(1, 0), ())
    gives = Found(effect, 0 if effect == "delay" else 1, EffectRow(1, {}), 50.0)
    unseen = Unseen((gain,), (9.0,), (1.0,), (1.0,), ((gives.row,),), open=left, numbers_beyond=(0.0,))
    told = far(total, {f"{effect} {gives.place}": 0.0}, None if total is None else (-0.1, 0.1))
    kept = judge._kept_anyway([gives], unseen, told)
    assert (_least_helpful([gives], unseen.gains, told, kept) is None) == stays


@pytest.mark.parametrize(("beyond", "gain", "stays"), [(0.01, 500.0, True), (0.01, 20.0, False), (1.0, 500.0, False)])
def test_beside_a_law_that_no_engine_has_simulation_judges_nothing_that_is_beyond_doubt(beyond, gain, stays):
    asked = problem(load("pendulum"), "rigid", [pendulum_run(duration=1.0)])
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(1, 0), ())
    droops = Found("torque_constant", 1, EffectRow(1, {"gain": 1.0, "droop": 0.01}), 50.0)
    both = [droops, Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.1}), 50.0)]
    unseen = Unseen((900.0, gain), (9.0, 9.0), (1.0, 1.0), (1.0, 1.0), ((),), 0.9, True, beyond, (0.01, 0.0))
    told = far(-0.1, {"torque_constant joint_1": 0.0, "coulomb_friction joint_1": 0.0}, (-0.2, 0.0))
    assert (both[1].key in judge._kept_anyway(both, unseen, told)) == stays


def test_a_delay_that_does_not_help_goes_whatever_its_evidence():
    """A torque stamped one tick late says as much along the motion."""
    late, rubs = (Found(name, 1, EffectRow(1, {}), 50.0) for name in ("delay", "coulomb_friction"))
    names = (f"delay {late.place}", f"coulomb_friction {rubs.place}")
    idle = dict(zip(names, (0.9, 0.1), strict=True))
    assert _least_helpful([late, rubs], (500.0, 20.0), far(0.9, idle, (0.8, 0.95))) is late
    helps = dict(zip(names, (0.5, 0.1), strict=True))
    assert _least_helpful([late, rubs], (0.0, 20.0), far(0.9, helps, (0.8, 0.95))) is None


@pytest.mark.parametrize(("gain", "why", "said"), [(500.0, NOT_EXCITED, 1), (20.0, NOT_EXCITED, 0), (500.0, "", 0)])
def test_what_no_held_out_run_excites_is_no_gap_that_is_not_there(gain, why, said):
    clipped = Found("torque_limit", 1, EffectRow(1, {"torque": 5.0}), gain)
    held = SimpleNamespace(found=(), dropped=(Rejected("torque_limit", "joint_1", why),))
    assert len(unheld([clipped], held)) == said
    held.found = (clipped,)
    assert unheld([clipped], held) == []


def test_findings_are_told_thelargest_first():
    names = ("viscous_friction", "coulomb_friction", "backlash")
    found = [Found(name, k, EffectRow(k, {}), 50.0) for k, name in enumerate(names, start=1)]
    # without friction that is nearly all next to nothing goes; without the last no engine can simulate it
    without = {"viscous_friction joint_1": 0.98, "coulomb_friction joint_2": 0.01, "backlash joint_3": None}
    held = SimpleNamespace(found=found, how_far=SimpleNamespace(without=without))
    assert largest_first(held) == [2, 1, 0]
    nothing = SimpleNamespace(found=found, how_far=SimpleNamespace(without={}))
    assert largest_first(nothing) == [0, 1, 2]


def held_alone(effect, against, delay):
    """A judge, a search and what holds where one friction was found of three runs, the last held out."""
    measured = [pendulum_run(seed=seed, against=against, delay=delay, duration=3.0) for seed in (1, 2, 3)]
    column = {"coulomb_friction": "torque", "viscous_friction": "coefficient"}[effect]
    start, absent = (EffectRow(1, {column: value}) for value in (0.03, 0.0))
    whole, ways = problem(load("pendulum"), "rigid", measured), splits(3, 1)
    whiten = whitening(whole)
    judge = Judge(load("pendulum"), "rigid", "mjcf", ["mjcf"], lambda _: None, whole, whiten, ways, measured)
    state = Search(whole.only(ways[0].seen), whiten.only(whole.evidence.places(ways[0].seen)))
    state.begin()
    held = judge.held([Found(effect, 1, start, 100.0, absent)])
    assert not held.adequate
    return judge, state, held


@pytest.mark.parametrize(
    ("against", "delay", "names"),
    [
        (lambda t, q, dq: 0.03 * math.tanh(1000.0 * dq), 6, ["coulomb_friction", "delay"]),
        (lambda t, q, dq: 0.1 * dq * abs(dq), 0, ["viscous_friction"]),
    ],
    ids=["delay", "drag"],
)
def test_what_the_measured_motion_hardly_shows_is_found_in_simulation(against, delay, names):
    """A drive's delay closes the gap beside friction; what is in no catalogue is closed by nothing."""
    judge, state, held = held_alone(names[0], against, delay)
    closed = closed_in_simulation(judge, held, state)
    assert [item.effect for item in closed.found] == names
    if delay:
        assert closed.adequate
        assert closed.unseen.rows[0][1].values["time"] == pytest.approx(2.0e-3, rel=0.02)
        assert closed.found[1].gain > 100.0
        # what unseen motions say of it is theirs, and not what simulation says of the fitted ones
        assert closed.unseen.gains[1] != closed.found[1].gain


def test_a_drive_that_rings_is_found_in_simulation_where_the_measured_motion_shows_nothing(monkeypatch):
    """And what that motion then has left does not speak against it."""
    stiffness, damping, inertia = 1000.0, 0.1, 0.3
    rotor = EffectRow(1, FrozenMap({"inertia": inertia}))
    robot = replace(load("pendulum"), effects=FrozenMap({"rotor_inertia": (rotor,)}))
    measured = [ringing_run(stiffness, damping, inertia, seed=seed, duration=2.5) for seed in (1, 2)]
    whole, ways = problem(robot, "full", measured), splits(2, 1)
    whiten = whitening(whole)
    judge = Judge(robot, "full", "mjcf", ["mjcf"], lambda _: None, whole, whiten, ways, measured)
    state = Search(whole.only(ways[0].seen), whiten.only(whole.evidence.places(ways[0].seen)))
    state.begin()
    # which sizes the candidates
    contenders(state, blocks(state.problem.evidence))
    held = closed_in_simulation(judge, judge.held([]), state)
    assert [item.key for item in held.found] == [("joint_compliance", 1)]
    assert held.adequate
    assert held.unseen.rows[0][0].values["stiffness"] == pytest.approx(stiffness, rel=0.05)
    assert contradicted(judge, held) is None
    # stiffer than it is it rings elsewhere, and leaves most of what the motion shows
    (item,) = held.found
    row = EffectRow(1, FrozenMap({**item.row.values, "stiffness": 1.5 * stiffness}))
    stiffer = replace(held, found=(replace(item, row=row),))
    assert contradicted(judge, stiffer) is None
    assert contradicted(judge, replace(stiffer, rings=False)) is not None
    # what another form of a law at its joint says as well would be no second cause
    monkeypatch.setattr(in_simulation, "judged", lambda *asked: replace(judged(*asked), own=(0.2,)))
    assert closed_in_simulation(judge, judge.held([]), state).found == ()


def test_what_closes_a_gap_with_numbers_that_may_be_anything_is_not_found(monkeypatch):
    judge, state, held = held_alone("coulomb_friction", lambda t, q, dq: 0.03 * math.tanh(1000.0 * dq), 6)
    monkeypatch.setattr("mbexport.core.diagnosis.in_simulation.vanished", lambda *_: True)
    assert closed_in_simulation(judge, held, state).found == held.found


@pytest.mark.parametrize(("energy", "found"), [(12.0, False), (120.0, True)])
def test_what_closes_a_gap_that_is_next_to_none_is_not_found(monkeypatch, energy, found):
    judge, state, held = held_alone("coulomb_friction", lambda t, q, dq: 0.03 * math.tanh(1000.0 * dq), 6)

    def nearly_all(*arguments):
        options = arguments[4]
        return energy, [0.1 * energy] * len(options)

    monkeypatch.setattr("mbexport.core.diagnosis.in_simulation.closing", nearly_all)
    assert bool(_closing(judge, held, state)) == found


RUBS = {
    "coulomb_friction": (EffectRow(1, FrozenMap({"torque": 0.08})),),
    "viscous_friction": (EffectRow(1, FrozenMap({"coefficient": 0.02})),),
}


def drags(t, q, dq):
    return 0.08 * np.sign(dq) + 0.02 * dq + 0.05 * dq * abs(dq)


def rubs_otherwise(t, q, dq):
    return 0.03 * np.sign(dq) + 0.08 * dq


@pytest.mark.parametrize(
    ("coulomb", "stribeck", "viscous", "growing"),
    [
        # a drag: as much at rest, and more with speed
        (0.05, 0.03, 0.06, 1),
        (0.05, 0.02, 0.06, 1),
        # friction that falls off with speed, and no more of it
        (0.05, 0.03, 0.01, 0),
        (0.05, 0.001, 0.06, 0),
        # more of everything
        (0.10, 0.03, 0.06, 0),
    ],
)
def test_what_grows_faster_than_with_speed_is_no_friction(monkeypatch, coulomb, stribeck, viscous, growing):
    """Three laws of friction follow a drag to the last part, and none of them is its cause."""
    database = replace(load("pendulum"), effects=FrozenMap(RUBS))
    run = pendulum_run(duration=1.0)
    asked = problem(database, "full", [run])
    judge = Judge(database, "full", "mjcf", [], lambda _: None, asked, whitening(asked), [Split((0,), (0,))], [run])
    rows = {
        "coulomb_friction": {"torque": coulomb},
        "stribeck_friction": {"torque": stribeck, "velocity": 0.5},
        "viscous_friction": {"coefficient": viscous},
    }
    found = tuple(Found(effect, 1, EffectRow(1, values), 50.0) for effect, values in rows.items())
    far = HowFar({}, {}, {}, 0.9, (0.8, 1.0), {})
    held = Held(found, SimpleNamespace(open=0.0, stands_out=False), (), set(), far, (), None)
    monkeypatch.setattr(Judge, "held", lambda _, kept: replace(held, found=tuple(kept)))
    rest = without_growing(judge, held)
    assert (rest.no_law.joint if rest.no_law else 0) == growing
    if growing:
        assert [item.effect for item in rest.found] == ["viscous_friction"]
        assert [(item.effect, item.at) for item in rest.dropped] == [
            ("coulomb_friction", "joint_1"),
            ("stribeck_friction", "joint_1"),
        ]
    else:
        assert rest is held


@pytest.mark.parametrize(("against", "growing"), [(drags, 1), (rubs_otherwise, 0)])
def test_a_drag_is_no_less_coulomb_and_more_viscous_friction(monkeypatch, against, growing):
    """To the last part two laws of friction follow it; one number says as much."""
    database = replace(load("pendulum"), effects=FrozenMap(RUBS))
    seen = [pendulum_run(against=against, seed=seed) for seed in (1, 2)]
    asked = problem(database, "full", seen)
    judge = Judge(database, "full", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), seen)
    begun = [
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.07}), 50.0),
        Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.05}), 50.0),
    ]
    fit = refined(asked, judge.whiten, begun, blocks(asked.evidence))
    found = tuple(replace(item, row=fit.rows[item.key]) for item in begun)
    assert found[0].row.values["torque"] < 0.08
    assert found[1].row.values["coefficient"] > 0.02
    far = HowFar({}, {}, {}, 0.9, (0.8, 1.0), {})
    held = Held(found, SimpleNamespace(open=0.0, stands_out=False), (), set(), far, (), None)
    monkeypatch.setattr(Judge, "held", lambda _, kept: replace(held, found=tuple(kept)))
    rest = without_growing(judge, held)
    assert (rest.no_law.joint if rest.no_law else 0) == growing
    assert [item.effect for item in rest.found] == ["coulomb_friction", "viscous_friction"][growing:]
    assert [(item.effect, item.at) for item in rest.dropped] == [("coulomb_friction", "joint_1")][:growing]


@pytest.mark.parametrize(
    ("against", "growing"),
    [
        (lambda t, q, dq: 0.004 * dq * abs(dq), 1),
        (lambda t, q, dq: 0.03 * dq, 0),
        (lambda t, q, dq: 0.06 * dq / (1.0 + 0.4 * abs(dq)), 0),
    ],
)
def test_viscous_friction_that_follows_a_drag_is_not_the_whole_cause(against, growing):
    """It stays, as what is nearest; friction that yields with speed is none."""
    runs = [pendulum_run(against=against, seed=seed) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    begun = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.02}), 50.0)
    fit = refined(asked, judge.whiten, [begun], blocks(asked.evidence))
    found = (replace(begun, row=fit.rows[begun.key]),)
    far = HowFar({}, {}, {}, 0.9, (0.8, 1.0), {})
    held = Held(found, SimpleNamespace(open=0.0, stands_out=False), (), set(), far, (), None)
    rest = without_growing(judge, held)
    assert (rest.found, rest.no_law.joint if rest.no_law else 0) == (found, growing)
    assert verdict_of(rest, True, None, None) == ("partly_explained" if growing else "explained")


@pytest.mark.parametrize(
    ("by", "short", "name"),
    [
        (0.8, 0.02, "joint_compliance"),
        (0.8, 0.05, "joint_compliance_6d"),
        # where next to nothing is left, more of its size
        (0.926, 0.03, "joint_compliance"),
        (0.3, 0.02, "joint_compliance_6d"),
    ],
)
def test_a_likelier_name_may_leave_a_hundredth_of_the_gaps_energy_more(by, short, name, monkeypatch):
    """As names may that are not told apart."""
    bearing, drive = (
        Found(effect, 1, EffectRow(1, {}), 50.0) for effect in ("joint_compliance_6d", "joint_compliance")
    )
    held = {
        item.effect: Held((item,), SimpleNamespace(), (), set(), HowFar({}, {}, {}, one, (0.0, 1.0), {}), (), None)
        for item, one in ((bearing, by), (drive, by - short))
    }
    judge = SimpleNamespace(held=lambda found: held[found[0].effect])
    better = {(bearing,): (drive,), (drive,): None}
    monkeypatch.setattr(diagnose, "told_apart", lambda judge, found, names: (names, better[found]))
    diagnosing = SimpleNamespace(_names=lambda state, found: (None, [()]))
    kept, _, _ = diagnose._Diagnosing._named(diagnosing, None, judge, held["joint_compliance_6d"])
    assert [item.effect for item in kept.found] == [name]


def test_a_better_name_may_give_way_to_what_looks_like_it(monkeypatch):
    """A mass at a point of the wrist, to a load, to the wrist with all of its numbers; and no further."""
    names = ("one", "two", "three", "four")
    held = {
        name: Held(
            (Found(name, 1, EffectRow(1, {}), 50.0),),
            SimpleNamespace(),
            (),
            set(),
            HowFar({}, {}, {}, 0.8, (0.0, 1.0), {}),
            (),
            None,
        )
        for name in names
    }
    judge = SimpleNamespace(held=lambda found: held[found[0].effect])
    following = dict(pairwise(names))
    monkeypatch.setattr(
        diagnose, "told_apart", lambda judge, found, _: (found[0].effect, held[following[found[0].effect]].found)
    )
    diagnosing = SimpleNamespace(_names=lambda state, found: (found[0].effect, [()]))
    kept, fit, said = diagnose._Diagnosing._named(diagnosing, None, judge, held["one"])
    assert [kept.found[0].effect, fit, said] == ["three"] * 3


def test_what_simulation_alone_speaks_against_makes_room_for_what_else_explains_the_fitted_runs(monkeypatch):
    """Play that no fitted run crosses is an encoder's offset there, and is crossed where no fit saw it."""
    run = pendulum_run(duration=1.0)
    asked = problem(load("pendulum"), "rigid", [run])
    judge = Judge(
        load("pendulum"), "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), [Split((0,), (0,))], [run]
    )
    offset = Found("encoder_offset", 1, EffectRow(1, {"offset": 1e-3}), 500.0)
    nothing = judge.held([])
    assert nothing.failed == set()
    worse = far(-0.2, {"encoder_offset joint_1": 0.0}, (-0.3, -0.1))
    seen = replace(nothing.unseen, gains=(500.0,), rows=((offset.row,),))
    monkeypatch.setattr(Judge, "_tame", lambda _, items: (list(items), seen if items else nothing.unseen, ()))
    monkeypatch.setattr(Judge, "numbers", lambda *_, **__: ())
    answers = {True: (worse, (), None), False: (nothing.how_far, (), None)}
    monkeypatch.setattr(Judge, "_how_far", lambda _, items, *__: answers[bool(items)])
    held = judge.held([offset])
    assert held.found == ()
    assert [item.why for item in held.dropped] == ["no gain on held-out data"]
    assert held.failed == {("encoder_offset", "joint_1")}


@pytest.mark.parametrize(("size", "verdict"), [(0.0, "no_gap"), (0.02, "unexplained")])
def test_a_gap_that_stands_in_fitted_runs_alone_is_one(size, verdict):
    """A bearing that rubs at times, and not in the run that was held out."""
    fitted = pendulum_run("pd", lambda t, q, dq: size * math.tanh(1e3 * dq) * (t < 1.2), seed=1, duration=3.0)
    held_out = pendulum_run("pd", seed=2, duration=3.0)
    answer = mbexport.diagnose(load("pendulum"), [fitted], [held_out], level="rigid", backends=["mjcf"])
    assert (answer.verdict, answer.which) == (verdict, ())
    assert any("stands in runs that were fitted" in note for note in answer.notes) is (size > 0.0)


@pytest.mark.parametrize(("size", "verdict"), [(0.0, "no_gap"), (0.5, "unexplained")])
def test_a_gap_that_drowns_in_a_controllers_noise_is_one_where_the_measured_motion_shows_it(monkeypatch, size, verdict):
    """A simulation was no worse than its noise floor, and what the motion left was ten times its noise."""
    monkeypatch.setattr(Gap, "is_noise", property(lambda gap: True))
    pushes = np.random.default_rng(7).normal(size=(2, 20))

    def run(k):
        return pendulum_run("pd", lambda t, q, dq: size * float(np.interp(t, np.arange(20) * 0.25, pushes[k])), seed=k)

    runs = [run(0), run(1)]
    answer = mbexport.diagnose(load("pendulum"), runs, level="rigid", backends=["mjcf"])
    assert (answer.verdict, answer.which) == (verdict, ())
    assert any("far above noise" in note for note in answer.notes) is (size > 0.0)
