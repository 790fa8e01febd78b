"""Friction against closed forms, energy and other integrators; the equations stand here, not in our kernels."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.core.control import Control
from mbexport.core.motion import from_table, hold
from mbexport.core.simulation import simulate


def imposed(robot, law, **more):
    return simulate(robot, "urdf", law, **more)


def test_coulomb_takes_the_same_amplitude_from_every_half_swing(robot_with, released, pendulum):
    # a mass on a spring under dry friction loses 2 Fc / k each half period, and stops inside the band +-Fc/k
    k, fc, start = 60.0, 2.0, 0.5
    robot = robot_with(
        "pendulum",
        base_tilt={0: {"roll": math.pi / 2}},
        joint_spring={1: {"stiffness": k}},
        coulomb_friction={1: {"torque": fc}},
    )
    half = math.pi * math.sqrt(pendulum.inertia / k)
    trace = released(robot, [start], duration=10 * half, step=5e-5, rate=2000.0)
    q = trace.joints["q"][:, 0]
    turns = [start]
    for n in range(1, 7):
        near = np.abs(trace.t - n * half) < 0.2 * half
        turns.append(float(np.max(np.abs(q[near]))))
    np.testing.assert_allclose(np.diff(turns), -2 * fc / k, rtol=2e-3)
    assert abs(q[-1]) < fc / k and abs(trace.joints["dq"][-1, 0]) < 1e-6


def test_coulomb_holds_what_is_below_it(robot_with, released, pendulum):
    q = 0.3
    hold = pendulum.gravity(q)
    stuck = released(robot_with("pendulum", coulomb_friction={1: {"torque": 1.05 * hold}}), [q], duration=1.0)
    assert np.max(np.abs(stuck.joints["q"] - q)) < 1e-5
    assert np.max(np.abs(stuck.joints["q"][100:] - stuck.joints["q"][-1])) < 1e-9
    falls = released(robot_with("pendulum", coulomb_friction={1: {"torque": 0.95 * hold}}), [q], duration=0.4)
    assert falls.joints["q"][-1, 0] < q - 1e-3


def test_viscous_friction_damps_a_swing_as_its_logarithmic_decrement_says(robot_with, released, pendulum):
    k, c = 60.0, 0.4
    robot = robot_with(
        "pendulum",
        base_tilt={0: {"roll": math.pi / 2}},
        joint_spring={1: {"stiffness": k}},
        viscous_friction={1: {"coefficient": c}},
    )
    trace = released(robot, [0.4])
    decay, w = c / 2 / pendulum.inertia, math.sqrt(k / pendulum.inertia - (c / 2 / pendulum.inertia) ** 2)
    exact = 0.4 * np.exp(-decay * trace.t) * (np.cos(w * trace.t) + decay / w * np.sin(w * trace.t))
    np.testing.assert_allclose(trace.joints["q"][:, 0], exact, atol=1e-10)


def test_stribeck_fades_with_speed_as_its_formula(robot_with, swing):
    fc, fs, vs, c = 1.5, 0.9, 0.3, 0.2
    law, formula = swing([0.0], [1.0], 0.4)
    tables = {
        "coulomb_friction": {1: {"torque": fc}},
        "stribeck_friction": {1: {"torque": fs, "velocity": vs}},
        "viscous_friction": {1: {"coefficient": c}},
    }
    rubbing, free = (imposed(robot_with("pendulum", smooth=1e-3, **with_), law) for with_ in (tables, {}))
    speed = np.array([formula(t)[1][0] for t in rubbing.t])
    friction = (fc + fs * np.exp(-((speed / vs) ** 2))) * np.tanh(speed / 1e-3) + c * speed
    np.testing.assert_allclose((rubbing.joints["tau"] - free.joints["tau"])[:, 0], friction, atol=1e-10)
    np.testing.assert_array_equal(rubbing.joints["tau_link"], free.joints["tau_link"])


def test_stribeck_under_torque_is_what_another_integrator_makes_of_it(robot_with, pendulum, sampled_loop, swing):
    fc, fs, vs, v = 0.8, 0.5, 0.2, 0.02
    robot = robot_with(
        "pendulum",
        smooth=v,
        coulomb_friction={1: {"torque": fc}},
        stribeck_friction={1: {"torque": fs, "velocity": vs}},
    )
    law, formula = swing([0.2], [0.7], 0.3)
    kp, kd, rate = 200.0, 8.0, 200.0

    def accelerate(t, x, tau):
        friction = (fc + fs * math.exp(-((x[1] / vs) ** 2))) * math.tanh(x[1] / v)
        return [x[1], (tau[0] - friction - pendulum.gravity(x[0])) / pendulum.inertia]

    def control(t, x):
        q, dq, _ = formula(t)
        return kp * (q - x[0]) + kd * (dq - x[1])

    trace = simulate(robot, "urdf", law, Control("pd", (kp,), (kd,), rate=rate), rate=rate, step=5e-5)
    begin = [trace.joints["q"][0, 0], 0.0]
    states, torque = sampled_loop(accelerate, begin, control, rate, 0.3)
    np.testing.assert_allclose(trace.joints["q"][:, 0], states[:, 0], atol=1e-9)
    np.testing.assert_allclose(trace.joints["tau"], torque, atol=1e-6)


def test_load_friction_lifts_dearer_than_it_lowers(robot_with, swing):
    # at the same place and speed up and down: tau_up / tau_down = (1 + mu) / (1 - mu), Dohring's gear
    mu = 0.15
    up, formula = swing([1.0], [1.4], 2.0)
    down, _ = swing([1.4], [1.0], 2.0)
    robot = robot_with("pendulum", smooth=1e-4, load_friction={1: {"coefficient": mu}})
    lifted, lowered = imposed(robot, up), imposed(robot, down)
    middle = 1000
    assert formula(1.0)[1][0] > 0.3
    ratio = lifted.joints["tau"][middle, 0] / lowered.joints["tau"][middle, 0]
    # the middle of the swing has no acceleration, and centrifugal forces of one arm give no torque
    assert ratio == pytest.approx((1 + mu) / (1 - mu), rel=1e-9)
    passed = lifted.joints["tau_link"][middle, 0]
    assert lifted.joints["tau"][middle, 0] == pytest.approx((1 + mu) * passed, rel=1e-9)


@pytest.mark.parametrize("backend", ["urdf", "mjcf"])
def test_load_friction_is_solved_with_the_acceleration(robot_with, pendulum, sampled_loop, swing, backend):
    mu, j, v = 0.3, 0.2, 0.05
    robot = robot_with("pendulum", smooth=v, load_friction={1: {"coefficient": mu}}, rotor_inertia={1: {"inertia": j}})
    law, formula = swing([0.4], [1.0], 0.3)
    kp, kd, rate = 200.0, 8.0, 200.0

    def accelerate(t, x, tau):
        # M q'' = T - g, J q'' = tau - mu |T| s - T: linear in T on either side of T = 0
        g, s = pendulum.gravity(x[0]), math.tanh(x[1] / v)
        share = j / pendulum.inertia
        for sense in (1.0, -1.0):
            passed = (tau[0] + share * g) / (1.0 + sense * mu * s + share)
            if passed * sense >= 0.0:
                break
        return [x[1], (passed - g) / pendulum.inertia]

    def control(t, x):
        q, dq, _ = formula(t)
        return kp * (q - x[0]) + kd * (dq - x[1])

    trace = simulate(robot, backend, law, Control("pd", (kp,), (kd,), rate=rate), rate=rate, step=5e-5)
    states, _ = sampled_loop(accelerate, [trace.joints["q"][0, 0], 0.0], control, rate, 0.3)
    np.testing.assert_allclose(trace.joints["q"][:, 0], states[:, 0], atol=1e-9)
    np.testing.assert_allclose(trace.joints["dq"][:, 0], states[:, 1], atol=1e-7)


@pytest.mark.parametrize("backend", ["urdf", "mjcf"])
def test_load_friction_opposes_motion_where_gravity_loads_nothing(robot_with, pendulum, backend):
    """Driven, then braked: (j + (1 + mu) m) q'' = tau, then (j + (1 - mu) m) q'' = tau, whatever the load at rest."""
    mu, j, tau, rate = 0.2, 0.15, 0.6, 1000.0
    tables = {"load_friction": {1: {"coefficient": mu}}, "rotor_inertia": {1: {"inertia": j}}}
    # about an axis that is vertical but for what angles are rounded by
    robot = robot_with("pendulum", base_tilt={0: {"roll": math.pi / 2, "pitch": 1e-12}}, **tables)
    torque = np.where(np.arange(602) < 300, tau, -tau)[:, None]
    law, control = hold(np.zeros(1), 0.4), Control("torque", rate=rate)
    trace = simulate(robot, backend, law, control, duration=0.4, rate=rate, torque=torque)
    dq = trace.joints["dq"][:, 0]
    assert dq.min() >= 0.0
    driven = tau / (j + (1.0 + mu) * pendulum.inertia)
    braked = tau / (j + (1.0 - mu) * pendulum.inertia)
    assert braked > 1.2 * driven
    assert (dq[290] - dq[100]) * rate / 190 == pytest.approx(driven, rel=1e-3)
    assert (dq[310] - dq[390]) * rate / 80 == pytest.approx(braked, rel=1e-3)


def test_load_friction_behind_a_spring_takes_the_spring_torque(robot_with, swing):
    mu = 0.2
    tables = {"joint_compliance": {1: {"stiffness": 400.0, "damping": 1.0}}}
    law, formula = swing([0.5], [1.1], 0.4)
    rubbing = imposed(robot_with("pendulum", smooth=1e-3, load_friction={1: {"coefficient": mu}}, **tables), law)
    speed = np.array([formula(t)[1][0] for t in rubbing.t])
    passed = rubbing.joints["tau_link"][:, 0]
    # the dummy part counts 0
    expected = passed + mu * np.abs(passed) * np.tanh(speed / 1e-3)
    np.testing.assert_allclose(rubbing.joints["tau"][:, 0], expected, atol=1e-10)


def masing(angle, stiffness, force, m):
    """Torque of m Maxwell-slip elements along a path of turning points, from their virgin state, by hand."""
    torque = np.zeros(len(angle))
    for i in range(1, m + 1):
        k, limit = stiffness / m, force * i / (m * (m + 1) / 2)
        stretch = 0.0
        for n in range(1, len(angle)):
            stretch = min(max(stretch + angle[n] - angle[n - 1], -limit / k), limit / k)
            torque[n] += k * stretch
    return torque


@pytest.mark.parametrize("rate", [1000.0, 20.0])
def test_hysteresis_follows_maxwells_elements_at_any_rate_of_the_record(robot_with, rate):
    force, stiffness = 3.0, 90.0
    there = from_table([0.0, 0.2, 0.4], np.array([[0.0], [0.25], [0.05]]), np.zeros((3, 1)), np.zeros((3, 1)))
    tables = {"hysteresis": {1: {"torque": force, "stiffness": stiffness, "slips": 6.0}}}
    memory, free = (imposed(robot_with("pendulum", **with_), there, rate=rate) for with_ in (tables, {}))
    # the path's own turning point is none of the record's business
    path = there.at(np.arange(401) / 1000.0)[0][:, 0]
    expected = masing(path, stiffness, force, 6)[:: round(1000 / rate)]
    np.testing.assert_allclose((memory.joints["tau"] - free.joints["tau"])[:, 0], expected, atol=1e-9)
    assert (memory.joints["tau"] - free.joints["tau"])[0, 0] == 0.0


def test_a_reversed_hysteresis_curve_is_the_first_one_twice_as_large(robot_with):
    # Masing's rule (1926)
    force, stiffness, far = 3.0, 90.0, 0.2
    law = from_table([0.0, 0.5, 1.5], np.array([[0.0], [far], [-far]]), np.zeros((3, 1)), np.zeros((3, 1)))
    tables = {"hysteresis": {1: {"torque": force, "stiffness": stiffness}}}
    memory, free = (imposed(robot_with("pendulum", **with_), law) for with_ in (tables, {}))
    angle = memory.joints["q"][:, 0]
    torque = (memory.joints["tau"] - free.joints["tau"])[:, 0]
    first = np.interp(np.linspace(0.0, far, 50), angle[:501], torque[:501])
    back = np.interp(np.linspace(0.0, 2 * far, 50), far - angle[500:], torque[500] - torque[500:])
    np.testing.assert_allclose(back, 2 * first, atol=2e-3 * force)


def test_hysteresis_takes_its_loop_from_a_free_swing(robot_with, released, pendulum):
    # energy: what the spring and the moving mass have less after some swings is what all elements slipped away
    k, force, stiffness = 60.0, 0.8, 40.0
    robot = robot_with(
        "pendulum",
        base_tilt={0: {"roll": math.pi / 2}},
        joint_spring={1: {"stiffness": k}},
        hysteresis={1: {"torque": force, "stiffness": stiffness, "slips": 3.0}},
    )
    trace = released(robot, [0.4], duration=0.8, step=2e-5, rate=5000.0)
    q, dq = trace.joints["q"][:, 0], trace.joints["dq"][:, 0]
    torque = masing(q, stiffness, force, 3)
    energy = 0.5 * pendulum.inertia * dq**2 + 0.5 * k * q**2
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * np.diff(q))])
    np.testing.assert_allclose(energy[0] - energy, lost, atol=2e-5 * energy[0])


def test_hysteresis_under_torque_is_what_another_integrator_makes_of_it(robot_with, pendulum, released):
    # one element, with its slip as an ideal-plastic rate: integrated from event to event
    k, force, stiffness = 60.0, 2.0, 200.0
    robot = robot_with(
        "pendulum",
        base_tilt={0: {"roll": math.pi / 2}},
        joint_spring={1: {"stiffness": k}},
        hysteresis={1: {"torque": force, "stiffness": stiffness, "slips": 1.0}},
    )
    trace = released(robot, [0.5], duration=0.6, step=2e-5)
    give = force / stiffness
    x, anchor, t = np.array([0.5, 0.0]), 0.5, 0.0
    slipping, path = 0.0, np.zeros((len(trace.t), 2))
    while t < 0.6:

        def rate(s, y, slipping=slipping, anchor=anchor):
            torque = slipping * force if slipping else stiffness * (y[0] - anchor)
            return [y[1], (-k * y[0] - torque) / pendulum.inertia]

        if slipping:
            events = [lambda s, y: y[1]]
        else:
            events = [lambda s, y, a=anchor: y[0] - a - give, lambda s, y, a=anchor: y[0] - a + give]
        for event in events:
            event.terminal = True
        events[0].direction = 1.0 if not slipping else 0.0
        if not slipping:
            events[1].direction = -1.0
        found = solve_ivp(rate, (t, 0.6), x, method="DOP853", rtol=1e-12, atol=1e-13, events=events, dense_output=True)
        inside = (trace.t >= t) & (trace.t <= found.t[-1])
        path[inside] = found.sol(trace.t[inside]).T
        t, x = found.t[-1], found.y[:, -1]
        if found.status != 1:
            break
        if slipping:
            anchor, slipping = x[0] - slipping * give, 0.0
            # the turning point itself must not stop it again
            t, x = t + 1e-9, x + 1e-9 * np.array(rate(t, x, 0.0, anchor))
        else:
            slipping = 1.0 if len(found.t_events[0]) else -1.0
    np.testing.assert_allclose(trace.joints["q"][:, 0], path[:, 0], atol=1e-6)


def test_ripple_adds_its_sine_of_the_angle(robot_with, swing):
    a, cycles, phase = 0.7, 12.0, 0.4
    law, formula = swing([0.1], [0.9], 0.3)
    tables = {"torque_ripple": {1: {"amplitude": a, "cycles": cycles, "phase": phase}}}
    rippled, free = (imposed(robot_with("pendulum", **with_), law) for with_ in (tables, {}))
    angle = np.array([formula(t)[0][0] for t in rippled.t])
    added = (rippled.joints["tau"] - free.joints["tau"])[:, 0]
    np.testing.assert_allclose(added, a * np.sin(cycles * angle + phase), atol=1e-11)


def test_ripple_has_a_potential(robot_with, released, pendulum):
    # a torque of the place alone conserves energy: E = I q'^2 / 2 - W cos q - a / cycles cos(cycles q + phase)
    a, cycles, phase = 0.7, 12.0, 0.4
    robot = robot_with("pendulum", torque_ripple={1: {"amplitude": a, "cycles": cycles, "phase": phase}})
    trace = released(robot, [0.8], duration=1.0, step=1e-4)
    q, dq = trace.joints["q"][:, 0], trace.joints["dq"][:, 0]
    energy = 0.5 * pendulum.inertia * dq**2 - pendulum.weight * np.cos(q) - a / cycles * np.cos(cycles * q + phase)
    np.testing.assert_allclose(energy, energy[0], atol=1e-9)
