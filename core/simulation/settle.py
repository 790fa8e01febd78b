"""Where a run starts: at rest, in equilibrium under the controller; for an elastic robot, sagged."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..errors import RefusedError
from ..representation import Drive, Robot
from .backend import MachineState, Vector

if TYPE_CHECKING:
    from ..control import Control
    from ..motion import MotionLaw

TOLERANCE = 1.0e-13
ITERATIONS = 50


class Weighed(Protocol):
    """What knows the torques that hold the arms against gravity: a running engine, or the robot's own dynamics."""

    def gravity(self, q: Vector) -> Vector:
        """Torques at q, shape (n,)."""
        ...


class Gains(Protocol):
    """What is known of a controller before it ticks."""

    kp: Vector

    def feedforward_at_start(self) -> Vector:
        """Torque added at t = 0, shape (n,)."""
        ...


def imposed_start(robot: Robot, engine: Weighed, law: MotionLaw) -> MachineState:
    """Sagged under gravity, moving with the motor sides if the motion begins moving."""
    theta, dtheta, _ = (row[0] for row in law.at(np.zeros(1)))
    return MachineState(0.0, sagged(robot, engine, theta), dtheta.copy(), theta, dtheta)


def controlled_start(
    robot: Robot, engine: Weighed, law: MotionLaw, control: Control, controller: Gains
) -> MachineState:
    """At rest in equilibrium under the controller; where there are no gains, at rest at the command."""
    command = law.at(np.zeros(1))[0][0]
    still = np.zeros(robot.n)
    kp = controller.kp
    passive = np.array([stage.drive.passive for stage in robot.stages])
    if control.mode == "torque" or not np.all((kp > 0.0) | passive):
        q = sagged(robot, engine, command)
        return MachineState(0.0, q, still, np.where(passive, q, command), still.copy())
    q, theta = settled(robot, engine, command, kp, controller.feedforward_at_start())
    return MachineState(0.0, q, still, theta, still.copy())


def arm_load(robot: Robot, engine: Weighed, q: Vector) -> Vector:
    """Torque that drives, and springs of passive joints, must pass to the arms at rest, shape (n,)."""
    springs = [
        0.0 if stage.drive.passive else sum(spring.stiffness * (x - spring.rest) for spring in stage.drive.arm_springs)
        for stage, x in zip(robot.stages, q, strict=True)
    ]
    return engine.gravity(q) + np.array(springs)


def sagged(robot: Robot, engine: Weighed, theta: Vector) -> Vector:
    """Arm-side position at rest under gravity with the motor sides held at theta, shape (n,).

    Solves K (theta - q) = g(q) to convergence; the one-shot K^-1 g(theta) is off by up to 1.3 % on the paper's arm.

    Raises:
        RefusedError: No equilibrium was found (the springs are too soft to hold the robot).
    """
    return _equilibrium(robot, engine, theta, np.zeros(robot.n))


def settled(robot: Robot, engine: Weighed, command: Vector, kp: Vector, feedforward: Vector) -> tuple[Vector, Vector]:
    """(q, theta) at rest under a proportional controller, shapes (n,).

    Args:
        robot: At its level.
        engine: Whose gravity counts.
        command: Commanded motor-side position (true, without the encoder's offset), shape (n,).
        kp: Gains in force [N m/rad or N/m], above 0 but for passive joints, shape (n,).
        feedforward: Torque that the controller adds [N m or N], shape (n,).

    Raises:
        RefusedError: No equilibrium was found (gains or springs are too soft to hold the robot).
    """
    gain = np.array([stage.drive.gain for stage in robot.stages])
    passive = np.array([stage.drive.passive for stage in robot.stages])
    softness = np.where(passive, 0.0, 1.0 / np.where(passive, 1.0, gain * kp))
    held = command + softness * gain * feedforward
    q = _equilibrium(robot, engine, held, softness)
    return q, np.where(passive, q, held - softness * arm_load(robot, engine, q))


def _equilibrium(robot: Robot, engine: Weighed, held: Vector, softness: Vector) -> Vector:
    """The q that solves q = held - (softness + 1/K) load(q), by Newton's method with a difference Jacobian."""
    give = softness + np.array([_series_softness(stage.drive) for stage in robot.stages])
    q = held - give * arm_load(robot, engine, held)
    size = 1.0e-6
    largest = np.inf
    for _ in range(ITERATIONS):
        residual = q - held + give * arm_load(robot, engine, q)
        largest = float(np.max(np.abs(residual)))
        if largest < TOLERANCE * (1.0 + float(np.max(np.abs(held)))):
            return q
        jacobian = np.eye(robot.n)
        for j in range(robot.n):
            shift = np.zeros(robot.n)
            shift[j] = size
            slope = (arm_load(robot, engine, q + shift) - arm_load(robot, engine, q - shift)) / (2 * size)
            jacobian[:, j] += give * slope
        q = q - np.linalg.solve(jacobian, residual)
    raise RefusedError(
        f"{robot.name} finds no rest under gravity (residual {largest:.3g} rad or m after "
        f"{ITERATIONS} iterations): springs or gains are too soft to hold it."
    )


def _series_softness(drive: Drive) -> float:
    """What a drive gives per torque that passes it [rad/(N m) or m/N]; a passive joint rests at 0 on its springs."""
    if drive.passive:
        return 1.0 / sum(spring.stiffness for spring in drive.arm_springs)
    return 1.0 / drive.spring.stiffness if drive.spring else 0.0
