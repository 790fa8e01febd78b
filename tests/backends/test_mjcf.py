"""MJCF in MuJoCo: numbers survive MuJoCo's compiler, drives are the common ones, and the process stays clean."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.backends.mjcf import MjcfBackend
from mbexport.backends.mujoco_engine import MujocoEngine
from mbexport.core.control import Control
from mbexport.core.errors import RefusedError
from mbexport.core.kinematics import dynamics, kinematics
from mbexport.core.motion import from_table
from mbexport.core.representation import (
    ArmSpring,
    Drive,
    FrictionModel,
    Inertia,
    Joint,
    Pose,
    Sensor,
    Shape,
    Slip,
    Spring,
    Stick,
    Term,
)
from mbexport.core.simulation.backend import Emission, MachineState

BACKEND = MjcfBackend()


def coulomb(torque):
    return Term("coulomb_friction", "level", "level", (torque,))


def with_drives(robot, drives):
    return replace(robot, stages=tuple(replace(s, drive=d) for s, d in zip(robot.stages, drives, strict=True)))


def with_arm(robot, i, **changes):
    stages = list(robot.stages)
    stages[i] = replace(stages[i], arm=replace(stages[i].arm, **changes))
    return replace(robot, stages=tuple(stages))


def edited(emission, old, new):
    text = emission.files[emission.main]
    assert old in text
    return Emission(emission.backend, emission.main, {**emission.files, emission.main: text.replace(old, new)}, ())


@pytest.fixture
def loaded(program):
    return lambda robot, control=None: BACKEND.engine_for(robot, program(robot.n, control))


# statics


@pytest.mark.parametrize("n", range(1, 9))
def test_statics_are_the_tables(random_robot, statics, loaded, n):
    robot = random_robot(n, n)
    engine = loaded(robot)
    q = np.random.default_rng(100 + n).uniform(-2.0, 2.0, n)
    tool, matrix, torque = statics(robot, q)
    assert np.allclose(engine.tool_in_base(q), tool, rtol=0.0, atol=1e-13)
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    assert np.max(np.abs(engine.mass_matrix(q) - matrix) / scale) < 1e-11
    assert np.max(np.abs(engine.gravity(q) - torque)) < 1e-12 * np.max(np.abs(torque))


def test_statics_are_of_the_arms_alone(random_robot, statics, loaded, soft):
    robot = random_robot(3, 5, soft)
    engine = loaded(robot)
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 5))
    _, matrix, torque = statics(robot, q)
    assert np.allclose(engine.mass_matrix(q), matrix, rtol=1e-11, atol=1e-11)
    assert np.allclose(engine.gravity(q), torque, rtol=1e-12, atol=1e-12)
    with_motion = engine.inverse_dynamics(q, dq, ddq)
    assert np.allclose(with_motion, matrix @ ddq + engine.bias(q, dq), rtol=1e-11, atol=1e-11)
    assert np.allclose(engine.motor_inertia(), [2.0, 3.0, 4.0, 5.0, 6.0], rtol=0.0, atol=0.0)


def test_inertias_survive_the_compiler(random_robot, program):
    robot = random_robot(5, 6)
    emission = BACKEND.emit(robot, program(6))
    model = mujoco.MjModel.from_xml_string(emission.files[emission.main])
    for i in range(6):
        body = model.body(f"arm_{i + 1}").id
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, model.body_iquat[body])
        axes = axes.reshape(3, 3)
        inertia = robot.inertia_in_joint(i)
        tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
        assert np.max(np.abs(tensor - inertia.tensor())) < 2e-15 * np.max(np.abs(inertia.tensor()))
        assert model.body_mass[body] == inertia.mass
        assert np.array_equal(model.body_ipos[body], inertia.com)


def test_flat_bodies_are_not_refused_for_their_last_digit(random_robot, loaded):
    # a + b = c exactly: turned, rounding breaks the triangle in a third of the cases
    rng = np.random.default_rng(8)
    robot = random_robot(1, 2, revolute_only=True)
    for _ in range(20):
        half = rng.normal(size=(3, 2))
        second = half @ half.T
        tensor = np.trace(second) * np.eye(3) - second
        flat = with_arm(robot, 1, inertia=Inertia.from_tensor(1.0, np.zeros(3), (tensor + tensor.T) / 2))
        loaded(flat)


def test_the_tool_is_where_the_tables_say_at_many_positions(random_robot, loaded):
    """On a base that is turned, in one call as in many."""
    robot = replace(random_robot(17, 5), base=Pose.from_rpy((0.3, -0.2, 0.9), (0.4, -0.7, 1.1)))
    engine = loaded(robot)
    q = np.random.default_rng(17).uniform(-1.0, 1.0, (40, 5))
    many = engine.tools_in_base(q)
    np.testing.assert_allclose(many, kinematics(robot).tool_in_base(q), rtol=0, atol=1e-12)
    assert np.array_equal(many, [engine.tool_in_base(row) for row in q])


@pytest.mark.parametrize(
    "inertia", [Inertia(0.0, (0.0, 0.0, 0.0), 0.3, 0.3, 0.4), Inertia(1.0, (0.0, 0.0, 0.0), 0.1, 0.1, 0.5)]
)
def test_impossible_bodies_are_refused_by_name(random_robot, loaded, inertia):
    with pytest.raises(RefusedError, match="arm_2"):
        loaded(with_arm(random_robot(1, 3), 1, inertia=inertia))


def test_joints_of_massless_arms_share_a_body(random_robot, statics, loaded):
    robot = random_robot(6, 6)
    for i in (0, 2, 3):
        robot = with_arm(robot, i, inertia=Inertia())
    q = np.random.default_rng(1).uniform(-1.0, 1.0, 6)
    tool, matrix, torque = statics(robot, q)
    engine = loaded(robot)
    assert np.allclose(engine.tool_in_base(q), tool, rtol=0.0, atol=1e-13)
    assert np.allclose(engine.mass_matrix(q), matrix, rtol=1e-11, atol=1e-11)
    assert np.allclose(engine.gravity(q), torque, rtol=1e-11, atol=1e-11)


def test_more_massless_arms_than_a_body_takes_joints(random_robot, statics, loaded):
    robot = random_robot(7, 8)
    for i in range(7):
        robot = with_arm(robot, i, inertia=Inertia())
    q = np.random.default_rng(1).uniform(-1.0, 1.0, 8)
    _, matrix, _ = statics(robot, q)
    assert np.allclose(loaded(robot).mass_matrix(q), matrix, rtol=1e-11, atol=1e-11)


# runs


def test_energy_is_kept(random_robot, loaded, still):
    springs = [Drive(inertia=2.0, spring=Spring(400.0)) if i % 2 else Drive(inertia=1.0) for i in range(4)]
    robot = with_drives(random_robot(2, 4, revolute_only=True), springs)
    engine = loaded(robot, Control("torque"))

    def energy():
        state = engine.state()
        kinetic = state.dq @ engine.mass_matrix(state.q) @ state.dq + engine.motor_inertia() @ state.dtheta**2
        elastic = 400.0 * np.sum((state.theta - state.q) ** 2)
        frame, height = robot.base.matrix(), 0.0
        for i, stage in enumerate(robot.stages):
            moved = replace(stage.arm.link, theta=stage.arm.link.theta + state.q[i])
            frame = frame @ moved.matrix()
            body = stage.arm.inertia
            height -= body.mass * (frame[:3, :3] @ body.com + frame[:3, 3]) @ np.array(robot.gravity)
        return 0.5 * (kinetic + elastic) + height

    engine.reset(still([0.3, -0.2, 0.5, 0.1]), None)
    before = energy()
    engine.advance(1.0, 2000)
    assert np.max(np.abs(engine.state().dq)) > 0.5
    assert abs(energy() - before) < 1e-8 * abs(before)


def reference(robot, law, start, duration):
    """q'' = M^-1 (T - h) of elastic joints by DOP853, knot by knot; rigid joints follow the law."""
    arms = dynamics(robot, always_compiled=True)
    drives = [stage.drive for stage in robot.stages]
    soft = np.array([drive.spring is not None for drive in drives])
    k, b = (
        np.array([getattr(d.spring, name) if d.spring else 0.0 for d in drives]) for name in ("stiffness", "damping")
    )
    pull = np.array([sum(s.stiffness for s in d.arm_springs) for d in drives])
    rest = np.array([sum(s.stiffness * s.rest for s in d.arm_springs) for d in drives])

    def slope(t, y):
        theta, dtheta, ddtheta = law.at(t)
        q, dq = theta.copy(), dtheta.copy()
        q[soft], dq[soft] = np.split(y, 2)
        torque = k * (theta - q) + b * (dtheta - dq) - pull * q + rest - arms.bias(q, dq)
        matrix = arms.mass_matrix(q)
        torque = torque[soft] - matrix[np.ix_(soft, ~soft)] @ ddtheta[~soft]
        return np.concatenate([dq[soft], np.linalg.solve(matrix[np.ix_(soft, soft)], torque)])

    y, t = np.concatenate([start[soft], np.zeros(soft.sum())]), 0.0
    for end in [*law.knots[(law.knots > 0.0) & (law.knots < duration)], duration]:
        # the law jumps at its knots: the piece ends before it
        inside = np.nextafter(end, 0.0)
        y = solve_ivp(slope, (t, inside), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        t = end
    q, dq, _ = law.at(duration)
    q[soft], dq[soft] = np.split(y, 2)
    return q, dq


@pytest.mark.parametrize("rigid", [(), (0, 2)])
def test_imposed_motion_is_exact(random_robot, loaded, soft, rigid):
    springs = (ArmSpring(30.0, -0.4), ArmSpring(20.0, 0.3))
    drives = [Drive(inertia=3.0, arm_springs=springs) if i in rigid else soft(i, arm_springs=springs) for i in range(4)]
    robot = with_drives(random_robot(11, 4, revolute_only=True), drives)
    # Akima: the acceleration jumps at the knots
    law = from_table(np.linspace(0.0, 0.3, 7), 0.3 * np.random.default_rng(2).normal(size=(7, 4)))
    theta, dtheta, _ = law.at(0.0)
    engine = loaded(robot)
    start = MachineState(0.0, theta.copy(), np.where([i in rigid for i in range(4)], dtheta, 0.0), theta, dtheta)
    errors = []
    q, dq = reference(robot, law, start.q, 0.28)
    for steps in (2, 4):
        engine.reset(start, law)
        for _ in range(280):
            engine.advance(1e-3, steps)
        state = engine.state()
        errors.append(np.max(np.abs(state.q - q)))
        assert np.allclose(state.theta, law.at(0.28)[0], rtol=0.0, atol=1e-13)
        assert np.max(np.abs(state.dq - dq)) < 1e-5
    assert np.max(np.abs(q - law.at(0.28)[0])) > 1e-3
    assert errors[1] < 1e-8
    assert 3.7 < np.log2(errors[0] / errors[1]) < 4.3
    stretch = state.theta - state.q
    expected = [d.spring.stiffness if d.spring else 0.0 for d in drives] * stretch + np.array(
        [d.spring.damping if d.spring else 0.0 for d in drives]
    ) * (state.dtheta - state.dq)
    assert np.allclose(engine.transmitted(), expected, rtol=1e-12, atol=1e-12)


def test_imposed_motion_does_not_feel_the_motor(random_robot, loaded, soft):
    # mode motion: rotor, friction and even a motor side without inertia leave the arms alone
    law = from_table([0.0, 0.1, 0.2], np.array([[0.0, 0.0], [0.2, -0.1], [0.1, 0.2]]))
    ends = []
    for change in ({}, {"inertia": 0.0}, {"inertia": 50.0, "damping": 5.0, "terms": (coulomb(3.0),)}):
        robot = random_robot(4, 2, lambda i, change=change: replace(soft(i), **change), revolute_only=True)
        engine = loaded(robot)
        theta, dtheta, _ = law.at(0.0)
        engine.reset(MachineState(0.0, theta, dtheta, theta, dtheta), law)
        engine.advance(0.2, 400)
        assert engine._data.warning[mujoco.mjtWarning.mjWARN_INERTIA].number == 0
        ends.append(engine.state().q)
    assert np.allclose(ends[0], ends[1], rtol=0.0, atol=1e-12)
    assert np.allclose(ends[0], ends[2], rtol=0.0, atol=1e-12)
    assert engine.friction()[0] != 0.0


def test_all_rigid_and_imposed_is_the_motion_itself(random_robot, loaded):
    law = from_table(np.linspace(0.0, 1.0, 5), np.random.default_rng(0).normal(size=(5, 3)))
    robot = random_robot(1, 3, lambda i: Drive(damping=2.0))
    engine = loaded(robot)
    theta, dtheta, _ = law.at(0.0)
    engine.reset(MachineState(0.0, theta, dtheta, theta, dtheta), law)
    for _ in range(7):
        engine.advance(0.1, 1)
    state = engine.state()
    q, dq, _ = law.at(0.7)
    assert np.allclose(state.q, q, rtol=0.0, atol=1e-14)
    assert np.allclose(state.dq, dq, rtol=0.0, atol=1e-13)
    assert np.allclose(engine.friction(), 2.0 * dq, rtol=1e-12, atol=1e-13)


def test_a_motor_without_inertia_is_not_moved_by_torque(random_robot, loaded, program, still):
    robot = random_robot(1, 2, lambda i: Drive(spring=Spring(1.0e3)))
    with pytest.raises(RefusedError, match="joint_1"):
        loaded(robot, Control("torque"))
    engine = BACKEND.load(BACKEND.emit(robot, program(2)))
    with pytest.raises(RefusedError, match="joint_1"):
        engine.reset(still([0.0, 0.0]), None)


def test_the_callback_does_what_mujoco_does_by_itself(random_robot, loaded, soft, still):
    def drive(i):
        springs = (ArmSpring(25.0, -1.0), ArmSpring(10.0, -1.0)) if i < 2 else (ArmSpring(40.0, 0.3),)
        more = {"damping": 4.0, "arm_springs": springs, "gain": 1.1}
        return soft(i, **more) if i % 2 else Drive(inertia=1.0, **more)

    engine = loaded(random_robot(9, 4, drive), Control("torque"))
    assert isinstance(engine, MujocoEngine)
    states = []
    for native in (True, False):
        engine._linear = native
        engine.reset(still([0.2, -0.1, 0.4, 0.0]), None)
        engine.hold(np.array([5.0, -3.0, 2.0, 1.0]))
        engine.advance(0.2, 400)
        states.append(engine.state())
    assert np.max(np.abs(states[0].dtheta)) > 0.1
    assert np.allclose(states[0].q, states[1].q, rtol=0.0, atol=1e-12)
    assert np.allclose(states[0].theta, states[1].theta, rtol=0.0, atol=1e-12)


def test_drive_torques_are_what_mujoco_applies(random_robot, program, soft):
    def drive(i):
        more = {"damping": 4.0, "arm_springs": (ArmSpring(25.0, -0.7),)}
        return soft(i, **more) if i % 2 else Drive(inertia=1.0, **more)

    robot = random_robot(9, 4, drive)
    emission = BACKEND.emit(robot, program(4))
    engine = BACKEND.load(emission)
    q, dq, theta, dtheta = np.random.default_rng(3).normal(size=(4, 4))
    theta[::2], dtheta[::2] = q[::2], dq[::2]
    on_arm, on_motor = engine.drive_torque(q, dq, theta, dtheta)
    model = mujoco.MjModel.from_xml_string(emission.files[emission.main])
    data = mujoco.MjData(model)
    for i in range(4):
        elastic = i % 2 == 1
        data.joint(f"joint_{i + 1}").qpos = q[i] - elastic * theta[i]
        data.joint(f"joint_{i + 1}").qvel = dq[i] - elastic * dtheta[i]
        if elastic:
            data.joint(f"joint_{i + 1}_motor").qpos, data.joint(f"joint_{i + 1}_motor").qvel = theta[i], dtheta[i]
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    for i in range(4):
        arm = data.joint(f"joint_{i + 1}").qfrc_passive[0]
        if i % 2:
            motor = data.joint(f"joint_{i + 1}_motor").qfrc_passive[0]
            assert on_arm[i] == pytest.approx(arm, rel=1e-12)
            assert on_motor[i] == pytest.approx(motor - arm, rel=1e-10)
        else:
            assert on_arm[i] + on_motor[i] == pytest.approx(arm, rel=1e-12)


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("rest", [-1.0, -0.3, 0.0, 0.7])
def test_springs_on_arms_rest_where_they_are_said_to(random_robot, loaded, still, soft, elastic, rest):
    """A spring length of -1 means "automatic" to MuJoCo."""
    springs = (ArmSpring(20.0, rest - 0.1), ArmSpring(20.0, rest + 0.1))
    drive = soft(0, arm_springs=springs) if elastic else Drive(inertia=1.0, arm_springs=springs)
    robot = replace(random_robot(1, 1, lambda i: drive, revolute_only=True), gravity=(0.0, 0.0, 0.0))
    engine = loaded(robot, Control("torque"))
    zero = np.zeros(1)
    assert engine.drive_torque(zero, zero, zero, zero)[0] == pytest.approx([40.0 * rest], abs=1e-12)
    engine.reset(still([rest]), None)
    engine.advance(0.1, 100)
    assert engine.state().q == pytest.approx([rest], abs=1e-12)


def test_asking_for_torques_does_not_disturb_a_run(random_robot, loaded, still):
    drive = Drive(inertia=1.0, terms=(coulomb(2.0),), stick=Stick(1e-3, 1e-3), slips=(Slip(800.0, 1.0),))
    robot = random_robot(2, 3, lambda i: drive)
    ends = []
    for asked in (False, True):
        engine = loaded(robot, Control("torque"))
        engine.reset(still([0.1, 0.2, 0.3]), None)
        for _ in range(50):
            engine.advance(1e-3, 2)
            if asked:
                far = np.full(3, 5.0)
                _, on_motor = engine.drive_torque(far, np.zeros(3), far, np.zeros(3))
                assert np.array_equal(on_motor, np.zeros(3))
        ends.append(engine.state().q)
    assert np.array_equal(*ends)


def test_numbers_of_the_drives_are_the_files(random_robot, program, soft):
    emission = BACKEND.emit(random_robot(1, 1, lambda i: soft(i, damping=4.0), revolute_only=True), program(1))
    zero, one = np.zeros(1), np.ones(1)
    engine = BACKEND.load(emission)
    assert engine.drive_torque(zero, zero, one, zero)[0] == pytest.approx(4.0e3)
    assert engine.drive_torque(zero, one, zero, one)[1] == pytest.approx(-4.0)
    for old, new, q, dq in (('stiffness="4000.0"', 'stiffness="3000.0"', one, zero), ('damping="4.0"', "", zero, one)):
        wrong = BACKEND.load(edited(emission, old, new))
        assert not np.allclose(wrong.drive_torque(zero, dq, q, dq), engine.drive_torque(zero, dq, q, dq))
    wrong = BACKEND.load(edited(emission, 'armature="2.0"', 'armature="1.0"'))
    assert wrong.motor_inertia() == pytest.approx([1.0])


def test_a_stuck_joint_holds_and_slips_at_its_level(random_robot, statics, loaded, still):
    robot = random_robot(21, 1, revolute_only=True)
    load = abs(statics(robot, np.zeros(1))[2][0])
    for factor, held in ((1.3, True), (0.9, False)):
        level = factor * load
        stick = Stick(5.0e-6, 2.0 * math.sqrt(5.0e-6 / level))
        engine = loaded(
            with_drives(robot, [Drive(inertia=0.5, terms=(coulomb(level),), stick=stick)]), Control("torque")
        )
        engine.reset(still([0.0]), None)
        engine.advance(1.0, 5000)
        after = engine.state().q[0]
        engine.advance(1.0, 5000)
        if held:
            assert abs(after) < 1e-5
            assert abs(engine.state().q[0] - after) < 1e-9
            assert abs(engine.friction()[0]) == pytest.approx(load, rel=1e-4)
        else:
            assert abs(after) > 1e-2


# a good guest in the process


def test_callbacks_of_others_are_left_alone(random_robot, loaded, still):
    robot = random_robot(2, 2, lambda i: Drive(inertia=1.0, terms=(coulomb(1.0),)))
    engine = loaded(robot, Control("torque"))
    other = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'
    )
    seen = []
    mujoco.set_mjcb_control(lambda model, data: seen.append(model.nv))
    try:
        engine.reset(still([0.1, 0.2]), None)
        engine.advance(0.01, 10)
        assert not seen
        mujoco.mj_step(other, mujoco.MjData(other))
        assert seen == [1]
    finally:
        mujoco.set_mjcb_control(None)
    engine.advance(0.01, 10)
    assert mujoco.get_mjcb_control() is None


def test_engines_beside_one_another_do_not_meet(random_robot, loaded, still):
    def run(engines):
        for engine in engines:
            engine.reset(still([0.1, 0.2, 0.3]), None)
        for _ in range(20):
            for engine in engines:
                engine.advance(1e-3, 3)
        return [engine.state().q for engine in engines]

    robots = [random_robot(k, 3, lambda i, k=k: Drive(inertia=1.0, terms=(coulomb(1.0 + k),))) for k in range(2)]
    engines = [loaded(robot, Control("torque")) for robot in robots]
    together = run(engines)
    alone = [run([engine])[0] for engine in engines]
    assert all(np.array_equal(a, b) for a, b in zip(together, alone, strict=True))


@pytest.mark.parametrize("terms", [(), (coulomb(1.0),)])
def test_a_run_that_bursts_says_when_and_leaves_no_file(random_robot, loaded, still, tmp_path, monkeypatch, terms):
    monkeypatch.chdir(tmp_path)
    engine = loaded(
        random_robot(1, 2, lambda i: Drive(inertia=1e-3, spring=Spring(1e6), terms=terms)), Control("torque")
    )
    engine.reset(still([0.1, 0.1]), None)
    with pytest.raises(RefusedError, match=r"t = 0\.\d+ s"):
        for _ in range(100):
            engine.advance(0.01, 1)
    assert not list(tmp_path.iterdir())


# text


def everything(robot):
    """A robot that has every datum of the representation."""
    terms = (
        coulomb(2.0),
        Term("transmission_error", "error", "error", (1e-3, 2.0, 0.0)),
        Term("transmission_error", "error_slope", "error_slope", (1e-3, 2.0, 0.0)),
    )
    drive = Drive(
        1.0,
        False,
        Spring(1e3, 1.0, 1e-3),
        2.0,
        terms,
        (Slip(1.0, 1.0),),
        (ArmSpring(1.0),),
        Stick(1e-6, 1e-3),
        1.1,
        50.0,
    )
    stages = list(robot.stages)
    stages[0] = replace(
        stages[0],
        joint=Joint("joint_1", "revolute", -1.0, 2.0, 3.0, 40.0, 0.5),
        drive=drive,
        sensor=Sensor(0.1, 0.2),
        arm=replace(stages[0].arm, shapes=(Shape("box", (0.1, 0.2, 0.3)), Shape("sphere", (0.1,)))),
    )
    stages[1] = replace(stages[1], drive=Drive(1.0, True, Spring(1e3)))
    return replace(robot, stages=tuple(stages), delay=0.01, kp_factor=(1.0, 0.9), kd_factor=(1.0, 1.0))


def test_every_datum_is_reported_once_and_absent_ones_are_not(random_robot, program):
    plain = random_robot(1, 2, revolute_only=True)
    said = {concept.datum for concept in BACKEND.emit(plain, program(2)).concepts}
    assert said == {
        "gravity", "base", "kinematics", "corrections", "inertia", "tool", "joint.type", "home",
    }  # fmt: skip
    concepts = BACKEND.emit(everything(plain), program(2)).concepts
    places = [(concept.datum, concept.at) for concept in concepts]
    assert len(places) == len(set(places))
    status = {concept.datum: concept.status for concept in concepts}
    assert {datum for datum, value in status.items() if value == "impossible"} == {
        "limits.velocity", "transmission_error", "hysteresis", "encoder_offset.offset", "torque_offset.torque", "delay",
        "controller_gain",
    }  # fmt: skip
    approximated = {datum for datum, value in status.items() if value == "approximated"}
    assert approximated == {"backlash.gap", "coulomb_friction", "friction.model"}
    for datum in ("limits.position", "limits.effort", "rotor_inertia.inertia", "dummy_inertia", "joint_spring",
                  "joint_compliance.stiffness", "torque_limit.torque", "torque_constant.gain", "shapes"):  # fmt: skip
        assert status[datum] == "exact"


def test_what_is_said_to_be_exact_is_in_mujocos_own_attributes(random_robot, program):
    robot = everything(random_robot(1, 2, revolute_only=True))
    emission = BACKEND.emit(robot, program(2))
    model = mujoco.MjModel.from_xml_string(emission.files[emission.main])
    motor, arm = model.joint("joint_1_motor"), model.joint("joint_1")
    assert motor.range.tolist() == [-1.0, 2.0]
    assert motor.limited
    assert model.jnt_actfrcrange[motor.id].tolist() == [-40.0, 40.0]
    assert (motor.armature[0], motor.damping[0], motor.frictionloss[0]) == (1.0, 2.0, 2.0)
    assert (model.jnt_stiffness[arm.id], arm.damping[0]) == (1e3, 1.0)
    actuator = model.actuator("joint_1")
    assert (actuator.gear[0], actuator.ctrlrange.tolist()) == (1.1, [-50.0, 50.0])
    assert model.key("home").qpos.tolist() == [0.5, 0.0, 0.0, 0.0]
    assert model.opt.gravity.tolist() == list(robot.gravity)
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert model.opt.timestep == 1e-4
    assert np.all(model.geom_contype == 0)
    assert model.body_mass.sum() == pytest.approx(sum(s.arm.inertia.mass for s in robot.stages), rel=1e-15)


def test_the_file_runs_in_plain_mujoco_near_ours(random_robot, program, soft, still):
    """Friction of the file is a soft constraint: near the law, and named an approximation."""
    robot = random_robot(3, 2, lambda i: soft(i, terms=(coulomb(2.0),)), revolute_only=True)
    robot = replace(robot, friction=FrictionModel("smooth", 1e-3))
    emission = BACKEND.emit(robot, program(2))
    model = mujoco.MjModel.from_xml_string(emission.files[emission.main])
    data = mujoco.MjData(model)
    data.qvel[[0, 2]] = 2.0
    mujoco.mj_step(model, data, 2000)
    engine = BACKEND.load(emission)
    engine.reset(MachineState(0.0, np.zeros(2), np.full(2, 2.0), np.zeros(2), np.full(2, 2.0)), None)
    engine.advance(0.2, 4000)
    moved = engine.state().theta
    assert np.max(np.abs(moved)) > 0.1
    assert np.max(np.abs(data.qpos[[0, 2]] - moved)) < 5e-3 * np.max(np.abs(moved))


def test_same_robot_same_bytes_and_remarks_cannot_break_out(random_robot, program):
    robot = random_robot(1, 2)
    assert BACKEND.emit(robot, program(2)) == BACKEND.emit(robot, program(2))
    nasty = replace(robot, level='a"<b> & c', source_hash="--> <x/>", notes=("---", "two\nlines"))
    assert BACKEND.load(BACKEND.emit(nasty, program(2))).n == 2


def test_meshes_that_are_not_there_do_not_stop_a_run(random_robot, program, still):
    mesh = Shape("mesh", (1.0, 1.0, -1.0), mesh="not there.stl")
    robot = with_arm(random_robot(1, 2), 0, shapes=(mesh, mesh))
    emission = BACKEND.emit(robot, program(2))
    assert emission.files[emission.main].count("not there.stl") == 1
    BACKEND.load(emission).reset(still([0.0, 0.0]), None)
