"""Arms behind springs with clearance whose motor sides move as recorded; plain text that Numba compiles.

An arm that crosses its clearance hits the other side within parts of a millisecond and is thrown back, which no record
is fast enough for. Between two samples the rigid bodies hardly change: contacts are followed there in finer steps of
Newmark's method (constant average acceleration), under loads that go from one sample's to the next's in a straight
line, along motor sides that go as their positions and speeds at both ends have it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kinematics.rigid_body import newton_euler, place_joints
from ..simulation.drive_law import factorised, solved
from .elastic import SpringTable, hang, mass_matrix_among

Vector = NDArray[np.float64]

# part of a radian of its own oscillation that a contact goes on in a step, and steps between two samples at most
PART, MOST_STEPS = 0.25, 128
# damping ratio of a contact that throws nothing back: a fortieth part of a speed
MOST_DAMPED = 3.0


def finer_steps(stiffness: Vector, arm: Vector, loose: NDArray[np.bool_], h: float) -> tuple[int, Vector]:
    """Even number of steps between two samples that follow contacts, and the stiffness of these, softer than no number.

    Args:
        stiffness: Of springs, shape (n,).
        arm: Moments of inertia behind them, shape (n,).
        loose: Which have a clearance.
        h: Time between samples [s].
    """
    fastest = float(np.sqrt(np.max((stiffness / arm)[loose])))
    steps = min(MOST_STEPS, 2 * math.ceil(0.5 * h * fastest / PART))
    followed = arm * (PART * steps / h) ** 2
    return steps, np.where(loose, np.minimum(stiffness, followed), stiffness)


def rebounding(stiffness: Vector, damping: Vector, arm: Vector, motor: Vector) -> tuple[Vector, NDArray[np.bool_]]:
    """Damping of contacts by which arms are thrown back from motor sides that move as they were seen to.

    Two bodies that meet at a speed u part at e u. Of that the arm's speed changes by r (1 + e) u, where r is the part
    that the motor's inertia J has of both, J / (J + M), and the motor's by (1 - r) (1 + e) u. A record is too slow for
    the blow: half of the motor's change is in the speed that it is seen to meet the arm with. From that the arm is
    thrown back by e', where 1 + e' = r (1 + e) / (1 - (1 - r) (1 + e) / 2). A motor that is lighter than its arm is
    pushed away, comes back at once and stays: such contacts hold.

    Args:
        stiffness: Of the contacts, shape (n,).
        damping: Of the same.
        arm: Moments of inertia M behind them.
        motor: J before them; infinite where a motor goes as it is told.

    Returns:
        The damping, and which dampers pull as well as push, shapes (n,).
    """
    finite = np.isfinite(motor)
    part = np.where(finite, np.where(finite, motor, 0.0) / (np.where(finite, motor, 0.0) + arm), 1.0)
    ratios = np.linspace(0.0, MOST_DAMPED, 400)
    known = thrown_back(ratios)
    back = np.interp(damping / (2.0 * np.sqrt(stiffness * np.maximum(part * arm, 1e-300))), ratios, known)
    seen = part * (1.0 + back) / np.maximum(1.0 - 0.5 * (1.0 - part) * (1.0 + back), 1e-300) - 1.0
    return 2.0 * np.interp(-seen, -known, ratios) * np.sqrt(stiffness * arm), part < 0.5


def thrown_back(ratio: Vector) -> Vector:
    """Part of its speed with which a body leaves a contact of a damping ratio whose damper never pulls, shape (k,).

    It leaves where spring and damper together push no longer (Schwager and Poeschel, 2007).
    """
    near = np.abs(ratio - 1.0) < 1e-3
    z = np.where(near, 1.0 - 1e-3, ratio)
    root = np.sqrt(np.abs(1.0 - z * z))
    swings = np.exp(-z / root * np.arctan2(2.0 * z * root, 2.0 * z * z - 1.0))
    creeps = np.exp(-z / root * np.log((z + root) / np.maximum(z - root, 1e-300)))
    return np.where(z < 1.0, swings, creeps)


def arms_across(
    chain: Any, elastic: Any, springs: SpringTable, finer: int, h: float, theta: Any, dtheta: Any, ddtheta: Any
) -> tuple[Any, Any, Any]:
    """Motion of the arms that a recorded motion of the motor sides makes across their clearances.

    Args:
        chain: The arms, a ChainTable of n joints.
        elastic: Indices of the joints with a spring, shape (e,), int64.
        springs: Of all joints.
        finer: Steps between two samples, an even number.
        h: Time between samples [s].
        theta: Motor sides (with transmission errors), shape (m, n).
        dtheta: Their speeds.
        ddtheta: Their accelerations.

    Returns:
        Arm sides, their speeds and accelerations, shapes (m, n), as `arms_along`; accelerations of those that are hit
        within a sample's time are the mean over it, in which all of a blow is.
    """
    m, n = theta.shape
    e = len(elastic)
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    needed = np.empty(n)
    mass, reduced = np.empty((e, e)), np.empty((e, e))
    before, after = np.empty(e), np.empty(e)
    x, v, a = np.empty(e), np.empty(e), np.zeros(e)
    change, pull, give, moved = np.empty(e), np.empty(e), np.empty(e), np.empty(e)
    place, rate, load = np.empty(e), np.empty(e), np.empty(e)
    half, last = np.empty(e), np.empty(e)
    hit = finer * PART > 1.0
    steady = np.zeros(e)
    q, dq, ddq = theta.copy(), dtheta.copy(), ddtheta.copy()
    hang(chain, elastic, springs, theta[0], q[0])
    for b in range(e):
        x[b] = q[0, elastic[b]]
        v[b] = dtheta[0, elastic[b]]
    step = h / finer
    for k in range(m):
        # where the arms would be by now, unless they are hit
        for b in range(e):
            i = elastic[b]
            if k > 0:
                q[k, i] = x[b] + h * v[b] + 0.5 * h * h * steady[b]
                dq[k, i] = v[b] + h * steady[b]
            ddq[k, i] = 0.0
        place_joints(chain, q[k], rotation, position)
        newton_euler(chain, rotation, position, dq[k], ddq[k], needed)
        mass_matrix_among(chain, elastic, rotation, position, mass)
        for b in range(e):
            after[b] = needed[elastic[b]]
        # at the first sample only the accelerations are to be found
        for part in range(finer if k > 0 else 1):
            s = (part + 1.0) / finer if k > 0 else 1.0
            long = step if k > 0 else 0.0
            for b in range(e):
                x[b] += long * v[b] + 0.25 * long * long * a[b]
                v[b] += 0.5 * long * a[b]
                # what the step's end adds to it is found from nothing
                a[b] = 0.0
                moved[b] = 0.0
                i = elastic[b]
                place[b], rate[b] = theta[k, i], dtheta[k, i]
                load[b] = after[b]
                if k > 0:
                    # Hermite's cubic through positions and speeds at both ends
                    rise = theta[k, i] - theta[k - 1, i]
                    c = h * dtheta[k - 1, i]
                    d = 3.0 * rise - 2.0 * c - h * dtheta[k, i]
                    f = c + h * dtheta[k, i] - 2.0 * rise
                    place[b] = theta[k - 1, i] + s * (c + s * (d + s * f))
                    rate[b] = (c + s * (2.0 * d + 3.0 * s * f)) / h
                    load[b] = before[b] + s * (after[b] - before[b])
            # two passes: the second knows on which side of its clearance each spring ends up
            for _ in range(2):
                for b in range(e):
                    i = elastic[b]
                    stretch = place[b] - x[b]
                    pull[b] = springs.stiffness[i]
                    give[b] = springs.damping[i]
                    rest = 0.0
                    if springs.half_gap[i] > 0.0:
                        if stretch > springs.half_gap[i]:
                            rest = springs.half_gap[i]
                        elif stretch < -springs.half_gap[i]:
                            rest = -springs.half_gap[i]
                        else:
                            pull[b] = 0.0
                            give[b] = 0.0
                    square = springs.stiffening[i] * (stretch - rest) * (stretch - rest)
                    force = pull[b] * (stretch - rest) * (1.0 + square) + give[b] * (rate[b] - v[b])
                    if not springs.holds[i] and force * rest < 0.0:
                        force = 0.0
                        pull[b] = 0.0
                        give[b] = 0.0
                    pull[b] *= 1.0 + 3.0 * square
                    force -= springs.arm_stiffness[i] * (x[b] - springs.arm_rest[i])
                    change[b] = force - load[b]
                    for g in range(e):
                        change[b] -= mass[b, g] * moved[g]
                        reduced[b, g] = mass[b, g]
                    reduced[b, b] += 0.5 * long * give[b] + 0.25 * long * long * (pull[b] + springs.arm_stiffness[i])
                factorised(reduced)
                solved(reduced, change)
                for b in range(e):
                    moved[b] += change[b]
                    a[b] += change[b]
                    v[b] += 0.5 * long * change[b]
                    x[b] += 0.25 * long * long * change[b]
            if k > 0 and part + 1 == finer // 2:
                for b in range(e):
                    half[b] = v[b]
        for b in range(e):
            i = elastic[b]
            if hit and k > 1:
                ddq[k - 1, i] = (half[b] - last[b]) / h
            if k > 0:
                steady[b] = (v[b] - dq[k - 1, i]) / h
                q[k, i] = x[b]
                dq[k, i] = v[b]
            if not hit or k == 0 or k == m - 1:
                ddq[k, i] = a[b]
            last[b] = half[b]
            before[b] = after[b]
    return q, dq, ddq
