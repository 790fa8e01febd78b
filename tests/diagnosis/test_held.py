"""What of the findings holds on runs that no fit saw, along the motion and in simulation."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis import judge as judging
from mbexport.core.diagnosis.diagnosis import HowFar, Rejected
from mbexport.core.diagnosis.forms import beyond_forms
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.held import CRUMB, GONE, MOST_LEFT, OTHER_LAW, TOO_FAST, WILD, Held
from mbexport.core.diagnosis.how_far import name_of
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.unseen import EARNS, Split, Unseen, judged, splits, worth_by
from mbexport.core.effects import EffectRow
from mbexport.core.errors import RefusedError

from .pendulums import INERTIA, WEIGHT, command, pendulum_run
from .searching import COLUMNS, NO_SPRING, question


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
    monkeypatch.setattr(Judge, "_outweighed", lambda *_: False)
    monkeypatch.setattr(Judge, "_how_far", how_far)
    monkeypatch.setattr(
        "mbexport.core.diagnosis.judge._least_helpful", lambda found, *_: rubs if rubs in found else None
    )
    answer = judge.held([late, rubs])
    assert answer.found == ()
    assert [(item.effect, item.why) for item in answer.dropped] == [("viscous_friction", GONE), ("delay", WILD)]


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


@pytest.mark.parametrize(
    ("by", "gain", "own", "stays"),
    [(0.75, 60.0, 0.9, True), (0.6, 60.0, 0.9, False), (0.75, 40.0, 0.9, False), (0.75, 60.0, 0.3, False)],
)
def test_what_closes_a_plain_part_of_the_gap_in_simulation_is_no_crumb_beside_a_wave_of_another_form(
    monkeypatch, by, gain, own, stays
):
    """Where that leaves much in any engine; but for chance, and for what another form of the wave would say."""
    wave, body = (Found(effect, 1, EffectRow(1, {}), 50.0) for effect in ("transmission_error", "link_inertia"))

    def far(share):
        return HowFar({}, {}, {}, share, (share, share), {})

    held = Held((wave,), SimpleNamespace(), (), set(), far(0.5), (), None)
    unseen = SimpleNamespace(gains=(900.0, gain), own=(1.0, own))
    monkeypatch.setattr(judging, "judged", lambda *_: unseen)
    judge = SimpleNamespace(
        whole=None,
        whiten=None,
        ways=(),
        by_bands=False,
        with_one_more=lambda held, found, unseen: replace(held, found=found, how_far=far(by)),
    )
    assert [item.effect for item in Judge._closed(judge, held, [body]).found] == [
        "transmission_error",
        *(["link_inertia"] if stays else []),
    ]


@pytest.mark.parametrize("closes", [True, False])
def test_what_is_small_along_the_motion_is_tried_before_simulation_speaks_against_the_rest(monkeypatch, closes):
    """Friction sticks elsewhere where a load is missing: without the load simulation is no better by it."""
    rubs, load = (
        Found(effect, at, EffectRow(at, {}), 50.0) for effect, at in (("coulomb_friction", 1), ("payload", 0))
    )
    fars = {1: HowFar({}, {}, {}, 0.1, (-0.1, 0.2), {}), 2: HowFar({}, {}, {}, 1.0, (0.9, 1.0), {})}
    unseen = SimpleNamespace(gains=(900.0,), rows=(), open=0.9, beyond=1.0)
    crumb = (Rejected("payload", "robot", CRUMB),)

    def tame(self, findings):
        found = [item for item in findings if item is rubs]
        return found, unseen, crumb if len(findings) > 1 else ()

    both = SimpleNamespace(gains=(900.0, 60.0), own=(1.0, 1.0), rows=(), open=0.0, beyond=1.0)
    asked = question()
    monkeypatch.setattr(judging, "judged", lambda *_: both)
    monkeypatch.setattr(judging, "_least_helpful", lambda found, *_: None if len(found) == 2 and closes else rubs)
    monkeypatch.setattr(Judge, "_tame", tame)
    monkeypatch.setattr(Judge, "_how_far", lambda self, found, *_: (fars[len(found) or 1], (), None))
    monkeypatch.setattr(Judge, "_kept_anyway", lambda *_: set())
    monkeypatch.setattr(Judge, "numbers", lambda *_, **__: ())
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), [])
    monkeypatch.setattr(Judge, "by_bands", False)
    if closes:
        answer = judge.held([rubs, load])
        assert answer.found == (rubs, load)
        assert answer.dropped == ()
        assert answer.by == 1.0
        return
    # then it goes, as it did
    monkeypatch.setattr(judging, "_least_helpful", lambda found, *_: rubs if rubs in found else None)
    monkeypatch.setattr(
        Judge, "_tame", lambda self, findings: tame(self, findings) if len(findings) > 1 else ([], unseen, ())
    )
    assert [(item.effect, item.why) for item in judge.held([rubs, load]).dropped] == [
        ("payload", CRUMB),
        ("coulomb_friction", GONE),
    ]


def test_a_tilt_or_a_body_may_close_the_gap_in_simulation_though_a_joints_law_may_have_another_form(monkeypatch):
    """They are felt at more joints than that one; of a spring at the joint nobody could tell."""
    runs = [pendulum_run(seed=seed, against=lambda t, q, dq: 0.1 * dq) for seed in (1, 2)]
    asked = problem(load("pendulum"), "rigid", runs)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)
    viscous = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.1}), 50.0)
    tilted = Found("base_tilt", 0, EffectRow(0, {"roll": 0.02, "pitch": 0.0}), 50.0)
    spring = Found("joint_spring", 1, EffectRow(1, {"stiffness": 0.1, "rest": -1.0}), 50.0)
    heavier = Found("link_inertia", 1, EffectRow(1, {"mass": 0.05}), 50.0)
    tame, offered = Judge._tame, []

    def first_alone(self, findings):
        found, unseen, dropped = tame(self, findings[:1])
        return found, unseen, (*dropped, *(Rejected(one.effect, one.place, OTHER_LAW) for one in findings[1:]))

    def closed(self, held, small):
        offered.extend(small)
        return held

    monkeypatch.setattr(Judge, "_tame", first_alone)
    monkeypatch.setattr(Judge, "_closed", closed)
    judge.held([viscous, tilted, spring, heavier])
    assert offered == [tilted, heavier]


RUBS = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)


def judge_of(count, coefficient=0.4):
    """Of some runs and a held-out one whose torque sensor hears next to nothing."""
    runs = [pendulum_run("motion", lambda t, q, dq: coefficient * dq, seed=k) for k in range(count + 1)]
    runs[-1] = replace(runs[-1], noise={"q": runs[-1].noise["q"], "tau": np.array([100.0])})
    asked = problem(load("pendulum"), "rigid", runs)
    ways = splits(count + 1, 1)
    return Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), ways, runs)


@pytest.mark.parametrize(
    ("effect", "harm", "gain", "in_turn", "helps", "stays"),
    [
        ("joint_spring", 0.02, 40.0, 900.0, 0.3, True),
        ("delay", 0.02, 40.0, 900.0, 0.3, False),
        ("joint_spring", 0.1, 40.0, 900.0, 0.3, False),
        ("joint_spring", 0.02, 4.0, 900.0, 0.3, False),
        ("joint_spring", 0.02, 40.0, 20.0, 0.3, False),
        ("joint_spring", 0.02, 40.0, 900.0, 0.1, False),
    ],
)
def test_what_the_fitted_runs_say_in_turn_outweighs_a_little_harm(
    monkeypatch, effect, harm, gain, in_turn, helps, stays
):
    """A straight spring in the place of one that stiffens, where the held-out run is near its rest."""
    wave, other = Found("torque_ripple", 2, EffectRow(2, {}), 900.0), Found(effect, 3, EffectRow(3, {}), 900.0)

    def far(total, less):
        without = {name_of(wave): 0.0, name_of(other): less}
        return HowFar({}, {}, {}, total, (total - 0.1, total + 0.1), {}, without=without)

    asked, runs = question(), (SimpleNamespace(), SimpleNamespace())
    rows = ((wave.row, other.row),) * 2
    worth = SimpleNamespace(gains=(900.0, in_turn), own=(1.0, 1.0), rows=rows, open=0.01, beyond=1.0)
    turns = judging._Turns(runs, splits(2, 0), worth)
    monkeypatch.setattr(Judge, "_turns", lambda *_: turns)
    monkeypatch.setattr(Judge, "_kept_anyway", lambda *_: set())
    monkeypatch.setattr(judging, "how_far", lambda *_: (far(0.9, 0.9 - helps), ()))
    monkeypatch.setattr(Judge, "by_bands", False)
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(3, 1), [])
    unseen = SimpleNamespace(gains=(900.0, gain))
    idle = judge._idle((wave, other), unseen, far(0.8, 0.8 + harm))
    assert idle is (None if stays else other)
    held = SimpleNamespace(found=(wave, other), unseen=unseen, how_far=far(0.8, 0.8 + harm))
    said = judge.said_of_turns(held)
    assert ["joint_spring at joint_3" in one for one in said] == ([True] if stays else [])


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


@pytest.mark.parametrize(("fitted", "its_own"), [(4.0, True), (0.7, False)])
def test_what_no_other_form_of_a_law_says_where_it_was_fitted_none_says_elsewhere(fitted, its_own):
    """On a short way a ripple's amount, phase and cycles are a steady torque as well; on a long one they are none."""
    runs = [
        pendulum_run("motion", lambda t, q, dq: 0.3 * math.sin(5.0 * q) + 0.1, seed=k, duration=duration)
        for k, duration in ((1, fitted), (2, 0.7))
    ]
    asked = problem(load("pendulum"), "rigid", runs)
    both = [
        Found("torque_ripple", 1, EffectRow(1, {"amplitude": 0.3, "cycles": 5.0, "phase": 0.0}), 50.0),
        Found("torque_offset", 1, EffectRow(1, {"torque": 0.1}), 50.0, EffectRow(1, {"torque": 0.0})),
    ]
    worth = judged(asked, whitening(asked), both, [Split((0,), (1,))])
    assert (worth.own[1] >= MOST_LEFT) == its_own


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


def test_evidence_is_that_of_the_numbers_that_stand():
    judge = judge_of(1)
    loud = [Split((1,), (0,)), Split((0,), (0,))]
    fitted = judged(judge.whole, judge.whiten, [RUBS], loud)

    def worth(scale):
        rows = [
            tuple(EffectRow(1, {"coefficient": scale * row.values["coefficient"]}) for row in there)
            for there in fitted.rows
        ]
        return worth_by(judge.whole, judge.whiten, [RUBS], loud, rows, 0)

    assert worth(1.0) == pytest.approx(sum(judged(judge.whole, judge.whiten, [RUBS], [way]).gains[0] for way in loud))
    assert worth(1e-4) == pytest.approx(0.0, abs=0.1)
    assert worth(2.1) < 0.0 < worth(1.9)


@pytest.mark.parametrize(("worth", "kept"), [(900.0, True), (3.0, False)])
def test_what_simulation_gave_other_numbers_has_the_evidence_of_these(monkeypatch, worth, kept):
    """By the evidence's own it did harm, and by the others it does neither harm nor good."""
    harms, idles = (HowFar({}, {}, {}, by, (by - 0.001, by + 0.001), {}, without={}) for by in (0.95, 0.99))
    harms, idles = (replace(far, without={name_of(RUBS): 0.9901}) for far in (harms, idles))
    evidence, simulated = EffectRow(1, {"coefficient": 0.4}), EffectRow(1, {"coefficient": 1e-6})
    unseen = Unseen((60.0,), (9.0,), (1.0,), (1.0,), ((evidence,),))
    fit = SimpleNamespace(rows={RUBS.key: simulated})
    asked = question()
    judge = Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0)[:1], [])
    monkeypatch.setattr(Judge, "by_bands", False)
    monkeypatch.setattr(Judge, "_tame", lambda self, some: (list(some), unseen, ()))
    monkeypatch.setattr(Judge, "_kept_anyway", lambda *_: set())
    monkeypatch.setattr(Judge, "numbers", lambda *_, **__: (fit,))
    monkeypatch.setattr(Judge, "_outweighed", lambda *_: False)
    monkeypatch.setattr(
        Judge, "_how_far", lambda self, found, by, *_: (idles if by.rows == ((simulated,),) else harms, (), None)
    )
    monkeypatch.setattr(judging, "worth_by", lambda *_: worth)
    held = judge.held([RUBS])
    assert bool(held.found) == kept
    assert held.dropped == (() if kept else (Rejected("viscous_friction", "joint_1", GONE),))
