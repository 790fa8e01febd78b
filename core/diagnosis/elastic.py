"""Arms behind springs whose motor sides move as recorded; plain text that Numba compiles.

Newmark's method (1959), free of damping of its own. With constant average acceleration (beta = 1/4) it is stable at
any step, so that a spring may be much stiffer than the record is fast; its periods are too long by (omega h)^2 / 12.
Springs that the record can follow have beta = 1/12, of fourth order (Fox and Goodwin, 1949): in seconds of ringing a
thousandth of a period is many times the noise.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kinematics.rigid_body import ChainTable, newton_euler, place_joints
from ..simulation.drive_law import factorised, solved

Vector = NDArray[np.float64]

# the state of rest is found by so many steps of a fixed point
REST_ITERATIONS = 50
# of the torque that would stretch a spring by half its clearance, what leaves the play centred
NO_LOAD = 1e-6
# (omega h)^2 up to which a spring is followed by the method that is stable up to 6
FOLLOWED = 1.0


class SpringTable(NamedTuple):
    """Springs between motor sides and arms as arrays, SI; those of n joints, shapes (n,).

    Attributes:
        stiffness, damping: Of the drives' springs.
        stiffening: By the square of a spring's stretch s beyond its clearance: T = K s (1 + stiffening s^2).
        half_gap: Half of the clearance.
        side: Where in it an arm begins, from -1 to 1 as the spring is stretched; NaN: where its load presses it.
        holds: Whether the damper pulls; across a clearance no other does.
        arm_stiffness: Of springs on the arms.
        arm_rest: Where these rest.
    """

    stiffness: Vector
    damping: Vector
    stiffening: Vector
    half_gap: Vector
    side: Vector
    holds: NDArray[np.bool_]
    arm_stiffness: Vector
    arm_rest: Vector


def arms_along(
    chain: Any, elastic: Any, springs: SpringTable, h: float, theta: Any, dtheta: Any, ddtheta: Any
) -> tuple[Any, Any, Any]:
    """Motion of the arms that a recorded motion of the motor sides makes; rigid joints follow it.

    Args:
        chain: The arms, a ChainTable of n joints.
        elastic: Indices of the joints with a spring, shape (e,), int64.
        springs: None of these with a clearance.
        h: Time between samples [s].
        theta: Motor sides (with transmission errors), shape (m, n).
        dtheta: Their speeds.
        ddtheta: Their accelerations.

    Returns:
        Arm sides, their speeds and accelerations, shapes (m, n); they begin at rest under gravity.
    """
    m, n = theta.shape
    e = len(elastic)
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    needed = np.empty(n)
    reduced = np.empty((e, e))
    change = np.empty(e)
    pull = np.empty(e)
    moved = np.empty(e)
    stiffness, damping, stiffening = springs.stiffness, springs.damping, springs.stiffening
    arm_stiffness, arm_rest = springs.arm_stiffness, springs.arm_rest
    q, dq, ddq = theta.copy(), dtheta.copy(), ddtheta.copy()
    hang(chain, elastic, springs, theta[0], q[0])
    for a in range(e):
        dq[0, elastic[a]] = dtheta[0, elastic[a]]
        ddq[0, elastic[a]] = ddtheta[0, elastic[a]]
    beta = np.empty(e)
    mass = np.empty((e, e))
    place_joints(chain, q[0], rotation, position)
    mass_matrix_among(chain, elastic, rotation, position, reduced)
    factorised(reduced)
    for a in range(e):
        for b in range(e):
            change[b] = 1.0 if b == a else 0.0
        solved(reduced, change)
        # no lighter than with everything else free
        i = elastic[a]
        stretch = theta[0, i] - q[0, i]
        hardest = stiffness[i] * (1.0 + 3.0 * stiffening[i] * stretch * stretch)
        followed = (hardest + arm_stiffness[i]) * change[a] * h * h <= FOLLOWED
        beta[a] = 1.0 / 12.0 if followed else 0.25
    for k in range(m):
        # at the first sample only the accelerations are to be found
        step = h if k > 0 else 0.0
        if k > 0:
            for i in elastic:
                q[k, i] = q[k - 1, i] + h * dq[k - 1, i] + 0.5 * h * h * ddq[k - 1, i]
                dq[k, i] = dq[k - 1, i] + h * ddq[k - 1, i]
                ddq[k, i] = ddq[k - 1, i]
        place_joints(chain, q[k], rotation, position)
        newton_euler(chain, rotation, position, dq[k], ddq[k], needed)
        mass_matrix_among(chain, elastic, rotation, position, mass)
        for a in range(e):
            moved[a] = 0.0
        # two passes: the second knows how stiff each spring ends up
        for _ in range(2):
            for a in range(e):
                i = elastic[a]
                stretch = theta[k, i] - q[k, i]
                square = stiffening[i] * stretch * stretch
                pull[a] = stiffness[i] * (1.0 + 3.0 * square)
                force = stiffness[i] * stretch * (1.0 + square) + damping[i] * (dtheta[k, i] - dq[k, i])
                force -= arm_stiffness[i] * (q[k, i] - arm_rest[i])
                change[a] = force - needed[i]
                for b in range(e):
                    change[a] -= mass[a, b] * moved[b]
                    reduced[a, b] = mass[a, b]
                reduced[a, a] += 0.5 * step * damping[i] + beta[a] * step * step * (pull[a] + arm_stiffness[i])
            factorised(reduced)
            solved(reduced, change)
            for a in range(e):
                i = elastic[a]
                moved[a] += change[a]
                ddq[k, i] += change[a]
                dq[k, i] += 0.5 * step * change[a]
                q[k, i] += beta[a] * step * step * change[a]
    return q, dq, ddq


def hang(chain: Any, elastic: Any, springs: SpringTable, theta: Any, q: Any) -> None:
    """Where arms rest under gravity behind their springs, and at which side of their clearances.

    Args:
        chain: The arms, a ChainTable of n joints.
        elastic: Indices of the joints with a spring, shape (e,), int64.
        springs: Of all joints.
        theta: Motor sides, shape (n,).
        q: In: where to start from; out: arm sides.
    """
    n = len(theta)
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    needed = np.empty(n)
    still = np.zeros(n)
    for _ in range(REST_ITERATIONS):
        place_joints(chain, q, rotation, position)
        newton_euler(chain, rotation, position, still, still, needed)
        for i in elastic:
            load = needed[i] + springs.arm_stiffness[i] * (q[i] - springs.arm_rest[i])
            clearance = springs.half_gap[i] if load > 0.0 else -springs.half_gap[i]
            if not math.isnan(springs.side[i]):
                clearance = springs.side[i] * springs.half_gap[i]
            elif abs(load) <= NO_LOAD * springs.stiffness[i] * springs.half_gap[i]:
                clearance = 0.0
            stretch = load / springs.stiffness[i]
            if springs.stiffening[i] > 0.0:
                # Cardano's root of s + stiffening s^3
                root = math.sqrt(3.0 * springs.stiffening[i])
                stretch = 2.0 / root * math.sinh(math.asinh(1.5 * root * stretch) / 3.0)
            q[i] = theta[i] - stretch - clearance


def mass_matrix_among(chain: Any, some: Any, rotation: Any, position: Any, mass: Any) -> None:
    """Mass matrix among some joints of a placed chain: what accelerations of one after the other take.

    Where few joints are asked for that is a fraction of the whole matrix's work.

    Args:
        chain: The arms.
        some: Indices of the joints, ascending, shape (e,), int64.
        rotation: Moving joint frames in the frames before them, shape (n, 3, 3).
        position: Their origins there, shape (n, 3).
        mass: Out, shape (e, e).
    """
    weightless = np.zeros(3)
    for a in range(len(some)):
        i = some[a]
        # what is before the joint stands still, and the chain begins there
        rest = ChainTable(
            chain.kind[i:],
            chain.rotation[i:],
            chain.position[i:],
            chain.mass[i:],
            chain.com[i:],
            chain.tensor[i:],
            weightless,
        )
        count = len(rest.mass)
        alone = np.zeros(count)
        still = np.zeros(count)
        needed = np.empty(count)
        alone[0] = 1.0
        newton_euler(rest, rotation[i:], position[i:], still, alone, needed)
        for b in range(a, len(some)):
            mass[a, b] = mass[b, a] = needed[some[b] - i]
