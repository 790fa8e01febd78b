"""Writing a database in SI with all digits, as a folder of tables or as one YAML file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

from ..effects import effect_named
from ..errors import UsageError
from ..files import write_whole
from ..representation import Inertia, VeitscheggerWu
from .database import Database, MotionTable, Placement, Visual
from .schema import JOINTS
from .settings import LARGEST_MESH, RESERVED_LEVELS
from .sources import SETTINGS_FILE, YAML_SUFFIXES
from .table import MOST_ROWS
from .yaml_tree import MOST_NODES

Header = list[str]
Cells = list[list[float | int | str]]


def write(
    database: Database, path: str | Path, form: Literal["folder", "yaml"] = "folder", *, force: bool = False
) -> tuple[Path, ...]:
    """Write a database; reading it again gives an equal one, to the last bit. Meshes go along.

    Args:
        database: What to write.
        path: The folder; for form "yaml" the file, or a folder for a `robot.yaml`.
        form: "folder" or "yaml".
        force: Replace files that are there.

    Returns:
        The files written.

    Raises:
        UsageError: A file is in the way, a mesh is not there, a table is too large to be read again, or the system
            refuses to write.
    """
    path = Path(path)
    texts: dict[str, str | bytes] = {}
    _check_size(database, form)
    if form == "yaml":
        name = path.name if path.suffix.lower() in YAML_SUFFIXES else SETTINGS_FILE
        path = path.parent if path.suffix.lower() in YAML_SUFFIXES else path
        texts[name] = yaml_text(database)
    else:
        texts.update(folder_texts(database))
    for mesh in sorted({shape.mesh for arm in database.visuals for shape in arm if shape.mesh}):
        texts[mesh] = _mesh(database, mesh)
    return write_whole(path, texts, force=force)


def _check_size(database: Database, form: Literal["folder", "yaml"]) -> None:
    """Refuse to write what could not be read again.

    Raises:
        UsageError: A table or the YAML document would be too large.
    """
    cells = 0
    for name, (header, rows) in _tables(database).items():
        cells += len(header) * (len(rows) + 1)
        if len(rows) > MOST_ROWS:
            raise UsageError(f"the table {name} of {database.name} has {len(rows)} rows; it may have {MOST_ROWS}.")
    # a row is a node itself, and the settings and shapes have some
    if form == "yaml" and 1.2 * cells > MOST_NODES:
        raise UsageError(f"{database.name} has {cells} cells, too many for one YAML file; write it as a folder.")


def _mesh(database: Database, mesh: str) -> bytes:
    if database.folder is None:
        raise UsageError(f"{database.name} was made in memory and says no folder in which the mesh {mesh} stands.")
    try:
        with (database.folder / mesh).open("rb") as stream:
            content = stream.read(LARGEST_MESH + 1)
    except OSError as error:
        raise UsageError(f"the mesh {mesh} of {database.name} cannot be read: {error.strerror or error}.") from error
    if len(content) > LARGEST_MESH:
        raise UsageError(f"the mesh {mesh} of {database.name} has more than {LARGEST_MESH} bytes.")
    return content


def folder_texts(database: Database) -> dict[str, str]:
    """Relative path to text of each file of the folder form."""
    texts = {SETTINGS_FILE: _settings_text(database)}
    for name, (header, rows) in _tables(database).items():
        texts[f"{name}.dat"] = _dat(header, rows)
    if database.visuals:
        texts["visuals.yaml"] = "\n".join(_visuals_lines(database.visuals)) + "\n"
    return texts


def yaml_text(database: Database) -> str:
    """The whole database as one YAML document."""
    lines = [_settings_text(database).rstrip("\n")]
    groups: dict[str, list[str]] = {}
    for name, (header, rows) in _tables(database).items():
        group, slash, inner = name.partition("/")
        if slash:
            groups.setdefault(group, [f"{group}:"]).extend(_yaml_table(inner, header, rows, "  "))
        else:
            lines.extend(_yaml_table(name, header, rows, ""))
    for group in groups.values():
        lines.extend(group)
    if database.visuals:
        lines.append("visuals:")
        lines.extend("  " + line for line in _visuals_lines(database.visuals))
    return "\n".join(lines) + "\n"


def _tables(database: Database) -> dict[str, tuple[Header, Cells]]:
    """Every table, named as in the folder without `.dat`."""
    five = ["alpha[rad]", "a[m]", "theta[rad]", "d[m]", "beta[rad]"]
    tables: dict[str, tuple[Header, Cells]] = {
        "kinematics": (["arm", *five], [[arm, *_five(row)] for arm, row in enumerate(database.kinematics, 1)])
    }
    if any(row != VeitscheggerWu() for row in database.corrections):
        tables["corrections"] = (["arm", *five], [[arm, *_five(row)] for arm, row in enumerate(database.corrections)])
    tables["inertia"] = (
        ["arm", "mass[kg]", "x[m]", "y[m]", "z[m]"]
        + [f"{name}[kg*m^2]" for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")],
        [[arm, *_ten(inertia)] for arm, inertia in enumerate(database.inertias, 1)],
    )
    tables["joints"] = (
        ["joint", *(_heading(column.name, getattr(column, "unit", "")) for column in JOINTS.columns)],
        [
            [number, joint.kind, joint.lower, joint.upper, joint.velocity, joint.effort, joint.home]
            for number, joint in enumerate(database.joints, 1)
        ],
    )
    for name, rows in database.effects.items():
        effect = effect_named(name)
        tables[f"effects/{name}"] = (
            [effect.key, *(_heading(column.name, column.unit) for column in effect.columns)],
            [
                ["robot" if effect.key == "robot" else row.at, *(row.values[column.name] for column in effect.columns)]
                for row in rows
            ],
        )
    for name, motion in database.motions.items():
        tables[f"motions/{name}"] = _motion(motion, database)
    return tables


def _motion(motion: MotionTable, database: Database) -> tuple[Header, Cells]:
    header = ["t[s]"]
    parts: list[Sequence[Sequence[float]]] = []
    for quantity, rate, values in (("q", "", motion.q), ("dq", "/s", motion.dq), ("ddq", "/s^2", motion.ddq)):
        if values is None:
            continue
        parts.append(values)
        for number, joint in enumerate(database.joints, 1):
            header.append(f"{quantity}{number}[{'rad' if joint.kind == 'revolute' else 'm'}{rate}]")
    rows: Cells = [[t] for t in motion.t]
    for values in parts:
        for row, more in zip(rows, values, strict=True):
            row.extend(more)
    return header, rows


def _heading(name: str, unit: str) -> str:
    return f"{name}[{unit}]" if unit else name


def _five(row: VeitscheggerWu) -> list[float]:
    return [row.alpha, row.a, row.theta, row.d, row.beta]


def _ten(inertia: Inertia) -> list[float]:
    i = inertia
    return [i.mass, *i.com, i.xx, i.yy, i.zz, i.xy, i.xz, i.yz]


def _dat(header: Header, rows: Cells) -> str:
    """A table's text, columns aligned."""
    lines = [header, *([_number(cell) for cell in row] for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
    aligned = (" ".join(word.ljust(width) for word, width in zip(line, widths, strict=True)).rstrip() for line in lines)
    return "\n".join(aligned) + "\n"


def _number(value: float | int | str) -> str:
    """All digits of a number; a word as it is."""
    return value if isinstance(value, str) else repr(value)


def _yaml_number(value: float | int | str) -> str:
    """A number as every YAML reader takes it: with a point, infinity as .inf."""
    if isinstance(value, str | int):
        return str(value)
    if math.isinf(value):
        return ".inf" if value > 0.0 else "-.inf"
    mantissa, e, exponent = repr(value).partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}{e}{exponent}"


def _yaml_table(name: str, header: Header, rows: Cells, indent: str) -> list[str]:
    """A table as a list of lists, the first of which names the columns."""
    if not rows:
        return [f"{indent}{name}: []"]
    lines = [f"{indent}{name}:", f"{indent}  - [{', '.join(_quoted(word) for word in header)}]"]
    lines.extend(f"{indent}  - [{', '.join(_yaml_number(cell) for cell in row)}]" for row in rows)
    return lines


def _quoted(text: str) -> str:
    """A text in double quotes, all that cannot be printed escaped."""
    named = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t"}
    return '"' + "".join(named.get(c, c if c.isprintable() else f"\\U{ord(c):08x}") for c in text) + '"'


def _list(values: Iterable[float]) -> str:
    return f"[{', '.join(_yaml_number(value) for value in values)}]"


def _placement(place: Placement) -> str:
    return f"{{xyz: {_list(place.xyz)}, rpy: {_list(place.rpy)}}}"


def _settings_text(database: Database) -> str:
    """robot.yaml of the folder form."""
    d = database
    lines = [
        f"name: {d.name}",
        f"gravity: {_list(d.gravity)}  # m/s^2, in the world",
        f"base: {_placement(d.base)}  # base in the world, m and rad",
        f"tool: {_placement(d.tool)}  # tool centre point in the last arm's frame, m and rad",
        "products_of_inertia: tensor",
        "kinematics_convention: standard",
    ]
    # what `with_effects` gave `rigid` is that robot's in memory alone
    named = [name for name in sorted(d.levels) if name not in RESERVED_LEVELS]
    if named:
        lines.append("levels:")
        # quoted: a name such as 1 or on is a word all the same
        lines.extend(f"  {_quoted(name)}: [{', '.join(sorted(d.levels[name]))}]" for name in named)
    t = d.tolerance
    lines += [
        f"dummy_inertia: {_yaml_number(d.dummy_inertia)}",
        f"friction: {{model: {d.friction.model}, velocity: {_yaml_number(d.friction.velocity)}}}",
        f"tolerance: {{mass: {_yaml_number(t.mass)}, com: {_yaml_number(t.com)}, inertia: {_yaml_number(t.inertia)}, "
        f"length: {_yaml_number(t.length)}, angle: {_yaml_number(t.angle)}}}",
        f"inertia_check: {d.inertia_check}",
    ]
    if d.source:
        lines.append(f"source: {_quoted(d.source)}")
    if d.remarks:
        lines.append("remarks:")
        lines.extend(f"  - {_quoted(remark)}" for remark in d.remarks)
    return "\n".join(lines) + "\n"


def _visuals_lines(visuals: Sequence[Sequence[Visual]]) -> list[str]:
    lines: list[str] = []
    for arm, shapes in enumerate(visuals, 1):
        if shapes:
            lines.append(f"{arm}:")
        for shape in shapes:
            mesh = f", mesh: {_quoted(shape.mesh)}" if shape.mesh else ""
            lines.append(
                f"  - {{kind: {shape.kind}, size: {_list(shape.size)}, xyz: {_list(shape.placement.xyz)}, "
                f"rpy: {_list(shape.placement.rpy)}{mesh}, rgba: {_list(shape.rgba)}}}"
            )
    return lines
