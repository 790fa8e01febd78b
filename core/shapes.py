"""Simple shapes drawn from the kinematics, so that every viewer shows a robot; they have no mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .representation import Pose, Robot, Shape

_LIMB = (0.85, 0.47, 0.16, 1.0)
_JOINT = (0.25, 0.27, 0.30, 1.0)
_TOOL = (0.16, 0.50, 0.72, 1.0)


def draw(robot: Robot) -> Robot:
    """The robot with shapes on every arm that has none: a barrel at its joint and a limb to the next one."""
    reach = _reach(robot)
    stages = list(robot.stages)
    for i, stage in enumerate(stages):
        if stage.arm.shapes:
            continue
        thickness = 0.045 * reach * (1.0 - 0.5 * i / max(robot.n, 1))
        joint_in_arm = robot.arm_in_joint(i).inverse()
        shapes = [Shape("cylinder", (0.9 * thickness, 2.2 * thickness), joint_in_arm, rgba=_JOINT)]
        last = i == robot.n - 1
        end = np.array(robot.tool.xyz if last else stage.arm.correction.pose().xyz)
        shapes += _limb(np.array(joint_in_arm.xyz), end, 0.6 * thickness)
        if last:
            shapes.append(Shape("sphere", (0.4 * thickness,), robot.tool, rgba=_TOOL))
        stages[i] = replace(stage, arm=replace(stage.arm, shapes=tuple(shapes)))
    return replace(robot, stages=tuple(stages))


def _reach(robot: Robot) -> float:
    """Sum of the arms' lengths [m], at least a decimetre so that shapes can be seen."""
    return max(sum(abs(stage.arm.link.a) + abs(stage.arm.link.d) for stage in robot.stages), 0.1)


def _limb(start: NDArray[np.float64], end: NDArray[np.float64], radius: float) -> list[Shape]:
    """A cylinder between two points, none where they are one."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length < radius:
        return []
    z = along / length
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    matrix[:3, 3] = (start + end) / 2
    return [Shape("cylinder", (radius, length), Pose.from_matrix(matrix), rgba=_LIMB)]
