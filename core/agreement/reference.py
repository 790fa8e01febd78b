"""The fifth voice: a robot's statics straight from the text of its tables.

This file imports nothing of the package, on purpose: an error that the reader, the build or a shared formula puts into
every engine alike would show nowhere else. It has its own reading of tables and units, its own chain of homogeneous
matrices, in the table's own convention (modified rows are not converted), and the textbook's sums over Jacobians
(Siciliano et al., 2009, section 7.1):

    M(q) = sum_i  m_i Jv_i^T Jv_i + Jw_i^T I_i Jw_i,      g(q) = - sum_i m_i Jv_i^T gravity

It is written to be read beside the database's contract, not to be fast, and it checks no input: a database that the
reader refuses never gets here. Positions q have shape (..., n); everything is in SI, vectors in the world's axes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Row = dict[str, float]

GEOMETRY = ("alpha", "a", "theta", "d", "beta")
MOMENTS = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")

# effects whose tables are read here
READ = frozenset(
    {
        "payload", "link_inertia", "kinematic_error", "base_tilt", "rotor_inertia", "joint_compliance", "joint_spring",
        "viscous_friction", "coulomb_friction", "stribeck_friction",
    }
)  # fmt: skip
# effects of the controller, the sensors and the motor, which change nothing that is asked here
NOT_ASKED = frozenset(
    {"torque_constant", "torque_offset", "torque_limit", "encoder_offset", "delay", "controller_gain"}
)
# effects that change what the drives pass, or let parts give, and nothing of the arms when all parts are rigid
OF_THE_DRIVES = frozenset(
    {
        "load_friction", "hysteresis", "torque_ripple", "backlash", "transmission_error", "joint_compliance_6d",
        "link_flexibility",
    }
)  # fmt: skip


class UnreadError(ValueError):
    """What the tables mean is beyond this file; the message says why, and the others speak without it."""


@dataclass(frozen=True, slots=True, eq=False)
class Lump:
    """A rigid body fixed to an arm.

    Attributes:
        mass: [kg].
        com: Center of mass in the arm's frame [m], shape (3,).
        tensor: Inertia tensor about it [kg m^2], shape (3, 3).
    """

    mass: float
    com: Array
    tensor: Array


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """A robot as its tables say it, with some of its effects.

    Attributes:
        kinds: "revolute" or "prismatic" of each joint.
        modified: Rows are Craig's; else Veitschegger's and Wu's.
        gravity: In the world [m/s^2], shape (3,).
        base, tool: Homogeneous matrices of the base in the world and the tool in the last arm, shape (4, 4).
        rows: alpha, a, theta, d, beta of each arm [rad, m], shape (n, 5), kinematic_error added.
        corrections: The same five of row 0 to n, shape (n + 1, 5).
        lumps: Bodies of each arm: its own first, then payloads.
        added: link_inertia: mass, three first moments, Ixx Iyy Izz Ixy Ixz Iyz about the frame's origin, shape (n, 10).
        rotor: Motor-side inertia [kg m^2 or kg], 0 where none is given, shape (n,).
        dummy: Fraction of the diagonal mass-matrix entry at home that an elastic joint without a rotor gets.
        home: Home positions, shape (n,).
        stiffness: K between motor and arm side, inf where rigid, shape (n,).
        damping: Its damper b, shape (n,).
        viscous, coulomb, stribeck, stribeck_velocity: Friction of the motor side, shape (n,).
        spring, rest: joint_spring of the arm side, shape (n,).
        smooth: Friction is smooth; else it sticks.
        smooth_velocity: Velocity of the smooth law's tanh [rad/s or m/s].
        motions: Name to (t, q) at the knots.
        effects: Rows of the effects that count, by effect and place (arm, joint, 0 for the robot), as the tables give
            them.
        drives_unsaid: Effects of the drives that this file does not read.
    """

    kinds: tuple[str, ...]
    modified: bool
    gravity: Array
    base: Array
    tool: Array
    rows: Array
    corrections: Array
    lumps: tuple[tuple[Lump, ...], ...]
    added: Array
    rotor: Array
    dummy: float
    home: Array
    stiffness: Array
    damping: Array
    viscous: Array
    coulomb: Array
    stribeck: Array
    stribeck_velocity: Array
    spring: Array
    rest: Array
    smooth: bool
    smooth_velocity: float
    motions: Mapping[str, tuple[Array, Array]]
    effects: Mapping[str, Mapping[int, Row]]
    drives_unsaid: tuple[str, ...] = ()

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.kinds)

    # -- kinematics -----------------------------------------------------------------------------------------------

    def frames(self, q: ArrayLike) -> tuple[Array, Array, Array]:
        """Frames of the arms in the world (..., n, 4, 4), the joints' axes (..., n, 3) and a point on each (..., n, 3).

        Standard rows turn and slide along z of the frame before: Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta).
        Modified rows along z of their own frame: Rx(alpha) Tx(a) Rz(theta) Tz(d).
        """
        q = np.asarray(q, dtype=float)
        before = np.broadcast_to(self.base, (*q.shape[:-1], 4, 4))
        frames: list[Array] = []
        joints: list[Array] = []
        for i, kind in enumerate(self.kinds):
            alpha, a, theta, d, beta = self.rows[i]
            turned = theta + (q[..., i] if kind == "revolute" else 0.0)
            slid = d + (q[..., i] if kind == "prismatic" else 0.0)
            moving = turn(2, turned) @ shift(2, slid)
            if self.modified:
                frame = before @ turn(0, alpha) @ shift(0, a) @ moving
                joints.append(frame)
            else:
                joints.append(before)
                frame = before @ moving @ shift(0, a) @ turn(0, alpha) @ turn(1, beta)
            frames.append(frame)
            before = frame
        places = np.stack(joints, axis=-3)
        return np.stack(frames, axis=-3), places[..., :3, 2], places[..., :3, 3]

    def tool_in_world(self, q: ArrayLike) -> Array:
        """Tool centre point in the world, shape (..., 4, 4)."""
        return self.frames(q)[0][..., -1, :, :] @ self.tool

    def real_joints_in_world(self, q: ArrayLike) -> Array:
        """Real places of the joints, corrections included, each still on the arm before it, shape (..., n, 4, 4)."""
        frames = self.frames(q)[0]
        base = np.broadcast_to(self.base, frames[..., :1, :, :].shape)
        before = np.concatenate([base, frames[..., :-1, :, :]], axis=-3)
        if self.modified:
            raise UnreadError("a modified table has no corrections")
        placed = [
            turn(2, theta) @ shift(2, d) @ shift(0, a) @ turn(0, alpha) @ turn(1, beta)
            for alpha, a, theta, d, beta in self.corrections[:-1]
        ]
        return before @ np.stack(placed)

    # -- dynamics -------------------------------------------------------------------------------------------------

    def jacobians(self, q: ArrayLike, arm: int, point: Array) -> tuple[Array, Array]:
        """Jacobians (..., 3, n) of the velocity of a point (..., 3) fixed to an arm (from 0), and of its turning."""
        _, axes, origins = self.frames(q)
        jv = np.zeros((*axes.shape[:-2], 3, self.n))
        jw = np.zeros_like(jv)
        for k in range(arm + 1):
            axis = axes[..., k, :]
            if self.kinds[k] == "revolute":
                jv[..., :, k] = np.cross(axis, point - origins[..., k, :])
                jw[..., :, k] = axis
            else:
                jv[..., :, k] = axis
        return jv, jw

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Mass matrix of the arms, without rotors, shape (..., n, n)."""
        q = np.asarray(q, dtype=float)
        frames = self.frames(q)[0]
        total = np.zeros((*q.shape, self.n))
        for i in range(self.n):
            rotation, origin = frames[..., i, :3, :3], frames[..., i, :3, 3]
            for lump in self.lumps[i]:
                jv, jw = self.jacobians(q, i, origin + rotation @ lump.com)
                tensor = rotation @ lump.tensor @ transposed(rotation)
                total = total + lump.mass * transposed(jv) @ jv + transposed(jw) @ tensor @ jw
            if self.added[i].any():
                # energy of parameters about the frame's origin: m v.v / 2 + v.(w x h) + w.I w / 2
                mass, first, tensor = about_origin(self.added[i])
                jv, jw = self.jacobians(q, i, origin)
                turned = transposed(jv) @ cross_matrix(rotation @ first) @ jw
                tensor = rotation @ tensor @ transposed(rotation)
                total = total + mass * transposed(jv) @ jv - turned - transposed(turned)
                total = total + transposed(jw) @ tensor @ jw
        return total

    def gravity_torque(self, q: ArrayLike) -> Array:
        """Torques that hold the arms against gravity, shape (..., n)."""
        q = np.asarray(q, dtype=float)
        frames = self.frames(q)[0]
        total = np.zeros_like(q)
        for i in range(self.n):
            rotation, origin = frames[..., i, :3, :3], frames[..., i, :3, 3]
            for lump in self.lumps[i]:
                jv, _ = self.jacobians(q, i, origin + rotation @ lump.com)
                total = total - lump.mass * transposed(jv) @ self.gravity
            if self.added[i].any():
                mass, first, _ = about_origin(self.added[i])
                jv, jw = self.jacobians(q, i, origin)
                moment = np.cross(rotation @ first, self.gravity)
                total = total - mass * transposed(jv) @ self.gravity - apply(transposed(jw), moment)
        return total

    def bias(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Torques of gravity, Coriolis and centrifugal forces, shape (..., n).

        Forces and moments of the accelerations that speeds dq alone give, projected by the Jacobians.
        """
        q, dq = np.asarray(q, dtype=float), np.asarray(dq, dtype=float)
        frames = self.frames(q)[0]
        total = self.gravity_torque(q)
        for i, (speed, turning, acceleration) in enumerate(self._accelerations(q, dq)):
            rotation, origin = frames[..., i, :3, :3], frames[..., i, :3, 3]
            for lump in self.lumps[i]:
                arm = rotation @ lump.com
                tensor = rotation @ lump.tensor @ transposed(rotation)
                force = lump.mass * (acceleration + np.cross(turning, arm) + np.cross(speed, np.cross(speed, arm)))
                moment = apply(tensor, turning) + np.cross(speed, apply(tensor, speed))
                jv, jw = self.jacobians(q, i, origin + arm)
                total = total + apply(transposed(jv), force) + apply(transposed(jw), moment)
            if self.added[i].any():
                mass, first, tensor = about_origin(self.added[i])
                first = rotation @ first
                tensor = rotation @ tensor @ transposed(rotation)
                force = mass * acceleration + np.cross(turning, first) + np.cross(speed, np.cross(speed, first))
                moment = apply(tensor, turning) + np.cross(speed, apply(tensor, speed)) + np.cross(first, acceleration)
                jv, jw = self.jacobians(q, i, origin)
                total = total + apply(transposed(jv), force) + apply(transposed(jw), moment)
        return total

    def _accelerations(self, q: Array, dq: Array) -> list[tuple[Array, Array, Array]]:
        """Angular velocity and acceleration of every arm, acceleration of its frame's origin, where ddq = 0."""
        frames, axes, origins = self.frames(q)
        speed = np.zeros((*q.shape[:-1], 3))
        turning, acceleration = np.zeros_like(speed), np.zeros_like(speed)
        here = np.broadcast_to(self.base[:3, 3], speed.shape)
        found: list[tuple[Array, Array, Array]] = []
        for k, kind in enumerate(self.kinds):
            axis, rate = axes[..., k, :], dq[..., k, None]
            place = frames[..., k, :3, 3]
            joint = origins[..., k, :] if kind == "revolute" else place
            # the point of the arm before that lies where the joint is
            arm = joint - here
            acceleration = acceleration + np.cross(turning, arm) + np.cross(speed, np.cross(speed, arm))
            if kind == "revolute":
                turning = turning + np.cross(speed, axis) * rate
                speed = speed + axis * rate
                arm = place - joint
                acceleration = acceleration + np.cross(turning, arm) + np.cross(speed, np.cross(speed, arm))
            else:
                acceleration = acceleration + 2.0 * np.cross(speed, axis) * rate
            here = place
            found.append((speed, turning, acceleration))
        return found

    def inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torques that the joints must give for a motion, without rotors, shape (..., n)."""
        return apply(self.mass_matrix(q), np.asarray(ddq, dtype=float)) + self.bias(q, dq)

    # -- drives ---------------------------------------------------------------------------------------------------

    def motor_inertia(self) -> Array:
        """Motor-side inertia, the dummy part's where an elastic joint has no rotor, shape (n,)."""
        home = np.diagonal(self.mass_matrix(self.home))
        return np.where(self.elastic() & (self.rotor == 0.0), self.dummy * home, self.rotor)

    def elastic(self) -> NDArray[np.bool_]:
        """Where motor and arm side are two coordinates: compliance, backlash or transmission error, shape (n,)."""
        found = np.isfinite(self.stiffness)
        for name in ("backlash", "transmission_error"):
            found[[place - 1 for place in self.effects.get(name, {})]] = True
        for place, row in self.effects.get("joint_compliance_6d", {}).items():
            own = "kz" if self.kinds[place - 1] == "prismatic" else "krz"
            found[place - 1] |= math.isfinite(row.get(own, math.inf))
        return found

    def drive_torque(self, q: ArrayLike, dq: ArrayLike, theta: ArrayLike, dtheta: ArrayLike) -> tuple[Array, Array]:
        """Torques on the arms and on the motor sides, command zero, sliding friction, shapes (..., n).

        Friction that sticks is given as it slides, its level against the speed.
        """
        q, dq, theta, dtheta = (np.asarray(x, dtype=float) for x in (q, dq, theta, dtheta))
        elastic = np.isfinite(self.stiffness)
        stiffness = np.where(elastic, self.stiffness, 0.0)
        passed = stiffness * (theta - q) + np.where(elastic, self.damping, 0.0) * (dtheta - dq)
        level = self.coulomb + self.stribeck * np.exp(-((dtheta / self.stribeck_velocity) ** 2))
        sense = np.tanh(dtheta / self.smooth_velocity) if self.smooth else np.sign(dtheta)
        return passed - self.spring * (q - self.rest), -passed - self.viscous * dtheta - level * sense

    def sag(self, theta: ArrayLike) -> Array:
        """Arm-side position at rest with the motor sides held at theta, shape (n,): q = theta - load(q) / K.

        Raises:
            UnreadError: The iteration finds no rest (springs too soft).
        """
        theta = np.asarray(theta, dtype=float)
        q = theta
        for _ in range(500):
            load = self.gravity_torque(q) + self.spring * (q - self.rest)
            following = theta - load / self.stiffness
            if float(np.max(np.abs(following - q))) <= 1e-15 * (1.0 + float(np.max(np.abs(theta)))):
                return following
            q = following
        raise UnreadError("q = theta - load(q) / K does not converge: the springs are too soft")


# -- small mathematics ------------------------------------------------------------------------------------------------


def turn(axis: int, angle: ArrayLike) -> Array:
    """Homogeneous matrices of turns about x (0), y (1) or z (2), shape (..., 4, 4)."""
    c, s = np.cos(angle), np.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((*np.shape(angle), 4, 4))
    matrix[..., axis, axis] = matrix[..., 3, 3] = 1.0
    matrix[..., j, j], matrix[..., j, k] = c, -s
    matrix[..., k, j], matrix[..., k, k] = s, c
    return matrix


def shift(axis: int, length: ArrayLike) -> Array:
    """Homogeneous matrices of shifts along x (0), y (1) or z (2), shape (..., 4, 4)."""
    matrix = np.zeros((*np.shape(length), 4, 4))
    matrix[...] = np.eye(4)
    matrix[..., axis, 3] = length
    return matrix


def transposed(matrix: Array) -> Array:
    """Each matrix turned over."""
    return np.swapaxes(matrix, -1, -2)


def apply(matrix: Array, vector: Array) -> Array:
    """Each matrix times its vector."""
    return (matrix @ vector[..., None])[..., 0]


def cross_matrix(vector: Array) -> Array:
    """Matrix of the cross product from the left, shape (..., 3, 3)."""
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = np.zeros_like(x)
    return np.stack(
        [np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)],
        -2,
    )


def tensor_of(moments: Sequence[float], products: float = 1.0) -> Array:
    """Tensor from Ixx Iyy Izz Ixy Ixz Iyz, the products times a sign, shape (3, 3)."""
    xx, yy, zz, xy, xz, yz = moments
    xy, xz, yz = products * xy, products * xz, products * yz
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def about_origin(ten: Array) -> tuple[float, Array, Array]:
    """Mass, first moments, tensor from the ten parameters about a frame's origin."""
    return float(ten[0]), ten[1:4], tensor_of([float(x) for x in ten[4:]])


# -- motion -----------------------------------------------------------------------------------------------------------


def out_and_back(t: ArrayLike, start: Array, turn: Array, duration: float) -> tuple[Array, Array]:
    """Positions and speeds of a motion from start (n,) to turn (n,) and back, each half 10 u^3 - 15 u^4 + 6 u^5."""
    half = duration / 2
    t = np.asarray(t, dtype=float)[..., None]
    there = t < half
    u = np.where(there, t, duration - t) / half
    way = turn - start
    speed = way * (30 * u**2 - 60 * u**3 + 30 * u**4) / half
    return start + way * (10 * u**3 - 15 * u**4 + 6 * u**5), np.where(there, speed, -speed)


# -- reading ----------------------------------------------------------------------------------------------------------

# how many SI units one is, and its dimension as powers of m, kg, s, rad
_UNITS: dict[str, tuple[float, tuple[int, int, int, int]]] = {
    "1": (1.0, (0, 0, 0, 0)), "": (1.0, (0, 0, 0, 0)), "%": (0.01, (0, 0, 0, 0)),
    "m": (1.0, (1, 0, 0, 0)), "cm": (1e-2, (1, 0, 0, 0)), "mm": (1e-3, (1, 0, 0, 0)), "um": (1e-6, (1, 0, 0, 0)),
    "kg": (1.0, (0, 1, 0, 0)), "g": (1e-3, (0, 1, 0, 0)), "t": (1e3, (0, 1, 0, 0)),
    "s": (1.0, (0, 0, 1, 0)), "ms": (1e-3, (0, 0, 1, 0)), "us": (1e-6, (0, 0, 1, 0)), "min": (60.0, (0, 0, 1, 0)),
    "Hz": (1.0, (0, 0, -1, 0)), "kHz": (1e3, (0, 0, -1, 0)),
    "rad": (1.0, (0, 0, 0, 1)), "mrad": (1e-3, (0, 0, 0, 1)), "deg": (math.pi / 180, (0, 0, 0, 1)),
    "turn": (2 * math.pi, (0, 0, 0, 1)), "rev": (2 * math.pi, (0, 0, 0, 1)), "rpm": (math.pi / 30, (0, 0, -1, 1)),
    "N": (1.0, (1, 1, -2, 0)), "kN": (1e3, (1, 1, -2, 0)), "mN": (1e-3, (1, 1, -2, 0)),
    "Nm": (1.0, (2, 1, -2, 0)), "Nmm": (1e-3, (2, 1, -2, 0)),
}  # fmt: skip


def unit_factor(text: str) -> float:
    """How many SI units one of these is: products, quotients and whole powers of the units above."""
    factor = 1.0
    for part, sign in _parts(text):
        name, _, power = part.replace("**", "^").replace("²", "^2").replace("³", "^3").partition("^")
        if name not in _UNITS or (power and not re.fullmatch(r"-?\d", power)):
            raise UnreadError(f"the unit {text!r} is not in the fifth voice's list")
        factor *= _UNITS[name][0] ** (sign * int(power or 1))
    return factor


def _parts(text: str) -> Iterable[tuple[str, int]]:
    """Factors of a unit with +1 or, behind a stroke, -1. Brackets turn the stroke for all they hold."""
    marks = re.findall(r"\*\*-?\d|[*/()·.]|[^*/()·.]+", text.replace(" ", ""))
    signs, sign = [1], 1
    pending: list[tuple[str, int]] = []
    for mark in marks:
        if mark in {"*", "·", "."}:
            sign = 1
        elif mark == "/":
            sign = -1
        elif mark == "(":
            signs.append(signs[-1] * sign)
            sign = 1
        elif mark == ")":
            signs.pop()
        elif mark.startswith("**"):
            pending[-1] = (pending[-1][0] + mark, pending[-1][1])
        else:
            pending.append((mark, signs[-1] * sign))
            sign = 1
    return pending


def read(
    path: str | Path, effects: Iterable[str] | None = None, level: str = "full", *, replaced: str | Path | None = None
) -> Tables:
    """A robot's statics from the text of its database.

    Args:
        path: Folder of tables or single YAML file.
        effects: Names of the effects that count; None: those of the level.
        level: "full", "rigid" or one that robot.yaml names.
        replaced: Folder of effects' tables that count too, and whose rows replace those of the level's tables.

    Raises:
        UnreadError: Something in it is beyond this file.
    """
    source = _Source(Path(path))
    head = source.head
    other = _Source(Path(replaced), bare=True) if replaced is not None else None
    own = source.level(level)
    wanted = own | (other.level("full") if other else set[str]()) if effects is None else set(effects)
    beyond = sorted(wanted - READ - NOT_ASKED - OF_THE_DRIVES)
    if beyond:
        raise UnreadError(f"the fifth voice does not know the effect {beyond[0]}")
    n = len(source.raw("kinematics"))
    joints = source.raw("joints")
    words = {int(float(row["joint"])): str(row.get("type", "revolute")) for row in joints}
    kinds = tuple("prismatic" if words.get(i + 1) == "prismatic" else "revolute" for i in range(n))
    source.kinds = kinds
    # of a table that the level does not use, only what replaces it counts
    used = {name: source.rows(f"effects/{name}") if name in own else [] for name in sorted(wanted)}
    if other:
        other.kinds = kinds
        for name in sorted(wanted):
            new = {_place(row): row for row in other.rows(name)}
            used[name] = [row for row in used[name] if _place(row) not in new] + list(new.values())
    sign = {"tensor": 1.0, "integral": -1.0}[str(head.get("products_of_inertia", "tensor"))]
    convention = str(head.get("kinematics_convention", "standard"))

    def joint_column(effect: str, column: str, default: float = 0.0) -> Array:
        values = np.full(n, default)
        for row in used.get(effect, ()):
            values[int(row["joint"]) - 1] = row.get(column, 0.0)
        return values

    rows = np.zeros((n, 5))
    for row in [*source.rows("kinematics"), *used.get("kinematic_error", ())]:
        rows[int(row["arm"]) - 1] += [row.get(column, 0.0) for column in GEOMETRY]
    corrections = np.zeros((n + 1, 5))
    for row in source.rows("corrections"):
        corrections[int(row["arm"])] = [row.get(column, 0.0) for column in GEOMETRY]
    lumps: list[tuple[Lump, ...]] = [()] * n
    for row in source.rows("inertia"):
        lumps[int(row["arm"]) - 1] = (_lump(row, sign),)
    for row in used.get("payload", ()):
        lumps[-1] = (*lumps[-1], _lump(row, 1.0))
    added = np.zeros((n, 10))
    for row in used.get("link_inertia", ()):
        added[int(row["arm"]) - 1] = [row.get(column, 0.0) for column in ("mass", "mx", "my", "mz", *MOMENTS)]
    base = _placed(head.get("base"))
    for row in used.get("base_tilt", ()):
        base = base @ turn(0, row.get("roll", 0.0)) @ turn(1, row.get("pitch", 0.0))
    friction: Any = head.get("friction") or {}
    return Tables(
        kinds=kinds,
        modified=convention == "modified",
        gravity=np.array([float(x) for x in head.get("gravity", (0.0, 0.0, -9.81))]),
        base=base,
        tool=_placed(head.get("tool")),
        rows=rows,
        corrections=corrections,
        lumps=tuple(lumps),
        added=added,
        rotor=joint_column("rotor_inertia", "inertia"),
        dummy=float(head.get("dummy_inertia", 1.0)),
        home=_home(source.rows("joints"), n),
        stiffness=joint_column("joint_compliance", "stiffness", math.inf),
        damping=joint_column("joint_compliance", "damping"),
        viscous=joint_column("viscous_friction", "coefficient"),
        coulomb=joint_column("coulomb_friction", "torque"),
        stribeck=joint_column("stribeck_friction", "torque"),
        stribeck_velocity=joint_column("stribeck_friction", "velocity", 1.0),
        spring=joint_column("joint_spring", "stiffness"),
        rest=joint_column("joint_spring", "rest"),
        smooth=str(friction.get("model", "stick")) == "smooth",
        smooth_velocity=float(friction.get("velocity", 1.0e-3)),
        motions={name: _motion(source.rows(f"motions/{name}"), n) for name in source.names("motions")},
        effects={name: {int(_place(row)): row for row in rows} for name, rows in used.items()},
        drives_unsaid=tuple(sorted(wanted & OF_THE_DRIVES)),
    )


def _place(row: Row) -> float:
    """The key of an effect's row; the robot's is 0."""
    return row.get("joint", row.get("arm", 0.0))


def _lump(row: Row, sign: float) -> Lump:
    com = np.array([row.get(axis, 0.0) for axis in "xyz"])
    return Lump(row["mass"], com, tensor_of([row.get(moment, 0.0) for moment in MOMENTS], sign))


def _placed(where: Any) -> Array:
    """Matrix of {xyz, rpy}: a shift, then turns about z, the new y, the new x."""
    where = where or {}
    x, y, z = (float(c) for c in where.get("xyz", (0.0, 0.0, 0.0)))
    roll, pitch, yaw = (float(c) for c in where.get("rpy", (0.0, 0.0, 0.0)))
    return shift(0, x) @ shift(1, y) @ shift(2, z) @ turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)


def _home(joints: Sequence[Row], n: int) -> Array:
    home = np.zeros(n)
    for row in joints:
        lower, upper = row.get("lower", -math.inf), row.get("upper", math.inf)
        if "home" in row:
            value = row["home"]
        elif lower <= 0.0 <= upper:
            value = 0.0
        elif math.isinf(lower) or math.isinf(upper):
            value = upper if math.isinf(lower) else lower
        else:
            value = (lower + upper) / 2
        home[int(row["joint"]) - 1] = value
    return home


def _motion(rows: Sequence[Row], n: int) -> tuple[Array, Array]:
    t = np.array([row["t"] for row in rows])
    return t, np.array([[row[f"q{i + 1}"] for i in range(n)] for row in rows])


class _Source:
    """The text of a database as rows by a table's name: a folder of tables, a single file, or some of both."""

    def __init__(self, path: Path, *, bare: bool = False) -> None:
        """Read the settings; a bare folder has none, only effects' tables."""
        from ruamel.yaml import YAML

        self.folder = path if path.is_dir() else path.parent if path.name == "robot.yaml" else None
        self.kinds: tuple[str, ...] = ()
        self.head: dict[str, Any] = {}
        if bare:
            return
        text = (path / "robot.yaml" if path.is_dir() else path).read_text(encoding="utf-8-sig")
        yaml: Any = YAML(typ="safe", pure=True)
        self.head = yaml.load(text) or {}

    def level(self, name: str) -> set[str]:
        """Names of a level's effects."""
        if name == "full":
            bare = {file.stem for file in self.folder.glob("*.dat")} if self.folder and not self.head else set[str]()
            return bare | set(self.names("effects")) | (set(self.head) & (READ | NOT_ASKED | OF_THE_DRIVES))
        return set() if name == "rigid" else set(self.head["levels"][name])

    def names(self, group: str) -> tuple[str, ...]:
        """Names of the tables of effects or of motions."""
        files = {file.stem for file in (self.folder / group).glob("*.dat")} if self.folder else set[str]()
        paths = {key.partition("/")[2] for key in self.head if key.startswith(f"{group}/")}
        return tuple(sorted({*files, *paths, *(self.head.get(group) or {})}))

    def raw(self, table: str) -> list[dict[str, Any]]:
        """Rows by the column's name, without its unit; [] where there is no such table."""
        return [{key.partition("[")[0]: cell for key, cell in row.items()} for row in self._rows(table)]

    def rows(self, table: str) -> list[Row]:
        """Rows in SI by the column's name."""
        converted: list[Row] = []
        for row in self._rows(table):
            key = next((name for name in ("joint", "arm") if name in row), None)
            kind = self.kinds[int(float(row[key])) - 1] if key == "joint" else ""
            values: Row = {}
            for heading, cell in row.items():
                name, _, unit = heading.partition("[")
                # the words in a column of words are no numbers
                if name not in {"type", "robot"} and cell is not None:
                    values[name] = float(cell) * self._factor(unit.rstrip("]"), kind, name)
            converted.append(values)
        return converted

    def _factor(self, unit: str, kind: str, column: str) -> float:
        """A column of two units has the revolute joint's first; in a motion the column names its joint."""
        if "|" not in unit:
            return unit_factor(unit)
        number = re.fullmatch(r"d{0,2}q(\d+)", column)
        if number:
            kind = self.kinds[int(number[1]) - 1]
        return unit_factor(unit.split("|")[kind == "prismatic"])

    def _rows(self, table: str) -> list[dict[str, Any]]:
        file = self.folder / f"{table}.dat" if self.folder else None
        if file and file.is_file():
            lines = (line.partition("#")[0].split() for line in file.read_text(encoding="utf-8-sig").splitlines())
            cells: list[Any] = [words for words in lines if words]
        else:
            group, _, name = table.partition("/")
            inner: dict[str, Any] = (self.head.get(group) or {}) if name else {}
            places: tuple[Any, ...] = (self.head.get(table), inner.get(name))
            if group == "effects":
                places = (*places, self.head.get(name))
            cells = list(next((place for place in places if place), ()))
            if cells and isinstance(cells[0], dict):
                return cells
        return [dict(zip(cells[0], row, strict=True)) for row in cells[1:]]
