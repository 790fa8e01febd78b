"""The integration step, chosen from the largest eigenvalue of the robot's linearised drives."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..build import level_at_rest, usual_load
from ..errors import RefusedError
from ..kinematics import dynamics
from ..representation import Robot
from .backend import Backend, Vector

if TYPE_CHECKING:
    from ..motion import MotionLaw

# Step times eigenvalue: 0.1 ms on the paper's compliant arm (7600 1/s), where agreement was measured. A bristle only
# holds a joint, so it has to be stable, not resolved.
ACCURATE = 0.76
BRISTLE = 1.5
MARGIN = 0.9
# what no engine comes to the end of [s]
SHORTEST = 1.0e-8


# how many positions along a motion are looked at
POSES = 8


def poses_of(robot: Robot, motion: MotionLaw) -> Vector:
    """Home and some positions that a motion passes, shape (k, n)."""
    passed, _, _ = motion.at(np.linspace(0.0, motion.duration, POSES))
    return np.vstack([np.array(robot.home()), passed])


def largest_eigenvalue(robot: Robot, *, imposed: bool, poses: Vector, bristles: bool) -> float:
    """Largest magnitude of an eigenvalue of the robot at rest [1/s], over some poses.

    The robot is linearised with its springs, dampers and friction; gravity's stiffness is left out (it is slow), the
    controller too (its torque is held).

    Args:
        robot: At its level.
        imposed: Motor sides are moved by a motion, not by torque.
        poses: Positions to try, shape (k, n).
        bristles: Count the stiffness of sticking friction.
    """
    arms = dynamics(robot)
    largest = 0.0
    for q in poses:
        inertia, damping, stiffness = _linearised(robot, arms.mass_matrix(q), arms.gravity(q), bristles)
        free = _free_coordinates(robot, imposed)
        if not free:
            continue
        block = np.ix_(free, free)
        m, b, k = inertia[block], damping[block], stiffness[block]
        if not (k.any() or b.any()):
            continue
        size = len(free)
        try:
            forces = np.linalg.solve(m, np.hstack([k, b]))
        except np.linalg.LinAlgError as error:
            raise RefusedError(
                f"{robot.name} has a joint that moves no inertia at all at q = {q.tolist()}: nothing can be integrated."
            ) from error
        system = np.block([[np.zeros((size, size)), np.eye(size)], [-forces]])
        largest = max(largest, float(np.max(np.abs(np.linalg.eigvals(system)))))
    return largest


def _free_coordinates(robot: Robot, imposed: bool) -> list[int]:
    """Which of (q_1 ... q_n, theta_1 ... theta_n) move freely."""
    n = robot.n
    elastic = [i for i, stage in enumerate(robot.stages) if stage.drive.spring]
    return elastic if imposed else [*range(n), *(n + i for i in elastic)]


def _linearised(robot: Robot, mass_matrix: Vector, gravity: Vector, bristles: bool) -> tuple[Vector, Vector, Vector]:
    """Inertia, damping and stiffness over (q, theta), shapes (2n, 2n)."""
    n = robot.n
    inertia, damping, stiffness = (np.zeros((2 * n, 2 * n)) for _ in range(3))
    inertia[:n, :n] = mass_matrix
    for i, stage in enumerate(robot.stages):
        drive = stage.drive
        motor = n + i if drive.spring else i
        inertia[motor, motor] += drive.inertia
        if drive.spring:
            for matrix, value in ((stiffness, drive.spring.stiffness), (damping, drive.spring.damping)):
                matrix[np.ix_((i, motor), (i, motor))] += value * np.array([[1.0, -1.0], [-1.0, 1.0]])
        stiffness[i, i] += sum(spring.stiffness for spring in drive.arm_springs)
        stiffness[motor, motor] += sum(slip.stiffness for slip in drive.slips)
        damping[motor, motor] += drive.damping
        passed = usual_load(float(gravity[i]), float(mass_matrix[i, i]))
        level = level_at_rest(drive, passed) if drive.terms else 0.0
        if level > 0.0 and robot.friction.model == "smooth":
            damping[motor, motor] += level / robot.friction.velocity
        elif level > 0.0 and drive.stick and bristles:
            stiffness[motor, motor] += level / drive.stick.displacement
            damping[motor, motor] += level * drive.stick.time / drive.stick.displacement
    return inertia, damping, stiffness


def choose_step(robot: Robot, backend: Backend, *, imposed: bool, poses: Vector, step: float | None = None) -> float:
    """Step for a run [s]: the backend's longest where nothing is stiff, else shorter.

    Args:
        robot: At its level.
        backend: Whose integrator.
        imposed: Mode motion.
        poses: Positions that the run passes, shape (k, n).
        step: Wanted by the user.

    Raises:
        RefusedError: The wanted step is unstable; the message names a stable one. Or no step is long enough to end.
    """
    stiff = largest_eigenvalue(robot, imposed=imposed, poses=poses, bristles=True)
    if step is not None:
        if stiff * step > backend.stable:
            raise RefusedError(
                f"a step of {step!r} s is unstable for {robot.name} in {backend.engine} ({backend.integrator}): its "
                f"largest eigenvalue is {stiff:.4g} 1/s; {_nice(backend.stable / stiff)!r} s or less is stable."
            )
        return step
    sticks = any(stage.drive.stick for stage in robot.stages)
    smooth = largest_eigenvalue(robot, imposed=imposed, poses=poses, bristles=False) if sticks else stiff
    limits = [backend.largest_step]
    limits += [ACCURATE / smooth] if smooth > 0.0 else []
    limits += [min(BRISTLE, MARGIN * backend.stable) / stiff] if stiff > smooth else []
    if min(limits) < SHORTEST:
        raise RefusedError(
            f"{robot.name} needs steps of {min(limits):.1g} s in {backend.engine}, and no run "
            f"ends below {SHORTEST:g} s: its largest eigenvalue is {stiff:.4g} 1/s; make what is stiff softer."
        )
    return _nice(min(limits))


def _nice(step: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above the step, to 1 % ."""
    power = math.floor(math.log10(step))
    candidates = [factor * 10.0**exponent for exponent in (power - 1, power) for factor in (1.0, 2.0, 5.0)]
    chosen = max(value for value in candidates if value <= 1.01 * step)
    return float(f"{chosen:.0e}")
