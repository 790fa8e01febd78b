"""The arm's own oscillations, from the eigenvalues of its linearised equations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control import Control
from ..kinematics import dynamics
from ..representation import Robot
from .statics import damping, stiffness

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# step of differences for gravity's own stiffness [rad]
SHIFT = 1.0e-5


@dataclass(frozen=True, slots=True)
class Mode:
    """One oscillation.

    Attributes:
        frequency: As it is seen, damped [Hz].
        damping_ratio: Part of the critical damping.
    """

    frequency: float
    damping_ratio: float

    def to_json(self) -> dict[str, float]:
        """As plain data."""
        return {"frequency_hz": self.frequency, "damping_ratio": self.damping_ratio}


def modes_of(eigenvalues: Complex) -> tuple[Mode, ...]:
    """The oscillations among eigenvalues [1/s], the slowest first."""
    turning = eigenvalues[eigenvalues.imag > 0.0]
    order = np.argsort(np.abs(turning), kind="stable")
    return tuple(Mode(float(value.imag / (2.0 * math.pi)), float(-value.real / abs(value))) for value in turning[order])


def arm_modes(robot: Robot, q: Array) -> tuple[Mode, ...]:
    """Oscillations of the arm about rest at q (n,) with its motor sides held: M q'' + b q' + (K + dg/dq) q = 0."""
    mass, b, k = _arm(robot, q)
    return modes_of(np.asarray(np.linalg.eigvals(_companion(mass, b, k)), dtype=np.complex128))


def loop_modes(robot: Robot, q: Array, control: Control, late: int = 0) -> tuple[Mode, ...]:
    """Oscillations about rest at q (n,) under a controller in ticks, its feedback `late` ticks old."""
    factors = _loop_factors(robot, q, control, late)
    lasting = factors[np.abs(factors) > 1.0e-9]
    return modes_of(np.asarray(np.log(lasting) * control.rate, dtype=np.complex128))


def loop_growth(robot: Robot, q: Array, control: Control, late: int = 0) -> float:
    """Factor by which the loop's quickest growing part grows from tick to tick; below 1 the loop is stable."""
    return float(np.max(np.abs(_loop_factors(robot, q, control, late))))


def _loop_factors(robot: Robot, q: Array, control: Control, late: int) -> Complex:
    """Eigenvalues of the step from tick to tick.

    Exact for the sampled loop: between ticks the torque is held and the linear plant moves by its matrix exponential.
    """
    # its types are not known
    expm: Any = import_module("scipy.linalg").expm

    n, period = robot.n, 1.0 / control.rate
    mass, b, k = _arm(robot, q)
    spring, damper = np.diag(stiffness(robot)), np.diag(damping(robot))
    motor = np.diag([stage.drive.inertia for stage in robot.stages])
    none = np.zeros((n, n))
    whole = _companion(
        np.block([[mass, none], [none, motor]]),
        np.block([[b, -damper], [-damper, damper]]),
        np.block([[k, -spring], [-spring, spring]]),
    )
    driven = np.zeros((4 * n, n))
    driven[3 * n :] = np.linalg.inv(motor)
    step = np.asarray(expm(period * np.block([[whole, driven], [np.zeros((n, 5 * n))]])), dtype=np.float64)
    move, push = step[: 4 * n, : 4 * n], step[: 4 * n, 4 * n :]
    # feedback of the motor side's place and speed
    gain = np.hstack([none, -np.diag(control.kp), none, -np.diag(control.kd)])
    size = 4 * n * (late + 1)
    sampled = np.zeros((size, size))
    sampled[: 4 * n, : 4 * n] = move
    sampled[: 4 * n, 4 * n * late :] += push @ gain
    # what the plant was, tick by tick
    sampled[4 * n :, : 4 * n * late] = np.eye(4 * n * late)
    return np.asarray(np.linalg.eigvals(sampled), dtype=np.complex128)


def nearest(modes: Sequence[Mode], mode: Mode) -> Mode:
    """Of some modes the one whose frequency is nearest to that of a mode."""
    return min(modes, key=lambda other: abs(other.frequency - mode.frequency))


def _arm(robot: Robot, q: Array) -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness of the arms on their springs at q (n,), each of shape (n, n)."""
    arms = dynamics(robot)
    turns = SHIFT * np.eye(robot.n)
    weight = (arms.gravity(q + turns) - arms.gravity(q - turns)).T / (2.0 * SHIFT)
    return arms.mass_matrix(q), np.diag(damping(robot)), np.diag(stiffness(robot)) + weight


def _companion(mass: Array, damping: Array, stiffness: Array) -> Array:
    """First-order form of mass x'' + damping x' + stiffness x = 0."""
    n = len(mass)
    forces = np.linalg.solve(mass, np.hstack([stiffness, damping]))
    system: Array = np.asarray(np.block([[np.zeros((n, n)), np.eye(n)], [-forces]]), dtype=np.float64)
    return system
