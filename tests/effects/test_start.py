"""Where runs start: at rest, whatever effects a robot has, play closed by the load and centred where there is none."""

import numpy as np
import pytest

from mbexport.core.control import Control
from mbexport.core.motion import from_table, hold
from mbexport.core.simulation import simulate

EVERYTHING = {
    "joint_compliance": {1: {"stiffness": 2e3, "damping": 3.0}, 2: {"stiffness": 800.0, "damping": 1.0}},
    "backlash": {1: {"gap": 0.01}, 2: {"gap": 0.005}},
    "transmission_error": {1: {"amplitude": 0.01, "cycles": 20.0, "phase": 0.3}},
    "torque_ripple": {2: {"amplitude": 0.5, "cycles": 12.0}},
    "torque_constant": {1: {"gain": 0.8}, 2: {"gain": 1.1}},
    "encoder_offset": {1: {"offset": 0.02}},
    "joint_spring": {2: {"stiffness": 5.0, "rest": 0.1}},
    "rotor_inertia": {1: {"inertia": 0.4}, 2: {"inertia": 0.1}},
    "coulomb_friction": {1: {"torque": 2.0}, 2: {"torque": 1.0}},
    "load_friction": {1: {"coefficient": 0.1}},
    "hysteresis": {1: {"torque": 1.0, "stiffness": 300.0}},
    "link_flexibility": {2: {"ku": 500.0, "kv": 400.0}},
    "delay": {0: {"time": 3e-3}},
}
PD = Control("pd", (400.0, 120.0), (20.0, 6.0))


@pytest.mark.parametrize("control", [None, PD])
def test_a_robot_with_everything_starts_at_rest(robot_with, control):
    robot = robot_with("planar2r", **EVERYTHING)
    trace = simulate(robot, "urdf", hold([0.5, -0.8], 0.1), control, duration=0.1)
    for signal in ("q", "q_link", "tau", "tau_link"):
        np.testing.assert_allclose(trace.joints[signal] - trace.joints[signal][0], 0.0, atol=1e-9)
    assert np.max(np.abs(trace.joints["q"] - trace.joints["q_link"])) > 5e-3


def test_the_controller_holds_what_weight_ripple_and_gear_ask(robot_with, pendulum):
    kp, gain, offset = 60.0, 0.8, 0.02
    a, cycles, phase, k, gap = 0.01, 20.0, 0.3, 2e3, 0.01
    robot = robot_with(
        "pendulum",
        joint_compliance={1: {"stiffness": k}},
        backlash={1: {"gap": gap}},
        transmission_error={1: {"amplitude": a, "cycles": cycles, "phase": phase}},
        torque_ripple={1: {"amplitude": 0.5, "cycles": 12.0}},
        torque_constant={1: {"gain": gain}},
        encoder_offset={1: {"offset": offset}},
    )
    trace = simulate(robot, "urdf", hold([1.0], 0.1), Control("pd", (kp,), (1.0,)), duration=0.01)
    reported, q = trace.joints["q"][0, 0], trace.joints["q_link"][0, 0]
    theta = reported - offset
    load = pendulum.gravity(q)
    stretch = theta + a * np.sin(cycles * theta + phase) - q
    assert stretch == pytest.approx(load / k + gap / 2, abs=1e-12)
    asked = (1 + a * cycles * np.cos(cycles * theta + phase)) * load + 0.5 * np.sin(12.0 * theta)
    assert gain * kp * (1.0 - reported) == pytest.approx(asked, rel=1e-10)
    assert trace.joints["tau"][0, 0] == pytest.approx(kp * (1.0 - reported), rel=1e-14)


@pytest.mark.parametrize("backend", ["urdf", "mjcf"])
def test_play_without_a_load_is_centred(robot_with, backend):
    # scara's first, second and fourth joints stand upright; the third carries its arm
    table = {i: {"gap": 1e-3} for i in range(1, 5)}
    trace = simulate(robot_with("scara", backlash=table), backend, hold([0.3, 0.4, 0.05, 0.1], 0.01))
    apart = trace.joints["q"][0] - trace.joints["q_link"][0]
    assert np.all(apart[[0, 1, 3]] == 0.0) and abs(apart[2]) > 5e-4


def test_play_in_which_the_load_turns_holds_none(robot_with):
    # a pendulum hanging within its play falls to where its weight is zero
    robot = robot_with("pendulum", backlash={1: {"gap": 0.02, "stiffness": 1e4, "damping": 1.0}})
    trace = simulate(robot, "urdf", hold([0.004], 0.05))
    np.testing.assert_allclose(trace.joints["q_link"], 0.0, atol=1e-12)
    assert np.all(trace.joints["tau_link"] == 0.0)


def test_an_imposed_start_moves_with_the_wobble(robot_with):
    law = from_table([0.0, 0.2], np.array([[0.0], [0.4]]), np.full((2, 1), 2.0), np.zeros((2, 1)))
    table = {"transmission_error": {1: {"amplitude": 5e-3, "cycles": 20.0, "phase": 0.0}}}
    trace = simulate(robot_with("pendulum", **table), "urdf", law, duration=0.02, step=1e-5, rate=1e4)
    speed = (trace.joints["q_link"][1, 0] - trace.joints["q_link"][0, 0]) * 1e4
    assert speed == pytest.approx(2.0 * (1 + 5e-3 * 20.0), rel=1e-2)
