"""What a difference of the tool's pose looks like: rows, units, signs, frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..kinematics import kinematics
from ..representation import Pose, Robot
from ..simulation.backend import Vector
from .look import Look, brief
from .reference import GEOMETRY, Tables

DEGREE = math.pi / 180.0
ANGLES = (0, 2, 4)
"""Columns of a row of kinematics that are angles."""
# states that are enough to tell one geometry from another
ENOUGH = 12


def geometry_look(
    model: Tables, robot: Robot, q: Vector, seen_in_world: Vector, without: Mapping[str, Callable[[], Tables]]
) -> Look:
    """What the tool poses of an odd voice look like.

    Args:
        model: The robot as the trusted voices have it.
        robot: The representation, for its joint frames.
        q: States, shape (m, n).
        seen_in_world: Tool poses of the odd voice, shape (m, 4, 4).
        without: Effect to the robot without it.
    """
    q, seen = q[:ENOUGH], seen_in_world[:ENOUGH]
    size = max(1e-3, float(np.max(np.abs(model.tool_in_world(q)[:, :3, 3]))))
    for look, changed in (*_row_faults(model), *_other_faults(model, without)):
        if _same(changed.tool_in_world(q), seen, size):
            return look
    for look, moved in _joint_faults(model, q):
        if _same(model.tool_in_world(moved), seen, size):
            return look
    fault = _cell_fitted(model, q, seen, size) or _frame_fault(robot, q, seen, size)
    return fault or Look("frame", "robot", _unknown(model, q, seen))


def _same(a: Vector, b: Vector, size: float) -> bool:
    return float(np.max(np.abs(a[:, :3, 3] - b[:, :3, 3]))) < 1e-9 * size and float(np.max(np.abs(a - b))) < 1e-8


def _unknown(model: Tables, q: Vector, seen: Vector) -> str:
    distance = np.linalg.norm(model.tool_in_world(q)[:, :3, 3] - seen[:, :3, 3], axis=1)
    return (
        f"its tool is off by up to {brief(float(distance.max()))} m, and no single row, unit, sign or frame does that"
    )


def _row_faults(model: Tables) -> Iterator[tuple[Look, Tables]]:
    """Changes of rows of the kinematics table."""

    def with_rows(rows: Vector) -> Tables:
        return replace(model, rows=rows)

    for i, row in enumerate(model.rows):
        for column, value in enumerate(row):
            if value == 0.0:
                continue
            for text, changed in _cell_faults(f"{GEOMETRY[column]} of arm_{i + 1}", float(value), column in ANGLES):
                rows = model.rows.copy()
                rows[i, column] = changed
                yield Look("frame", f"arm_{i + 1}", text), with_rows(rows)
    for i, j in combinations(range(model.n), 2):
        rows = model.rows.copy()
        rows[[i, j]] = rows[[j, i]]
        text = f"rows arm_{i + 1} and arm_{j + 1} of the kinematics are swapped"
        yield Look("frame", f"arm_{i + 1}, arm_{j + 1}", text), with_rows(rows)
    for columns, what in (*(((c,), f"{GEOMETRY[c]} of every arm") for c in ANGLES), (ANGLES, "every angle")):
        for factor, text in ((1 / DEGREE, "is degrees taken for radians"), (DEGREE, "is radians taken for degrees")):
            rows = model.rows.copy()
            rows[:, columns] *= factor
            yield Look("frame", "all arms", f"{what} {text}"), with_rows(rows)
    yield Look("frame", "all arms", "beta is left out everywhere"), with_rows(model.rows * (1, 1, 1, 1, 0))


def _cell_faults(what: str, value: float, angle: bool) -> Iterator[tuple[str, float]]:
    if angle:
        degrees = brief(value / DEGREE)
        yield f"{what} is degrees taken for radians ({degrees} rad instead of {degrees} deg)", value / DEGREE
        yield f"{what} is radians taken for degrees ({brief(value)} deg instead of {brief(value)} rad)", value * DEGREE
    else:
        yield f"{what} is millimetres taken for metres ({brief(1e3 * value)} instead of {brief(value)} m)", 1e3 * value
        yield (
            f"{what} is metres taken for millimetres ({brief(1e-3 * value)} instead of {brief(value)} m)",
            1e-3 * value,
        )
    unit = "rad" if angle else "m"
    yield f"{what} has the opposite sign ({brief(-value)} instead of {brief(value)} {unit})", -value
    yield f"{what} is left out (0 instead of {brief(value)} {unit})", 0.0


def _other_faults(model: Tables, without: Mapping[str, Callable[[], Tables]]) -> Iterator[tuple[Look, Tables]]:
    for effect in ("kinematic_error", "base_tilt"):
        if effect in without:
            yield Look("lost effect", "robot", f"{effect} is left out"), without[effect]()
    for name, matrix in (("tool", model.tool), ("base", model.base)):
        if not np.array_equal(matrix, np.eye(4)):
            straight = matrix.copy()
            straight[:3, :3] = np.eye(3)
            for what, changed in (("is left out", np.eye(4)), ("has lost its rotation", straight)):
                look = Look("frame", "robot", f"the {name}'s transform {what}")
                yield look, replace(model, tool=changed) if name == "tool" else replace(model, base=changed)
    # a chain that goes on from the corrected joint
    if model.corrections[1:].any():
        rows = model.rows + model.corrections[1:]
        yield Look("frame", "all arms", "the geometry corrections move the chain"), replace(model, rows=rows)


def _joint_faults(model: Tables, q: Vector) -> Iterator[tuple[Look, Vector]]:
    for i in range(model.n):
        turned = q.copy()
        turned[:, i] = -turned[:, i]
        yield Look("frame", f"joint_{i + 1}", f"joint_{i + 1} turns the other way"), turned
    for i, j in combinations(range(model.n), 2):
        swapped = q.copy()
        swapped[:, [i, j]] = swapped[:, [j, i]]
        at = f"joint_{i + 1}, joint_{j + 1}"
        yield Look("frame", at, f"the positions of joint_{i + 1} and joint_{j + 1} are swapped"), swapped


def _cell_fitted(model: Tables, q: Vector, seen: Vector, size: float) -> Look | None:
    """The one number of the kinematics table that, changed, gives the poses seen: Gauss-Newton on each alone."""
    for i in range(model.n):
        for column, name in enumerate(GEOMETRY):
            rows = model.rows.copy()
            for _ in range(8):
                here = replace(model, rows=rows).tool_in_world(q)
                if _same(here, seen, size):
                    told, has = float(model.rows[i, column]), float(rows[i, column])
                    unit = "rad" if column in ANGLES else "m"
                    text = f"{name} of arm_{i + 1} is {brief(has)} instead of {brief(told)} {unit}"
                    return Look("frame", f"arm_{i + 1}", text)
                nudged = rows.copy()
                nudged[i, column] += 1e-6
                slope = ((replace(model, rows=nudged).tool_in_world(q) - here) / 1e-6).ravel()
                rows[i, column] += float(slope @ (seen - here).ravel()) / max(float(slope @ slope), 1e-300)
    return None


def _frame_fault(robot: Robot, q: Vector, seen_in_world: Vector, size: float) -> Look | None:
    """The one constant transform of the chain whose change gives the poses seen, if there is one.

    With all others as they should be, tool = L_i(q) X_i R_i(q) gives X_i at every state: it is the culprit if it comes
    out the same everywhere.
    """
    chain = kinematics(robot)
    seen = np.linalg.inv(robot.base.matrix()) @ seen_in_world
    joints = chain.joints_in_base(q)
    tool = joints[:, -1] @ chain.tool_in_last_joint
    found: list[tuple[float, Look]] = []
    for i in range(robot.n + 1):
        last = i == robot.n
        expected = chain.tool_in_last_joint if last else chain.joint_in_previous[i]
        left = joints[:, i - 1] if i else np.broadcast_to(np.eye(4), seen.shape)
        right = np.linalg.inv(left @ expected) @ tool
        placed = np.linalg.inv(left) @ seen @ np.linalg.inv(right)
        if float(np.max(np.abs(placed - placed[0]))) > 1e-8 * max(size, 1.0):
            continue
        change = float(np.linalg.norm(placed[0] - expected))
        where = "the tool" if last else f"joint_{i + 1}"
        mate = f"arm_{robot.n}" if last else f"arm_{i}" if i else "the base"
        text = f"the frame of {where} on {mate} {_described(expected, placed[0], size)}"
        found.append((change, Look("frame", "tool" if last else f"joint_{i + 1}", text)))
    return min(found, key=lambda pair: pair[0])[1] if found else None


def _described(expected: Vector, seen: Vector, size: float) -> str:
    """In words: what turns the one transform into the other."""
    moved = float(np.linalg.norm(seen[:3, 3] - expected[:3, 3])) > 1e-9 * size
    turn = expected[:3, :3].T @ seen[:3, :3]
    turned = float(np.max(np.abs(turn - np.eye(3)))) > 1e-9
    if not moved:
        rpy = np.array(Pose.from_matrix(expected).rpy())
        for factor, text in ((1 / DEGREE, "degrees taken for radians"), (DEGREE, "radians taken for degrees")):
            scaled = Pose.from_rpy((0.0, 0.0, 0.0), tuple(factor * rpy)).rotation_matrix()
            if float(np.max(np.abs(scaled - seen[:3, :3]))) < 1e-7:
                return f"has {text}"
        if float(np.max(np.abs(seen[:3, :3] - np.eye(3)))) < 1e-9:
            return "has lost its rotation"
        if float(np.max(np.abs(seen[:3, :3] - expected[:3, :3].T))) < 1e-9:
            return "is turned the wrong way round"
    if moved and not turned:
        if not seen[:3, 3].any():
            return "has lost its position"
        way = seen[:3, 3] - expected[:3, 3]
        clean = np.where(np.abs(way) < 1e-6 * np.max(np.abs(way)), 0.0, way)
        return f"is moved by ({', '.join(brief(float(f'{x:.4g}')) for x in clean)}) m"
    angle = math.acos(max(-1.0, min(1.0, (float(np.trace(turn)) - 1.0) / 2.0)))
    words = f"is turned by {brief(angle / DEGREE)} deg"
    return f"{words} and moved by {brief(float(np.linalg.norm(seen[:3, 3] - expected[:3, 3])))} m" if moved else words
