"""Inverse kinematics: joint positions that put the tool where it is wanted, at one place or along a path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import UsageError
from ..representation import Robot
from .forward import Array, Kinematics, kinematics, reach

Task = Literal["pose", "axis", "position"]
"""What of the tool must be as wanted: its pose, its position and the direction of its z axis, or its position."""

# largest residual that counts as reached, as a fraction of the reach and in rad
REACHED = 1.0e-10
# smallest over largest singular value of the scaled Jacobian below which a posture is called singular
SINGULAR = 1.0e-3
# a joint that moves further than this between two points of a path has changed branch [rad or reach]
JUMP = 0.5
ITERATIONS = 60
# a step or an error this small is followed by nothing but rounding
ROUNDING = 1.0e-13


@dataclass(frozen=True, slots=True, eq=False)
class InverseKinematics:
    """Levenberg-Marquardt on the geometric Jacobian, for some joints of a robot and one task.

    Lengths count in units of the robot's reach, so that metres and radians can be added up.

    Attributes:
        robot: Whose limits are kept.
        chain: Its transforms.
        task: What of the tool must be as wanted.
        free: Joints that may move, from 0; the others stay where the start has them.
        length: Unit of length [m].
    """

    robot: Robot
    chain: Kinematics
    task: Task
    free: tuple[int, ...]
    length: float

    def solve(self, target_in_base: Array, start: ArrayLike) -> Array:
        """Joint positions, shape (n,), that put the tool at a pose (4, 4), found from a start (n,) near them.

        Revolute joints are brought within their limits by whole turns where that helps.

        Raises:
            UsageError: The pose is out of reach from there, or beyond a joint's limit.
        """
        q, miss = self.nearest(target_in_base, np.asarray(start, dtype=np.float64))
        x, y, z = target_in_base[:3, 3].tolist()
        if miss > REACHED:
            raise UsageError(
                f"{self.robot.name} cannot put its tool at ({x:.6g}, {y:.6g}, {z:.6g}) m in the base: the nearest "
                f"found is {self._in_words(miss)} off; choose a place within its reach of {self.length:.3g} m."
            )
        q = self._turned_into_limits(q)
        beyond = self.beyond_limits(q)
        if beyond:
            raise UsageError(f"the tool at ({x:.6g}, {y:.6g}, {z:.6g}) m in the base takes {beyond}.")
        return q

    def follow(self, targets_in_base: Array, start: ArrayLike, path: ArrayLike | None = None) -> Array:
        """Joint positions, shape (m, n), along a path of tool poses (m, 4, 4), without a change of branch.

        Args:
            targets_in_base: Poses close enough together that a joint moves by far less than JUMP from one to the next.
            start: Joint positions near the first pose, shape (n,).
            path: Path length at each pose, named in errors [m], shape (m,); None: the number of the pose.

        Raises:
            UsageError: Out of reach, beyond a limit, singular, or a jump; names the joint, the place and the value.
        """
        places = None if path is None else np.asarray(path, dtype=np.float64)
        found = np.empty((len(targets_in_base), self.chain.n))
        q = np.asarray(start, dtype=np.float64)
        for k, target in enumerate(targets_in_base):
            where = (
                f"at path position {places[k]:.6g} m of {places[-1]:.6g} m" if places is not None else f"at pose {k}"
            )
            # the straight continuation is a better guess than where the last pose was
            guess = 2.0 * found[k - 1] - found[k - 2] if k > 1 else q
            new, miss = self.nearest(target, guess)
            if miss > REACHED:
                x, y, z = target[:3, 3].tolist()
                raise UsageError(
                    f"{self.robot.name} cannot follow the path {where}, tool at ({x:.6g}, {y:.6g}, {z:.6g}) m in the "
                    f"base: the nearest it gets is {self._in_words(miss)} off."
                )
            if k > 0:
                step = np.abs(new - q) / self._unit()
                worst = int(np.argmax(step))
                if step[worst] > JUMP:
                    raise UsageError(
                        f"{self.robot.name} cannot follow the path {where} without a jump: "
                        f"{self._joint(worst)} would go from {q[worst]:.6g} to {new[worst]:.6g} "
                        f"{self._unit_name(worst)} at once."
                    )
            beyond = self.beyond_limits(new)
            if beyond:
                raise UsageError(f"{self.robot.name} cannot follow the path {where}: it takes {beyond}.")
            singular = self.singular(new)
            if singular:
                raise UsageError(f"{self.robot.name} cannot follow the path {where}: {singular}.")
            found[k] = q = new
        return found

    def nearest(self, target_in_base: Array, start: Array) -> tuple[Array, float]:
        """Joint positions (n,) nearest to a pose, and how far off: largest part of the error, in reaches or rad.

        Levenberg-Marquardt (Nocedal and Wright, 2006, section 10.3) down to rounding.
        """
        free = list(self.free)
        unit = self._unit()[free]
        q = start.copy()
        tool, jacobian = self.chain.tool_and_jacobian(q)
        error = self._error(tool, target_in_base)
        size = float(error @ error)
        damping = 1.0e-6
        for _ in range(ITERATIONS):
            matrix = self._project(jacobian, target_in_base)[:, free] * unit
            normal = matrix.T @ matrix
            step = np.linalg.solve(normal + damping * np.eye(len(free)), matrix.T @ error)
            trial = q.copy()
            trial[free] += unit * step
            tool, trial_jacobian = self.chain.tool_and_jacobian(trial)
            trial_error = self._error(tool, target_in_base)
            trial_size = float(trial_error @ trial_error)
            if trial_size < size:
                q, jacobian, error, size = trial, trial_jacobian, trial_error, trial_size
                damping = max(damping * 0.1, 1.0e-14)
                if np.max(np.abs(step)) < ROUNDING:
                    break
            elif size < ROUNDING**2 or damping > 1.0e8:
                break  # no way down
            else:
                damping *= 10.0
        return q, float(np.max(np.abs(error)))

    def speeds(self, q: Array, twist: Array) -> Array:
        """Joint speeds (n,) of a tool twist (6,) in base axes, linear then angular velocity [m/s, rad/s]."""
        return self._least_squares(q, twist)

    def accelerations(self, q: Array, dq: Array, twist_rate: Array) -> Array:
        """Joint accelerations (n,) of the tool's linear and angular acceleration (6,): J ddq = a - (dJ/dt) dq."""
        return self._least_squares(q, twist_rate - self.chain.jacobian_rate(q, dq) @ dq)

    def misses(self, q: Array, twist: Array) -> float:
        """Part of a twist (6,) that the joints cannot follow at q, over the part that they can; 0 is all of it."""
        twist = self._project_rows(twist, self.chain.tool_in_base(q))
        got = self._project_rows(self.chain.jacobian(q) @ self.speeds(q, twist), self.chain.tool_in_base(q))
        return float(
            np.linalg.norm(self._scaled(twist - got)) / max(float(np.linalg.norm(self._scaled(twist))), 1e-300)
        )

    def condition(self, q: Array, rank: int | None = None) -> float:
        """Smallest over largest singular value of the scaled Jacobian of the task at q; 0 is singular.

        Args:
            q: Joint positions, shape (n,).
            rank: Count so many singular values, the largest first; None: one for each free joint.
        """
        values = np.linalg.svd(self._matrix(q), compute_uv=False)
        last = (len(self.free) if rank is None else rank) - 1
        return float(values[last] / values[0]) if last < len(values) and values[0] > 0.0 else 0.0

    def singular(self, q: Array) -> str:
        """What is singular at q, in words; "" where nothing is."""
        _, values, right = np.linalg.svd(self._matrix(q))
        last = len(self.free) - 1
        if len(values) > last and values[last] > SINGULAR * values[0]:
            return ""
        weights: list[float] = np.abs(right[last]).tolist()
        joints = [joint for joint, weight in zip(self.free, weights, strict=True) if weight > 0.3 * max(weights)]
        smallest = float(values[last] / values[0]) if len(values) > last and values[0] > 0.0 else 0.0
        names = " and ".join(self._joint(joint) for joint in joints)
        at = ", ".join(f"{q[joint]:.6g} {self._unit_name(joint)}" for joint in joints)
        return (
            f"it is singular there, {names} (at {at}) would have to move without end "
            f"(ratio of singular values {smallest:.3g}, {SINGULAR!r} or more is needed)"
        )

    def beyond_limits(self, q: Array) -> str:
        """Which joint is beyond which limit at q, in words; "" where none is."""
        for i, stage in enumerate(self.robot.stages):
            joint = stage.joint
            if q[i] < joint.lower - 1.0e-12 or q[i] > joint.upper + 1.0e-12:
                side, limit = ("lower", joint.lower) if q[i] < joint.lower else ("upper", joint.upper)
                unit = self._unit_name(i)
                return f"{self._joint(i)} to {q[i]:.6g} {unit}, beyond its {side} limit {limit!r} {unit}"
        return ""

    def _matrix(self, q: Array) -> Array:
        """Scaled Jacobian of the task at q, shape (6, number of free joints)."""
        tool, jacobian = self.chain.tool_and_jacobian(q)
        free = list(self.free)
        return self._project(jacobian, tool)[:, free] * self._unit()[free]

    def _least_squares(self, q: Array, twist: Array) -> Array:
        tool, jacobian = self.chain.tool_and_jacobian(q)
        free = list(self.free)
        unit = self._unit()[free]
        matrix = self._project(jacobian, tool)[:, free] * unit
        wanted = self._scaled(self._project_rows(twist, tool))
        out = np.zeros(self.chain.n)
        out[free] = unit * np.linalg.lstsq(matrix, wanted, rcond=None)[0]
        return out

    def _unit(self) -> Array:
        """What one scaled unit of each joint is, shape (n,) [rad or m]."""
        return np.where(self.chain.prismatic, self.length, 1.0)

    def _scaled(self, twist: Array) -> Array:
        return np.concatenate([twist[:3] / self.length, twist[3:]])

    def _project(self, jacobian: Array, tool: Array) -> Array:
        """Rows of the scaled Jacobian that the task asks for; the others are 0."""
        rows = self._project_rows(jacobian, tool)
        return np.vstack([rows[:3] / self.length, rows[3:]])

    def _project_rows(self, rows: Array, tool: Array) -> Array:
        if self.task == "pose":
            return rows
        out = rows.copy()
        if self.task == "position":
            out[3:] = 0.0
        else:
            z = tool[:3, 2]
            out[3:] -= np.outer(z, z @ rows[3:]).reshape(rows[3:].shape)
        return out

    def _error(self, tool: Array, target: Array) -> Array:
        """Scaled twist that would bring the tool to its target in one unit of time, shape (6,)."""
        error = np.zeros(6)
        error[:3] = (target[:3, 3] - tool[:3, 3]) / self.length
        if self.task == "pose":
            error[3:] = rotation_vector(target[:3, :3] @ tool[:3, :3].T)
        elif self.task == "axis":
            error[3:] = turn_between(tool[:3, 2], target[:3, 2])
        return error

    def _turned_into_limits(self, q: Array) -> Array:
        out = q.copy()
        for i, stage in enumerate(self.robot.stages):
            joint = stage.joint
            if joint.kind == "revolute" and not joint.lower <= q[i] <= joint.upper:
                turns = math.ceil((joint.lower - q[i]) / (2.0 * math.pi)) if math.isfinite(joint.lower) else 0
                if math.isinf(joint.lower):
                    turns = math.floor((joint.upper - q[i]) / (2.0 * math.pi))
                turned = q[i] + turns * 2.0 * math.pi
                if i in self.free and joint.lower <= turned <= joint.upper:
                    out[i] = turned
        return out

    def _joint(self, i: int) -> str:
        return self.robot.stages[i].joint.name

    def _unit_name(self, i: int) -> str:
        return "m" if self.chain.prismatic[i] else "rad"

    def _in_words(self, miss: float) -> str:
        return f"{miss * self.length:.3g} m or {miss:.3g} rad"


def inverse_kinematics(robot: Robot, task: Task = "pose", free: Sequence[int] | None = None) -> InverseKinematics:
    """A solver for a robot.

    Args:
        robot: At any level; rigid joints are taken.
        task: What of the tool must be as wanted.
        free: Joints that may move, from 0; None: all (a redundant robot then takes the nearest solution).
    """
    joints = tuple(range(robot.n)) if free is None else tuple(sorted(free))
    return InverseKinematics(robot, kinematics(robot), task, joints, reach(robot) or 1.0)


def independent_joints(solver: InverseKinematics, q: Array) -> tuple[int, ...]:
    """As many joints as the task needs at q, from 0, the best conditioned ones; the other joints can stay.

    Column-pivoted Gram-Schmidt of the scaled Jacobian (Golub and Van Loan, 2013, section 5.4.2).
    """
    tool, jacobian = solver.chain.tool_and_jacobian(q)
    unit = np.where(solver.chain.prismatic, solver.length, 1.0)
    rest = np.vstack([jacobian[:3] / solver.length, jacobian[3:]]) * unit
    if solver.task == "position":
        rest = rest[:3]
    elif solver.task == "axis":
        z = tool[:3, 2]
        rest[3:] -= np.outer(z, z @ rest[3:])
    largest = float(np.max(np.linalg.norm(rest, axis=0)))
    chosen: list[int] = []
    while len(chosen) < min(rest.shape):
        norms = np.linalg.norm(rest, axis=0)
        best = int(np.argmax(norms))
        if norms[best] <= 1.0e-6 * largest:
            break
        chosen.append(best)
        direction = rest[:, best] / norms[best]
        rest = rest - np.outer(direction, direction @ rest)
        rest[:, best] = 0.0
    return tuple(sorted(chosen))


def rotation_vector(rotation: NDArray[np.float64]) -> Array:
    """Axis times angle, shape (3,) [rad], of a rotation matrix (3, 3), exact for small angles and good up to pi."""
    sine = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    cosine = 0.5 * (float(np.trace(rotation)) - 1.0)
    length = float(np.linalg.norm(sine))
    angle = math.atan2(length, cosine)
    if length > 1.0e-8:
        return sine * (angle / length)
    if cosine > 0.0:
        return sine
    # half a turn: the axis is the eigenvector of (R + 1) / 2
    column = rotation + np.eye(3)
    axis = column[:, int(np.argmax(np.diag(column)))]
    return axis * (angle / float(np.linalg.norm(axis)))


def turn_between(a: Array, b: Array) -> Array:
    """Shortest rotation vector (3,) [rad] that turns unit vector a onto b."""
    cross = np.array(np.cross(a, b), dtype=np.float64)
    length = float(np.linalg.norm(cross))
    angle = math.atan2(length, float(a @ b))
    if length > 1.0e-8:
        return cross * (angle / length)
    if a @ b > 0.0:
        return cross
    perpendicular = np.array(np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))]), dtype=np.float64)
    return perpendicular * (angle / float(np.linalg.norm(perpendicular)))


def shortest_turn(a: Array, b: Array) -> Array:
    """Rotation matrix (3, 3) that turns unit vector a onto b by the shortest way (Rodrigues' formula)."""
    vector = turn_between(a, b)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(angle) / angle and (1 - cos(angle)) / angle^2, both good at 0
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (cross @ cross)
