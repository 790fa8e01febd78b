"""Reading MJCF, MuJoCo's format (https://mujoco.readthedocs.io, XML reference)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..representation import Pose, Vector3
from .findings import Findings, listing, nearest
from .mjcf_mass import Weigher
from .mjcf_settings import (
    ACTUATORS,
    MAIN,
    ORIENTATIONS,
    Compiler,
    Defaults,
    orientation,
    read_compiler,
    with_includes,
)
from .model import Model, TreeBody, TreeJoint
from .rotations import at
from .xml_file import Element

WORLD = "world"
GRAVITY: Vector3 = (0.0, 0.0, -9.81)
_ZERO: Vector3 = (0.0, 0.0, 0.0)
_LOOSE = {"ball": "ball", "free": "free"}
_UNREAD = {
    "replicate": "repeats its content",
    "attach": "brings in another model",
    "composite": "makes many bodies",
    "flexcomp": "makes a deformable body",
}
_SILENT = {
    # what neither moves nor weighs anything
    "body": {"name", "childclass", "pos", "user", "mocap", "simple", "sleep", *ORIENTATIONS},
    "inertial": {"pos", "mass", "diaginertia", "fullinertia", *ORIENTATIONS},
    "joint": {
        "name", "class", "group", "type", "pos", "axis", "range", "limited", "ref", "springref", "stiffness", "damping",
        "frictionloss", "armature", "actuatorfrcrange", "actuatorfrclimited", "margin", "user", "solimpfriction",
        "solimplimit", "solreffriction", "solreflimit",
    },
}  # fmt: skip


def read_mjcf(root: Element, path: Path) -> Model:
    """The model of a <mujoco> element.

    Args:
        root: The element.
        path: The file it comes from; what it includes must stand in that file's folder.

    Raises:
        ModelFileError: All that is wrong with it.
    """
    root = with_includes(root, path)
    findings = Findings()
    compiler = read_compiler(findings, root)
    defaults = Defaults(findings)
    defaults.read(root)
    weigher = Weigher(findings, compiler, defaults)
    reader = _Reader(findings, compiler, defaults, weigher)
    reader.read_options(root)
    reader.read_actuators(root)
    worlds = list(root.all("worldbody"))
    if not any(world.children for world in worlds):
        findings.problem("<mujoco> holds no body in a <worldbody>", root)
    reader.bodies[WORLD] = TreeBody(WORLD, None)
    for world in worlds:
        reader.read_children(world, WORLD, MAIN)
    reader.check_actuated()
    findings.stop()
    bodies = weigher.scaled(reader.bodies)
    _remarks(findings, root, weigher.geoms)
    return Model(
        "MJCF",
        root.attributes.get("model", ""),
        reader.gravity,
        bodies,
        reader.frames,
        findings,
        unweighed=weigher.unweighed,
    )


@dataclass(slots=True)
class _Reader:
    """Walks the bodies.

    Attributes:
        gravity: [m/s^2].
        bodies: Name to body as read so far.
        frames: Name of a site to its body and its pose there.
        joints: Names of joints so far.
        driven: Joint to the rotor inertia and the damping of its actuators, and where the first one stands.
        unsprung, undamped, frictionless: Switched off by an <option><flag>.
        unnamed: Counts of what has no name.
    """

    findings: Findings
    compiler: Compiler
    defaults: Defaults
    weigher: Weigher
    gravity: Vector3 = GRAVITY
    bodies: dict[str, TreeBody] = field(default_factory=dict[str, TreeBody])
    frames: dict[str, tuple[str, Pose]] = field(default_factory=dict[str, tuple[str, Pose]])
    joints: set[str] = field(default_factory=set[str])
    driven: dict[str, tuple[float, float, Element]] = field(default_factory=dict[str, tuple[float, float, Element]])
    unsprung: bool = False
    undamped: bool = False
    frictionless: bool = False
    unnamed: Counter[str] = field(default_factory=Counter[str])

    def read_options(self, root: Element) -> None:
        """Gravity, and what is switched off."""
        for option in root.all("option"):
            if "gravity" in option.attributes:
                self.gravity = self.findings.vector(option, "gravity", GRAVITY)
            for name in ("density", "viscosity"):
                if self.findings.number(option, name, 0.0):
                    self.findings.remark(f"the surrounding medium ({name} {option.attributes[name]}) is left out")
        for option in root.all("option"):
            for flag in option.all("flag"):
                off = {name for name, text in flag.attributes.items() if text == "disable"}
                if "gravity" in off:
                    self.gravity = _ZERO
                self.unsprung |= bool(off & {"spring", "passive"})
                self.undamped |= bool(off & {"damper", "passive"})
                self.frictionless |= bool(off & {"frictionloss", "constraint"})
                for name in sorted(off & {"gravity", "spring", "damper", "passive", "frictionloss", "constraint"}):
                    self.findings.remark(f"{name} is switched off in the file, so it is left out")

    def read_actuators(self, root: Element) -> None:
        """Rotor inertia and damping that actuators bring to a joint: gear^2 times theirs."""
        names: list[str] = []
        for section in root.all("actuator"):
            for element in section.all(*ACTUATORS):
                actuator = self.defaults.applied(element, MAIN)
                joint = actuator.attributes.get("joint") or actuator.attributes.get("jointinparent")
                names.append(actuator.attributes.get("name") or f"of {joint or 'no joint'}")
                armature = self.findings.number(actuator, "armature", 0.0, minimum=0.0)
                damping = self._first(actuator, "damping")
                gear = self.findings.numbers(actuator, "gear", actuator.attributes.get("gear"), (1, 6), (1.0,))[0]
                if joint and (armature or damping):
                    j, c, where = self.driven.get(joint, (0.0, 0.0, actuator))
                    self.driven[joint] = (j + gear**2 * armature, c + gear**2 * damping, where)
                elif armature or damping:
                    self.findings.remark(
                        f"armature and damping of actuator {names[-1]!r} are left out: it drives no joint"
                    )
        if names:
            self.findings.remark(
                f"actuators are left out, save the armature and damping they bring to joints: {listing(names)}"
            )

    def check_actuated(self) -> None:
        """Actuators of joints that are not there are faults."""
        for joint, (_, _, where) in self.driven.items():
            if joint not in self.joints:
                self.findings.problem(f"there is no such joint; {nearest(joint, self.joints)}", where, "joint", joint)

    def read_children(self, holder: Element, body: str, childclass: str) -> None:
        """The bodies and sites in a body."""
        for element, in_body, inner in self._content(holder, Pose(), childclass):
            if element.tag == "body":
                self._read_body(element, body, in_body, inner)
            elif element.tag == "site":
                site = self.defaults.applied(element, inner)
                name = site.attributes.get("name")
                if name and "fromto" not in site.attributes:
                    if name in self.frames:
                        self.findings.problem("a second site of this name", element, "name", name)
                    self.frames[name] = (body, in_body @ self._pose(site))
            elif element.tag in _UNREAD and body == WORLD and element.tag != "attach":
                self.findings.remark(f"<{element.tag}> in the world is left out")
            elif element.tag in _UNREAD:
                self.findings.problem(
                    f"<{element.tag}> {_UNREAD[element.tag]} and is not read; let MuJoCo save the compiled model "
                    "(mj_saveLastXML) and import that",
                    element,
                )

    def _content(self, holder: Element, in_body: Pose, childclass: str) -> Iterator[tuple[Element, Pose, str]]:
        """What stands in a body, with the pose and the default class that the <frame> around it gives it."""
        for element in holder.children:
            if element.tag == "frame":
                inner = self.defaults.known(element, "childclass") or childclass
                yield from self._content(element, in_body @ self._pose(element), inner)
            else:
                yield element, in_body, childclass

    def _pose(self, element: Element) -> Pose:
        return at(self.findings.vector(element, "pos", _ZERO), orientation(self.findings, self.compiler, element))

    def _name(self, element: Element, tag: str) -> str:
        name = element.attributes.get("name", "")
        if not name:
            self.unnamed[tag] += 1
            name = f"unnamed {tag} {self.unnamed[tag]}"
        return name

    def _first(self, element: Element, name: str) -> float:
        """The linear coefficient of a polynomial; what is beyond it cannot be said."""
        values = self.findings.numbers(element, name, element.attributes.get(name), (1, 3), (0.0,), minimum=0.0)
        if any(values[1:]):
            self.findings.remark(
                f"{name} of {element.attributes.get('name') or element.tag!r} is a polynomial; "
                f"only its first coefficient, {values[0]!r}, is taken"
            )
        return values[0]

    def _read_body(self, element: Element, parent: str, in_parent: Pose, childclass: str) -> None:
        inner = self.defaults.known(element, "childclass") or childclass
        name = self._name(element, "body")
        if name in self.bodies:
            self.findings.problem("a second body of this name", element, "name", name)
            return
        content = list(self._content(element, Pose(), inner))
        joints: list[TreeJoint] = []
        loose = ""
        for child, in_body, own in content:
            if child.tag == "freejoint":
                loose = "free"
            elif child.tag == "inertial":
                self._unknown(child, "inertial")
            elif child.tag == "joint":
                joint = self._read_joint(self.defaults.applied(child, own), in_body)
                if isinstance(joint, TreeJoint):
                    joints.append(joint)
                else:
                    loose = joint
        gravcomp = self.findings.number(element, "gravcomp", 0.0)
        if gravcomp:
            self.findings.remark(f"gravity compensation of body {name!r} (gravcomp {gravcomp!r}) is left out")
        self._unknown(element, "body", {"gravcomp"})
        self.bodies[name] = TreeBody(
            name,
            parent,
            in_parent @ self._pose(element),
            tuple(joints),
            inertia=self.weigher.weigh(name, content),
            loose=loose,
        )
        self.read_children(element, name, inner)

    def _unknown(self, element: Element, tag: str, more: set[str] | None = None) -> None:
        for name in sorted(set(element.attributes) - _SILENT[tag] - (more or set())):
            self.findings.remark(f"attribute {name!r} of <{tag}> {self._label(element)}is left out")

    def _label(self, element: Element) -> str:
        name = element.attributes.get("name")
        return f"{name!r} " if name else ""

    def _read_joint(self, joint: Element, in_body: Pose) -> TreeJoint | str:
        findings, compiler = self.findings, self.compiler
        name = self._name(joint, "joint")
        if name in self.joints:
            findings.problem("a second joint of this name", joint, "name", name)
        self.joints.add(name)
        kind = findings.choice(joint, "type", joint.attributes.get("type", "hinge"), ("hinge", "slide", "ball", "free"))
        if kind is None or kind in _LOOSE:
            return _LOOSE.get(kind or "", "")
        self._unknown(joint, "joint")

        def angle(value: float) -> float:
            return compiler.angle(value) if kind == "hinge" else value

        axis = findings.unit(joint, "axis", findings.vector(joint, "axis", (0.0, 0.0, 1.0)))
        lower, upper = (angle(limit) for limit in self._range(joint, "range", "limited"))
        least, most = self._range(joint, "actuatorfrcrange", "actuatorfrclimited")
        if -least != most:
            findings.remark(
                f"joint {name!r} may be driven by {least!r} to {most!r}; the effort limit is the larger magnitude"
            )
        rotor, damping, _ = self.driven.get(name, (0.0, 0.0, joint))
        rotor += findings.number(joint, "armature", 0.0, minimum=0.0)
        damping += self._first(joint, "damping")
        friction = findings.number(joint, "frictionloss", 0.0, minimum=0.0)
        stiffness = self._first(joint, "stiffness")
        effort = max(abs(least), abs(most))
        if effort == 0.0:
            findings.remark(f"the effort limit of joint {name!r} is 0, so it does nothing; it is taken as unlimited")
            effort = math.inf
        return TreeJoint(
            name,
            "revolute" if kind == "hinge" else "prismatic",
            origin=_vector(in_body, findings.vector(joint, "pos", _ZERO), shifted=True),
            axis=_vector(in_body, axis, shifted=False),
            reference=angle(findings.number(joint, "ref", 0.0)),
            lower=lower,
            upper=upper,
            effort=effort,
            rotor_inertia=rotor,
            damping=0.0 if self.undamped else damping,
            friction=0.0 if self.frictionless else friction,
            stiffness=0.0 if self.unsprung else stiffness,
            rest=angle(findings.number(joint, "springref", 0.0)),
        )

    def _range(self, joint: Element, name: str, switch: str) -> tuple[float, float]:
        """A range in the file's units; infinite where it is missing or switched off."""
        limited = self.findings.choice(joint, switch, joint.attributes.get(switch, "auto"), ("false", "true", "auto"))
        text = joint.attributes.get(name)
        if text is not None and limited == "auto" and not self.compiler.autolimits:
            self.findings.problem(f"{name} without {switch}, which autolimits=false asks for", joint, name, text)
        if limited == "true" and text is None:
            self.findings.problem(f"{switch} without {name}", joint)
        if text is None or limited == "false":
            return -math.inf, math.inf
        lower, upper = self.findings.numbers(joint, name, text, 2, (-1.0, 1.0))
        if lower >= upper:
            self.findings.problem("the first number must be below the second", joint, name, text)
        return lower, upper


def _vector(in_body: Pose, vector: Vector3, *, shifted: bool) -> Vector3:
    """A point (shifted) or a direction of a <frame> in its body; untouched where there is no frame."""
    if in_body == Pose():
        return vector
    moved = in_body.rotation_matrix() @ np.array(vector)
    x, y, z = (float(c) for c in (moved + np.array(in_body.xyz) if shifted else moved))
    return (x, y, z)


def _remarks(findings: Findings, root: Element, geoms: int) -> None:
    """What the file says and a database cannot."""
    if geoms:
        findings.remark(f"{geoms} geoms are left out as shapes")
    counts: Counter[str] = Counter()
    for tag in ("equality", "tendon", "contact", "sensor", "keyframe", "deformable", "extension"):
        for section in root.all(tag):
            counts[tag] += len(section.children)
    for tag, count in counts.items():
        if not count:
            continue
        acts = " although they act on the motion" if tag in {"equality", "tendon", "deformable"} else ""
        findings.remark(f"{count} entries of <{tag}> are left out{acts}")
    for body in root.walk():
        if body.tag == "body" and body.first("plugin") is not None:
            findings.remark(f"plugins of body {body.attributes.get('name', '?')!r} are left out")
    known = {
        "compiler", "option", "size", "statistic", "visual", "default", "custom", "asset", "worldbody", "actuator",
        "equality", "tendon", "contact", "sensor", "keyframe", "deformable", "extension",
    }  # fmt: skip
    for child in root.children:
        if child.tag not in known:
            findings.remark(f"<{child.tag}> is no MJCF and is left out")
