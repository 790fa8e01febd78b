from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.errors import UsageError
from mbexport.core.kinematics import inverse_kinematics, kinematics
from mbexport.core.kinematics.inverse import independent_joints, rotation_vector
from mbexport.core.representation import Arm, Joint, Pose, Robot, Stage, VeitscheggerWu


def planar(lengths: tuple[float, ...], **limits: float) -> Robot:
    stages = tuple(
        Stage(Joint(f"joint_{i + 1}", **limits), Arm(f"arm_{i + 1}", VeitscheggerWu(a=length)))
        for i, length in enumerate(lengths)
    )
    return Robot("planar", (0.0, -9.81, 0.0), Pose(), VeitscheggerWu(), stages)


@pytest.mark.parametrize("n", [6, 7, 8])
def test_solves_a_pose(random_robot: Callable[[int, int], Robot], n: int) -> None:
    robot = random_robot(n, n)
    solver, chain = inverse_kinematics(robot), kinematics(robot)
    rng = np.random.default_rng(n)
    solved = 0
    for _ in range(10):
        q = rng.uniform(-1, 1, size=n)
        target = chain.tool_in_base(q)
        try:
            found = solver.solve(target, q + rng.uniform(-0.3, 0.3, size=n))
        except UsageError:
            continue  # random postures may be singular
        assert np.allclose(chain.tool_in_base(found), target, rtol=0, atol=1e-10)
        solved += 1
    assert solved >= 8


def test_axis_leaves_the_turn_about_it_free(random_robot: Callable[[int, int], Robot]) -> None:
    robot = random_robot(6, 6)
    solver, chain = inverse_kinematics(robot, "axis"), kinematics(robot)
    q = np.random.default_rng(3).uniform(-1, 1, size=6)
    target = chain.tool_in_base(q)
    target[:3, :3] = target[:3, :3] @ Pose.from_rpy((0, 0, 0), (0.0, 0.0, 1.0)).rotation_matrix()
    found = chain.tool_in_base(solver.solve(target, q + 0.1))
    assert np.allclose(found[:3, 2:], target[:3, 2:], rtol=0, atol=1e-10)
    assert not np.allclose(found[:3, 0], target[:3, 0], atol=1e-3)


def test_turns_into_limits() -> None:
    """The elbow starts a whole turn off."""
    robot = planar((0.5, 0.4), lower=-math.pi, upper=math.pi)
    target = kinematics(robot).tool_in_base([0.3, 1.0])
    found = inverse_kinematics(robot, "position").solve(target, np.array([0.3, 1.0 + 2 * math.pi]))
    assert np.allclose(found, [0.3, 1.0], atol=1e-9)


def test_out_of_reach_says_how_far() -> None:
    solver = inverse_kinematics(planar((0.5, 0.4)), "position")
    target = np.eye(4)
    target[0, 3] = 1.2
    with pytest.raises(UsageError, match=r"cannot put its tool at \(1\.2, 0, 0\).*0\.3 m"):
        solver.solve(target, np.array([0.1, 0.1]))


def line(robot: Robot, start: np.ndarray, end: tuple[float, float], count: int = 60) -> np.ndarray:
    targets = np.repeat(kinematics(robot).tool_in_base(start)[None], count, axis=0)
    targets[:, :2, 3] = np.linspace(targets[0, :2, 3], end, count)
    return targets


def test_follows_a_line_with_exact_speeds() -> None:
    robot = planar((0.5, 0.4, 0.2))
    solver, chain = inverse_kinematics(robot), kinematics(robot)
    start = np.array([0.2, 1.0, 0.5])
    targets = line(robot, start, (0.3, 0.5))
    q = solver.follow(targets, start)
    assert np.allclose(chain.tool_in_base(q), targets, rtol=0, atol=1e-12)
    twist = np.array([0.2, -0.1, 0, 0, 0, 0.3])
    dq = solver.speeds(q[5], twist)
    assert np.allclose(chain.jacobian(q[5]) @ dq, twist, atol=1e-12)
    ddq = solver.accelerations(q[5], dq, twist)
    h = 1e-5  # speed a moment later, were the accelerations held
    later = chain.jacobian(q[5] + h * dq + 0.5 * h * h * ddq) @ (dq + h * ddq)
    assert np.allclose((later - chain.jacobian(q[5]) @ dq) / h, twist, atol=1e-4)


def test_names_limit_joint_and_place() -> None:
    robot = planar((0.5, 0.4), lower=-2.0, upper=1.2)
    start = np.array([0.2, 1.0])
    targets = line(robot, start, (0.3, 0.2))
    with pytest.raises(
        UsageError, match=r"path position 0\.\d+ m of 1 m: .*joint_2 to 1\.2\d* rad.*upper limit 1\.2 rad"
    ):
        inverse_kinematics(robot, "position").follow(targets, start, np.linspace(0, 1, 60))


def test_names_what_is_singular() -> None:
    robot = planar((0.5, 0.4))
    start = np.array([0.2, 0.3])
    targets = line(robot, start, (0.9 - 1e-8, 0.0), 200)
    with pytest.raises(UsageError, match=r"pose \d+: it is singular there, .*joint_2.*singular values"):
        inverse_kinematics(robot, "position").follow(targets, start)


def test_names_a_jump() -> None:
    """Close by the axis of the first joint, which must turn by nearly pi at once."""
    robot = planar((0.5, 0.5))
    start = np.array([0.0, 2.9])
    x, y = kinematics(robot).tool_in_base(start)[:2, 3]
    with pytest.raises(UsageError, match=r"without a jump: joint_1 would go from"):
        inverse_kinematics(robot, "position").follow(line(robot, start, (-x + 0.02, -y), 12), start)


def test_unreachable_along_the_path() -> None:
    robot = planar((0.5, 0.4))
    start = np.array([0.2, 1.3])
    with pytest.raises(UsageError, match=r"cannot follow the path at pose \d+, tool at .*off"):
        inverse_kinematics(replace(robot, name="short"), "position").follow(line(robot, start, (2.0, 0.0), 300), start)


def test_independent_joints_of_redundant_and_planar_arms(random_robot: Callable[[int, int], Robot]) -> None:
    q = np.full(8, 0.4)
    solver = inverse_kinematics(random_robot(8, 8))
    free = independent_joints(solver, q)
    assert len(free) == 6
    assert inverse_kinematics(solver.robot, free=free).condition(q) > 1e-3
    assert independent_joints(inverse_kinematics(planar((0.5, 0.4)), "position"), q[:2]) == (0, 1)
    assert (
        len(independent_joints(inverse_kinematics(planar((0.5, 0.4, 0.3, 0.2))), np.array([0.1, 0.5, 0.9, 0.4]))) == 3
    )


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 1.0, 3.0, math.pi - 1e-7, math.pi])
def test_rotation_vector(angle: float) -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k
    got = rotation_vector(rotation)
    assert min(np.abs(got - angle * axis).max(), np.abs(got + angle * axis).max() if angle == math.pi else 1) < 1e-8
