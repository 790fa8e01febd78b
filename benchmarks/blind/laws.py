"""The generator's own laws: the catalogue's forms, and others that real drives are nearer to.

Every joint has one row of numbers, `NAMES` below names its columns. Form 0 is the catalogue's law, form 1 another one:
friction: LuGre (Canudas de Wit et al. 1995) with asymmetry; springs: stiffening with the cube; backlash: a soft
contact; hysteresis: Dahl (1968); torque limit: a smooth knee; periodic laws: a second harmonic.
"""

from __future__ import annotations

import math

from numba import njit

NAMES = (
    # motor
    "inertia", "gain", "gain_droop", "limit", "limit_form", "lag",
    # friction
    "form", "coulomb", "asymmetry", "stribeck", "velocity", "exponent", "viscous", "viscous_bend", "load",
    "load_asymmetry", "bristle", "bristle_inertia", "bristle_lead", "drag",
    "wavy", "waves", "wavy_phase", "warm", "warm_time",
    # hysteresis
    "hysteresis_form", "hysteresis", "hysteresis_stiffness",
    # periodic
    "ripple", "ripple_cycles", "ripple_phase", "ripple_second", "ripple_growth",
    "error", "error_cycles", "error_phase", "error_second",
    # elastic
    "elastic", "stiffness", "damping", "stiffening", "gap", "soft",
    # on the arm
    "spring", "spring_rest", "spring_bend",
    # with another joint
    "partner", "coupling", "cable", "cable_ratio",
)  # fmt: skip
COLUMN = {name: number for number, name in enumerate(NAMES)}
SLIPS = 8

(
    INERTIA, GAIN, DROOP, LIMIT, LIMIT_FORM, LAG,
    FORM, COULOMB, ASYMMETRY, STRIBECK, VELOCITY, EXPONENT, VISCOUS, VISCOUS_BEND, LOAD,
    LOAD_ASYMMETRY, BRISTLE, BRISTLE_INERTIA, BRISTLE_LEAD, DRAG, WAVY, WAVES, WAVY_PHASE, WARM, WARM_TIME,
    HYSTERESIS_FORM, HYSTERESIS, HYSTERESIS_STIFFNESS,
    RIPPLE, RIPPLE_CYCLES, RIPPLE_PHASE, RIPPLE_SECOND, RIPPLE_GROWTH,
    ERROR, ERROR_CYCLES, ERROR_PHASE, ERROR_SECOND,
    ELASTIC, STIFFNESS, DAMPING, STIFFENING, GAP, SOFT,
    SPRING, SPRING_REST, SPRING_BEND,
    PARTNER, COUPLING, CABLE, CABLE_RATIO,
) = range(len(NAMES))  # fmt: skip


@njit(cache=True)
def level(p, v, theta, t, passed):
    """Level of dry friction [N m] at a speed; `passed` is the torque behind the gear."""
    side = 1.0 if v >= 0.0 else -1.0
    dry = p[COULOMB]
    if p[STRIBECK] != 0.0:
        dry += p[STRIBECK] * math.exp(-((abs(v) / p[VELOCITY]) ** p[EXPONENT]))
    value = dry * (1.0 + side * p[ASYMMETRY])
    if p[LOAD] != 0.0:
        # other where the load drives than where it is driven
        pushes = 1.0 if passed * v >= 0.0 else -1.0
        value += p[LOAD] * abs(passed) * (1.0 + pushes * p[LOAD_ASYMMETRY])
    if p[WAVY] != 0.0:
        value *= 1.0 + p[WAVY] * math.sin(p[WAVES] * theta + p[WAVY_PHASE])
    if p[WARM] != 0.0:
        value *= 1.0 - p[WARM] * (1.0 - math.exp(-t / p[WARM_TIME]))
    return value


@njit(cache=True)
def smooth_resistance(p, v, theta, t):
    """Friction without memory [N m]: viscous, drag, ripple."""
    value = p[DRAG] * abs(v) * v
    if p[VISCOUS] != 0.0:
        value += p[VISCOUS] * v / (1.0 + p[VISCOUS_BEND] * abs(v))
    if p[RIPPLE] != 0.0:
        angle = p[RIPPLE_CYCLES] * theta + p[RIPPLE_PHASE]
        value += p[RIPPLE] * (1.0 + p[RIPPLE_GROWTH] * t) * (
            math.sin(angle) + p[RIPPLE_SECOND] * math.sin(2.0 * angle + 0.7)
        )  # fmt: skip
    return value


@njit(cache=True)
def bristle(p, z, v, height):
    """(force, dz) of dry friction whose bristle is bent by z [rad], at a level `height`."""
    if height <= 0.0:
        return 0.0, 0.0
    if p[FORM] == 0.0:
        # elastic, then sliding; damped while it sticks. What slides is let go after each step
        bent = (z + p[BRISTLE_LEAD] * v) / p[BRISTLE]
        return height * min(1.0, max(-1.0, bent)), v
    # LuGre: its stiffness from the level at rest, its damping a fraction of the critical
    sigma = max(p[COULOMB] + p[STRIBECK], height) / p[BRISTLE]
    dz = v - sigma * abs(v) / height * z
    return sigma * z + 0.6 * math.sqrt(sigma * p[BRISTLE_INERTIA]) * dz, dz


@njit(cache=True)
def bristle_after(p, z, v, height):
    """The bristle after a step: what slid stays slid (form 0)."""
    if p[FORM] != 0.0 or height <= 0.0:
        return z
    return min(p[BRISTLE], max(-p[BRISTLE], z))


@njit(cache=True)
def gear_error(p, theta):
    """(e, de/dtheta, d2e/dtheta2) of the transmission."""
    if p[ERROR] == 0.0:
        return 0.0, 0.0, 0.0
    c = p[ERROR_CYCLES]
    angle = c * theta + p[ERROR_PHASE]
    s2, c2 = math.sin(2.0 * angle + 0.7), math.cos(2.0 * angle + 0.7)
    a, b = p[ERROR], p[ERROR] * p[ERROR_SECOND]
    return (
        a * math.sin(angle) + b * s2,
        c * (a * math.cos(angle) + 2.0 * b * c2),
        -c * c * (a * math.sin(angle) + 4.0 * b * s2),
    )


@njit(cache=True)
def passed_torque(p, stretch, dstretch):
    """T of the elastic connection [N m]."""
    half = 0.5 * p[GAP]
    if half == 0.0:
        return p[STIFFNESS] * stretch * (1.0 + p[STIFFENING] * stretch * stretch) + p[DAMPING] * dstretch
    if p[SOFT] == 0.0:
        if stretch > half:
            return max(p[STIFFNESS] * (stretch - half) + p[DAMPING] * dstretch, 0.0)
        if stretch < -half:
            return min(p[STIFFNESS] * (stretch + half) + p[DAMPING] * dstretch, 0.0)
        return 0.0
    w = p[SOFT] * p[GAP]
    right = math.sqrt((stretch - half) ** 2 + w * w)
    left = math.sqrt((stretch + half) ** 2 + w * w)
    pressed = 0.5 * (stretch - half + right) - 0.5 * (-stretch - half + left)
    slope = 1.0 - 0.5 * ((stretch + half) / left - (stretch - half) / right)
    torque = p[STIFFNESS] * pressed + p[DAMPING] * slope * dstretch
    # a contact does not pull
    if pressed > 0.0:
        return max(torque, 0.0)
    return min(torque, 0.0)


@njit(cache=True)
def stretch_of(p, torque):
    """The stretch at rest under a torque, by bisection."""
    low, high = -1.0, 1.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if passed_torque(p, middle, 0.0) > torque:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@njit(cache=True)
def arm_spring(p, q):
    """Torque of the spring on the arm [N m]."""
    if p[SPRING] == 0.0:
        return 0.0
    x = q - p[SPRING_REST]
    return -p[SPRING] * x * (1.0 + p[SPRING_BEND] * x * x)


@njit(cache=True)
def limited(p, tau):
    """The torque that the limit lets through."""
    top = p[LIMIT]
    if top <= 0.0:
        return tau
    if p[LIMIT_FORM] == 0.0:
        return min(top, max(-top, tau))
    return tau / (1.0 + abs(tau / top) ** 12.0) ** (1.0 / 12.0)


@njit(cache=True)
def motor_torque(p, tau):
    """What the motor truly gives: a gain that may droop where the torque is high, as iron that saturates makes it."""
    return p[GAIN] * tau / math.sqrt(1.0 + 2.0 * p[DROOP] * tau * tau)
