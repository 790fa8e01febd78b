"""What lives in the motor, the controller and the sensors: bit for bit where nothing but a number is added."""

import numpy as np
import pytest

from mbexport.core.control import Control
from mbexport.core.simulation import simulate

KP, KD, RATE = 200.0, 8.0, 200.0
PD = Control("pd", (KP,), (KD,), rate=RATE)


def run(robot, law, control=PD, **more):
    return simulate(robot, "urdf", law, control, rate=RATE, step=2e-4, **more)


@pytest.fixture(scope="module")
def law(swing):
    return swing([0.3], [0.9], 0.3)


def rigid(pendulum, gain=1.0, rotor=0.0, offset=0.0):
    """Equations of the pendulum and its controller's law, as sampled_loop wants them."""

    def accelerate(t, x, tau):
        return [x[1], (gain * tau[0] - pendulum.gravity(x[0])) / (pendulum.inertia + rotor)]

    def controller(formula, kp=KP, kd=KD, limit=np.inf):
        def control(t, x):
            q, dq, _ = formula(t)
            return np.clip(kp * (q - x[0] - offset) + kd * (dq - x[1]), -limit, limit)

        return control

    return accelerate, controller


def test_a_rotor_adds_to_the_arm_and_to_the_torque(robot_with, pendulum, sampled_loop, law):
    j = 0.3
    motion, formula = law
    heavy, light = (
        simulate(robot_with("pendulum", **tables), "urdf", motion, rate=RATE)
        for tables in ({"rotor_inertia": {1: {"inertia": j}}}, {})
    )
    added = np.array([j * formula(t)[2] for t in heavy.t])
    np.testing.assert_allclose(heavy.joints["tau"] - light.joints["tau"], added, atol=1e-10)
    np.testing.assert_array_equal(heavy.joints["tau_link"], light.joints["tau_link"])
    accelerate, controller = rigid(pendulum, rotor=j)
    trace = run(robot_with("pendulum", rotor_inertia={1: {"inertia": j}}), motion)
    states, torque = sampled_loop(accelerate, [trace.joints["q"][0, 0], 0.0], controller(formula), RATE, 0.3)
    np.testing.assert_allclose(trace.joints["q"][:, 0], states[:, 0], atol=1e-10)
    np.testing.assert_allclose(trace.joints["tau"], torque, atol=1e-8)
    # behind the gear only what the arm takes
    slope = (torque[:, 0] - pendulum.gravity(states[:, 0])) / (pendulum.inertia + j)
    passed = pendulum.inertia * slope + pendulum.gravity(states[:, 0])
    np.testing.assert_allclose(trace.joints["tau_link"][:, 0], passed, atol=1e-8)


def test_a_torque_constant_is_a_gain_that_the_report_does_not_see(robot_with, pendulum, sampled_loop, law):
    motion, formula = law
    accelerate, controller = rigid(pendulum, gain=0.8)
    trace = run(robot_with("pendulum", torque_constant={1: {"gain": 0.8}}), motion)
    states, torque = sampled_loop(accelerate, [trace.joints["q"][0, 0], 0.0], controller(formula), RATE, 0.3)
    np.testing.assert_allclose(trace.joints["q"][:, 0], states[:, 0], atol=1e-10)
    np.testing.assert_allclose(trace.joints["tau"], torque, atol=1e-8)
    np.testing.assert_allclose(trace.joints["tau_link"], 0.8 * torque, atol=1e-8)


def test_a_torque_offset_is_in_the_report_only(robot_with, law):
    biased, true = (
        run(robot_with("pendulum", torque_offset={1: {"torque": 1.5}}), law[0]),
        run(robot_with("pendulum"), law[0]),
    )
    np.testing.assert_array_equal(biased.joints["tau"], true.joints["tau"] + 1.5)
    for signal in ("q", "dq", "q_link", "tau_link"):
        np.testing.assert_array_equal(biased.joints[signal], true.joints[signal])


def test_a_torque_limit_cuts_before_the_report_and_the_gain(robot_with, pendulum, sampled_loop, law):
    motion, formula = law
    limit, gain = 4.0, 1.1
    accelerate, controller = rigid(pendulum, gain=gain)
    robot = robot_with("pendulum", torque_limit={1: {"torque": limit}}, torque_constant={1: {"gain": gain}})
    trace = run(robot, motion)
    begin = [trace.joints["q"][0, 0], 0.0]
    states, torque = sampled_loop(accelerate, begin, controller(formula, limit=limit), RATE, 0.3)
    assert np.count_nonzero(np.abs(trace.joints["tau"]) == limit) > 5
    np.testing.assert_allclose(trace.joints["q"][:, 0], states[:, 0], atol=1e-10)
    np.testing.assert_allclose(trace.joints["tau"], torque, atol=1e-8)


def test_an_encoder_offset_shifts_what_is_followed(robot_with, pendulum, sampled_loop, law):
    motion, formula = law
    offset = 0.05
    robot = robot_with("pendulum", encoder_offset={1: {"offset": offset}})
    imposed = simulate(robot, "urdf", motion, rate=RATE)
    wanted = np.array([formula(t)[0] for t in imposed.t])
    np.testing.assert_allclose(imposed.joints["q"], wanted, atol=1e-14)
    np.testing.assert_allclose(imposed.joints["q_link"], wanted - offset, atol=1e-14)
    accelerate, controller = rigid(pendulum, offset=offset)
    trace = run(robot, motion)
    states, _ = sampled_loop(accelerate, [trace.joints["q_link"][0, 0], 0.0], controller(formula), RATE, 0.3)
    np.testing.assert_allclose(trace.joints["q_link"][:, 0], states[:, 0], atol=1e-10)
    np.testing.assert_array_equal(trace.joints["q"], trace.joints["q_link"] + offset)


@pytest.mark.parametrize("time", [2.3e-3, 5e-3, 7.5e-3])
def test_a_delay_moves_the_torque_and_its_report(robot_with, pendulum, sampled_loop, law, time):
    motion, formula = law
    accelerate, controller = rigid(pendulum)
    trace = run(robot_with("pendulum", delay={0: {"time": time}}), motion)
    begin = [trace.joints["q"][0, 0], 0.0]
    states, torque = sampled_loop(accelerate, begin, controller(formula), RATE, 0.3, delay=time)
    np.testing.assert_allclose(trace.joints["q"][:, 0], states[:, 0], atol=1e-10)
    np.testing.assert_allclose(trace.joints["tau"], torque, atol=1e-8)
    at_once, _ = sampled_loop(accelerate, begin, controller(formula), RATE, 0.3)
    assert np.max(np.abs(at_once[:, 0] - states[:, 0])) > 1e-4


def test_controller_gains_are_factors_on_the_logs(robot_with, law):
    factors = run(robot_with("pendulum", controller_gain={1: {"kp": 0.8, "kd": 1.2}}), law[0])
    written = run(robot_with("pendulum"), law[0], Control("pd", (0.8 * KP,), (1.2 * KD,), rate=RATE))
    for signal in ("q", "dq", "tau", "tau_link"):
        np.testing.assert_array_equal(factors.joints[signal], written.joints[signal])


def test_an_imposed_motion_knows_no_controller(robot_with, law):
    tables = {
        "torque_limit": {1: {"torque": 0.1}},
        "delay": {0: {"time": 0.02}},
        "controller_gain": {1: {"kp": 0.5}},
        "torque_constant": {1: {"gain": 0.5}},
    }
    springs = {
        "joint_compliance": {1: {"stiffness": 400.0, "damping": 1.0}},
        "viscous_friction": {1: {"coefficient": 0.3}},
    }
    for more in ({}, springs):
        acted, plain = (
            simulate(robot_with("pendulum", **with_, **more), "urdf", law[0], rate=RATE) for with_ in (tables, {})
        )
        for signal in ("q", "dq", "q_link", "tau", "tau_link"):
            np.testing.assert_array_equal(acted.joints[signal], plain.joints[signal])


def test_the_order_along_the_command(robot_with, pendulum, sampled_loop, law):
    # controller -> log's limit -> delay -> drive's limit -> report (+ offset) -> constant -> motor
    motion, formula = law
    robot = robot_with(
        "pendulum",
        torque_limit={1: {"torque": 5.0}},
        torque_constant={1: {"gain": 1.2}},
        torque_offset={1: {"torque": 0.7}},
        delay={0: {"time": 2.5e-3}},
        controller_gain={1: {"kp": 1.3}},
        rotor_inertia={1: {"inertia": 0.1}},
        encoder_offset={1: {"offset": 0.03}},
    )
    control = Control("pd", (KP,), (KD,), rate=RATE, torque_limit=(4.5,))
    trace = run(robot, motion, control)
    accelerate, controller = rigid(pendulum, gain=1.2, rotor=0.1, offset=0.03)
    begin = [trace.joints["q_link"][0, 0], 0.0]
    law_of = controller(formula, kp=1.3 * KP, limit=4.5)
    states, torque = sampled_loop(accelerate, begin, law_of, RATE, 0.3, delay=2.5e-3)
    assert np.max(np.abs(torque)) == 4.5
    np.testing.assert_allclose(trace.joints["q_link"][:, 0], states[:, 0], atol=1e-10)
    np.testing.assert_allclose(trace.joints["tau"], torque + 0.7, atol=1e-8)


def test_a_commanded_torque_is_recorded_as_it_was_asked_for(robot_with, swing):
    # what acts is late and cut; who replays the run must find what was asked
    robot = robot_with("pendulum", delay={0: {"time": 0.02}}, torque_limit={1: {"torque": 1.0}})
    motion, _ = swing([0.0], [0.0], 0.1)
    asked = 2.0 * np.sin(np.arange(101) / 9.0)[:, None]
    trace = simulate(robot, "urdf", motion, Control("torque", rate=1000.0), torque=asked)
    np.testing.assert_array_equal(trace.joints["tau_cmd"], asked)
    late = np.clip(asked, -1.0, 1.0)[:-20]
    np.testing.assert_array_equal(trace.joints["tau"][20:], late)
