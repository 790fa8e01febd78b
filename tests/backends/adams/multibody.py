"""A tree of rigid bodies from parts, frames and joints alone: numpy, and none of the project's own mechanics.

What a reader finds in an emitted file becomes a `Machine`: mass matrix by sums over Jacobians, forces as the file says
them, motion by scipy. It is the judge of formats whose engines are not here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


def frame(rotation=None, place=(0.0, 0.0, 0.0)):
    """Homogeneous matrix, shape (4, 4)."""
    out = np.eye(4)
    if rotation is not None:
        out[:3, :3] = rotation
    out[:3, 3] = place
    return out


def inverse(pose):
    return frame(pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3])


def about(axis, angle):
    """Rotation about x, y or z (0, 1, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out


@dataclass
class Body:
    """A rigid body: mass [kg], center of mass [m] and tensor about it [kg m^2], both in the body's frame."""

    mass: float
    center: np.ndarray
    tensor: np.ndarray


@dataclass
class Link:
    """A joint: the child's frame moves about ("revolute") or along ("prismatic") z of the parent's."""

    name: str
    kind: str
    parent: str
    in_parent: np.ndarray
    child: str
    in_child: np.ndarray


class State:
    """Where everything is: homogeneous matrices of all bodies with their derivatives, shapes (bodies, 4, 4)."""

    def __init__(self, t, index, pose, rate, bend):
        self.t, self._index = t, index
        self.poses, self.rates, self.bends = pose, rate, bend
        self._turning = {}

    def pose(self, body):
        return self.poses[self._index[body]]

    def point(self, body, place):
        """Position, velocity and acceleration of a point of a body, in the world."""
        at, k = np.append(place, 1.0), self._index[body]
        return tuple((matrices[k] @ at)[:3] for matrices in (self.poses, self.rates, self.bends))

    def turning(self, body):
        """Angular velocity and acceleration of a body, in the world."""
        if body not in self._turning:
            k = self._index[body]
            r, dr, ddr = (matrices[k, :3, :3] for matrices in (self.poses, self.rates, self.bends))
            # the symmetric part of the second is not of the angular acceleration
            self._turning[body] = unskewed(dr @ r.T), unskewed(ddr @ r.T)
        return self._turning[body]


def unskewed(m):
    """The vector whose cross product the antisymmetric part of a matrix is."""
    return 0.5 * np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])


@dataclass
class Effort:
    """A torque about ("revolute") or force along ("prismatic") the z axis of a frame of j, on i, the opposite on j.

    `value(state)` is its size; `accelerated`: it depends on accelerations.
    """

    kind: str
    i: str
    i_place: np.ndarray
    j: str
    j_frame: np.ndarray
    value: Callable
    accelerated: bool = False


class Machine:
    """A tree on the ground; its coordinates are the joints', in the order of the tree.

    Equations by Uicker (1965): with T the body's matrix and J = integral of p p^T dm over it, p = (x, y, z, 1), kinetic
    energy is tr(T' J T'^T) / 2.
    """

    def __init__(self, bodies, links, gravity, ground="ground"):
        self.links, self._index, waiting = [], {ground: 0}, list(links)
        while waiting:
            ready = [link for link in waiting if link.parent in self._index]
            assert ready, f"joints of nothing: {[link.name for link in waiting]}"
            for link in ready:
                assert link.child not in self._index, f"{link.child} hangs on two joints"
                self.links.append(link)
                self._index[link.child] = len(self._index)
                waiting.remove(link)
        assert set(self._index) == set(bodies) | {ground}, "a body hangs on no joint"
        self.names = [link.name for link in self.links]
        self.n = len(self.links)
        self._parents = [self._index[link.parent] for link in self.links]
        self._turns = np.array([link.kind == "revolute" for link in self.links])
        self._seats = np.array([link.in_parent for link in self.links])
        self._backs = np.array([inverse(link.in_child) for link in self.links])
        # which coordinates move which bodies, shape (bodies, n)
        self._moves = np.zeros((self.n + 1, self.n), dtype=bool)
        for k, parent in enumerate(self._parents):
            self._moves[k + 1] = self._moves[parent]
            self._moves[k + 1, k] = True
        self._spread = np.zeros((self.n + 1, 4, 4))
        for name, body in bodies.items():
            moment = 0.5 * np.trace(body.tensor) * np.eye(3) - body.tensor
            first = body.mass * np.asarray(body.center)
            spread = self._spread[self._index[name]]
            spread[:3, :3] = moment + np.outer(first, body.center)
            spread[:3, 3] = spread[3, :3] = first
            spread[3, 3] = body.mass
        self._pull = np.append(np.asarray(gravity, dtype=float), 0.0)

    def state(self, q, dq=None, ddq=None, t=0.0):
        """Where everything is at positions, speeds and accelerations (0 where none are given), shapes (n,)."""
        q = np.asarray(q, dtype=float)
        dq = np.zeros(self.n) if dq is None else dq
        ddq = np.zeros(self.n) if ddq is None else ddq
        step, slope, curve = (np.zeros((self.n, 4, 4)) for _ in range(3))
        c, s, turns = np.cos(q), np.sin(q), self._turns
        step[:] = np.eye(4)
        step[turns, 0, 0] = step[turns, 1, 1] = c[turns]
        step[turns, 1, 0], step[turns, 0, 1] = s[turns], -s[turns]
        slope[turns, 0, 0] = slope[turns, 1, 1] = -s[turns]
        slope[turns, 1, 0], slope[turns, 0, 1] = c[turns], -c[turns]
        curve[turns, :2, :2] = -step[turns, :2, :2]
        step[~turns, 2, 3], slope[~turns, 2, 3] = q[~turns], 1.0
        x, x1, x2 = (self._seats @ matrix @ self._backs for matrix in (step, slope, curve))
        first = x1 * dq[:, None, None]
        second = x2 * (dq * dq)[:, None, None] + x1 * ddq[:, None, None]
        pose, rate, bend = (np.zeros((self.n + 1, 4, 4)) for _ in range(3))
        pose[0] = np.eye(4)
        for k, p in enumerate(self._parents):
            pose[k + 1] = pose[p] @ x[k]
            rate[k + 1] = rate[p] @ x[k] + pose[p] @ first[k]
            bend[k + 1] = bend[p] @ x[k] + 2.0 * rate[p] @ first[k] + pose[p] @ second[k]
        return State(t, self._index, pose, rate, bend)

    def _twists(self, s):
        """What a unit of speed of each joint does to what it moves: dT = twist T, shape (n, 4, 4)."""
        seats = s.poses[self._parents] @ self._seats
        z, at = seats[:, :3, 2], seats[:, :3, 3]
        twists = np.zeros((self.n, 4, 4))
        turning = z * self._turns[:, None]
        twists[:, 2, 1], twists[:, 0, 2], twists[:, 1, 0] = turning.T
        twists[:, 1, 2], twists[:, 2, 0], twists[:, 0, 1] = -turning.T
        twists[:, :3, 3] = np.where(self._turns[:, None], -np.einsum("kij,kj->ki", twists[:, :3, :3], at), z)
        return twists

    def equations(self, s):
        """Mass matrix, and torques that the motion s asks for where its accelerations are 0 (gravity included)."""
        partial = self._twists(s)[None] @ s.poses[:, None] * self._moves[:, :, None, None]
        weighed = partial @ self._spread[:, None]
        size = (self.n + 1) * 16
        a, b = (np.moveaxis(m, 1, 0).reshape(self.n, size) for m in (weighed, partial))
        inertial = (s.bends @ self._spread).reshape(size)
        return a @ b.T, b @ inertial - np.einsum("bkx,x->k", weighed[:, :, :, 3], self._pull)

    def mass_matrix(self, q):
        return self.equations(self.state(q))[0]

    def gravity(self, q):
        return self.equations(self.state(q))[1]

    def efforts(self, s, efforts):
        """Generalised forces, shape (n,)."""
        out = np.zeros(self.n)
        twists = self._twists(s)
        for effort in efforts:
            z = (s.pose(effort.j) @ effort.j_frame)[:3, 2]
            differ = 1.0 * self._moves[self._index[effort.i]] - self._moves[self._index[effort.j]]
            if effort.kind == "revolute":
                along = twists[:, (2, 0, 1), (1, 2, 0)] @ z
            else:
                # the reaction acts at the same point
                along = (twists @ np.append(s.point(effort.i, effort.i_place)[0], 1.0))[:, :3] @ z
            out += differ * along * effort.value(s)
        return out

    def run(self, start, times, efforts=(), imposed=None, error=1.0e-4):
        """Positions at times, shape (m, n).

        Args:
            start: q at times[0]; at rest, but for what is imposed.
            times: [s].
            efforts: What acts.
            error: Relative error of a step.
            imposed: (coordinates, function of t that gives their positions, speeds and accelerations).
        """
        from scipy.integrate import solve_ivp

        driven, law = imposed or ([], None)
        free = np.array([k for k in range(self.n) if k not in driven], dtype=int)

        def whole(t, x):
            q, dq, ddq = (np.zeros(self.n) for _ in range(3))
            q[free], dq[free] = x[: len(free)], x[len(free) :]
            if law is not None:
                q[driven], dq[driven], ddq[driven] = law(t)
            return q, dq, ddq

        def reaction(t, x):
            """How forces answer accelerations, shape (n, n): rotor inertias said as torques."""
            moving = [effort for effort in efforts if effort.accelerated]
            q, dq, _ = whole(t, x)
            if not moving:
                return np.zeros((self.n, self.n))
            at_rest = self.efforts(self.state(q, dq, t=t), moving)
            columns = [self.efforts(self.state(q, dq, e, t), moving) - at_rest for e in np.eye(self.n)]
            return np.stack(columns, axis=1)

        x = np.concatenate([np.asarray(start)[free], np.zeros(len(free))])
        answer = reaction(times[0], x)

        def slope(t, x):
            q, dq, ddq = whole(t, x)
            s = self.state(q, dq, t=t)
            matrix, bias = self.equations(s)
            matrix = matrix - answer
            rest = self.efforts(s, efforts) - bias - matrix @ ddq
            return np.concatenate([x[len(free) :], np.linalg.solve(matrix[np.ix_(free, free)], rest[free])])

        if not len(free):
            return np.array([whole(t, x)[0] for t in times])
        solved = solve_ivp(slope, (times[0], times[-1]), x, method="BDF", t_eval=times, rtol=error, atol=1.0e-4 * error)
        assert solved.success, solved.message
        assert np.allclose(reaction(times[-1], solved.y[:, -1]), answer, rtol=1e-9, atol=1e-9)
        return np.array([whole(t, x)[0] for t, x in zip(times, solved.y.T, strict=True)])
