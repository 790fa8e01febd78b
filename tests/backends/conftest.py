"""Robots by hand, and their statics by matrix products: what engines are held against."""

import numpy as np
import pytest

from mbexport.core.control import Control
from mbexport.core.motion import point_to_point
from mbexport.core.representation import (
    Arm,
    Drive,
    Inertia,
    Joint,
    Pose,
    Robot,
    Spring,
    Stage,
    VeitscheggerWu,
)
from mbexport.core.simulation.backend import MachineState, Program


@pytest.fixture(scope="session")
def random_robot():
    """A robot of any number of joints of both kinds, with beta, corrections, turned base and tool; seeded."""

    def make(seed, n, drive=lambda i: Drive(), revolute_only=False):
        rng = np.random.default_rng(seed)
        kinds = ["revolute" if revolute_only or rng.random() < 0.7 else "prismatic" for _ in range(n)]

        def correction(next_kind):
            # what commutes with the next joint's motion
            a, theta, d = rng.uniform(-0.2, 0.2, 3)
            return VeitscheggerWu(theta=theta, d=d, a=0.0 if next_kind == "revolute" else a)

        stages = []
        for i in range(n):
            link = VeitscheggerWu(*rng.uniform(-1.5, 1.5, 5) * np.array([1.0, 0.4, 1.0, 0.4, 0.3]))
            half = rng.uniform(0.05, 0.4, 3)
            turn = Pose.from_rpy((0.0, 0.0, 0.0), tuple(rng.uniform(-2.0, 2.0, 3))).rotation_matrix()
            mass = float(rng.uniform(1.0, 9.0))
            moments = mass * (np.sum(half**2) - half**2)
            inertia = Inertia.from_tensor(mass, rng.uniform(-0.3, 0.3, 3), turn @ np.diag(moments) @ turn.T)
            next_kind = kinds[i + 1] if i + 1 < n else "revolute"
            arm = Arm(f"arm_{i + 1}", link, correction(next_kind), inertia)
            stages.append(Stage(Joint(f"joint_{i + 1}", kinds[i]), arm, drive(i)))
        base = Pose.from_rpy(tuple(rng.uniform(-1.0, 1.0, 3)), tuple(rng.uniform(-1.0, 1.0, 3)))
        tool = Pose.from_rpy(tuple(rng.uniform(-0.2, 0.2, 3)), tuple(rng.uniform(-1.0, 1.0, 3)))
        return Robot("random", (0.3, -0.2, -9.81), base, correction(kinds[0]), tuple(stages), tool)

    return make


@pytest.fixture(scope="session")
def statics():
    """(tool in base, mass matrix, gravity) by Veitschegger-Wu products and Jacobian sums, without corrections."""

    def compute(robot, q):
        n = robot.n
        gravity = robot.base.rotation_matrix().T @ np.array(robot.gravity)
        frame, axes, origins, matrix, torque = np.eye(4), [], [], np.zeros((n, n)), np.zeros(n)
        for i, stage in enumerate(robot.stages):
            turn = stage.joint.kind == "revolute"
            moved = VeitscheggerWu(theta=q[i]) if turn else VeitscheggerWu(d=q[i])
            axes.append((frame[:3, 2], turn))
            origins.append(frame[:3, 3])
            frame = frame @ (stage.arm.link + moved).matrix()
            body = stage.arm.inertia
            com = frame[:3, :3] @ np.array(body.com) + frame[:3, 3]
            tensor = frame[:3, :3] @ body.tensor() @ frame[:3, :3].T
            linear, angular = np.zeros((3, n)), np.zeros((3, n))
            for j in range(i + 1):
                axis, turns = axes[j]
                linear[:, j] = np.cross(axis, com - origins[j]) if turns else axis
                angular[:, j] = axis if turns else 0.0
            matrix += body.mass * linear.T @ linear + angular.T @ tensor @ angular
            torque -= body.mass * linear.T @ gravity
        return frame @ robot.tool.matrix(), matrix, torque

    return compute


@pytest.fixture(scope="session")
def program():
    """A program for n joints: imposed motion by default."""

    def make(n, control=None):
        return Program(point_to_point([0.0] * n, [0.3] * n, 1.0), control or Control(), 1.0, 1.0e-4)

    return make


@pytest.fixture(scope="session")
def still():
    """The state in which everything is at rest at q."""

    def make(q):
        q = np.array(q, dtype=float)
        return MachineState(0.0, q, np.zeros_like(q), q.copy(), np.zeros_like(q))

    return make


@pytest.fixture(scope="session")
def soft():
    """An elastic drive that is not too stiff for a millisecond."""

    def make(i, **more):
        return Drive(inertia=2.0 + i, spring=Spring(4.0e3 + 300.0 * i, 20.0), **more)

    return make
