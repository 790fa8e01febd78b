"""Re-simulation against pendulums that step through their equation of motion by another method at another step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pendulums import CENTER, INERTIA, KD, KP, MASS, NOISE, WEIGHT, command, pendulum_run, standing_run
from scipy.integrate import solve_ivp
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from mbexport.core.build import build
from mbexport.core.control import Control, default_pd
from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis.beginning import start_of, window_edges
from mbexport.core.diagnosis.compared import compared, residuals
from mbexport.core.diagnosis.inverse import said
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.prepare import creep_of, smoothed
from mbexport.core.diagnosis.resimulate import held_torque, resimulated
from mbexport.core.effects import EffectRow
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.kinematics import dynamics, tool_in_base
from mbexport.core.motion import from_table
from mbexport.core.simulation import simulate

DATABASE = load("pendulum")


def robot(run, **rows):
    return robot_of(DATABASE, "rigid", run, {name: tuple(found) for name, found in rows.items()})


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


@pytest.mark.parametrize("backend", ["urdf", "mjcf"])
@pytest.mark.parametrize("mode", ["pd", "motion"])
def test_a_perfect_model_leaves_the_noise(mode, backend):
    run = pendulum_run(mode)
    left = residuals(run, resimulated(robot(run), robot(run), run, backend), robot(run))
    assert rms(left["q"]) == pytest.approx(NOISE["q"], rel=0.1)
    assert rms(left["tau"]) == pytest.approx(NOISE["tau"], rel=0.1)


def test_friction_that_the_model_has_is_no_gap_and_one_that_it_lacks_is():
    run = pendulum_run("pd", lambda t, q, dq: 0.5 * dq)
    base = robot(run)
    rubbing = robot(run, viscous_friction=[EffectRow(1, FrozenMap({"coefficient": 0.5}))])
    assert rms(residuals(run, resimulated(rubbing, base, run, "mjcf"), base)["q"]) < 1.15 * NOISE["q"]
    assert rms(residuals(run, resimulated(base, base, run, "mjcf"), base)["q"]) > 20.0 * NOISE["q"]


def test_a_gear_with_a_small_error_is_as_good_as_rigid_to_a_quick_controller():
    """Its contact rang on from tick to tick, and a light motor's damping drove it to 350 N m."""
    run = pendulum_run("pd")
    quick = replace(run, control=replace(run.control, kp=(392.0,), kd=(14.0,)))
    rotor = {"rotor_inertia": [EffectRow(1, FrozenMap({"inertia": 0.004}))]}
    rigid = robot(quick, **rotor)
    gear = {"transmission_error": [EffectRow(1, FrozenMap({"amplitude": 8.0e-4, "cycles": 41.0, "phase": 0.0}))]}
    nearly = robot(quick, **rotor, **gear)
    left = [resimulated(one, rigid, quick, "mjcf") for one in (rigid, nearly)]
    assert np.abs(left[0]["q"] - left[1]["q"]).max() < 2.0e-3
    assert np.abs(left[0]["tau"] - left[1]["tau"]).max() < 2.0
    # what gives by itself keeps its own damping
    spring = {"joint_compliance": [EffectRow(1, FrozenMap({"stiffness": 900.0, "damping": 0.1}))]}
    soft = robot(quick, **rotor, **gear, **spring)
    assert soft.stages[0].drive.spring.damping == 0.1


def test_the_spring_that_engines_need_where_a_rigid_gear_wobbles_is_none_of_the_robots():
    """It gave by 1.4e-4 rad under the arm's weight, seven times the second encoder's noise: no gear was the cause."""
    run = pendulum_run("motion")
    amplitude, cycles, phase = 2.0e-5, 60.0, 0.4
    theta = command(run.t)[0]
    arm = (theta + amplitude * np.sin(cycles * theta + phase))[:, None]
    tool = tool_in_base(robot(run), arm)[:, :3, :3], tool_in_base(robot(run), arm)[:, :3, 3]
    seen = {"q": run.signals["q"], "q_link": arm, "ee": tool[1], "ee_rot": Rotation.from_matrix(tool[0]).as_quat()}
    seen["ee_rot"] = seen["ee_rot"][:, [3, 0, 1, 2]]
    both = replace(run, signals={**run.signals, **seen})
    rows = {"amplitude": amplitude, "cycles": cycles, "phase": phase}
    gear = robot(
        both,
        rotor_inertia=[EffectRow(1, FrozenMap({"inertia": 0.004}))],
        transmission_error=[EffectRow(1, FrozenMap(rows))],
    )
    simulated = residuals(both, resimulated(gear, robot(both), both, "mjcf"), gear)
    for name, most in (("q_link", 4.0e-6), ("ee", 2.0e-6), ("ee_rot", 4.0e-6)):
        assert rms(simulated[name][100:]) < most, name
    # nor does it make more of quick torques
    where, speed, rate = command(run.t)
    angle = cycles * where + phase
    slope = amplitude * cycles * np.cos(angle)
    quick = (1.0 + slope) * rate - amplitude * (cycles * speed) ** 2 * np.sin(angle)
    asked = (1.0 + slope) * (INERTIA * quick + WEIGHT * np.sin(arm[:, 0])) + 0.004 * rate
    says = resimulated(gear, robot(both), both, "mjcf")["tau"][:, 0]
    assert rms((says - asked)[100:-1]) < 1.5e-3
    # nor does the stop behind a given motion's end reach back into it
    uneven = replace(both, t=run.t + 1.0e-5 * np.sin(run.t))
    says = resimulated(gear, robot(both), uneven, "mjcf")["tau"][:, 0]
    assert np.abs((says - asked)[100:-1]).max() < 0.05
    grid = smoothed(both)
    spoken = said(gear, grid, robot(both), creep_of(grid))
    inside = slice(grid.edge, -grid.edge)
    followed = grid.q + amplitude * np.sin(cycles * grid.q + phase)
    np.testing.assert_allclose(spoken.q_link[inside], followed[inside], atol=1.0e-9)


def test_stamps_that_jitter_miss_and_lack_a_clock():
    stamps = np.cumsum(np.random.default_rng(5).uniform(0.002, 0.006, 900))
    stamps = np.concatenate([[0.0], stamps[stamps < 3.9]])
    run = pendulum_run("pd", stamps=stamps)
    run = replace(run, signals={**run.signals, "tau": np.full_like(run.signals["tau"], np.nan)})
    left = residuals(run, resimulated(robot(run), robot(run), run, "mjcf"), robot(run))
    assert rms(left["q"]) == pytest.approx(NOISE["q"], rel=0.15)
    assert np.isnan(left["tau"]).all()
    whole = pendulum_run("pd")
    kept = np.delete(np.arange(len(whole.t)), np.arange(100, 160))
    holed = replace(whole, t=whole.t[kept], signals={name: x[kept] for name, x in whole.signals.items()})
    left = residuals(holed, resimulated(robot(holed), robot(holed), holed, "mjcf"), robot(holed))["tau"]
    # nobody knows what was asked for in the hole
    assert rms(left[np.abs(holed.t - 0.6) > 0.7]) < 1.1 * NOISE["tau"]


def test_a_given_motion_does_not_stop_before_its_last_row():
    stamps = np.arange(0, 901) / 250.0 + 1e-5 * np.random.default_rng(7).normal(size=901)
    stamps[0] = 0.0
    run = pendulum_run("motion", stamps=stamps, duration=4.0)
    asked = command(run.t[-1])
    assert abs(asked[1]) > 0.5
    run = replace(run, signals={**run.signals, "dq": command(run.t)[1][:, None]})
    left = residuals(run, resimulated(robot(run), robot(run), run, "mjcf"), robot(run))
    assert np.abs(left["dq"][-3:]).max() < 1e-4
    assert np.abs(left["tau"][-3:]).max() < 6.0 * NOISE["tau"]


def test_a_command_does_not_stop_before_the_last_tick_of_a_run_that_ends_in_motion():
    """Its last row is stamped a hundredth of a tick early, so that its tick is behind the table's end."""
    run = pendulum_run("pd", duration=3.8)
    assert abs(float(command(3.8)[1])) > 0.5
    early = replace(run, t=np.append(run.t[:-1], run.t[-1] - 1.0e-5))
    left = residuals(early, resimulated(robot(early), robot(early), early, "mjcf"), robot(early))
    assert np.abs(left["tau"][-3:]).max() < 6.0 * NOISE["tau"]


def test_torque_alone_is_followed_in_windows():
    run = pendulum_run("torque", rate=1000.0)
    left = residuals(run, resimulated(robot(run), robot(run), run, "mjcf"), robot(run))
    # half a second from a start that is known as well as its sensor lets it
    assert rms(left["q"]) < 30.0 * NOISE["q"]
    assert rms(left["tau"]) == pytest.approx(NOISE["tau"], rel=0.1)
    heavy = robot(run, payload=[EffectRow(0, FrozenMap(_body(0.3)))])
    assert rms(residuals(run, resimulated(heavy, robot(run), run, "mjcf"), robot(run))["q"]) > 100.0 * NOISE["q"]


def test_windows_of_a_torque_run_that_begins_in_motion_begin_where_its_motion_is_known():
    """At a run's end the filter knows no speed: as wrong a start as that is taken for a gap half a second long."""
    whole = pendulum_run("torque", rate=1000.0, duration=3.0)
    for cut in (700, 1100, 1600):
        signals = {name: values[cut:] for name, values in whole.signals.items()}
        late = replace(whole, t=whole.t[cut:] - whole.t[cut], signals=signals)
        assert start_of(robot(late), late) is not None
        simulated = resimulated(robot(late), robot(late), late, "mjcf")
        left = residuals(late, simulated, robot(late))["q"]
        unknown = int(np.isnan(left).sum())
        assert 0 < unknown < 300
        assert np.isnan(left[:unknown]).all() and np.isnan(simulated["q"][:unknown]).all()
        assert rms(left) < 15.0 * NOISE["q"]
        assert all(np.isfinite(values).all() for values in noise_floor(DATABASE, "rigid", late).sigma.values())


def test_a_torque_run_begins_at_rest():
    """Of loud positions a filter's edge makes a speed, which half a second later is a gap."""
    loud = [pendulum_run("torque", rate=1000.0, duration=1.0, noise={"q": 2e-3, "tau": 0.01}, seed=k) for k in range(8)]
    ends = [residuals(run, resimulated(robot(run), robot(run), run, "mjcf"), robot(run))["q"][480:500] for run in loud]
    drifts = np.abs([float(np.nanmean(one)) for one in ends])
    assert drifts.max() < 4e-3


def test_a_torque_whose_stamp_is_a_little_late_does_not_wait_for_the_next_tick():
    """And one stamped before its tick by as little is of that tick, as one on time is."""
    on_time = pendulum_run("torque", rate=1000.0)
    given = held_torque(on_time, on_time.t)
    for away in (2.0e-5, -2.0e-5):
        stamped = replace(on_time, t=np.concatenate([[0.0], on_time.t[1:] + away]))
        np.testing.assert_array_equal(held_torque(stamped, on_time.t), given)
        left = residuals(stamped, resimulated(robot(stamped), robot(stamped), stamped, "mjcf"), robot(stamped))
        assert rms(left["tau"]) == pytest.approx(NOISE["tau"], rel=0.1)


def behind_a_drive(inertia, passes, factor=1.0):
    """A run of torque of a motor and an arm, stepped by SciPy under a torque held from tick to tick; its states.

    Args:
        inertia: The motor's.
        passes: Torque that its drive passes at a stretch and its rate.
        factor: By which the command is quicker.
    """
    ticks = np.arange(2001) / 1000.0
    asked, rate, _ = command(factor * ticks)
    state, states, given = np.zeros(4), [], []

    def bend(t, y, held):
        passed = passes(y[0] - y[2], y[1] - y[3])
        return [y[1], (held - passed) / inertia, y[3], (passed - WEIGHT * np.sin(y[2])) / INERTIA]

    for k in range(len(ticks)):
        states.append(state)
        given.append(KP * (asked[k] - state[0]) + KD * (factor * rate[k] - state[1]))
        state = solve_ivp(bend, (0.0, 1e-3), state, "RK45", args=(given[-1],), rtol=1e-8, atol=1e-11).y[:, -1]
    random = np.random.default_rng(4)
    states, held = np.array(states), np.array(given)[:, None]
    q, q_link = (states[:, [i]] + NOISE["q"] * random.normal(size=held.shape) for i in (0, 2))
    run = pendulum_run("torque", rate=1000.0, duration=2.0)
    signals = {"q": q, "q_link": q_link, "tau_cmd": held, "tau": held + NOISE["tau"] * random.normal(size=held.shape)}
    return replace(run, signals=signals, noise=run.noise | {"q_link": np.array([NOISE["q"]])}), states


def test_windows_of_torque_begin_with_arms_bent_by_what_they_bear():
    """Against a motor and an arm with a spring between them."""
    inertia, stiffness, damping = 0.05, 900.0, 6.0
    run, states = behind_a_drive(inertia, lambda stretch, rate: stiffness * stretch + damping * rate)
    soft = robot(
        run,
        rotor_inertia=[EffectRow(1, FrozenMap({"inertia": inertia}))],
        joint_compliance=[EffectRow(1, FrozenMap({"stiffness": stiffness, "damping": damping}))],
    )
    assert np.abs(states[:, 0] - states[:, 2]).max() > 200.0 * NOISE["q"]
    left = residuals(run, resimulated(soft, robot(run), run, "mjcf"), robot(run))
    assert rms(left["q_link"]) < 3.0 * NOISE["q"]


def test_windows_of_torque_begin_with_hysteresis_bent_as_the_motion_left_it():
    """Against a pendulum with four springs that slip, which nothing of the package moves."""
    torque, stiffness = 1.2, 40.0
    parts = np.arange(1, 5)
    pull, most = stiffness / 4.0, torque * parts / 10.0
    ticks, h = np.arange(2001) / 1000.0, 1.0e-3 / 8.0
    asked, rate, _ = command(ticks)
    q = dq = 0.0
    fixed, states, given = np.zeros(4), [], []
    for k in range(len(ticks)):
        states.append(q)
        given.append(KP * (asked[k] - q) + KD * (rate[k] - dq))
        for _ in range(8):
            # semi-implicit midpoint, with what slips let go after each step
            fixed = np.clip(fixed, q - most / pull, q + most / pull)
            middle = q + 0.5 * h * dq
            held = float(np.sum(np.clip(pull * (middle - fixed), -most, most)))
            dq += h * (given[-1] - held - WEIGHT * math.sin(middle)) / INERTIA
            q = middle + 0.5 * h * dq
    held = np.array(given)[:, None]
    noise = np.random.default_rng(5).normal(size=(2, *held.shape))
    signals = {"q": np.array(states)[:, None] + NOISE["q"] * noise[0], "tau_cmd": held, "tau": held + 0.01 * noise[1]}
    run = replace(pendulum_run("torque", rate=1000.0, duration=2.0), signals=signals)
    row = EffectRow(1, FrozenMap({"torque": torque, "stiffness": stiffness, "slips": 4.0}))
    rubbed = robot(run, hysteresis=[row])
    for engine in ("mjcf", "exudyn", "pybullet", "urdf"):
        left = residuals(run, resimulated(rubbed, robot(run), run, engine), rubbed)["q"]
        assert rms(left) < 10.0 * NOISE["q"], engine


def test_windows_of_torque_begin_with_arms_at_the_side_of_their_play_that_they_bear_on():
    """Where they are driven the other way than gravity pulls: it alone has them half of the time at the other side."""
    inertia, gap, stiffness, damping = 0.05, 0.01, 4.0e4, 20.0

    def contact(stretch, rate):
        pushed = stretch - np.clip(stretch, -0.5 * gap, 0.5 * gap)
        force = stiffness * pushed + damping * rate
        return max(force, 0.0) if pushed > 0.0 else min(force, 0.0) if pushed < 0.0 else 0.0

    run, states = behind_a_drive(inertia, contact, factor=2.0)
    loose = robot(
        run,
        rotor_inertia=[EffectRow(1, FrozenMap({"inertia": inertia}))],
        backlash=[EffectRow(1, FrozenMap({"gap": gap, "stiffness": stiffness, "damping": damping}))],
    )
    left = residuals(run, resimulated(loose, robot(run), run, "mjcf"), robot(run))
    starts = np.rint(1000.0 * np.array(window_edges(run)[1:-1])).astype(int)
    sides = np.sign(states[starts, 0] - states[starts, 2])
    assert np.any(sides != np.sign(np.sin(states[starts, 2])))
    assert rms(left["q_link"]) < 5.0 * NOISE["q"]


def test_torque_that_nobody_recorded_moves_nothing_that_is_compared():
    run = pendulum_run("torque", rate=1000.0)
    kept = (run.t < 1.05) | (run.t >= 1.27)
    torn = replace(run, t=run.t[kept], signals={name: values[kept] for name, values in run.signals.items()})
    simulated = resimulated(robot(torn), robot(torn), torn, "mjcf")
    assert np.abs(torn.signals["q"] - simulated["q"]).max() > 200.0 * NOISE["q"]
    left = residuals(torn, simulated, robot(torn))["q"]
    assert rms(left) < 30.0 * NOISE["q"]
    hidden = torn.t[np.isnan(left[:, 0])]
    # up to the next window
    assert hidden[0] == pytest.approx(1.27) and hidden[-1] == pytest.approx(1.5, abs=2e-3)


def test_what_drives_pass_on_is_not_compared_where_friction_turns_or_a_window_begins():
    run = pendulum_run("torque", rate=1000.0)
    run = replace(run, signals={**run.signals, "tau_link": run.signals["tau"]})
    known = np.isfinite(compared(run, robot(run))["tau_link"][:, 0])
    speed = np.gradient(savgol_filter(run.signals["q"][:, 0], 101, 3), run.t)
    turn = run.t[1:][(np.diff(np.sign(speed)) != 0) & (run.t[1:] > 1.0)][0]
    assert not known[np.abs(run.t - turn) < 0.006].any()
    assert not known[(run.t >= 1.0) & (run.t < 1.01)].any()
    far = np.min(np.abs(run.t[:, None] - np.arange(0.0, 4.0, 0.5)), axis=1) > 0.02
    assert known[far & (np.abs(speed) > 0.3)][20:-20].all()


def test_under_torque_alone_arms_are_held_against_their_motors():
    """Both drift away from the start that is not quite known; their difference does not."""
    run = pendulum_run("torque", rate=1000.0)
    random = np.random.default_rng(7)
    gives = 3.0e-4 * np.sin(5.0 * run.t)[:, None]
    for away, least, most in ((0.0 * gives, 0.9, 1.1), (gives, 5.0, 20.0)):
        arm = run.signals["q"] + away + NOISE["q"] * random.normal(size=run.signals["q"].shape)
        both = replace(run, signals=run.signals | {"q_link": arm}, noise=run.noise | {"q_link": np.array([NOISE["q"]])})
        left = residuals(both, resimulated(robot(both), robot(both), both, "mjcf"), robot(both))["q_link"]
        floor = noise_floor(DATABASE, "rigid", both).sigma["q_link"][0]
        assert floor < 2.0 * NOISE["q"]
        assert least < rms(left) / NOISE["q"] < most


def test_what_a_standing_joint_bears_is_compared_unless_its_friction_may_bear_any_of_it():
    run = standing_run()
    rubbing = robot(run, coulomb_friction=[EffectRow(1, FrozenMap({"torque": 2.0}))])
    rests, moves = (run.t > 0.5) & (run.t < 1.9), (run.t > 2.2) & (run.t < 2.6)
    bare, rubbed = compared(run, robot(run))["tau"], compared(run, rubbing)["tau"]
    assert np.isfinite(bare[rests]).all() and np.isfinite(bare[moves]).all()
    assert np.isnan(rubbed[rests]).all() and np.isfinite(rubbed[moves]).all()
    assert rms(residuals(run, resimulated(robot(run), robot(run), run, "mjcf"), robot(run))["tau"]) < 3.0 * NOISE["tau"]


def test_unknown_control_compares_torques_behind_one_filter():
    run = pendulum_run("unknown", rate=1000.0)
    assert set(compared(run, robot(run))) == {"tau"}
    left = residuals(run, resimulated(robot(run), robot(run), run, "mjcf"), robot(run))
    assert set(left) == {"tau"}
    assert rms(left["tau"]) < 3.0 * NOISE["tau"]
    assert np.isnan(left["tau"][[0, -1]]).all()


def test_a_motor_that_gives_less_than_it_is_asked_for_is_asked_for_more_by_a_controller_nobody_knows():
    run = pendulum_run("unknown", rate=1000.0)
    weak = replace(run, signals=run.signals | {"tau": run.signals["tau"] / 0.8})
    gives = robot(weak, torque_constant=[EffectRow(1, FrozenMap({"gain": 0.8}))])
    assert rms(residuals(weak, resimulated(gives, robot(weak), weak, "mjcf"), robot(weak))["tau"]) < 3.0 * NOISE["tau"]
    assert (
        rms(residuals(weak, resimulated(robot(weak), robot(weak), weak, "mjcf"), robot(weak))["tau"])
        > 30.0 * NOISE["tau"]
    )
    # what a sensor adds is no torque that a motor was asked for
    biased = replace(weak, signals=weak.signals | {"tau": weak.signals["tau"] + 0.5})
    row = EffectRow(1, FrozenMap({"torque": 0.5}))
    both = robot(biased, torque_constant=[EffectRow(1, FrozenMap({"gain": 0.8}))], torque_offset=[row])
    assert (
        rms(residuals(biased, resimulated(both, robot(biased), biased, "mjcf"), robot(biased))["tau"])
        < 3.0 * NOISE["tau"]
    )


@pytest.mark.parametrize("mode", ["motion", "unknown"])
def test_inverse_dynamics_and_simulation_agree_on_whether_a_motors_constant_acts(mode):
    """Where a motion is imposed gains do not act."""
    run = pendulum_run(mode, rate=1000.0)
    weak = robot(run, torque_constant=[EffectRow(1, FrozenMap({"gain": 0.8}))])
    grid = smoothed(run)
    along = said(weak, grid, robot(run), creep_of(grid)).tau[:, 0]
    simulated = np.interp(grid.t, run.t, resimulated(weak, robot(run), run, "mjcf")["tau"][:, 0])
    inside = slice(100, -100)
    assert rms((along - simulated)[inside]) < 0.02 * rms(simulated[inside])


def test_a_robot_that_a_fit_came_to_and_nobody_awaits_is_refused(monkeypatch):
    """As the robot is known it takes what it takes."""
    run = pendulum_run()
    monkeypatch.setattr("mbexport.core.diagnosis.resimulate.AWAITED", 100.0)
    assert set(resimulated(robot(run), robot(run), run, "mjcf")) >= {"q", "tau"}
    rubs = robot(run, viscous_friction=[EffectRow(1, FrozenMap({"coefficient": 0.123}))])
    with pytest.raises(RefusedError, match=r"takes [0-9e+.]+ steps for"):
        resimulated(rubs, robot(run), run, "mjcf")


def test_a_run_that_begins_moving_begins_so():
    run = pendulum_run("pd")
    assert start_of(robot(run), run) is None
    cut = run.t >= 1.0
    late = replace(run, t=run.t[cut] - 1.0, signals={name: values[cut] for name, values in run.signals.items()})
    start = start_of(robot(late), late)
    assert start is not None
    assert start.dtheta[0] == pytest.approx(np.polyfit(late.t[:15], late.signals["q"][:15, 0], 3)[2], abs=0.02)
    assert (
        rms(residuals(late, resimulated(robot(late), robot(late), late, "mjcf"), robot(late))["q"]) < 10.0 * NOISE["q"]
    )


@pytest.mark.parametrize("known", [("dq",), ()])
def test_a_kick_at_the_start_is_no_motion_before_it(known):
    """A command that begins with a speed: within a few rows a quick controller has the motor at it."""
    run = pendulum_run("pd", rate=1000.0, duration=1.0)
    t = np.arange(251) / 250.0
    law = from_table(t, 2.0 * t[:, None])
    control = Control("pd", (400.0,), (20.0,), rate=1000.0)
    trace = simulate(robot(run), "urdf", law, control, rate=250.0)
    signals = {name: trace.joints[name] for name in ("q", "dq", "q_cmd", "dq_cmd")}
    random, noise = np.random.default_rng(1), {"q": np.array([1e-5]), "dq": np.array([1e-3])}
    signals |= {name: signals[name] + noise[name] * random.normal(size=signals[name].shape) for name in noise}
    kept = {name: values for name, values in signals.items() if name != "dq" or name in known}
    kicked = replace(run, t=trace.t, signals=kept, noise=noise, control=control, rate=250.0)
    assert start_of(robot(kicked), kicked) is None
    # and what was moving before the record began still was
    later = {name: values[100:] for name, values in kept.items()}
    assert start_of(robot(kicked), replace(kicked, t=trace.t[100:] - trace.t[100], signals=later)) is not None


def _body(mass):
    return {"mass": mass, "x": 0.0, "y": 0.0, "z": 0.0} | dict.fromkeys(("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0)


def test_payloads_of_log_and_database_hang_together():
    run = replace(pendulum_run("motion", duration=1.0), payload=_body(0.2))
    here = robot_of(DATABASE, "rigid", run, {"payload": (EffectRow(0, FrozenMap(_body(0.3))),)})
    # both at the tool, 0.5 m from the axis
    weight = dynamics(here).gravity(np.array([math.pi / 2]))[0]
    assert weight == pytest.approx(9.81 * (MASS * CENTER + 0.5 * 0.5), rel=1e-12)
    alone = dynamics(robot(pendulum_run("motion", duration=1.0)))
    assert alone.gravity([math.pi / 2])[0] == pytest.approx(WEIGHT)
    assert dynamics(robot(run)).mass_matrix(np.zeros(1))[0, 0] == pytest.approx(INERTIA + 0.2 * 0.25)


def test_found_rows_stand_on_a_level_that_leaves_their_table_out():
    arm = load("imece2013")
    run = pendulum_run("motion", duration=1.0)
    found = {"joint_compliance": (EffectRow(2, FrozenMap({"stiffness": 5.0e4, "damping": 10.0})),)}
    elastic = [stage.drive.spring for stage in robot_of(arm, "rigid", run, found).stages]
    assert [spring is not None for spring in elastic] == [False, True, False, False, False, False]
    kept = [stage.drive.spring for stage in robot_of(arm, "full", run, found).stages]
    assert [spring.stiffness for spring in kept if spring][:3] == [180000.0, 50000.0, 180000.0]
    with pytest.raises(UsageError, match="no level 'soft'"):
        robot_of(arm, "soft", run)


def test_nothing_is_compared_behind_a_gap_before_the_controller_has_caught_up():
    """What is commanded in a quarter of a second without rows is not what a polynomial through its ends says."""
    run = pendulum_run("pd")
    kept = (run.t < 1.0) | (run.t >= 1.25)
    run = replace(run, t=run.t[kept], signals={name: values[kept] for name, values in run.signals.items()})
    simulated = resimulated(robot(run), robot(run), run, "mjcf")
    left = residuals(run, simulated, robot(run))
    off = np.abs(run.signals["q"] - simulated["q"])[:, 0] / NOISE["q"]
    hidden = np.isnan(left["q"][:, 0])
    assert off.max() > 20.0
    assert np.nanmax(np.abs(left["q"])) < 6.0 * NOISE["q"]
    # of every signal, from the gap's end on, for six times kd / kp
    assert run.t[hidden][0] == pytest.approx(1.252)
    assert np.all(np.diff(np.flatnonzero(hidden)) == 1)
    assert run.t[hidden][-1] - run.t[hidden][0] == pytest.approx(6.0 * KD / KP, abs=1.5 / run.rate)
    assert np.isnan(left["tau"][hidden]).all()
    # a few samples that are missing are bridged
    few = np.ones(len(run.t), dtype=bool)
    few[50:54] = False
    bridged = replace(run, t=run.t[few], signals={name: values[few] for name, values in run.signals.items()})
    assert np.isfinite(compared(bridged, robot(bridged))["q"][:200]).all()


@pytest.mark.parametrize("backend", ["urdf", "mjcf"])
def test_what_nobody_looks_at_changes_nothing_else(backend):
    """Friction that sticks, a spring and a delay remember; asking for less must not make them forget."""
    arm = build(load("planar2r"), "full")
    rules = replace(default_pd(arm), rate=400.0)
    words = {"duration": 0.4, "rate": 400.0}
    whole = simulate(arm, backend, "greca", rules, **words)
    less = simulate(arm, backend, "greca", rules, **words, without=("tau_link", "tool"))
    assert "tau_link" not in less.joints
    assert np.isnan(less.tool_in_base).all()
    for name, values in less.joints.items():
        np.testing.assert_array_equal(values, whole.joints[name], err_msg=name)
