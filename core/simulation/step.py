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


def largest_eigenvalue(robot: Robot, *, imposed: bool, poses: Vector, bristles: bool, compiled: bool = False) -> float:
    """Largest magnitude of an eigenvalue of the robot at rest [1/s], over some poses.

    The robot is linearised with its springs, dampers and friction; gravity's stiffness is left out (it is slow), the
    controller too (its torque is held).

    Args:
        robot: At its level.
        imposed: Motor sides are moved by a motion, not by torque.
        poses: Positions to try, shape (k, n).
        bristles: Count the stiffness of sticking friction.
        compiled: Numba is there anyway, as where the robot is run.
    """
    free = _free_coordinates(robot, imposed)
    if not free:
        return 0.0
    arms = dynamics(robot, always_compiled=compiled)
    inertia, damping, stiffness = _linearised(
        robot,
        np.array([arms.mass_matrix(q) for q in poses]),
        np.array([arms.gravity(q) for q in poses]),
        bristles,
    )
    block = np.ix_(range(len(poses)), free, free)
    m, b, k = inertia[block], damping[block], stiffness[block]
    moves = k.any(axis=(1, 2)) | b.any(axis=(1, 2))
    if not moves.any():
        return 0.0
    try:
        forces = np.linalg.solve(m[moves], np.concatenate([k, b], axis=2)[moves])
    except np.linalg.LinAlgError as error:
        still = next(q for q, one in zip(poses[moves], m[moves], strict=True) if _moves_nothing(one))
        raise RefusedError(
            f"{robot.name} has a joint that moves no inertia at all at q = {still.tolist()}: nothing can be integrated."
        ) from error
    size = len(free)
    system = np.zeros((len(forces), 2 * size, 2 * size))
    system[:, :size, size:] = np.eye(size)
    system[:, size:] = -forces
    return float(np.max(np.abs(np.linalg.eigvals(system))))


def _moves_nothing(inertia: Vector) -> bool:
    try:
        np.linalg.inv(inertia)
    except np.linalg.LinAlgError:
        return True
    return False


def _free_coordinates(robot: Robot, imposed: bool) -> list[int]:
    """Which of (q_1 ... q_n, theta_1 ... theta_n) move freely."""
    n = robot.n
    elastic = [i for i, stage in enumerate(robot.stages) if stage.drive.spring]
    return elastic if imposed else [*range(n), *(n + i for i in elastic)]


def _linearised(robot: Robot, mass_matrices: Vector, gravity: Vector, bristles: bool) -> tuple[Vector, Vector, Vector]:
    """Inertia, damping and stiffness over (q, theta) in each pose, shapes (k, 2n, 2n)."""
    n = robot.n
    inertia, damping, stiffness = (np.zeros((len(gravity), 2 * n, 2 * n)) for _ in range(3))
    inertia[:, :n, :n] = mass_matrices
    for i, stage in enumerate(robot.stages):
        drive = stage.drive
        motor = n + i if drive.spring else i
        inertia[:, motor, motor] += drive.inertia
        if drive.spring:
            sides = np.ix_(range(len(gravity)), (i, motor), (i, motor))
            for matrix, value in ((stiffness, drive.spring.stiffness), (damping, drive.spring.damping)):
                matrix[sides] += value * np.array([[1.0, -1.0], [-1.0, 1.0]])
        stiffness[:, i, i] += sum(spring.stiffness for spring in drive.arm_springs)
        stiffness[:, motor, motor] += sum(slip.stiffness for slip in drive.slips)
        damping[:, motor, motor] += drive.damping
        for pose in range(len(gravity)) if drive.terms else ():
            passed = usual_load(float(gravity[pose, i]), float(mass_matrices[pose, i, i]))
            level = level_at_rest(drive, passed)
            if level > 0.0 and robot.friction.model == "smooth":
                damping[pose, motor, motor] += level / robot.friction.velocity
            elif level > 0.0 and drive.stick and bristles:
                stiffness[pose, motor, motor] += level / drive.stick.displacement
                damping[pose, motor, motor] += level * drive.stick.time / drive.stick.displacement
    return inertia, damping, stiffness


def choose_step(
    robot: Robot,
    backend: Backend,
    *,
    imposed: bool,
    poses: Vector,
    step: float | None = None,
    compiled: bool = False,
) -> float:
    """Step for a run [s]: the backend's longest where nothing is stiff, else shorter.

    Args:
        robot: At its level.
        backend: Whose integrator.
        imposed: Mode motion.
        poses: Positions that the run passes, shape (k, n).
        step: Wanted by the user.
        compiled: Numba is there anyway, as where the robot is run.

    Raises:
        RefusedError: The wanted step is unstable; the message names a stable one. Or no step is long enough to end.
    """

    def largest(bristles: bool) -> float:
        return largest_eigenvalue(robot, imposed=imposed, poses=poses, bristles=bristles, compiled=compiled)

    stiff = largest(bristles=True)
    if step is not None:
        if stiff * step > backend.stable:
            raise RefusedError(
                f"a step of {step!r} s is unstable for {robot.name} in {backend.engine} ({backend.integrator}): its "
                f"largest eigenvalue is {stiff:.4g} 1/s; {_nice(backend.stable / stiff)!r} s or less is stable."
            )
        return step
    sticks = any(stage.drive.stick for stage in robot.stages)
    smooth = largest(bristles=False) if sticks else stiff
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
