"""A robot in which every fault shows, and ways to plant one: in the reader, in the build, in an emitter."""

from dataclasses import replace

import pytest

import mbexport.core.build
import mbexport.core.database
from mbexport.core.agreement import agree
from mbexport.core.effects.effect import with_stage
from mbexport.core.simulation import backend_named

SETTINGS = """\
name: subject
gravity: [0, 0, -9.81]
base: {xyz: [0.1, 0, 0.2], rpy: [0.2, -0.1, 0.4]}
tool: {xyz: [0.02, 0, 0.1], rpy: [0, 0.3, 0]}
products_of_inertia: integral
friction: {model: smooth, velocity: 1.0e-2}
"""

TABLES = {
    "kinematics": """\
arm alpha[deg] a[mm] theta[deg] d[mm] beta[deg]
1  90  260   0  270  0
2   5  680  90    0  1.5
3  80   30   0   60  0
4   0  100  20  155  0
""",
    "corrections": """\
arm theta[deg] d[mm]
0 0 50
1 10 72
2 0 72
3 0 200
4 0 0
""",
    "inertia": """\
arm mass x y z Ixx Iyy Izz Ixy Ixz Iyz
1 75.4 -0.1504 -0.1227 -0.0175 1.92  2.63  2.9   -0.921    0.187   0.160
2 38.3 -0.361  -0.0003  0.1595 0.16  2.15  2.15   1.07e-3 -5.3e-2 -5.5e-4
3 40.5  0.0187 -0.006  -0.0276 1.36  1.31  0.39   3.04e-3 -2.19e-2 -2.4e-2
4 10.9  0.05    0.164  -0.0042 0.114 0.0338 0.112 -1e-3    3.91e-4 -7.64e-3
""",
    "joints": "joint type\n1 revolute\n2 revolute\n3 revolute\n4 revolute\n",
    "effects/rotor_inertia": "joint inertia\n1 60\n2 60\n3 25\n4 3\n",
    "effects/joint_compliance": "joint stiffness[N*m/rad] damping\n2 67000 550\n4 67000 110\n",
    "effects/viscous_friction": "joint coefficient\n1 30\n2 40\n3 20\n4 6\n",
    "effects/coulomb_friction": "joint torque\n2 8\n3 5\n",
}


def motion_table():
    """Out and back in 1 s, each joint its own way, at knots of 20 ms: a smooth law by its positions."""
    lines = ["t q1 q2 q3 q4"]
    for k in range(51):
        u = 1 - abs(k - 25) / 25
        s = u**3 * (10 - 15 * u + 6 * u * u)
        lines.append(" ".join(repr(x) for x in (k * 0.02, 0.4 * s, -0.3 * s, 0.5 * s, -0.6 * s)))
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="session")
def subject(tmp_path_factory):
    """The robot's folder."""
    folder = tmp_path_factory.mktemp("subject")
    (folder / "robot.yaml").write_text(SETTINGS)
    for name, text in {**TABLES, "motions/wave": motion_table()}.items():
        file = folder / f"{name}.dat"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
    return folder


@pytest.fixture(scope="session")
def healthy(subject):
    """The subject agrees before anything is planted; else no fault below proves a thing."""
    answer = agree(subject, ["mjcf", "urdf", "exudyn", "pybullet"], quantities=STATICS, states=12)
    assert answer.agreed, answer.sentences
    return subject


STATICS = (
    "tool_position", "tool_orientation", "mass_matrix", "gravity", "bias", "inverse_dynamics", "motor_inertia",
    "drive_torque", "acceleration", "static_sag",
)  # fmt: skip


@pytest.fixture
def plant(monkeypatch):
    """Plant a change of the representation: "build" in what all engines get, or a backend's name in its emitter alone.

    Returns the backends to compare.
    """

    def planted(where, change):
        if where == "build":
            genuine = mbexport.core.build.build
            monkeypatch.setattr(mbexport.core.build, "build", lambda *args, **kw: change(genuine(*args, **kw)))
            return ["mjcf", "urdf"]
        others = [name for name in ("mjcf", "urdf") if name != where]
        return [faulty(where, change=change), *others]

    return planted


@pytest.fixture
def misread(monkeypatch):
    """Plant a change of the database behind the reader."""

    def planted(change):
        genuine = mbexport.core.database.load
        monkeypatch.setattr(mbexport.core.database, "load", lambda source: change(genuine(source)))
        return ["mjcf", "urdf"]

    return planted


def faulty(name, change=None, text=None, load=None):
    """A backend that emits another robot, or another text, or hands out another engine."""
    genuine = backend_named(name)

    class Faulty(type(genuine)):
        def emit(self, robot, program):
            emission = super().emit(change(robot) if change else robot, program)
            if text is None:
                return emission
            files = {file: text(content) for file, content in emission.files.items()}
            assert files != dict(emission.files), "the fault was not planted"
            return replace(emission, files=files)

        def load(self, emission):
            engine = super().load(emission)
            return load(engine) if load else engine

    return Faulty()


@pytest.fixture(scope="session")
def faulty_backend():
    return faulty


@pytest.fixture(scope="session")
def statics():
    return STATICS


def change_arm(number, change):
    """Robot -> robot with the arm of that number changed."""
    return lambda robot: with_stage(robot, number, lambda stage: replace(stage, arm=change(stage.arm)))


@pytest.fixture(scope="session")
def arm_changed():
    return change_arm
