"""Suspects that are no physics: stamps that are off, a hold, a step; a delay of the drive is none of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pendulums
import pytest
from pendulums import INERTIA, KD, KP, NOISE, WEIGHT, command, friction_free, pendulum_run
from scipy.interpolate import CubicSpline

import mbexport
from mbexport.core.build import assembled
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis import suspect as suspecting
from mbexport.core.diagnosis.compared import residuals
from mbexport.core.diagnosis.inverse import said
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import Noise, noise_floor
from mbexport.core.diagnosis.numerics import (
    NUMERICAL,
    _in_most_joints,
    late_beside,
    left_by,
    numerics,
    part_left,
    suspects,
)
from mbexport.core.diagnosis.prepare import creep_of, prepared
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.diagnosis.stamps import _common, _Told, shift_of, shift_said, torque_shift_of, unshifted
from mbexport.core.diagnosis.suspect import with_coarse_steps, with_held_command, with_steps
from mbexport.core.effects import EffectRow
from mbexport.core.errors import RefusedError
from mbexport.core.motion import from_table
from mbexport.core.recording import Run
from mbexport.core.recording.run import MEASURED
from mbexport.core.simulation import simulate

DATABASE, PLANAR = load("pendulum"), load("planar2r")


def shift_in(run):
    robot = robot_of(DATABASE, "rigid", run)
    simulated = resimulated(robot, robot, run, "mjcf")
    return shift_of(run, robot, simulated, noise_floor(DATABASE, "rigid", run))


@pytest.mark.parametrize("late", [0.004, 0.002])
def test_stamps_that_are_late_are_found_and_put_back(late):
    run = pendulum_run("pd", late=late)
    assert shift_in(run) == pytest.approx(late, rel=0.1)
    robot = robot_of(DATABASE, "rigid", run)
    back = unshifted(run, shift_in(run))
    left = residuals(back, resimulated(robot, robot, back, "mjcf"), robot)["q"][5:-5]
    assert np.sqrt(np.nanmean(np.square(left))) < 3.0 * NOISE["q"]


def test_good_stamps_and_friction_are_no_shift():
    assert shift_in(pendulum_run("pd")) == 0.0
    assert shift_in(pendulum_run("pd", lambda t, q, dq: 0.4 * dq)) == 0.0
    assert shift_in(pendulum_run("pd", lambda t, q, dq: 0.3 * np.tanh(dq / 2e-3))) == 0.0


def test_positions_alone_tell_late_stamps_from_friction():
    def alone(run):
        """Where its arm side is, by a second sensor that says the same, and no torque."""
        return replace(run, signals={"q": run.signals["q"], "q_link": run.signals["q"], "q_cmd": run.signals["q_cmd"]})

    assert shift_in(alone(pendulum_run("pd", lambda t, q, dq: 0.3 * np.tanh(dq / 2e-3)))) == 0.0
    late = alone(pendulum_run("pd", late=0.004))
    assert shift_in(late) == pytest.approx(0.004, rel=0.1)
    # and what one joint's positions alone cannot tell is said
    assert "Viscous friction" in shift_said(late, 0.004)
    assert "Viscous friction" not in shift_said(pendulum_run("pd"), 0.004)


def test_one_channel_alone_is_late_by_whole_samples_only():
    """A drag makes it late by any part of one."""

    def alone(run):
        return replace(run, signals={"q": run.signals["q"], "q_cmd": run.signals["q_cmd"]})

    late = alone(pendulum_run("pd", late=0.004))
    assert shift_in(late) == pytest.approx(round(0.004 * late.rate) / late.rate)
    for run in (
        pendulum_run("pd", late=0.0037),
        pendulum_run("pd", lambda t, q, dq: 0.4 * dq),
        pendulum_run("pd", lambda t, q, dq: 0.3 * np.tanh(dq / 2e-3)),
        pendulum_run("pd"),
    ):
        assert shift_in(alone(run)) == 0.0


def test_what_the_arm_bears_goes_with_the_motor_and_is_no_other_witness():
    """Friction holds a joint and all behind it back alike; the torque that moves it would tell."""

    def borne(against=friction_free, late=0.0):
        quiet = pendulum_run("pd", against, late=late, noise=dict.fromkeys(NOISE, 0.0))
        way = CubicSpline(quiet.t, quiet.signals["q"][:, 0])
        torque = INERTIA * way(quiet.t, 2) + WEIGHT * np.sin(way(quiet.t))
        random = np.random.default_rng(1).normal(size=(2, len(quiet.t)))
        signals = {"q": way(quiet.t) + NOISE["q"] * random[0], "tau_link": torque + NOISE["tau"] * random[1]}
        columns = {name: values[:, None] for name, values in signals.items()}
        return replace(quiet, signals={**columns, "q_cmd": quiet.signals["q_cmd"]})

    assert shift_in(borne(lambda t, q, dq: 0.4 * dq)) == 0.0
    late = borne(late=0.004)
    assert shift_in(late) == pytest.approx(0.004)
    assert "Viscous friction" in shift_said(late, 0.004)


@pytest.mark.parametrize(
    ("joints", "left", "told"), [(1, 0.7, False), (1, 0.05, True), (2, 0.7, True), (2, 0.95, False)]
)
def test_parts_of_a_sample_are_said_by_more_than_one_joint_or_leave_next_to_nothing(joints, left, told):
    """A motor's gain and a load made a joint's position and torque 0.4 of a sample late, by chance the same."""
    late = 0.4e-2
    said = [_Told(name, i, late, 1e-5, 1e6, left * 1e6) for name in ("q", "tau") for i in range(joints)]
    assert _common(said, 100.0) == (pytest.approx(late) if told else 0.0)
    # whole ones are no chance
    whole = [replace(one, shift=1e-2) for one in said]
    assert _common(whole, 100.0) == pytest.approx(1e-2)


def test_a_late_drive_is_no_late_stamp():
    past: dict[float, float] = {}

    def late_torque(t, q, dq):
        """What takes the torque away that is held now and gives that of 4 ms ago instead."""
        wanted = float(command(t)[0])
        now = KP * (wanted - q) + KD * (float(command(t)[1]) - dq)
        past[round(t, 6)] = now
        before = past.get(round(t - 0.004, 6), now)
        return now - before

    assert shift_in(pendulum_run("pd", late_torque, duration=2.0)) == 0.0


def test_a_smooth_run_is_neither_its_step_nor_its_hold():
    run = pendulum_run("pd")
    robot = robot_of(DATABASE, "rigid", run)
    found = numerics(robot, robot, run, "mjcf", noise_floor(DATABASE, "rigid", run))
    assert found.step == pytest.approx(1e-3)
    assert found.step_error["q"][0] < 1e-3 * NOISE["q"]
    # the hold of one tick moves what a millisecond's lag of the damping moves, above nothing
    assert 0.0 < found.hold_error["q"][0] < 50.0 * NOISE["q"]
    assert len(found.notes) == 2


def lazy(seed=0, duration=4.0, against=friction_free):
    """The log says that a torque is held for 4 ms, it was held for one."""
    run = pendulum_run("pd", against, seed=seed, duration=duration)
    return replace(run, control=replace(run.control, rate=250.0))


UNSAID = [
    (lazy, "without a hold"),
    (lambda **more: pendulum_run("pd", coarse=1, **more), "first order"),
    (lambda **more: pendulum_run("pd", every=4, **more), "every 4 ticks"),
    (lambda **more: pendulum_run("pd", torque_late=0.004, **more), "torque"),
]


@pytest.mark.parametrize(("made", "said"), UNSAID)
def test_what_a_log_does_not_say_of_its_controller_is_no_effect(made, said):
    answer = mbexport.diagnose("pendulum", [made(seed=seed) for seed in (1, 2)], level="rigid", backends=[])
    assert answer.verdict == "no_gap"
    assert answer.which == ()
    assert any(said in note and "no effect" in note for note in answer.notes), answer.notes


def test_no_effect_is_looked_for_where_most_of_a_gap_is_numerics():
    runs = [lazy(seed, against=lambda t, q, dq: 0.006 * dq) for seed in (1, 2)]
    answer = mbexport.diagnose("pendulum", runs, level="rigid", backends=[])
    assert answer.verdict == "unexplained"
    assert answer.which == ()
    assert any("More than half" in note and "without a hold" in note for note in answer.notes)
    # positions alone do not say so: friction that damps may be all of it
    alone = [positions(run) for run in runs]
    answer = mbexport.diagnose("pendulum", alone, level="rigid", backends=[])
    assert not any("More than half" in note for note in answer.notes)


@pytest.mark.parametrize("more", [0.01, 0.02])
def test_a_gain_that_makes_more_than_half_of_what_numerics_makes_is_named(more):
    """A hundredth more damping than the log says looks three quarters like a controller that acts without a hold."""
    runs = [pendulum_run("pd", seed=seed) for seed in (1, 2)]
    stated = [replace(run, control=replace(run.control, kd=(KD / (1.0 + more),))) for run in runs]
    answer = mbexport.diagnose("pendulum", stated, level="rigid", backends=[])
    assert answer.verdict == "explained"
    (gain,) = answer.which
    assert gain.effect == "controller_gain"
    assert gain.parameters["kd"].value == pytest.approx(1.0 + more, abs=0.003)
    assert gain.parameters["kp"].value == pytest.approx(1.0, abs=0.003)
    said = any("not taken for numerics" in note and "without a hold" in note for note in answer.notes)
    assert said == (more == 0.01)


def positions(run):
    """A run whose torque was not measured."""
    return replace(run, signals={name: run.signals[name] for name in ("q", "q_cmd", "dq_cmd")})


def test_a_rotor_is_no_speed_that_is_late(monkeypatch):
    """Of positions alone; where speeds half a tick late would show what a rotor a third as heavy does."""
    monkeypatch.setattr(pendulums, "INERTIA", pendulums.INERTIA + 3.0 * KD * 0.5e-3)
    runs = [positions(pendulum_run("pd", seed=seed)) for seed in (1, 2)]
    answer = mbexport.diagnose("pendulum", runs, level="rigid", backends=[])
    (rotor,) = answer.which
    assert rotor.effect == "rotor_inertia"
    assert rotor.parameters["inertia"].value == pytest.approx(3.0 * KD * 0.5e-3, rel=0.01)


def test_positions_of_one_joint_alone_tell_an_integrator_by_its_size_too():
    run = pendulum_run("pd", coarse=1, duration=3.0)
    assert "first order" in likely(positions(run))[0][0]
    # its steps are those of no such controller
    other = replace(run, control=replace(run.control, rate=1400.0))
    assert any("first order" in name for name in likely(other)[0])
    assert likely(positions(other)) == ([], 1.0)


def likely(run):
    """Names of what may be the gap, and which part of it the first of them leaves."""
    robot = robot_of(DATABASE, "rigid", run)
    noise = noise_floor(DATABASE, "rigid", run)
    found = suspects(robot, run, "mjcf", noise)
    before = residuals(run, resimulated(robot, robot, run, "mjcf"), robot)
    left = part_left([before], [left_by(found[0], robot, run, "mjcf")], [noise]) if found else 1.0
    return [one.name for one in found], left


@pytest.mark.parametrize(("made", "said"), UNSAID)
def test_each_is_told_from_the_others(made, said):
    names, left = likely(made(duration=3.0))
    assert said in names[0]
    # that of the lazy log ticks four times as fast, and is compared with one that ticks eight times as fast
    assert left < (0.05 if made is lazy else 0.005)


def test_of_what_is_no_more_than_noise_no_part_is_taken():
    noise = noise_floor(DATABASE, "rigid", pendulum_run("pd"))
    quiet, loud = ({"q": scale * NOISE["q"] * np.ones((100, 1))} for scale in (0.5, 2.0))
    assert part_left([quiet], [loud], [noise]) == 1.0
    # of two that leave less than noise the quieter leaves less
    quieter = {"q": 0.5 * quiet["q"]}
    assert part_left([loud], [quieter], [noise]) < part_left([loud], [quiet], [noise]) < 0.0
    assert part_left([loud, loud], [loud, quiet], [noise, noise]) == pytest.approx((300.0 - 75.0) / 600.0, rel=0.02)


@pytest.mark.parametrize(("told", "size", "most"), [(3, 1.0, True), (2, 1.0, False), (3, 3.0, False)])
def test_what_acts_in_every_joint_is_told_by_most_of_them(told, size, most):
    """Where another joint's gap, a thousand times theirs, is of another kind."""
    t = np.arange(400) / 100.0
    ones = {"q": np.ones(4)}
    noise = Noise(ones, {"q": np.zeros(4)}, ones, ones)
    made = 10.0 * np.sin(np.outer(t, [2.0, 3.0, 4.0, 5.0]))
    left = size * made + np.random.default_rng(1).normal(size=made.shape)
    left[:, told:] = 1e4 * np.cos(np.outer(t, np.ones(4 - told)))
    assert _in_most_joints([{"q": left}], [{"q": left - made}], [noise]) == most


@pytest.mark.parametrize(
    "against",
    [
        lambda t, q, dq: -0.1 * dq,
        lambda t, q, dq: 0.3 * np.tanh(dq / 2e-3),
        lambda t, q, dq: 0.5 * np.sin(q),
        lambda t, q, dq: 0.2,
    ],
)
def test_physics_is_none_of_them(against):
    names, left = likely(pendulum_run("pd", against, duration=3.0))
    # what lags looks somewhat late, and is not that
    assert all("every" in name or "stamps" in name for name in names)
    assert left > NUMERICAL


def test_viscous_friction_is_no_command_that_is_held():
    """It makes positions late by 7 ms, as a command does that is held for ten ticks; its torque tells."""
    runs = [pendulum_run("pd", lambda t, q, dq: 0.4 * dq, seed=seed) for seed in (1, 2)]
    assert likely(runs[0])[1] > NUMERICAL
    answer = mbexport.diagnose("pendulum", runs, level="rigid", backends=[])
    assert [item.effect for item in answer.which] == ["viscous_friction"]
    # and where there is none, one joint's positions do not
    assert likely(positions(runs[0])) == ([], 1.0)


def test_viscous_friction_is_no_controller_that_acts_at_once():
    """Of kp times half a tick its damping is what a hold takes away."""
    runs = [pendulum_run("pd", lambda t, q, dq: 0.5e-3 * KP * dq, seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose("pendulum", runs, level="rigid", backends=[])
    assert [item.effect for item in answer.which] == ["viscous_friction"]


def test_no_mode_but_pd_has_a_controller_to_suspect():
    assert likely(pendulum_run("motion", torque_late=0.004)) == ([], 1.0)


def test_a_late_torque_is_told_in_whole_samples_and_alone():
    robot = robot_of(DATABASE, "rigid", pendulum_run("pd"))

    def torque_shift_in(run):
        return torque_shift_of(run, robot, resimulated(robot, robot, run, "mjcf"), noise_floor(DATABASE, "rigid", run))

    assert torque_shift_in(pendulum_run("pd", torque_late=0.004)) == pytest.approx(0.004, abs=1e-12)
    # a filter's lag is none, nor is a torque that comes before its motion, nor one that comes with it
    assert torque_shift_in(pendulum_run("pd", torque_late=0.002)) == 0.0
    assert torque_shift_in(pendulum_run("pd", late=0.004)) == 0.0
    assert torque_shift_in(pendulum_run("pd")) == 0.0
    early = unshifted(pendulum_run("pd"), 0.004, ("tau",))
    assert torque_shift_in(early) == 0.0


@pytest.mark.parametrize(
    ("more", "change"), [({"coarse": 1}, with_coarse_steps), ({"every": 3}, lambda run: with_held_command(run, 3))]
)
def test_what_such_a_controller_asks_for_is_known_along_the_motion(more, change):
    run = change(pendulum_run("pd", noise={"q": 1e-7, "tau": 1e-4}, **more))
    nominal = robot_of(DATABASE, "rigid", run)
    inside = slice(100, -100)

    def misses(one):
        grid = prepared(one)
        asked = said(nominal, grid, nominal, creep_of(grid)).u
        return float(np.std((asked - run.signals["tau"])[inside]))

    assert misses(run) < 1e-3
    assert misses(replace(run, control=Control("pd", (KP,), (KD,)))) > 0.01


def planar_run(engine, rows=None, seed=1):
    """A run of two joints that another engine made, with what a database does not know."""
    t = np.arange(751) / 250.0
    law = from_table(t, np.array([0.6, -0.5]) * (1.0 - np.cos(np.outer(t, [2.1 + 0.3 * seed, 3.3]))))
    control = Control("pd", (900.0, 250.0), (40.0, 12.0), "inverse_dynamics", 1000.0)
    plant, nominal = assembled(PLANAR, rows or {}), assembled(PLANAR, {})
    trace = simulate(plant, engine, law, control=control, nominal=nominal, rate=250.0)
    noise = {"q": np.full(2, 2e-6), "dq": np.full(2, 2e-4), "tau": np.full(2, 0.005)}
    random = np.random.default_rng(seed)
    q_cmd, dq_cmd, _ = law.at(trace.t)
    signals = {name: trace.joints[name] + noise[name] * random.normal(size=q_cmd.shape) for name in noise}
    signals |= {"q_cmd": q_cmd, "dq_cmd": dq_cmd}
    return Run(f"run {seed}", trace.t, signals, control, noise, (), {}, "", (), 250.0)


def test_where_everything_is_comes_half_such_a_step_early():
    """The tool's orientation too: positions and what the arms bear, and neither speeds nor what motors give."""
    t = np.arange(100) / 250.0
    signals = {name: np.repeat(t[:, None], 4 if name == "ee_rot" else 3, axis=1) for name in MEASURED}
    run = Run("ramp", t, signals, Control("pd", (KP,), (KD,), rate=1000.0), {}, (), {}, "", (), 250.0)
    moved = {name: float(np.nanmedian(values - t[:, None])) for name, values in with_steps(run, 0.5).signals.items()}
    still = {"dq", "tau"}
    assert moved == pytest.approx({name: 0.0 if name in still else -0.25e-3 for name in MEASURED}, abs=1e-9)


def test_an_integrator_of_first_order_with_several_steps_a_tick_is_no_effect():
    """PyBullet's: the speeds that its controller sees are half a step late."""
    runs = [planar_run("pybullet", seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose("planar2r", runs, level="rigid", backends=[])
    assert (answer.verdict, answer.which) == ("no_gap", ())
    assert any("steps of 0.1" in note and "no effect" in note for note in answer.notes), answer.notes


@pytest.mark.parametrize(
    ("effect", "joint", "name", "value"),
    [("rotor_inertia", 1, "inertia", 0.01), ("viscous_friction", 2, "coefficient", 0.05)],
)
def test_what_stands_beside_speeds_that_are_late_has_its_own_number(effect, joint, name, value):
    """They look like kd times half a step of a rotor, a fifth of the one that is there: it would go for less."""
    row = EffectRow(joint, {name: value})
    runs = [planar_run("pybullet", {effect: (row,)}, seed=seed) for seed in (1, 2)]
    answer = mbexport.diagnose("planar2r", runs, level="rigid", backends=[])
    (found,) = answer.which
    assert (found.effect, found.at) == (effect, f"joint_{joint}")
    low, high = found.parameters[name].ci95
    assert low < value < high
    assert found.parameters[name].value == pytest.approx(value, rel=0.02)
    assert any("steps of 0.1" in note and "looked for again" in note for note in answer.notes), answer.notes


@pytest.mark.parametrize("torque", [1e-3, 2.0])
def test_steps_of_first_order_and_a_lighter_rotor_are_told_apart_at_one_joint(monkeypatch, torque):
    """Speeds alone would look like the rotor; the torque that acts half a step early does not, whatever torque says."""

    def fitted():
        run = pendulum_run("pd", coarse=coarse, noise={"q": NOISE["q"], "tau": torque})
        robot, noise = robot_of(DATABASE, "rigid", run), noise_floor(DATABASE, "rigid", run)
        return [one.name for one in suspects(robot, run, "mjcf", noise) if one.fitted]

    coarse = 5
    assert "steps of 0.2" in fitted()[0]
    coarse = 0
    for part in (0.2, 0.5, 2.0):
        monkeypatch.setattr(pendulums, "INERTIA", INERTIA - part * 0.5e-3 * KD)
        assert fitted() == []


def test_speeds_so_late_that_no_controller_holds_are_not_suspected(monkeypatch):
    """The simulation of one that is that late is refused; the others are tried all the same."""
    run = planar_run("pybullet")
    robot, noise = robot_of(PLANAR, "rigid", run), noise_floor(PLANAR, "rigid", run)
    assert [one.fitted for one in suspects(robot, run, "mjcf", noise)] == [True, True]

    def refused(run, ticks=1.0):
        if ticks != 1.0:
            raise RefusedError("the motion is no longer finite")
        return with_coarse_steps(run)

    for name in ("with_differences", "with_steps"):
        monkeypatch.setattr(suspecting, name, refused)
    assert suspects(robot, run, "mjcf", noise) == []
    assert late_beside([robot], [robot], [run], "mjcf", [noise], 0.1) is None


def test_physics_of_two_joints_is_no_speed_that_is_late():
    """As another engine makes it, that is of fourth order."""
    run = planar_run("exudyn", {"rotor_inertia": (EffectRow(1, {"inertia": 0.01}),)})
    robot, noise = robot_of(PLANAR, "rigid", run), noise_floor(PLANAR, "rigid", run)
    assert suspects(robot, run, "mjcf", noise) == []
    assert late_beside([robot], [robot], [run], "mjcf", [noise], 0.1) is None


def test_what_is_put_back_has_holes_where_nothing_was_measured():
    run = pendulum_run("pd", duration=1.0)
    kept = np.ones(len(run.t), dtype=bool)
    kept[100:110] = False
    run = replace(run, t=run.t[kept], signals={name: values[kept] for name, values in run.signals.items()})
    back = unshifted(run, 1.0 / run.rate)
    missing = np.flatnonzero(np.isnan(back.signals["q"][:, 0]))
    assert missing.tolist() == [99, len(run.t) - 1]
    there = np.setdiff1d(np.arange(len(run.t) - 1), missing)
    assert back.signals["q"][there, 0] == pytest.approx(run.signals["q"][there + 1, 0], abs=1e-12)
    assert back.signals["q_cmd"] is run.signals["q_cmd"]
