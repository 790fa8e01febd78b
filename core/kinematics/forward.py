"""Forward kinematics and Jacobian, for one position of the joints or many at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..representation import Pose, Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """The constant transforms of a chain; positions q have shape (..., n) [rad or m].

    Attributes:
        prismatic: True where the joint slides, shape (n,).
        joint_in_previous: Joint i at zero in the moving frame of joint i-1 (0: the base), shape (n, 4, 4).
        arm_in_joint: Veitschegger-Wu frame of arm i in the moving frame of its joint, shape (n, 4, 4).
        tool_in_last_joint: Tool centre point in the last moving joint frame, shape (4, 4).
    """

    prismatic: NDArray[np.bool_]
    joint_in_previous: Array
    arm_in_joint: Array
    tool_in_last_joint: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.prismatic)

    def joints_in_base(self, q: ArrayLike) -> Array:
        """Moving joint frames, shape (..., n, 4, 4)."""
        q = self._positions(q)
        frames = np.empty((*q.shape, 4, 4))
        still = np.eye(4)
        frame = still
        for i in range(self.n):
            move = np.empty((*q.shape[:-1], 4, 4))
            move[...] = still
            if self.prismatic[i]:
                move[..., 2, 3] = q[..., i]
            else:
                move[..., 0, 0] = move[..., 1, 1] = np.cos(q[..., i])
                move[..., 1, 0] = np.sin(q[..., i])
                move[..., 0, 1] = -move[..., 1, 0]
            frame = frame @ self.joint_in_previous[i] @ move
            frames[..., i, :, :] = frame
        return frames

    def arms_in_base(self, q: ArrayLike) -> Array:
        """Veitschegger-Wu frames of the arms, shape (..., n, 4, 4)."""
        return self.joints_in_base(q) @ self.arm_in_joint

    def tool_in_base(self, q: ArrayLike) -> Array:
        """Tool centre point, shape (..., 4, 4)."""
        return self.joints_in_base(q)[..., -1, :, :] @ self.tool_in_last_joint

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobian of the tool centre point in base axes, shape (..., 6, n): linear, then angular velocity.

        Column of a revolute joint: (z x (p - p_i), z), of a prismatic one: (z, 0) (Siciliano et al., 2009, eq. 3.30).
        """
        return self.tool_and_jacobian(q)[1]

    def tool_and_jacobian(self, q: ArrayLike) -> tuple[Array, Array]:
        """Tool centre point (..., 4, 4) and its geometric Jacobian (..., 6, n) from one pass."""
        joints = self.joints_in_base(q)
        tool = joints[..., -1, :, :] @ self.tool_in_last_joint
        axis = joints[..., :, :3, 2]  # (..., n, 3)
        arm = tool[..., None, :3, 3] - joints[..., :, :3, 3]
        slides = self.prismatic[:, None]
        linear = np.where(slides, axis, _cross(axis, arm))
        angular = np.where(slides, 0.0, axis)
        return tool, np.swapaxes(np.concatenate([linear, angular], axis=-1), -1, -2)

    def jacobian_rate(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Time derivative of the Jacobian at speeds dq (..., n), shape (..., 6, n): acceleration = J ddq + (dJ/dt) dq.

        Every axis turns with its own joint's angular velocity, and every lever arm changes with the difference of the
        tool's and the joint's velocity.
        """
        q = self._positions(q)
        dq = np.asarray(dq, dtype=np.float64)[..., None]
        joints = self.joints_in_base(q)
        tool = joints[..., -1, :, :] @ self.tool_in_last_joint
        axis = joints[..., :, :3, 2]
        origin = joints[..., :, :3, 3]
        slides = self.prismatic[:, None]
        turning = np.where(slides, 0.0, axis) * dq
        omega = np.cumsum(turning, axis=-2)  # of the moving joint frames, (..., n, 3)
        # velocity of a joint's origin: every earlier turn about its axis, every slide up to its own along its axis
        sliding = np.where(slides, axis, 0.0) * dq
        about = np.cumsum(_cross(turning, -origin), axis=-2)
        moved = np.cumsum(sliding, axis=-2)
        velocity = about + _cross(omega, origin) + moved
        tool_velocity = velocity[..., -1, :] + _cross(omega[..., -1, :], tool[..., :3, 3] - origin[..., -1, :])
        axis_rate = _cross(omega, axis)
        arm = tool[..., None, :3, 3] - origin
        arm_rate = tool_velocity[..., None, :] - velocity
        linear = np.where(slides, axis_rate, _cross(axis_rate, arm) + _cross(axis, arm_rate))
        angular = np.where(slides, 0.0, axis_rate)
        return np.swapaxes(np.concatenate([linear, angular], axis=-1), -1, -2)

    def _positions(self, q: ArrayLike) -> Array:
        array = np.asarray(q, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != self.n:
            raise ValueError(f"positions must end in {self.n} joints, not have shape {array.shape}")
        return array


def _cross(a: Array, b: Array) -> Array:
    """Vector product over the last axis; np.cross takes three times as long for one posture."""
    x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    y = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    z = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.stack([x, y, z], axis=-1)


def kinematics(robot: Robot) -> Kinematics:
    """The constant transforms of a robot's chain; hold on to it where there are many calls."""
    stages = range(robot.n)
    return Kinematics(
        prismatic=np.array([stage.joint.kind == "prismatic" for stage in robot.stages]),
        joint_in_previous=np.array([robot.joint_in_previous(i).matrix() for i in stages]),
        arm_in_joint=np.array([robot.arm_in_joint(i).matrix() for i in stages]),
        tool_in_last_joint=robot.tool_in_last_joint().matrix(),
    )


def joints_in_base(robot: Robot, q: ArrayLike) -> Array:
    """Moving joint frames, shape (..., n, 4, 4), of positions (..., n) [rad or m]."""
    return kinematics(robot).joints_in_base(q)


def arms_in_base(robot: Robot, q: ArrayLike) -> Array:
    """Veitschegger-Wu frames of the arms, shape (..., n, 4, 4), of positions (..., n) [rad or m]."""
    return kinematics(robot).arms_in_base(q)


def tool_in_base(robot: Robot, q: ArrayLike) -> Array:
    """Tool centre point, shape (..., 4, 4), of positions (..., n) [rad or m]."""
    return kinematics(robot).tool_in_base(q)


def jacobian(robot: Robot, q: ArrayLike) -> Array:
    """Geometric Jacobian of the tool centre point in base axes, shape (..., 6, n): linear, then angular velocity."""
    return kinematics(robot).jacobian(q)


def reach(robot: Robot) -> float:
    """Length of the chain stretched out [m]: the distances from arm to arm and to the tool, slides at their longest.

    An upper bound of how far the tool gets from the base; slides without limits count with their place at home.
    """
    poses: list[Pose] = [stage.arm.link.pose() for stage in robot.stages]
    length = math.hypot(*robot.tool.xyz)
    for stage, pose in zip(robot.stages, poses, strict=True):
        x, y, z = pose.xyz
        if stage.joint.kind == "prismatic":
            ends = [end for end in (stage.joint.lower, stage.joint.upper) if math.isfinite(end)]
            z = max(abs(z + end) for end in (ends or [stage.joint.home]))
        length += math.hypot(x, y, z)
    return length
