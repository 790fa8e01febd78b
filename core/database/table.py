"""The text of a table: a header `name[unit] ...` and rows, with the lines that they stand on."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .problems import Problems

LARGEST_FILE = 64 * 2**20
MOST_ROWS = 250_000
MOST_COLUMNS = 1_000

_HEADING = re.compile(r"([^\[\]]+)(?:\[([^\[\]]*)\])?")


@dataclass(frozen=True, slots=True)
class Heading:
    """A column as the header names it.

    Attributes:
        name: Without the unit.
        unit: Between the brackets; None where there are none.
    """

    name: str
    unit: str | None = None

    def __str__(self) -> str:
        return self.name if self.unit is None else f"{self.name}[{self.unit}]"


@dataclass(frozen=True, slots=True)
class RawRow:
    """A row as text.

    Attributes:
        line: Where it stands, from 1.
        cells: One a heading; None where the row does not give it.
        lines: Line of each cell, where they differ.
    """

    line: int
    cells: tuple[str | None, ...]
    lines: tuple[int, ...] | None = None

    def line_of(self, index: int) -> int:
        """Line of one cell."""
        return self.line if self.lines is None else self.lines[index]


@dataclass(frozen=True, slots=True)
class RawTable:
    """A table as text, from either form of the database.

    Attributes:
        file: As the user named it, or relative to the database's folder.
        line: Line of the header.
        headings: The columns in the file's order.
        rows: The rows in the file's order.
        lost: How many rows more there are that could not be read, as has been noted.
    """

    file: str
    line: int
    headings: tuple[Heading, ...]
    rows: tuple[RawRow, ...]
    lost: int = 0

    @property
    def length(self) -> int:
        """Number of rows, those that could not be read included."""
        return len(self.rows) + self.lost


def parse_heading(text: str) -> Heading | None:
    """`name[unit]` or `name`; None where it is neither."""
    match = _HEADING.fullmatch(text)
    return Heading(match[1], match[2]) if match else None


def parse_table(text: str, file: str, problems: Problems) -> RawTable | None:
    """Read a table's text; None, with problems noted, where it has no usable header.

    A row with too few or too many cells is noted and left out.
    """
    headings: tuple[Heading, ...] | None = None
    header_line = 0
    rows: list[RawRow] = []
    lost = 0
    for number, full_line in enumerate(lines_of(text), 1):
        words = full_line.partition("#")[0].split()
        if not words:
            continue
        if headings is None:
            headings, header_line = _parse_header(words, file, number, problems), number
            if headings is None:
                return None
            continue
        if len(words) != len(headings):
            problems.error(
                f"the row has {len(words)} cells, the header names {len(headings)} columns.",
                file,
                number,
                None,
                words[0],
            )
            lost += 1
            continue
        rows.append(RawRow(number, tuple(words)))
        if len(rows) > MOST_ROWS:
            problems.error(f"more than {MOST_ROWS} rows; a table may have that many.", file, number)
            return None
    if headings is None:
        problems.error("the table is empty; its first line names the columns.", file)
        return None
    return RawTable(file, header_line, headings, tuple(rows), lost)


def _parse_header(words: list[str], file: str, line: int, problems: Problems) -> tuple[Heading, ...] | None:
    headings: list[Heading] = []
    if len(words) > MOST_COLUMNS:
        problems.error(f"{len(words)} columns; a table may have {MOST_COLUMNS}.", file, line)
        return None
    whole = True
    for word in words:
        heading = parse_heading(word)
        if heading is None:
            whole = False
            hint = " (no blank before or within the brackets)" if "[" in word or "]" in word else ""
            problems.error(f"a column is written name[unit]{hint}.", file, line, word, word)
        else:
            headings.append(heading)
    return tuple(headings) if whole else None


def lines_of(text: str) -> Iterator[str]:
    """The lines of a text, one by one; only the line ends of the common systems count."""
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    start = 0
    while (end := text.find("\n", start)) >= 0:
        yield text[start:end]
        start = end + 1
    yield text[start:]


def read_text(path: Path, file: str, problems: Problems, largest: int = LARGEST_FILE) -> str | None:
    """Text of a file; None, with the problem noted, where it cannot be read, is no text, or too large."""
    try:
        if not path.is_file():
            problems.error("this is not a file." if path.exists() else "there is no such file.", file)
            return None
        size = path.stat().st_size
        if size > largest:
            problems.error(f"the file has {size} bytes; it may have {largest}.", file)
            return None
        with path.open("rb") as stream:
            content = stream.read(largest + 1)
    except OSError as error:
        problems.error(f"the file cannot be read: {error.strerror or error}.", file)
        return None
    return decode(content, file, problems)


def decode(content: bytes, file: str, problems: Problems) -> str | None:
    """UTF-8 text, a byte order mark at its start left out; None, with the problem noted, where it is none."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        problems.error(
            f"the file is not text in UTF-8 (byte {error.start} is 0x{content[error.start]:02x}).", file, line
        )
        return None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        problems.error("the file is not text: it holds a zero byte.", file, line)
        return None
    return text
