"""Every effect in every engine, alone and in three random sets, at the gates of the integrators' classes."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.agreement import agree
from mbexport.core.agreement.exercise import exercise
from mbexport.core.agreement.samples import SAMPLED, acting_runs, sample_rows, sampled
from mbexport.core.build import build
from mbexport.core.control import default_pd
from mbexport.core.database import FrozenMap, load
from mbexport.core.effects import EffectRow, catalogue, effect_named
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.expansion import expanded
from mbexport.core.export import emit
from mbexport.core.simulation import backend_named, simulate

ENGINES = ("urdf", "mjcf", "exudyn", "pybullet")
DURATION = 0.15
# engine to effects that it refuses by name: none does
REFUSED = dict.fromkeys(ENGINES, ())
# torques of engines of order four over their peak
SAME_TORQUE = 1e-5


@pytest.fixture(scope="module")
def database():
    return load("planar2r")


def held_together(database, names):
    """Agreement of all engines on a robot with these effects, in the runs where they act."""
    subject = sampled(database, names)
    runs = acting_runs(build(subject))
    answer = agree(subject, ENGINES, quantities=runs, duration=DURATION)
    assert tuple(run.scenario for run in answer.runs) == runs
    refused = {(omission.voice, omission.reason) for omission in answer.left_out if omission.voice in ENGINES}
    assert answer.agreed, (answer.sentences, refused)
    for scenario, found in answer.evidence.runs.values():
        exact = [run for run in found if run.manner in ("explicit", "algebra") and not run.half]
        assert {run.voice for run in found} == set(ENGINES) - {voice for voice, _ in refused}, scenario.name
        for run in exact[1:]:
            peak = np.max(np.abs(exact[0].tau))
            assert np.max(np.abs(run.tau - exact[0].tau)) < SAME_TORQUE * peak, (scenario.name, run.voice)
    return refused


@pytest.mark.parametrize("name", SAMPLED)
def test_alone(database, name):
    refused = held_together(database, [name])
    assert {voice for voice, _ in refused} == {voice for voice in ENGINES if name in REFUSED[voice]}
    assert all(name in reason for _, reason in refused)


def test_play_with_the_contact_that_it_gets_without_numbers(database):
    rows = tuple(
        replace(row, values={**row.values, "stiffness": np.inf, "damping": np.inf})
        for row in sample_rows(database, "backlash")
    )
    subject = replace(database, effects=FrozenMap({"backlash": rows}), levels=FrozenMap({}))
    answer = agree(subject, ENGINES, quantities=["compliant_loop"], duration=DURATION)
    assert answer.agreed, answer.sentences
    springs = [stage.drive.spring for stage in build(subject).stages]
    assert all(spring.gap == 2e-3 and spring.stiffness > 1e5 for spring in springs)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_in_random_sets(database, seed):
    names = np.random.default_rng(seed).choice(SAMPLED, 8, replace=False).tolist()
    refused = held_together(database, names)
    assert {voice for voice, _ in refused} == {voice for voice in ENGINES if set(names) & set(REFUSED[voice])}


def everything_gives(database):
    """Six components at every joint and bends in every arm: up to 16 joints of MuJoCo in a row without mass."""
    subject = sampled(database, ["joint_compliance_6d", "link_flexibility"])
    mount, bend = (subject.effects[name][0].values for name in ("joint_compliance_6d", "link_flexibility"))
    n = len(subject.joints)
    # each row softer than the one before it, so that no two springs are alike
    rows = {
        "joint_compliance_6d": tuple(EffectRow(i + 1, {k: 0.7**i * v for k, v in mount.items()}) for i in range(n)),
        "link_flexibility": tuple(EffectRow(i + 1, {**bend, "ku": bend["ku"] * (n - i)}) for i in range(n)),
    }
    return replace(subject, effects=FrozenMap(rows))


@pytest.mark.parametrize("control", ["imposed", "pd"])
def test_more_joints_than_mujoco_takes_on_one_body(database, control):
    robot = build(everything_gives(database))
    assert expanded(robot, imposed=True).robot.n == 16
    motion = exercise(robot, 0.05)
    given = None if control == "imposed" else default_pd(robot)
    one, other = (simulate(robot, engine, motion, given) for engine in ("urdf", "mjcf"))
    moved = np.max(np.abs(one.joints["q_link"] - one.joints["q"]))
    assert moved > 1e-3
    np.testing.assert_allclose(other.tip, one.tip, atol=1e-12)
    np.testing.assert_allclose(other.joints["q_link"], one.joints["q_link"], atol=1e-12)


def test_mujocos_carriers_are_told_and_weigh_nothing(database):
    emission = emit(build(everything_gives(database)), backend_named("mjcf"))
    _, *bodies = ET.fromstring(emission.files[emission.main]).iter("body")
    assert max(len(body.findall("joint")) for body in bodies) <= 6
    light = [body.get("name") for body in bodies if float(body.find("inertial").get("mass")) < 1e-12]
    told = [concept for concept in emission.concepts if concept.datum == "inertia" and concept.status != "exact"]
    assert light and [concept.at for concept in told] == light
    assert all("1e-14 kg" in concept.how for concept in told)


def test_the_catalogue_is_whole():
    named = {effect for effect in catalogue() if type(effect_named(effect)).__module__.startswith("mbexport.core.")}
    assert set(SAMPLED) == named
    with pytest.raises(UsageError, match="no sample rows of effect 'warmth'"):
        sample_rows(load("pendulum"), "warmth")


@pytest.mark.parametrize("name", SAMPLED)
def test_every_sample_shows(database, name):
    bare, subject = build(sampled(database, [])), build(sampled(database, [name]))
    control = default_pd(bare)
    motion = exercise(bare, DURATION)
    with_it, without = (simulate(robot, "urdf", motion, control) for robot in (subject, bare))
    signals = ("q", "q_link", "tau", "tau_link")
    shown = [np.max(np.abs(with_it.joints[signal] - without.joints[signal])) for signal in signals]
    assert max(*shown, np.max(np.abs(with_it.tip - without.tip))) > 1e-5


@pytest.mark.parametrize("engine", ENGINES)
def test_what_cannot_run_is_refused_by_name(database, engine):
    # without any inertia between torque and spring there is no equation for the motor side
    weightless = replace(sampled(database, ["joint_compliance"]), dummy_inertia=0.0)
    robot = build(weightless)
    assert robot.stages[0].drive.inertia == 0.0
    simulate(robot, engine, "hold", duration=0.01)
    with pytest.raises(RefusedError, match=r"joint_compliance at joint_1|joint_1 is elastic"):
        simulate(robot, engine, "hold", default_pd(robot), duration=0.01)
