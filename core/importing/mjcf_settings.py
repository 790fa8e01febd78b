"""What holds for a whole MJCF file: its includes, the compiler's settings and the default classes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..errors import ModelFileError, Problem
from ..representation import Pose
from .findings import Findings, nearest
from .rotations import about, of_euler, of_quaternion, of_x_and_y, onto_z
from .xml_file import DEEPEST, MOST_ELEMENTS, Element, parse_xml, read_file

MAIN = "main"
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "orientation", "pid", "damper", "cylinder", "muscle",
    "adhesion", "dcmotor", "plugin",
)  # fmt: skip
INCLUDES = 100
"""Most files that one model may include."""


def with_includes(root: Element, path: Path) -> Element:
    """The model with its <include> elements replaced by what the files hold, each file once and inside the folder.

    Raises:
        ModelFileError: A file is missing, outside, included twice, or too much comes together.
    """
    folder = path.parent.resolve()
    # the model itself stands in here too: it may not include itself
    seen = {path.resolve()}
    count = sum(1 for _ in root.walk())

    def expanded(element: Element, depth: int) -> Element:
        nonlocal count
        if depth > DEEPEST:
            raise ModelFileError([Problem("too much is nested; no robot needs it", element.file, element.line)])
        children: list[Element] = []
        for child in element.children:
            if child.tag != "include":
                children.append(expanded(child, depth + 1))
                continue
            name = child.attributes.get("file", "")
            wrong = _unreadable(folder, name, seen)
            if wrong:
                raise ModelFileError([Problem(wrong, child.file, child.line, "file", name)])
            seen.add((folder / name).resolve())
            included = parse_xml(read_file(folder / name, name), name)
            count += sum(1 for _ in included.walk())
            if count > MOST_ELEMENTS or len(seen) > 1 + INCLUDES:
                raise ModelFileError([Problem("too much is included; no robot needs it", child.file, child.line)])
            children.extend(expanded(included, depth).children)
        return replace(element, children=children)

    return expanded(root, 1)


def _unreadable(folder: Path, name: str, seen: set[Path]) -> str | None:
    try:
        target = (folder / name).resolve()
    except (OSError, ValueError, RuntimeError):
        return "is no path of a file"
    if not name or not target.is_relative_to(folder):
        return "is outside of the model's folder; included files must stand in it"
    if target in seen:
        return "is included a second time"
    if not target.is_file():
        return "there is no such file in the model's folder"
    return None


@dataclass(frozen=True, slots=True)
class Compiler:
    """The <compiler> element; attributes as MJCF names them."""

    degree: bool = True
    eulerseq: str = "xyz"
    autolimits: bool = True
    inertiafromgeom: str = "auto"
    inertiagrouprange: tuple[float, float] = (0.0, 5.0)
    settotalmass: float = -1.0
    boundmass: float = 0.0
    boundinertia: float = 0.0
    balanceinertia: bool = False

    def angle(self, value: float) -> float:
        """An angle of the file in radians."""
        return math.radians(value) if self.degree else value


_NO_EFFECT = {
    "alignfree", "assetdir", "conflict", "convexhull", "discardvisual", "exactmeshinertia", "fitaabb", "fusestatic",
    "meshdir", "passthrough", "savecanonical", "savecompiled", "saveinertial", "strippath", "texturedir", "usethread",
}  # fmt: skip


def read_compiler(findings: Findings, root: Element) -> Compiler:
    """The settings of all <compiler> elements, later ones over earlier ones."""
    compiler = Compiler()
    for element in root.all("compiler"):
        for name, text in element.attributes.items():
            match name:
                case "angle":
                    compiler = replace(
                        compiler, degree=_word(findings, element, name, ("degree", "radian")) == "degree"
                    )
                case "autolimits":
                    compiler = replace(compiler, autolimits=_word(findings, element, name) == "true")
                case "balanceinertia":
                    compiler = replace(compiler, balanceinertia=_word(findings, element, name) == "true")
                case "inertiafromgeom":
                    word = _word(findings, element, name, ("false", "true", "auto"))
                    compiler = replace(compiler, inertiafromgeom=word)
                case "settotalmass":
                    compiler = replace(compiler, settotalmass=findings.number(element, name, -1.0))
                case "boundmass":
                    compiler = replace(compiler, boundmass=findings.number(element, name, 0.0, minimum=0.0))
                case "boundinertia":
                    compiler = replace(compiler, boundinertia=findings.number(element, name, 0.0, minimum=0.0))
                case "inertiagrouprange":
                    least, most = findings.numbers(element, name, text, 2, (0.0, 5.0))
                    compiler = replace(compiler, inertiagrouprange=(least, most))
                case "eulerseq":
                    if len(text) == 3 and all(letter in "xyzXYZ" for letter in text):
                        compiler = replace(compiler, eulerseq=text)
                    else:
                        findings.problem("must be three letters of x y z X Y Z", element, name, text)
                case "coordinate":
                    if text != "local":
                        findings.problem(
                            "only local coordinates are read; MuJoCo 2.3.3 or older converts a file by saving it",
                            element, name, text,
                        )  # fmt: skip
                case _:
                    if name not in _NO_EFFECT:
                        findings.remark(f"attribute {name!r} of <compiler> is not known and is left out")
    return compiler


def _word(findings: Findings, element: Element, name: str, choices: tuple[str, ...] = ("false", "true")) -> str:
    return findings.choice(element, name, element.attributes[name], choices) or choices[0]


@dataclass(slots=True)
class Defaults:
    """Default classes: class to element name to attributes. A class starts as a copy of the one that holds it."""

    findings: Findings
    classes: dict[str, dict[str, dict[str, str]]] = field(default_factory=lambda: {MAIN: dict[str, dict[str, str]]()})

    def read(self, root: Element) -> None:
        """All <default> sections of a model."""
        for section in root.all("default"):
            name = section.attributes.get("class", MAIN)
            if name != MAIN:
                self.findings.problem(f"the outermost default class is {MAIN!r}", section, "class", name)
            self._read(section, MAIN)

    def _read(self, section: Element, name: str) -> None:
        settings = self.classes[name]
        for element in section.children:
            if element.tag != "default":
                tag = _shared(element.tag)
                settings[tag] = over(settings.get(tag, {}), element.attributes)
        for nested in section.all("default"):
            inner = nested.attributes.get("class", "")
            if not inner or inner in self.classes:
                self.findings.problem("a nested default needs a class name of its own", nested, "class", inner)
                continue
            self.classes[inner] = {tag: dict(attributes) for tag, attributes in settings.items()}
            self._read(nested, inner)

    def applied(self, element: Element, childclass: str) -> Element:
        """The element with what its class, or else the class of its surroundings, says of such elements."""
        name = self.known(element, "class") or childclass
        inherited = self.classes[name].get(_shared(element.tag), {})
        return replace(element, attributes=over(inherited, element.attributes))

    def known(self, element: Element, attribute: str) -> str:
        """The class that an attribute names, "" where it names none."""
        name = element.attributes.get(attribute, "")
        if name and name not in self.classes:
            self.findings.problem(
                f"there is no such default class; {nearest(name, self.classes)}", element, attribute, name
            )
            return ""
        return name


def _shared(tag: str) -> str:
    """Actuators of all kinds share one set of defaults."""
    return "actuator" if tag in ACTUATORS else tag


def over(inherited: Mapping[str, str], own: Mapping[str, str]) -> dict[str, str]:
    """Attributes over inherited ones; an orientation of one's own replaces one written another way."""
    turned = any(name in own for name in ORIENTATIONS)
    kept = {name: text for name, text in inherited.items() if not (turned and name in ORIENTATIONS)}
    return {**kept, **own}


def orientation(findings: Findings, compiler: Compiler, element: Element) -> Pose:
    """The rotation that an element writes in one of MJCF's five ways."""
    written = [name for name in ORIENTATIONS if name in element.attributes]
    if not written:
        return Pose()
    if len(written) > 1:
        findings.problem(f"more than one orientation: {', '.join(written)}; give one", element)
        return Pose()
    name = written[0]
    text = element.attributes[name]
    rotation: Pose | None = None
    match name:
        case "quat":
            w, x, y, z = findings.numbers(element, name, text, 4, (1.0, 0.0, 0.0, 0.0))
            rotation = of_quaternion((w, x, y, z)) if math.hypot(w, x, y, z) > 1e-10 else None
        case "axisangle":
            x, y, z, angle = findings.numbers(element, name, text, 4, (0.0, 0.0, 1.0, 0.0))
            rotation = about(findings.unit(element, name, (x, y, z)), compiler.angle(angle))
        case "euler":
            first, second, third = (compiler.angle(a) for a in findings.vector(element, name, None))
            rotation = of_euler((first, second, third), compiler.eulerseq)
        case "xyaxes":
            v = findings.numbers(element, name, text, 6, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
            rotation = of_x_and_y((v[0], v[1], v[2]), (v[3], v[4], v[5]))
        case _:
            rotation = onto_z(findings.unit(element, name, findings.vector(element, name, (0.0, 0.0, 1.0))))
    if rotation is None:
        findings.problem("says no orientation", element, name, text)
        return Pose()
    return rotation
