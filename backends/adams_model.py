"""A robot in the words of Adams: parts, markers, joints by the z axes of two markers, forces, splines, requests.

Expressions name markers, splines, variables and motions by tokens, {m12}, {s3}, {v2}, {c4}: the Solver's dataset puts
their numbers there, the View command file their names.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from ..core.representation import Inertia, JointKind, Pose, Shape

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class Marker:
    """A frame on a part.

    Attributes:
        id: Number, unique in the model.
        part, name: Of its part, and its own within it.
        in_part: Where it stands on the part.
        floating: It follows another marker (the reaction point of a force).
    """

    id: int
    part: str
    name: str
    in_part: Pose = Pose()
    floating: bool = False

    @property
    def token(self) -> str:
        """How expressions name it."""
        return f"{{m{self.id}}}"


@dataclass(slots=True)
class Part:
    """A rigid body.

    Attributes:
        id, name: Number and name.
        in_world: Where its frame stands at the start.
        inertia: In its own frame; None on the ground.
        center: Marker at its center of mass, axes parallel to the part's.
        markers: All markers on it.
        shapes: (marker of the shape, shape): what View draws.
    """

    id: int
    name: str
    in_world: Pose = Pose()
    inertia: Inertia | None = None
    center: Marker | None = None
    markers: list[Marker] = field(default_factory=list[Marker])
    shapes: list[tuple[Marker, Shape]] = field(default_factory=list[tuple[Marker, Shape]])


@dataclass(frozen=True, slots=True)
class Joint:
    """A revolute or translational joint: the z axes of i (on the moved part) and j (on the part before) coincide.

    Attributes:
        id, name, kind, i, j: Of the joint.
        initial: Displacement and speed at the start [rad or m, and a second]; None: as the parts stand, at rest.
    """

    id: int
    name: str
    kind: JointKind
    i: Marker
    j: Marker
    initial: tuple[float, float] | None = None

    @property
    def position(self) -> str:
        """Expression of i's displacement from j [rad or m]."""
        i, j = self.i.token, self.j.token
        return f"AZ({i},{j})" if self.kind == "revolute" else f"DZ({i},{j},{j})"

    @property
    def velocity(self) -> str:
        """Expression of the speed [rad/s or m/s]."""
        i, j = self.i.token, self.j.token
        return f"{'WZ' if self.kind == 'revolute' else 'VZ'}({i},{j},{j})"

    @property
    def acceleration(self) -> str:
        """Expression of the acceleration as j sees it [rad/s^2 or m/s^2]."""
        i, j = self.i.token, self.j.token
        return f"{'WDTZ' if self.kind == 'revolute' else 'ACCZ'}({i},{j},{j},{j})"


@dataclass(frozen=True, slots=True)
class Motion:
    """An imposed displacement of a joint, a function of time."""

    id: int
    name: str
    joint: Joint
    function: str


@dataclass(frozen=True, slots=True)
class Spring:
    """A linear spring-damper of a joint: -stiffness (displacement - rest) - damping speed on i, the opposite on j."""

    stiffness: float
    damping: float
    rest: float = 0.0


@dataclass(frozen=True, slots=True)
class Force:
    """A torque about, or a force along, the z axis of a pair of markers: on i, and the opposite on j.

    Attributes:
        id, name: Number and name.
        pair: The markers, as the joint between them, or one that could be there.
        function: Its value on i.
        spring: What View makes of it by itself, where it is linear.
        floating: On j's part, for a force along an axis (the Solver's one-component force acts along the line between
            two markers, which has no direction where they coincide).
    """

    id: int
    name: str
    pair: Joint
    function: str
    spring: Spring | None = None
    floating: Marker | None = None


@dataclass(frozen=True, slots=True)
class Spline:
    """A function of time at knots."""

    id: int
    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Variable:
    """An algebraic variable."""

    id: int
    name: str
    function: str

    @property
    def value(self) -> str:
        """Expression of its value."""
        return f"VARVAL({{v{self.id}}})"


@dataclass(frozen=True, slots=True)
class Request:
    """Up to six functions that are reported: component name to expression."""

    id: int
    name: str
    functions: Mapping[str, str]


@dataclass(slots=True)
class Model:
    """All of a model, in the order in which it is written.

    Attributes:
        name: Safe in View and as an identifier.
        gravity: In the world [m/s^2].
        parts: The ground first.
        joints, motions, splines, variables, forces, requests: What acts between and on them.
    """

    name: str
    gravity: tuple[float, float, float]
    parts: list[Part] = field(default_factory=list[Part])
    joints: list[Joint] = field(default_factory=list[Joint])
    motions: list[Motion] = field(default_factory=list[Motion])
    splines: list[Spline] = field(default_factory=list[Spline])
    variables: list[Variable] = field(default_factory=list[Variable])
    forces: list[Force] = field(default_factory=list[Force])
    requests: list[Request] = field(default_factory=list[Request])
    _markers: int = 0

    def add_part(self, name: str, in_world: Pose | None = None, inertia: Inertia | None = None) -> Part:
        """A new part (on the world's frame where none is given), with a marker at its center of mass."""
        part = Part(len(self.parts) + 1, name, in_world or Pose(), inertia)
        self.parts.append(part)
        if inertia is not None:
            part.center = self.add_marker(part, "cm", Pose(inertia.com))
        return part

    def add_marker(self, part: Part, name: str, in_part: Pose | None = None, *, floating: bool = False) -> Marker:
        """A new marker on a part (on its frame where no place is given)."""
        self._markers += 1
        marker = Marker(self._markers, part.name, name, in_part or Pose(), floating)
        part.markers.append(marker)
        return marker

    def add_force(self, name: str, pair: Joint, function: str, spring: Spring | None = None) -> None:
        """A new force between the markers of a pair."""
        number = len(self.forces) + 1
        floating = None
        if pair.kind == "prismatic":
            part = next(part for part in self.parts if part.name == pair.j.part)
            floating = self.add_marker(part, f"{name}_reaction", floating=True)
        self.forces.append(Force(number, name, pair, function, spring, floating))

    def add_spline(self, name: str, x: tuple[float, ...], y: tuple[float, ...]) -> Spline:
        """A new spline."""
        spline = Spline(len(self.splines) + 1, name, x, y)
        self.splines.append(spline)
        return spline

    def add_variable(self, name: str, function: str) -> Variable:
        """A new variable."""
        variable = Variable(len(self.variables) + 1, name, function)
        self.variables.append(variable)
        return variable

    def add_request(self, name: str, functions: Mapping[str, str]) -> None:
        """A new request."""
        self.requests.append(Request(len(self.requests) + 1, name, functions))

    def numbers(self) -> dict[str, str]:
        """Token to what the Solver's dataset calls it."""
        markers = {f"m{marker.id}": str(marker.id) for part in self.parts for marker in part.markers}
        return markers | {
            f"{letter}{item.id}": str(item.id)
            for letter, items in (("s", self.splines), ("v", self.variables), ("c", self.motions))
            for item in items
        }

    def names(self) -> dict[str, str]:
        """Token to what View calls it."""
        markers = {
            f"m{marker.id}": f".{self.name}.{part.name}.{marker.name}" for part in self.parts for marker in part.markers
        }
        return markers | {
            f"{letter}{item.id}": f".{self.name}.{item.name}"
            for letter, items in (("s", self.splines), ("v", self.variables), ("c", self.motions))
            for item in items
        }


def body313(pose: Pose) -> tuple[float, float, float]:
    """Angles [rad] of R = Rz(a) Rx(b) Rz(c), body-fixed, whose matrix is the pose's rotation to rounding.

    b comes from atan2, a from the third column, and c from what is left once a is taken out, so that no digit is lost
    where b is 0 or pi and only a + c or a - c counts.
    """
    r = pose.rotation
    sine = math.hypot(r[0][2], r[1][2])
    b = math.atan2(sine, r[2][2])
    a = math.atan2(r[0][2], -r[1][2]) if sine > 1.0e-15 else 0.0
    ca, sa = math.cos(a), math.sin(a)
    # first row of Rz(-a) R is (cos c, -sin c, 0), exact at any b
    c = math.atan2(-(ca * r[0][1] + sa * r[1][1]), ca * r[0][0] + sa * r[1][0])
    return a, b, c
