"""Elastic parts of a robot as joints without a drive: what engines run where bearings give or arms bend.

The neutral robot has one stage a driven joint. Here a stage with a mount or a bend becomes several: the driven joint,
and behind it one joint for each direction that gives, on arms without mass but for the last. Such a joint is moved by
its spring alone. Where motion is imposed it is written as an elastic joint whose motor side stands still at 0, where
torque drives the robot as a free joint with a spring to 0: the same physics in words that engines know already.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .errors import RefusedError
from .representation import (
    Arm,
    ArmSpring,
    Drive,
    Inertia,
    Joint,
    JointKind,
    Pose,
    Robot,
    Sensor,
    Spring,
    Stage,
    VeitscheggerWu,
)

# an arm shorter than this has no direction to bend across [m]
SHORTEST_BEND = 1.0e-6
# stages that are kept: of robots that are tried one after the other most are the same
_REMEMBERED = 1024
# the directions of a mount: all six but the drive's own, in the catalogue's order
_DIRECTIONS: dict[JointKind, tuple[tuple[str, JointKind, int], ...]] = {
    "revolute": (
        ("x", "prismatic", 0),
        ("y", "prismatic", 1),
        ("z", "prismatic", 2),
        ("rx", "revolute", 0),
        ("ry", "revolute", 1),
    ),
    "prismatic": (
        ("x", "prismatic", 0),
        ("y", "prismatic", 1),
        ("rx", "revolute", 0),
        ("ry", "revolute", 1),
        ("rz", "revolute", 2),
    ),
}


@dataclass(frozen=True, slots=True)
class Expansion:
    """A robot with its elastic parts written as joints.

    Attributes:
        robot: The robot that engines run.
        driven: Which of its stages (from 0) are the neutral robot's joints.
    """

    robot: Robot
    driven: tuple[int, ...]

    def spread(self, values: NDArray[np.float64], fill: float = 0.0) -> NDArray[np.float64]:
        """Values of the driven joints, shape (..., n), as those of all joints; the others get `fill`."""
        if not self.passive:
            return np.array(values, dtype=np.float64)
        out = np.full((*values.shape[:-1], self.robot.n), fill)
        out[..., list(self.driven)] = values
        return out

    @property
    def passive(self) -> bool:
        """Whether there is anything beside driven joints."""
        return len(self.driven) < self.robot.n


def expanded(robot: Robot, *, imposed: bool) -> Expansion:
    """The robot with every mount and bend as joints; itself where there are none.

    Args:
        robot: As built.
        imposed: Its motion will be imposed (see the module's text).

    Raises:
        RefusedError: An arm that shall bend is too short to have a direction.
    """
    if not any(stage.mount or stage.bend for stage in robot.stages):
        return Expansion(robot, tuple(range(robot.n)))
    coupled = sorted({t.effect for stage in robot.stages for t in stage.drive.terms if t.kind == "coupled"})
    if coupled:
        raise RefusedError(f"{robot.name} has {coupled[0]}, which couples joints that bearings or bends would part.")
    stages: list[Stage] = []
    driven: list[int] = []
    # where the frame of the neutral stage before stands in the last joint of its expansion
    before = Pose()
    for i in range(robot.n):
        driven.append(len(stages))
        placed = before @ robot.joint_in_previous(i)
        new, before = _expanded_stage(robot.stages[i], robot.arm_in_joint(i), placed, imposed)
        stages += new
    factors = {name: _spread(getattr(robot, name), driven, len(stages)) for name in ("kp_factor", "kd_factor")}
    return Expansion(replace(robot, stages=tuple(stages), **factors), tuple(driven))


def _spread(factors: tuple[float, ...], driven: list[int], n: int) -> tuple[float, ...]:
    """Factors of the driven joints as those of all; the others get 1."""
    by_place = dict(zip(driven, factors, strict=True)) if factors else {}
    return tuple(by_place.get(i, 1.0) for i in range(n)) if factors else ()


@lru_cache(maxsize=_REMEMBERED)
def _expanded_stage(stage: Stage, arm_in_joint: Pose, placed: Pose, imposed: bool) -> tuple[tuple[Stage, ...], Pose]:
    """Stages of one driven joint, and where its own moving joint frame stands in the last of them, undeflected.

    Args:
        stage: Of the neutral robot.
        arm_in_joint: Its arm's frame in its moving joint frame.
        placed: Where its joint stands in the frame before.
        imposed: Its motion will be imposed.
    """
    joints: list[tuple[Joint, Drive]] = [(replace(stage.joint, in_previous=placed), stage.drive)]
    frames = [Pose()]  # of each joint in the driven joint's moving frame
    bodies: list[Inertia] = []
    if stage.mount:
        directions = _DIRECTIONS[stage.joint.kind]
        for (name, kind, axis), k, b in zip(directions, stage.mount.stiffness, stage.mount.damping, strict=True):
            if math.isfinite(k):
                bodies.append(Inertia())
                _add(joints, frames, f"{stage.joint.name}_{name}", kind, _along(np.eye(3)[axis]), (k, b), imposed)
    inertia = stage.arm.inertia
    if stage.bend:
        point, axes = _bending_axes(stage)
        own = _without(inertia, stage.bend.carried)
        bodies.append(_share(own, stage.bend.at))
        inertia = _share(own, 1.0 - stage.bend.at) + stage.bend.carried
        for number, (name, axis) in enumerate(zip("uv", axes, strict=True)):
            k, b = stage.bend.stiffness[number], stage.bend.damping[number]
            frame = arm_in_joint @ _along(axis, point)
            _add(joints, frames, f"{stage.arm.name}_{name}", "revolute", frame, (k, b), imposed)
            if number == 0:
                bodies.append(Inertia())
    bodies.append(inertia)
    stages: list[Stage] = []
    for number, ((joint, drive), frame, body) in enumerate(zip(joints, frames, bodies, strict=True)):
        final = number == len(joints) - 1
        arm = Arm(
            stage.arm.name if final else f"{joint.name}_carrier",
            VeitscheggerWu(),
            inertia=body,
            shapes=stage.arm.shapes if final else (),
            in_joint=frame.inverse() @ arm_in_joint,
        )
        stages.append(Stage(joint, arm, drive, stage.sensor if number == 0 else Sensor()))
    return tuple(stages), frames[-1].inverse()


def _add(
    joints: list[tuple[Joint, Drive]],
    frames: list[Pose],
    name: str,
    kind: JointKind,
    frame: Pose,
    spring: tuple[float, float],
    imposed: bool,
) -> None:
    """One more passive joint, at a frame of the driven joint's moving frame."""
    k, b = spring
    drive = (
        Drive(inertia=1.0, dummy=True, spring=Spring(k, b))
        if imposed
        else Drive(damping=b, arm_springs=(ArmSpring(k),), passive=True)
    )
    joints.append((Joint(name, kind, in_previous=frames[-1].inverse() @ frame), drive))
    frames.append(frame)


def _along(axis: NDArray[np.float64], point: NDArray[np.float64] | None = None) -> Pose:
    """A frame at a point whose z lies along an axis of unit length."""
    other = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    other /= np.linalg.norm(other)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([other, np.cross(axis, other), axis])
    if point is not None:
        matrix[:3, 3] = point
    return Pose.from_matrix(matrix)


def _bending_axes(stage: Stage) -> tuple[NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Where an arm bends, shape (3,), and the axes u and v, all in its own Veitschegger-Wu frame."""
    assert stage.bend is not None
    before = stage.arm.link.pose().inverse()
    start = np.array(before.xyz)
    length = float(np.linalg.norm(start))
    if length < SHORTEST_BEND:
        raise RefusedError(
            f"{stage.arm.name} is {length!r} m long, too short to bend (link_flexibility needs {SHORTEST_BEND!r} m)."
        )
    e = -start / length
    z, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    u = np.cross(z, e)
    if np.linalg.norm(u) < SHORTEST_BEND:
        u = np.cross(x, e)
    u /= np.linalg.norm(u)
    return (1.0 - stage.bend.at) * start, (u, np.cross(e, u))


def _without(whole: Inertia, part: Inertia) -> Inertia:
    """A body less a part of it."""
    if part == Inertia():
        return whole
    if part == whole:
        return Inertia()
    return Inertia.from_origin(
        whole.mass - part.mass,
        whole.first_moments() - part.first_moments(),
        whole.tensor_about_origin() - part.tensor_about_origin(),
    )


def _share(inertia: Inertia, fraction: float) -> Inertia:
    """A fraction of mass, first moments and tensor alike."""
    return Inertia(
        fraction * inertia.mass,
        inertia.com,
        *(fraction * getattr(inertia, name) for name in ("xx", "yy", "zz", "xy", "xz", "yz")),
    )
