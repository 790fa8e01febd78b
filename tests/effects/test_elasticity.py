"""What gives: springs, play, wobbling gears, bearings and arms, against equations that are written here."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbexport
from mbexport.core.control import Control
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.expansion import expanded
from mbexport.core.motion import hold
from mbexport.core.simulation import simulate

KP, KD, RATE = np.array([300.0, 100.0]), np.array([15.0, 5.0]), 200.0
PD = Control("pd", tuple(KP.tolist()), tuple(KD.tolist()), rate=RATE)


def test_two_elastic_joints_with_rotors_in_a_loop(robot_with, planar2r, sampled_loop, swing):
    k, b, j = np.array([900.0, 300.0]), np.array([2.0, 0.7]), np.array([0.4, 0.1])
    robot = robot_with(
        "planar2r",
        joint_compliance={i + 1: {"stiffness": k[i], "damping": b[i]} for i in range(2)},
        rotor_inertia={i + 1: {"inertia": j[i]} for i in range(2)},
    )
    law, formula = swing([0.5, -1.0], [0.9, -0.6], 0.3)

    def accelerate(t, x, tau):
        q, theta, dq, dtheta = x.reshape(4, 2)
        passed = k * (theta - q) + b * (dtheta - dq)
        ddq = np.linalg.solve(planar2r.mass_matrix(q), passed - planar2r.bias(q, dq))
        return np.concatenate([dq, dtheta, ddq, (tau - passed) / j])

    def control(t, x):
        q, dq, _ = formula(t)
        return KP * (q - x[2:4]) + KD * (dq - x[6:])

    trace = simulate(robot, "urdf", law, PD, rate=RATE, step=5e-5)
    begin = np.concatenate([trace.joints["q_link"][0], trace.joints["q"][0], np.zeros(4)])
    states, torque = sampled_loop(accelerate, begin, control, RATE, 0.3)
    np.testing.assert_allclose(trace.joints["q_link"], states[:, :2], atol=1e-9)
    np.testing.assert_allclose(trace.joints["q"], states[:, 2:4], atol=1e-9)
    np.testing.assert_allclose(trace.joints["tau"], torque, atol=1e-6)
    passed = k * (states[:, 2:4] - states[:, :2]) + b * (states[:, 6:] - states[:, 4:6])
    np.testing.assert_allclose(trace.joints["tau_link"], passed, atol=1e-5)


def test_imposed_motion_of_an_elastic_robot(robot_with, planar2r, swing):
    k, b = np.array([900.0, 300.0]), np.array([2.0, 0.7])
    tables = {"joint_compliance": {i + 1: {"stiffness": k[i], "damping": b[i]} for i in range(2)}}
    law, formula = swing([0.5, -1.0], [1.0, -0.5], 0.3)
    trace = simulate(robot_with("planar2r", **tables), "urdf", law, step=5e-5, rate=100.0)

    def rate(t, x):
        theta, dtheta, _ = formula(t)
        passed = k * (theta - x[:2]) + b * (dtheta - x[2:])
        ddq = np.linalg.solve(planar2r.mass_matrix(x[:2]), passed - planar2r.bias(x[:2], x[2:]))
        return np.concatenate([x[2:], ddq])

    begin = np.concatenate([trace.joints["q_link"][0], np.zeros(2)])
    exact = solve_ivp(rate, (0.0, 0.3), begin, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=trace.t).y
    np.testing.assert_allclose(trace.joints["q_link"], exact[:2].T, atol=1e-10)
    # the rotor's torque is added, the motion stays
    with_rotor = robot_with("planar2r", rotor_inertia={1: {"inertia": 0.4}}, **tables)
    heavier = simulate(with_rotor, "urdf", law, step=5e-5, rate=100.0)
    np.testing.assert_array_equal(heavier.joints["q_link"], trace.joints["q_link"])
    added = np.array([[0.4 * formula(t)[2][0], 0.0] for t in trace.t])
    np.testing.assert_allclose(heavier.joints["tau"] - trace.joints["tau"], added, atol=1e-9)


def played(stretch, dstretch, k, b, gap):
    if abs(stretch) <= gap / 2:
        return 0.0
    torque = k * (stretch - math.copysign(gap / 2, stretch)) + b * dstretch
    return torque if torque * stretch > 0.0 else 0.0


def test_play_is_what_an_integrator_with_its_own_contacts_makes_of_it(robot_with, pendulum, swing):
    k, b, gap, j = 2000.0, 1.5, 0.03, 0.3
    robot = robot_with(
        "pendulum",
        joint_compliance={1: {"stiffness": k, "damping": b}},
        backlash={1: {"gap": gap}},
        rotor_inertia={1: {"inertia": j}},
    )
    law, formula = swing([-0.3], [0.5], 0.3)
    trace = simulate(robot, "urdf", law, duration=0.4, step=1e-5)

    def rate(t, x):
        theta, dtheta, _ = formula(t)
        torque = played(theta[0] - x[0], dtheta[0] - x[1], k, b, gap)
        return [x[1], (torque - pendulum.gravity(x[0])) / pendulum.inertia]

    begin = [trace.joints["q_link"][0, 0], 0.0]
    # steps short enough that no contact is missed
    exact = solve_ivp(rate, (0.0, 0.4), begin, method="DOP853", rtol=1e-10, atol=1e-12, t_eval=trace.t, max_step=2e-4)
    np.testing.assert_allclose(trace.joints["q_link"][:, 0], exact.y[0], atol=2e-6)
    stretch = trace.joints["q"] - trace.joints["q_link"]
    # it was in the play, and at both its ends
    inside = np.abs(stretch) < gap / 2
    assert np.count_nonzero(inside) > 20 and stretch.min() < -gap / 2 and stretch.max() > gap / 2
    assert np.all(trace.joints["tau_link"][inside] == 0.0)
    assert np.all(trace.joints["tau_link"] * stretch >= 0.0)


def test_a_contact_without_numbers_rings_at_500_hz(robot_with, pendulum):
    # on the reduced inertia of motor side and arm, and without weight
    j, gap, duration = 0.3, 0.01, 0.02
    robot = robot_with(
        "pendulum",
        base_tilt={0: {"roll": math.pi / 2}},
        backlash={1: {"gap": gap}},
        rotor_inertia={1: {"inertia": j}},
    )
    spring = robot.stages[0].drive.spring
    reduced = j * pendulum.inertia / (j + pendulum.inertia)
    assert spring.stiffness == pytest.approx((2 * math.pi * 500.0) ** 2 * reduced, rel=1e-12)
    assert spring.damping == pytest.approx(2 * 0.15 * math.sqrt(spring.stiffness * reduced), rel=1e-12)
    # half a period in contact
    from mbexport.core.simulation.backend import MachineState

    speed = 0.5
    start = MachineState(0.0, np.zeros(1), np.zeros(1), np.full(1, gap / 2), np.full(1, speed))
    law = hold([0.0], duration)
    trace = simulate(
        robot, "urdf", law, Control("torque"), duration=duration, step=1e-6, rate=1e5, start=start,
        torque=np.zeros((21, 1)),
    )  # fmt: skip
    passed = trace.joints["tau_link"][:, 0]
    end = trace.t[np.flatnonzero(passed > 0.0)[-1]]
    w, d = 2 * math.pi * 500.0, 0.15
    wd = w * math.sqrt(1 - d * d)
    # T = K s + b s' of s = v / wd exp(-d w t) sin(wd t) is zero first at tan(wd t) = -2 d sqrt(1 - d^2) / (1 - 2 d^2)
    assert end == pytest.approx((math.pi - math.atan2(2 * d * wd / w, 1 - 2 * d * d)) / wd, abs=2e-5)
    # momentum is kept
    total = j * trace.joints["dq"][0, 0]
    rate = np.gradient(trace.joints["q_link"][:, 0], trace.t)
    assert j * trace.joints["dq"][-5, 0] + pendulum.inertia * rate[-5] == pytest.approx(total, rel=1e-4)


def test_a_wobbling_gear_loses_nothing(robot_with, released, pendulum):
    a, cycles, phase, k, j = 0.01, 20.0, 0.3, 800.0, 0.3
    robot = robot_with(
        "pendulum",
        joint_compliance={1: {"stiffness": k}},
        transmission_error={1: {"amplitude": a, "cycles": cycles, "phase": phase}},
        rotor_inertia={1: {"inertia": j}},
    )
    trace = released(robot, [0.8], theta=[0.8], duration=0.6, step=5e-5)
    theta, dtheta = trace.joints["q"][:, 0], trace.joints["dq"][:, 0]
    q = trace.joints["q_link"][:, 0]

    def rate(t, x):
        q, theta, dq, dtheta = x
        torque = k * (theta + a * math.sin(cycles * theta + phase) - q)
        slope = a * cycles * math.cos(cycles * theta + phase)
        return [dq, dtheta, (torque - pendulum.gravity(q)) / pendulum.inertia, -(1 + slope) * torque / j]

    exact = solve_ivp(rate, (0.0, 0.6), [0.8, 0.8, 0, 0], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=trace.t).y
    np.testing.assert_allclose(q, exact[0], atol=1e-9)
    np.testing.assert_allclose(theta, exact[1], atol=1e-9)
    stretch = theta + a * np.sin(cycles * theta + phase) - q
    energy = 0.5 * j * dtheta**2 + 0.5 * pendulum.inertia * exact[2] ** 2 + 0.5 * k * stretch**2
    energy = energy - pendulum.weight * np.cos(q)
    np.testing.assert_allclose(energy, energy[0], atol=1e-7)
    np.testing.assert_allclose(trace.joints["tau_link"][:, 0], k * stretch, atol=1e-5)


def test_imposed_drives_feel_the_gear_wobble(robot_with, swing):
    # power into the motor side is power out of the gear: tau theta' = T theta' (1 + de/dtheta)
    a, cycles, phase = 0.01, 20.0, 0.3
    robot = robot_with(
        "pendulum",
        joint_compliance={1: {"stiffness": 5e4, "damping": 20.0}},
        transmission_error={1: {"amplitude": a, "cycles": cycles, "phase": phase}},
    )
    law, _ = swing([0.3], [0.9], 0.3)
    trace = simulate(robot, "urdf", law, duration=0.3, step=2e-5)
    theta = trace.joints["q"][:, 0]
    slope = a * cycles * np.cos(cycles * theta + phase)
    np.testing.assert_allclose(trace.joints["tau"][:, 0], (1 + slope) * trace.joints["tau_link"][:, 0], atol=1e-9)
    # a stiff spring: q follows theta + e
    follows = theta + a * np.sin(cycles * theta + phase)
    assert np.max(np.abs(trace.joints["q_link"][:, 0] - follows)) < 5e-4


def test_a_rigid_joint_with_a_wobbling_gear_gets_the_stiff_contact_and_says_so(robot_with):
    robot = robot_with("pendulum", transmission_error={1: {"amplitude": 1e-3, "cycles": 10.0}})
    drive = robot.stages[0].drive
    assert drive.dummy and drive.spring.gap == 0.0
    assert any("contact has stiffness" in note for note in robot.notes)


def test_a_joint_spring_pulls_the_arm_and_not_the_motor(robot_with, pendulum, released):
    k, stiff, rest, j = 500.0, 20.0, 0.4, 0.3
    robot = robot_with(
        "pendulum",
        joint_compliance={1: {"stiffness": k}},
        joint_spring={1: {"stiffness": stiff, "rest": rest}},
        rotor_inertia={1: {"inertia": j}},
    )
    trace = released(robot, [0.9], duration=0.4)

    def rate(t, x):
        torque = k * (x[1] - x[0])
        arm = torque - pendulum.gravity(x[0]) - stiff * (x[0] - rest)
        return [x[2], x[3], arm / pendulum.inertia, -torque / j]

    exact = solve_ivp(rate, (0.0, 0.4), [0.9, 0.9, 0, 0], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=trace.t).y
    np.testing.assert_allclose(trace.joints["q_link"][:, 0], exact[0], atol=1e-10)
    np.testing.assert_allclose(trace.joints["tau_link"][:, 0], k * (exact[1] - exact[0]), atol=1e-7)


# -- six components ---------------------------------------------------------------------------------------------------

SIX = {"kx": 6e3, "ky": 9e3, "kz": 7e3, "krx": 500.0, "kry": 700.0, "krz": 400.0}
SIX |= {"bx": 9.0, "by": 8.0, "bz": 7.0, "brx": 0.9, "bry": 0.8, "brz": 0.7}
LEANING = {0: {"roll": -0.5, "pitch": 0.3}}


BODY = (1.2, np.array([-0.05, 0.0, 0.0]), np.diag([9e-4, 8e-3, 8e-3]))
GRAVITY = np.array([0.0, 0.0, -9.81])


def base_of(matrices):
    turn, shift = matrices
    return shift(0, 0, 1) @ turn(0, math.pi / 2) @ turn(0, LEANING[0]["roll"]) @ turn(1, LEANING[0]["pitch"])


def tips_of(frame, base, states):
    return [(np.linalg.inv(np.real(base)) @ np.real(frame(x)))[:3, 3] for x in states]


@pytest.fixture(scope="module")
def six_components(lagrangian, matrices, swing):
    """Motion law, times, angle of the arm and tip of a pendulum in a soft bearing, by Lagrange's equations."""
    turn, shift = matrices
    base = base_of(matrices)

    def frame(x):
        # the chain of the tables by hand: x = (q, dx, dy, dz, rx, ry)
        joint = base @ turn(2, x[..., 0]) @ shift(x[..., 1], x[..., 2], x[..., 3]) @ turn(0, x[..., 4])
        return joint @ turn(1, x[..., 5]) @ turn(2, -math.pi / 2) @ shift(0.5, 0, 0)

    order = ("rz", "x", "y", "z", "rx", "ry")
    k, b = (np.array([SIX[f"{letter}{axis}"] for axis in order]) for letter in "kb")
    law, formula = swing([0.2], [0.7], 0.2)
    accelerate, _, forces = lagrangian([(*BODY, frame)], GRAVITY)

    def rate(t, x):
        place, speed = (np.concatenate([values, np.zeros(5)]) for values in formula(t)[:2])
        return np.concatenate([x[6:], accelerate(x[:6], x[6:], k * (place - x[:6]) + b * (speed - x[6:]))])

    reference = np.concatenate([formula(0.0)[0], np.zeros(5)])
    rest = reference
    for _ in range(200):
        rest = reference + forces(rest) / k
    times = np.linspace(0.0, 0.1, 5)
    begin = np.concatenate([rest, np.zeros(6)])
    exact = solve_ivp(rate, (0.0, 0.1), begin, method="DOP853", rtol=1e-9, atol=1e-10, t_eval=times).y
    return law, exact[0], tips_of(frame, base, exact[:6].T)


@pytest.mark.parametrize("backend", ["urdf", "mjcf", "exudyn"])
def test_six_components_under_gravity_and_motion(robot_with, six_components, backend):
    robot = robot_with("pendulum", joint_compliance_6d={1: SIX}, base_tilt=LEANING)
    law, angle, tips = six_components
    trace = simulate(robot, backend, law, duration=0.1, rate=40.0, step=1e-4)
    np.testing.assert_allclose(trace.joints["q_link"][:, 0], angle, atol=2e-8)
    np.testing.assert_allclose(trace.tip, tips, atol=2e-8)


def test_a_bearing_that_is_soft_in_one_direction_rings_there_alone(robot_with, released):
    # the heavy direction of the paper's outlook: m x'' + kx x = m g, from rest without deflection
    k = 6e3
    robot = robot_with("pendulum", joint_compliance_6d={1: {"ky": k}}, rotor_inertia={1: {"inertia": 1e6}})
    whole = expanded(robot, imposed=False)
    assert [stage.joint.name for stage in whole.robot.stages] == ["joint_1", "joint_1_y"]
    trace = simulate(robot, "urdf", hold([0.0], 0.3), duration=0.3)
    # at rest to begin with, sagged by m g / k downwards, which is y of the hanging joint's frame
    np.testing.assert_allclose(trace.tip[:, 1] + 0.5, -1.2 * 9.81 / k, atol=1e-12)


def test_rz_of_a_bearing_is_joint_compliance(robot_with, swing):
    law, _ = swing([0.2, -0.5], [0.7, -0.9], 0.2)
    k, b = 800.0, 3.0
    as_six = robot_with("planar2r", joint_compliance_6d={1: {"krz": k, "brz": b}})
    as_one = robot_with("planar2r", joint_compliance={1: {"stiffness": k, "damping": b}})
    six, one = (simulate(robot, "urdf", law, duration=0.2) for robot in (as_six, as_one))
    np.testing.assert_array_equal(six.joints["q_link"], one.joints["q_link"])
    with pytest.raises(UsageError, match="joint_1 has joint_compliance and a finite krz"):
        robot_with("planar2r", joint_compliance={1: {"stiffness": k}}, joint_compliance_6d={1: {"krz": k}})


def test_the_drive_of_a_slide_is_in_series_with_z(robot_with, swing):
    law, _ = swing([0.0, 0.0, 0.05, 0.0], [0.3, -0.3, 0.12, 0.4], 0.2)
    k, b = 2e4, 20.0
    as_six = robot_with("scara", joint_compliance_6d={3: {"kz": k, "bz": b}})
    as_one = robot_with("scara", joint_compliance={3: {"stiffness": k, "damping": b}})
    six, one = (simulate(robot, "urdf", law, duration=0.2) for robot in (as_six, as_one))
    np.testing.assert_array_equal(six.tip, one.tip)
    # what is left of a slide's bearing turns about z last
    turning = expanded(robot_with("scara", joint_compliance_6d={3: {"kx": k, "krz": 50.0}}), imposed=True)
    assert [s.joint.name for s in turning.robot.stages][2:5] == ["joint_3", "joint_3_x", "joint_3_rz"]


# -- bending arms -----------------------------------------------------------------------------------------------------


def test_a_bent_arm_sags_as_a_hinge_with_a_spring_at_its_place(robot_with):
    # the pendulum held out level: what hangs behind the bend, over the spring
    at, kv = 0.3, 300.0
    robot = robot_with("pendulum", link_flexibility={1: {"ku": kv, "kv": kv, "at": at}})
    trace = simulate(robot, "urdf", hold([math.pi / 2], 0.1), duration=0.1)
    # the far part has (1 - at) of the mass with the arm's own center, 0.45 m from the axis; the hinge is at 0.15 m
    angle = 0.0
    for _ in range(50):
        angle = (1 - at) * 1.2 * 9.81 * 0.3 * math.cos(angle) / kv
    np.testing.assert_allclose(trace.tip, [[0.15 + 0.35 * math.cos(angle), -0.35 * math.sin(angle), 0.0]] * 101,
                               atol=1e-10)  # fmt: skip


BENDING = {"ku": 300.0, "kv": 200.0, "bu": 0.5, "bv": 0.4, "at": 0.4}
LOAD = {"mass": 0.7, "x": 0.03, "y": 0.02, "z": 0.05, "Ixx": 1e-3, "Iyy": 2e-3, "Izz": 1.5e-3}


@pytest.fixture(scope="module")
def bending(lagrangian, matrices, swing):
    """Motion law and tip of a pendulum that bends, with a payload, by Lagrange's equations."""
    turn, shift = matrices
    base = base_of(matrices)
    law, formula = swing([0.3], [1.2], 0.2)
    # e = x of the arm, u = z x e = y, v = e x u = z; u and v stand at `at` of the way from the joint to the tip
    at, whole = BENDING["at"], 0.5

    def near(x):
        return base @ turn(2, x[..., 0]) @ turn(2, -math.pi / 2) @ shift(whole, 0, 0)

    def far(x):
        hinge = base @ turn(2, x[..., 0]) @ turn(2, -math.pi / 2) @ shift(at * whole, 0, 0)
        return hinge @ turn(1, x[..., 1]) @ turn(2, x[..., 2]) @ shift((1 - at) * whole, 0, 0)

    mass, com, tensor = BODY
    load_com, load_tensor = (np.array([LOAD[axis] for axis in names]) for names in ("xyz", ("Ixx", "Iyy", "Izz")))
    bodies = [
        (at * mass, com, at * tensor, near),
        ((1 - at) * mass, com, (1 - at) * tensor, far),
        (LOAD["mass"], load_com, np.diag(load_tensor), far),
    ]
    springs = np.array([0.0, BENDING["ku"], BENDING["kv"]])
    dampers = np.array([0.0, BENDING["bu"], BENDING["bv"]])
    accelerate, mass_matrix, _ = lagrangian(bodies, GRAVITY, lambda x: 0.5 * (springs * x**2).sum(-1))

    def bent(t, x, v):
        """Accelerations of u and v with q imposed: their rows of M x'' = f, solved for x''."""
        place, speed, acceleration = formula(t)
        x, v = np.concatenate([place, x]), np.concatenate([speed, v])
        matrix = mass_matrix(x)
        free = matrix @ accelerate(x, v, -dampers * v)
        return np.linalg.solve(matrix[1:, 1:], free[1:] - matrix[1:, 0] * acceleration[0])

    rest, still = np.zeros(2), np.zeros(2)
    for _ in range(30):
        slope = [(bent(0.0, rest + 1e-6 * e, still) - bent(0.0, rest - 1e-6 * e, still)) / 2e-6 for e in np.eye(2)]
        rest = rest - np.linalg.solve(np.transpose(slope), bent(0.0, rest, still))
    times = np.linspace(0.0, 0.1, 5)
    exact = solve_ivp(
        lambda t, y: np.concatenate([y[2:], bent(t, y[:2], y[2:])]),
        (0.0, 0.1),
        np.concatenate([rest, still]),
        method="DOP853",
        rtol=1e-9,
        atol=1e-11,
        t_eval=times,
    ).y
    assert np.max(np.abs(exact[:2])) > 5e-3
    states = [np.concatenate([formula(t)[0], x]) for t, x in zip(times, exact[:2].T, strict=True)]
    return law, tips_of(far, base, states)


@pytest.mark.parametrize("backend", ["urdf", "mjcf", "exudyn"])
def test_a_bending_arm_with_a_payload_in_motion(robot_with, bending, backend):
    robot = robot_with("pendulum", link_flexibility={1: BENDING}, payload={0: LOAD}, base_tilt=LEANING)
    law, tips = bending
    trace = simulate(robot, backend, law, duration=0.1, rate=40.0, step=1e-4)
    np.testing.assert_allclose(trace.tip, tips, atol=1e-8)


def test_an_arm_without_length_cannot_bend(robot_with):
    robot = robot_with("arm7", link_flexibility={1: {"ku": 1e4, "kv": 1e4}})
    link = replace(robot.stages[0].arm.link, a=0.0, d=0.5e-6)
    stage = replace(robot.stages[0], arm=replace(robot.stages[0].arm, link=link))
    with pytest.raises(RefusedError, match="arm_1 is 5e-07 m long, too short to bend"):
        expanded(replace(robot, stages=(stage, *robot.stages[1:])), imposed=True)


def test_a_contact_on_an_arm_without_inertia_is_refused_by_name(tmp_path):
    """Published arms may have none; what stiffness a contact has by itself nobody can say there."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "robot.yaml").write_text("name: point\ninertia_check: warn\n")
    (tmp_path / "kinematics.dat").write_text("arm alpha a theta d\n1 0 0 0 0.1\n")
    (tmp_path / "inertia.dat").write_text("arm mass x y z Ixx Iyy Izz\n1 1 0 0 0 0 0 0\n")
    (tmp_path / "effects" / "backlash.dat").write_text("joint gap\n1 0.01\n")
    with pytest.raises(mbexport.UsageError, match="joint_1: a contact needs inertia on both sides"):
        mbexport.build(mbexport.load(tmp_path))
