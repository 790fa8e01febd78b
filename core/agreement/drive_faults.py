"""What differences of the drives look like: inertias, springs, dampers, friction, and what acts only while running."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..representation import Robot
from ..simulation.backend import Vector
from .inertia_faults import least_squares
from .look import Look, brief, listed
from .quantities import States
from .reference import Tables, apply, transposed

# a cause found in torques must explain all but this part of them
_EXPLAINED = 1.0e-4
# one found in accelerations, which are extrapolated, all but this part
_EXPLAINED_RUNNING = 2.0e-2
DEGREE = math.pi / 180.0


def armature_look(robot: Robot, expected: Vector, seen: Vector) -> Look:
    """What the motor sides' inertias of an odd voice look like, both of shape (n,)."""
    lost: list[str] = []
    told: list[str] = []
    for i, (should, has) in enumerate(zip(expected, seen, strict=True)):
        if abs(should - has) <= 1e-10 * max(abs(should), abs(has)):
            continue
        name = f"joint_{i + 1}"
        lost.append(name)
        what = "the dummy part's inertia" if robot.stages[i].drive.dummy else "the rotor's inertia (armature)"
        fate = "is lost" if has == 0.0 else "is doubled" if abs(has - 2 * should) < 1e-9 * abs(has) else "differs"
        told.append(f"{what} of {name} {fate} ({brief(float(has))} instead of {brief(float(should))})")
    if len(told) > 3:
        fate = "is lost" if not seen.any() else "differs"
        told = [f"the motor-side inertia (armature) {fate} at {listed(lost)}"]
    return Look("armature", ", ".join(lost), "; ".join(told))


def torque_look(robot: Robot, states: States, expected: Vector, seen: Vector) -> Look:
    """What the drives' torques of an odd voice look like; shapes (m, 2 n), arm side first."""
    n = robot.n
    looks: list[Look] = []
    for i in range(n):
        on_arm, on_motor = (seen[:, k] - expected[:, k] for k in (i, n + i))
        scale = max(float(np.max(np.abs(expected[:, [i, n + i]]))), float(np.max(np.abs(seen[:, [i, n + i]]))), 1e-300)
        if float(np.max(np.abs(on_arm))) + float(np.max(np.abs(on_motor))) > 1e-9 * scale:
            looks.append(_joint_torque_look(robot, states, i, on_arm, on_motor))
    return _together(looks) or Look("unknown", "robot", "the drives' torques differ")


def _joint_torque_look(robot: Robot, states: States, i: int, on_arm: Vector, on_motor: Vector) -> Look:
    drive = robot.stages[i].drive
    spring = drive.spring
    name = f"joint_{i + 1}"
    q, dq, theta, dtheta = (array[:, i] for array in (states.q, states.dq, states.theta, states.dtheta))
    if spring:
        columns = np.stack([theta - q, dtheta - dq], axis=1)
        change = least_squares(columns, on_arm)
        size = float(np.linalg.norm(on_arm))
        passed = np.abs(change) * np.linalg.norm(columns, axis=0) > 1e-6 * size
        if size and float(np.linalg.norm(on_arm - columns @ change)) < _EXPLAINED * size:
            parts: list[str] = []
            kind = "damping"
            if passed[0]:
                kind = "stiffness"
                parts.append(_spring_text(name, "stiffness", spring.stiffness, spring.stiffness + float(change[0])))
            if passed[1]:
                parts.append(_spring_text(name, "damping", spring.damping, spring.damping + float(change[1])))
            # what the motor side differs by beyond the spring's reaction
            beyond = on_motor + columns @ change
            if float(np.linalg.norm(beyond)) > _EXPLAINED * size:
                parts.append(_friction_text(robot, name, i, dtheta, beyond)[1])
            return Look(kind, name, " and ".join(parts))
    rests = [arm.rest for arm in drive.arm_springs] or [0.0]
    columns = np.stack([q - rests[0], np.ones_like(q)], axis=1)
    size = float(np.linalg.norm(on_arm))
    if size > _EXPLAINED * float(np.linalg.norm(on_motor)):
        change = least_squares(columns, on_arm)
        if float(np.linalg.norm(on_arm - columns @ change)) < _EXPLAINED * size:
            told = sum(arm.stiffness for arm in drive.arm_springs)
            has = told - float(change[0])
            fate = "is lost" if abs(has) < 1e-9 * told else f"has {brief(has)} instead of {brief(told)}"
            return Look("joint spring", name, f"the spring on the arm side of {name} {fate}")
    kind, text = _friction_text(robot, name, i, dtheta, on_motor)
    return Look(kind, name, text)


def _spring_text(name: str, what: str, told: float, has: float) -> str:
    unit = "N m/rad" if what == "stiffness" else "N m s/rad"
    if told and abs(has / told * DEGREE - 1.0) < 1e-6:
        return (
            f"the {what} of {name} is taken per radian where it is per degree ({brief(has)} instead of {brief(told)})"
        )
    if told and abs(has / told / DEGREE - 1.0) < 1e-6:
        return (
            f"the {what} of {name} is taken per degree where it is per radian ({brief(has)} instead of {brief(told)})"
        )
    if abs(has) < 1e-6 * abs(told):
        return f"the {what} of {name} is lost (0 instead of {brief(told)} {unit})"
    return f"the {what} of {name} is {brief(has)} instead of {brief(told)} {unit}"


def _friction_text(robot: Robot, name: str, i: int, dtheta: Vector, on_motor: Vector) -> tuple[str, str]:
    """Kind and text of a difference that depends on the motor's speed."""
    told = robot.stages[i].drive.damping
    sense = np.tanh(dtheta / robot.friction.velocity)
    size = float(np.linalg.norm(on_motor))
    for column, kind in ((dtheta, "damping"), (sense, "friction")):
        coefficient = -float(column @ on_motor) / max(float(column @ column), 1e-300)
        if float(np.linalg.norm(on_motor + coefficient * column)) < _EXPLAINED * size:
            if kind == "damping":
                return kind, _damping_text(name, told, told + coefficient)
            fate = "more" if coefficient > 0 else "less"
            return kind, f"dry friction of {name} is {brief(abs(coefficient))} N m (or N) {fate} than it should be"
    return "friction", f"the friction of {name} follows another law"


def _damping_text(name: str, told: float, has: float) -> str:
    if told and abs(has) < 1e-6 * told:
        return f"the viscous damping of {name} is lost (0 instead of {brief(told)} N m s/rad)"
    if not told:
        return f"{name} has a damping of {brief(has)} N m s/rad that the robot has not, like a default"
    return f"the viscous damping of {name} is {brief(has)} instead of {brief(told)} N m s/rad"


def _together(looks: Sequence[Look]) -> Look | None:
    """Several joints in one clause."""
    if not looks:
        return None
    kinds = list(dict.fromkeys(look.kind for look in looks))
    at = ", ".join(look.at for look in looks)
    shown = [look.text for look in looks[:3]]
    if len(looks) > 3:
        shown.append(f"the same kind of difference at {listed([look.at for look in looks[3:]])}")
    return Look(" and ".join(kinds), at, "; ".join(shown))


def acceleration_look(model: Tables, robot: Robot, states: States, expected: Vector, seen: Vector) -> Look:
    """What accelerations look like that an engine's integrator takes and its own statics do not give.

    The missing torque is M (expected - seen); it is held against dampings of links and joints, inertias, friction.

    Args:
        model: The robot as the trusted voices have it.
        robot: The representation.
        states: At which the accelerations are, the first of them.
        expected: Accelerations of arm and motor sides of the trusted voices, shape (m, 2 n).
        seen: The odd voice's.
    """
    if not np.isfinite(seen).all():
        return Look("unknown", "robot", "its accelerations are no numbers")
    few = len(expected)
    n = robot.n
    q, dq = states.q[:few], states.dq[:few]
    elastic = np.array([stage.drive.spring is not None for stage in robot.stages])
    inertia = np.array([stage.drive.inertia for stage in robot.stages])
    bare = model.mass_matrix(q)
    arms = bare + np.diag(np.where(elastic, 0.0, inertia))
    root = np.sqrt(np.einsum("kii->ki", arms)).max(axis=0)
    links = np.stack([(column / root).ravel() for column in _link_damping(model, q, dq)], axis=1)
    # an engine without armature takes its rotors beside it, and the damping acts on the arms alone
    for matrix in (arms, bare):
        target = (apply(matrix, expected[:, :n] - seen[:, :n]) / root).ravel()
        for columns in (links[:, :1], links):
            rates = least_squares(columns, target)
            if float(np.linalg.norm(target - columns @ rates)) < _EXPLAINED_RUNNING * float(np.linalg.norm(target)):
                text = (
                    f"every link is damped by {brief(float(f'{rates[0]:.2g}'))} 1/s as it runs, which the robot has "
                    "not: like an engine's default damping left on"
                )
                return Look("default damping", "all arms", text)
    missing = apply(arms, expected[:, :n] - seen[:, :n])
    size = float(np.linalg.norm(missing / root))
    looks = [
        _running_joint_look(f"joint_{i + 1}", robot, i, missing[:, i], dq[:, i], seen[:, i], expected[:, i])
        for i in range(n)
        if float(np.linalg.norm(missing[:, i])) > 1e-2 * size * root[i]
    ]
    motor = inertia * (expected[:, n:] - seen[:, n:])
    for i in np.flatnonzero(elastic):
        column = motor[:, i]
        drives = inertia[i] * np.abs(expected[:, n + i])
        if float(np.max(np.abs(column))) > 1e-4 * float(np.max(drives)):
            looks.append(
                _running_joint_look(
                    f"joint_{i + 1}",
                    robot,
                    int(i),
                    column,
                    states.near_dtheta[:few, i],
                    seen[:, n + i],
                    expected[:, n + i],
                )
            )
    return _together(looks) or Look("unknown", "robot", "its integrator moves otherwise than its own model says")


def _running_joint_look(
    name: str, robot: Robot, i: int, missing: Vector, speed: Vector, seen: Vector, expected: Vector
) -> Look:
    """One joint's missing torque against its speed, its acceleration and its sense."""
    size = float(np.linalg.norm(missing))
    told = robot.stages[i].drive.damping
    for column, kind in ((speed, "damping"), (seen, "armature"), (np.sign(speed), "friction")):
        coefficient = float(column @ missing) / max(float(column @ column), 1e-300)
        if float(np.linalg.norm(missing - coefficient * column)) < _EXPLAINED_RUNNING * size:
            if kind == "damping":
                return Look(kind, name, f"as it runs, {_damping_text(name, told, told + coefficient)}")
            if kind == "armature":
                more = "more" if coefficient > 0 else "less"
                text = f"as it runs, {name} has {brief(abs(coefficient))} kg m^2 {more} motor-side inertia (armature)"
                return Look(kind, name, text)
            more = "more" if coefficient > 0 else "less"
            return Look(kind, name, f"as it runs, {name} has {brief(abs(coefficient))} N m {more} dry friction")
    worst = float(np.max(np.abs(expected - seen)))
    return Look("unknown", name, f"as it runs, {name} accelerates otherwise by up to {brief(worst)} rad/s^2 (or m/s^2)")


def _link_damping(model: Tables, q: Vector, dq: Vector) -> tuple[Vector, Vector]:
    """Joint torques of links damped by 1/s in proportion to their momentum, and to it times their speed."""
    frames = model.frames(q)[0]
    linear, squared = np.zeros_like(q), np.zeros_like(q)
    for i in range(model.n):
        rotation, origin = frames[:, i, :3, :3], frames[:, i, :3, 3]
        for lump in model.lumps[i]:
            jv, jw = model.jacobians(q, i, origin + rotation @ lump.com)
            tensor = rotation @ lump.tensor @ transposed(rotation)
            velocity, spin = apply(jv, dq), apply(jw, dq)
            momentum, turning = lump.mass * velocity, apply(tensor, spin)
            linear += apply(transposed(jv), momentum) + apply(transposed(jw), turning)
            momentum = momentum * np.linalg.norm(velocity, axis=-1, keepdims=True)
            turning = turning * np.linalg.norm(spin, axis=-1, keepdims=True)
            squared += apply(transposed(jv), momentum) + apply(transposed(jw), turning)
    return linear, squared
