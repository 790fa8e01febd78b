"""Where a database's text comes from: a folder of tables, one YAML file, or a built-in robot's name."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from ..effects import catalogue
from ..errors import DatabaseError, Problem
from .problems import Problems, nearest
from .schema import TABLES
from .settings import SETTINGS
from .table import MOST_COLUMNS, MOST_ROWS, Heading, RawRow, RawTable, parse_heading, parse_table, read_text
from .yaml_tree import LARGEST_YAML, Entries, Items, Node, Scalar, parse_yaml

SETTINGS_FILE = "robot.yaml"
YAML_SUFFIXES = (".yaml", ".yml")
# more files than any robot has, and few enough to read
MOST_FILES = 500

_YAML_SPECIAL = re.compile(r"([+-]?)\.(inf|Inf|INF|nan|NaN|NAN)")


@dataclass(slots=True)
class Sources:
    """All text of one database, not yet understood.

    Attributes:
        folder: What meshes are relative to.
        settings_file: Name of the YAML file for messages.
        settings: Its content; None where there is none that can be read.
        tables: Table name to text, of the fixed tables.
        effects: Effect's name to its table, also of effects that are not installed.
        motions: Motion's name to its table.
        visuals: Content of the visuals, with its file.
        extra: Files that the contract does not know.
    """

    folder: Path
    settings_file: str
    settings: Entries | None = None
    tables: dict[str, RawTable] = field(default_factory=dict[str, RawTable])
    effects: dict[str, RawTable] = field(default_factory=dict[str, RawTable])
    motions: dict[str, RawTable] = field(default_factory=dict[str, RawTable])
    visuals: tuple[Node, str] | None = None
    unread: set[str] = field(default_factory=set[str])
    extra: list[str] = field(default_factory=list[str])


def built_in() -> tuple[str, ...]:
    """Names of the built-in robots, sorted."""
    root = _robots()
    return tuple(sorted(entry.name for entry in root.iterdir() if (entry / SETTINGS_FILE).is_file()))


def _robots() -> Path:
    return Path(str(files((__package__ or "").partition(".")[0] + ".examples"))) / "robots"


def find(source: str | Path) -> Path:
    """The folder or file that a user means by a path or a built-in name.

    Raises:
        DatabaseError: There is nothing of that name.
    """
    path = Path(source)
    try:
        if path.is_file() or (path / SETTINGS_FILE).is_file():
            return path
        # a bare name means the built-in robot, unless a database of that name stands here
        if isinstance(source, str) and source in built_in():
            return _robots() / source
        if path.is_dir():
            return path
    except (OSError, ValueError) as error:
        raise DatabaseError((Problem(f"this cannot be a path: {error}.", value=str(source)[:80]),)) from error
    raise DatabaseError(
        (
            Problem(
                f"there is no such folder or file, nor a built-in robot; {nearest(str(source), built_in())}",
                value=str(source)[:200],
            ),
        )
    )


def gather(path: Path, problems: Problems) -> Sources:
    """Read all text of the database at a folder or a YAML file."""
    if path.is_dir():
        return _gather_folder(path, problems)
    if path.name == SETTINGS_FILE and any((path.parent / f"{table.name}.dat").exists() for table in TABLES):
        # the folder's own robot.yaml was named
        return _gather_folder(path.parent, problems)
    sources = Sources(path.parent, path.name)
    if path.suffix.lower() not in YAML_SUFFIXES:
        problems.error(
            f"a database is a folder or a file ending in {' or '.join(YAML_SUFFIXES)}; a URDF or MJCF file "
            "becomes one by mbexport import.",
            path.name,
        )
        return sources
    _gather_yaml(path, sources, problems)
    return sources


def _gather_folder(folder: Path, problems: Problems) -> Sources:
    sources = Sources(folder, SETTINGS_FILE)
    if (folder / SETTINGS_FILE).exists():
        _gather_yaml(folder / SETTINGS_FILE, sources, problems)
    else:
        problems.error(f"the folder has no {SETTINGS_FILE}; it holds at least name: my_robot.", SETTINGS_FILE)
    names = {f"{table.name}.dat": table.name for table in TABLES}
    for entry in _entries(folder, problems):
        if entry.name in names:
            _add_table(entry, entry.name, names[entry.name], sources.tables, sources, problems)
        elif entry.name == "effects" and entry.is_dir():
            for file in _entries(entry, problems):
                if file.suffix == ".dat":
                    _add_table(file, f"effects/{file.name}", file.stem, sources.effects, sources, problems)
                else:
                    sources.extra.append(f"effects/{file.name}")
        elif entry.name == "motions" and entry.is_dir():
            for file in _entries(entry, problems):
                if file.suffix == ".dat":
                    _add_table(file, f"motions/{file.name}", file.stem, sources.motions, sources, problems)
                else:
                    sources.extra.append(f"motions/{file.name}")
        elif entry.name == "visuals.yaml":
            text = read_text(entry, entry.name, problems, LARGEST_YAML)
            node = None if text is None else parse_yaml(text, entry.name, problems)
            if sources.visuals is not None:
                problems.error(f"visuals are in {SETTINGS_FILE} too; keep one.", entry.name)
            elif node is not None:
                sources.visuals = (node, entry.name)
        elif entry.suffix == ".dat" or entry.name.lower() in {*names, "effects", "motions", "visuals.yaml"}:
            sources.extra.append(entry.name)
    return sources


def _entries(folder: Path, problems: Problems) -> list[Path]:
    """What a folder holds, sorted, hidden files left out."""
    try:
        entries = sorted(entry for entry in folder.iterdir() if not entry.name.startswith("."))
    except OSError as error:
        problems.error(f"the folder cannot be read: {error.strerror or error}.", folder.name)
        return []
    if len(entries) > MOST_FILES:
        problems.error(f"the folder holds {len(entries)} files; it may hold {MOST_FILES}.", folder.name)
        return []
    return entries


def _add_table(
    path: Path, file: str, name: str, tables: dict[str, RawTable], sources: Sources, problems: Problems
) -> None:
    if name in tables:
        problems.error(f"this table is in {SETTINGS_FILE} too; keep one.", file)
        return
    text = read_text(path, file, problems)
    table = None if text is None else parse_table(text, file, problems)
    if table is None:
        sources.unread.add(name)
    else:
        tables[name] = table


def table_keys(entries: Entries) -> list[str]:
    """The keys of a YAML file that are tables."""
    fixed = {"effects", "motions", "visuals", *(table.name for table in TABLES)}
    keys: list[str] = []
    for key, _ in entries.entries:
        folder, slash, name = key.text.partition("/")
        listed_table = key.text in fixed or (slash and folder in {"effects", "motions"} and name)
        # the catalogue asks for all that is installed, which takes milliseconds: for strange keys only
        if listed_table or (key.text not in SETTINGS and key.text in catalogue()):
            keys.append(key.text)
    return keys


def _gather_yaml(path: Path, sources: Sources, problems: Problems) -> None:
    file = path.name
    text = read_text(path, file, problems, LARGEST_YAML)
    if text is None:
        sources.unread.add(file)
        return
    before = len(problems.errors)
    root = parse_yaml(text, file, problems)
    if not isinstance(root, Entries):
        sources.unread.add(file)
        if len(problems.errors) == before:
            problems.error("the file is a mapping from keys to values, such as name: my_robot.", file)
        return
    sources.settings = root
    keys = set(table_keys(root))
    for key, node in root.entries:
        if key.text not in keys or (isinstance(node, Scalar) and node.empty):
            continue
        folder, _, name = key.text.partition("/")
        if key.text == "visuals":
            sources.visuals = (node, file)
        elif folder in {"effects", "motions"}:
            group = sources.effects if folder == "effects" else sources.motions
            if name:
                _add_node(node, name, key.line, group, sources, file, problems)
            elif isinstance(node, Entries):
                for inner, table in node.entries:
                    _add_node(table, inner.text, inner.line, group, sources, file, problems)
            else:
                problems.error(f"{folder} is a mapping from names to tables.", file, node.line, folder)
        else:
            fixed = {table.name for table in TABLES}
            group = sources.tables if key.text in fixed else sources.effects
            _add_node(node, key.text, key.line, group, sources, file, problems)


def _add_node(
    node: Node, name: str, line: int, group: dict[str, RawTable], sources: Sources, file: str, problems: Problems
) -> None:
    if name in group:
        problems.error(f"the table {name!r} is there twice; keep one.", file, line, name)
        return
    table = _table_of(node, name[:80], line, file, problems)
    if table is None:
        sources.unread.add(name)
    else:
        group[name] = table


def _table_of(node: Node, name: str, line: int, file: str, problems: Problems) -> RawTable | None:
    """A table from a list of rows: mappings, or lists of which the first names the columns."""
    if isinstance(node, Scalar) and node.empty:
        node = Items((), node.line)
    if not isinstance(node, Items):
        problems.error(f"the table {name} is a list of rows.", file, node.line, name)
        return None
    if len(node.items) > MOST_ROWS:
        problems.error(f"more than {MOST_ROWS} rows; a table may have that many.", file, node.line, name)
        return None
    if node.items and isinstance(node.items[0], Items):
        return _table_of_lists(node, name, file, problems)
    headings: dict[str, int] = {}
    parsed: list[Heading] = []
    rows: list[tuple[int, dict[int, tuple[str, int]]]] = []
    whole = True
    for item in node.items:
        if not isinstance(item, Entries):
            problems.error(
                f"a row of {name} is a mapping from columns to values, as the first one is.", file, item.line, name
            )
            whole = False
            continue
        cells: dict[int, tuple[str, int]] = {}
        for key, value in item.entries:
            if key.text not in headings:
                heading = parse_heading(key.text)
                if heading is None:
                    problems.error("a column is written name[unit].", file, key.line, key.text[:80], key.text)
                    whole = False
                    continue
                if len(parsed) >= MOST_COLUMNS:
                    problems.error(f"more than {MOST_COLUMNS} columns; a table may have that many.", file, key.line)
                    return None
                headings[key.text] = len(parsed)
                parsed.append(heading)
            if isinstance(value, Scalar):
                cells[headings[key.text]] = (_cell_text(value), value.line)
            else:
                problems.error("a cell is one value, not a list or a mapping.", file, value.line, key.text[:80])
                whole = False
        rows.append((item.line, cells))
    if not whole:
        return None
    absent: tuple[None, int] = (None, line)
    return RawTable(
        file,
        node.line,
        tuple(parsed),
        tuple(
            RawRow(
                row_line,
                tuple(cells.get(index, absent)[0] for index in range(len(parsed))),
                tuple(cells.get(index, absent)[1] for index in range(len(parsed))),
            )
            for row_line, cells in rows
        ),
    )


def _table_of_lists(node: Items, name: str, file: str, problems: Problems) -> RawTable | None:
    header: tuple[Heading, ...] | None = None
    rows: list[RawRow] = []
    whole = True
    lost = 0
    for item in node.items:
        words = [cell for cell in item.items if isinstance(cell, Scalar)] if isinstance(item, Items) else []
        if not isinstance(item, Items) or len(words) != len(item.items):
            problems.error(f"a row of {name} is a list of values, as the first one is.", file, item.line, name)
            whole = False
        elif header is None:
            if len(words) > MOST_COLUMNS:
                problems.error(f"{len(words)} columns; a table may have {MOST_COLUMNS}.", file, item.line, name)
                return None
            parsed = [(parse_heading(cell.text), cell) for cell in words]
            for heading, cell in parsed:
                if heading is None:
                    problems.error("a column is written name[unit].", file, cell.line, cell.text[:80], cell.text)
                    return None
            header = tuple(heading for heading, _ in parsed if heading is not None)
        elif len(words) != len(header):
            problems.error(
                f"the row has {len(words)} cells, the first one names {len(header)} columns.", file, item.line, name
            )
            lost += 1
        else:
            rows.append(
                RawRow(item.line, tuple(_cell_text(cell) for cell in words), tuple(cell.line for cell in words))
            )
    if header is None or not whole:
        return None
    return RawTable(file, node.items[0].line, header, tuple(rows), lost)


def _cell_text(scalar: Scalar) -> str:
    """The cell as a table would have it: YAML writes .inf for inf."""
    match = _YAML_SPECIAL.fullmatch(scalar.text)
    return match[1] + match[2].lower() if match else scalar.text
