"""Kinematics and rigid-body dynamics of a serial chain, straight from a database's tables.

A chain is a row of nodes; each has a constant transform from the node before, then one coordinate about (or along) its
own z axis, then a body. Driven joints and hidden ones (bending arms, soft bearings, sloshing loads) are nodes alike.
Dynamics: spatial vectors, all at the base's origin (Featherstone 2008, chapters 5 and 6): composite bodies for the mass
matrix, recursive Newton-Euler for the bias.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit
from ruamel.yaml import YAML

SCALES = {"deg": math.pi / 180.0, "mm": 1.0e-3, "g": 1.0e-3, "rad": 1.0, "m": 1.0}
REVOLUTE, PRISMATIC = 0, 1


@dataclass(frozen=True)
class Arm:
    """One arm: Veitschegger-Wu parameters (alpha, a, theta, d, beta), mass, center of mass, tensor about it (3, 3)."""

    alpha: float
    a: float
    theta: float
    d: float
    beta: float
    mass: float
    com: np.ndarray
    tensor: np.ndarray

    def transform(self) -> np.ndarray:
        """A = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta) without the joint's variable, shape (4, 4)."""
        return turn(2, self.theta) @ shift(self.a, 0.0, self.d) @ turn(0, self.alpha) @ turn(1, self.beta)


@dataclass(frozen=True)
class Robot:
    """What a database says of the rigid robot."""

    name: str
    arms: tuple[Arm, ...]
    prismatic: tuple[bool, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    home: np.ndarray
    joint_shift: tuple[float, ...]  # how far along its axis joint i's real place is from its frame
    gravity: np.ndarray  # in the base
    base: np.ndarray
    tool: np.ndarray
    settings: dict
    tables: dict = field(default_factory=dict)  # effect -> {joint: {column: value}}, SI

    @property
    def n(self) -> int:
        return len(self.arms)


def turn(axis: int, angle: float) -> np.ndarray:
    """Rotation about an axis, shape (4, 4)."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def shift(x: float, y: float, z: float) -> np.ndarray:
    """Translation, shape (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def pose(place: dict) -> np.ndarray:
    """xyz and rpy as a matrix: Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = place.get("rpy", (0.0, 0.0, 0.0))
    return shift(*place.get("xyz", (0.0, 0.0, 0.0))) @ turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)


def unit_scale(unit: str, prismatic: bool) -> float:
    """Factor of a unit of kinematics and joints to SI."""
    choices = unit.split("|")
    unit = choices[-1] if prismatic else choices[0]
    return SCALES.get(unit.split("/")[0], 1.0) if "*" not in unit else 1.0


def read_table(path: Path, prismatic: tuple[bool, ...] = ()) -> dict[int, dict]:
    """Rows of a table by key; numbers in SI."""
    lines = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    lines = [line for line in lines if line]
    names = [cell.rstrip("]").partition("[") for cell in lines[0]]
    rows = {}
    for line in lines[1:]:
        key = int(line[0])
        slides = bool(prismatic) and 0 < key <= len(prismatic) and prismatic[key - 1]
        row = {}
        for (name, _, unit), cell in zip(names[1:], line[1:], strict=True):
            row[name] = cell if name == "type" else float(cell) * unit_scale(unit, slides)
        rows[key] = row
    return rows


def read_robot(folder: Path) -> Robot:
    """The rigid robot of a database folder with the effects' tables beside it."""
    settings = YAML(typ="safe").load((folder / "robot.yaml").read_text())
    kinematics = read_table(folder / "kinematics.dat")
    inertia = read_table(folder / "inertia.dat")
    n = len(kinematics)
    types = read_table(folder / "joints.dat")
    prismatic = tuple(types[i]["type"] == "prismatic" for i in range(1, n + 1))
    joints = read_table(folder / "joints.dat", prismatic)
    shifts = [0.0] * n
    if (folder / "corrections.dat").is_file():
        rows = read_table(folder / "corrections.dat")
        shifts = [rows[i]["d"] if i in rows else 0.0 for i in range(n)]
    arms = []
    for i in range(1, n + 1):
        k, b = kinematics[i], inertia[i]
        xx, yy, zz = b["Ixx"], b["Iyy"], b["Izz"]
        xy, xz, yz = b.get("Ixy", 0.0), b.get("Ixz", 0.0), b.get("Iyz", 0.0)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        com = np.array([b["x"], b["y"], b["z"]])
        arms.append(Arm(k["alpha"], k["a"], k["theta"], k["d"], k.get("beta", 0.0), b["mass"], com, tensor))

    def column(name: str, default: float) -> np.ndarray:
        return np.array([joints[i].get(name, default) for i in range(1, n + 1)])

    base = pose(settings["base"])
    tables = {path.stem: read_table(path, prismatic) for path in sorted((folder / "effects").glob("*.dat"))}
    return Robot(
        settings["name"],
        tuple(arms),
        prismatic,
        column("lower", -math.inf),
        column("upper", math.inf),
        column("velocity", math.inf),
        column("effort", math.inf),
        column("home", 0.0),
        tuple(shifts),
        base[:3, :3].T @ np.array(settings["gravity"], dtype=float),
        base,
        pose(settings["tool"]),
        settings,
        tables,
    )


# ---------------------------------------------------------------------------------------------------------- the chain


class Chain(NamedTuple):
    """Arrays of N nodes. kind (N,); turn (N, 3, 3) and place (N, 3): constant transform from the node before; mass
    (N,), moment (N, 3) = mass times center, tensor (N, 3, 3) about the node's origin; gravity (3,)."""

    kind: np.ndarray
    turn: np.ndarray
    place: np.ndarray
    mass: np.ndarray
    moment: np.ndarray
    tensor: np.ndarray
    gravity: np.ndarray


@dataclass
class ChainBuilder:
    """Nodes collected one by one; `driven` tells which node each joint is."""

    kinds: list = field(default_factory=list)
    places: list = field(default_factory=list)
    bodies: list = field(default_factory=list)  # (mass, moment, tensor about the origin)
    driven: list = field(default_factory=list)

    def node(self, kind: int, transform: np.ndarray) -> None:
        self.kinds.append(kind)
        self.places.append(transform)
        self.bodies.append((0.0, np.zeros(3), np.zeros((3, 3))))

    def body(self, mass: float, com: np.ndarray, tensor: np.ndarray, transform: np.ndarray) -> None:
        """Add a body to the last node: center and tensor about it in a frame that `transform` places in the node."""
        center = transform[:3, :3] @ com + transform[:3, 3]
        about = transform[:3, :3] @ tensor @ transform[:3, :3].T + mass * steiner(center)
        m, moment, old = self.bodies[-1]
        self.bodies[-1] = (m + mass, moment + mass * center, old + about)

    def built(self, gravity: np.ndarray) -> Chain:
        return Chain(
            np.array(self.kinds, dtype=np.int64),
            np.array([p[:3, :3] for p in self.places]),
            np.array([p[:3, 3] for p in self.places]),
            np.array([b[0] for b in self.bodies]),
            np.array([b[1] for b in self.bodies]),
            np.array([b[2] for b in self.bodies]),
            np.array(gravity, dtype=float),
        )


def steiner(c: np.ndarray) -> np.ndarray:
    """Tensor about the origin of a unit mass at c, shape (3, 3)."""
    return float(c @ c) * np.eye(3) - np.outer(c, c)


def axis_frame(axis: np.ndarray, point: np.ndarray) -> np.ndarray:
    """A frame at a point with z along an axis, shape (4, 4)."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    matrix[:3, 3] = point
    return matrix


@dataclass(frozen=True)
class Extras:
    """What is hung into the chain beside the arms.

    bearings: joint (from 0) -> directions of (kind, axis); bends: arm (from 0) -> fraction; mount: the base rocks about
    x and y with (mass, inertia); load: (mass, center, tensor) fixed to the last arm; slosh: (mass, center) that slides
    in x and y of the last arm. Hidden coordinates come in this order along the chain.
    """

    bearings: dict = field(default_factory=dict)
    bends: dict = field(default_factory=dict)
    mount: tuple | None = None
    load: tuple | None = None
    slosh: tuple | None = None


def build_chain(robot: Robot, extras: Extras = Extras()) -> tuple[Chain, list[int], list[tuple], np.ndarray]:
    """(chain, node of each joint, hidden nodes as (node, what, number), tool in the last arm's node)."""
    b = ChainBuilder()
    hidden: list[tuple] = []
    before = np.eye(4)
    if extras.mount:
        for number, axis in enumerate((0, 1)):
            frame = axis_frame(np.eye(3)[axis], np.zeros(3))
            b.node(REVOLUTE, before @ frame)
            hidden.append((len(b.kinds) - 1, ("mount", 0), number))
            before = np.linalg.inv(frame)
        b.body(extras.mount[0], np.zeros(3), extras.mount[1] * np.eye(3), before)
    for i, arm in enumerate(robot.arms):
        b.node(PRISMATIC if robot.prismatic[i] else REVOLUTE, before)
        b.driven.append(len(b.kinds) - 1)
        inside = np.eye(4)  # the driven joint's moving frame in the last node
        for number, (kind, axis) in enumerate(extras.bearings.get(i, ())):
            frame = axis_frame(np.eye(3)[axis], np.array([0.0, 0.0, robot.joint_shift[i]]))
            b.node(kind, inside @ frame)
            hidden.append((len(b.kinds) - 1, ("bearing", i), number))
            inside = np.linalg.inv(frame)
        own = arm.transform()
        if i in extras.bends:
            at = extras.bends[i]
            b.body(at * arm.mass, arm.com, at * arm.tensor, inside @ own)
            line = own[:3, 3]
            e = line / np.linalg.norm(line)
            u = np.cross(own[:3, 2], e)
            if np.linalg.norm(u) < 1.0e-6:
                u = np.cross(own[:3, 0], e)
            u /= np.linalg.norm(u)
            for number, axis in enumerate((u, np.cross(e, u))):
                frame = axis_frame(axis, at * line)
                b.node(REVOLUTE, inside @ frame)
                hidden.append((len(b.kinds) - 1, ("bend", i), number))
                inside = np.linalg.inv(frame)
            b.body((1.0 - at) * arm.mass, arm.com, (1.0 - at) * arm.tensor, inside @ own)
        else:
            b.body(arm.mass, arm.com, arm.tensor, inside @ own)
        before = inside @ own
    if extras.load:
        b.body(extras.load[0], np.asarray(extras.load[1]), np.asarray(extras.load[2]), before)
    tool = before @ robot.tool
    tool_node = len(b.kinds) - 1
    if extras.slosh:
        mass, center = extras.slosh
        inside = before @ shift(*center)
        for number, axis in enumerate((0, 1)):
            frame = axis_frame(np.eye(3)[axis], np.zeros(3))
            b.node(PRISMATIC, inside @ frame)
            hidden.append((len(b.kinds) - 1, ("slosh", 0), number))
            inside = np.linalg.inv(frame)
        b.body(mass, np.zeros(3), 1.0e-4 * mass * np.eye(3), inside)
    return b.built(robot.gravity), b.driven, hidden, (tool_node, tool)


# ------------------------------------------------------------------------------------------------------- compiled parts


@njit(cache=True)
def place_nodes(chain, q, R, p):
    """World rotation (N, 3, 3) and origin (N, 3) of every node."""
    for j in range(len(q)):
        a = chain.turn[j]
        x, y, z = chain.place[j]
        if chain.kind[j] == 1:
            x += a[0, 2] * q[j]
            y += a[1, 2] * q[j]
            z += a[2, 2] * q[j]
            c, s = 1.0, 0.0
        else:
            c, s = math.cos(q[j]), math.sin(q[j])
        if j == 0:
            p[0, 0], p[0, 1], p[0, 2] = x, y, z
            for r in range(3):
                R[0, r, 0] = a[r, 0] * c + a[r, 1] * s
                R[0, r, 1] = a[r, 1] * c - a[r, 0] * s
                R[0, r, 2] = a[r, 2]
        else:
            for r in range(3):
                u, v, w = R[j - 1, r, 0], R[j - 1, r, 1], R[j - 1, r, 2]
                p[j, r] = p[j - 1, r] + u * x + v * y + w * z
                b0 = u * a[0, 0] + v * a[1, 0] + w * a[2, 0]
                b1 = u * a[0, 1] + v * a[1, 1] + w * a[2, 1]
                R[j, r, 0] = b0 * c + b1 * s
                R[j, r, 1] = b1 * c - b0 * s
                R[j, r, 2] = u * a[0, 2] + v * a[1, 2] + w * a[2, 2]


@njit(cache=True)
def inertia_times(m, c, tensor, w, v, out):
    """Momentum (angular about the origin, linear) of a body that moves with (w, v); out (6,)."""
    for r in range(3):
        a, b = (r + 1) % 3, (r + 2) % 3
        out[r] = tensor[r, 0] * w[0] + tensor[r, 1] * w[1] + tensor[r, 2] * w[2] + c[a] * v[b] - c[b] * v[a]
        out[3 + r] = m * v[r] - (c[a] * w[b] - c[b] * w[a])


@njit(cache=True)
def dynamics(chain, q, v, M, h, R, p, S, V, A, F, C, J):
    """Mass matrix (N, N) and bias (N,): M ddq + h = forces. The others are workspace.

    S (N, 6) axes, V (N, 6) velocities, A (N, 6) accelerations for ddq = 0, F (N, 6) forces, C (N, 4) mass and moment,
    J (N, 3, 3) tensors, all in the base at its origin.
    """
    n = len(q)
    place_nodes(chain, q, R, p)
    for j in range(n):
        # body at the base's origin
        m = chain.mass[j]
        mx = np.empty(3)
        for r in range(3):
            mx[r] = R[j, r, 0] * chain.moment[j, 0] + R[j, r, 1] * chain.moment[j, 1] + R[j, r, 2] * chain.moment[j, 2]
        T = chain.tensor[j]
        o = p[j]
        dot_oc = o[0] * mx[0] + o[1] * mx[1] + o[2] * mx[2]
        oo = o[0] * o[0] + o[1] * o[1] + o[2] * o[2]
        for r in range(3):
            t0 = R[j, r, 0] * T[0, 0] + R[j, r, 1] * T[1, 0] + R[j, r, 2] * T[2, 0]
            t1 = R[j, r, 0] * T[0, 1] + R[j, r, 1] * T[1, 1] + R[j, r, 2] * T[2, 1]
            t2 = R[j, r, 0] * T[0, 2] + R[j, r, 1] * T[1, 2] + R[j, r, 2] * T[2, 2]
            for s in range(3):
                value = t0 * R[j, s, 0] + t1 * R[j, s, 1] + t2 * R[j, s, 2]
                value -= m * o[r] * o[s] + o[r] * mx[s] + mx[r] * o[s]
                if r == s:
                    value += m * oo + 2.0 * dot_oc
                J[j, r, s] = value
        C[j, 0] = m
        for r in range(3):
            C[j, 1 + r] = mx[r] + m * o[r]
        # axis
        for r in range(3):
            z = R[j, r, 2]
            if chain.kind[j] == 1:
                S[j, r], S[j, 3 + r] = 0.0, z
            else:
                a, b = (r + 1) % 3, (r + 2) % 3
                S[j, r], S[j, 3 + r] = z, o[a] * R[j, b, 2] - o[b] * R[j, a, 2]
        # velocity, and acceleration with gravity as the base's
        for r in range(6):
            V[j, r] = (V[j - 1, r] if j else 0.0) + S[j, r] * v[j]
            A[j, r] = A[j - 1, r] if j else (-chain.gravity[r - 3] if r > 2 else 0.0)
        for r in range(3):
            a, b = (r + 1) % 3, (r + 2) % 3
            A[j, r] += (V[j, a] * S[j, b] - V[j, b] * S[j, a]) * v[j]
            A[j, 3 + r] += (
                V[j, a] * S[j, 3 + b] - V[j, b] * S[j, 3 + a] + V[j, 3 + a] * S[j, b] - V[j, 3 + b] * S[j, a]
            ) * v[j]
        P = np.empty(6)
        inertia_times(m, C[j, 1:4], J[j], V[j, :3], V[j, 3:], P)
        inertia_times(m, C[j, 1:4], J[j], A[j, :3], A[j, 3:], F[j])
        for r in range(3):
            a, b = (r + 1) % 3, (r + 2) % 3
            F[j, r] += V[j, a] * P[b] - V[j, b] * P[a] + V[j, 3 + a] * P[3 + b] - V[j, 3 + b] * P[3 + a]
            F[j, 3 + r] += V[j, a] * P[3 + b] - V[j, b] * P[3 + a]
    force = np.empty(6)
    for j in range(n - 1, -1, -1):
        if j < n - 1:
            for r in range(6):
                F[j, r] += F[j + 1, r]
            for r in range(4):
                C[j, r] += C[j + 1, r]
            for r in range(3):
                for s in range(3):
                    J[j, r, s] += J[j + 1, r, s]
        h[j] = 0.0
        for r in range(6):
            h[j] += S[j, r] * F[j, r]
        inertia_times(C[j, 0], C[j, 1:4], J[j], S[j, :3], S[j, 3:], force)
        for i in range(j + 1):
            value = 0.0
            for r in range(6):
                value += S[i, r] * force[r]
            M[i, j] = value
            M[j, i] = value


@njit(cache=True)
def mass_and_bias(chain, q, v):
    """(mass matrix (N, N), bias (N,)) at one state."""
    n = len(q)
    M, h = np.zeros((n, n)), np.zeros(n)
    six = np.zeros((4, n, 6))
    dynamics(
        chain, q, v, M, h, np.zeros((n, 3, 3)), np.zeros((n, 3)), six[0], six[1], six[2], six[3], np.zeros((n, 4)),
        np.zeros((n, 3, 3)),
    )  # fmt: skip
    return M, h


@njit(cache=True)
def inverse_dynamics(chain, q, v, a):
    """Torques along a motion, (m, N) each."""
    out = np.zeros_like(q)
    for k in range(len(q)):
        M, h = mass_and_bias(chain, q[k], v[k])
        out[k] = M @ a[k] + h
    return out


@njit(cache=True)
def node_frames(chain, q, node):
    """World frame of one node along a motion, (m, 3, 4): rotation and origin."""
    m, n = q.shape
    out = np.zeros((m, 3, 4))
    R, p = np.zeros((n, 3, 3)), np.zeros((n, 3))
    for k in range(m):
        place_nodes(chain, q[k], R, p)
        out[k, :, :3] = R[node]
        out[k, :, 3] = p[node]
    return out


@njit(cache=True)
def energy(chain, q, v):
    """Kinetic plus potential energy of the bodies [J]."""
    M, _ = mass_and_bias(chain, q, v)
    n = len(q)
    R, p = np.zeros((n, 3, 3)), np.zeros((n, 3))
    place_nodes(chain, q, R, p)
    total = 0.5 * (v @ (M @ v))
    for j in range(n):
        center = chain.mass[j] * p[j] + R[j] @ chain.moment[j]
        total -= center @ chain.gravity
    return total


def changed(robot: Robot, arms: tuple[Arm, ...]) -> Robot:
    return replace(robot, arms=arms)
