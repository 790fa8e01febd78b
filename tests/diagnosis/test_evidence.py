"""What is compared: nothing that smoothing smears, and a delay to a part of a tick."""

from dataclasses import replace

import numpy as np
import pytest
from pendulums import (
    INERTIA,
    LENGTH,
    WEIGHT,
    command,
    late_by,
    noisy_loop,
    pendulum_run,
    soft_run,
    standing_run,
    without_torque,
)
from scipy.spatial.transform import Rotation

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis import prepare
from mbexport.core.diagnosis.inverse import _before, said
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.prepare import creep_of
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.search import search
from mbexport.core.diagnosis.state import Search
from mbexport.core.effects import EffectRow
from mbexport.core.kinematics import kinematics
from mbexport.core.motion import from_table
from mbexport.core.recording import read_run
from mbexport.core.representation import Spring
from mbexport.core.simulation import simulate

DATABASE = load("pendulum")


def left_by_nothing(runs):
    """Mean square that a perfect model leaves in each channel, in units of noise."""
    asked = problem(DATABASE, "rigid", runs)
    left = asked.residual({})
    return [float(np.mean(left[c.first : c.last] ** 2)) for c in asked.evidence.channels]


def without(run, begin, end):
    """The run with its rows between two times missing."""
    kept = (run.t < begin) | (run.t > end)
    return replace(run, t=run.t[kept], signals={name: values[kept] for name, values in run.signals.items()})


def test_a_hole_in_the_record_is_no_gap_of_the_model():
    assert max(left_by_nothing([without(pendulum_run(), 1.8, 2.0)])) < 1.5


def test_a_run_that_ends_in_motion_is_no_gap_of_the_model(monkeypatch):
    run = pendulum_run(duration=3.8)
    assert abs(float(command(3.8)[1])) > 0.5
    assert max(left_by_nothing([run])) < 1.5
    # the ends are what this is about: kept, they show
    monkeypatch.setattr(prepare, "EDGE", 0.1)
    assert max(left_by_nothing([run])) > 3.0


def test_a_delay_is_found_to_a_part_of_a_tick():
    late = 0.0044
    against, past = late_by(late)
    runs: list = []
    for seed in (1, 2):
        past.clear()
        runs.append(without_torque(pendulum_run(against=against, seed=seed)))
    asked = problem(DATABASE, "rigid", runs)
    state = Search(asked, whitening(asked))
    state.begin()
    found = search(state).found
    assert [item.effect for item in found] == ["delay"]
    assert found[0].row.values["time"] == pytest.approx(late, abs=6e-4)


def test_what_a_part_of_a_tick_makes_late_is_known_to_the_end_of_a_run():
    """The smoothing's ends, where nothing is compared, were carried into the run by the slower filter of a delay."""
    late, tick = 0.0003, 0.001
    recorded = pendulum_run(duration=3.8)
    assert abs(float(command(3.8)[1])) > 0.5
    q, dq, ddq = command(recorded.t)
    run = prepare.prepared(replace(recorded, signals={**recorded.signals, "q": q[:, None]}))
    robot = robot_of(DATABASE, "rigid", run.run)
    prompt, delayed = (
        said(one, run, nominal=robot, creep=creep_of(run)).tau[:, 0] for one in (robot, replace(robot, delay=late))
    )
    # the pendulum's torque by its own equation of motion, and how it changes
    rate = np.interp(run.t, recorded.t, np.gradient(INERTIA * ddq, recorded.t) + WEIGHT * np.cos(q) * dq)
    left = (delayed - prompt + (tick - late) * rate)[run.edge : -run.edge]
    # 1.6 times all of it at the end, where the smoothing is not left out
    assert np.abs(left).max() < 0.15 * (tick - late) * np.abs(rate).max()


def test_of_a_run_that_is_all_ends_a_late_drive_is_known_as_it_is():
    recorded = pendulum_run(duration=0.5, rate=100.0, noise={"q": 0.1, "tau": 1.0})
    run = prepare.prepared(recorded)
    assert len(run.t) - 2 * run.edge < prepare.FEWEST_FILTERED
    robot = robot_of(DATABASE, "rigid", recorded)
    assert np.isfinite(said(replace(robot, delay=0.0003), run, nominal=robot, creep=creep_of(run)).tau).all()


@pytest.mark.parametrize("thirds", [0, 2])
def test_what_reaches_the_arm_jumps_by_its_part_of_a_held_torque(thirds):
    """A smooth motion had shown the mean of two ticks, 0.4 of which a rotor keeps."""
    recorded = pendulum_run(noise={"q": 1e-9, "tau": 1e-9}, duration=3.8, delay=thirds)
    q, tau = recorded.signals["q"], recorded.signals["tau"]
    # the same pendulum, a part of whose inertia is its rotor's
    rotor, center = 0.1, 0.3
    mass = WEIGHT / 9.81 / center
    (body,) = DATABASE.inertias
    arm = replace(body, mass=mass, com=(center - LENGTH, 0.0, 0.0), zz=INERTIA - rotor - mass * center**2)
    robot = robot_of(replace(DATABASE, inertias=(arm,)), "rigid", recorded)
    (stage,) = robot.stages
    late = replace(robot, stages=(replace(stage, drive=replace(stage.drive, inertia=rotor)),), delay=thirds / 3000.0)
    # by its equation of motion at each tick, where the torque has just jumped
    passed = tau - rotor * (tau - WEIGHT * np.sin(q)) / INERTIA
    run = prepare.prepared(replace(recorded, signals={**recorded.signals, "tau_link": passed}))
    told = said(late, run, nominal=late, creep=creep_of(run)).tau_link
    left = (run.measured["tau_link"] - told)[run.edge : -run.edge]
    # three quarters of that without the part that jumps, where nothing is late
    assert np.abs(left).max() < 0.2 * 0.0005 * np.abs(np.gradient(passed[:, 0], recorded.t)).max()


def test_nothing_jumps_behind_a_spring():
    run = prepare.prepared(replace(r := pendulum_run(), signals={**r.signals, "tau_link": r.signals["tau"]}))
    robot = robot_of(DATABASE, "rigid", run.run)
    (stage,) = robot.stages
    soft = replace(robot, stages=(replace(stage, drive=replace(stage.drive, spring=Spring(1.0e4, 1.0))),))
    passed, held = (
        said(soft, some, nominal=robot, creep=creep_of(some)).tau_link
        for some in (replace(run, run=replace(run.run, control=Control("unknown"))), run)
    )
    assert np.array_equal(passed, held)
    assert not np.array_equal(held, said(robot, run, nominal=robot, creep=creep_of(run)).tau_link)


def test_a_commanded_torque_that_is_noisy_is_no_gap_of_the_model():
    """Left as it was at the rows that are compared, what it has far above the motion's band came down into it."""
    loud = noisy_loop({"q": 2.0e-5, "dq": 5.0e-3, "tau": 0.0}, slope=0.0)
    signals = {"q": loud.signals["q"], "tau_cmd": loud.signals["tau"]}
    run = replace(loud, signals=signals, noise={"q": loud.noise["q"]}, control=Control("torque"))
    assert np.std(np.diff(signals["tau_cmd"], axis=0)) > 0.02
    # 11 of it
    assert max(left_by_nothing([run])) < 1.5


def test_a_feedforward_that_jumps_at_every_row_is_no_gap_of_the_model(tmp_path):
    """Through positions alone a motion's pieces join with one speed and two accelerations, of which rows show one."""
    t = np.arange(501) / 200.0
    s = np.clip(np.minimum(t, 2.5 - t), 0.0, 1.0)
    rest = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    motion = from_table(t, np.column_stack([0.8 * rest * np.sin(4.1 * t), 0.6 * rest * np.cos(7.3 * t)]))
    database = load("planar2r")
    control = Control("pd", (900.0, 250.0), (40.0, 12.0), feedforward="inverse_dynamics", rate=1000.0)
    trace = simulate(build(database, "rigid"), "urdf", motion, control, rate=200.0)
    noise = {"q": [2e-5] * 2, "dq": [2e-3] * 2, "tau": [0.05] * 2}
    trace.with_noise(noise, 1).write(tmp_path / "run")
    run = read_run(tmp_path / "run", database)
    asked = problem(database, "rigid", [run])
    left = asked.residual({})
    loud = {c.signal: [] for c in asked.evidence.channels}
    for c in asked.evidence.channels:
        loud[c.signal].append(float(np.mean(left[c.first : c.last] ** 2)))
    # 262 and 2686 as if rows showed what acts about them; what the controller asked for is known far better
    assert max(loud["tau"]) < 1.5
    assert max(loud["u"]) < 50.0


@pytest.mark.parametrize("rows", [0.0, 0.5, 1.0, 2.0])
def test_what_is_late_is_no_quieter(rows):
    """A straight line between samples took a third of the noise away, and a delay that is none seemed to help."""
    run = prepare.prepared(pendulum_run(seed=1))
    turn = np.arange(len(run.t))[:, None]
    # up to a quarter of the rate at which it is sampled
    for frequency in (0.01, 0.1, 0.25):
        wave = np.sin(2.0 * np.pi * frequency * turn)
        late = _before(run, wave, rows * run.h)
        middle = slice(50, -50)
        there = np.sin(2.0 * np.pi * frequency * (turn - rows))
        np.testing.assert_allclose(late[middle], there[middle], atol=0.03)
    # before the first one that one
    assert _before(run, 3.0 + turn, 5.0 * run.h)[0] == _before(run, 3.0 + turn, 5.5 * run.h)[0] == 3.0


def test_where_the_tool_points_is_compared():
    """An axis that leans turns the tool and moves it nowhere: positions alone would not see it."""
    run = pendulum_run("motion")
    half = 0.5 * command(run.t)[0]
    # the built-in pendulum's tool in its base, by its own frames
    base = kinematics(robot_of(DATABASE, "rigid", run)).tool_in_base(np.zeros((1, 1)))[0, :3, :3]
    random = np.random.default_rng(3)
    axis = kinematics(robot_of(DATABASE, "rigid", run)).joints_in_base(np.zeros((1, 1)))[0, 0, :3, 2]
    swung = Rotation.from_rotvec(np.outer(2.0 * half, axis)) * Rotation.from_matrix(base)

    def left(lean):
        turn = Rotation.from_rotvec(random.normal(size=(len(run.t), 3)) * 1e-4) * Rotation.from_rotvec(lean) * swung
        signals = run.signals | {"ee_rot": np.roll(turn.as_quat(), 1, axis=1)}
        asked = problem(
            DATABASE, "rigid", [replace(run, signals=signals, noise=run.noise | {"ee_rot": np.array([1e-4])})]
        )
        rest = asked.residual({})
        return [float(np.mean(rest[c.first : c.last] ** 2)) for c in asked.evidence.channels if c.signal == "ee_rot"]

    assert len(left(np.zeros(3))) == 3
    assert max(left(np.zeros(3))) < 2.0
    assert max(left(np.array([1e-3, 0.0, 0.0]))) > 50.0


def test_what_rings_is_known_no_better_than_what_it_makes_of_noise():
    """A true spring that rings in the band makes many times the noise of its motor's position of it there."""
    omega = 60.0
    spring = {"stiffness": INERTIA * omega**2, "damping": 0.03}
    asked = problem(DATABASE, "rigid", [soft_run(**spring, seed=seed) for seed in (1, 2)])
    rows = {"joint_compliance": (EffectRow(1, spring),)}
    heard = asked.heard(rows)

    def squares(question, rows):
        left = question.residual(rows)
        return [float(np.mean(left[c.first : c.last] ** 2)) for c in question.evidence.channels]

    assert min(squares(asked, rows)) > 20.0
    assert max(squares(heard, rows)) < 1.5
    assert min(squares(heard, {})) > 20.0
    whiten = whitening(asked)
    left = asked.residual(rows)
    np.testing.assert_allclose(heard.evidence.told_by(asked.evidence, left), heard.residual(rows), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(whiten.undone(whiten(left)), left, rtol=1e-9, atol=1e-9)
    again = whiten.told_by(asked.evidence, heard.evidence)
    np.testing.assert_allclose(again(left), whitening(heard)(left), rtol=1e-6, atol=1e-6)
    # what makes no more of noise than the robot as it is known
    assert asked.heard({}) is asked
    assert asked.heard({"torque_offset": (EffectRow(1, {"torque": 0.5}),)}) is asked


def test_what_a_controller_asked_for_is_told_in_other_units_with_its_torque():
    run = pendulum_run()
    asked = problem(DATABASE, "rigid", [run])
    assert {c.signal for c in asked.evidence.channels} == {"tau", "u"} and asked.evidence.mixes[0]
    spring = {"stiffness": INERTIA * 60.0**2, "damping": 0.03}
    heard = asked.heard({"joint_compliance": (EffectRow(1, spring),)})
    offset = {"torque_offset": (EffectRow(1, {"torque": 0.5}),)}
    columns = np.column_stack([asked.residual({}), asked.residual(offset)])
    there = np.column_stack([heard.residual({}), heard.residual(offset)])
    assert not np.allclose(there[:, 1], columns[:, 1], rtol=0.1)
    np.testing.assert_allclose(heard.evidence.told_by(asked.evidence, columns), there, rtol=1e-9, atol=1e-9)


def test_a_joint_that_stands_most_of_the_time_rubs_only_where_it_moves():
    """Its sensor's noise turns no friction: what is stuck bears anything, and a friction would seem to be refuted."""
    level, run = 2.0, standing_run()
    ready = prepare.prepared(run)
    creep = creep_of(ready)
    bare = robot_of(DATABASE, "rigid", run)
    rubbing = robot_of(DATABASE, "rigid", run, {"coulomb_friction": (EffectRow(1, {"torque": level}),)})
    friction = (said(rubbing, ready, bare, creep).tau - said(bare, ready, bare, creep).tau)[:, 0]
    moves = (ready.t > 2.15) & (ready.t < 2.65)
    rests = (ready.t < 1.9) | (ready.t > 2.9)
    assert np.mean(np.abs(ready.dq) < creep) > 0.7
    np.testing.assert_allclose(friction[moves], level, rtol=1e-3)
    np.testing.assert_array_equal(friction[rests], 0.0)


@pytest.mark.parametrize(("kp", "kd"), [(0.8, 1.1), (0.5, 1.0), (1.0, 0.5), (1.3, 0.7)])
def test_what_other_gains_make_of_noise_is_what_a_controller_with_them_is_seen_to_make(kp, kd):
    asked = problem(DATABASE, "rigid", [pendulum_run()])
    other = asked.heard({"controller_gain": (EffectRow(1, {"kp": kp, "kd": kd}),)}, exactly=True)
    channel = next(c for c in asked.evidence.channels if c.signal == "u")
    before, after = (one.evidence.weights[channel.first : channel.last] ** -2.0 for one in (asked, other))
    assert asked.evidence.asks[0][0].noise(1.0, 1.0) == pytest.approx(1.0)
    assert asked.evidence.asks[0][0].noise(kp, kd) == pytest.approx(float(np.mean(after / before)), rel=0.1)
    # which is all that is heard of them there
    assert other.evidence.asks[0][0].noise(kp, kd) == pytest.approx(1.0)
