"""Functions for Simscape Multibody, rebuilt by a reader of the class API, and run by Octave on stand-ins of it."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.backends.simscape import SimscapeBackend
from mbexport.backends.simscape_text import matlab_name
from mbexport.backends.urdf_text import urdf_text
from mbexport.core.control import Control, default_pd
from mbexport.core.errors import RefusedError
from mbexport.core.export import default_program, emit
from mbexport.core.kinematics import dynamics, tool_in_base
from mbexport.core.motion import hold, motion_named, point_to_point
from mbexport.core.representation import (
    ArmSpring,
    Bend,
    Drive,
    FrictionModel,
    Mount,
    Sensor,
    Slip,
    Spring,
    Term,
)
from mbexport.core.simulation.drive_sheet import DriveSheet
from mbexport.core.simulation.drives import Drives

TIP = 1.0e-6
STATICS = 1.0e-10


def robot_of(name, level="full"):
    return mbexport.build(mbexport.load(name), level)


def build_text(emission):
    return emission.files[emission.main]


def arms_of(machine, robot):
    return [machine.names.index(stage.joint.name) for stage in robot.stages]


def statics_differ(build, robot):
    machine, _ = build.machine()
    arms = arms_of(machine, robot)
    q = np.random.default_rng(1).uniform(-0.6, 0.6, robot.n)
    x = np.zeros(machine.n)
    x[arms] = q
    matrix, weight = machine.mass_matrix(x)[np.ix_(arms, arms)], machine.gravity(x)[arms]
    known = dynamics(robot)
    expected, expected_weight = known.mass_matrix(q), known.gravity(q)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    size = max(float(np.abs(expected_weight).max()), 1.0e-3)
    return max(np.abs((matrix - expected) / scale).max(), np.abs(weight - expected_weight).max() / size)


def quick_motion(robot, turn=0.2, duration=0.4):
    home = np.array(robot.home())
    return point_to_point(home, home + turn * (-1.0) ** np.arange(robot.n), duration)


def followed(machine, motion):
    """The motor sides' law for the rebuilt machine: what NAME_command gives them."""
    joints = [machine.names.index(name) for name in machine.names if name.endswith("_drive")]
    return joints, lambda t: tuple(row[0] for row in motion.at([t]))


@pytest.mark.parametrize(
    ("name", "level"),
    [("imece2013", "compliant"), ("arm7", "full"), ("scara", "full"), ("puma560", "full"), ("pendulum", "rigid")],
)
def test_mass_matrix_and_gravity_are_the_robots(readers, name, level):
    robot = robot_of(name, level)
    assert statics_differ(readers.Build(build_text(emit(robot, SimscapeBackend()))), robot) < STATICS


@pytest.mark.parametrize("seed", range(2))
def test_a_random_robot_is_rebuilt(random_robot, readers, seed):
    robot = random_robot(seed, 5)
    build = readers.Build(build_text(emit(robot, SimscapeBackend())))
    assert statics_differ(build, robot) < STATICS
    machine, start = build.machine()
    tool = np.asarray(tool_in_base(robot, np.array(robot.home())))
    assert build.tip(machine.state(start)) == pytest.approx(tool[:3, 3], abs=1e-12)


@pytest.mark.parametrize(("name", "duration"), [("imece2013", 0.03), ("scara", 0.05)])
def test_compliant_motion_is_as_in_mujoco(readers, name, duration):
    robot = robot_of(name, "compliant")
    motion = quick_motion(robot, 0.1)
    run = mbexport.simulate(robot, "mjcf", motion, duration=duration, rate=100.0)
    build = readers.Build(build_text(emit(robot, SimscapeBackend(), motion)))
    machine, start = build.machine()
    q = machine.run(start, run.t, build.efforts(machine), followed(machine, motion))
    tips = np.array([build.tip(machine.state(row)) for row in q])
    assert np.ptp(run.tip, axis=0).max() > 1.0e-4
    assert np.abs(tips - run.tip).max() < TIP


def elastic_robot():
    """Bearings that give, an arm that bends: joints on springs."""
    robot = robot_of("planar2r", "rigid")
    one, two = robot.stages
    inf = math.inf
    one = replace(one, mount=Mount((4.0e4, inf, inf, inf, 3.0e3), (20.0, 0.0, 0.0, 0.0, 2.0)))
    return replace(robot, stages=(one, replace(two, bend=Bend((800.0, 900.0), (0.4, 0.4), 0.4))))


def test_bearings_that_give_and_arms_that_bend_are_joints_on_springs(readers):
    robot = elastic_robot()
    motion = quick_motion(robot)
    run = mbexport.simulate(robot, "urdf", motion, duration=0.04, rate=100.0)
    build = readers.Build(build_text(emit(robot, SimscapeBackend(), motion)))
    machine, start = build.machine()
    assert len(build.springs) == 4
    joints = [machine.names.index(f"joint_{i}") for i in (1, 2)]
    law = (joints, lambda t: tuple(row[0] for row in motion.at([t])))
    q = machine.run(start, run.t, build.efforts(machine), law)
    assert np.abs(np.array([build.tip(machine.state(row)) for row in q]) - run.tip).max() < TIP


def test_the_robot_stands_sagged_and_at_rest(readers):
    robot = robot_of("imece2013", "compliant")
    build = readers.Build(build_text(emit(robot, SimscapeBackend())))
    machine, start = build.machine()
    state = machine.state(start)
    torque = machine.efforts(state, build.efforts(machine)) - machine.equations(state)[1]
    assert np.abs(torque[arms_of(machine, robot)]).max() < 1.0e-7
    assert np.abs(start).max() > 1.0e-4
    assert all(build.targets[name, "speed"] == 0.0 for name in machine.names)


def change(pattern, new):
    return lambda text: re.sub(pattern, new, text)


FAULTS = {
    "products in the order of other formats": change(
        r"(solid\(38\.3.*\n.*\n    )\[(\S+) (\S+) (\S+)\]", r"\1[\4 \3 \2]"
    ),
    "a product with the other sign": change(r"\[0\.053 ", "[-0.053 "),
    "lengths in millimetres": change(r'Value\(xyz, "m"\)', 'Value(xyz, "mm")'),
    "inertias in another unit": change(r'Value\(moments, "kg\*m\^2"\)', 'Value(moments, "kg*mm^2")'),
    "the default gravity": change(r"robot\.Gravity.*\n", ""),
    "a transposed rotation": change(
        r"\[1\.0 0\.0 0\.0; 0\.0 0\.0 -1\.0; 0\.0 1\.0 0\.0\]", "[1.0 0.0 0.0; 0.0 0.0 1.0; 0.0 -1.0 0.0]"
    ),
    "a lost rotation": change(r"(joint_3_seat.*\n    )\[[^\]]*\]", r"\1[1.0 0.0 0.0; 0.0 1.0 0.0; 0.0 0.0 1.0]"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_caught(readers, fault):
    robot = robot_of("imece2013", "compliant")
    text = build_text(emit(robot, SimscapeBackend()))
    planted = FAULTS[fault](text)
    assert planted != text, "nothing was planted"
    assert statics_differ(readers.Build(planted), robot) > 1.0e-4


def unbalanced(build, robot):
    """Largest torque that is left over on an arm where the robot starts [N*m]; and how fast its springs let it turn."""
    machine, start = build.machine()
    state = machine.state(start, np.full(machine.n, 1.0e-3))
    still = machine.state(start)
    efforts = build.efforts(machine)
    left = machine.efforts(still, efforts) - machine.equations(still)[1]
    braking = machine.efforts(state, efforts) - machine.efforts(still, efforts)
    arms = arms_of(machine, robot)
    return np.abs(left[arms]).max(), braking[arms]


@pytest.mark.parametrize(
    ("right", "wrong"),
    [('stiffness, "N*m/rad"', 'stiffness, "N*m/deg"'), ('"rad"), "High"', '"deg"), "High"')],
)
def test_springs_and_starts_in_degrees_do_not_rest(readers, right, wrong):
    robot = robot_of("imece2013", "compliant")
    text = build_text(emit(robot, SimscapeBackend()))
    assert right in text
    assert unbalanced(readers.Build(text), robot)[0] < 1.0e-7
    assert unbalanced(readers.Build(text.replace(right, wrong)), robot)[0] > 1.0


def test_dampers_per_degree_brake_too_much(readers):
    robot = robot_of("imece2013", "compliant")
    text = build_text(emit(robot, SimscapeBackend()))
    said = [-1.0e-3 * stage.drive.spring.damping for stage in robot.stages]
    assert unbalanced(readers.Build(text), robot)[1] == pytest.approx(said)
    planted = readers.Build(text.replace("N*m/(rad/s)", "N*m/(deg/s)"))
    assert unbalanced(planted, robot)[1] == pytest.approx(180.0 / math.pi * np.array(said))


@pytest.mark.parametrize(
    ("pattern", "new", "complaint"),
    [
        (r'addConnector\(arm_1, "joint_2_seat"\);\n', "", "has no connector"),
        (r"(joint_1 = .*\n)(joint_1\.Rz.*\n)(.*\n)", r"\1\3\2", "changed after it was added"),
        (r"RevoluteJoint", "CylindricalJoint", "cannot read"),
        (r'connectVia\(robot, "joint_6", .*\n', "", "hangs on no joint"),
    ],
)
def test_broken_builds_are_found(readers, pattern, new, complaint):
    text = build_text(emit(robot_of("imece2013", "compliant"), SimscapeBackend()))
    assert re.search(pattern, text)
    with pytest.raises((AssertionError, KeyError), match=complaint):
        readers.Build(re.sub(pattern, new, text)).machine()


# executed by Octave on stand-ins that insist on units, connectors and the order of things
@pytest.mark.parametrize("name", ["imece2013", "scara", "puma560"])
def test_octave_parses_every_function(octave, name):
    robot = robot_of(name)
    emission = emit(robot, SimscapeBackend(), quick_motion(robot), default_pd(robot, feedforward="gravity"))
    functions = [file for file in emission.files if file.endswith(".m")]
    assert len(functions) == 4
    octave(emission, "".join(f"__parse_file__([pwd '/{file}']);" for file in functions) + "disp('read')")


def test_octave_would_complain(octave):
    emission = emit(robot_of("pendulum"), SimscapeBackend())
    broken = replace(
        emission, files={**emission.files, emission.main: build_text(emission).replace("end\n", "", 1)[:-20]}
    )
    with pytest.raises(AssertionError, match="error"):
        octave(broken, f"__parse_file__([pwd '/{emission.main}'])")


def test_octave_builds_what_the_reader_reads(octave, readers):
    robot = robot_of("scara", "compliant")
    emission = emit(robot, SimscapeBackend())
    code = """
    [robot, start] = scara_simscape();
    compiled = compile(robot);
    state = computeState(compiled, start);
    links = compiled.links;
    for k = 1:numel(links)
        links(k).rest = state.q(k);
    end
    disp(jsonencode(links))
    """
    built = json.loads(octave(emission, code))
    machine, start = readers.Build(build_text(emission)).machine()
    assert [link["path"].partition("/")[0] for link in built] == machine.names
    assert [link["rest"] for link in built] == pytest.approx(start, rel=1e-4, abs=1e-12)
    for link, own in zip(built, machine.links, strict=True):
        assert np.array(link["seat"]) == pytest.approx(own.in_parent, abs=1e-4)


def test_octave_commands_what_the_law_says(octave):
    database = mbexport.load("imece2013")
    robot = mbexport.build(database, "rigid")
    law = motion_named(robot, "greca", database=database)
    sensors = tuple(replace(stage, sensor=Sensor(0.01 * k)) for k, stage in enumerate(robot.stages))
    robot = replace(robot, stages=sensors, kp_factor=(0.5,) * 6)
    control = default_pd(robot, feedforward="gravity")
    control = replace(control, torque_limit=(400.0,) * 6)
    emission = emit(robot, SimscapeBackend(), law, control)
    times = [-1.0, 0.0, 0.013, 1.777, 6.159, 7.0]
    code = f"""
    for t = {times}
        [q, dq, ddq, torque] = imece2013_command(t, 0.1 * ones(6, 1), 0.2 * ones(6, 1));
        printf("%.17g ", q, dq, ddq, torque);
        printf("\\n");
    end
    """
    rows = np.array([[float(x) for x in line.split()] for line in octave(emission, code).splitlines()])
    q, dq, ddq = law.at(times)
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    assert rows[:, :6] == pytest.approx(q - offsets, abs=1e-13)
    assert rows[:, 6:12] == pytest.approx(dq, abs=1e-11)
    assert rows[:, 12:18] == pytest.approx(ddq, abs=1e-8)
    forward = dynamics(robot).gravity(q)
    wanted = 0.5 * np.array(control.kp) * (q - offsets - 0.1) + np.array(control.kd) * (dq - 0.2) + forward
    held = np.clip(wanted, -400.0, 400.0)
    assert (held != wanted).any()
    assert (held == wanted).any()
    assert rows[:, 18:] == pytest.approx(held, rel=2e-4, abs=0.1)  # the feedforward is a table


def everything():
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


def test_octave_drives_as_the_common_equations(octave):
    robot = everything()
    emission = emit(robot, SimscapeBackend(), hold(robot.home(), 1.0), default_pd(robot))
    rng = np.random.default_rng(2)
    drives = Drives(DriveSheet.of(robot))
    elastic = np.array([stage.drive.spring is not None for stage in robot.stages])
    code, expected, shut = "", [], 0
    for _ in range(8):
        theta, dtheta, tau = rng.uniform(-0.3, 0.3, (3, 4))
        q = theta - np.where(elastic, rng.uniform(-6e-3, 6e-3, 4), 0.0)
        dq = dtheta + np.where(elastic, rng.uniform(-0.2, 0.2, 4), 0.0)
        drives.evaluate(0.0, q, dq, theta, dtheta)
        shut += drives.transmitted[0] == 0.0
        expected.append(np.concatenate([drives.motor_torque(tau), drives.transmitted, drives.on_arm]))
        state = ", ".join("[" + "; ".join(map(repr, row.tolist())) + "]" for row in (q, dq, theta, dtheta, tau))
        code += f"""
        [motor, transmitted, on_arm] = scara_drives(0, {state});
        printf("%.17g ", motor, transmitted, on_arm);
        printf("\\n");
        """
    rows = np.array([[float(x) for x in line.split()] for line in octave(emission, code).splitlines()])
    assert rows == pytest.approx(np.array(expected), rel=1e-11, abs=1e-11)
    assert 0 < shut < 8


def run_by_octave(octave, emission, name, duration):
    """q, theta at the end."""
    code = f"[t, q, theta] = {name}_run({duration!r}); printf('%.17g ', q(end, :), theta(end, :)); disp(t(end))"
    values = [float(x) for x in octave(emission, code).split()]
    assert values[-1] == pytest.approx(duration)
    return np.array(values[:-1]).reshape(2, -1)


def test_octave_runs_imposed_compliant_motion(octave):
    robot = robot_of("planar2r", "compliant")
    motion = quick_motion(robot, 0.4)
    run = mbexport.simulate(robot, "mjcf", motion, duration=0.008, rate=1000.0)
    q, theta = run_by_octave(octave, emit(robot, SimscapeBackend(), motion), "planar2r", 0.008)
    assert theta == pytest.approx(run.joints["q"][-1], abs=1e-9)
    assert q == pytest.approx(run.joints["q_link"][-1], abs=1e-7)
    assert np.abs(q - theta).max() > 1e-4


@pytest.mark.parametrize("level", ["rigid", "compliant"])
def test_octave_runs_a_closed_loop(octave, level):
    """Rotors on rigid and behind elastic joints; the controller is continuous, so runs of ours tick fast."""
    robot = robot_of("planar2r", level)
    if level == "rigid":
        drives = (Drive(inertia=0.4, damping=0.5), Drive(inertia=0.1, gain=0.9))
        stages = tuple(replace(s, drive=d) for s, d in zip(robot.stages, drives, strict=True))
        robot = replace(robot, stages=stages)
    motion = quick_motion(robot, 0.4)
    slow, fast = (
        mbexport.simulate(robot, "mjcf", motion, default_pd(robot, rate=rate), duration=0.008, rate=1000.0)
        for rate in (4000.0, 8000.0)
    )
    q, theta = run_by_octave(octave, emit(robot, SimscapeBackend(), motion, default_pd(robot)), "planar2r", 0.008)
    for ours, signal in ((q, "q_link"), (theta, "q")):
        limit = 2.0 * fast.joints[signal][-1] - slow.joints[signal][-1]
        assert ours == pytest.approx(limit, abs=1e-7)


def test_octave_runs_what_needs_no_integration(octave):
    robot = robot_of("pendulum", "rigid")
    motion = quick_motion(robot)
    q, theta = run_by_octave(octave, emit(robot, SimscapeBackend(), motion), "pendulum", 0.1)
    assert q == pytest.approx(motion.at([0.1])[0][0])
    assert theta == pytest.approx(q)


# what is said, and how it is written
def statuses(emission):
    return {(c.datum, c.at): c.status for c in emission.concepts}


def test_concepts_say_what_the_functions_cannot():
    robot = everything()
    one = robot.stages[0]
    sticking = replace(
        robot,
        friction=FrictionModel("stick", 1.0e-3),
        stages=(replace(one, drive=replace(one.drive, slips=(Slip(100.0, 1.0),))), *robot.stages[1:]),
        delay=0.001,
    )
    smooth, stick = (statuses(emit(r, SimscapeBackend(), control=default_pd(r))) for r in (robot, sticking))
    assert smooth["coulomb_friction", "joint_1"] == "exact"
    assert stick["coulomb_friction", "joint_1"] == "approximated"
    assert stick["friction.model", "joint_1"] == "approximated"
    assert stick["hysteresis", "joint_1"] == "impossible"
    assert stick["delay", "robot"] == "impossible"
    assert stick["control", "all joints"] == "approximated"
    assert stick["motion", "all joints"] == "exact"
    torque = statuses(emit(robot, SimscapeBackend(), control=Control("torque")))
    assert torque["control", "all joints"] == "impossible"


def test_files_names_and_the_urdf_for_smimport(tmp_path):
    robot = robot_of("imece2013", "compliant")
    mbexport.export(robot, ["simscape"], tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    parts = ("command", "drives", "run", "simscape")
    assert names == sorted([f"imece2013_{p}.m" for p in parts] + ["imece2013.urdf", "imece2013.concepts.json"])
    assert (tmp_path / "imece2013.urdf").read_text(encoding="utf-8") == urdf_text(robot)
    main = (tmp_path / "imece2013_simscape.m").read_text(encoding="utf-8")
    assert "smimport(imece2013.urdf) knows neither springs" in main
    # every quantity has a unit
    assert not re.search(r"simscape\.Value\([^,]*\)", main)


def test_nothing_here_runs_it():
    backend = SimscapeBackend()
    assert not backend.runs
    assert backend.version() == ""
    with pytest.raises(RefusedError, match="emitted only"):
        backend.load(emit(robot_of("pendulum"), backend))


def test_a_weightless_motor_side_is_refused():
    robot = robot_of("planar2r", "rigid")
    robot = replace(robot, stages=tuple(replace(s, drive=replace(s.drive, spring=Spring(5e2))) for s in robot.stages))
    backend, program = SimscapeBackend(), default_program(robot)
    backend.emit(robot, program)
    with pytest.raises(RefusedError, match="without an inertia of its motor side"):
        backend.emit(robot, replace(program, control=Control("pd", (10.0,) * 2, (1.0,) * 2)))


def test_same_bytes_and_plain_characters():
    robot = replace(robot_of("scara"), notes=("é ... % \n quoted ' \"",))
    first, again = (emit(robot, SimscapeBackend(), quick_motion(robot), default_pd(robot)) for _ in range(2))
    assert dict(first.files) == dict(again.files)
    for name, text in first.files.items():
        if name.endswith(".m"):
            text.encode("ascii")
            assert not re.search(r"\b(nan|inf)\b", text)


@pytest.mark.parametrize(
    ("name", "safe"),
    [("imece2013", "imece2013"), ("my-robot", "my_robot"), ("7axis", "robot_7axis"), ("_x", "robot__x")],
)
def test_names_are_safe_in_matlab(name, safe):
    assert matlab_name(name) == safe
    assert len(matlab_name("x" * 64) + "_simscape") <= 63
