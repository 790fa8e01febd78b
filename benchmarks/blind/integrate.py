"""One run of a robot: Dormand-Prince of order 5 between the ticks of a controller, all of it compiled.

State: coordinates s and speeds of the N nodes (of a rigid joint its motor side theta; q = theta + e(theta)),
motor sides of elastic joints, bristles, hysteresis, lagging torques.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from bodies import dynamics, mass_and_bias
from laws import (
    CABLE,
    CABLE_RATIO,
    COUPLING,
    DAMPING,
    ELASTIC,
    GAP,
    HYSTERESIS,
    HYSTERESIS_FORM,
    HYSTERESIS_STIFFNESS,
    INERTIA,
    LAG,
    LOAD,
    PARTNER,
    SLIPS,
    SOFT,
    STIFFNESS,
    arm_spring,
    bristle,
    bristle_after,
    gear_error,
    level,
    limited,
    motor_torque,
    passed_torque,
    smooth_resistance,
    stretch_of,
)
from numba import njit

# Dormand and Prince (1980)
A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    ]
)
B = np.array([35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84])
NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0])


class Plant(NamedTuple):
    """The robot as arrays: nodes of the joints (n,), drives (n, columns), hidden nodes' springs (N,): stiffness,
    damping and what they stiffen; imposed: the motor sides follow the command."""

    driven: np.ndarray
    drives: np.ndarray
    hidden_stiffness: np.ndarray
    hidden_damping: np.ndarray
    hidden_stiffening: np.ndarray
    imposed: bool


class Command(NamedTuple):
    """Piecewise quintics: knots every `spacing` seconds, coefficients (m, n, 6) of powers of the time since."""

    spacing: float
    coefficients: np.ndarray


class Control(NamedTuple):
    """kp, kd (n,), as they act; feedforward (ticks, n); limit (n,); delay [s]; offset (n,): reported less true
    position; noise (ticks, 2, n) that the controller sees on position and speed; rate [Hz]; command_hold: for how many
    ticks the command is held."""

    kp: np.ndarray
    kd: np.ndarray
    feedforward: np.ndarray
    limit: np.ndarray
    delay: float
    offset: np.ndarray
    noise: np.ndarray
    rate: float
    command_hold: int


@njit(cache=True)
def commanded(command, t, q, dq, ddq):
    """Position, speed and acceleration of the command at t, into arrays (n,)."""
    last = command.coefficients.shape[0] - 1
    k = min(max(math.floor(t / command.spacing + 1.0e-9), 0), last)
    x = t - k * command.spacing
    for i in range(len(q)):
        c = command.coefficients[k, i]
        q[i] = ((((c[5] * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
        dq[i] = (((5 * c[5] * x + 4 * c[4]) * x + 3 * c[3]) * x + 2 * c[2]) * x + c[1]
        ddq[i] = ((20 * c[5] * x + 12 * c[4]) * x + 6 * c[3]) * x + 2 * c[2]


@njit(cache=True)
def solve_in_place(M, x):
    """Cholesky solution of M y = x into x; M is overwritten."""
    n = len(x)
    for j in range(n):
        for k in range(j):
            f = M[j, k]
            if f != 0.0:
                for i in range(j, n):
                    M[i, j] -= M[i, k] * f
        root = math.sqrt(M[j, j])
        for i in range(j, n):
            M[i, j] /= root
    back_substitute(M, x)


@njit(cache=True)
def back_substitute(L, x):
    n = len(x)
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]


@njit(cache=True)
def workspace(N, n):
    """Arrays that `flow` writes into."""
    return (
        np.zeros((N, N)), np.zeros(N), np.zeros((N, 3, 3)), np.zeros((N, 3)), np.zeros((N, 6)), np.zeros((N, 6)),
        np.zeros((N, 6)), np.zeros((N, 6)), np.zeros((N, 4)), np.zeros((N, 3, 3)), np.zeros(N), np.zeros(N),
        np.zeros(N), np.zeros((5, max(N, n))), np.zeros(N), np.zeros(N), np.zeros((3, n)), np.zeros(n),
    )  # fmt: skip


@njit(cache=True)
def flow(chain, plant, command, t, y, tau, dy, out, work):
    """dy of the state; out (4, n): torque T passed, friction, drive's torque where imposed, arm's position."""
    M, h, R, p, S, V, acc, F, C, J, q, v, f, extra, slope, curve, cmd, passed_before = work
    N = len(q)
    n = len(plant.driven)
    motor = 2 * N
    grease = motor + 2 * n
    memory = grease + n
    lagging = memory + n * SLIPS
    if plant.imposed:
        commanded(command, t, cmd[0], cmd[1], cmd[2])
    for j in range(N):
        q[j], v[j], slope[j], curve[j] = y[j], y[N + j], 1.0, 0.0
        f[j] = -plant.hidden_stiffness[j] * q[j] * (1.0 + plant.hidden_stiffening[j] * q[j] * q[j])
        f[j] -= plant.hidden_damping[j] * v[j]
    # arm sides of rigid joints
    for i in range(n):
        d = plant.drives[i]
        j = plant.driven[i]
        f[j] = 0.0
        if d[ELASTIC] == 0.0:
            if plant.imposed:
                q[j], v[j] = cmd[0, i], cmd[1, i]
            e, e1, e2 = gear_error(d, q[j])
            q[j] += e
            slope[j] = 1.0 + e1
            curve[j] = e2 * v[j] * v[j]
            v[j] *= slope[j]
    dynamics(chain, q, v, M, h, R, p, S, V, acc, F, C, J)
    # M (slope dds + curve) + h = f
    for a in range(N):
        if curve[a] != 0.0:
            for b in range(N):
                h[b] += M[b, a] * curve[a]
    for i in range(n):
        j = plant.driven[i]
        f[j] += arm_spring(plant.drives[i], q[j])
        partner = int(plant.drives[i, PARTNER])
        if plant.drives[i, CABLE] != 0.0:
            # a cable over two joints: a potential of both, so each feels it
            k = plant.driven[partner]
            r = plant.drives[i, CABLE_RATIO]
            pull = plant.drives[i, CABLE] * math.sin(q[j] + r * q[k])
            f[j] -= pull
            f[k] -= r * pull
    iterate = False
    for i in range(n):
        d = plant.drives[i]
        j = plant.driven[i]
        elastic = d[ELASTIC] != 0.0
        if elastic:
            if plant.imposed:
                theta, dtheta = cmd[0, i], cmd[1, i]
            else:
                theta, dtheta = y[motor + i], y[motor + n + i]
            e, e1, _ = gear_error(d, theta)
            passed = passed_torque(d, theta + e - q[j], dtheta * (1.0 + e1) - v[j])
            out[0, i] = passed
            out[3, i] = (1.0 + e1) * passed
            passed_before[i] = passed
        else:
            if plant.imposed:
                theta, dtheta = cmd[0, i], cmd[1, i]
            else:
                theta, dtheta = y[j], y[N + j]
            if d[LOAD] != 0.0:
                iterate = True
        # friction but for the bristle, whose level may hang on the load
        r = smooth_resistance(d, dtheta, theta, t)
        if d[HYSTERESIS] != 0.0:
            K = d[HYSTERESIS_STIFFNESS]
            if d[HYSTERESIS_FORM] == 0.0:
                for s in range(SLIPS):
                    top = d[HYSTERESIS] * (s + 1) / (SLIPS * (SLIPS + 1) / 2)
                    r += min(top, max(-top, K / SLIPS * y[memory + i * SLIPS + s]))
                    dy[memory + i * SLIPS + s] = dtheta
            else:
                force = y[memory + i * SLIPS]
                r += force
                dy[memory + i * SLIPS] = K * (dtheta - abs(dtheta) * force / d[HYSTERESIS])
        if d[COUPLING] != 0.0:
            other = int(d[PARTNER])
            k = plant.driven[other]
            r += d[COUPLING] * math.tanh((dtheta + v[k]) / 0.01)
        for i2 in range(n):
            if plant.drives[i2, COUPLING] != 0.0 and int(plant.drives[i2, PARTNER]) == i:
                k = plant.driven[i2]
                r += plant.drives[i2, COUPLING] * math.tanh((dtheta + v[k]) / 0.01)
        extra[0, i], extra[1, i], extra[2, i] = r, theta, dtheta
        # the drive's torque
        if d[LAG] > 0.0:
            extra[3, i] = motor_torque(d, y[lagging + i])
            dy[lagging + i] = (tau[i] - y[lagging + i]) / d[LAG]
        else:
            extra[3, i] = motor_torque(d, tau[i])
    if plant.imposed:
        for i in range(n):
            j = plant.driven[i]
            if plant.drives[i, ELASTIC] == 0.0:
                for a in range(N):
                    h[a] += M[a, j] * slope[j] * cmd[2, i]
    mass = M.copy()
    for a in range(N):
        for b in range(N):
            M[a, b] *= slope[a] * slope[b]
    for i in range(n):
        j = plant.driven[i]
        if plant.drives[i, ELASTIC] == 0.0:
            if plant.imposed:
                for a in range(N):
                    M[a, j] = 0.0
                    M[j, a] = 0.0
                M[j, j] = 1.0
            else:
                M[j, j] += plant.drives[i, INERTIA]
    first = True
    # load and friction may answer each other with more: by less at a time they come together
    share, last = 1.0, math.inf
    for _ in range(200):
        change = 0.0
        for i in range(n):
            d = plant.drives[i]
            force, dz = bristle(d, y[grease + i], extra[2, i], level(d, extra[2, i], extra[1, i], t, passed_before[i]))
            dy[grease + i] = dz
            out[1, i] = extra[0, i] + force
        x = extra[4]
        for a in range(N):
            x[a] = slope[a] * (f[a] - h[a])
        for i in range(n):
            j = plant.driven[i]
            if plant.drives[i, ELASTIC] == 0.0:
                if plant.imposed:
                    x[j] = 0.0
                else:
                    x[j] += extra[3, i] - out[1, i]
            else:
                x[j] += out[0, i]
        if first:
            solve_in_place(M, x)
            first = False
        else:
            back_substitute(M, x)
        # what rigid joints pass
        for i in range(n):
            j = plant.driven[i]
            if plant.drives[i, ELASTIC] == 0.0:
                total = h[j] - f[j]
                for a in range(N):
                    total += mass[j, a] * slope[a] * x[a]
                change = max(change, abs(total - passed_before[i]) / (1.0 + abs(total)))
                out[0, i] = total
                passed_before[i] += share * (total - passed_before[i])
                out[3, i] = slope[j] * total
        if not iterate or change < 1.0e-12:
            break
        if change > 0.5 * last:
            share *= 0.7
        last = change
    for a in range(N):
        dy[a] = y[N + a]
        dy[N + a] = x[a]
    for i in range(n):
        d = plant.drives[i]
        j = plant.driven[i]
        if plant.imposed:
            out[2, i] = d[INERTIA] * cmd[2, i] + out[1, i] + out[3, i]
            if d[ELASTIC] == 0.0:
                dy[j] = 0.0
                dy[N + j] = 0.0
        elif d[ELASTIC] != 0.0:
            dy[motor + i] = y[motor + n + i]
            dy[motor + n + i] = (extra[3, i] - out[1, i] - out[3, i]) / d[INERTIA]


@njit(cache=True)
def settle_memory(plant, t, y, N, out, extra):
    """After a step: what slid stays slid."""
    n = len(plant.driven)
    grease = 2 * N + 2 * n
    memory = grease + n
    for i in range(n):
        d = plant.drives[i]
        height = level(d, extra[2, i], extra[1, i], t, out[0, i])
        y[grease + i] = bristle_after(d, y[grease + i], extra[2, i], height)
        if d[HYSTERESIS] != 0.0 and d[HYSTERESIS_FORM] == 0.0:
            for s in range(SLIPS):
                top = d[HYSTERESIS] * (s + 1) / (SLIPS * (SLIPS + 1) / 2) / (d[HYSTERESIS_STIFFNESS] / SLIPS)
                k = memory + i * SLIPS + s
                y[k] = min(top, max(-top, y[k]))


@njit(cache=True)
def advance(chain, plant, command, t, step, y, tau, slopes, stage, out, work):
    """y, a step of Dormand-Prince later; slopes[0] is the slope at its begin, already there."""
    size = len(y)
    for b in range(1, 6):
        for a in range(size):
            value = y[a]
            for c in range(b):
                value += step * A[b, c] * slopes[c, a]
            stage[a] = value
        flow(chain, plant, command, t + NODES[b] * step, stage, tau, slopes[b], out, work)
    for a in range(size):
        for c in range(6):
            y[a] += step * B[c] * slopes[c, a]


@njit(cache=True)
def touching(plant, command, t, y, N, cmd):
    """Which hard contacts of backlash press, one number of base 3 for all joints."""
    n = len(plant.driven)
    code = 0
    imposed = False
    for i in range(n):
        d = plant.drives[i]
        if d[GAP] == 0.0 or d[SOFT] != 0.0:
            continue
        if plant.imposed and not imposed:
            commanded(command, t, cmd[0], cmd[1], cmd[2])
            imposed = True
        theta = cmd[0, i] if plant.imposed else y[2 * N + i]
        dtheta = cmd[1, i] if plant.imposed else y[2 * N + n + i]
        e, e1, _ = gear_error(d, theta)
        j = plant.driven[i]
        stretch, dstretch = theta + e - y[j], dtheta * (1.0 + e1) - y[N + j]
        half = 0.5 * d[GAP]
        press = d[DAMPING] * dstretch / d[STIFFNESS]
        code *= 3
        if stretch > half and stretch - half + press > 0.0:
            code += 1
        elif stretch < -half and stretch + half + press < 0.0:
            code += 2
    return code


@njit(cache=True)
def wound_up(stiffness, stiffening, torque):
    """Where k x (1 + c x^2) is a torque, by Newton's method: from the straight spring's place it comes down to it."""
    x = torque / stiffness
    for _ in range(60):
        x -= (stiffness * x * (1.0 + stiffening * x * x) - torque) / (stiffness * (1.0 + 3.0 * stiffening * x * x))
    return x


@njit(cache=True)
def at_rest(chain, plant, command, control):
    """Coordinates (N,) and motor sides (n,) in equilibrium under the controller, without friction, by relaxation."""
    N = len(chain.kind)
    n = len(plant.driven)
    q0, dq0, ddq0 = np.zeros(n), np.zeros(n), np.zeros(n)
    commanded(command, 0.0, q0, dq0, ddq0)
    q = np.zeros(N)
    theta = q0 - control.offset
    for i in range(n):
        q[plant.driven[i]] = theta[i]
    for _ in range(400):
        _, h = mass_and_bias(chain, q, np.zeros(N))
        change = 0.0
        for j in range(N):
            if plant.hidden_stiffness[j] > 0.0:
                new = wound_up(plant.hidden_stiffness[j], plant.hidden_stiffening[j], -h[j])
                change = max(change, abs(new - q[j]))
                q[j] += 0.7 * (new - q[j])
        for i in range(n):
            d = plant.drives[i]
            j = plant.driven[i]
            e, e1, _ = gear_error(d, theta[i])
            passed = h[j] - arm_spring(d, q[j])
            if d[CABLE] != 0.0:
                passed += d[CABLE] * math.sin(q[j] + d[CABLE_RATIO] * q[plant.driven[int(d[PARTNER])]])
            for i2 in range(n):
                d2 = plant.drives[i2]
                if d2[CABLE] != 0.0 and int(d2[PARTNER]) == i:
                    passed += d2[CABLE_RATIO] * d2[CABLE] * math.sin(q[plant.driven[i2]] + d2[CABLE_RATIO] * q[j])
            if not plant.imposed:
                needed = (1.0 + e1) * passed + smooth_resistance(d, 0.0, theta[i], 0.0)
                # the command that makes the motor give that much, by a few steps of its own
                tau = needed / d[1]
                for _ in range(20):
                    tau -= (motor_torque(d, tau) - needed) / d[1]
                new = q0[i] - control.offset[i] + (control.feedforward[0, i] - tau) / control.kp[i]
                change = max(change, abs(new - theta[i]))
                theta[i] += 0.7 * (new - theta[i])
                e, e1, _ = gear_error(d, theta[i])
            new = theta[i] + e
            if d[ELASTIC] != 0.0:
                new -= stretch_of(d, passed)
            change = max(change, abs(new - q[j]))
            q[j] += 0.7 * (new - q[j])
        if change < 1.0e-13:
            break
    s = q.copy()
    for i in range(n):
        if plant.drives[i, ELASTIC] == 0.0:
            s[plant.driven[i]] = theta[i]
    return s, theta


@njit(cache=True)
def run(chain, plant, command, control, ticks, substeps, euler, given):
    """Simulate; records at every tick, arrays (ticks, n) unless said.

    Args:
        chain, plant, command, control: The robot and what it is asked.
        ticks: How many ticks of the controller.
        substeps: Integration steps between two ticks.
        euler: Semi-implicit Euler in place of Dormand-Prince.
        given: Commanded torques (ticks, n) in place of a controller; (0, n) otherwise.

    Returns:
        theta, dtheta, nodes' positions (ticks, N), commanded torque, torque that acts (reported), torque passed T.
    """
    N = len(chain.kind)
    n = len(plant.driven)
    size = 2 * N + 2 * n + n + n * SLIPS + n
    work = workspace(N, n)
    y, stage = np.zeros(size), np.zeros(size)
    slopes = np.zeros((6, size))
    out = np.zeros((4, n))
    before = np.zeros(size)
    clacks = False
    for i in range(n):
        clacks = clacks or (plant.drives[i, GAP] != 0.0 and plant.drives[i, SOFT] == 0.0)
    s, theta0 = at_rest(chain, plant, command, control)
    y[:N] = s
    y[2 * N : 2 * N + n] = theta0
    grease = 2 * N + 2 * n
    lagging = grease + n + n * SLIPS
    period = 1.0 / control.rate
    behind = math.floor(control.delay * control.rate + 1.0e-9)
    part = control.delay * control.rate - behind
    if part < 1.0e-6:
        part = 0.0
    buffer = np.zeros((ticks, n))
    record_theta, record_dtheta = np.zeros((ticks, n)), np.zeros((ticks, n))
    record_nodes = np.zeros((ticks, N))
    record_tau, record_passed = np.zeros((ticks, n)), np.zeros((ticks, n))
    tau = np.zeros(n)
    q_cmd, dq_cmd, ddq_cmd = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(ticks):
        t = k * period
        held = (k // control.command_hold) * control.command_hold
        commanded(command, held * period, q_cmd, dq_cmd, ddq_cmd)
        for i in range(n):
            j = plant.driven[i]
            if plant.imposed:
                theta, dtheta = q_cmd[i] - control.offset[i], dq_cmd[i]
            elif plant.drives[i, ELASTIC] != 0.0:
                theta, dtheta = y[2 * N + i], y[2 * N + n + i]
            else:
                theta, dtheta = y[j], y[N + j]
            record_theta[k, i], record_dtheta[k, i] = theta, dtheta
            if given.shape[0] > 0:
                asked = given[k, i]
            else:
                seen = theta + control.offset[i] + control.noise[k, 0, i]
                asked = control.kp[i] * (q_cmd[i] - seen) + control.kd[i] * (
                    dq_cmd[i] - dtheta - control.noise[k, 1, i]
                )
                asked += control.feedforward[k, i]
            if control.limit[i] > 0.0:
                asked = min(control.limit[i], max(-control.limit[i], asked))
            buffer[k, i] = asked
            # what acts at this tick's beginning, and before the fraction of a period is over
            now = max(k - behind - (1 if part > 0.0 else 0), 0)
            tau[i] = limited(plant.drives[i], buffer[now, i])
            if k == 0 and plant.drives[i, LAG] > 0.0:
                y[lagging + i] = tau[i]
            record_tau[k, i] = tau[i]
        flow(chain, plant, command, t, y, tau, slopes[0], out, work)
        for i in range(n):
            record_passed[k, i] = out[0, i]
            if plant.imposed:
                record_tau[k, i] = out[2, i]
        for a in range(N):
            record_nodes[k, a] = work[10][a]
        for piece in range(2):
            length = (part if piece == 0 else 1.0 - part) * period
            if length <= 0.0:
                continue
            if piece == 1 and part > 0.0:
                t = (k + part) * period
                for i in range(n):
                    tau[i] = limited(plant.drives[i], buffer[max(k - behind, 0), i])
            steps = max(1, math.ceil(length / period * substeps - 1.0e-9))
            step = length / steps
            for m in range(steps):
                start = t + m * step
                flow(chain, plant, command, start, y, tau, slopes[0], out, work)
                settle_memory(plant, start, y, N, out, work[13])
                if euler:
                    for a in range(N):
                        y[N + a] += step * slopes[0, N + a]
                        y[a] += step * y[N + a]
                    for a in range(2 * N, size):
                        if a < 2 * N + n:
                            continue
                        y[a] += step * slopes[0, a]
                    for i in range(n):
                        y[2 * N + i] += step * y[2 * N + n + i]
                    continue
                if not clacks:
                    advance(chain, plant, command, start, step, y, tau, slopes, stage, out, work)
                    continue
                # to where a contact closes or opens, by bisection, then on from there
                done = 0.0
                for _ in range(20):
                    before[:] = y
                    code = touching(plant, command, start + done, y, N, work[16])
                    advance(chain, plant, command, start + done, step - done, y, tau, slopes, stage, out, work)
                    if touching(plant, command, start + step, y, N, work[16]) == code:
                        break
                    low, high = 0.0, step - done
                    while high - low > 1.0e-9:
                        middle = 0.5 * (low + high)
                        y[:] = before
                        advance(chain, plant, command, start + done, middle, y, tau, slopes, stage, out, work)
                        if touching(plant, command, start + done + middle, y, N, work[16]) == code:
                            low = middle
                        else:
                            high = middle
                    y[:] = before
                    advance(chain, plant, command, start + done, high, y, tau, slopes, stage, out, work)
                    done += high
                    if step - done < 1.0e-9:
                        break
                    flow(chain, plant, command, start + done, y, tau, slopes[0], out, work)
                    settle_memory(plant, start + done, y, N, out, work[13])
        if not math.isfinite(y[0] + y[N]):
            break
    return record_theta, record_dtheta, record_nodes, buffer, record_tau, record_passed
