"""What differences of mass matrix and gravity look like: signs, rotations, units and rows of the inertias.

Both are linear in the ten inertial parameters of every arm (mass, first moments, tensor about the frame's origin), so
every suspicion is a vector of parameters and is tried by one product.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from ..kinematics import arms_in_base, joints_in_base
from ..representation import Robot
from ..simulation.backend import Vector
from .look import EXPLAINED, Look, brief, listed
from .reference import Lump, Tables, transposed

# states that are enough to tell one body from another
ENOUGH = 10
PARAMETERS = ("mass", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
_PRODUCTS = {"Ixy": (0, 1), "Ixz": (0, 2), "Iyz": (1, 2)}


class _Differences:
    """Mass matrices and gravity torques as one vector, each entry weighed as its gate does."""

    def __init__(self, model: Tables, q: Vector) -> None:
        self.model, self.q = model, q[:ENOUGH]
        mass_matrix, gravity = model.mass_matrix(self.q), model.gravity_torque(self.q)
        root = np.sqrt(np.abs(np.einsum("kii->ki", mass_matrix)))
        self.by_mass = root[:, :, None] * root[:, None, :]
        weight = root.max(axis=0)
        self.by_gravity = weight * max(float(np.max(np.abs(gravity) / weight)), 1e-300)
        self.expected = self.vector(mass_matrix, gravity)
        n = model.n
        bare = replace(model, lumps=((),) * n, added=np.zeros((n, 10)))
        self.columns = np.empty((n, len(self.expected), 10))
        for i in range(n):
            for k in range(10):
                added = np.zeros((n, 10))
                added[i, k] = 1.0
                unit = replace(bare, added=added)
                self.columns[i, :, k] = self.vector(unit.mass_matrix(self.q), unit.gravity_torque(self.q))

    def vector(self, mass_matrix: Vector, gravity: Vector) -> Vector:
        count = len(self.q)
        parts = (mass_matrix[:count] / self.by_mass, gravity[:count] / self.by_gravity)
        return np.concatenate([part.ravel() for part in parts])


def inertia_look(
    model: Tables,
    robot: Robot,
    q: Vector,
    mass_matrix: Vector,
    gravity: Vector,
    without: Mapping[str, Callable[[], Tables]],
) -> Look:
    """What the mass matrices and gravity torques of an odd voice look like.

    Args:
        model: The robot as the trusted voices have it.
        robot: The representation, for its joint frames.
        q: States, shape (m, n).
        mass_matrix: Of the odd voice, shape (m, n, n).
        gravity: Of the odd voice, shape (m, n).
        without: Effect to the robot without it.
    """
    if not (np.isfinite(mass_matrix).all() and np.isfinite(gravity).all()):
        return Look("unknown", "robot", "its mass matrix or gravity is no number")
    differences = _Differences(model, q)
    seen = differences.vector(mass_matrix, gravity) - differences.expected
    size = float(np.linalg.norm(seen))
    by_mass = differences.by_mass.size
    if float(np.linalg.norm(seen[:by_mass])) < EXPLAINED * size:
        look = _gravity_vector(differences, seen)
        if look is not None:
            return look
    found: list[tuple[float, Look]] = []
    for look, changes in _suspicions(model, robot):
        made = sum((differences.columns[i] @ change for i, change in changes.items()), np.zeros(len(seen)))
        left = float(np.linalg.norm(seen - made))
        if left < EXPLAINED * size:
            found.append((left, look))
    if found:
        # the simplest of those that explain it equally well
        best = min(left for left, _ in found)
        return next(look for left, look in found if left <= max(10.0 * best, 1e-9 * size))
    for effect in ("payload", "link_inertia"):
        if effect in without:
            bare = without[effect]()
            made = differences.vector(bare.mass_matrix(differences.q), bare.gravity_torque(differences.q))
            if float(np.linalg.norm(seen - made + differences.expected)) < EXPLAINED * size:
                return Look("lost effect", "robot", f"{effect} is left out")
    return _fitted(differences, seen, size)


def _gravity_vector(differences: _Differences, seen: Vector) -> Look | None:
    """Gravity torques are linear in the vector of gravity."""
    model, by_mass = differences.model, differences.by_mass.size
    still = np.zeros_like(differences.by_mass)
    columns = np.stack(
        [
            differences.vector(still, replace(model, gravity=np.eye(3)[k]).gravity_torque(differences.q))[by_mass:]
            for k in range(3)
        ],
        axis=1,
    )
    change = least_squares(columns, seen[by_mass:])
    if float(np.linalg.norm(seen[by_mass:] - columns @ change)) > EXPLAINED * float(np.linalg.norm(seen)):
        return None
    got = model.gravity + change
    clean = np.where(np.abs(got) < 1e-9 * np.linalg.norm(model.gravity), 0.0, got)
    shown = ", ".join(brief(float(x)) for x in clean)
    told = ", ".join(brief(float(x)) for x in model.gravity)
    if abs(float(np.linalg.norm(got)) - float(np.linalg.norm(model.gravity))) < 1e-9 and float(got @ model.gravity) > 0:
        text = (
            f"gravity comes from another direction: as ({shown}) instead of ({told}) m/s^2; the base's rotation is off"
        )
    else:
        text = f"gravity is ({shown}) instead of ({told}) m/s^2"
    return Look("gravity", "robot", text)


def parameters_of(lump: Lump) -> Vector:
    """The ten parameters about the frame's origin."""
    x, y, z = lump.com
    steiner = (lump.com @ lump.com) * np.eye(3) - np.outer(lump.com, lump.com)
    t = lump.tensor + lump.mass * steiner
    moments = (t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2])
    return np.array([lump.mass, lump.mass * x, lump.mass * y, lump.mass * z, *moments])


def _suspicions(model: Tables, robot: Robot) -> Iterator[tuple[Look, dict[int, Vector]]]:
    """Changes of parameters by arm: one arm first, then the same fault in all arms, then two rows."""
    of_all: dict[str, dict[int, Vector]] = {}
    at_zero = np.zeros(model.n)
    placed = model.frames(at_zero)[0][:, :3, :3]
    base = robot.base.rotation_matrix()
    # from the axes that a table's inertias stand in to those of the joint, and of the standard convention's row
    to_joint = transposed(base @ joints_in_base(robot, at_zero)[:, :3, :3]) @ placed
    to_standard = transposed(base @ arms_in_base(robot, at_zero)[:, :3, :3]) @ placed
    for i in range(model.n):
        if not model.lumps[i]:
            continue
        lump = model.lumps[i][0]
        for fault, text, changed in _lump_faults(lump, to_joint[i], to_standard[i]):
            change = parameters_of(changed) - parameters_of(lump)
            if float(np.max(np.abs(change))) > 0.0:
                of_all.setdefault(fault, {})[i] = change
                yield Look("inertia", f"arm_{i + 1}", text.format(arm=f"arm_{i + 1}")), {i: change}
    for fault, changes in of_all.items():
        if len(changes) > 1:
            arms = [f"arm_{i + 1}" for i in changes]
            where = "every arm" if len(arms) == model.n else listed(arms)
            text = re.sub(r", in the order [^)]*\)\)", ")", fault)
            yield Look("inertia", ", ".join(arms), f"{text} in {where}"), changes
    for i, j in combinations(range(model.n), 2):
        if model.lumps[i] and model.lumps[j]:
            change = parameters_of(model.lumps[j][0]) - parameters_of(model.lumps[i][0])
            text = f"rows arm_{i + 1} and arm_{j + 1} of the inertias are swapped"
            yield Look("inertia", f"arm_{i + 1}, arm_{j + 1}", text), {i: change, j: -change}


def _lump_faults(lump: Lump, arm_to_joint: Vector, arm_to_standard: Vector) -> Iterator[tuple[str, str, Lump]]:
    """Name of the fault, its text for one arm, the body that it makes."""
    tensor, com = lump.tensor, lump.com

    def body(changed: Vector) -> Lump:
        return Lump(lump.mass, com, changed)

    for name, (a, b) in _PRODUCTS.items():
        value = float(tensor[a, b])
        if value == 0.0:
            continue
        for fault, factor in (("has the opposite sign", -1.0), ("is left out", 0.0)):
            changed = tensor.copy()
            changed[a, b] = changed[b, a] = factor * value
            told = f"({brief(factor * value)} instead of {brief(value)} kg m^2)"
            yield f"{name} {fault}", f"{name} of {{arm}} {fault} {told}", body(changed)
    diagonal = np.diag(np.diag(tensor))
    yield (
        "the products of inertia have the opposite sign",
        "the products of inertia of {arm} have the opposite sign",
        body(2 * diagonal - tensor),
    )
    yield "the products of inertia are left out", "the products of inertia of {arm} are left out", body(diagonal)
    # a rotation that is lost on the way from the arm's frame to the joint's, or from the principal axes
    moments = np.linalg.eigvalsh(tensor)
    lost = "the rotation of the inertia is lost"
    text = "the rotation of {arm}'s inertia is lost"
    for order in permutations(range(3)):
        principal = np.asarray(np.diag(moments[list(order)]), dtype=float)
        for where, turned in (("arm", principal), ("joint", arm_to_joint.T @ principal @ arm_to_joint)):
            what = f"its principal moments stand in the {where}'s axes"
            yield f"{lost} ({what}, in the order {order})", f"{text} ({what})", body(turned)
    for whose, turn in (("the joint's", arm_to_joint), ("another convention's", arm_to_standard)):
        if float(np.max(np.abs(turn - np.eye(3)))) > 1e-9:
            what = f"its tensor stands in {whose} axes"
            yield f"{lost} ({what})", f"{text} ({what})", body(turn.T @ tensor @ turn)
    in_joint = arm_to_joint @ tensor @ arm_to_joint.T
    bare = arm_to_joint.T @ np.diag(np.diag(in_joint)) @ arm_to_joint
    text = "the products of inertia of {arm} in the joint's frame are left out"
    yield "the products of inertia in the joint's frame are left out", text, body(bare)
    for name, (a, b) in _PRODUCTS.items():
        mirrored = in_joint.copy()
        mirrored[a, b] = mirrored[b, a] = -in_joint[a, b]
        fault = f"{name} in the joint's frame has the opposite sign"
        text = f"{name} of {{arm}} in the joint's frame has the opposite sign"
        yield fault, text, body(arm_to_joint.T @ mirrored @ arm_to_joint)
    flipped = arm_to_joint.T @ (2 * np.diag(np.diag(in_joint)) - in_joint) @ arm_to_joint
    text = "the products of inertia of {arm} in the joint's frame have the opposite sign"
    yield "the products of inertia in the joint's frame have the opposite sign", text, body(flipped)
    for (a, first), (b, second) in combinations(_PRODUCTS.items(), 2):
        changed = tensor.copy()
        changed[first[0], first[1]] = changed[first[1], first[0]] = tensor[second]
        changed[second[0], second[1]] = changed[second[1], second[0]] = tensor[first]
        yield f"{a} and {b} are swapped", f"{a} and {b} of {{arm}} are swapped", body(changed)
    for a, b in combinations(range(3), 2):
        changed = tensor.copy()
        changed[a, a], changed[b, b] = tensor[b, b], tensor[a, a]
        names = f"I{'xyz'[a] * 2} and I{'xyz'[b] * 2}"
        yield f"{names} are swapped", f"{names} of {{arm}} are swapped", body(changed)
    steiner = lump.mass * ((com @ com) * np.eye(3) - np.outer(com, com))
    text = "the inertia of {arm} is taken about its frame's origin, not its center of mass"
    yield "the inertia is taken about the frame's origin", text, body(tensor - steiner)
    text = "the inertia of {arm} has Steiner's part twice"
    yield "the inertia has Steiner's part twice", text, body(tensor + steiner)
    for axis in range(3):
        if com[axis] != 0.0:
            moved = com.copy()
            moved[axis] = -moved[axis]
            what = f"{'xyz'[axis]} of the center of mass"
            told = f"({brief(float(moved[axis]))} instead of {brief(float(com[axis]))} m)"
            yield (
                f"{what} has the opposite sign",
                f"{what} of {{arm}} has the opposite sign {told}",
                Lump(lump.mass, moved, tensor),
            )
    for fault, moved in (
        ("is left out", np.zeros(3)),
        ("is millimetres taken for metres", 1e3 * com),
        ("is metres taken for millimetres", 1e-3 * com),
        ("has lost its rotation into the joint's axes", arm_to_joint.T @ com),
    ):
        text = f"the center of mass of {{arm}} {fault}"
        yield f"the center of mass {fault}", text, Lump(lump.mass, moved, tensor)
    yield "the mass is left out", "the mass of {arm} is left out", Lump(0.0, com, tensor)
    yield "the body is left out", "the whole body of {arm} is left out", Lump(0.0, com, 0.0 * tensor)
    yield "the inertia is left out", "the moments of inertia of {arm} are left out", body(0.0 * tensor)
    for factor, units in ((1e6, "kg mm^2 and kg m^2"), (1e-6, "kg m^2 and kg mm^2"), (1e3, "g and kg")):
        text = f"the units {units} are mixed up in the inertia"
        yield text, f"{text} of {{arm}}", body(factor * tensor)
    for factor in (1e3, 1e-3):
        text = "the units g and kg are mixed up in the mass"
        yield text, f"{text} of {{arm}}", Lump(factor * lump.mass, com, tensor)


def _fitted(differences: _Differences, seen: Vector, size: float) -> Look:
    """The one arm whose parameters, changed freely, explain the difference best; which arm, if several can, is open."""
    scale = np.array([_sizes(differences.model, i) for i in range(differences.model.n)])
    fits: list[tuple[float, int, Vector]] = []
    for i, columns in enumerate(differences.columns):
        change = least_squares(columns * scale[i], seen)
        left = float(np.linalg.norm(seen - columns @ (scale[i] * change)))
        if left < EXPLAINED * size:
            fits.append((float(np.linalg.norm(change)), i, scale[i] * change))
    if fits:
        _, i, change = min(fits, key=lambda fit: fit[0])
        leading = np.argsort(-np.abs(change / scale[i]))[:3]
        large = [
            k for k in leading if abs(change[k] / scale[i, k]) > 1e-3 * abs(change[leading[0]] / scale[i, leading[0]])
        ]
        told = listed([f"{PARAMETERS[k]} by {brief(float(change[k]))}" for k in sorted(large)])
        text = f"the inertia of arm_{i + 1} differs (about its frame's origin, {told}, in SI)"
        return Look("inertia", f"arm_{i + 1}", text)
    whole = np.concatenate(list(differences.columns * scale[:, None, :]), axis=1)
    change = least_squares(whole, seen)
    if float(np.linalg.norm(seen - whole @ change)) < EXPLAINED * size:
        weights = np.linalg.norm(change.reshape(-1, 10), axis=1)
        arms = [f"arm_{i + 1}" for i in np.flatnonzero(weights > 1e-3 * weights.max())]
        return Look("inertia", ", ".join(arms), f"the inertias of {listed(arms)} differ")
    return Look("unknown", "robot", "no inertia of any arm explains its mass matrix and gravity")


def least_squares(columns: Vector, seen: Vector) -> Vector:
    """The smallest x that brings columns x nearest to what is seen."""
    return np.asarray(np.linalg.lstsq(columns, seen, rcond=1e-10)[0], dtype=float)


def _sizes(model: Tables, i: int) -> Vector:
    """By what the ten parameters of an arm are made comparable."""
    mass = max((sum(lump.mass for lump in model.lumps[i])), 1e-3)
    length = max(float(np.max(np.abs(model.rows[:, [1, 3]]))), 1e-2)
    return np.array([mass] + [mass * length] * 3 + [mass * length**2] * 6)
