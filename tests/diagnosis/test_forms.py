"""What a found law leaves whose form is another one: its cause is known, and what else is left is not."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis import unseen
from mbexport.core.diagnosis.diagnosis import Unexplained
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.forms import HALF_SAID, SOFTLY_SAID, TWICE_SAID, _every_form
from mbexport.core.diagnosis.found import Found, as_hard_as_a_contact
from mbexport.core.diagnosis.growing import GROWS_SAID
from mbexport.core.diagnosis.held import MOST_LEFT, NoLaw
from mbexport.core.diagnosis.hypothesis import defaults
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.other_form import contradicted, other_form
from mbexport.core.diagnosis.other_laws import as_harmonics, straightened
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.search import search
from mbexport.core.diagnosis.state import Search
from mbexport.core.diagnosis.unseen import Along, bent, judged, splits
from mbexport.core.diagnosis.verdict import unexplained_of, verdict_of
from mbexport.core.diagnosis.words import open_in_words
from mbexport.core.effects import EffectRow

from .pendulums import INERTIA, KD, KP, command, friction_free, pendulum_run

WAVE = Found("torque_ripple", 1, EffectRow(1, {"amplitude": 0.3, "cycles": 20.0, "phase": 0.1}), 50.0)
LIMITED = Found("torque_limit", 1, EffectRow(1, {"torque": 5.6}), 50.0)
DAMPS = Found("viscous_friction", 1, EffectRow(1, {"coefficient": 0.4}), 50.0)


def said_of(against, item, mode="motion"):
    """What other forms of one finding's law say of pendulums on which another torque acts."""
    judge = judge_of(against, mode)
    return bent(judge.whole, judge.whiten, [item], judge.ways, rows_of(judge, item))


def judge_of(against, mode="motion"):
    runs = [pendulum_run(mode, against, seed=seed) for seed in (1, 2)]
    if mode == "pd":
        # of their torque all that was asked for is recorded, and none of what a motor lacks
        runs = [replace(run, signals={k: v for k, v in run.signals.items() if k != "tau"}) for run in runs]
    asked = problem(load("pendulum"), "rigid", runs)
    return Judge(asked.database, "rigid", "mjcf", [], lambda _: None, asked, whitening(asked), splits(2, 0), runs)


def rows_of(judge, item):
    return judged(judge.whole, judge.whiten, [item], judge.ways).rows


def ripple(times):
    """A wave of 20 a turn, and one of four tenths of it that comes so many times as often."""
    return lambda t, q, dq: 0.3 * math.sin(20.0 * q) + 0.12 * math.sin(20.0 * times * q + 0.7)


@pytest.mark.parametrize(("times", "its_own"), [(2.0, True), (1.45, False)])
def test_a_wave_that_comes_twice_as_often_as_well_is_one_cause(times, its_own):
    form = said_of(ripple(times), WAVE)
    assert form.said == TWICE_SAID
    assert (form.leaves < 0.05) if its_own else (form.leaves > 0.75)


def gear(first, second):
    """Torque of inertia behind a gear with errors of 20 and of 40 a turn, of these amplitudes [rad]."""

    def against(t, q, dq):
        # e'' = e''(q) q'^2 + e'(q) q''; along a given motion
        ddq = float(command(t)[2])
        total = 0.0
        for amplitude, cycles, phase in ((first, 20.0, 0.3), (second, 40.0, 1.1)):
            angle = cycles * q + phase
            total += amplitude * cycles * (math.cos(angle) * ddq - cycles * math.sin(angle) * dq**2)
        return INERTIA * total

    return against


@pytest.mark.parametrize(("first", "known"), [(2.0e-4, True), (2.0e-3, False)])
def test_a_gears_error_may_be_the_harmonic_of_one_that_comes_half_as_often(first, known):
    """Up to four times as large as it."""
    row = EffectRow(1, {"amplitude": 1.5e-4, "cycles": 40.0, "phase": 1.1})
    form = said_of(gear(first, 1.5e-4), Found("transmission_error", 1, row, 100.0))
    assert (form.said, form.leaves < 0.1) == (HALF_SAID, known)


def test_a_waves_cycles_may_be_a_little_off_where_it_comes_twice_as_often_as_well():
    near = replace(WAVE, row=EffectRow(1, {**WAVE.row.values, "cycles": 20.3}))
    judge = judge_of(ripple(2.0))
    form = bent(judge.whole, judge.whiten, [near], judge.ways, [(near.row,)] * 2)
    assert form.leaves < 0.15


@pytest.mark.parametrize(
    ("bend", "its_own"),
    [(lambda dq: dq / (1.0 + 0.15 * abs(dq)), True), (lambda dq: dq * (1.0 + 0.3 * abs(dq)), False)],
)
def test_a_damper_yields_and_what_grows_with_the_square_of_speed_is_none(bend, its_own):
    form = said_of(lambda t, q, dq: 0.5 * bend(dq), DAMPS)
    assert (form.leaves < 0.3) if its_own else (form.leaves > 0.8)


def test_what_a_database_knows_of_a_damper_yields_with_the_rest_of_it():
    """A fifth less than was known of it was all that might have another form, and hysteresis was named for the rest."""
    known = replace(load("pendulum"), effects=FrozenMap({"viscous_friction": (EffectRow(1, {"coefficient": 0.5}),)}))
    runs = [pendulum_run("motion", lambda t, q, dq: 0.5 * dq / (1.0 + 0.15 * abs(dq)), seed=seed) for seed in (1, 2)]
    asked = problem(known, "full", runs)
    ways = splits(2, 0)
    rows = judged(asked, whitening(asked), [DAMPS], ways).rows
    assert rows[0][0].values["coefficient"] < 0.45
    assert bent(asked, whitening(asked), [DAMPS], ways, rows).leaves < 0.3


@pytest.mark.parametrize(("power", "level", "its_own"), [(1.0, 0.0, False), (2.0, 0.1, True)])
def test_what_stribecks_friction_of_another_power_leaves_is_no_coulomb_friction(power, level, its_own):
    """What falls by e to the -|v| goes on where the catalogue's is long gone: dry friction was named for the rest."""

    def rubs(t, q, dq):
        return (0.5 * math.exp(-((abs(dq) / 0.5) ** power)) + level) * math.tanh(dq / 1e-2)

    judge = judge_of(rubs)
    both = [
        Found("stribeck_friction", 1, EffectRow(1, {"torque": 0.45, "velocity": 0.6}), 90.0),
        Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.05}), 50.0),
    ]
    own = judged(judge.whole, judge.whiten, both, judge.ways).own[1]
    assert (own >= MOST_LEFT) is its_own


def lacks(given):
    """The part of what its controller asks for that a motor does not give."""

    def against(t, q, dq):
        q_cmd, dq_cmd, _ = command(t)
        asked = KP * (float(q_cmd) - q) + KD * (float(dq_cmd) - dq)
        return asked - given(asked)

    return against


def rounded(asked, top=5.6, corner=0.56):
    """A limit with a parabola for its corner."""
    size = abs(asked)
    if size <= top - corner:
        return asked
    return math.copysign(top if size >= top + corner else size - (size - top + corner) ** 2 / (4.0 * corner), asked)


@pytest.mark.parametrize(("beside", "its_own"), [(0.0, True), (0.05, False)])
def test_a_limit_that_is_felt_before_it_is_reached_is_one_cause(beside, its_own):
    limits = lacks(rounded)
    form = said_of(lambda t, q, dq: limits(t, q, dq) + beside * math.sin(3.0 * q), LIMITED, "pd")
    assert form.said == SOFTLY_SAID
    assert (form.leaves < 0.2) if its_own else (form.leaves > 0.5)


def test_where_nothing_asks_for_a_torque_a_limit_has_no_other_form():
    assert said_of(lambda t, q, dq: 0.1 * dq, LIMITED) is None


def test_what_has_no_other_form_says_nothing():
    offset = Found("torque_offset", 1, EffectRow(1, {"torque": 0.2}), 50.0)
    assert said_of(lambda t, q, dq: 0.2 + 0.1 * np.sin(3.0 * t), offset) is None


def test_a_run_that_stands_has_the_same_forms_of_nothing():
    moved, stood = pendulum_run("motion", lambda t, q, dq: 0.5 * dq), pendulum_run("motion")
    still = replace(stood, signals={name: 0.0 * values for name, values in stood.signals.items()})
    both = problem(load("pendulum"), "rigid", [moved, still])
    counts = [len(list(_every_form(both.only([k]), [DAMPS]))) for k in (0, 1)]
    assert counts[0] == counts[1] > 0


def test_another_amount_of_a_law_is_no_other_form_of_it():
    judge = judge_of(lambda t, q, dq: 0.3 * math.sin(20.0 * q + 0.1))
    less = [(EffectRow(1, {**WAVE.row.values, "amplitude": 0.2}),)] * 2
    form = bent(judge.whole, judge.whiten, [WAVE], judge.ways, less)
    assert form is None or form.leaves > 0.8


def told_of(against, item):
    """What is said of a part of a gap that a finding leaves."""
    judge = judge_of(against)
    unseen = SimpleNamespace(rows=rows_of(judge, item), beyond=1.0)

    def said(share, adequate=False):
        held = SimpleNamespace(
            found=(item,), open=share, no_law=None, adequate=adequate, explains=False, unseen=unseen, overlays=()
        )
        return other_form(judge, held)

    return said


def test_the_cause_is_known_of_no_more_than_a_quarter_of_a_gap():
    said = told_of(lambda t, q, dq: 0.5 * dq / (1.0 + 0.15 * abs(dq)), DAMPS)
    assert said(0.1).place == 0
    assert said(0.3) is None
    assert said(0.01, adequate=True) is None


def test_of_a_wave_that_comes_twice_as_often_as_well_more_may_be_left():
    said = told_of(ripple(2.0), WAVE)
    assert said(0.2).said == said(0.6).said == TWICE_SAID
    other = told_of(ripple(1.45), WAVE)
    assert other(0.2) is None
    assert other(0.6) is None


def test_what_is_left_of_a_wave_is_no_little():
    answer = SimpleNamespace(verdict="explained", unexplained=Unexplained(0.6, {"joint_1": 1.0}, "a second harmonic"))
    assert open_in_words(answer) == (
        "Left in the corrected model: 60 % of the gap's energy, most of it at joint 1. Its cause is known, and no law "
        "of the catalogue says all of it: a second harmonic."
    )


def test_a_channel_whose_noise_is_quieter_than_was_thought_hides_nothing(monkeypatch):
    """What is left in one channel is no less there than the other has less than noise."""
    judge = judge_of(lambda t, q, dq: 0.4 * dq, "pd")
    rows = rows_of(judge, DAMPS)
    count = len(judge.whole.only(judge.ways[0].unseen).evidence.weights)
    own = np.where(np.arange(count) < 20, 2.0, 0.1)
    assert own @ own < count
    forms = SimpleNamespace(largest=(0, "another form"), beyond=lambda *_: (own, np.where(own > 1.0, 1.1, own)))
    monkeypatch.setattr(unseen.Forms, "of", lambda *_: forms)
    monkeypatch.setattr(unseen, "edges_of", lambda _: [(0, 20), (20, count)])
    said = bent(judge.whole, judge.whiten, [DAMPS], judge.ways[:1], rows[:1])
    assert said is not None
    assert said.leaves == pytest.approx((1.1**2 - 1.0) / (2.0**2 - 1.0))


def speaks_against(against, item, adequate=True):
    judge = judge_of(against)
    unseen = SimpleNamespace(beyond=1.0)
    held = SimpleNamespace(found=(item,), no_law=None, adequate=adequate, unseen=unseen, rings=False)
    return contradicted(judge, held)


def test_what_evidence_tells_of_what_noise_hides_is_said():
    """Else nobody knows why a gap that is down to the noise is explained in part."""
    held = SimpleNamespace(no_law=NoLaw(6, GROWS_SAID.format(joint=6)), open=0.0)
    rest = unexplained_of("partly_explained", None, held, None, None)
    answer = SimpleNamespace(verdict="partly_explained", unexplained=rest)
    assert open_in_words(answer) == (
        "Not explained: a resistance that grows faster than with the speed of joint 6; what was found leaves no more "
        "than noise of it."
    )
    assert open_in_words(SimpleNamespace(verdict="explained", unexplained=Unexplained(0.0, {}, ""))) == ""


def test_of_what_would_be_told_as_nothing_no_place_is_told():
    rest = Unexplained(0.004, {"joint_1": 1.0}, "nothing that one variable explains")
    answer = SimpleNamespace(verdict="explained", unexplained=rest)
    assert open_in_words(answer) == "Left in the corrected model: less than 1 % of the gap's energy."
    answer.unexplained = replace(rest, share=0.006)
    assert open_in_words(answer).startswith("Not explained: 1 % of the gap's energy, most of it at joint 1")


def test_what_the_measured_motion_has_left_speaks_against_what_closes_a_gap_in_simulation(monkeypatch):
    damps = replace(DAMPS, row=EffectRow(1, {"coefficient": 0.5}))
    assert speaks_against(lambda t, q, dq: 0.5 * dq, damps) is None
    rubs = Found("coulomb_friction", 1, EffectRow(1, {"torque": 0.05}), 50.0)
    left = speaks_against(lambda t, q, dq: 0.3 * dq * abs(dq), rubs)
    assert left.share > 0.5
    assert left.loudest > 5.0
    assert left.joints == {"joint_1": 1.0}
    # a gap that is open in simulation is told so
    assert speaks_against(lambda t, q, dq: 0.3 * dq * abs(dq), rubs, adequate=False) is None
    # nor does what a found law leaves that has another form
    monkeypatch.setattr("mbexport.core.diagnosis.other_form.CONTRADICTS", 0.05)
    assert speaks_against(ripple(1.45), WAVE).share > 0.1
    assert speaks_against(ripple(2.0), WAVE) is None


def test_a_cause_that_the_measured_motion_speaks_against_is_not_the_whole_one():
    held, left = SimpleNamespace(found=(WAVE,), no_law=None, adequate=True), Along(0.6, 20.0, {"joint_1": 1.0})
    assert verdict_of(held, True, None, None) == "explained"
    assert verdict_of(held, True, None, left) == "partly_explained"
    open_still = unexplained_of("partly_explained", None, held, None, left)
    assert (open_still.share, open_still.joints) == (0.6, {"joint_1": 1.0})
    assert "controller hides" in open_still.looks_like


def test_a_gears_error_is_found_behind_its_harmonic_and_so_is_what_stands_beside_it():
    """Inertia makes three times as much of the harmonic, which is picked first."""
    wobbles = gear(2.0e-4, 1.5e-4)
    runs = [
        pendulum_run("motion", lambda t, q, dq: wobbles(t, q, dq) + 0.02 * math.tanh(dq / 1e-3), seed=k) for k in (1, 2)
    ]
    asked = problem(load("pendulum"), "rigid", runs)
    whiten = whitening(asked)
    state = Search(asked, whiten)
    state.begin()
    rows = {item.effect: item.row.values for item in search(state).found}
    assert set(rows) == {"transmission_error", "coulomb_friction"}
    wave = rows["transmission_error"]
    assert wave["cycles"] == pytest.approx(20.0, rel=2e-3)
    # the weight that an error moves is not in what was recorded here
    assert wave["amplitude"] == pytest.approx(2.0e-4, rel=0.15)
    assert wave["second"] == pytest.approx(0.75, rel=0.15)
    assert rows["coulomb_friction"]["torque"] == pytest.approx(0.02, rel=0.1)
    # of which a database and engines know nothing: two numbers beyond the catalogue's go
    parts = blocks(asked.evidence)
    fit = refined(asked, whiten, state.found, parts)
    plain = straightened(asked, whiten, state.found, fit, parts)
    assert len(plain.free) == len(fit.free) - 2
    assert set(plain.rows["transmission_error", 1].values) == {"amplitude", "cycles", "phase"}
    assert float(plain.left @ plain.left) > 2.0 * float(fit.left @ fit.left)


@pytest.mark.parametrize(("first", "cycles", "begins"), [(0.0, 40.0, None), (3.0e-4, 20.0, (3.0e-4, 20.0, 0.5))])
def test_a_plain_wave_is_no_harmonic(first, cycles, begins):
    """Where nothing comes half as often, or twice as often as well."""
    row = EffectRow(1, {"amplitude": 1.5e-4, "cycles": cycles, "phase": 1.1 if cycles == 40.0 else 0.3})
    asked = problem(load("pendulum"), "rigid", [pendulum_run("motion", gear(first, 1.5e-4), seed=1)])
    whiten, parts, item = whitening(asked), blocks(asked.evidence), Found("transmission_error", 1, row, 100.0)
    fit = refined(asked, whiten, [item], parts)
    begun = as_harmonics(asked, whiten, fit, item)
    if begins is None:
        assert begun == []
    else:
        (values,) = (row.values for row in begun)
        assert [values[name] for name in ("amplitude", "cycles", "second")] == pytest.approx(begins, rel=0.15)


@pytest.mark.parametrize("torque", [0.0, 0.02])
def test_a_wave_is_found_with_its_harmonic_and_so_is_what_stands_beside_it(torque):
    """What comes twice as often, four tenths as large, is far louder than the friction."""
    twice = ripple(2.0)
    runs = [
        pendulum_run("motion", lambda t, q, dq: twice(t, q, dq) + torque * math.tanh(dq / 1e-3), seed=k) for k in (1, 2)
    ]
    asked = problem(load("pendulum"), "rigid", runs)
    state = Search(asked, whitening(asked))
    state.begin()
    rows = {item.effect: item.row.values for item in search(state).found}
    assert set(rows) == {"torque_ripple", *(("coulomb_friction",) if torque else ())}
    wave = rows["torque_ripple"]
    assert (wave["amplitude"], wave["cycles"]) == pytest.approx((0.3, 20.0), rel=0.02)
    assert wave["second"] == pytest.approx(0.4, rel=0.05)
    if torque:
        assert rows["coulomb_friction"]["torque"] == pytest.approx(torque, rel=0.1)


@pytest.mark.parametrize(("part", "its_own"), [(0.05, True), (0.03, False)])
def test_a_spring_as_hard_as_the_contact_of_its_play_is_no_second_cause(part, its_own):
    """How hard a contact is nobody knows: it is taken to ring at 500 Hz, and may at 100."""
    judge = judge_of(friction_free)
    play = Found("backlash", 1, EffectRow(1, defaults("backlash") | {"gap": 1e-3}), 50.0)
    (robot, _) = judge.whole.robots({"backlash": (play.row,)})
    stiffness = part * robot.stages[0].drive.spring.stiffness
    spring = Found("joint_compliance", 1, EffectRow(1, {"stiffness": stiffness, "damping": 0.0}), 50.0)
    assert as_hard_as_a_contact(judge.whole, [spring, play]) is (spring if its_own else None)
    assert as_hard_as_a_contact(judge.whole, [spring]) is None
    known = replace(play, row=EffectRow(1, play.row.values | {"stiffness": 1e4}))
    assert as_hard_as_a_contact(judge.whole, [spring, known]) is None
