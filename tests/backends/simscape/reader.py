"""A reader of the emitted build function, from the documentation of the class API: MATLAB's statements of that subset.

Units are those that the file says, so a stiffness per degree reads as one.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass, field

import numpy as np

multibody = sys.modules["adams_readers.multibody"]

DEGREE = math.pi / 180.0
UNITS = {
    "m": 1.0, "mm": 1.0e-3, "kg": 1.0, "g": 1.0e-3, "rad": 1.0, "deg": DEGREE, "m/s": 1.0, "rad/s": 1.0, "m/s^2": 1.0,
    "kg*m^2": 1.0, "kg*mm^2": 1.0e-6, "N*m/rad": 1.0, "N*m/deg": 1.0 / DEGREE, "N*m/(rad/s)": 1.0,
    "N*m/(deg/s)": 1.0 / DEGREE, "N/m": 1.0, "N/(m/s)": 1.0,
}  # fmt: skip
NUMBER = r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?"
ARRAY = r"\[[^\]]*\]"


def numbers(text):
    rows = [[float(value) for value in row.split()] for row in text.strip("[]").split(";")]
    return np.array(rows if len(rows) > 1 else rows[0])


def statements(text):
    """Statements without comments and continuations; strings hold neither here."""
    text = re.sub(r"\.\.\.[^\n]*\n\s*", "", re.sub(r"%[^\n]*", "", text))
    return [line.strip() for line in text.splitlines() if line.strip()]


def units_of(text, function):
    """Units that a helper function gives its arguments: argument to factor."""
    body = re.search(rf"function \w+ = {function}\(.*?\n(.*?)\nend", text, re.DOTALL)
    if body is None:
        return {}
    return {name: UNITS[unit] for name, unit in re.findall(r'simscape\.Value\((\w+), "([^"]+)"\)', body[1])}


@dataclass
class Body:
    frames: dict = field(default_factory=lambda: {"reference": np.eye(4)})
    connectors: set = field(default_factory=set)
    mass: multibody.Body | None = None


class Build:
    """What the build function makes."""

    def __init__(self, text):
        self.gravity = None
        self.bodies, self.kinds, self.springs, self.links, self.targets = {}, {}, {}, [], {}
        self.added, self.grounded = set(), False
        units = {name: units_of(text, name) for name in ("place", "solid", "torsional", "axial")}
        main = text[: text.index("\nend\n")]
        # order of the products of inertia in MassDistribution's fourth argument: yz zx xy
        assert re.search(r"MassDistribution\(\s*simscape\.Value\(mass", re.sub(r"\.\.\.\n", "", text))
        for statement in statements(main)[1:]:
            for pattern, handler in self.PATTERNS:
                match = re.fullmatch(pattern, statement)
                if match:
                    handler(self, units, *match.groups())
                    break
            else:
                raise AssertionError(f"cannot read {statement!r}")

    def _multibody(self, units):
        self.gravity = np.array([0.0, 0.0, -9.80665])

    def _gravity(self, units, vector, unit):
        self.gravity = numbers(vector) * UNITS[unit]

    def _world(self, units):
        self.added.add("world")

    def _body(self, units, name):
        self.bodies[name] = Body()

    def _connector(self, units, body, frame):
        assert body not in self.added, "changed after it was added"
        assert frame in self.bodies[body].frames
        self.bodies[body].connectors.add(frame)

    def _frame(self, units, body, name, parent, xyz, rotation):
        assert body not in self.added, "changed after it was added"
        own = self.bodies[body].frames
        assert name not in own
        own[name] = own[parent] @ multibody.frame(numbers(rotation), numbers(xyz) * units["place"]["xyz"])

    def _solid(self, units, body, mass, center, moments, products):
        unit = units["solid"]
        xx, yy, zz = numbers(moments) * unit["moments"]
        yz, xz, xy = numbers(products) * unit["products"]
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        self.bodies[body].mass = multibody.Body(float(mass) * unit["mass"], numbers(center) * unit["center"], tensor)

    def _add(self, units, name, variable):
        assert name == variable
        assert name not in self.added, f"{name} twice"
        self.added.add(name)

    def _joint(self, units, name, kind):
        self.kinds[name] = {"Revolute": "revolute", "Prismatic": "prismatic"}[kind]

    def _law(self, units, name, primitive, function, k, b, rest):
        assert name not in self.added, "changed after it was added"
        kind = {"Rz": "revolute", "Pz": "prismatic"}[primitive]
        assert kind == self.kinds[name] == {"torsional": "revolute", "axial": "prismatic"}[function]
        unit = units[function]
        self.springs[name] = (
            float(k) * unit["stiffness"], float(b) * unit["damping"], float(rest) * unit["rest"]
        )  # fmt: skip

    def _ground(self, units):
        assert {"world", "base"} <= self.added
        self.grounded = True

    def _connect(self, units, joint, base, in_base, follower, in_follower):
        assert {joint, base, follower} <= self.added
        for body, frame in ((base, in_base), (follower, in_follower)):
            assert frame in self.bodies[body].connectors, f"{body}/{frame} has no connector"
        seat, grip = self.bodies[base].frames[in_base], self.bodies[follower].frames[in_follower]
        self.links.append(multibody.Link(joint, self.kinds[joint], base, seat, follower, grip))

    def _start(self, units):
        """No targets yet."""

    def _target(self, units, joint, primitive, letter, number, unit):
        kind = {"Rz": "revolute", "Pz": "prismatic"}[primitive]
        assert self.kinds[joint] == kind
        what = {"q": "position", "p": "position", "w": "speed", "v": "speed"}[letter]
        assert (letter in "qw") == (kind == "revolute")
        self.targets[joint, what] = float(number) * UNITS[unit]

    PATTERNS = (
        (r"robot = simscape\.multibody\.Multibody;", _multibody),
        (rf'robot\.Gravity = simscape\.Value\(({ARRAY}), "([^"]+)"\);', _gravity),
        (r'addComponent\(robot, "world", simscape\.multibody\.WorldFrame\);', _world),
        (r"(\w+) = simscape\.multibody\.RigidBody;", _body),
        (r'addConnector\((\w+), "(\w+)"\);', _connector),
        (rf'addFrame\((\w+), "(\w+)", "(\w+)", place\(({ARRAY}), ({ARRAY})\)\);', _frame),
        (
            rf'addComponent\((\w+), "mass", "reference", solid\(({NUMBER}), ({ARRAY}), ({ARRAY}), ({ARRAY})\)\);',
            _solid,
        ),
        (r'addComponent\(robot, "(\w+)", (\w+)\);', _add),
        (r"(\w+) = simscape\.multibody\.(Revolute|Prismatic)Joint;", _joint),
        (rf"(\w+)\.(Rz|Pz)\.ForceLaws = (torsional|axial)\(({NUMBER}), ({NUMBER}), ({NUMBER})\);", _law),
        (r'connect\(robot, "world/W", "base/reference"\);', _ground),
        (r'connectVia\(robot, "(\w+)", "(\w+)/(\w+)", "(\w+)/(\w+)"\);', _connect),
        (r"start = simscape\.op\.OperatingPoint;", _start),
        (
            r'start\("(\w+)/(Rz|Pz)/(\w)"\) = '
            rf'simscape\.op\.Target\(simscape\.Value\(({NUMBER}), "([^"]+)"\), "High"\);',
            _target,
        ),
    )

    def machine(self):
        """(machine, coordinates of the operating point)."""
        assert self.grounded
        bodies = {name: body.mass for name, body in self.bodies.items() if name != "base"}
        machine = multibody.Machine(bodies, self.links, self.gravity, ground="base")
        return machine, np.array([self.targets[name, "position"] for name in machine.names])

    def efforts(self, machine):
        """The springs' torques, by the coordinates of their joints."""
        out = []
        for link in self.links:
            if link.name not in self.springs:
                continue
            k, b, rest = self.springs[link.name]

            def torque(s, link=link, k=k, b=b, rest=rest):
                between = multibody.inverse(s.pose(link.parent) @ link.in_parent) @ s.pose(link.child) @ link.in_child
                axis = (s.pose(link.parent) @ link.in_parent)[:3, 2]
                if link.kind == "revolute":
                    position = np.arctan2(between[1, 0], between[0, 0])
                    speed = (s.turning(link.child)[0] - s.turning(link.parent)[0]) @ axis
                else:
                    position = between[2, 3]
                    one = s.point(link.child, link.in_child[:3, 3])
                    other = s.point(link.parent, link.in_parent[:3, 3])
                    speed = (one[1] - other[1]) @ axis
                    # the axis turns under the slider
                    speed -= np.cross(s.turning(link.parent)[0], one[0] - other[0]) @ axis
                return -k * (position - rest) - b * speed

            out.append(
                multibody.Effort(link.kind, link.child, link.in_child[:3, 3], link.parent, link.in_parent, torque)
            )
        return out

    def tip(self, state):
        """Tool centre point in the robot's base [m]."""
        tool = next(name for name, body in self.bodies.items() if "tool" in body.frames)
        in_base = multibody.inverse(self.bodies["base"].frames["base"]) @ state.pose(tool)
        return (in_base @ self.bodies[tool].frames["tool"])[:3, 3]
