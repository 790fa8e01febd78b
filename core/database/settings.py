"""`robot.yaml`: everything of a database that is no table."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, cast

from ..representation import MESH_SUFFIXES, FrictionModel, Vector3, is_label, is_mesh_path, is_name
from .database import STANDARD_GRAVITY, Placement, Tolerance, Visual
from .problems import Problems, listed, nearest
from .rows import read_number
from .yaml_tree import Entries, Items, Node, Scalar

RESERVED_LEVELS = ("custom", "full", "rigid")
LONGEST_TEXT = 20_000
# a mesh larger than this is no picture of a robot's arm
LARGEST_MESH = 256 * 2**20

_TEXT = re.compile(r"[^\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]*")

SETTINGS = (
    "name",
    "gravity",
    "base",
    "tool",
    "products_of_inertia",
    "kinematics_convention",
    "levels",
    "dummy_inertia",
    "friction",
    "tolerance",
    "inertia_check",
    "source",
    "remarks",
)


@dataclass(frozen=True, slots=True)
class Level:
    """A named level as the file has it; each effect with its line."""

    name: str
    line: int
    effects: tuple[tuple[str, int], ...]


@dataclass(slots=True)
class Settings:
    """What robot.yaml says, defaults filled in; the meaning of each is in `Database`."""

    file: str
    name: str = "unnamed"
    gravity: Vector3 = STANDARD_GRAVITY
    base: Placement = Placement()
    tool: Placement = Placement()
    products_of_inertia: Literal["tensor", "integral"] = "tensor"
    kinematics_convention: Literal["standard", "modified"] = "standard"
    levels: tuple[Level, ...] = ()
    dummy_inertia: float = 1.0
    friction: FrictionModel = FrictionModel()
    tolerance: Tolerance = Tolerance()
    inertia_check: Literal["error", "warn"] = "error"
    source: str = ""
    remarks: tuple[str, ...] = ()
    given: frozenset[str] = frozenset()
    lines: dict[str, int] | None = None

    def line(self, key: str) -> int | None:
        """Line of a key."""
        return (self.lines or {}).get(key)


@dataclass(frozen=True, slots=True)
class Notes:
    """Where problems of one YAML file go."""

    problems: Problems
    file: str

    def error(self, message: str, node: Node | None, column: str) -> None:
        """Note a fault at a node."""
        value = node.text if isinstance(node, Scalar) else None
        self.problems.error(message, self.file, node.line if node else None, column, value)


def read_settings(entries: Entries, tables: Iterable[str], file: str, problems: Problems) -> Settings:
    """Everything but the tables.

    Args:
        entries: The file's keys.
        tables: Keys that are tables and are read elsewhere.
        file: Name for the messages.
        problems: Takes what is wrong.
    """
    notes = Notes(problems, file)
    tables = set(tables)
    settings = Settings(file)
    nodes: dict[str, Node] = {}
    lines: dict[str, int] = {}
    for key, node in entries.entries:
        if key.text in tables:
            continue
        if key.text not in SETTINGS:
            notes.error(f"there is no key {key.text[:80]!r}; {nearest(key.text, SETTINGS)}", key, key.text[:80])
        elif not (isinstance(node, Scalar) and node.empty):
            nodes[key.text], lines[key.text] = node, key.line
    settings.given, settings.lines = frozenset(nodes), lines
    _read_name(nodes, settings, notes)
    if "gravity" in nodes:
        settings.gravity = vector(nodes["gravity"], "gravity", notes) or settings.gravity
    for key in ("base", "tool"):
        if key in nodes:
            setattr(settings, key, placement(nodes[key], key, notes))
    settings.products_of_inertia = cast(
        "Literal['tensor', 'integral']", word(nodes, "products_of_inertia", ("tensor", "integral"), notes)
    )
    settings.kinematics_convention = cast(
        "Literal['standard', 'modified']", word(nodes, "kinematics_convention", ("standard", "modified"), notes)
    )
    settings.inertia_check = cast("Literal['error', 'warn']", word(nodes, "inertia_check", ("error", "warn"), notes))
    if "dummy_inertia" in nodes:
        settings.dummy_inertia = number(nodes["dummy_inertia"], "dummy_inertia", notes, above=0.0) or 1.0
    if "levels" in nodes:
        settings.levels = _read_levels(nodes["levels"], notes)
    if "friction" in nodes:
        settings.friction = _read_friction(nodes["friction"], notes)
    if "tolerance" in nodes:
        given = mapping(nodes["tolerance"], "tolerance", ("mass", "com", "inertia", "length", "angle"), notes)
        read = {key: number(node, f"tolerance.{key}", notes, least=0.0) for key, node in given.items()}
        settings.tolerance = Tolerance(**{key: value for key, value in read.items() if value is not None})
    if "source" in nodes:
        settings.source = text(nodes["source"], "source", notes) or ""
    if "remarks" in nodes:
        node = nodes["remarks"]
        items = node.items if isinstance(node, Items) else (node,)
        settings.remarks = tuple(remark for item in items if (remark := text(item, "remarks", notes)))
    return settings


def _read_name(nodes: dict[str, Node], settings: Settings, notes: Notes) -> None:
    if "name" not in nodes:
        notes.problems.error("the robot has no name; write name: my_robot.", notes.file, None, "name")
        return
    name = text(nodes["name"], "name", notes)
    if name is None:
        return
    if is_name(name):
        settings.name = name
    else:
        notes.error(
            "the name must serve as a file name and an identifier: a letter, then at most 63 letters, digits, _ or -.",
            nodes["name"],
            "name",
        )


def _read_levels(node: Node, notes: Notes) -> tuple[Level, ...]:
    if not isinstance(node, Entries):
        notes.error("levels is a mapping from a name to a list of effects.", node, "levels")
        return ()
    levels: list[Level] = []
    for key, value in node.entries:
        column = f"levels.{key.text[:64]}"
        if key.text in RESERVED_LEVELS:
            notes.error(f"the level {key.text!r} is always there and may not be named anew.", key, column)
            continue
        if not is_label(key.text):
            notes.error("a level's name is made of at most 64 letters, digits, _ and -.", key, column)
            continue
        if not isinstance(value, Items):
            notes.error(f"the level {key.text!r} is a list of effects, such as [joint_compliance].", value, column)
            continue
        effects: list[tuple[str, int]] = []
        for item in value.items:
            name = text(item, column, notes)
            if name is not None:
                effects.append((name, item.line))
        levels.append(Level(key.text, key.line, tuple(effects)))
    return tuple(sorted(levels, key=lambda level: level.name))


def _read_friction(node: Node, notes: Notes) -> FrictionModel:
    given = mapping(node, "friction", ("model", "velocity"), notes)
    model = word(given, "model", ("stick", "smooth"), notes, "friction.")
    default = FrictionModel().velocity
    velocity = number(given["velocity"], "friction.velocity", notes, above=0.0) if "velocity" in given else default
    return FrictionModel(cast("Literal['stick', 'smooth']", model), velocity or default)


def mapping(node: Node, column: str, keys: tuple[str, ...], notes: Notes) -> dict[str, Node]:
    """The entries of a mapping with known keys; others are noted."""
    if not isinstance(node, Entries):
        notes.error(f"{column} is a mapping with the keys {listed(keys)}.", node, column)
        return {}
    found: dict[str, Node] = {}
    for key, value in node.entries:
        if key.text not in keys:
            notes.error(
                f"{column} has no key {key.text[:80]!r}; {nearest(key.text, keys)}", key, f"{column}.{key.text[:80]}"
            )
        elif not (isinstance(value, Scalar) and value.empty):
            found[key.text] = value
    return found


def text(node: Node, column: str, notes: Notes) -> str | None:
    """A text that can be printed; None, noted, where it is none."""
    if not isinstance(node, Scalar):
        notes.error(f"{column} is a text.", node, column)
        return None
    if len(node.text) > LONGEST_TEXT:
        notes.error(f"the text has {len(node.text)} characters; it may have {LONGEST_TEXT}.", node, column)
        return None
    if not _TEXT.fullmatch(node.text):
        notes.error("the text holds control characters.", Scalar(ascii(node.text), node.line), column)
        return None
    return node.text


def word(nodes: dict[str, Node], key: str, words: tuple[str, ...], notes: Notes, prefix: str = "") -> str:
    """One of some words; the first, where it is not given or, noted, none of them."""
    node = nodes.get(key)
    if node is None:
        return words[0]
    if isinstance(node, Scalar) and node.text in words:
        return node.text
    hint = nearest(node.text, words) if isinstance(node, Scalar) else ""
    notes.error(f"{prefix}{key} is {' or '.join(words)}; {hint}".rstrip("; "), node, prefix + key)
    return words[0]


def number(
    node: Node, column: str, notes: Notes, *, least: float = -math.inf, above: float = -math.inf, most: float = math.inf
) -> float | None:
    """A finite number within bounds; None, noted, where it is none."""
    value = read_number(node.text) if isinstance(node, Scalar) else None
    if value is None or math.isinf(value):
        notes.error(f"{column} is a finite number.", node, column)
        return None
    if value < least or value > most or (value <= above and above > -math.inf):
        if above > -math.inf:
            notes.error(f"{column} must be above {above!r}.", node, column)
        elif most < math.inf:
            notes.error(f"{column} must be from {least!r} to {most!r}.", node, column)
        else:
            notes.error(f"{column} must be at least {least!r}.", node, column)
        return None
    return value


def vector(node: Node, column: str, notes: Notes) -> Vector3 | None:
    """Three finite numbers; None, noted, where they are not."""
    values = numbers(node, column, 3, notes)
    return None if values is None else (values[0], values[1], values[2])


def numbers(
    node: Node,
    column: str,
    count: int,
    notes: Notes,
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
) -> tuple[float, ...] | None:
    """A list of so many finite numbers; None, noted, where it is not."""
    if not isinstance(node, Items) or len(node.items) != count:
        notes.error(f"{column} is a list of {count} number{'s' * (count > 1)}.", node, column)
        return None
    values = [number(item, column, notes, least=least, above=above, most=most) for item in node.items]
    read = tuple(value for value in values if value is not None)
    return read if len(read) == count else None


def placement(node: Node, column: str, notes: Notes) -> Placement:
    """A frame's place: {xyz: [..], rpy: [..]}."""
    given = mapping(node, column, ("xyz", "rpy"), notes)
    zero = (0.0, 0.0, 0.0)
    xyz = vector(given["xyz"], f"{column}.xyz", notes) if "xyz" in given else zero
    rpy = vector(given["rpy"], f"{column}.rpy", notes) if "rpy" in given else zero
    return Placement(xyz or zero, rpy or zero)


_SIZES = {
    "box": (3, "lengths along x, y and z"),
    "cylinder": (2, "radius and length"),
    "sphere": (1, "radius"),
    "mesh": (3, "scale along x, y and z"),
}
_VISUAL_KEYS = ("kind", "size", "xyz", "rpy", "mesh", "rgba")


def read_visuals(node: Node, n: int, notes: Notes) -> tuple[tuple[Visual, ...], ...]:
    """`visuals`: a mapping from the arm's number to a list of shapes; a tuple an arm."""
    if not isinstance(node, Entries):
        if not (isinstance(node, Scalar) and node.empty):
            notes.error("visuals is a mapping from an arm's number to a list of shapes.", node, "visuals")
        return ()
    arms: list[tuple[Visual, ...]] = [()] * n
    for key, value in node.entries:
        column = f"visuals.{key.text[:20]}"
        if key.text not in {str(arm) for arm in range(1, n + 1)}:
            notes.error(f"there is no arm {key.text[:20]!r}; arms go from 1 to {n}.", key, column)
        elif isinstance(value, Items):
            shapes = [_read_visual(item, column, notes) for item in value.items]
            arms[int(key.text) - 1] = tuple(shape for shape in shapes if shape is not None)
        else:
            notes.error("the shapes of an arm are a list of mappings.", value, column)
    return tuple(arms) if any(arms) else ()


def _read_visual(node: Node, column: str, notes: Notes) -> Visual | None:
    given = mapping(node, column, _VISUAL_KEYS, notes)
    if "kind" not in given:
        if isinstance(node, Entries):
            notes.error(f"the shape has no kind: {listed(list(_SIZES))}.", node, f"{column}.kind")
        return None
    kind = word(given, "kind", tuple(_SIZES), notes, f"{column}.")
    count, meaning = _SIZES[kind]
    size: tuple[float, ...] | None = (1.0, 1.0, 1.0)
    if "size" in given:
        # a mesh may be mirrored by a negative scale
        above = -math.inf if kind == "mesh" else 0.0
        size = numbers(given["size"], f"{column}.size", count, notes, above=above)
        if size is not None and 0.0 in size:
            notes.error("a mesh cannot be scaled to nothing.", given["size"], f"{column}.size")
    elif kind != "mesh":
        notes.error(f"a {kind} has a size: {meaning}.", node, f"{column}.size")
        return None
    mesh = ""
    if "mesh" in given:
        mesh = _mesh_path(given["mesh"], f"{column}.mesh", notes)
        if kind != "mesh":
            notes.error(f"a {kind} has no mesh.", given["mesh"], f"{column}.mesh")
    elif kind == "mesh":
        notes.error("a shape of kind mesh names its file: mesh: meshes/arm.stl.", node, f"{column}.mesh")
    where = Placement(
        (vector(given["xyz"], f"{column}.xyz", notes) if "xyz" in given else None) or (0.0, 0.0, 0.0),
        (vector(given["rpy"], f"{column}.rpy", notes) if "rpy" in given else None) or (0.0, 0.0, 0.0),
    )
    rgba = numbers(given["rgba"], f"{column}.rgba", 4, notes, least=0.0, most=1.0) if "rgba" in given else None
    if size is None:
        return None
    visual = Visual(cast("Literal['box', 'cylinder', 'sphere', 'mesh']", kind), size, where, mesh)
    if rgba is not None:
        visual = Visual(visual.kind, size, where, mesh, (rgba[0], rgba[1], rgba[2], rgba[3]))
    return visual


def _mesh_path(node: Node, column: str, notes: Notes) -> str:
    """Path of a mesh relative to the database's folder; noted where it would leave it or is unsafe in a text."""
    path = text(node, column, notes) or ""
    if not is_mesh_path(path):
        notes.error(
            "a mesh is a path within the database's folder, such as meshes/arm.stl: letters, digits, _ . + - and "
            f"blanks, parts separated by /, none beginning with a dot, ending in {listed(MESH_SUFFIXES)}.",
            node,
            column,
        )
        return ""
    return path
