"""The drives' equations, once for all engines: friction, elasticity and what effects add, at every joint.

This text is plain Python that Numba compiles (`compiled.py`), and that emitted scripts carry verbatim. It knows kinds
of terms, not effects: the laws come as a list, by functions here or by addresses where compiled.

Motor side: inertia theta'' = gain tau - friction - (1 + de/dtheta) T. Arm side: rigid bodies driven by T + on_arm.
A rigid joint has theta = q and the motor side's inertia is added to the arm's.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

LEVEL, RESISTANCE, ARM, ERROR, ERROR_SLOPE, COUPLED = 0, 1, 2, 3, 4, 5
LOAD_ITERATIONS = 200
LOAD_TOLERANCE = 1.0e-13


class DriveTable(NamedTuple):
    """The drives of a robot as arrays; n joints, m terms sorted by joint, s slip elements.

    Attributes:
        inertia: Motor-side inertia, shape (n,).
        elastic: 1 where motor and arm side are two coordinates, shape (n,), int64.
        stiffness, spring_damping, half_gap: Elastic connection, shape (n,).
        damping: Linear friction on theta', shape (n,).
        gain: True motor torque per commanded one, shape (n,).
        arm_stiffness, arm_rest: Sum of the springs on the arm side, shape (n,).
        stick_displacement, stick_time: Give of sticking friction; displacement 0 means smooth, shape (n,).
        smooth_velocity: Velocity of the smooth law's tanh, shape (n,).
        first: Terms of joint i are first[i] to first[i + 1] - 1, shape (n + 1,), int64.
        kinds: Kind of each term, shape (m,), int64.
        laws: Law of each term: its address (compiled) or function, length m.
        parameters: Parameters of each term, shape (m, 8).
        slip_first: Slip elements of joint i, as `first`, shape (n + 1,), int64.
        slip_stiffness, slip_level: shape (s,).
    """

    inertia: Any
    elastic: Any
    stiffness: Any
    spring_damping: Any
    half_gap: Any
    damping: Any
    gain: Any
    arm_stiffness: Any
    arm_rest: Any
    stick_displacement: Any
    stick_time: Any
    smooth_velocity: Any
    first: Any
    kinds: Any
    laws: Any
    parameters: Any
    slip_first: Any
    slip_stiffness: Any
    slip_level: Any


def call_law(law: Any, p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """Value of one law; compiled code replaces this by a call through the law's address."""
    return law(p, t, theta, dtheta, q, dq, load)


def transmitted_torque(stiffness: float, damping: float, half_gap: float, stretch: float, dstretch: float) -> float:
    """T of a spring-damper with clearance: 0 inside the gap, and beyond it the damper never pulls."""
    if half_gap == 0.0:
        return stiffness * stretch + damping * dstretch
    if stretch > half_gap:
        return max(stiffness * (stretch - half_gap) + damping * dstretch, 0.0)
    if stretch < -half_gap:
        return min(stiffness * (stretch + half_gap) + damping * dstretch, 0.0)
    return 0.0


def drive_torques(
    table: DriveTable,
    stick_anchor: Any,
    slip_anchor: Any,
    t: float,
    q: Any,
    dq: Any,
    theta: Any,
    dtheta: Any,
    load: Any,
    transmitted: Any,
    reaction: Any,
    friction: Any,
    on_arm: Any,
    accept: bool,
) -> None:
    """Torques of every drive at one state.

    Args:
        table: The drives.
        stick_anchor: Where each bristle is fixed [rad or m], shape (n,); moved if `accept`.
        slip_anchor: Where each slip element's spring is fixed, shape (s,); moved if `accept`.
        t: Time [s].
        q: Position of the arm side, shape (n,).
        dq: Its speed.
        theta: Position of the motor side, shape (n,); equal to q at rigid joints.
        dtheta: Its speed.
        load: Torque that a RIGID joint passes to the arm, for laws that need it, shape (n,).
        transmitted: Out: T of elastic joints (0 at rigid ones), shape (n,).
        reaction: Out: (1 + de/dtheta) T on the motor side, shape (n,).
        friction: Out: friction on the motor side, positive against positive speed, shape (n,).
        on_arm: Out: torque on the arm beside T, shape (n,).
        accept: The state is one the integrator has accepted: let what slips slip for good.
    """
    for i in range(len(q)):
        error = 0.0
        slope = 0.0
        for k in range(table.first[i], table.first[i + 1]):
            if table.kinds[k] == ERROR:
                error += call_law(table.laws[k], table.parameters[k], t, theta[i], dtheta[i], q[i], dq[i], 0.0)
            elif table.kinds[k] == ERROR_SLOPE:
                slope += call_law(table.laws[k], table.parameters[k], t, theta[i], dtheta[i], q[i], dq[i], 0.0)
        passed = load[i]
        transmitted[i] = 0.0
        reaction[i] = 0.0
        if table.elastic[i] == 1:
            passed = transmitted_torque(
                table.stiffness[i],
                table.spring_damping[i],
                table.half_gap[i],
                theta[i] + error - q[i],
                dtheta[i] * (1.0 + slope) - dq[i],
            )
            transmitted[i] = passed
            reaction[i] = (1.0 + slope) * passed
        level = 0.0
        resistance = table.damping[i] * dtheta[i]
        arm = -table.arm_stiffness[i] * (q[i] - table.arm_rest[i])
        for k in range(table.first[i], table.first[i + 1]):
            kind = table.kinds[k]
            if kind in (LEVEL, RESISTANCE, ARM):
                value = call_law(table.laws[k], table.parameters[k], t, theta[i], dtheta[i], q[i], dq[i], passed)
                if kind == LEVEL:
                    level += value
                elif kind == RESISTANCE:
                    resistance += value
                else:
                    arm += value
        if level > 0.0:
            give = table.stick_displacement[i]
            if give > 0.0:
                # damped as it bends, and never more than the level. What slides lets go by where it is: friction turns
                # where the speed does, and not before it by the time of that damping
                moved = theta[i] - stick_anchor[i]
                bent = (moved + table.stick_time[i] * dtheta[i]) / give
                if accept and moved > give:
                    stick_anchor[i] = theta[i] - give
                elif accept and moved < -give:
                    stick_anchor[i] = theta[i] + give
                resistance += level * min(max(bent, -1.0), 1.0)
            else:
                resistance += level * math.tanh(dtheta[i] / table.smooth_velocity[i])
        for k in range(table.slip_first[i], table.slip_first[i + 1]):
            limit = table.slip_level[k]
            force = table.slip_stiffness[k] * (theta[i] - slip_anchor[k])
            if force > limit:
                force = limit
                if accept:
                    slip_anchor[k] = theta[i] - limit / table.slip_stiffness[k]
            elif force < -limit:
                force = -limit
                if accept:
                    slip_anchor[k] = theta[i] + limit / table.slip_stiffness[k]
            resistance += force
        friction[i] = resistance
        on_arm[i] = arm
    for i in range(1, len(q)):
        for k in range(table.first[i], table.first[i + 1]):
            if table.kinds[k] == COUPLED:
                ratio = table.parameters[k, 0]
                value = call_law(
                    table.laws[k],
                    table.parameters[k],
                    t,
                    theta[i] + ratio * theta[i - 1],
                    dtheta[i] + ratio * dtheta[i - 1],
                    q[i] + ratio * q[i - 1],
                    dq[i] + ratio * dq[i - 1],
                    0.0,
                )
                friction[i] += value
                friction[i - 1] += ratio * value


def factorised(matrix: Any) -> None:
    """Cholesky factor of a symmetric positive definite matrix, shape (n, n), into its lower triangle."""
    n = matrix.shape[0]
    for j in range(n):
        for k in range(j):
            for i in range(j, n):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
        root = math.sqrt(matrix[j, j])
        for i in range(j, n):
            matrix[i, j] /= root


def solved(factor: Any, x: Any) -> None:
    """Solution of (factor factor^T) y = x into x, shape (n,)."""
    n = factor.shape[0]
    for i in range(n):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]


def loaded_torques(
    table: DriveTable,
    stick_anchor: Any,
    slip_anchor: Any,
    t: float,
    q: Any,
    dq: Any,
    theta: Any,
    dtheta: Any,
    load: Any,
    transmitted: Any,
    reaction: Any,
    friction: Any,
    on_arm: Any,
    accept: bool,
    command: Any,
    mass_matrix: Any,
    bias: Any,
    factor: Any,
    ddq: Any,
) -> None:
    """`drive_torques` with the load of rigid joints solved together with the accelerations.

    A rigid joint passes T = gain tau - friction - inertia q'', friction depends on T, and q'' on friction. Friction of
    coefficients below 1 makes this a contraction; it is iterated until T stands still.

    Args:
        table: The drives; as all that follows up to accept in `drive_torques`.
        stick_anchor: Memory of sticking friction.
        slip_anchor: Memory of slip elements.
        t: Time [s].
        q: Position of the arm side.
        dq: Its speed.
        theta: Position of the motor side.
        dtheta: Its speed.
        load: In: first guess of T; out: T at rigid joints, shape (n,).
        transmitted: Out.
        reaction: Out.
        friction: Out.
        on_arm: Out.
        accept: Let what slips slip for good.
        command: Motor torques before the drives' gain, shape (n,).
        mass_matrix: Of the arms, shape (n, n).
        bias: Gravity, Coriolis and centrifugal torques, shape (n,).
        factor: Workspace, shape (n, n).
        ddq: Out: accelerations of the arms, shape (n,).
    """
    n = len(q)
    for i in range(n):
        for j in range(n):
            factor[i, j] = mass_matrix[i, j]
        if table.elastic[i] == 0:
            factor[i, i] += table.inertia[i]
    factorised(factor)
    for _ in range(LOAD_ITERATIONS):
        drive_torques(
            table,
            stick_anchor,
            slip_anchor,
            t,
            q,
            dq,
            theta,
            dtheta,
            load,
            transmitted,
            reaction,
            friction,
            on_arm,
            False,
        )
        for i in range(n):
            driving = transmitted[i] if table.elastic[i] == 1 else table.gain[i] * command[i] - friction[i]
            ddq[i] = driving + on_arm[i] - bias[i]
        solved(factor, ddq)
        change = 0.0
        largest = 0.0
        for i in range(n):
            if table.elastic[i] == 0:
                passed = table.gain[i] * command[i] - friction[i] - table.inertia[i] * ddq[i]
                change = max(change, abs(passed - load[i]))
                largest = max(largest, abs(passed))
                load[i] = passed
        if change <= LOAD_TOLERANCE * (1.0 + largest):
            break
    drive_torques(
        table, stick_anchor, slip_anchor, t, q, dq, theta, dtheta, load, transmitted, reaction, friction, on_arm, accept
    )


class DriveMemory(NamedTuple):
    """What the drives' equations work on, for all n joints, so that it can be handed on as one.

    Attributes:
        q, dq, theta, dtheta, load, transmitted, reaction, friction, on_arm: As `drive_torques` has them, shape (n,).
        stick_anchor, slip_anchor: Memory of friction, shapes (n,) and (s,).
        table: The drives.
    """

    q: Any
    dq: Any
    theta: Any
    dtheta: Any
    load: Any
    transmitted: Any
    reaction: Any
    friction: Any
    on_arm: Any
    stick_anchor: Any
    slip_anchor: Any
    table: DriveTable


def memory_torques(memory: DriveMemory, t: float, accept: bool) -> None:
    """`drive_torques` at the state that stands in memory."""
    drive_torques(
        memory.table,
        memory.stick_anchor,
        memory.slip_anchor,
        t,
        memory.q,
        memory.dq,
        memory.theta,
        memory.dtheta,
        memory.load,
        memory.transmitted,
        memory.reaction,
        memory.friction,
        memory.on_arm,
        accept,
    )


def coordinate_torques(memory: DriveMemory, t: float, x: Any, v: Any, command: Any, out: Any, accept: bool) -> None:
    """Torques on the coordinates of an engine: q_1 ... q_n, then the motor sides of the elastic joints.

    Where there are the n arm sides only, the motor sides of elastic joints are where memory says (imposed motion).

    Args:
        memory: The drives; its state and torques are written.
        t: Time [s].
        x: Coordinates, shape (n + e,) or (n,).
        v: Their speeds.
        command: Motor torque before the drives' gain, shape (n,).
        out: Out: torque on every coordinate, without inertia and gravity, shape as x.
        accept: As `drive_torques`.
    """
    n = len(command)
    free = len(x) > n
    motor = n
    for i in range(n):
        memory.q[i] = x[i]
        memory.dq[i] = v[i]
        if memory.table.elastic[i] == 0:
            memory.theta[i] = x[i]
            memory.dtheta[i] = v[i]
        elif free:
            memory.theta[i] = x[motor]
            memory.dtheta[i] = v[motor]
            motor += 1
    memory_torques(memory, t, accept)
    motor = n
    for i in range(n):
        driving = memory.table.gain[i] * command[i] - memory.friction[i]
        if memory.table.elastic[i] == 0:
            out[i] = driving + memory.on_arm[i]
        else:
            out[i] = memory.transmitted[i] + memory.on_arm[i]
            if free:
                out[motor] = driving - memory.reaction[i]
                motor += 1


def flat_sizes(n: int, m: int, s: int) -> tuple[int, int]:
    """Lengths of the two flat arrays that hold the memory of n joints, m terms and s slip elements."""
    return 21 * n + 8 * m + 3 * s, 3 + n + 2 * (n + 1) + 2 * m


def flat_memory(numbers: Any, counts: Any) -> DriveMemory:
    """Memory as views into two flat arrays: a compiled call that takes two arrays costs a fifth of one that takes 30.

    Args:
        numbers: float64.
        counts: int64, beginning with n, m, s.
    """
    n = counts[0]
    m = counts[1]
    s = counts[2]
    a = 21 * n
    b = a + 8 * m
    c = 3 + n
    d = c + 2 * (n + 1)
    return DriveMemory(
        numbers[:n],
        numbers[n : 2 * n],
        numbers[2 * n : 3 * n],
        numbers[3 * n : 4 * n],
        numbers[4 * n : 5 * n],
        numbers[5 * n : 6 * n],
        numbers[6 * n : 7 * n],
        numbers[7 * n : 8 * n],
        numbers[8 * n : 9 * n],
        numbers[9 * n : 10 * n],
        numbers[b : b + s],
        DriveTable(
            numbers[10 * n : 11 * n],
            counts[3:c],
            numbers[11 * n : 12 * n],
            numbers[12 * n : 13 * n],
            numbers[13 * n : 14 * n],
            numbers[14 * n : 15 * n],
            numbers[15 * n : 16 * n],
            numbers[16 * n : 17 * n],
            numbers[17 * n : 18 * n],
            numbers[18 * n : 19 * n],
            numbers[19 * n : 20 * n],
            numbers[20 * n : 21 * n],
            counts[c : c + n + 1],
            counts[d : d + m],
            counts[d + m : d + 2 * m],
            numbers[a:b].reshape((m, 8)),
            counts[c + n + 1 : d],
            numbers[b + s : b + 2 * s],
            numbers[b + 2 * s : b + 3 * s],
        ),
    )


def flat_torques(numbers: Any, counts: Any, t: float, accept: bool) -> None:
    """`memory_torques` on flat memory."""
    memory_torques(flat_memory(numbers, counts), t, accept)


def flat_coordinate_torques(
    numbers: Any, counts: Any, t: float, x: Any, v: Any, command: Any, out: Any, accept: bool
) -> None:
    """`coordinate_torques` on flat memory."""
    coordinate_torques(flat_memory(numbers, counts), t, x, v, command, out, accept)


def flat_loaded_torques(
    numbers: Any,
    counts: Any,
    t: float,
    accept: bool,
    command: Any,
    mass_matrix: Any,
    bias: Any,
    factor: Any,
    ddq: Any,
) -> None:
    """`loaded_torques` on flat memory."""
    memory = flat_memory(numbers, counts)
    loaded_torques(
        memory.table,
        memory.stick_anchor,
        memory.slip_anchor,
        t,
        memory.q,
        memory.dq,
        memory.theta,
        memory.dtheta,
        memory.load,
        memory.transmitted,
        memory.reaction,
        memory.friction,
        memory.on_arm,
        accept,
        command,
        mass_matrix,
        bias,
        factor,
        ddq,
    )
