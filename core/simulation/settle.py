"""Where a run starts: at rest, in equilibrium under the controller; for an elastic robot, sagged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from ..representation import Drive, Robot, TermKind
from .backend import MachineState, Vector
from .compiled import law_function

if TYPE_CHECKING:
    from ..motion import MotionLaw

Mask = NDArray[np.bool_]

TOLERANCE = 1.0e-13
ITERATIONS = 50
# a torque below this part of the robot's weight times 1 m is none, and play stands centred under it
WEIGHTLESS = 1.0e-9
# how often the sides on which play is closed are looked at again
BRANCHES = 20
# step of differences for slopes [rad or m]
SHIFT = 1.0e-6


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
    q = sagged(robot, engine, theta)
    wobble = [
        terms_at_rest(stage.drive, "error_slope", x, y) for stage, x, y in zip(robot.stages, theta, q, strict=True)
    ]
    return MachineState(0.0, q, dtheta * (1.0 + np.array(wobble)), theta, dtheta)


def controlled_start(robot: Robot, engine: Weighed, law: MotionLaw, controller: Gains) -> MachineState:
    """At rest in equilibrium under the controller; where there are no gains, at rest at the command."""
    command = law.at(np.zeros(1))[0][0]
    still = np.zeros(robot.n)
    kp = controller.kp
    passive = np.array([stage.drive.passive for stage in robot.stages])
    if not np.all((kp > 0.0) | passive):
        q = sagged(robot, engine, command)
        return MachineState(0.0, q, still, np.where(passive, q, command), still.copy())
    q, theta = settled(robot, engine, command, kp, controller.feedforward_at_start())
    return MachineState(0.0, q, still, theta, still.copy())


def sagged(robot: Robot, engine: Weighed, theta: Vector) -> Vector:
    """Arm-side position at rest under gravity with the motor sides held at theta, shape (n,).

    Solves T(theta + e - q) = load(q) to convergence; the one-shot q = theta - load(theta) / K is off by up to 1.3 % on
    the paper's arm.

    Raises:
        RefusedError: No equilibrium was found (the springs are too soft to hold the robot).
    """
    return _Rest(robot, engine, theta, np.zeros(robot.n)).found()[0]


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
    stiffness = np.where(passive, 1.0, gain * kp)
    if (nothing := np.flatnonzero(~(stiffness > 0.0))).size:
        joints = ", ".join(f"joint_{i + 1}" for i in nothing.tolist())
        raise RefusedError(
            f"robot {robot.name}: the controller holds nothing at {joints}, whose drive gives no torque."
        )
    softness = np.where(passive, 0.0, 1.0 / stiffness)
    return _Rest(robot, engine, command + softness * gain * feedforward, softness).found()


def weight_of(robot: Robot) -> float:
    """Weight of all arms [N]."""
    return sum(stage.arm.inertia.mass for stage in robot.stages) * float(np.linalg.norm(robot.gravity))


def terms_at_rest(drive: Drive, kind: TermKind, theta: float, q: float) -> float:
    """Sum of a drive's laws of one kind at rest."""
    return sum(
        float(law_function(term.effect, term.law)(term.parameters, 0.0, theta, 0.0, q, 0.0, 0.0))
        for term in drive.terms
        if term.kind == kind
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Rest:
    """The equilibrium of a robot whose motor sides stand on springs, at q = theta + e(theta) - stretch(T).

    The motor sides give way to what acts on them: theta = held - softness ((1 + de/dtheta) T + resistance(theta)), and
    T is the load of the arm at q. Friction and hysteresis are at zero force.

    Attributes:
        robot: At its level.
        engine: Whose gravity counts.
        held: Where the motor sides are without any torque, shape (n,).
        softness: What they give per torque [rad/(N m) or m/N], shape (n,).
    """

    robot: Robot
    engine: Weighed
    held: Vector
    softness: Vector

    def found(self) -> tuple[Vector, Vector]:
        """(q, theta), shapes (n,).

        Play is closed on the side that the load presses on. A load that turns its sign within the play is zero there,
        and play under no load at all stands centred.
        """
        play = np.array([stage.drive.spring.gap if stage.drive.spring else 0.0 for stage in self.robot.stages])
        load = self.load(self.held)
        side = np.where(play > 0.0, self._pressed(load), 0.0)
        loose: Mask = np.zeros(self.robot.n, dtype=np.bool_)
        for _ in range(BRANCHES):
            q = self._solved(side, loose)
            load = self.load(q)
            theta = self._motor(q, load)
            pressed = np.where(play > 0.0, self._pressed(load), 0.0)
            stretch = self._stretch(q, theta)
            # what was let loose must stay within its play, what is pressed must press back
            beyond = loose & (np.abs(stretch) > play / 2 * (1.0 + WEIGHTLESS))
            against = ~loose & (side * pressed < 0.0)
            newly = ~loose & (side == 0.0) & (pressed != 0.0)
            if not (beyond | against | newly).any():
                return q, theta
            side = np.where(beyond, np.sign(stretch), np.where(newly, pressed, np.where(against, 0.0, side)))
            loose = np.asarray((loose & ~beyond) | against, dtype=np.bool_)
        raise self._restless(float(np.max(play)))

    def load(self, q: Vector) -> Vector:
        """Torque that drives, and springs of passive joints, must pass to the arms at rest, shape (n,)."""
        held = [
            0.0
            if stage.drive.passive
            else sum(spring.stiffness * (x - spring.rest) for spring in stage.drive.arm_springs)
            - terms_at_rest(stage.drive, "arm", x, x)
            for stage, x in zip(self.robot.stages, q, strict=True)
        ]
        return self.engine.gravity(q) + np.array(held)

    def _pressed(self, load: Vector) -> Vector:
        return np.where(np.abs(load) > WEIGHTLESS * weight_of(self.robot), np.sign(load), 0.0)

    def _stretch(self, q: Vector, theta: Vector) -> Vector:
        error = [
            terms_at_rest(stage.drive, "error", x, y) for stage, x, y in zip(self.robot.stages, theta, q, strict=True)
        ]
        return theta + np.array(error) - q

    def _motor(self, q: Vector, load: Vector) -> Vector:
        """Where the motor sides stand under a load, shape (n,)."""
        theta = self.held - self.softness * load
        for i, stage in enumerate(self.robot.stages):
            drive = stage.drive
            if drive.passive:
                theta[i] = q[i]
            elif self.softness[i] and any(term.kind in ("resistance", "error_slope") for term in drive.terms):
                theta[i] = self._yielding(i, float(q[i]), float(load[i]))
        return theta

    def _yielding(self, i: int, q: float, load: float) -> float:
        """The theta at which a motor side stands whose resistance or gear changes with it."""
        drive, held, softness = self.robot.stages[i].drive, float(self.held[i]), float(self.softness[i])

        def beyond(theta: float) -> float:
            # a rigid joint's arm side is its motor side
            arm = q if drive.spring else theta
            torque = (1.0 + terms_at_rest(drive, "error_slope", theta, arm)) * load + terms_at_rest(
                drive, "resistance", theta, arm
            )
            return theta - held + softness * torque

        return _root(beyond, held - softness * load, self._restless)

    def _residual(self, q: Vector, side: Vector, loose: Mask) -> Vector:
        """How far q is from where motor side and stretch put it; of loose joints, their load as a displacement."""
        load = self.load(q)
        theta = self._motor(q, load)
        left = np.empty(self.robot.n)
        for i, stage in enumerate(self.robot.stages):
            drive = stage.drive
            give = _series_softness(drive)
            if loose[i]:
                left[i] = (give + self.softness[i]) * load[i]
            elif drive.passive:
                left[i] = q[i] + give * load[i]
            else:
                gap = side[i] * drive.spring.gap / 2 if drive.spring else 0.0
                left[i] = (
                    q[i] - theta[i] - terms_at_rest(drive, "error", float(theta[i]), float(q[i])) + give * load[i] + gap
                )
        return left

    def _solved(self, side: Vector, loose: Mask) -> Vector:
        """The q at rest with play closed on given sides, by Newton's method with a difference Jacobian."""
        n = self.robot.n
        q = self.held - np.where(loose, 0.0, self._residual(self.held, side, loose))
        largest = np.inf
        for _ in range(ITERATIONS):
            residual = self._residual(q, side, loose)
            largest = float(np.max(np.abs(residual)))
            if largest < TOLERANCE * (1.0 + float(np.max(np.abs(self.held)))):
                return q
            jacobian = np.empty((n, n))
            for j in range(n):
                shift = np.zeros(n)
                shift[j] = SHIFT
                above, below = self._residual(q + shift, side, loose), self._residual(q - shift, side, loose)
                jacobian[:, j] = (above - below) / (2 * SHIFT)
            if not np.isfinite(jacobian).all() or not np.linalg.det(jacobian):
                break
            q = q - np.linalg.solve(jacobian, residual)
        raise self._restless(largest)

    def _restless(self, residual: float) -> RefusedError:
        return RefusedError(
            f"{self.robot.name} finds no rest under gravity (residual {residual:.3g} rad or m after "
            f"{ITERATIONS} iterations): springs or gains are too soft to hold it."
        )


def _root(function: Callable[[float], float], start: float, failure: Callable[[float], RefusedError]) -> float:
    """Where a smooth function of slope near 1 is zero, by Newton's method with differences."""
    x = start
    for _ in range(ITERATIONS):
        value = function(x)
        if abs(value) < TOLERANCE * 1.0e-2 * (1.0 + abs(x)):
            return x
        x -= value * 2 * SHIFT / (function(x + SHIFT) - function(x - SHIFT))
    raise failure(abs(function(x)))


def _series_softness(drive: Drive) -> float:
    """What a drive gives per torque that passes it [rad/(N m) or m/N]; a passive joint rests at 0 on its springs."""
    if drive.passive:
        return 1.0 / sum(spring.stiffness for spring in drive.arm_springs)
    return 1.0 / drive.spring.stiffness if drive.spring else 0.0
