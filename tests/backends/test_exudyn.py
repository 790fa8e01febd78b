"""Exudyn: the emitted script's model has the tables' statics, keeps RK4's order, and the drives are the common ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.backends.exudyn import ExudynBackend
from mbexport.core.control import Control
from mbexport.core.kinematics import dynamics
from mbexport.core.motion import from_table, point_to_point
from mbexport.core.representation import ArmSpring, Drive, Shape, Slip, Spring, Stick, Term
from mbexport.core.simulation.backend import Emission, MachineState

BACKEND = ExudynBackend()
PD = Control("pd", (0.0,), (0.0,))


def with_drives(robot, drives):
    return replace(robot, stages=tuple(replace(s, drive=d) for s, d in zip(robot.stages, drives, strict=True)))


def coulomb(torque):
    return Term("coulomb_friction", "level", "level", (torque,))


@pytest.fixture
def loaded(program):
    return lambda robot: BACKEND.engine_for(robot, program(robot.n))


# statics


@pytest.mark.parametrize("n", range(1, 9))
def test_statics_are_the_tables(random_robot, statics, loaded, n):
    robot = random_robot(30 + n, n)
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


def test_the_loaded_model_tells_its_drives(random_robot, loaded, soft, still):
    drives = [
        soft(0, damping=0.4, arm_springs=(ArmSpring(30.0, 0.2), ArmSpring(20.0, -0.4))),
        Drive(inertia=1.5, damping=0.6, arm_springs=(ArmSpring(8.0, 0.1),)),
        Drive(damping=0.1),
        soft(3),
    ]
    engine = loaded(with_drives(random_robot(3, 4), drives))
    q, dq, theta, dtheta = np.random.default_rng(5).normal(size=(4, 4))
    theta[[1, 2]], dtheta[[1, 2]] = q[[1, 2]], dq[[1, 2]]
    engine.reset(still(q), None)
    before = engine.state()
    on_arm, on_motor = engine.drive_torque(q, dq, theta, dtheta)
    passed = np.array([4000.0, 0.0, 0.0, 4900.0]) * (theta - q) + np.array([20.0, 0.0, 0.0, 20.0]) * (dtheta - dq)
    spring = np.array([-30.0 * (q[0] - 0.2) - 20.0 * (q[0] + 0.4), -8.0 * (q[1] - 0.1), 0.0, 0.0])
    assert np.allclose(on_arm, passed + spring, rtol=1e-12, atol=1e-10)
    assert np.allclose(on_motor, -passed - np.array([0.4, 0.6, 0.1, 0.0]) * dtheta, rtol=1e-12, atol=1e-10)
    assert np.allclose(engine.motor_inertia(), [2.0, 1.5, 0.0, 5.0], rtol=0.0, atol=1e-13)
    # asking changed nothing
    assert np.array_equal(engine.state().q, before.q)
    assert np.array_equal(engine.state().dtheta, before.dtheta)


def test_the_engine_has_what_the_text_says(random_robot, program):
    robot = random_robot(1, 2)
    emission = BACKEND.emit(robot, program(2))
    mass = f'"mass": {robot.stages[1].arm.inertia.mass!r}'
    text = emission.files[emission.main]
    assert text.count(mass) == 1
    heavier = Emission("exudyn", emission.main, {emission.main: text.replace(mass, '"mass": 77.0')}, ())
    assert BACKEND.load(heavier).mass_matrix(np.zeros(2))[0, 0] != BACKEND.load(emission).mass_matrix(np.zeros(2))[0, 0]


# motion


def free_reference(robot, start, torque, duration):
    """Elastic and rigid joints moved by constant torque, linear drives, by DOP853."""
    arms, drives = dynamics(robot), [stage.drive for stage in robot.stages]
    soft = np.array([drive.spring is not None for drive in drives])
    k = np.array([drive.spring.stiffness if drive.spring else 0.0 for drive in drives])
    b = np.array([drive.spring.damping if drive.spring else 0.0 for drive in drives])
    j, c, gain = (np.array([getattr(drive, name) for drive in drives]) for name in ("inertia", "damping", "gain"))
    pull = np.array([sum(s.stiffness for s in drive.arm_springs) for drive in drives])
    rest = np.array([sum(s.stiffness * s.rest for s in drive.arm_springs) for drive in drives])

    def slope(t, y):
        q, dq, theta, dtheta = np.split(y, 4)
        passed = k * (theta - q) + b * (dtheta - dq)
        driving = np.where(soft, passed, gain * torque - c * dq) - pull * q + rest
        inertia = arms.mass_matrix(q) + np.diag(np.where(soft, 0.0, j))
        ddq = np.linalg.solve(inertia, driving - arms.bias(q, dq))
        ddtheta = np.where(soft, (gain * torque - c * dtheta - passed) / np.where(soft, j, 1.0), ddq)
        return np.concatenate([dq, ddq, dtheta, ddtheta])

    y = np.concatenate([start.q, start.dq, start.theta, start.dtheta])
    y = solve_ivp(slope, (0.0, duration), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return np.split(y, 4)


@pytest.mark.parametrize("laws", [False, True])
def test_torque_moves_it_at_fourth_order(random_robot, loaded, still, soft, laws):
    # a law of no friction sends all drives through the equations at every stage
    terms = (coulomb(0.0),) if laws else ()
    drives = [
        soft(0, damping=0.4, gain=0.8, terms=terms),
        Drive(inertia=1.5, damping=0.6, arm_springs=(ArmSpring(30.0, 0.2), ArmSpring(10.0, -0.1))),
        soft(2, arm_springs=(ArmSpring(40.0, 0.3),)),
    ]
    robot = with_drives(random_robot(40, 3), drives)
    engine = loaded(robot)
    start, torque = still([0.2, -0.1, 0.3]), np.array([15.0, -8.0, 12.0])
    expected = free_reference(robot, start, torque, 0.2)
    errors = []
    for steps in (2, 4):
        engine.reset(start, None)
        engine.hold(torque)
        for _ in range(40):
            engine.advance(0.005, steps)
        state = engine.state()
        errors.append(max(np.max(np.abs(state.q - expected[0])), np.max(np.abs(state.theta - expected[2]))))
    assert state.t == pytest.approx(0.2, abs=1e-12)
    assert errors[1] < 1e-7
    assert 3.5 < np.log2(errors[0] / errors[1]) < 4.8


def imposed_reference(robot, law, q, duration):
    """Arm sides of elastic joints while the motor sides follow a law, piece by piece, by DOP853."""
    arms, drives = dynamics(robot), [stage.drive for stage in robot.stages]
    soft = np.array([drive.spring is not None for drive in drives])
    k = np.array([drive.spring.stiffness if drive.spring else 0.0 for drive in drives])
    b = np.array([drive.spring.damping if drive.spring else 0.0 for drive in drives])

    def slope(t, y):
        theta, dtheta, ddtheta = law.at(t)
        q, dq = theta.copy(), dtheta.copy()
        q[soft], dq[soft] = np.split(y, 2)
        matrix = arms.mass_matrix(q)
        torque = (k * (theta - q) + b * (dtheta - dq) - arms.bias(q, dq))[soft]
        torque -= matrix[np.ix_(soft, ~soft)] @ ddtheta[~soft]
        return np.concatenate([dq[soft], np.linalg.solve(matrix[np.ix_(soft, soft)], torque)])

    y, t = np.concatenate([q[soft], np.zeros(soft.sum())]), 0.0
    for end in [*law.knots[(law.knots > 0.0) & (law.knots < duration)], duration]:
        y = solve_ivp(slope, (t, np.nextafter(end, 0.0)), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        t = end
    theta, dtheta, _ = law.at(duration)
    theta[soft], dtheta[soft] = np.split(y, 2)
    return theta, dtheta


@pytest.mark.parametrize("rigid", [(), (0, 2)])
def test_imposed_motion_keeps_the_order_over_knots(random_robot, loaded, soft, rigid):
    robot = with_drives(random_robot(41, 4), [Drive(inertia=3.0) if i in rigid else soft(i) for i in range(4)])
    # Akima: the acceleration jumps at the knots
    law = from_table(np.linspace(0.0, 0.3, 7), 0.3 * np.random.default_rng(2).normal(size=(7, 4)))
    theta, dtheta, _ = law.at(0.0)
    start = MachineState(0.0, theta.copy(), np.where([i in rigid for i in range(4)], dtheta, 0.0), theta, dtheta)
    engine = loaded(robot)
    q, dq = imposed_reference(robot, law, theta, 0.28)
    errors = []
    for steps in (2, 4):
        engine.reset(start, law)
        for _ in range(56):
            engine.advance(0.005, steps)
        state = engine.state()
        errors.append(max(np.max(np.abs(state.q - q)), 1e-2 * np.max(np.abs(state.dq - dq))))
        assert np.allclose(state.theta, law.at(0.28)[0], rtol=0.0, atol=1e-13)
        assert np.array_equal(state.q[list(rigid)], state.theta[list(rigid)])
    assert errors[1] < 1e-6
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_energy_is_kept(random_robot, loaded, still, statics):
    drives = [Drive(inertia=2.0, spring=Spring(4.0e3)), Drive(inertia=1.0), Drive(arm_springs=(ArmSpring(50.0, 0.1),))]
    robot = with_drives(random_robot(42, 3, revolute_only=True), drives)
    engine = loaded(robot)

    def energy(state):
        # gravity's work along the way, from its torques, by Gauss-Legendre on a straight path
        nodes, weights = np.polynomial.legendre.leggauss(40)
        path = 0.5 * (nodes + 1.0)
        work = sum(0.5 * w * engine.gravity(s * state.q) @ state.q for s, w in zip(path, weights, strict=True))
        kinetic = 0.5 * state.dq @ statics(robot, state.q)[1] @ state.dq
        rotors = 0.5 * 2.0 * state.dtheta[0] ** 2 + 0.5 * 1.0 * state.dq[1] ** 2
        springs = 2.0e3 * (state.theta[0] - state.q[0]) ** 2 + 25.0 * (state.q[2] - 0.1) ** 2
        return work + kinetic + rotors + springs

    engine.reset(still([0.3, 0.2, -0.4]), None)
    first = energy(engine.state())
    for _ in range(100):
        engine.advance(0.005, 10)
    assert np.max(np.abs(engine.state().q - [0.3, 0.2, -0.4])) > 0.3
    assert energy(engine.state()) == pytest.approx(first, abs=1e-7)


# friction


def pendulum(random_robot, drive):
    """One revolute joint without gravity, its inertia about the axis, and the drive."""
    robot = replace(with_drives(random_robot(6, 1, revolute_only=True), [drive]), gravity=(0.0, 0.0, 0.0))
    return robot, float(dynamics(robot).mass_matrix(np.zeros(1))[0, 0])


def test_a_stuck_joint_holds_and_slips_at_its_level(random_robot, loaded, still):
    robot, inertia = pendulum(random_robot, Drive(terms=(coulomb(5.0),), stick=Stick(5e-6, 4e-3)))
    engine = loaded(robot)
    engine.reset(still([0.0]), None)
    engine.hold(np.array([4.0]))
    engine.advance(0.5, 5000)
    assert engine.state().q[0] == pytest.approx(4e-6, rel=1e-6)
    assert engine.friction()[0] == pytest.approx(4.0, rel=1e-9)
    engine.hold(np.array([7.0]))
    engine.advance(0.5, 5000)
    assert engine.state().dq[0] == pytest.approx(0.5 * 2.0 / inertia, rel=1e-3)
    assert engine.friction()[0] == pytest.approx(5.0, rel=1e-12)
    # back at rest it holds again where it stands
    engine.hold(np.zeros(1))
    engine.advance(1.0, 10000)
    stood = engine.state().q[0]
    engine.advance(0.5, 5000)
    assert engine.state().q[0] == pytest.approx(stood, abs=1e-9)


def test_slip_elements_remember_what_is_accepted(random_robot, loaded):
    drive = Drive(inertia=1.0, spring=Spring(4.0e3, 20.0), slips=(Slip(100.0, 2.0),))
    robot, _ = pendulum(random_robot, drive)
    engine = loaded(robot)
    law = from_table([0.0, 0.1, 0.2], [[0.0], [0.1], [0.06]], [[0.0], [0.0], [0.0]])
    engine.reset(MachineState(0.0, *(np.zeros(1) for _ in range(4))), law)
    engine.advance(0.1, 100)
    assert engine.friction()[0] == pytest.approx(2.0, rel=1e-12)
    engine.advance(0.1, 100)
    # it stuck at 0.08 and went back by 0.04
    assert engine.friction()[0] == pytest.approx(2.0 - 100.0 * 0.04, rel=1e-9)


def test_friction_under_load_is_solved_with_the_acceleration(random_robot, loaded, still):
    terms = (Term("load_friction", "level", "level", (0.25,)),)
    robot, inertia = pendulum(random_robot, Drive(inertia=0.8, terms=terms, stick=Stick(5e-6, 1e-3)))
    engine = loaded(robot)
    engine.reset(replace_speed(still([0.0]), 1.0), None)
    engine.hold(np.array([12.0]))
    engine.advance(0.2, 2000)
    # sliding forwards: T = M a, 12 - T / 4 - 0.8 a = T
    acceleration = 12.0 / (1.25 * inertia + 0.8)
    assert engine.state().dq[0] == pytest.approx(1.0 + 0.2 * acceleration, rel=1e-4)
    assert engine.friction()[0] == pytest.approx(0.25 * inertia * acceleration, rel=1e-9)


def replace_speed(state, speed):
    state.dq[:] = state.dtheta[:] = speed
    return state


# the process


def test_runs_repeat_and_do_not_mix(random_robot, loaded, still, soft):
    drives = [soft(i, terms=(coulomb(2.0),), stick=Stick(1e-4, 1e-2)) for i in range(3)]
    engines = [loaded(with_drives(random_robot(seed, 3), drives)) for seed in (51, 52)]
    torque = np.array([9.0, -4.0, 3.0])

    def run(engine):
        engine.reset(still([0.1, 0.2, 0.3]), None)
        for k in range(10):
            engine.hold(torque * np.cos(k))
            engine.advance(0.002, 2)
            yield engine.state().q

    alone = [list(run(engine)) for engine in engines]
    together = list(zip(*(run(engine) for engine in engines), strict=True))
    for k, states in enumerate(together):
        for which, q in enumerate(states):
            assert np.array_equal(q, alone[which][k])
    for engine in engines:
        engine.close()


def test_it_neither_prints_nor_writes(random_robot, loaded, still, soft, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    engine = loaded(with_drives(random_robot(8, 2), [soft(0, terms=(coulomb(1.0),), stick=Stick(1e-4, 1e-2)), soft(1)]))
    engine.reset(still([0.0, 0.0]), None)
    engine.advance(1.0, 20000)
    engine.reset(still([0.0, 0.0]), point_to_point([0.0, 0.0], [0.1, 0.1], 1.0))
    engine.advance(0.1, 100)
    engine.close()
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_explodes_ends_in_a_state_that_is_not_finite_or_an_error(random_robot, loaded, still):
    robot, _ = pendulum(random_robot, Drive(damping=1e6))
    engine = loaded(robot)
    engine.reset(replace_speed(still([0.0]), 1.0), None)
    try:
        engine.advance(1.0, 100)
    except Exception as error:
        assert type(error).__name__ == "RefusedError"
    else:
        assert not np.isfinite(engine.state().q).all()


def test_shapes_are_drawn_and_weigh_nothing(random_robot, program):
    robot = random_robot(9, 3)
    shapes = (Shape("box", (0.1, 0.2, 0.3)), Shape("cylinder", (0.05, 0.2)), Shape("sphere", (0.1,)))
    mesh = Shape("mesh", (1.0, 1.0, 1.0), mesh="arm.obj")
    stages = [replace(s, arm=replace(s.arm, shapes=shapes)) for s in robot.stages]
    drawn = replace(robot, stages=tuple(stages))
    emission = BACKEND.emit(drawn, program(3))
    script = BACKEND.load(emission)._script
    assert [len(list_) for list_ in script["graphics"]()] == [3, 3, 3]
    seen, zero = script["build"]("none", view=True), np.zeros(3)
    matrix = script["mass_matrix_and_bias"](seen, zero, zero)[0]
    assert np.array_equal(matrix, BACKEND.engine_for(robot, program(3)).mass_matrix(zero))
    stages[0] = replace(stages[0], arm=replace(stages[0].arm, shapes=(mesh,)))
    concepts = BACKEND.emit(replace(drawn, stages=tuple(stages)), program(3)).concepts
    assert [(c.at, c.status) for c in concepts if c.datum == "shapes" and c.status != "exact"] == [
        ("arm_1", "impossible")
    ]
