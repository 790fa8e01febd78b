"""What both formats say, in one form: a tree of bodies whose joints have one degree of freedom each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..database.database import home_within
from ..errors import Problem
from ..representation import Inertia, JointKind, Pose, Vector3
from .findings import Findings
from .rotations import about, at


@dataclass(frozen=True, slots=True)
class TreeJoint:
    """One degree of freedom of a body against its parent, or against the body's joint before it.

    Attributes:
        name: As in the file.
        kind: "revolute" or "prismatic".
        origin: A point of the axis in the body's frame [m].
        axis: Unit vector in the body's frame.
        reference: Value of the joint's variable at which the body stands at its `in_parent` [rad or m].
        lower, upper, velocity, effort: Limits in the database's sense, infinite where there are none.
        rotor_inertia: [kg m^2 or kg].
        damping: Viscous coefficient [N m s/rad or N s/m].
        friction: Coulomb level [N m or N].
        stiffness, rest: Spring on the joint [N m/rad or N/m], [rad or m].
    """

    name: str
    kind: JointKind
    origin: Vector3 = (0.0, 0.0, 0.0)
    axis: Vector3 = (0.0, 0.0, 1.0)
    reference: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    effort: float = math.inf
    rotor_inertia: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0

    @property
    def home(self) -> float:
        """Where the joint stands by itself: the file's own pose, or the database's rule where that is outside."""
        if self.lower <= self.reference <= self.upper:
            return self.reference
        return home_within(self.lower, self.upper)

    def motion(self, variable: float) -> Pose:
        """Body at that value of the variable in the body where the file puts it."""
        return _motion(self.kind, self.origin, self.axis, variable - self.reference)


@dataclass(frozen=True, slots=True)
class TreeBody:
    """A body of the tree.

    Attributes:
        name: As in the file.
        parent: Name of its parent; None for the root.
        in_parent: Its pose in the parent with all its joints at their references.
        joints: From the parent outwards; none: fixed.
        inertia: In its own frame; None where the file gives none.
        loose: What kind of joint it hangs on, where that is none of one degree of freedom ("floating", "ball").
    """

    name: str
    parent: str | None
    in_parent: Pose = Pose()
    joints: tuple[TreeJoint, ...] = ()
    inertia: Inertia | None = None
    loose: str = ""


@dataclass(frozen=True, slots=True)
class Model:
    """A robot description as read.

    Attributes:
        format: "URDF" or "MJCF".
        name: The model's name in the file, "" where it has none.
        gravity: [m/s^2].
        bodies: Name to body, parents before their children; the first one is the root, which does not move.
        frames: Name to body and pose on it: marked places (sites) that can be a tip too.
        findings: What was noted while reading.
        mimics: Joint to the joint it must follow, in words.
        unweighed: Body to why its mass cannot be found; that matters only where the body is part of the chain.
    """

    format: str
    name: str
    gravity: Vector3
    bodies: Mapping[str, TreeBody]
    frames: Mapping[str, tuple[str, Pose]]
    findings: Findings
    mimics: Mapping[str, str] = field(default_factory=dict[str, str])
    unweighed: Mapping[str, Sequence[Problem]] = field(default_factory=dict[str, Sequence[Problem]])

    @property
    def root(self) -> str:
        """Name of the body that does not move."""
        return next(iter(self.bodies))

    def children(self) -> dict[str, list[str]]:
        """Body to the bodies that hang on it, in the file's order."""
        found: dict[str, list[str]] = {name: [] for name in self.bodies}
        for body in self.bodies.values():
            if body.parent is not None:
                found[body.parent].append(body.name)
        return found


def _motion(kind: JointKind, origin: Vector3, axis: Vector3, variable: float) -> Pose:
    """Displacement along or about a line."""
    if kind == "prismatic":
        x, y, z = axis
        return Pose((variable * x, variable * y, variable * z))
    rotation = about(axis, variable)
    point = np.array(origin)
    x, y, z = (float(c) for c in point - rotation.rotation_matrix() @ point)
    return at((x, y, z), rotation)
