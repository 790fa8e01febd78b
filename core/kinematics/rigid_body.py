"""Rigid-body dynamics of a serial chain: plain functions of arrays that Numba can compile and that run as they stand.

Everything about joint i is said in its own moving frame (z is the axis), which keeps the small inertias of the last
arms free of the lever arms of the whole robot. Equations of motion: tau = M(q) ddq + h(q, dq), h(q, 0) = gravity.
The text needs NumPy and `math` only, so that it can stand verbatim in a script of its own.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ChainTable(NamedTuple):
    """A serial chain of n bodies as arrays, SI.

    Attributes:
        kind: 0 revolute, 1 prismatic, shape (n,), integers.
        rotation: Axes of joint i's frame, at zero, in joint i-1's frame (joint 0: in the base), shape (n, 3, 3).
        position: Its origin there [m], shape (n, 3).
        mass: [kg], shape (n,).
        com: Center of mass in the moving joint frame [m], shape (n, 3).
        tensor: Inertia tensor about the center of mass, axes of the moving joint frame [kg m^2], shape (n, 3, 3).
        gravity: In the base [m/s^2], shape (3,).
    """

    kind: NDArray[np.int64]
    rotation: Array
    position: Array
    mass: Array
    com: Array
    tensor: Array
    gravity: Array


def place_joints(table: ChainTable, q: Array, rotation: Array, position: Array) -> None:
    """Moving joint frames at q in the frames before them, into rotation (n, 3, 3) and position (n, 3) [m]."""
    for i in range(q.shape[0]):
        if table.kind[i] == 0:
            c = math.cos(q[i])
            s = math.sin(q[i])
            for k in range(3):
                x = table.rotation[i, k, 0]
                y = table.rotation[i, k, 1]
                rotation[i, k, 0] = c * x + s * y
                rotation[i, k, 1] = c * y - s * x
                rotation[i, k, 2] = table.rotation[i, k, 2]
                position[i, k] = table.position[i, k]
        else:
            for k in range(3):
                rotation[i, k, 0] = table.rotation[i, k, 0]
                rotation[i, k, 1] = table.rotation[i, k, 1]
                rotation[i, k, 2] = table.rotation[i, k, 2]
                position[i, k] = table.position[i, k] + table.rotation[i, k, 2] * q[i]


def newton_euler(table: ChainTable, rotation: Array, position: Array, dq: Array, ddq: Array, out: Array) -> None:
    """Joint torques of given motion at placed joints, into out (n,): recursive Newton-Euler (Luh et al., 1980).

    Gravity enters as an acceleration of the base upwards.
    """
    n = dq.shape[0]
    wrench = np.empty((n, 6))  # force and moment about the joint's origin that body i needs, in joint i's frame
    wx = wy = wz = 0.0  # angular velocity
    ex = ey = ez = 0.0  # angular acceleration
    ax = -table.gravity[0]  # acceleration of the frame's origin
    ay = -table.gravity[1]
    az = -table.gravity[2]
    for i in range(n):
        r = rotation[i]
        px = position[i, 0]
        py = position[i, 1]
        pz = position[i, 2]
        # origin of joint i, still in the frame before: a + e x p + w x (w x p)
        ux = wy * pz - wz * py
        uy = wz * px - wx * pz
        uz = wx * py - wy * px
        bx = ax + ey * pz - ez * py + wy * uz - wz * uy
        by = ay + ez * px - ex * pz + wz * ux - wx * uz
        bz = az + ex * py - ey * px + wx * uy - wy * ux
        ax = r[0, 0] * bx + r[1, 0] * by + r[2, 0] * bz
        ay = r[0, 1] * bx + r[1, 1] * by + r[2, 1] * bz
        az = r[0, 2] * bx + r[1, 2] * by + r[2, 2] * bz
        vx = r[0, 0] * wx + r[1, 0] * wy + r[2, 0] * wz
        vy = r[0, 1] * wx + r[1, 1] * wy + r[2, 1] * wz
        vz = r[0, 2] * wx + r[1, 2] * wy + r[2, 2] * wz
        fx = r[0, 0] * ex + r[1, 0] * ey + r[2, 0] * ez
        fy = r[0, 1] * ex + r[1, 1] * ey + r[2, 1] * ez
        fz = r[0, 2] * ex + r[1, 2] * ey + r[2, 2] * ez
        wx = vx
        wy = vy
        if table.kind[i] == 0:
            wz = vz + dq[i]
            ex = fx + vy * dq[i]
            ey = fy - vx * dq[i]
            ez = fz + ddq[i]
        else:
            wz = vz
            ex = fx
            ey = fy
            ez = fz
            ax += 2.0 * vy * dq[i]  # Coriolis of the slide
            ay -= 2.0 * vx * dq[i]
            az += ddq[i]
        cx = table.com[i, 0]
        cy = table.com[i, 1]
        cz = table.com[i, 2]
        ux = wy * cz - wz * cy
        uy = wz * cx - wx * cz
        uz = wx * cy - wy * cx
        m = table.mass[i]
        fx = m * (ax + ey * cz - ez * cy + wy * uz - wz * uy)
        fy = m * (ay + ez * cx - ex * cz + wz * ux - wx * uz)
        fz = m * (az + ex * cy - ey * cx + wx * uy - wy * ux)
        t = table.tensor[i]
        lx = t[0, 0] * wx + t[0, 1] * wy + t[0, 2] * wz  # angular momentum about the center of mass
        ly = t[1, 0] * wx + t[1, 1] * wy + t[1, 2] * wz
        lz = t[2, 0] * wx + t[2, 1] * wy + t[2, 2] * wz
        wrench[i, 0] = fx
        wrench[i, 1] = fy
        wrench[i, 2] = fz
        wrench[i, 3] = t[0, 0] * ex + t[0, 1] * ey + t[0, 2] * ez + wy * lz - wz * ly + cy * fz - cz * fy
        wrench[i, 4] = t[1, 0] * ex + t[1, 1] * ey + t[1, 2] * ez + wz * lx - wx * lz + cz * fx - cx * fz
        wrench[i, 5] = t[2, 0] * ex + t[2, 1] * ey + t[2, 2] * ez + wx * ly - wy * lx + cx * fy - cy * fx
    for i in range(n - 1, -1, -1):
        out[i] = wrench[i, 5] if table.kind[i] == 0 else wrench[i, 2]
        if i > 0:
            carry_wrench(rotation[i], position[i], wrench[i])
            for k in range(6):
                wrench[i - 1, k] += wrench[i, k]


def carry_wrench(r: Array, p: Array, wrench: Array) -> None:
    """Force and moment about a frame's origin, shape (6,), re-expressed in place in the frame it stands in."""
    fx = r[0, 0] * wrench[0] + r[0, 1] * wrench[1] + r[0, 2] * wrench[2]
    fy = r[1, 0] * wrench[0] + r[1, 1] * wrench[1] + r[1, 2] * wrench[2]
    fz = r[2, 0] * wrench[0] + r[2, 1] * wrench[1] + r[2, 2] * wrench[2]
    mx = r[0, 0] * wrench[3] + r[0, 1] * wrench[4] + r[0, 2] * wrench[5]
    my = r[1, 0] * wrench[3] + r[1, 1] * wrench[4] + r[1, 2] * wrench[5]
    mz = r[2, 0] * wrench[3] + r[2, 1] * wrench[4] + r[2, 2] * wrench[5]
    wrench[0] = fx
    wrench[1] = fy
    wrench[2] = fz
    wrench[3] = mx + p[1] * fz - p[2] * fy
    wrench[4] = my + p[2] * fx - p[0] * fz
    wrench[5] = mz + p[0] * fy - p[1] * fx


def composite_inertia(table: ChainTable, rotation: Array, position: Array, M: Array) -> None:
    """Mass matrix at placed joints, into M (n, n): composite rigid bodies (Featherstone, 2008, section 6.2).

    For each joint, the body of all arms from it to the tip gets a unit acceleration of that joint alone; the wrench
    this takes, carried down the chain, is read off along every joint before it.
    """
    n = M.shape[0]
    wrench = np.empty(6)
    h = np.zeros(3)  # first moments of the composite body about joint i's origin
    k = np.zeros((3, 3))  # its inertia tensor about that origin
    j = np.empty((3, 3))
    m = 0.0
    for i in range(n - 1, -1, -1):
        if i + 1 < n:
            # the composite of joint i + 1, re-expressed in joint i's frame
            r = rotation[i + 1]
            p = position[i + 1]
            x = r[0, 0] * h[0] + r[0, 1] * h[1] + r[0, 2] * h[2]
            y = r[1, 0] * h[0] + r[1, 1] * h[1] + r[1, 2] * h[2]
            z = r[2, 0] * h[0] + r[2, 1] * h[1] + r[2, 2] * h[2]
            for a in range(3):
                for b in range(3):
                    j[a, b] = r[a, 0] * k[0, b] + r[a, 1] * k[1, b] + r[a, 2] * k[2, b]
            h[0] = x
            h[1] = y
            h[2] = z
            dot = 2.0 * (p[0] * x + p[1] * y + p[2] * z) + m * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
            for a in range(3):
                for b in range(3):
                    k[a, b] = (
                        j[a, 0] * r[b, 0]
                        + j[a, 1] * r[b, 1]
                        + j[a, 2] * r[b, 2]
                        - p[a] * h[b]
                        - h[a] * p[b]
                        - m * p[a] * p[b]
                    )
                k[a, a] += dot
            for a in range(3):
                h[a] += m * p[a]
        mass = table.mass[i]
        c = table.com[i]
        dot = mass * (c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
        m += mass
        for a in range(3):
            h[a] += mass * c[a]
            for b in range(3):
                k[a, b] += table.tensor[i, a, b] - mass * c[a] * c[b]
            k[a, a] += dot
        if table.kind[i] == 0:
            wrench[0] = -h[1]  # z x h
            wrench[1] = h[0]
            wrench[2] = 0.0
            wrench[3] = k[0, 2]
            wrench[4] = k[1, 2]
            wrench[5] = k[2, 2]
        else:
            wrench[0] = 0.0
            wrench[1] = 0.0
            wrench[2] = m
            wrench[3] = h[1]  # h x z
            wrench[4] = -h[0]
            wrench[5] = 0.0
        for before in range(i, -1, -1):
            value = wrench[5] if table.kind[before] == 0 else wrench[2]
            M[before, i] = value
            M[i, before] = value
            if before > 0:
                carry_wrench(rotation[before], position[before], wrench)


def inverse_dynamics(table: ChainTable, q: Array, dq: Array, ddq: Array, out: Array) -> None:
    """Joint torques tau = M(q) ddq + h(q, dq), into out (n,) [N m or N]; q, dq, ddq (n,) in SI."""
    n = q.shape[0]
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    place_joints(table, q, rotation, position)
    newton_euler(table, rotation, position, dq, ddq, out)


def mass_matrix_and_bias(table: ChainTable, q: Array, dq: Array, M: Array, h: Array) -> None:
    """Mass matrix into M (n, n) and bias into h (n,), gravity included: tau = M ddq + h."""
    n = q.shape[0]
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    place_joints(table, q, rotation, position)
    newton_euler(table, rotation, position, dq, np.zeros_like(q), h)
    composite_inertia(table, rotation, position, M)


def mass_matrix(table: ChainTable, q: Array, M: Array) -> None:
    """Mass matrix into M (n, n), entries in kg m^2, kg m or kg by the joints' kinds."""
    n = q.shape[0]
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    place_joints(table, q, rotation, position)
    composite_inertia(table, rotation, position, M)


def gravity(table: ChainTable, q: Array, out: Array) -> None:
    """Joint torques that hold the chain still at q, into out (n,) [N m or N]."""
    still = np.zeros_like(q)
    inverse_dynamics(table, q, still, still, out)


def mass_matrices(table: ChainTable, q: Array, M: Array) -> None:
    """Mass matrices of many configurations: q (m, n), M (m, n, n)."""
    for i in range(q.shape[0]):
        mass_matrix(table, q[i], M[i])


def inverse_dynamics_along(table: ChainTable, q: Array, dq: Array, ddq: Array, out: Array) -> None:
    """Joint torques of many states: all (m, n)."""
    for i in range(q.shape[0]):
        inverse_dynamics(table, q[i], dq[i], ddq[i], out[i])


def points_along(table: ChainTable, point: Array, q: Array, out: Array) -> None:
    """Where a point of the last moving joint frame is in the base [m]: point (3,), q (m, n), out (m, 3)."""
    n = q.shape[1]
    rotation = np.empty((n, 3, 3))
    position = np.empty((n, 3))
    for k in range(q.shape[0]):
        place_joints(table, q[k], rotation, position)
        x = point[0]
        y = point[1]
        z = point[2]
        for j in range(n):
            i = n - 1 - j
            r = rotation[i]
            u = position[i, 0] + r[0, 0] * x + r[0, 1] * y + r[0, 2] * z
            v = position[i, 1] + r[1, 0] * x + r[1, 1] * y + r[1, 2] * z
            z = position[i, 2] + r[2, 0] * x + r[2, 1] * y + r[2, 2] * z
            x = u
            y = v
        out[k, 0] = x
        out[k, 1] = y
        out[k, 2] = z
