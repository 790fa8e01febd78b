"""The emitted scripts: each runs by itself, in a bare process, and ends where a run through the interface ends."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from mbexport.backends.common import joint_data
from mbexport.backends.exudyn import ExudynBackend
from mbexport.backends.pybullet import PybulletBackend
from mbexport.core.control import Control
from mbexport.core.files import write_whole
from mbexport.core.motion import from_table
from mbexport.core.representation import (
    ArmSpring,
    Drive,
    FrictionModel,
    Inertia,
    Sensor,
    Slip,
    Spring,
    Stick,
    Term,
)
from mbexport.core.simulation import simulate
from mbexport.core.simulation.backend import Emission, Program

BACKENDS = {"exudyn": ExudynBackend(), "pybullet": PybulletBackend()}
COULOMB = Term("coulomb_friction", "level", "level", (3.0,))
STRIBECK = Term("stribeck_friction", "level", "level", (2.0, 0.1))
LOADED = Term("load_friction", "level", "level", (0.2,))
ERROR = tuple(Term("transmission_error", name, name, (1e-3, 5.0, 0.3)) for name in ("error", "error_slope"))
SOFT = Spring(4.0e3, 20.0)
STICK = Stick(1.0e-4, 5.0e-3)
RIGID = Drive()
ROTOR = Drive(inertia=2.0, damping=1.5, gain=0.9, terms=(COULOMB, STRIBECK), stick=STICK, torque_limit=25.0)
ELASTIC = Drive(inertia=1.0, spring=SOFT, damping=0.7, arm_springs=(ArmSpring(20.0, 0.1), ArmSpring(5.0, -0.2)))
LAWS = Drive(inertia=1.0, spring=SOFT, terms=(COULOMB, *ERROR), slips=(Slip(50.0, 1.0), Slip(20.0, 2.0)), stick=STICK)
GAP = Drive(inertia=1.0, spring=replace(SOFT, gap=2e-3))
PD = Control("pd", (400.0, 300.0, 200.0), (40.0, 30.0, 20.0), "inverse_dynamics", 500.0, (60.0, 50.0, 40.0))

CASES = {
    "rigid, imposed": ((RIGID, ROTOR, RIGID), Control()),
    "elastic, imposed": ((ELASTIC, LAWS, GAP), Control()),
    "elastic and rigid, imposed": ((ROTOR, ELASTIC, RIGID), Control()),
    "linear, pd": ((ELASTIC, replace(ROTOR, terms=(), stick=None), RIGID), PD),
    "laws, pd": ((ROTOR, LAWS, GAP), PD),
    "friction under load, pd": (
        (replace(ROTOR, terms=(COULOMB, LOADED)), ELASTIC, replace(ROTOR, terms=(LOADED,))),
        PD,
    ),
    "torque": ((ROTOR, ELASTIC, RIGID), Control("torque", rate=500.0)),
}


@pytest.fixture(scope="module")
def robot_of(random_robot):
    def make(drives, **changes):
        robot = random_robot(21, len(drives))
        stages = [replace(stage, drive=drive) for stage, drive in zip(robot.stages, drives, strict=True)]
        return replace(robot, stages=tuple(stages), **changes)

    return make


@pytest.fixture(scope="module")
def law():
    # Akima: the acceleration jumps at the knots, which lie on the steps
    rng = np.random.default_rng(4)
    return from_table(np.linspace(0.0, 0.06, 7), 0.2 + 0.02 * rng.normal(size=(7, 3)))


def with_sensors(robot, sensors):
    stages = [replace(stage, sensor=sensor) for stage, sensor in zip(robot.stages, sensors, strict=True)]
    return replace(robot, stages=tuple(stages))


def run_alone(emission, folder, *arguments):
    write_whole(folder, emission.files)
    command = [sys.executable, emission.main, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    line = next(line for line in done.stdout.splitlines() if line.startswith("tip in base [m]:"))
    return np.array([float(number) for number in line.split(":")[1].split()]), done.stdout


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_script_ends_where_a_run_ends(robot_of, law, tmp_path, backend, case):
    drives, control = CASES[case]
    sensors = (Sensor(0.01), Sensor(-0.02), Sensor())
    robot = robot_of(drives, delay=0.0013, kp_factor=(1.1, 1.0, 0.9), kd_factor=(0.9, 1.0, 1.2))
    robot = with_sensors(robot, sensors)
    backend = BACKENDS[backend]
    torque = np.zeros((26, 3)) if control.mode == "torque" else None
    trace = simulate(robot, backend, law, control, duration=0.05, rate=500.0, step=2.5e-4, torque=torque)
    tip, text = run_alone(backend.emit(robot, Program(law, control, 0.05, 2.5e-4)), tmp_path)
    assert np.allclose(tip, trace.tip[-1], rtol=0.0, atol=1e-12)
    assert backend.engine in text
    assert {path.suffix for path in tmp_path.iterdir()} <= {".py", ".urdf"}  # nothing else was written


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_a_smooth_script_too(robot_of, law, tmp_path, backend):
    robot = robot_of((ROTOR, LAWS, ROTOR), friction=FrictionModel("smooth", 0.01))
    trace = simulate(robot, backend, law, PD, duration=0.02, step=2.5e-4)
    tip, _ = run_alone(backend.emit(robot, Program(law, PD, 0.02, 2.5e-4)), tmp_path)
    assert np.allclose(tip, trace.tip[-1], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_what_runs_is_what_was_emitted(robot_of, program, backend):
    robot = robot_of((ELASTIC, ROTOR, ELASTIC))
    emission = backend.emit(robot, program(3))
    edits = [
        ('"inertia": 2.0', '"inertia": 2.5'),
        ('"stiffness": 4000.0', '"stiffness": 5000.0'),
    ]
    text = emission.files[emission.main]
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    engine = backend.load(Emission(emission.backend, emission.main, {**emission.files, emission.main: text}, ()))
    assert engine.motor_inertia() == pytest.approx([1.0, 2.5, 1.0], rel=1e-14)
    zero = np.zeros(3)
    on_arm, on_motor = engine.drive_torque(zero, zero, np.array([0.1, 0.0, 0.1]), zero)
    # the springs on the arm side pull by 20 0.1 - 5 0.2 = 1 N m at 0
    assert on_arm == pytest.approx([500.0 + 1.0, 0.0, 500.0 + 1.0], rel=1e-13)
    assert on_motor == pytest.approx([-500.0, 0.0, -500.0], rel=1e-13)


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_same_bytes_and_an_unchanged_robot(robot_of, law, backend):
    robot = robot_of((ROTOR, LAWS, GAP))
    before = repr(robot)
    first, second = (backend.emit(robot, Program(law, PD, 0.05, 1e-4)) for _ in range(2))
    assert first.files == second.files
    assert first.concepts == second.concepts
    assert repr(robot) == before


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_every_datum_is_in_the_concepts_and_exact(robot_of, program, backend):
    robot = robot_of((ROTOR, LAWS, GAP), delay=0.01, kp_factor=(2.0, 1.0, 1.0))
    concepts = backend.emit(robot, program(3)).concepts
    said = {concept.datum for concept in concepts}
    assert {datum for stage in robot.stages for datum in joint_data(stage)} <= said
    assert {"gravity", "base", "kinematics", "corrections", "inertia", "tool", "delay", "controller_gain"} <= said
    assert {concept.status for concept in concepts} == {"exact"}
    assert all(concept.how for concept in concepts)


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_a_script_carries_only_the_laws_in_use(robot_of, program, backend):
    text = backend.emit(robot_of((ROTOR, RIGID, RIGID)), program(3)).files
    text = next(text for name, text in text.items() if name.endswith(".py"))
    assert "def coulomb_friction_level(" in text
    assert "def stribeck_friction_level(" in text
    assert "load_friction" not in text
    assert "def loaded_torques(" not in text


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_no_text_of_a_robot_breaks_out(robot_of, program, tmp_path, backend):
    evil = 'x"""\nraise SystemExit(3)\n# \'\\'
    robot = robot_of((RIGID, RIGID, RIGID), notes=(evil,), level=evil, source_hash=evil)
    emission = backend.emit(robot, Program(program(3).motion, Control(), 0.01, 1e-3))
    run_alone(emission, tmp_path)


@pytest.mark.parametrize("backend", BACKENDS.values(), ids=BACKENDS)
def test_what_cannot_move_is_refused_by_name(random_robot, program, backend):
    robot = random_robot(2, 3)
    arm = replace(robot.stages[2].arm, inertia=Inertia())
    weightless = replace(robot, stages=(*robot.stages[:2], replace(robot.stages[2], arm=arm)))
    assert "joint_3" in backend.refusal(weightless, None)
    assert backend.refusal(robot, program(3)) is None
    light = replace(robot, stages=(replace(robot.stages[0], drive=Drive(spring=SOFT)), *robot.stages[1:]))
    assert "joint_1" in backend.refusal(light, program(3, PD))
    assert backend.refusal(light, program(3)) is None
