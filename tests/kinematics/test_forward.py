from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mbexport.core.kinematics import arms_in_base, jacobian, joints_in_base, kinematics, reach, tool_in_base
from mbexport.core.kinematics.inverse import rotation_vector
from mbexport.core.representation import Arm, Joint, Pose, Robot, Stage, VeitscheggerWu


def product_of_the_tables(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Equation 2 of the paper, arm after arm, without a word of corrections."""
    frames, frame = [], np.eye(4)
    for stage, value in zip(robot.stages, q, strict=True):
        move = {"theta": value} if stage.joint.kind == "revolute" else {"d": value}
        frame = frame @ (stage.arm.link + VeitscheggerWu(**move)).matrix()
        frames.append(frame)
    return frames


@pytest.mark.parametrize("seed", range(4))
def test_arms_are_the_product_of_the_tables(random_robot: Callable[[int, int], Robot], seed: int) -> None:
    robot = random_robot(seed, 5)
    q = np.random.default_rng(seed).uniform(-2, 2, size=5)
    frames = product_of_the_tables(robot, q)
    assert np.allclose(arms_in_base(robot, q), frames, rtol=0, atol=1e-14)
    assert np.allclose(tool_in_base(robot, q), frames[-1] @ robot.tool.matrix(), rtol=0, atol=1e-14)


def test_joints_stand_at_their_real_places(random_robot: Callable[[int, int], Robot]) -> None:
    """A_Tot = A_VW A_GC (equation 4) places the next joint; the frame then turns about its own z."""
    robot = random_robot(2, 4)
    q = np.random.default_rng(0).uniform(-2, 2, size=4)
    joints, arms = joints_in_base(robot, q), product_of_the_tables(robot, q)
    for i in range(1, 4):
        real = arms[i - 1] @ robot.stages[i - 1].arm.correction.matrix()
        assert np.allclose(joints[i][:3, 2], real[:3, 2], rtol=0, atol=1e-14)
        if robot.stages[i].joint.kind == "revolute":
            assert np.allclose(joints[i][:3, 3], real[:3, 3], rtol=0, atol=1e-14)


def test_leading_axes(random_robot: Callable[[int, int], Robot]) -> None:
    chain = kinematics(random_robot(1, 3))
    q = np.random.default_rng(0).uniform(-2, 2, size=(2, 4, 3))
    assert chain.joints_in_base(q).shape == (2, 4, 3, 4, 4)
    assert chain.jacobian(q).shape == chain.jacobian_rate(q, q).shape == (2, 4, 6, 3)
    # matrix products of a stack and of one matrix may differ in the last bit
    for got, want in (
        (chain.tool_in_base(q)[1, 2], chain.tool_in_base(q[1, 2])),
        (chain.jacobian(q)[1, 2], chain.jacobian(q[1, 2])),
        (chain.jacobian_rate(q, q)[1, 2], chain.jacobian_rate(q[1, 2], q[1, 2])),
    ):
        assert np.allclose(got, want, rtol=0, atol=1e-14)
    with pytest.raises(ValueError, match="3 joints"):
        chain.tool_in_base(np.zeros(2))


@pytest.mark.parametrize("seed", range(3))
def test_jacobian_by_differences(random_robot: Callable[[int, int], Robot], seed: int) -> None:
    robot = random_robot(seed, 5)
    rng = np.random.default_rng(seed)
    q, dq = rng.uniform(-2, 2, size=(2, 5))
    h = 1e-6
    J = jacobian(robot, q)
    for i in range(5):
        e = h * np.eye(5)[i]
        plus, minus = tool_in_base(robot, q + e), tool_in_base(robot, q - e)
        assert np.allclose((plus - minus)[:3, 3] / (2 * h), J[:3, i], atol=1e-9)
        assert np.allclose(rotation_vector(plus[:3, :3] @ minus[:3, :3].T) / (2 * h), J[3:, i], atol=1e-9)
    rate = (jacobian(robot, q + h * dq) - jacobian(robot, q - h * dq)) / (2 * h)
    assert np.allclose(kinematics(robot).jacobian_rate(q, dq), rate, atol=1e-8)


def test_reach_counts_links_slides_and_tool() -> None:
    stages = (
        Stage(Joint("joint_1"), Arm("arm_1", VeitscheggerWu(a=0.3, d=0.4))),
        Stage(Joint("joint_2", "prismatic", lower=-0.1, upper=0.2), Arm("arm_2", VeitscheggerWu(d=0.1))),
    )
    robot = Robot("a", (0, 0, -9.81), Pose(), VeitscheggerWu(), stages, Pose((0.0, 0.0, 0.05)))
    assert reach(robot) == pytest.approx(0.5 + 0.3 + 0.05)
