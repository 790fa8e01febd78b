"""Files for Adams, rebuilt by readers that know its documentation only, against the engines that are here."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.backends.adams import AdamsBackend
from mbexport.backends.adams_build import adams_name
from mbexport.backends.adams_model import body313
from mbexport.backends.adams_motion import TOLERANCE, splines_of
from mbexport.core.control import Control, default_pd
from mbexport.core.errors import RefusedError
from mbexport.core.export import default_program, emit
from mbexport.core.kinematics import dynamics, tool_in_base
from mbexport.core.motion import MotionLaw, from_table, hold, motion_named, point_to_point
from mbexport.core.representation import (
    ArmSpring,
    Bend,
    Drive,
    FrictionModel,
    Inertia,
    Mount,
    Pose,
    Sensor,
    Slip,
    Spring,
    Term,
)
from mbexport.core.simulation.drive_sheet import DriveSheet
from mbexport.core.simulation.drives import Drives

# gates of agreement.md: compliant motion, closed loop; the statics' are 1e-10
TIP = 1.0e-6
STATICS = 1.0e-10
KINDS = {"adm": "dataset", "cmd": "commands"}


def robot_of(name, level="full"):
    return mbexport.build(mbexport.load(name), level)


def file_of(emission, suffix):
    return next(text for name, text in emission.files.items() if name.endswith("." + suffix))


@pytest.fixture
def rebuilt(readers):
    """What the reader of one file finds in an emission."""

    def read(emission, suffix="adm", change=lambda text: text):
        return getattr(readers, KINDS[suffix]).read(change(file_of(emission, suffix)))

    return read


def arms_of(machine, robot):
    """Coordinates of the arms' joints: where the motor sides stand at 0 they are q."""
    return [machine.names.index(stage.joint.name) for stage in robot.stages]


def statics_differ(found, robot, seed=1):
    """Largest differences of mass matrix (scaled by its diagonal) and gravity from the robot's own dynamics."""
    machine, _ = found.machine()
    arms = arms_of(machine, robot)
    q = np.random.default_rng(seed).uniform(-0.6, 0.6, robot.n)
    x = np.zeros(machine.n)
    x[arms] = q
    matrix, weight = machine.mass_matrix(x)[np.ix_(arms, arms)], machine.gravity(x)[arms]
    known = dynamics(robot)
    expected, expected_weight = known.mass_matrix(q), known.gravity(q)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    size = max(float(np.abs(expected_weight).max()), 1.0e-3)
    return np.abs((matrix - expected) / scale).max(), np.abs(weight - expected_weight).max() / size


def tips_of(found, times):
    """Tool centre point in the base [m] over a run of the rebuilt machine, shape (m, 3)."""
    machine, start = found.machine()
    q = machine.run(start, times, found.efforts(machine), found.imposed(machine))
    return np.array([[found.request("tip", machine.state(row))[axis] for axis in "xyz"] for row in q])


def quick_motion(robot, turn=0.2, duration=0.4):
    home = np.array(robot.home())
    return point_to_point(home, home + turn * (-1.0) ** np.arange(robot.n), duration)


@pytest.mark.parametrize("suffix", ["adm", "cmd"])
@pytest.mark.parametrize(
    ("name", "level"),
    [("imece2013", "compliant"), ("arm7", "full"), ("scara", "full"), ("puma560", "full"), ("pendulum", "rigid")],
)
def test_mass_matrix_and_gravity_are_the_robots(rebuilt, name, level, suffix):
    robot = robot_of(name, level)
    assert max(statics_differ(rebuilt(emit(robot, AdamsBackend()), suffix), robot)) < STATICS


@pytest.mark.parametrize("seed", range(3))
def test_a_random_robot_is_rebuilt(random_robot, rebuilt, seed):
    """Prismatic joints, beta, corrections, a turned base and a tool: nothing at zero."""
    robot = random_robot(seed, 5)
    found = rebuilt(emit(robot, AdamsBackend()), "cmd" if seed % 2 else "adm")
    assert max(statics_differ(found, robot)) < STATICS
    machine, start = found.machine()
    tip = found.request("tip", machine.state(start))
    tool = np.asarray(tool_in_base(robot, np.array(robot.home())))
    assert [tip[axis] for axis in "xyz"] == pytest.approx(tool[:3, 3], abs=1e-12)
    angles = [tip[angle] for angle in ("psi", "theta", "phi")]
    assert angles == pytest.approx(body313(Pose.from_matrix(tool)), abs=1e-9)


def test_both_files_say_the_same(rebuilt):
    """One model in two languages: forces at a moving state, splines, motions, initial conditions."""
    robot = robot_of("scara")
    emission = emit(robot, AdamsBackend(), quick_motion(robot), default_pd(robot))
    dataset, commands = rebuilt(emission, "adm"), rebuilt(emission, "cmd")
    rng = np.random.default_rng(5)
    made = [(found, *found.machine()) for found in (dataset, commands)]
    q, dq, ddq = rng.uniform(-0.1, 0.1, (3, made[0][1].n))
    torques = [
        machine.efforts(machine.state(start + q, dq, ddq, 0.1), found.efforts(machine))
        for found, machine, start in made
    ]
    assert torques[0] == pytest.approx(torques[1], rel=1e-12)
    assert list(dataset.splines.values()) == list(commands.splines.values())
    assert list(dataset.requests) == list(commands.requests)
    still = emit(robot, AdamsBackend(), quick_motion(robot))
    assert [m[:2] for m in rebuilt(still).motions.values()] == [m[:2] for m in rebuilt(still, "cmd").motions.values()]


def test_the_paper_arm_moves_as_in_mujoco(rebuilt):
    robot = robot_of("imece2013", "compliant")
    motion = quick_motion(robot)
    run = mbexport.simulate(robot, "mjcf", motion, duration=0.04, rate=100.0)
    found = rebuilt(emit(robot, AdamsBackend(), motion))
    assert np.ptp(run.tip, axis=0).max() > 1.0e-3
    assert np.abs(tips_of(found, run.t) - run.tip).max() < TIP


@pytest.mark.parametrize("suffix", ["adm", "cmd"])
def test_compliant_joints_of_both_kinds_move_as_in_pinocchio(rebuilt, suffix):
    robot = robot_of("scara", "compliant")
    motion = quick_motion(robot, 0.1)
    run = mbexport.simulate(robot, "urdf", motion, duration=0.06, rate=100.0)
    found = rebuilt(emit(robot, AdamsBackend(), motion), suffix)
    assert np.abs(tips_of(found, run.t) - run.tip).max() < TIP


def closed_loop_runs(robot, motion, duration, rates):
    return [
        mbexport.simulate(robot, "mjcf", motion, default_pd(robot, rate=rate), duration=duration, rate=200.0)
        for rate in rates
    ]


def test_a_closed_loop_is_what_faster_and_faster_ticks_come_to(rebuilt):
    """The files' controller is continuous: sampled runs approach it at first order in the tick's length.

    Rotors as accelerations in the torque, smooth friction and a sliding joint are in it.
    """
    robot = replace(robot_of("scara"), friction=FrictionModel("smooth", 1.0e-2))
    motion = quick_motion(robot, 0.1)
    slow, fast = closed_loop_runs(robot, motion, 0.05, (4000.0, 8000.0))
    tips = tips_of(rebuilt(emit(robot, AdamsBackend(), motion, default_pd(robot))), slow.t)
    off = [np.abs(tips - run.tip).max() for run in (slow, fast)]
    assert off[0] / off[1] == pytest.approx(2.0, abs=0.05)
    assert np.abs(tips - (2.0 * fast.tip - slow.tip)).max() < TIP


def test_bearings_that_give_and_arms_that_bend_are_joints_on_springs(rebuilt):
    robot = robot_of("planar2r", "rigid")
    one, two = robot.stages
    inf = math.inf
    one = replace(one, mount=Mount((4.0e4, inf, inf, inf, 3.0e3), (20.0, 0.0, 0.0, 0.0, 2.0)))
    two = replace(two, bend=Bend((800.0, 900.0), (0.4, 0.4), 0.4))
    robot = replace(robot, stages=(one, two))
    motion = quick_motion(robot, 0.4)
    run = mbexport.simulate(robot, "urdf", motion, duration=0.05, rate=100.0)
    emission = emit(robot, AdamsBackend(), motion)
    found = rebuilt(emission)
    assert len(found.joints) == 2 + 4
    assert len(found.motions) == 2
    assert np.abs(tips_of(found, run.t) - run.tip).max() < TIP
    assert np.abs(tips_of(rebuilt(emission, "cmd"), run.t[:3]) - run.tip[:3]).max() < TIP


def everything():
    """Three joints with every law that has an expression: elastic with play and wobble, rigid, sliding and elastic."""
    robot = replace(robot_of("scara", "rigid"), friction=FrictionModel("smooth", 0.05))
    wobble = (2.0e-3, 9.0, 0.4)
    level = Term("coulomb_friction", "level", "level", (3.0,))
    drives = (
        Drive(
            inertia=0.3,
            spring=Spring(900.0, 1.5, gap=4.0e-3),
            damping=0.7,
            terms=(
                level,
                Term("stribeck_friction", "level", "level", (2.0, 0.3)),
                Term("load_friction", "level", "level", (0.2,)),
                Term("transmission_error", "error", "error", wobble),
                Term("transmission_error", "error_slope", "error_slope", wobble),
                Term("torque_ripple", "resistance", "resistance", (1.5, 7.0, 0.2)),
            ),
            arm_springs=(ArmSpring(40.0, 0.1),),
        ),
        Drive(inertia=0.2, damping=0.2, terms=(level,), arm_springs=(ArmSpring(30.0, -0.2),), gain=1.1),
        Drive(inertia=2.0, spring=Spring(4.0e4, 30.0), damping=9.0, terms=(level,), gain=0.9),
        Drive(),
    )
    stages = tuple(replace(stage, drive=drive) for stage, drive in zip(robot.stages, drives, strict=True))
    return replace(robot, stages=stages)


@pytest.mark.parametrize("suffix", ["adm", "cmd"])
def test_every_law_of_a_drive_acts_as_in_the_common_equations(rebuilt, suffix):
    robot = everything()
    command = default_pd(robot)
    motion = hold(robot.home(), 1.0)
    found = rebuilt(emit(robot, AdamsBackend(), motion, command), suffix)
    machine, _ = found.machine()
    efforts = found.efforts(machine)
    drives = Drives(DriveSheet.of(robot))
    arms = arms_of(machine, robot)
    rng = np.random.default_rng(2)
    shut = 0
    for _ in range(12):
        theta, dtheta = rng.uniform(-0.3, 0.3, (2, robot.n))
        elastic = np.array([stage.drive.spring is not None for stage in robot.stages])
        stretch = np.where(elastic, rng.uniform(-6e-3, 6e-3, robot.n), 0.0)
        q, dq = theta - stretch, dtheta + np.where(elastic, rng.uniform(-0.2, 0.2, robot.n), 0.0)
        drives.evaluate(0.0, q, dq, theta, dtheta)
        shut += drives.transmitted[0] == 0.0
        tau = np.array(command.kp) * (np.array(robot.home()) - theta) - np.array(command.kd) * dtheta
        x, v = np.zeros(machine.n), np.zeros(machine.n)
        x[arms], v[arms] = np.where(elastic, q - theta, q), np.where(elastic, dq - dtheta, dq)
        expected = np.zeros(machine.n)
        on_arm = np.where(elastic, drives.transmitted, 0.0) + drives.on_arm
        motor = drives.motor_torque(tau)
        for i, stage in enumerate(robot.stages):
            if elastic[i]:
                k = machine.names.index(f"{stage.joint.name}_drive")
                x[k], v[k] = theta[i], dtheta[i]
                expected[k] = motor[i] + on_arm[i]  # the arm moves with its motor side
                expected[arms[i]] = on_arm[i]
            else:
                expected[arms[i]] = motor[i] + on_arm[i]
        torque = machine.efforts(machine.state(x, v), efforts)
        assert torque == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert 0 < shut < 12, "the play was never, or always, open"


def test_rotors_answer_the_acceleration_that_the_part_before_sees(rebuilt):
    robot = everything()
    found = rebuilt(emit(robot, AdamsBackend(), control=default_pd(robot)))
    machine, start = found.machine()
    rng = np.random.default_rng(4)
    dq = rng.uniform(-1.0, 1.0, machine.n)
    moving = [effort for effort in found.efforts(machine) if effort.accelerated]
    at_rest = machine.efforts(machine.state(start, dq), moving)
    answer = np.stack(
        [machine.efforts(machine.state(start, dq, e), moving) - at_rest for e in np.eye(machine.n)], axis=1
    )
    inertia = {
        f"{stage.joint.name}_drive" if stage.drive.spring else stage.joint.name: stage.drive.inertia
        for stage in robot.stages
    }
    expected = -np.diag([inertia.get(name, 0.0) for name in machine.names])
    assert answer == pytest.approx(expected, abs=1e-9)


def test_imposed_motion_carries_friction_and_rotor_but_no_dummy(rebuilt):
    robot = robot_of("imece2013", "compliant")
    assert not any("WDTZ" in force[3] for force in rebuilt(emit(robot, AdamsBackend())).forces.values())
    turned = rebuilt(emit(robot, AdamsBackend(), control=default_pd(robot)))
    assert sum("WDTZ" in force[3] for force in turned.forces.values()) == robot.n
    assert not turned.motions
    rotors = rebuilt(emit(robot_of("puma560", "drives"), AdamsBackend()))
    assert sum("WDTZ" in force[3] for force in rotors.forces.values()) == 6
    assert "MOTION(1,0,8,2)" in rotors.requests["joint_1_state"]["tau"]


@pytest.fixture
def evaluate(readers):
    """Value of a function expression at a state."""

    def value(found, text, state):
        return readers.expressions.Expression(text)(readers.model.Scope(found, state))

    return value


def test_a_controllers_limits_delay_offsets_and_feedforward(rebuilt, evaluate):
    robot = robot_of("planar2r", "rigid")
    one, two = robot.stages
    one = replace(one, sensor=Sensor(0.02, 1.5), drive=replace(one.drive, torque_limit=16.0))
    robot = replace(robot, stages=(one, two), delay=0.003, kp_factor=(0.5, 1.0), kd_factor=(1.0, 2.0))
    control = Control("pd", (100.0, 50.0), (10.0, 5.0), "gravity", 1000.0, (17.0, 4.0))
    motion = quick_motion(robot)
    found = rebuilt(emit(robot, AdamsBackend(), motion, control))
    machine, start = found.machine()
    q, dq, _ = (row[0] for row in motion.at([0.2]))
    speed = dq + np.array([0.04, -0.05])
    forward, cut = dynamics(robot).gravity(q), 0
    for shift in (-0.05, 0.0, 0.05):
        state = machine.state(start + shift, speed, t=0.2)
        theta = np.array([evaluate(found, found.requests[f"joint_{i}_state"]["theta"], state) for i in (1, 2)])
        assert theta == pytest.approx(start + shift)
        wanted = np.array([50.0, 50.0]) * (q - [0.02, 0.0] - theta) + 10.0 * (dq - speed) + forward
        held = np.clip(wanted, [-16.0, -4.0], [16.0, 4.0])
        cut += int((wanted != held).sum())
        said = [evaluate(found, found.variables[variable], state) for variable in ("1", "3")]
        assert said == pytest.approx(held, rel=1e-5, abs=1e-5)
    assert 0 < cut < 6
    for variable in ("2", "4"):
        assert re.fullmatch(r"DELAY\(VARVAL\(\d\),0.003,\(?-?[\d.E+-]+\)?\)", found.variables[variable])
    assert found.requests["joint_1_state"]["tau"] == "VARVAL(2) + 1.5"
    assert found.requests["joint_2_state"]["tau"] == "VARVAL(4)"


def test_torques_from_outside_begin_at_zero(rebuilt):
    robot = robot_of("planar2r", "rigid")
    emission = emit(robot, AdamsBackend(), control=Control("torque"))
    assert set(rebuilt(emission).variables.values()) == {"0.0"}
    assert next(c for c in emission.concepts if c.datum == "control").status == "impossible"


# where it starts and how it moves
def test_the_robot_stands_sagged_and_at_rest(rebuilt):
    robot = robot_of("imece2013", "compliant")
    found = rebuilt(emit(robot, AdamsBackend()))
    machine, start = found.machine()
    state = machine.state(start)
    torque = machine.efforts(state, found.efforts(machine)) - machine.equations(state)[1]
    assert np.abs(torque[arms_of(machine, robot)]).max() < 1.0e-7
    assert np.abs(start[arms_of(machine, robot)]).max() > 1.0e-4
    assert not found.initial


@pytest.mark.parametrize("suffix", ["adm", "cmd"])
def test_a_motion_that_begins_moving_says_how_elastic_joints_begin(rebuilt, suffix):
    robot = robot_of("arm7", "compliant")
    home = np.array(robot.home())
    moving = from_table([0.0, 1.0], [home, home + 0.3], [[0.3] * 7, [0.3] * 7])
    found = rebuilt(emit(robot, AdamsBackend(), moving), suffix)
    machine, start = found.machine()
    assert set(found.initial) == {stage.joint.name for stage in robot.stages}
    for name, (displacement, speed) in found.initial.items():
        assert displacement == pytest.approx(start[machine.names.index(name)], abs=1e-12)
        assert speed == 0.0


def worst(splines, law, readers, duration):
    times = np.linspace(0.0, duration, 4001)[1:-1]
    fit = readers.model.Found.interpolator(splines.function)(splines.knots, splines.position)
    exact = law.at(times)
    return [float(np.abs(fit(times, order) - exact[order]).max()) for order in range(3)]


def test_greca_is_within_the_said_error(readers):
    database = mbexport.load("imece2013")
    law = motion_named(mbexport.build(database), "greca", database=database)
    splines = splines_of(law, law.duration)
    assert splines.function == "CUBSPL"
    assert not splines.exact
    off = worst(splines, law, readers, law.duration)
    assert off[0] <= splines.errors[0] <= TOLERANCE
    assert all(real <= 1.5 * said for real, said in zip(off, splines.errors, strict=True))
    assert splines.velocity == pytest.approx(law.at(splines.knots)[1])


def test_an_akima_law_is_akispl_through_its_own_knots(readers):
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 2.0, 21)
    law = from_table(t, rng.normal(size=(21, 3)))
    splines = splines_of(law, 2.0)
    assert splines.exact
    assert (splines.function, len(splines.knots)) == ("AKISPL", 21)
    assert worst(splines, law, readers, 2.0) == pytest.approx([0.0] * 3, abs=1e-10)
    robot = robot_of("planar2r", "rigid")
    emission = emit(robot, AdamsBackend(), from_table(t, 0.1 * rng.normal(size=(21, 2))))
    assert next(c for c in emission.concepts if c.datum == "motion").status == "exact"
    assert "AKISPL(TIME,0,1,1)" in file_of(emission, "adm")


def test_a_law_that_turns_back_between_its_knots_moves():
    law = MotionLaw(np.array([0.0, 1.0]), np.array([[[1.0]], [[-1.0]], [[0.0]]]))
    assert splines_of(law, 1.0).moves(0)


def test_a_still_joint_needs_no_spline(rebuilt):
    robot = robot_of("planar2r", "rigid")
    home = np.array(robot.home())
    found = rebuilt(emit(robot, AdamsBackend(), point_to_point(home, home + np.array([0.0, 0.5]), 1.0)))
    assert found.motions["joint_1_motion"][2] == repr(float(home[0]))
    assert found.motions["joint_2_motion"][2] == "CUBSPL(TIME,0,1,0)"


# planted faults: a difference that the comparisons above would see
def change(pattern, new):
    return lambda text: re.sub(pattern, new, text)


EULER = r", REULER.*\n"
QUARTER = "REULER = 0.0, 1.5707963267948966, 0.0"
FAULTS = {
    "a product of inertia with the tensor's sign": ("cmd", change("iyz = -0.053", "iyz = 0.053")),
    "products in another order": ("cmd", change(r"izx = (.*?)  &\n   iyz = (.*)", r"izx = \2  &\n   iyz = \1")),
    "degrees for radians": ("cmd", change("angle = radians", "angle = deg")),
    "a lost orientation of a marker": ("adm", change(rf"(MARKER/9,.*\n, QP.*\n){EULER}", r"\1")),
    "a lost orientation of a part": ("adm", change(rf"(PART/5\n, QG.*\n){EULER}", r"\1")),
    "an angle in degrees": ("adm", change(QUARTER, QUARTER.replace("966", "966D"))),
    "a center of mass without its place": ("adm", change(r"(MARKER/12, PART = 5)\n, QP.*\n", r"\1\n")),
    "gravity upwards": ("adm", change("KGRAV = -", "KGRAV = ")),
    "moments in another order": ("adm", change("IP = 1.92, 2.9, 2.63", "IP = 1.92, 2.63, 2.9")),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_caught(rebuilt, fault):
    robot = robot_of("imece2013", "compliant")
    emission = emit(robot, AdamsBackend())
    suffix, plant = FAULTS[fault]
    text = file_of(emission, suffix)
    assert plant(text) != text, "nothing was planted"
    try:
        differ = max(statics_differ(rebuilt(emission, suffix, plant), robot))
    except AssertionError as error:
        assert "do not stand on each other" in str(error)
    else:
        assert differ > 1.0e-4


def test_a_stiffness_per_degree_is_caught(rebuilt):
    """A spring 57.3 times too stiff moves the tip by what it no longer gives."""
    robot = robot_of("imece2013", "compliant")
    emission = emit(robot, AdamsBackend())

    def per_degree(text):
        return re.sub(r"stiffness = ([\d.]+)", lambda m: f"stiffness = {math.degrees(float(m[1]))!r}", text)

    found = rebuilt(emission, "cmd", per_degree)
    machine, start = found.machine()
    state = machine.state(start)
    torque = machine.efforts(state, found.efforts(machine)) - machine.equations(state)[1]
    assert np.abs(torque[arms_of(machine, robot)]).max() > 1.0e3


# what is said, and how it is written
def statuses(emission):
    return {(c.datum, c.at): c.status for c in emission.concepts}


def test_concepts_say_what_the_files_cannot():
    robot = everything()
    one = robot.stages[0]
    sticking = replace(
        robot,
        friction=FrictionModel("stick", 1.0e-3),
        stages=(replace(one, drive=replace(one.drive, slips=(Slip(100.0, 1.0),))), *robot.stages[1:]),
        delay=0.001,
    )
    smooth, stick = (statuses(emit(r, AdamsBackend(), control=default_pd(r))) for r in (robot, sticking))
    assert smooth["coulomb_friction", "joint_1"] == "exact"
    assert smooth["friction.model", "joint_1"] == "exact"
    assert stick["coulomb_friction", "joint_1"] == "approximated"
    assert stick["friction.model", "joint_1"] == "approximated"
    assert stick["hysteresis", "joint_1"] == "impossible"
    assert stick["backlash.gap", "joint_1"] == "exact"
    assert stick["delay", "robot"] == "exact"
    assert stick["control", "all joints"] == "approximated"
    assert stick["limits.position", "all joints"] == "impossible"


def test_load_friction_of_a_rigid_joint_is_not_said(rebuilt):
    robot = robot_of("planar2r", "rigid")
    one, two = robot.stages
    term = Term("load_friction", "level", "level", (0.2,))
    rigid = replace(robot, stages=(replace(one, drive=replace(one.drive, terms=(term,))), two))
    emission = emit(rigid, AdamsBackend())
    assert statuses(emission)["load_friction", "joint_1"] == "impossible"
    assert "joint_1_torque" not in rebuilt(emission).forces
    elastic = replace(one.drive, terms=(term,), spring=Spring(500.0, 1.0), inertia=1.0)
    emission = emit(replace(robot, stages=(replace(one, drive=elastic), two)), AdamsBackend())
    assert statuses(emission)["load_friction", "joint_1"] == "approximated"  # it sticks
    assert "joint_1_torque" in rebuilt(emission).forces


def test_strict_refuses_and_names_what_is_not_exact(tmp_path):
    with pytest.raises(RefusedError, match=r"adams: limits\.position"):
        mbexport.export(robot_of("imece2013"), ["adams"], tmp_path / "out", strict=True)
    assert not (tmp_path / "out").exists()


def test_three_files_are_written(tmp_path):
    mbexport.export(robot_of("imece2013", "compliant"), ["adams"], tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["imece2013.acf", "imece2013.adm", "imece2013.cmd", "imece2013.concepts.json"]
    run = (tmp_path / "imece2013.acf").read_text(encoding="utf-8").splitlines()
    assert run == ["", "file/model=imece2013.adm", "simulate/dynamics, end=1.0, dtout=0.001", "stop"]


def test_nothing_here_runs_it():
    backend = AdamsBackend()
    assert not backend.runs
    assert backend.version() == ""
    with pytest.raises(RefusedError, match="emitted only"):
        backend.load(emit(robot_of("pendulum", "rigid"), backend))


def test_a_weightless_motor_side_is_refused():
    robot = robot_of("planar2r", "rigid")
    stages = tuple(replace(s, drive=replace(s.drive, spring=Spring(500.0))) for s in robot.stages)
    robot = replace(robot, stages=stages)
    backend, program = AdamsBackend(), default_program(robot)
    backend.emit(robot, program)
    with pytest.raises(RefusedError, match="without an inertia of its motor side"):
        backend.emit(robot, replace(program, control=Control("pd", (10.0,) * 2, (1.0,) * 2)))


@pytest.mark.parametrize("name", ["imece2013", "scara"])
def test_same_bytes_short_lines_and_plain_characters(name):
    robot = replace(robot_of(name), notes=('é & ; \u2028 -- "quoted"',))
    emission = emit(robot, AdamsBackend(), quick_motion(robot), default_pd(robot))
    again = emit(robot, AdamsBackend(), quick_motion(robot), default_pd(robot))
    assert dict(emission.files) == dict(again.files)
    for text in emission.files.values():
        text.encode("ascii")
        assert max(map(len, text.splitlines())) < 240
        assert "nan" not in text.lower().replace("nano", "")
        assert not re.search(r"[^.\w]inf[^\w]", text)
    adm = file_of(emission, "adm")
    assert all(len(line) <= 80 for line in adm.splitlines() if not line.startswith("! "))


@pytest.mark.parametrize(
    ("name", "safe"), [("imece2013", "imece2013"), ("my-robot", "my_robot"), ("7axis", "_7axis"), ("a b.c", "a_b_c")]
)
def test_names_are_safe_in_view(name, safe):
    assert adams_name(name) == safe


def test_a_hyphen_in_a_name_is_none_in_view():
    emission = emit(replace(robot_of("pendulum", "rigid"), name="my-robot"), AdamsBackend())
    assert emission.main == "my_robot.cmd"
    assert "model_name = my_robot\n" in emission.files[emission.main]


@pytest.mark.parametrize("seed", range(4))
def test_euler_angles_give_every_rotation_back(readers, seed):
    rng = np.random.default_rng(seed)
    special = [0.0, math.pi, math.pi / 2.0, -math.pi / 2.0, 1.0e-9, 3.0e-17]
    for b in (*special, *rng.uniform(-3.0, 3.0, 20)):
        turn = readers.model.body313((rng.uniform(-3, 3), b, rng.uniform(-3, 3)))
        pose = Pose.from_matrix(readers.multibody.frame(turn))
        assert readers.model.body313(body313(pose)) == pytest.approx(turn, abs=3e-15)


def test_arms_without_mass_get_next_to_nothing(rebuilt):
    robot = robot_of("planar2r", "rigid")
    one, two = robot.stages
    robot = replace(robot, stages=(replace(one, arm=replace(one.arm, inertia=Inertia())), two))
    masses = [part.mass for part in rebuilt(emit(robot, AdamsBackend())).parts.values()]
    assert 0.0 < masses[1] < 1e-11 * masses[2]
