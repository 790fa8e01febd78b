"""A log.yaml as plain values with the lines that they stand on; reading it executes nothing and is bounded in size."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..database.problems import Problems
from ..database.table import read_text
from ..database.yaml_tree import LARGEST_YAML, Entries, Items, Node, parse_yaml
from ..errors import Problem, RunFileError

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_INFINITY = re.compile(r"([-+]?)\.?inf", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class LogFile:
    """What a log.yaml says.

    Attributes:
        file: As the user named it.
        data: Its content: dict, list, str, float, bool, None.
        lines: Line of each key, nested ones joined by dots ("control.kp"), from 1.
    """

    file: str
    data: Mapping[str, Any]
    lines: Mapping[str, int]

    def problem(self, key: str, value: Any, message: str) -> Problem:
        """A fault of the value at a dotted key."""
        line = self.lines.get(key) or self.lines.get(key.rpartition(".")[0])
        return Problem(message, file=self.file, line=line, column=key, value=None if value is None else str(value))


def read_log(path: Path) -> LogFile:
    """The content of a log.yaml.

    Raises:
        RunFileError: It cannot be read or is no mapping; with all problems.
    """
    problems = Problems()
    text = read_text(path, str(path), problems, LARGEST_YAML)
    tree = None if text is None else parse_yaml(text, str(path), problems)
    if not problems.errors and not isinstance(tree, Entries):
        problems.error("must be a mapping, e.g. control: {mode: motion}.", str(path))
    if problems.errors:
        raise RunFileError(problems.errors)
    lines: dict[str, int] = {}
    data = _plain(tree, "", lines)
    return LogFile(str(path), data, lines)


def _plain(node: Node | None, key: str, lines: dict[str, int]) -> Any:
    if node is None:
        return None
    if isinstance(node, Entries):
        values: dict[str, Any] = {}
        for name, value in node.entries:
            dotted = f"{key}.{name.text}" if key else name.text
            lines[dotted] = name.line
            values[name.text] = _plain(value, dotted, lines)
        return values
    if isinstance(node, Items):
        return [_plain(item, key, lines) for item in node.items]
    if not node.plain:
        return node.text
    if node.empty:
        return None
    if node.text in {"true", "false"}:
        return node.text == "true"
    if _NUMBER.fullmatch(node.text):
        return float(node.text)
    infinite = _INFINITY.fullmatch(node.text)
    return float(f"{infinite[1]}inf") if infinite else node.text
