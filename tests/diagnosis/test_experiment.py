"""The next experiment: what it separates is separated by an engine too, and what nothing separates is called so."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from mbexport.core.build import build
from mbexport.core.cli import program
from mbexport.core.control.gains import default_pd
from mbexport.core.database import FrozenMap, load
from mbexport.core.database.write import folder_texts
from mbexport.core.diagnosis.demonstration import shown
from mbexport.core.diagnosis.experiment import Experiment, design
from mbexport.core.diagnosis.experiment_words import SHOWS
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.imagined import imagined
from mbexport.core.diagnosis.problem import problem
from mbexport.core.effects import EffectRow, catalogue, effect_named
from mbexport.core.errors import UsageError
from mbexport.core.kinematics import dynamics
from mbexport.core.motion import excitation, motion_named
from mbexport.core.recording import Run
from mbexport.core.simulation import simulate

from .pendulums import pendulum_run


def name(effect, at=1, **values):
    given = {column.name: column.default for column in effect_named(effect).columns} | values
    return Found(effect, at, EffectRow(at, {key: value or 0.0 for key, value in given.items()}), 0.0)


COULOMB, OFFSET = name("coulomb_friction", torque=0.4), name("torque_offset", torque=0.4)
ROTOR, ARM = name("rotor_inertia", inertia=0.02), name("link_inertia", Ixx=0.01, Iyy=0.01, Izz=0.02)
VISCOUS = name("viscous_friction", coefficient=0.3)


@pytest.fixture(scope="module")
def asked():
    return problem(load("pendulum"), "rigid", [pendulum_run(seed=1)])


@pytest.fixture(scope="module")
def friction(asked):
    return design(asked, [VISCOUS, COULOMB])


def test_friction_is_split_by_several_speeds(friction):
    assert friction.splits
    fast = np.abs(friction.law.at(np.linspace(0.0, friction.law.duration, 2000))[1])
    assert np.quantile(fast, 0.9) > 4.0 * np.quantile(fast, 0.3)
    assert friction.pairs[0].share > 0.1
    assert "Coulomb friction at joint 1" in friction.why
    assert "viscous friction at joint 1 from" in friction.why or "from viscous friction at joint 1" in friction.why
    assert "they would where" in friction.because(COULOMB, VISCOUS)


def test_the_same_question_gives_the_same_motion(asked, friction):
    again = design(asked, [VISCOUS, COULOMB])
    assert again.why == friction.why
    assert again.next() == friction.next()


def test_an_engine_shows_what_was_promised(asked, friction):
    outcomes = shown(friction, asked, [VISCOUS, COULOMB])
    assert [one.told for one in outcomes] == [True, True]
    # what was imagined of it comes out
    pair = friction.pairs[0]
    outcome = next(one for one in outcomes if one.truth is pair.one)
    assert outcome.share == pytest.approx(pair.share, rel=0.3)


def test_an_engine_shows_too_what_a_motion_leaves_open(asked, friction):
    outcomes = shown(friction, asked, [ROTOR, ARM])
    assert not any(one.told for one in outcomes)
    assert "is not told from" in outcomes[0].words
    # what evidence tells and next to no energy does is neither told nor untold
    hardly = replace(outcomes[0], gain=57.7, share=0.002)
    assert not hardly.told
    assert "is hardly told from" in hardly.words and "58 short" in hardly.words and "than 1 % more" in hardly.words
    with pytest.raises(UsageError, match="no motion"):
        shown(Experiment(None, "", (), ""), asked, [ROTOR, ARM])


def test_the_motion_is_a_table_that_simulate_takes(friction, tmp_path):
    database = load("pendulum")
    table = friction.next().motion
    text = folder_texts(replace(database, motions=FrozenMap({"next": table})))["motions/next.dat"]
    file = tmp_path / "next.dat"
    file.write_text(text, encoding="utf-8")
    law = motion_named(build(database, "rigid"), str(file))
    t = np.linspace(0.0, law.duration, 500)
    assert np.allclose(law.at(t)[0], friction.law.at(t)[0], atol=1e-9)
    told = CliRunner().invoke(
        program,
        [
            "simulate",
            "pendulum",
            "--backend",
            "mjcf",
            "--motion",
            str(file),
            "--rate",
            "100",
            "-o",
            str(tmp_path / "run"),
        ],
    )
    assert told.exit_code == 0, told.output


def test_limits_are_kept(friction):
    joint = load("pendulum").joints[0]
    t = np.linspace(0.0, friction.law.duration, 2000)
    q, dq, _ = friction.law.at(t)
    assert np.abs(dq).max() < joint.velocity
    recorded = pendulum_run(seed=1).signals["q"]
    assert recorded.min() - 0.05 < q.min() < q.max() < recorded.max() + 0.05


def test_no_motion_splits_a_rotor_from_an_arm_about_the_same_axis(asked):
    found = design(asked, [ROTOR, ARM])
    assert not found.splits
    assert found.next() is None
    assert found.why.startswith("No motion can split")
    assert found.because(ROTOR, ARM) == "they say the same in every motion that these sensors see"


def test_of_three_names_those_that_can_be_split_are():
    database = load("planar2r")
    robot = build(database, "rigid")
    control = default_pd(robot, 8.0)
    sigma = {"q": (1e-5, 1e-5), "tau": (0.02, 0.02)}
    trace = simulate(robot, "mjcf", excitation(robot, duration=4.0), control, rate=250.0).with_noise(sigma)
    signals = {key: trace.joints[key] for key in ("q", "tau", "q_cmd", "dq_cmd")}
    noise = {key: np.array(values) for key, values in sigma.items()}
    asked = problem(database, "rigid", [Run("r", trace.t, signals, control, noise, (), {}, "", (), 250.0)])
    rotor, arm = name("rotor_inertia", 2, inertia=0.05), name("link_inertia", 2, Izz=0.05)
    load_ = name("payload", 0, mass=0.1, Izz=0.05)
    found = design(asked, [rotor, arm, load_], duration=6.0)
    apart = {frozenset((p.one.effect, p.other.effect)): p.apart for p in found.pairs}
    assert apart[frozenset(("rotor_inertia", "link_inertia"))]
    assert apart[frozenset(("rotor_inertia", "payload"))]
    assert not apart[frozenset(("link_inertia", "payload"))]
    assert "No motion can split" in found.why
    effort = np.array([joint.effort for joint in database.joints])
    t = np.linspace(0.0, found.law.duration, 1000)
    assert np.all(np.abs(dynamics(robot).inverse_dynamics(*found.law.at(t))) < effort)


def test_what_else_was_found_may_help_the_other(asked):
    """With friction of both kinds free, what an offset does is still its own."""
    found = design(asked, [COULOMB, OFFSET], [VISCOUS])
    assert found.splits


def test_noise_that_hides_all_leaves_nothing_to_split():
    loud = problem(load("pendulum"), "rigid", [pendulum_run(seed=1, noise={"q": 2e-5, "tau": 0.01})])
    tiny = [name("viscous_friction", coefficient=1e-5), name("coulomb_friction", torque=1e-5)]
    found = design(loud, tiny)
    assert not found.splits
    assert found.why.startswith("No motion within the limits splits")
    # a model that misses by more than noise hides more
    assert not design(loud, [COULOMB, VISCOUS], misfit=1e4).splits


@pytest.mark.parametrize("mode", ["pd", "motion", "torque"])
@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("backlash", {"gap": 1e-3, "stiffness": np.inf, "damping": np.inf}),
        ("joint_compliance", {"stiffness": 2000.0, "damping": 2.0}),
        ("viscous_friction", {"coefficient": 0.3}),
    ],
)
def test_what_is_imagined_leaves_nothing_of_the_truth(mode, effect, values):
    """In no channel: not of where the arm began in its play, nor of what a hold takes from the controller's torque."""
    run = pendulum_run(mode, seed=1)
    signals, noise = ({**one, "q_link": one["q"]} for one in (run.signals, run.noise))
    question = problem(load("pendulum"), "rigid", [replace(run, signals=signals, noise=noise)])
    truth = {effect: (EffectRow(1, values),)}
    planned = imagined(question, excitation(build(load("pendulum")), duration=3.0), truth)
    assert {channel.signal for channel in planned.evidence.channels} >= {"tau", "q_link"}
    assert np.abs(planned.residual(truth)).max() < 1e-6
    assert np.abs(planned.residual({})).max() > 5.0


def test_every_effect_says_what_it_shows():
    assert set(SHOWS) == {
        effect for effect in catalogue() if effect_named(effect).__class__.__module__.startswith("mbexport.")
    }
