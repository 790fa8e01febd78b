"""The drives' equations: text and compiled text agree, friction sticks, gears conserve power."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.core.representation import ArmSpring, Drive, FrictionModel, Slip, Spring, Stick, Term
from mbexport.core.simulation import drive_law
from mbexport.core.simulation.backend import MachineState
from mbexport.core.simulation.compiled import law_function
from mbexport.core.simulation.drive_sheet import DriveSheet
from mbexport.core.simulation.drives import Drives


def sheet(*drives, model="stick", velocity=1.0e-3):
    n = len(drives)
    names = tuple(f"joint_{i + 1}" for i in range(n))
    return DriveSheet(names, ("revolute",) * n, drives, FrictionModel(model, velocity))


def coulomb(torque):
    return Term("coulomb_friction", "level", "level", (torque,))


def bristle(torque, inertia, give=5.0e-6):
    return Stick(give, 2.0 * math.sqrt(give * inertia / torque))


def everything():
    """Two joints that use every kind of term, one elastic with play, one rigid."""
    wobble = (1.0e-3, 40.0, 0.3)
    elastic = Drive(
        inertia=2.0,
        spring=Spring(5.0e3, 3.0, gap=2.0e-3),
        damping=0.7,
        terms=(
            coulomb(4.0),
            Term("stribeck_friction", "level", "level", (2.0, 0.05)),
            Term("load_friction", "level", "level", (0.1,)),
            Term("torque_ripple", "resistance", "resistance", (0.5, 12.0, 0.1)),
            Term("transmission_error", "error", "error", wobble),
            Term("transmission_error", "error_slope", "error_slope", wobble),
        ),
        slips=(Slip(300.0, 0.4), Slip(300.0, 1.1)),
        stick=bristle(6.0, 2.0),
        gain=0.9,
    )
    # what a law of one joint says of the motion of two
    together = Term("torque_ripple", "resistance", "coupled", (0.5, 12.0, 0.1))
    rigid = Drive(
        inertia=0.5, terms=(coulomb(1.0), together), arm_springs=(ArmSpring(9.0, 0.2),), stick=bristle(1.0, 0.5)
    )
    return sheet(elastic, rigid)


def outputs(n):
    return [np.zeros(n) for _ in range(4)]


def test_text_and_compiled_text_give_the_same_bits():
    drives = Drives(everything())
    plain = everything().table(law_function)
    random = np.random.default_rng(1)
    stick, slip = np.zeros(2), np.zeros(2)
    for accept in (False, True) * 50:
        q, dq, theta, dtheta = random.normal(scale=0.01, size=(4, 2))
        out = outputs(2)
        drive_law.drive_torques(plain, stick, slip, 0.1, q, dq, theta, dtheta, np.zeros(2), *out, accept)
        drives.evaluate(0.1, q, dq, theta, dtheta, accept=accept)
        for mine, compiled in zip(
            out, (drives.transmitted, drives.reaction, drives.friction, drives.on_arm), strict=True
        ):
            np.testing.assert_allclose(mine, compiled, rtol=1e-15, atol=1e-15)
        np.testing.assert_allclose(stick, drives.stick_anchor, rtol=1e-15)
        np.testing.assert_allclose(slip, drives.slip_anchor, rtol=1e-15)


def test_a_coupled_term_is_felt_by_both_joints_and_takes_no_more_than_its_power():
    ratio, cycles = -0.6, 3.0
    alone = sheet(Drive(), Drive())
    coupled = sheet(Drive(), Drive(terms=(Term("torque_ripple", "resistance", "coupled", (ratio, cycles, 0.2)),)))
    q, dq = np.array([0.3, -0.8]), np.array([1.1, 0.7])
    friction = []
    for drives in (Drives(alone), Drives(coupled)):
        drives.evaluate(0.0, q, dq, q, dq)
        friction.append(drives.friction.copy())
    value = ratio * math.sin(cycles * (q[1] + ratio * q[0]) + 0.2)
    assert friction[0].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(friction[1], [ratio * value, value], rtol=1e-14)
    assert friction[1] @ dq == pytest.approx(value * (dq[1] + ratio * dq[0]), rel=1e-14)


def test_the_sheet_survives_its_json():
    assert DriveSheet.from_json(everything().to_json()) == everything()


def integrate(drives, inertia, torque, theta, dtheta, h, steps):
    """One rigid joint under a constant or given torque, by RK4 with the memory accepted once a step."""
    drives.reset(MachineState(0.0, np.array([theta]), np.array([dtheta]), np.array([theta]), np.array([dtheta])))
    path = np.zeros((steps + 1, 2))
    path[0] = theta, dtheta

    def slope(t, x):
        drives.evaluate(t, x[:1], x[1:], x[:1], x[1:])
        return np.array([x[1], (torque(t) - drives.friction[0]) / inertia])

    x = path[0].copy()
    for k in range(steps):
        t = k * h
        k1 = slope(t, x)
        k2 = slope(t + h / 2, x + h / 2 * k1)
        k3 = slope(t + h / 2, x + h / 2 * k2)
        k4 = slope(t + h, x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        drives.evaluate(t + h, x[:1], x[1:], x[:1], x[1:], accept=True)
        path[k + 1] = x
    return path


def test_a_loaded_joint_sticks_and_does_not_creep():
    level, inertia = 10.0, 0.5
    drives = Drives(sheet(Drive(terms=(coulomb(level),), stick=bristle(level, inertia))))
    path = integrate(drives, inertia, lambda t: 0.9 * level, 0.3, 0.0, 1.0e-3, 10_000)
    assert abs(path[:, 0] - 0.3).max() < 1.0e-5
    assert abs(path[-1, 0] - path[100, 0]) < 1.0e-12


def test_a_joint_breaks_away_above_the_level_and_stops_where_coulomb_stops_it():
    level, inertia, speed = 10.0, 0.5, 0.4
    drives = Drives(sheet(Drive(terms=(coulomb(level),), stick=bristle(level, inertia))))
    moving = integrate(drives, inertia, lambda t: 1.5 * level, 0.0, 0.0, 1.0e-3, 1000)
    # uniformly accelerated by what is above the level
    assert moving[-1, 0] == pytest.approx(0.5 * (0.5 * level / inertia), rel=1.0e-3)
    stopping = integrate(drives, inertia, lambda t: 0.0, 0.0, speed, 1.0e-4, 2000)
    assert stopping[-1, 0] == pytest.approx(inertia * speed**2 / 2 / level, abs=2.0e-5)
    assert abs(stopping[-1, 1]) < 1.0e-9


def test_vibration_below_the_level_does_not_ratchet():
    level, inertia = 10.0, 0.5
    drives = Drives(sheet(Drive(terms=(coulomb(level),), stick=bristle(level, inertia))))
    path = integrate(drives, inertia, lambda t: 5.0 + 4.0 * math.sin(200.0 * t), 0.0, 0.0, 1.0e-4, 20_000)
    assert abs(path[-1, 0] - path[2000, 0]) < 1.0e-5


def test_smooth_friction_is_what_an_adaptive_integrator_makes_of_tanh():
    level, inertia, velocity = 3.0, 0.5, 0.05
    drives = Drives(sheet(Drive(terms=(coulomb(level),)), model="smooth", velocity=velocity))
    path = integrate(drives, inertia, lambda t: 4.0 * math.sin(5 * t), 0.0, 0.0, 1.0e-3, 2000)
    exact = solve_ivp(
        lambda t, x: [x[1], (4.0 * math.sin(5 * t) - level * math.tanh(x[1] / velocity)) / inertia],
        (0.0, 2.0),
        [0.0, 0.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    np.testing.assert_allclose(path[-1], exact.y[:, -1], atol=1.0e-8)


def test_hysteresis_closes_a_loop_whose_area_does_not_depend_on_speed():
    force, stiffness, m = 6.0, 900.0, 8
    slips = tuple(Slip(stiffness / m, force * i / (m * (m + 1) / 2)) for i in range(1, m + 1))
    amplitude = 0.02
    areas = []
    for speed in (0.01, 10.0):
        drives = Drives(sheet(Drive(slips=slips)))
        drives.reset(MachineState(0.0, *(np.zeros(1) for _ in range(4))))
        angle = amplitude * np.sin(np.linspace(0, 4 * math.pi, 20_001))
        torque = np.zeros_like(angle)
        for k, theta in enumerate(angle):
            x, v = np.array([theta]), np.array([speed])
            drives.evaluate(0.0, x, v, x, v, accept=True)
            torque[k] = drives.friction[0]
        areas.append(np.trapezoid(torque[10_000:], angle[10_000:]))
    assert areas[0] == areas[1]
    # closed form: an element that slips loses 4 level (amplitude - level / stiffness) a cycle
    closed = sum(4 * slip.level * max(amplitude - slip.level / slip.stiffness, 0.0) for slip in slips)
    assert areas[0] == pytest.approx(closed, rel=1.0e-4)


def test_play_passes_nothing_inside_and_its_damper_never_pulls():
    assert drive_law.transmitted_torque(100.0, 5.0, 0.01, 0.009, 3.0) == 0.0
    assert drive_law.transmitted_torque(100.0, 5.0, 0.01, 0.012, -3.0) == 0.0
    assert drive_law.transmitted_torque(100.0, 5.0, 0.01, -0.03, 0.0) == pytest.approx(-2.0)
    assert drive_law.transmitted_torque(100.0, 5.0, 0.0, 0.01, -3.0) == pytest.approx(1.0 - 15.0)


def test_a_wobbling_gear_loses_no_power():
    wobble = (2.0e-3, 40.0, 0.3)
    terms = (
        Term("transmission_error", "error", "error", wobble),
        Term("transmission_error", "error_slope", "error_slope", wobble),
    )
    drives = Drives(sheet(Drive(inertia=1.0, spring=Spring(2.0e4), terms=terms)))
    random = np.random.default_rng(3)
    for _ in range(20):
        theta, dtheta, q, dq = random.normal(scale=0.1, size=(4, 1))
        drives.evaluate(0.0, q, dq, theta, dtheta)
        error = wobble[0] * math.sin(wobble[1] * theta[0] + wobble[2])
        derror = wobble[0] * wobble[1] * math.cos(wobble[1] * theta[0] + wobble[2]) * dtheta[0]
        stretch, dstretch = theta[0] + error - q[0], dtheta[0] + derror - dq[0]
        stored = 2.0e4 * stretch * dstretch
        given = drives.reaction[0] * dtheta[0] - drives.transmitted[0] * dq[0]
        assert given == pytest.approx(stored, rel=1e-9, abs=1e-9)


def test_friction_under_load_is_solved_with_the_accelerations():
    mu, inertia = 0.3, 0.8
    drives = Drives(
        sheet(
            *(
                Drive(inertia=inertia, terms=(Term("load_friction", "level", "level", (mu,)),), stick=Stick(5e-6, 1e-3))
                for _ in range(3)
            )
        )
    )
    assert drives.needs_load
    random = np.random.default_rng(5)
    for _ in range(20):
        root = random.normal(size=(3, 3))
        mass, bias, command = root @ root.T + np.eye(3), random.normal(size=3), 5 * random.normal(size=3)
        q, dq = random.normal(size=(2, 3))
        drives.stick_anchor[:] = q - np.sign(dq)  # slipping, whatever came before
        drives.evaluate_loaded(0.0, q, dq, q, dq, command, mass, bias)
        ddq = np.linalg.solve(mass + inertia * np.eye(3), command - drives.friction - bias)
        passed = mass @ ddq + bias
        np.testing.assert_allclose(drives.friction, mu * abs(passed) * np.sign(dq), rtol=1e-10, atol=1e-11)
