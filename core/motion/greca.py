"""The "Greca" (figure 11 of IMECE2013-64815): a Greek key with right-angled corners, as milling and painting robots go.

The paper draws the path and gives no numbers; ours is a meander in a plane through a working posture of the robot,
followed edge by edge, each from rest to rest, so that the corners are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..kinematics import REACHED, InverseKinematics, Task, independent_joints, inverse_kinematics, reach, shortest_turn
from ..representation import Robot
from .law import MotionLaw, from_table
from .quintic import risen

Array = NDArray[np.float64]

CELL = ((0, 0), (0, 3), (3, 3), (3, 1), (2, 1), (2, 2), (1, 2), (1, 0), (4, 0))
"""Corners of one key, in units; the next begins where it ends."""
CELLS = 2
WIDTH = 0.28
"""Width of the whole path over the robot's reach."""
DURATION = 6.0
KNOT_SPACING = 0.02
"""Time between knots [s]; every corner is a knot."""
DIGITS = 14
"""Decimals that are kept [rad or m, by s]."""
SPEED_SHARE = 0.9
"""Part of a joint's speed limit that the motion may take."""

# search for a posture: how many are tried, how far from home, and how many of the best are looked at closely
POSTURES = 400
SPREAD = 1.2
CLOSER = 8
SEED = 20130913
# worst ratio of singular values along the path that a default posture may have
WELL_CONDITIONED = 0.05
# ... and above which one posture is as good as another
ENOUGH = 0.1
# ... and so is one further out than this part of the reach, where there is little room left
FAR_OUT = 0.65
# part of a direction in the plane that the joints may miss and still be said to move in it
FOLLOWED = 1.0e-6


@dataclass(frozen=True, slots=True)
class Place:
    """Where and how a Greek key is drawn.

    Attributes:
        solver: Inverse kinematics for what of the tool is held, with the joints that move.
        q: Joint positions at the path's centre, shape (n,) [rad or m].
        frame: Pose of the path in the base: x along its width, y along its height, shape (4, 4).
        orientation: Orientation that the tool keeps, shape (3, 3).
    """

    solver: InverseKinematics
    q: Array
    frame: Array
    orientation: Array

    def targets(self, points: Array) -> Array:
        """Tool poses in the base, shape (m, 4, 4), at points of the plane (m, 2) [m]."""
        poses = np.zeros((len(points), 4, 4))
        poses[:, :3, :3] = self.orientation
        poses[:, :3, 3] = self.frame[:3, 3] + points @ self.frame[:3, :2].T
        poses[:, 3, 3] = 1.0
        return poses


def greca(
    robot: Robot,
    *,
    width: float | None = None,
    duration: float = DURATION,
    cells: int = CELLS,
    posture: tuple[float, ...] | None = None,
) -> MotionLaw:
    """Joint motion along a Greek key, at rest at both ends and at every corner.

    The tool keeps its orientation where the robot can hold it, else the direction of its z axis, else its position
    alone follows. The plane is level where the tool can point down, else the tool's own xy plane, else the plane in
    which the robot moves. Knots carry speeds and accelerations from the Jacobian and its rate of change, not from
    differences.

    Args:
        robot: At any level; its arms are taken as rigid.
        width: Width of the whole path [m]; None: WIDTH of the reach, or less where that does not fit.
        duration: [s]; longer where a joint's speed limit asks for it.
        cells: Number of keys.
        posture: Joint positions at the middle of the path [rad or m]; None: a well-conditioned one near home.

    Raises:
        UsageError: The robot cannot draw it; says why.
    """
    if robot.n < 2:
        raise UsageError(f"{robot.name} has one joint and cannot draw a Greek key; that takes two or more.")
    if cells < 1 or duration <= 0.0 or (width is not None and width <= 0.0):
        raise UsageError(f"a Greek key of {cells} cells, {width!r} m and {duration!r} s is none: all must be above 0.")
    corners = meander(cells)
    place, scale = _place(robot, corners, width, posture)
    law = _timed(place, corners * scale, duration)
    excess = _speed_excess(robot, law)
    return law if excess <= 1.0 else _timed(place, corners * scale, duration * excess)


def meander(cells: int) -> Array:
    """Corners of a Greek key of several cells in units, about its centre, shape (8 cells + 1, 2)."""
    corners = [(x + 4 * cell, y) for cell in range(cells) for x, y in CELL[0 if cell == 0 else 1 :]]
    return np.array(corners, dtype=np.float64) - (2.0 * cells, 1.5)


def _timed(place: Place, corners: Array, duration: float) -> MotionLaw:
    """The motion along the corners (m, 2) [m] in about a duration, edges from rest to rest on a quintic of time.

    An edge takes a time in proportion to the root of its length (equal peaks of acceleration), in whole knots.
    """
    edges = np.diff(corners, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    share = np.sqrt(lengths) / np.sum(np.sqrt(lengths))
    steps = np.maximum(2, np.ceil(duration * share / KNOT_SPACING - 1.0e-9)).astype(int)
    points: list[Array] = [corners[:1]]
    velocity: list[Array] = [np.zeros((1, 2))]
    acceleration: list[Array] = [np.zeros((1, 2))]
    for corner, edge, count in zip(corners[:-1], edges, steps.tolist(), strict=True):
        time = float(count * KNOT_SPACING)
        value, slope, bend = risen(np.linspace(0.0, 1.0, count + 1)[1:, None])
        points.append(corner + edge * value)
        velocity.append(edge * slope / time)
        acceleration.append(edge * bend / time**2)
    p, v, a = (np.concatenate(parts) for parts in (points, velocity, acceleration))
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    solver, targets = place.solver, place.targets(p)
    q = solver.follow(targets, _led_to(place, p[0]), along)
    axes = place.frame[:3, :2]
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    for k in range(len(q)):
        dq[k] = solver.speeds(q[k], np.concatenate([axes @ v[k], np.zeros(3)]))
        ddq[k] = solver.accelerations(q[k], dq[k], np.concatenate([axes @ a[k], np.zeros(3)]))
    # without the digits that are rounding errors: a joint that stands still has zeros
    q, dq, ddq = (np.round(values, DIGITS) + 0.0 for values in (q, dq, ddq))
    return from_table(np.round(np.arange(len(q)) * KNOT_SPACING, 9), q, dq, ddq)


def _led_to(place: Place, point: Array) -> Array:
    """Joint positions (n,) at a point of the plane, followed there from the centre so that the branch stays."""
    straight = point * np.linspace(0.0, 1.0, 20)[:, None]
    return place.solver.follow(place.targets(straight), place.q)[-1]


def _speed_excess(robot: Robot, law: MotionLaw) -> float:
    """By how much the fastest joint exceeds its share of its speed limit; 1 or less where none does."""
    t = np.linspace(0.0, law.duration, 10 * len(law.knots))
    peak = np.max(np.abs(law.at(t)[1]), axis=0)
    limits = np.array([stage.joint.velocity for stage in robot.stages]) * SPEED_SHARE
    return float(np.max(peak / limits))


def _place(robot: Robot, corners: Array, width: float | None, posture: tuple[float, ...] | None) -> tuple[Place, float]:
    """Where the path is drawn and the metres of its unit: at its full size, else smaller where no size is asked for."""
    units = float(np.ptp(corners[:, 0]))
    reason = ""
    whole = WIDTH * reach(robot) if width is None else width
    sizes = [whole, 0.5 * whole, 0.25 * whole] if width is None else [whole]
    places: Iterable[Place] = _candidates(robot, posture)
    for size in sizes:
        tried: list[Place] = []
        for place in places:
            tried.append(place)
            try:
                condition = _worst_condition(place, _outline(corners * (size / units)))
            except UsageError as error:
                reason = reason or f": {error}"
                continue
            if condition > WELL_CONDITIONED or posture is not None:
                return place, size / units
        places = tried
    where = f" around any of {POSTURES} postures near home" if posture is None else " around the posture given"
    raise UsageError(f"{robot.name} cannot draw a Greek key {sizes[-1]:.3g} m wide{where}{reason or '.'}")


def _outline(corners: Array) -> Array:
    """Some points along the edges, shape (m, 2), close enough to be followed."""
    parts = [a + (b - a) * np.linspace(0.0, 1.0, 5)[1:, None] for a, b in pairwise(corners)]
    return np.concatenate([corners[:1], *parts])


def _worst_condition(place: Place, points: Array) -> float:
    q = place.solver.follow(place.targets(points), _led_to(place, points[0]))
    return min(place.solver.condition(row) for row in q)


def _candidates(robot: Robot, posture: tuple[float, ...] | None) -> Iterator[Place]:
    """Places to draw at: the task that holds the most of the tool, in a level plane if any, else in another."""
    postures = _postures(robot) if posture is None else np.array([posture], dtype=np.float64)
    tasks: tuple[Task, ...] = ("pose", "axis", "position")
    for task in tasks:
        solver = inverse_kinematics(robot, task)
        best = _best_first(solver, postures)[:CLOSER]
        found = False
        for find in (_level_place, _tool_place, _only_place) if posture is None else (_tool_place, _only_place):
            for q in best:
                place = find(solver, q)
                if place is not None:
                    found = True
                    yield place
        if found:
            return


def _postures(robot: Robot) -> Array:
    """Postures around home within the limits, home first, shape (m, n); the same at every call.

    The first and the last joint stay: turning them turns the picture, and changes nothing of what can be reached.
    """
    home = np.array(robot.home())
    slide = SPREAD * reach(robot) / 4.0
    spread = np.array([SPREAD if stage.joint.kind == "revolute" else slide for stage in robot.stages])
    lower = np.maximum(home - spread, [stage.joint.lower for stage in robot.stages])
    upper = np.minimum(home + spread, [stage.joint.upper for stage in robot.stages])
    random = np.random.default_rng(SEED).uniform(size=(POSTURES - 1, robot.n))
    postures = np.vstack([home, lower + random * (upper - lower)])
    for end in {0, robot.n - 1} if robot.n > 3 else {0}:
        if robot.stages[end].joint.kind == "revolute":
            postures[:, end] = home[end]
    return postures


def _best_first(solver: InverseKinematics, postures: Array) -> Array:
    """Postures (m, n) sorted: well conditioned, away from limits, and with the tool far out, where a robot gives."""
    rank = max(len(independent_joints(solver, q)) for q in postures[:5])
    lower = np.array([stage.joint.lower for stage in solver.robot.stages])
    upper = np.array([stage.joint.upper for stage in solver.robot.stages])
    room = np.min(np.minimum(postures - lower, upper - postures) / np.minimum(upper - lower, np.pi), axis=1)
    conditions = np.array([solver.condition(q, rank) for q in postures])
    joints = solver.chain.joints_in_base(postures)
    away = solver.chain.tool_in_base(postures)[:, :3, 3] - joints[:, 0, :3, 3]
    axis = joints[:, 0, :3, 2]
    out = np.linalg.norm(away - axis * np.sum(axis * away, axis=1, keepdims=True), axis=1)
    score = np.minimum(conditions, ENOUGH) * np.minimum(room, 0.1) * np.minimum(out, FAR_OUT * solver.length)
    return postures[np.argsort(-score, kind="stable")]


def _level_place(solver: InverseKinematics, q: Array) -> Place | None:
    """Around a posture (n,), turned so that the tool looks down, in a level plane; None where that cannot be."""
    down = solver.robot.base.rotation_matrix().T @ np.array(solver.robot.gravity)
    if not down.any():
        return None
    target = solver.chain.tool_in_base(q)
    target[:3, :3] = shortest_turn(target[:3, 2], down / np.linalg.norm(down)) @ target[:3, :3]
    try:
        turned = solver.solve(target, q)
    except UsageError:
        return None
    return _in_plane(solver, _ends_at_home(solver, turned), target[:3, 2])


def _tool_place(solver: InverseKinematics, q: Array) -> Place | None:
    """Around a posture (n,), in the tool's xy plane; None where the robot does not move in it."""
    return _in_plane(solver, q, solver.chain.tool_in_base(q)[:3, 2])


def _only_place(solver: InverseKinematics, q: Array) -> Place | None:
    """Around a posture (n,), in the plane of motion of a planar arm whose tool looks somewhere else."""
    left, values, _ = np.linalg.svd(solver.chain.jacobian(q)[:3])
    planar = len(values) < 3 or values[2] < 1.0e-9 * values[0]
    return _in_plane(solver, q, left[:, 2]) if planar else None


def _ends_at_home(solver: InverseKinematics, q: Array) -> Array:
    """The posture with its first and last joint at home where the tool still looks the same way, shape (n,)."""
    straight = q.copy()
    for end in (0, -1):
        if solver.robot.stages[end].joint.kind == "revolute":
            straight[end] = solver.robot.stages[end].joint.home
    before, after = (solver.chain.tool_in_base(posture)[:3, 2] for posture in (q, straight))
    return straight if np.max(np.abs(after - before)) < REACHED else q


def _in_plane(solver: InverseKinematics, q: Array, normal: Array) -> Place | None:
    """The path around a posture in the plane with a normal (3,); its height points away from the first joint."""
    joints = solver.chain.joints_in_base(q)
    tool = solver.chain.tool_in_base(q)
    z = -normal if normal @ joints[0, :3, 2] < 0.0 else normal
    away = tool[:3, 3] - joints[0, :3, 3]
    y = away - z * (z @ away)
    if np.linalg.norm(y) < 1.0e-6:
        y = tool[:3, 1] - z * (z @ tool[:3, 1])
    y = y / np.linalg.norm(y)
    x = np.cross(y, z)
    free = independent_joints(solver, q)
    chosen = inverse_kinematics(solver.robot, solver.task, free)
    if any(chosen.misses(q, np.concatenate([axis, np.zeros(3)])) > FOLLOWED for axis in (x, y)):
        return None
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, y, z])
    frame[:3, 3] = tool[:3, 3]
    return Place(chosen, q, frame, tool[:3, :3])
