"""Reading URDF (the format of http://wiki.ros.org/urdf/XML)."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

from ..representation import Inertia, Pose, Vector3
from .findings import Findings, listing, nearest
from .model import Model, TreeBody, TreeJoint
from .rotations import at, of_quaternion
from .xml_file import Element

GRAVITY: Vector3 = (0.0, 0.0, -9.81)
TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_KNOWN = {
    "robot": {"link", "joint", "material", "transmission", "gazebo"},
    "link": {"inertial", "visual", "collision"},
    "joint": {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "safety_controller", "calibration"},
}
_IDENTITY_AXIS: Vector3 = (1.0, 0.0, 0.0)
_ZERO: Vector3 = (0.0, 0.0, 0.0)


def read_urdf(robot: Element) -> Model:
    """The model of a <robot> element.

    Raises:
        ModelFileError: All that is wrong with it.
    """
    findings = Findings()
    if any(element.tag.startswith("xacro:") for element in robot.walk()):
        macro = next(element for element in robot.walk() if element.tag.startswith("xacro:"))
        findings.problem(f"<{macro.tag}> is a macro; run xacro on the file and import what it writes", macro)
        findings.stop()
    links = _named(findings, robot, "link")
    joints = _named(findings, robot, "joint")
    if not links:
        findings.problem("<robot> holds no <link>", robot)
    bodies = {name: TreeBody(name, None, inertia=_inertial(findings, link)) for name, link in links.items()}
    mimics: dict[str, str] = {}
    placed: dict[str, Element] = {}
    for name, joint in joints.items():
        parent, child = _end(findings, joint, "parent", bodies), _end(findings, joint, "child", bodies)
        if parent is None or child is None:
            continue
        if child in placed:
            other = placed[child].attributes["name"]
            findings.problem(f"link {child!r} hangs on two joints, {other!r} and {name!r}; a link has one", joint)
            continue
        placed[child] = joint
        origin = _origin(findings, findings.single(joint, "origin"))
        bodies[child] = _hung(findings, joint, replace(bodies[child], parent=parent, in_parent=origin))
        mimic = findings.single(joint, "mimic")
        if mimic is not None:
            factor, offset = findings.number(mimic, "multiplier", 1.0), findings.number(mimic, "offset", 0.0)
            mimics[name] = f"{factor!r} * {mimic.attributes.get('joint', '?')} + {offset!r}"
    ordered = _parents_first(findings, robot, bodies, placed) if links and not findings.problems else {}
    findings.stop()
    _remarks(findings, robot)
    findings.remark(f"URDF has no gravity; {list(GRAVITY)!r} m/s^2 is taken")
    return Model("URDF", robot.attributes.get("name", ""), GRAVITY, ordered, {}, findings, mimics)


def _named(findings: Findings, robot: Element, tag: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in robot.all(tag):
        name = element.attributes.get("name")
        if not name:
            findings.problem(f"<{tag}> needs a name", element)
        elif name in found:
            findings.problem(
                f"a second {tag} of this name; the first stands in line {found[name].line}", element, "name", name
            )
        else:
            found[name] = element
    return found


def _end(findings: Findings, joint: Element, tag: str, bodies: dict[str, TreeBody]) -> str | None:
    """Name of the joint's parent or child link."""
    end = findings.single(joint, tag)
    if end is None:
        findings.problem(f"joint {joint.attributes['name']!r} has no <{tag}>", joint)
        return None
    link = end.attributes.get("link", "")
    if link not in bodies:
        findings.problem(f"there is no such link; {nearest(link, bodies)}", end, "link", link)
        return None
    return link


def _origin(findings: Findings, origin: Element | None) -> Pose:
    if origin is None:
        return Pose()
    xyz = findings.vector(origin, "xyz", _ZERO)
    if "quat_xyzw" in origin.attributes:
        x, y, z, w = findings.numbers(origin, "quat_xyzw", origin.attributes["quat_xyzw"], 4, (0.0, 0.0, 0.0, 1.0))
        if math.hypot(x, y, z, w) < 1e-10:
            findings.problem("has no direction", origin, "quat_xyzw", origin.attributes["quat_xyzw"])
            return Pose()
        return at(xyz, of_quaternion((w, x, y, z)))
    return Pose.from_rpy(xyz, findings.vector(origin, "rpy", _ZERO))


def _inertial(findings: Findings, link: Element) -> Inertia | None:
    inertial = findings.single(link, "inertial")
    if inertial is None:
        return None
    in_link = _origin(findings, findings.single(inertial, "origin"))
    mass_element, inertia = findings.single(inertial, "mass"), findings.single(inertial, "inertia")
    for tag, element in (("mass", mass_element), ("inertia", inertia)):
        if element is None:
            findings.problem(f"<inertial> of link {link.attributes['name']!r} has no <{tag}>", inertial)
    mass = findings.number(mass_element, "value", None, minimum=0.0)
    xx, yy, zz, xy, xz, yz = (
        findings.number(inertia, name, None) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    return Inertia(mass, _ZERO, xx, yy, zz, xy, xz, yz).moved(in_link)


def _hung(findings: Findings, joint: Element, body: TreeBody) -> TreeBody:
    """The body on its joint."""
    kind = findings.choice(joint, "type", joint.attributes.get("type", ""), TYPES)
    if kind is None or kind == "fixed":
        return body
    if kind in {"floating", "planar"}:
        return replace(body, loose=kind)
    name = joint.attributes["name"]
    axis_element = findings.single(joint, "axis")
    axis = _IDENTITY_AXIS
    if axis_element is not None:
        axis = findings.unit(axis_element, "xyz", findings.vector(axis_element, "xyz", _IDENTITY_AXIS))
    dynamics = findings.single(joint, "dynamics")
    lower, upper, velocity, effort = _limits(findings, joint, kind)
    return replace(
        body,
        joints=(
            TreeJoint(
                name,
                "prismatic" if kind == "prismatic" else "revolute",
                axis=axis,
                lower=lower,
                upper=upper,
                velocity=velocity,
                effort=effort,
                damping=findings.number(dynamics, "damping", 0.0, minimum=0.0),
                friction=findings.number(dynamics, "friction", 0.0, minimum=0.0),
            ),
        ),
    )


def _limits(findings: Findings, joint: Element, kind: str) -> tuple[float, float, float, float]:
    """Lower, upper, velocity, effort, as URDF reads them: a missing lower or upper is 0."""
    name = joint.attributes["name"]
    limit = findings.single(joint, "limit")
    if limit is None:
        if kind != "continuous":
            findings.remark(f"joint {name!r} is {kind} without <limit>, which URDF asks for; it is taken as unlimited")
        return -math.inf, math.inf, math.inf, math.inf
    if kind == "continuous":
        lower, upper = -math.inf, math.inf
    else:
        lower, upper = (findings.number(limit, side, 0.0, infinite=True) for side in ("lower", "upper"))
        if lower > upper or lower == math.inf or upper == -math.inf:
            findings.problem(f"lower {lower!r} is above upper {upper!r}", limit)
        elif lower == upper:
            findings.remark(f"joint {name!r} cannot move: its limits are {lower!r} and {upper!r} (a missing one is 0)")
    greatest: list[float] = []
    for what in ("velocity", "effort"):
        value = findings.number(limit, what, math.inf, minimum=0.0, infinite=True)
        if what not in limit.attributes:
            findings.remark(f"joint {name!r} states no {what} limit, which URDF asks for; it is taken as unlimited")
        elif value == 0.0:
            findings.remark(
                f"the {what} limit of joint {name!r} is 0, so to URDF it does nothing; it is taken as unlimited"
            )
            value = math.inf
        greatest.append(value)
    return lower, upper, greatest[0], greatest[1]


def _parents_first(
    findings: Findings, robot: Element, bodies: dict[str, TreeBody], placed: dict[str, Element]
) -> dict[str, TreeBody]:
    """The bodies from the root outwards; two roots or a loop are faults."""
    roots = [name for name in bodies if name not in placed]
    if len(roots) > 1:
        findings.problem(
            f"{len(roots)} links hang on no joint: {listing(roots)}; a robot has one root; join them by fixed joints",
            robot,
        )
        return {}
    children: dict[str, list[str]] = {name: [] for name in bodies}
    for body in bodies.values():
        if body.parent is not None:
            children[body.parent].append(body.name)
    ordered: dict[str, TreeBody] = {}
    waiting = list(reversed(roots))
    while waiting:
        name = waiting.pop()
        ordered[name] = bodies[name]
        waiting.extend(reversed(children[name]))
    looped = [name for name in bodies if name not in ordered]
    if looped:
        findings.problem(
            f"joints form a loop through links {listing(looped)}; a serial chain has none", placed[looped[0]]
        )
    return ordered


def _remarks(findings: Findings, robot: Element) -> None:
    """What the file says and a database cannot."""
    shapes: Counter[str] = Counter()
    for link in robot.all("link"):
        for shape in link.all("visual", "collision"):
            shapes[shape.tag] += 1
    for tag in ("visual", "collision"):
        if shapes[tag]:
            findings.remark(f"{shapes[tag]} <{tag}> shapes are left out")
    for joint in robot.all("joint"):
        shapes.update(child.tag for child in joint.children)
    for tag in ("safety_controller", "calibration"):
        if shapes[tag]:
            findings.remark(f"<{tag}> of {shapes[tag]} joints is left out")
    transmissions = [element.attributes.get("name", "?") for element in robot.all("transmission")]
    if transmissions:
        findings.remark(f"transmissions are left out: {listing(transmissions)}")
    if robot.first("gazebo") is not None:
        findings.remark("<gazebo> elements are left out")
    unknown: Counter[str] = Counter()
    for element in (robot, *robot.all("link"), *robot.all("joint")):
        for child in element.children:
            if child.tag not in _KNOWN[element.tag]:
                unknown[f"<{child.tag}> in <{element.tag}>"] += 1
    for what, count in sorted(unknown.items()):
        findings.remark(
            f"{what} is no URDF and is left out ({count} times)" if count > 1 else f"{what} is no URDF and is left out"
        )
    odd = Counter(
        f"attribute {name!r} of <dynamics>"
        for joint in robot.all("joint")
        for dynamics in joint.all("dynamics")
        for name in dynamics.attributes
        if name not in {"damping", "friction"}
    )
    for what in sorted(odd):
        findings.remark(f"{what} is no URDF and is left out")
