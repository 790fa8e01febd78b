"""A diagnosis in words: numbers as people read them, no more certainty than there is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mbexport.core.diagnosis.diagnosis import Finding, JointShare, Parameter, Rival
from mbexport.core.diagnosis.words import (
    cause_in_words,
    estimate,
    finding_in_words,
    how_far_in_words,
    percent,
    probability_in_words,
    quantity,
    rivals_in_words,
    unseen_runs,
    variable_in_words,
    verdict_in_words,
    where_in_words,
)


@pytest.mark.parametrize(
    ("value", "interval", "unit", "said"),
    [
        (12.1, (11.7, 12.5), "N*m", ("12.10", "11.70 to 12.50", "N m")),
        (0.0021, (0.0019, 0.0024), "rad", ("2.10", "1.90 to 2.40", "mrad")),
        (3.2e-5, (3.0e-5, 3.5e-5), "m", ("32.0", "30.0 to 35.0", "\u00b5m")),
        (2.61e5, (2.5e5, 2.7e5), "N*m/rad", ("261", "250 to 270", "kN m/rad")),
        (0.003, (0.0029, 0.0031), "s", ("3.00", "2.90 to 3.10", "ms")),
        (0.21, (-0.1, 0.52), "kg*m^2", ("0.21", "-0.10 to 0.52", "kg m\u00b2")),
        (-1e-6, (-5.1e-4, 5.1e-4), "m", ("0.00", "-0.51 to 0.51", "mm")),
        (5.0, (5.0, 5.0), "", ("5.00", "5.00 to 5.00", "")),
        (1e7, (2e6, float("inf")), "N*m/rad", ("10.0", "2.00 to infinite", "MN m/rad")),
        (0.0, (0.0, 0.0), "kg", ("0", "0 to 0", "kg")),
    ],
)
def test_an_estimate_has_the_digits_of_its_interval(value, interval, unit, said):
    assert estimate(Parameter(value, interval, unit)) == said


def test_quantities_are_in_units_that_suit_them():
    told = [quantity(x, u) for x, u in ((4.1e-4, "rad"), (2.2e-5, "rad"), (0.0, "m"), (1234.6, "N*m"), (1.2e-9, "m"))]
    assert told == ["0.410 mrad", "22.0 \u00b5rad", "0 \u00b5m", "1235 N m", "0.00120 \u00b5m"]


@pytest.mark.parametrize(
    ("share", "said"), [(0.5, "50 %"), (0.997, "99.7 %"), (1.0, "100 %"), (-0.001, "0 %"), (-0.2, "-20 %")]
)
def test_hundred_per_cent_is_all(share, said):
    assert percent(share) == said


def test_laws_of_plugins_are_called_after_people_as_well():
    said = [cause_in_words(effect, "joint_6") for effect in ("coupled_coulomb_friction", "load_friction", "my_drag")]
    assert said == ["coupled Coulomb friction at joint 6", "load-dependent friction at joint 6", "my drag at joint 6"]


def test_certainty_is_not_claimed():
    assert probability_in_words(1.0) == "over 99.9 %"
    assert probability_in_words(0.999) == "99.9 %"
    assert probability_in_words(0.7) == "70 %"


def test_causes_have_names_for_people():
    assert cause_in_words("coulomb_friction", "joint_2") == "Coulomb friction at joint 2"
    assert cause_in_words("delay", "robot") == "delay"
    assert cause_in_words("axis_coupling", "joint_5") == "axis coupling at joint 5"
    assert variable_in_words("sign(dq_3)") == "the direction of motion of joint 3"
    assert variable_in_words("tau_1") == "the torque of joint 1"
    assert variable_in_words("abs(tau_1)") == "the size of the torque of joint 1"
    assert variable_in_words("cos(q_1 + q_2)") == "cos(q_1 + q_2)"


def test_a_sentence_tells_parameters_that_are_there():
    parameters = {
        "mass": Parameter(2.0, (1.9, 2.1), "kg"),
        "x": Parameter(0.0, (-0.1, 0.1), "m"),
        "y": Parameter(0.05, (-0.1, 0.2), "m"),
        "z": Parameter(0.3, (0.2, 0.4), "m"),
    }
    said = finding_in_words(Finding("payload", "robot", 0.9, parameters))
    assert said == (
        "Payload: mass 2.00 kg (95 % interval 1.90 to 2.10) and z 0.30 m (95 % interval 0.20 to 0.40), and 2 more, "
        "probability 90 %."
    )
    assert finding_in_words(Finding("delay", "robot", 0.9, {})) == "Delay, probability 90 %."


def test_names_that_look_alike_are_told_with_their_reason():
    rivals = (Rival("a", "joint_1", "too slow."), Rival("b", "joint_1", "too slow"), Rival("c", "robot", ""))
    assert rivals_in_words(rivals) == [
        "It may as well be a at joint 1 or b at joint 1: too slow.",
        "It may as well be c.",
    ]


def test_the_headline_is_not_surer_than_the_finding(explained, no_gap, unexplained):
    (found,) = explained.which
    alone = replace(found, indistinguishable_from=())
    one = replace(found, indistinguishable_from=found.indistinguishable_from[:1])
    assert verdict_in_words(replace(explained, which=(alone,))).endswith("Coulomb friction at joint 2")
    assert verdict_in_words(replace(explained, which=(one,))).endswith("(or Stribeck friction at joint 2)")
    assert verdict_in_words(explained).endswith("(or what looks like it)")
    five = tuple(replace(alone, at=f"joint_{i}") for i in range(1, 6))
    assert verdict_in_words(replace(explained, which=five)).endswith("at joint 3 and 2 more")
    assert verdict_in_words(no_gap) == "no gap above the noise"
    assert "no effect of the catalogue" in verdict_in_words(unexplained)


def test_how_far_says_what_cannot_be_said(explained, no_gap):
    def told(**changes):
        return how_far_in_words(replace(explained, how_far=replace(explained.how_far, **changes)))

    assert told() == (
        "With it in the model the gap shrinks by 93 % (95 % interval 91 to 95 %) on runs that no fit saw."
    )
    assert "(95 % interval 0 to 16 %)" in told(ci95=(-1e-5, 0.16))
    assert "cannot be said" in told(shrinks_by=None, ci95=None)
    assert "grows by 20 %" in told(shrinks_by=-0.2, ci95=(-0.3, -0.1))
    assert how_far_in_words(no_gap) == ""


def test_what_was_unseen_is_named(explained):
    assert unseen_runs(explained) == "the held-out run run-02"
    assert unseen_runs(replace(explained, holdout=())) == "each run, left out in turn"
    assert unseen_runs(replace(explained, holdout=(), runs=("a",))) == "blocks of the run, each left out in turn"


def test_two_joints_are_named_where_two_count(explained):
    joints = {"joint_1": JointShare(0.4, 3.0), "joint_2": JointShare(0.6, 4.0)}
    said = where_in_words(replace(explained, where=replace(explained.where, joints=joints)))
    assert said.startswith("The gap lies mostly at joint 2 (60 %) and joint 1 (40 %), at reversals")


def test_the_summary_is_a_few_lines(explained, no_gap, unexplained):
    lines = explained.summary().splitlines()
    assert lines[0].startswith("imece2013: the gap comes from Coulomb friction")
    assert any(line.startswith("  Next: separates Coulomb from Stribeck") for line in lines)
    assert any("left out in 1 place: stuck" in line for line in lines)
    assert len(lines) <= 8 + len(explained.notes) and len(no_gap.summary().splitlines()) == 2 + len(no_gap.notes)
    assert "looks like a torque" in unexplained.summary()
    noted = replace(no_gap, notes=("The stamps of run-01 are 1 ms late.",)).summary()
    assert noted.splitlines()[-1] == "  Note: The stamps of run-01 are 1 ms late."
