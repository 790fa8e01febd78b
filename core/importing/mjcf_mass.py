"""Mass properties of MJCF bodies: given by <inertial>, or found from geoms, and the compiler's corrections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ModelFileError, Problem
from ..representation import Inertia, Pose, Vector3
from .bodies import put_together
from .findings import Findings
from .geoms import SIZES, WATER, Solid, placed
from .mjcf_settings import ORIENTATIONS, Compiler, Defaults, orientation
from .model import TreeBody
from .rotations import at, onto_z
from .xml_file import Element

_ZERO: Vector3 = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class Weigher:
    """Finds the mass properties of bodies, one after the other.

    Attributes:
        geoms: How many geoms there were.
        unweighed: Body to why its mass cannot be found.
    """

    findings: Findings
    compiler: Compiler
    defaults: Defaults
    geoms: int = 0
    unweighed: dict[str, list[Problem]] = field(default_factory=dict[str, list[Problem]])

    def weigh(self, name: str, content: Sequence[tuple[Element, Pose, str]]) -> Inertia:
        """Of one body, in its frame.

        Args:
            name: The body's.
            content: Its elements, each with the pose of the <frame> around it and the default class that holds there.
        """
        inertials = [(element, in_body) for element, in_body, _ in content if element.tag == "inertial"]
        geoms = [
            (self.defaults.applied(element, inner), in_body)
            for element, in_body, inner in content
            if element.tag == "geom"
        ]
        self.geoms += len(geoms)
        if len(inertials) > 1:
            self.findings.problem("a second <inertial>", inertials[1][0])
        inertia = self._inertial(*inertials[0]) if inertials else Inertia()
        mode = self.compiler.inertiafromgeom
        if mode == "true" or (mode == "auto" and not inertials):
            least, most = self.compiler.inertiagrouprange
            weighed = [
                (geom, in_body) for geom, in_body in geoms if least <= self.findings.number(geom, "group", 0.0) <= most
            ]
            if weighed:
                inertia = put_together([self._solid(geom, in_body, name) for geom, in_body in weighed])
        return self._corrected(name, inertia)

    def _inertial(self, element: Element, in_body: Pose) -> Inertia:
        findings = self.findings
        place = findings.vector(element, "pos", None)
        mass = findings.number(element, "mass", None, minimum=0.0)
        full, diagonal = element.attributes.get("fullinertia"), element.attributes.get("diaginertia")
        turned = [name for name in ORIENTATIONS if name in element.attributes]
        if full is not None and (turned or diagonal is not None):
            findings.problem(
                f"fullinertia and {(turned or ['diaginertia'])[0]} cannot both stand here", element, "fullinertia", full
            )
        if full is not None:
            xx, yy, zz, xy, xz, yz = findings.numbers(element, "fullinertia", full, 6, (0.0,) * 6)
            return Inertia(mass, _ZERO, xx, yy, zz, xy, xz, yz).moved(in_body @ Pose(place))
        xx, yy, zz = findings.numbers(element, "diaginertia", diagonal, 3, (0.0, 0.0, 0.0))
        pose = in_body @ at(place, orientation(findings, self.compiler, element))
        return Inertia(mass, _ZERO, xx, yy, zz).moved(pose)

    def _solid(self, geom: Element, in_body: Pose, body: str) -> Inertia:
        """Mass properties of a geom in its body."""
        findings = self.findings
        kind = geom.attributes.get("type", "sphere")
        given = geom.attributes.get("mass")
        mass = None if given is None else findings.number(geom, "mass", None, minimum=0.0)
        density = findings.number(geom, "density", WATER, minimum=0.0)
        if mass == 0.0 or (mass is None and density == 0.0):
            return Inertia()
        unweighed = ""
        if "mesh" in geom.attributes or kind in {"mesh", "sdf", "hfield", "plane"}:
            unweighed = f"the mass of body {body!r} cannot be found from a {kind}"
        elif geom.attributes.get("shellinertia") == "true":
            unweighed = f"the mass of body {body!r} cannot be found from a shell"
        if unweighed:
            cure = 'give the body an <inertial>, or the geom mass="0"'
            problem = Problem(f"{unweighed}; {cure}", geom.file, geom.line)
            self.unweighed.setdefault(body, []).append(problem)
            return Inertia()
        if findings.choice(geom, "type", kind, tuple(SIZES)) is None:
            return Inertia()
        given_size = geom.attributes.get("size")
        size = findings.numbers(geom, "size", given_size, (1, 3), None, minimum=0.0)
        if given_size is None:
            return Inertia()
        fromto = geom.attributes.get("fromto")
        if fromto is None or kind == "sphere":
            pose = at(findings.vector(geom, "pos", _ZERO), orientation(findings, self.compiler, geom))
        else:
            v = np.array(findings.numbers(geom, "fromto", fromto, 6, (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)))
            along = v[3:] - v[:3]
            half = 0.5 * float(np.linalg.norm(along))
            x, y, z = (float(c) for c in 0.5 * (v[3:] + v[:3]))
            direction = findings.unit(geom, "fromto", (float(along[0]), float(along[1]), float(along[2])))
            pose = at((x, y, z), onto_z(direction))
            size = (size[0], half) if SIZES[kind] == 2 else (size[0], size[0], half)
        wanted = SIZES[kind]
        if len(size) < wanted or not all(length > 0.0 for length in size[:wanted]):
            findings.problem(f"a {kind} needs {wanted} lengths above 0", geom, "size", given_size)
            return Inertia()
        return placed(Solid(kind, size[:wanted]), mass, density, in_body @ pose)

    def _corrected(self, name: str, inertia: Inertia) -> Inertia:
        """After boundmass, boundinertia and balanceinertia, which act on the principal moments."""
        compiler = self.compiler
        moments, in_body = inertia.principal()
        new = tuple(max(moment, compiler.boundinertia) if compiler.boundinertia else moment for moment in moments)
        if compiler.balanceinertia and new[0] + new[1] < new[2]:
            new = (sum(new) / 3.0,) * 3
        mass = max(inertia.mass, compiler.boundmass)
        if mass == inertia.mass and new == moments:
            return inertia
        self.findings.remark(
            f"body {name!r}: the file's compiler settings change its mass {inertia.mass!r} -> {mass!r} kg and its "
            f"principal moments {list(moments)!r} -> {list(new)!r} kg m^2"
        )
        return Inertia(mass, _ZERO, new[0], new[1], new[2]).moved(in_body)

    def scaled(self, bodies: Mapping[str, TreeBody]) -> Mapping[str, TreeBody]:
        """All bodies, scaled to the total mass that the file asks for."""
        wanted = self.compiler.settotalmass
        total = sum(body.inertia.mass for body in bodies.values() if body.inertia)
        if wanted <= 0.0 or total <= 0.0:
            return bodies
        if self.unweighed:
            raise ModelFileError([problem for problems in self.unweighed.values() for problem in problems])
        factor = wanted / total
        self.findings.remark(f"settotalmass: all masses and inertias are multiplied by {factor!r}")
        return {
            name: body if body.inertia is None else replace(body, inertia=_scaled(body.inertia, factor))
            for name, body in bodies.items()
        }


def _scaled(body: Inertia, factor: float) -> Inertia:
    return Inertia.from_tensor(factor * body.mass, np.array(body.com), factor * body.tensor())
