"""PyBullet: what it does unasked is off, what it lacks is added, and it converges at its own order to the truth."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.backends.pybullet import PybulletBackend
from mbexport.backends.urdf_text import within_triangle
from mbexport.core.errors import RefusedError
from mbexport.core.kinematics import dynamics
from mbexport.core.motion import from_table
from mbexport.core.representation import ArmSpring, Drive, Inertia, Pose, Slip, Spring, Stick, Term
from mbexport.core.simulation.backend import Emission, MachineState

BACKEND = PybulletBackend()


def with_drives(robot, drives):
    return replace(robot, stages=tuple(replace(s, drive=d) for s, d in zip(robot.stages, drives, strict=True)))


def with_arm(robot, i, **changes):
    stages = list(robot.stages)
    stages[i] = replace(stages[i], arm=replace(stages[i].arm, **changes))
    return replace(robot, stages=tuple(stages))


def with_joint(robot, i, **changes):
    stages = list(robot.stages)
    stages[i] = replace(stages[i], joint=replace(stages[i].joint, **changes))
    return replace(robot, stages=tuple(stages))


@pytest.fixture
def loaded(program):
    engines = []

    def load(robot):
        engines.append(BACKEND.engine_for(robot, program(robot.n)))
        return engines[-1]

    yield load
    for engine in engines:
        engine.close()


# statics


@pytest.mark.parametrize("n", range(1, 9))
def test_statics_are_the_tables(random_robot, statics, loaded, n):
    robot = random_robot(60 + n, n)
    engine = loaded(robot)
    q, dq, ddq = np.random.default_rng(n).uniform(-2.0, 2.0, (3, n))
    tool, matrix, torque = statics(robot, q)
    assert np.allclose(engine.tool_in_base(q), tool, rtol=0.0, atol=1e-13)
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    assert np.max(np.abs(engine.mass_matrix(q) - matrix) / scale) < 1e-12
    assert np.max(np.abs(engine.gravity(q) - torque)) < 1e-12 * np.max(np.abs(torque))
    bias = dynamics(robot).bias(q, dq)
    assert np.max(np.abs(engine.bias(q, dq) - bias)) < 1e-12 * np.max(np.abs(bias))
    moving = matrix @ ddq + bias
    assert np.max(np.abs(engine.inverse_dynamics(q, dq, ddq) - moving)) < 1e-12 * np.max(np.abs(moving))


@pytest.mark.parametrize("shape", ["flat", "thin"])
def test_flat_and_thin_bodies_keep_their_inertia(random_robot, statics, loaded, shape):
    # turned, rounding breaks the triangle of half of the flat ones, and makes moments of thin ones negative
    rng = np.random.default_rng(8)
    robot = random_robot(71, 2, revolute_only=True)
    for _ in range(10):
        turn = Pose.from_rpy((0.0, 0.0, 0.0), tuple(rng.uniform(-2.0, 2.0, 3))).rotation_matrix()
        a, b = (0.3, 0.4) if shape == "flat" else (0.0, 0.4)
        tensor = turn @ np.diag([a, b, a + b]) @ turn.T
        body = with_arm(robot, 1, inertia=Inertia.from_tensor(1.0, np.zeros(3), (tensor + tensor.T) / 2))
        q = rng.normal(size=2)
        assert np.allclose(loaded(body).mass_matrix(q), statics(body, q)[1], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("inertia", [(0.0, 0.0, 0.0), (0.0, 30.0, 30.0), (1.0, 2.0, 3.0), (20.0, 30.0, 40.0)])
def test_heavy_and_flat_bodies_away_from_the_joint(random_robot, statics, loaded, inertia):
    # PyBullet checks tensors about the joint to the last digit: rounding must not make a robot of this kind unusable
    rng = np.random.default_rng(9)
    robot = random_robot(73, 3)
    for _ in range(10):
        robot = with_arm(robot, 0, inertia=Inertia(300.0, tuple(rng.uniform(-0.7, 0.7, 3)), *inertia))
        robot = with_arm(robot, 2, inertia=Inertia(2.0, (*rng.uniform(-0.7, 0.7, 2), 0.0), *inertia))
        engine, q = loaded(robot), rng.normal(size=3)
        tool, matrix, torque = statics(robot, q)
        assert np.allclose(engine.mass_matrix(q), matrix, rtol=1e-12, atol=1e-11)
        assert np.allclose(engine.gravity(q), torque, rtol=1e-12, atol=1e-10)
        assert np.allclose(engine.tool_in_base(q), tool, rtol=0.0, atol=1e-13)
        engine.reset(MachineState(0.0, q, np.zeros(3), q.copy(), np.zeros(3)), None)
        engine.advance(1e-6, 1)
        assert np.allclose(engine.state().dq / 1e-6, -np.linalg.solve(matrix, torque), rtol=1e-6)


def test_only_rounding_is_taken_back():
    assert within_triangle((1.0, 2.0, 3.0 + 1e-12)) == (1.0, 2.0, 3.0)
    assert within_triangle((1.0, 2.0, 3.1)) == (1.0, 2.0, 3.1)
    assert within_triangle((-1e-17, 2.0, 2.0)) == (0.0, 2.0, 2.0)
    assert within_triangle((-0.1, 2.0, 2.0)) == (-0.1, 2.0, 2.0)


@pytest.mark.parametrize("moments", [(0.1, 0.1, 0.5), (-0.1, 0.3, 0.3)])
def test_inertia_that_would_be_set_to_zero_is_refused_by_name(random_robot, loaded, moments):
    with pytest.raises(RefusedError, match=r"arm_2.*0\.[35]"):
        loaded(with_arm(random_robot(1, 3), 1, inertia=Inertia(1.0, (0.0, 0.0, 0.0), *moments)))


@pytest.mark.parametrize("inertia", [Inertia(), Inertia(1e-9, (0.1, 0.0, 0.0), 1e-12, 1e-12, 1e-12), Inertia(2.0)])
def test_arms_of_little_or_no_mass_stay_what_they_are(random_robot, statics, loaded, still, inertia):
    robot = with_arm(random_robot(72, 3), 1, inertia=inertia)
    engine = loaded(robot)
    q = np.array([0.4, -0.3, 0.2])
    _, matrix, torque = statics(robot, q)
    assert np.allclose(engine.mass_matrix(q), matrix, rtol=1e-11, atol=1e-13)
    engine.reset(still(q), None)
    engine.advance(1e-6, 1)
    assert np.allclose(engine.state().dq / 1e-6, -np.linalg.solve(matrix, torque), rtol=1e-7)


# what PyBullet does unasked


def straight_pendulum(random_robot, **changes):
    """One revolute joint in no gravity."""
    robot = replace(random_robot(6, 1, revolute_only=True), gravity=(0.0, 0.0, 0.0))
    return with_joint(robot, 0, **changes)


def moving(speed):
    return MachineState(0.0, np.zeros(1), np.array([speed]), np.zeros(1), np.array([speed]))


def test_nothing_brakes_or_stops_a_free_joint(random_robot, loaded):
    # URDF limits of position, speed and effort, all left behind; 100 rad/s is PyBullet's own limit of speed
    limits = {"lower": -0.5, "upper": 0.5, "velocity": 1.0, "effort": 1.0}
    engine = loaded(straight_pendulum(random_robot, **limits))
    engine.reset(moving(150.0), None)
    engine.advance(1.0, 10000)
    assert engine.state().dq[0] == pytest.approx(150.0, rel=1e-12)
    assert engine.state().q[0] == pytest.approx(150.0, rel=1e-10)


def test_a_joint_at_rest_does_not_sleep(random_robot, loaded, still):
    engine = loaded(straight_pendulum(random_robot))
    engine.reset(still([0.0]), None)
    engine.advance(5.0, 5000)
    engine.hold(np.array([1e-6]))
    engine.advance(1.0, 1000)
    assert engine.state().dq[0] > 0.0


def test_damping_acts_once_and_friction_as_its_law(random_robot, loaded):
    # both stand in the URDF too
    term = Term("coulomb_friction", "level", "level", (3.0,))
    robot = with_drives(straight_pendulum(random_robot), [Drive(damping=2.0, terms=(term,), stick=Stick(1e-5, 1e-3))])
    inertia = float(dynamics(robot).mass_matrix(np.zeros(1))[0, 0])
    engine = loaded(robot)
    engine.reset(moving(20.0), None)
    engine.advance(0.1, 2000)
    # J q'' = -2 q' - 3
    assert engine.state().dq[0] == pytest.approx(21.5 * math.exp(-0.2 / inertia) - 1.5, rel=1e-4)
    assert engine.friction()[0] == pytest.approx(2.0 * engine.state().dq[0] + 3.0, rel=1e-12)


def test_a_file_of_the_same_name_is_read_anew(random_robot, program):
    robots = [random_robot(3, 2), with_arm(random_robot(3, 2), 1, inertia=Inertia(5.0, (0.1, 0.0, 0.0), 0.2, 0.2, 0.2))]
    engines = [BACKEND.engine_for(robot, program(2)) for robot in robots]
    assert engines[0]._script["URDF"] == engines[1]._script["URDF"]
    for engine, robot in zip(engines, robots, strict=True):
        assert np.allclose(engine.mass_matrix(np.zeros(2)), dynamics(robot).mass_matrix(np.zeros(2)), rtol=1e-12)
        engine.close()


def test_the_urdf_counts(random_robot, program):
    robot = random_robot(3, 2)
    emission = BACKEND.emit(robot, program(2))
    mass = f'<mass value="{robot.stages[1].arm.inertia.mass!r}"/>'
    model = f"{robot.name}.urdf"
    assert emission.files[model].count(mass) == 1
    files = {**emission.files, model: emission.files[model].replace(mass, '<mass value="7.0"/>')}
    heavier, as_it_was = BACKEND.load(Emission("pybullet", emission.main, files, ())), BACKEND.load(emission)
    assert heavier.gravity(np.zeros(2))[0] != as_it_was.gravity(np.zeros(2))[0]
    heavier.close()
    as_it_was.close()


def test_a_file_that_is_no_urdf_is_refused(random_robot, program):
    emission = BACKEND.emit(random_robot(3, 2), program(2))
    with pytest.raises(RefusedError, match="urdf"):
        BACKEND.load(Emission("pybullet", emission.main, {**emission.files, "random.urdf": "<robot"}, ()))


def test_a_body_that_its_inverse_dynamics_refuses_is_refused(random_robot, loaded, monkeypatch):
    # without a link of its own: a third of such bodies
    monkeypatch.setattr("mbexport.backends.pybullet._hung", lambda robot: ())
    rng, refused = np.random.default_rng(9), 0
    for _ in range(10):
        body = Inertia(300.0, tuple(rng.uniform(-0.7, 0.7, 3)), 20.0, 30.0, 40.0)
        try:
            loaded(with_arm(random_robot(73, 2), 0, inertia=body))
        except RefusedError as error:
            assert "urdf" in str(error)
            refused += 1
    assert refused > 0


# convergence


def run(engine, start, law, torque, duration, steps):
    engine.reset(start, law)
    if law is None:
        engine.hold(torque)
    for _ in range(10):
        engine.advance(duration / 10, steps // 10)
    return engine.state()


def check_first_order(engine, start, law, torque, duration, expected):
    coarse, middle, fine = (run(engine, start, law, torque, duration, steps).q for steps in (500, 1000, 2000))
    errors = [np.max(np.abs(q - expected)) for q in (coarse, middle, fine)]
    for bigger, smaller in pairwise(errors):
        assert 0.9 < np.log2(bigger / smaller) < 1.1
    # Richardson's extrapolation leaves the second order
    assert np.max(np.abs(2.0 * fine - middle - expected)) < 1e-2 * errors[-1] + 1e-9


@pytest.mark.parametrize("rigid", [(), (1,), (0, 1, 2)])
def test_torque_moves_it_at_first_order(random_robot, loaded, still, soft, rigid):
    springs = (ArmSpring(30.0, 0.2), ArmSpring(10.0, -0.1))
    drives = [
        Drive(inertia=1.5, damping=0.6, gain=0.8, arm_springs=springs) if i in rigid else soft(i, damping=0.4, gain=0.8)
        for i in range(3)
    ]
    robot = with_drives(random_robot(40, 3), drives)
    arms, start, torque = dynamics(robot), still([0.2, -0.1, 0.3]), np.array([15.0, -8.0, 12.0])
    is_soft = np.array([i not in rigid for i in range(3)])
    k, b, c = (np.where(is_soft, x, 0.0) for x in (4.0e3 + 300.0 * np.arange(3), 20.0, 0.4))
    c, j = np.where(is_soft, c, 0.6), np.where(is_soft, 2.0 + np.arange(3), 1.5)

    def slope(t, y):
        q, dq, theta, dtheta = np.split(y, 4)
        passed = k * (theta - q) + b * (dtheta - dq)
        spring = np.where(is_soft, 0.0, -40.0 * q + 5.0)
        driving = np.where(is_soft, passed, 0.8 * torque - c * dq) + spring
        inertia = arms.mass_matrix(q) + np.diag(np.where(is_soft, 0.0, j))
        ddq = np.linalg.solve(inertia, driving - arms.bias(q, dq))
        return np.concatenate([dq, ddq, dtheta, np.where(is_soft, (0.8 * torque - c * dtheta - passed) / j, ddq)])

    y = np.concatenate([start.q, start.dq, start.theta, start.dtheta])
    expected = solve_ivp(slope, (0.0, 0.1), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:3, -1]
    check_first_order(loaded(robot), start, None, torque, 0.1, expected)


@pytest.mark.parametrize("rigid", [(), (0, 2)])
def test_imposed_motion_is_followed_at_first_order(random_robot, loaded, soft, rigid):
    robot = with_drives(random_robot(41, 4), [Drive(inertia=3.0) if i in rigid else soft(i) for i in range(4)])
    knots = np.linspace(0.0, 0.1, 5)
    law = from_table(knots, 0.1 * np.random.default_rng(2).normal(size=(5, 4)))
    arms, is_soft = dynamics(robot), np.array([i not in rigid for i in range(4)])
    k, b = np.where(is_soft, 4.0e3 + 300.0 * np.arange(4), 0.0), np.where(is_soft, 20.0, 0.0)

    def slope(t, y):
        theta, dtheta, ddtheta = law.at(t)
        q, dq = theta.copy(), dtheta.copy()
        q[is_soft], dq[is_soft] = np.split(y, 2)
        matrix = arms.mass_matrix(q)
        torque = (k * (theta - q) + b * (dtheta - dq) - arms.bias(q, dq))[is_soft]
        torque -= matrix[np.ix_(is_soft, ~is_soft)] @ ddtheta[~is_soft]
        return np.concatenate([dq[is_soft], np.linalg.solve(matrix[np.ix_(is_soft, is_soft)], torque)])

    theta, dtheta, _ = law.at(0.0)
    y, t = np.concatenate([theta[is_soft], np.zeros(is_soft.sum())]), 0.0
    for end in knots[1:]:
        y = solve_ivp(slope, (t, np.nextafter(end, 0.0)), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        t = end
    expected = law.at(0.1)[0]
    expected[is_soft] = y[: is_soft.sum()]
    start = MachineState(0.0, theta.copy(), np.where(is_soft, 0.0, dtheta), theta, dtheta)
    engine = loaded(robot)
    check_first_order(engine, start, law, None, 0.1, expected)
    state = engine.state()
    assert np.allclose(state.theta, law.at(0.1)[0], rtol=0.0, atol=1e-14)
    assert np.array_equal(state.q[~is_soft], state.theta[~is_soft])


# friction


def test_a_stuck_joint_holds_and_slips_at_its_level(random_robot, loaded, still):
    term = Term("coulomb_friction", "level", "level", (5.0,))
    robot = with_drives(straight_pendulum(random_robot), [Drive(inertia=1.0, terms=(term,), stick=Stick(5e-6, 4e-3))])
    inertia = float(dynamics(robot).mass_matrix(np.zeros(1))[0, 0])
    engine = loaded(robot)
    engine.reset(still([0.0]), None)
    engine.hold(np.array([4.0]))
    engine.advance(0.5, 5000)
    assert engine.state().q[0] == pytest.approx(4e-6, rel=1e-6)
    assert engine.friction()[0] == pytest.approx(4.0, rel=1e-9)
    engine.hold(np.array([7.0]))
    engine.advance(0.5, 5000)
    assert engine.state().dq[0] == pytest.approx(0.5 * 2.0 / (inertia + 1.0), rel=1e-3)


def test_slip_elements_remember_what_is_accepted(random_robot, loaded):
    drive = Drive(inertia=1.0, spring=Spring(4.0e3, 20.0), slips=(Slip(100.0, 2.0),))
    engine = loaded(with_drives(straight_pendulum(random_robot), [drive]))
    law = from_table([0.0, 0.1, 0.2], [[0.0], [0.1], [0.06]], [[0.0], [0.0], [0.0]])
    engine.reset(MachineState(0.0, *(np.zeros(1) for _ in range(4))), law)
    engine.advance(0.1, 1000)
    assert engine.friction()[0] == pytest.approx(2.0, rel=1e-12)
    engine.advance(0.1, 1000)
    # it stuck at 0.08 and went back by 0.04
    assert engine.friction()[0] == pytest.approx(2.0 - 100.0 * 0.04, rel=1e-6)


def test_friction_under_load_is_solved_with_the_acceleration(random_robot, loaded):
    terms = (Term("load_friction", "level", "level", (0.25,)),)
    drive = Drive(inertia=0.8, terms=terms, stick=Stick(5e-6, 1e-3))
    robot = with_drives(straight_pendulum(random_robot), [drive])
    inertia = float(dynamics(robot).mass_matrix(np.zeros(1))[0, 0])
    engine = loaded(robot)
    engine.reset(moving(1.0), None)
    engine.hold(np.array([12.0]))
    engine.advance(0.2, 2000)
    # sliding forwards: T = M a, 12 - T / 4 - 0.8 a = T
    acceleration = 12.0 / (1.25 * inertia + 0.8)
    assert engine.state().dq[0] == pytest.approx(1.0 + 0.2 * acceleration, rel=1e-4)
    assert engine.friction()[0] == pytest.approx(0.25 * inertia * acceleration, rel=1e-9)


# the process


def test_engines_do_not_mix_and_go_when_closed(random_robot, program, still, soft):
    torque = np.array([9.0, -4.0, 3.0])

    def run_slowly(engine):
        engine.reset(still([0.1, 0.2, 0.3]), None)
        for k in range(10):
            engine.hold(torque * np.cos(k))
            engine.advance(0.002, 20)
            yield engine.state().q

    robots = [with_drives(random_robot(seed, 3), [soft(i) for i in range(3)]) for seed in (51, 52)]
    engines = [BACKEND.engine_for(robot, program(3)) for robot in robots]
    alone = [list(run_slowly(engine)) for engine in engines]
    together = list(zip(*(run_slowly(engine) for engine in engines), strict=True))
    for k, states in enumerate(together):
        for which, q in enumerate(states):
            assert np.array_equal(q, alone[which][k])
    bullet, clients = engines[0]._bullet, [engine._client for engine in engines]
    assert len(set(clients)) == 2
    for engine in engines:
        engine.close()
        engine.close()
    assert not any(bullet.isConnected(client) for client in clients)


def test_it_neither_prints_nor_leaves_files(random_robot, loaded, still, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    streams = Path("/proc/self/fd")
    before = len(list(streams.iterdir())) if streams.exists() else 0
    engine = loaded(random_robot(8, 2))
    engine.reset(still([0.0, 0.0]), None)
    engine.advance(0.1, 1000)
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []
    assert not streams.exists() or len(list(streams.iterdir())) == before


def test_a_motion_that_explodes_is_refused(random_robot, loaded):
    engine = loaded(with_drives(straight_pendulum(random_robot), [Drive(damping=1e6)]))
    engine.reset(moving(1.0), None)
    with pytest.raises(RefusedError, match="finite"):
        engine.advance(1.0, 1000)
