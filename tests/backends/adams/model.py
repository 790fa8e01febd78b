"""What a reader of Adams' files finds, and the machine that it makes: the same for datasets and command files."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field

import numpy as np

multibody = sys.modules["adams_readers.multibody"]
expressions = sys.modules["adams_readers.expressions"]

ALIGNED = 1.0e-9


def body313(angles):
    """Rotation of body-fixed 3-1-3 angles [rad]."""
    a, b, c = angles
    return multibody.about(2, a) @ multibody.about(0, b) @ multibody.about(2, c)


@dataclass
class Marker:
    part: str
    frame: np.ndarray | None  # None: it floats


@dataclass
class Part:
    pose: np.ndarray
    mass: float = 0.0
    center: str | None = None
    moments: tuple = (0.0, 0.0, 0.0)
    integrals: tuple = (0.0, 0.0, 0.0)  # +integral of xy, xz, yz dm: Adams' sign


@dataclass
class Found:
    """A file's content; markers, joints and all else by the names the file uses in references."""

    gravity: tuple = (0.0, 0.0, 0.0)
    parts: dict = field(default_factory=dict)
    ground: str = ""
    markers: dict = field(default_factory=dict)
    joints: dict = field(default_factory=dict)  # name: (kind, i, j)
    initial: dict = field(default_factory=dict)  # name: (displacement, speed)
    motions: dict = field(default_factory=dict)  # name: (joint, kind, function)
    splines: dict = field(default_factory=dict)  # name: (x, y)
    variables: dict = field(default_factory=dict)  # name: function
    forces: dict = field(default_factory=dict)  # name: (kind, i, j, function)
    requests: dict = field(default_factory=dict)  # name: {component: function}
    _fits: dict = field(default_factory=dict)
    _variables: dict = field(default_factory=dict)

    def machine(self):
        """(machine, coordinates as the parts stand)."""
        bodies = {name: self._body(name, part) for name, part in self.parts.items() if name != self.ground}
        links = []
        for name, (kind, i, j) in self.joints.items():
            child, parent = self.markers[i], self.markers[j]
            links.append(multibody.Link(name, kind, parent.part, parent.frame, child.part, child.frame))
        machine = multibody.Machine(bodies, links, self.gravity, self.ground)
        start = np.array([self._displacement(name) for name in machine.names])
        return machine, start

    def _body(self, name, part):
        marker = self.markers[part.center]
        assert marker.part == name, f"center of mass of {name} is on {marker.part}"
        xx, yy, zz = part.moments
        xy, xz, yz = (-value for value in part.integrals)
        rotation = marker.frame[:3, :3]
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return multibody.Body(part.mass, marker.frame[:3, 3], rotation @ tensor @ rotation.T)

    def _displacement(self, name):
        """Where a joint stands; its markers must fit each other as the parts are placed."""
        kind, i, j = self.joints[name]
        i, j = (self.parts[self.markers[m].part].pose @ self.markers[m].frame for m in (i, j))
        between = multibody.inverse(j) @ i
        fits = abs(between[2, 2] - 1.0) < ALIGNED
        if kind == "revolute":
            fits &= np.abs(between[:3, 3]).max() < ALIGNED
            value = np.arctan2(between[1, 0], between[0, 0])
        else:
            fits &= np.abs(between[:2, 3]).max() < ALIGNED and abs(between[0, 0] - 1.0) < ALIGNED
            value = between[2, 3]
        assert fits, f"the markers of joint {name} do not stand on each other"
        return value

    def efforts(self, machine):
        """What acts, as the file says it."""
        out = []
        for kind, i, j, function in self.forces.values():
            expression = expressions.Expression(function)
            out.append(
                multibody.Effort(
                    kind,
                    self.markers[i].part,
                    self.markers[i].frame[:3, 3],
                    self.markers[j].part,
                    self.markers[j].frame,
                    lambda s, e=expression: e(Scope(self, s)),
                    expression.accelerated,
                )
            )
        return out

    def imposed(self, machine):
        """Which coordinates have motions, and those, for `Machine.run`: constants, or splines over the same knots."""
        if not self.motions:
            return None
        rows, x, method = [], (0.0, 1.0, 2.0, 3.0, 4.0), "CUBSPL"
        for joint, kind, function in self.motions.values():
            assert kind == self.joints[joint][0], f"a {kind} motion of a {self.joints[joint][0]} joint"
            match = re.fullmatch(r"(CUBSPL|AKISPL)\(TIME,0,([\w.]+),0\)", function)
            if match:
                method = match[1]
                x, y = self.splines[match[2]]
            rows.append(y if match else float(function.strip("()")))
        values = np.array([np.broadcast_to(row, len(x)) for row in rows])
        fit = self.interpolator(method)(x, values.T)
        places = [machine.names.index(joint) for joint, _, _ in self.motions.values()]
        return places, lambda t: (fit(t), fit(t, 1), fit(t, 2))

    @staticmethod
    def interpolator(method):
        from scipy.interpolate import Akima1DInterpolator, CubicSpline

        return {"CUBSPL": CubicSpline, "AKISPL": Akima1DInterpolator}[method]

    def fit(self, method, name):
        if (method, name) not in self._fits:
            self._fits[method, name] = self.interpolator(method)(*self.splines[name])
        return self._fits[method, name]

    def variable(self, name):
        if name not in self._variables:
            self._variables[name] = expressions.Expression(self.variables[name])
        return self._variables[name]

    def request(self, name, state):
        """Components of a request at a state."""
        return {key: expressions.Expression(f)(Scope(self, state)) for key, f in self.requests[name].items()}


class Scope:
    """What expressions may ask of a state."""

    def __init__(self, found, state):
        self.found, self.state, self.time = found, state, state.t

    def _marker(self, name):
        marker = self.found.markers[name]
        return marker, self.state.pose(marker.part) @ marker.frame

    def function(self, name, arguments):
        if name in ("CUBSPL", "AKISPL"):
            x, _, spline, *order = arguments
            return float(self.found.fit(name, spline)(x(self), int(order[0](self)) if order else 0))
        if name == "VARVAL":
            return self.found.variable(arguments[0])(self)
        assert name not in ("DELAY", "MOTION"), f"{name} has no value at a state alone"
        s = self.state
        (mi, fi), (mj, fj) = self._marker(arguments[0]), self._marker(arguments[1])
        if name == "AZ":
            return float(np.arctan2(fi[:3, 0] @ fj[:3, 1], fi[:3, 0] @ fj[:3, 0]))
        if name in ("PSI", "THETA", "PHI"):
            r = fj[:3, :3].T @ fi[:3, :3]
            angles = {
                "PSI": np.arctan2(r[0, 2], -r[1, 2]),
                "THETA": np.arctan2(np.hypot(r[0, 2], r[1, 2]), r[2, 2]),
                "PHI": np.arctan2(r[2, 0], r[2, 1]),
            }
            return float(angles[name])
        axis = self._marker(arguments[2])[1][:3, "XYZ".index(name[-1])]
        # in whose frame derivatives are taken: the ground's where nothing is said
        seen = self._marker(arguments[3])[0].part if len(arguments) > 3 else None
        w, dw = s.turning(seen) if seen else (np.zeros(3), np.zeros(3))
        if name in ("WZ", "WDTZ"):
            (w_i, dw_i), (w_j, dw_j) = s.turning(mi.part), s.turning(mj.part)
            return float((w_i - w_j if name == "WZ" else dw_i - dw_j - np.cross(w, w_i - w_j)) @ axis)
        (p_i, v_i, a_i), (p_j, v_j, a_j) = (s.point(m.part, m.frame[:3, 3]) for m in (mi, mj))
        r, v, a = p_i - p_j, v_i - v_j, a_i - a_j
        if name in ("DX", "DY", "DZ"):
            return float(r @ axis)
        v = v - np.cross(w, r)
        if name == "VZ":
            return float(v @ axis)
        assert name == "ACCZ"
        return float((a - np.cross(dw, r) - np.cross(w, np.cross(w, r)) - 2.0 * np.cross(w, v)) @ axis)
