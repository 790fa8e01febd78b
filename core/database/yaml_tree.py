"""YAML as a tree of plain text with line numbers, and nothing else: no tags, no objects, bounded in every way.

The library's parser gives the events; values stay the text that the file has, so that numbers are read by the same
code as the tables' cells.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any, cast

from .problems import Problems, shortened

# the parser takes some 30 microseconds a value; long motions belong into tables of their own
LARGEST_YAML = 8 * 2**20
DEEPEST = 20
MOST_NODES = 500_000

_PLAIN_TAGS = {f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "seq", "map")}


@dataclass(frozen=True, slots=True)
class Scalar:
    """One value as text; `plain` where it stands without quotes."""

    text: str
    line: int
    plain: bool = True

    @property
    def empty(self) -> bool:
        """Whether this is YAML's null."""
        return self.plain and self.text in {"", "~", "null"}


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    items: tuple[Node, ...]
    line: int


@dataclass(frozen=True, slots=True)
class Entries:
    """A mapping, keys in the file's order."""

    entries: tuple[tuple[Scalar, Node], ...]
    line: int


Node = Scalar | Items | Entries


@dataclass(slots=True)
class _Open:
    """A list or mapping that is being read."""

    mapping: bool
    line: int
    anchor: str | None
    children: list[Node]
    size: int = 1


class _StopError(Exception):
    """What is wrong, with its line."""

    def __init__(self, message: str, line: int, value: str | None = None) -> None:
        super().__init__(message)
        self.message, self.line, self.value = message, line, value


def parse_yaml(text: str, file: str, problems: Problems) -> Node | None:
    """The document's tree; None, with the problem noted, where it is no YAML or more than is taken."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        return _build(YAML(typ="safe", pure=True).parse(io.StringIO(text)), problems, file)
    except _StopError as stop:
        problems.error(stop.message, file, stop.line, None, stop.value)
    except MarkedYAMLError as error:
        marked = cast("Any", error)
        mark = marked.problem_mark or marked.context_mark
        what = " ".join(str(part) for part in (marked.context, marked.problem) if part)
        problems.error(f"this is no YAML: {what}.", file, mark.line + 1 if mark else None)
    except YAMLError as error:
        problems.error(f"this is no YAML: {' '.join(str(error).split())}.", file)
    except (ValueError, OverflowError, AttributeError, IndexError, NotImplementedError) as error:
        # escapes and directives on which the library's scanner stumbles
        problems.error(f"this is no YAML: {error}.", file)
    return None


def _build(events: Any, problems: Problems, file: str) -> Node | None:
    from ruamel.yaml import events as kind

    stack: list[_Open] = []
    anchors: dict[str, tuple[Node, int]] = {}
    root: Node | None = None
    documents = 0
    total = 0
    for event in events:
        # the library's classes are untyped, so narrowing would make everything of them unknown
        unnarrowed: Any = event
        line = int(event.start_mark.line) + 1 if event.start_mark else 1
        if isinstance(event, kind.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise _StopError("a second document begins here; the file may hold one.", line)
            continue
        done: Node
        size = 1
        anchor = cast("str | None", getattr(event, "anchor", None))
        if isinstance(event, kind.AliasEvent):
            if anchor not in anchors:
                raise _StopError(f"the alias *{anchor} stands before its anchor is complete.", line, f"*{anchor}")
            done, size = anchors[anchor]
            anchor = None
        elif isinstance(event, kind.ScalarEvent):
            _refuse_tag(event, line)
            done = Scalar(unnarrowed.value, line, unnarrowed.style in {None, ""})
        elif isinstance(event, kind.SequenceStartEvent | kind.MappingStartEvent):
            _refuse_tag(event, line)
            if len(stack) >= DEEPEST:
                raise _StopError(f"lists and mappings are nested deeper than {DEEPEST}.", line)
            stack.append(_Open(isinstance(event, kind.MappingStartEvent), line, anchor, []))
            continue
        elif isinstance(event, kind.SequenceEndEvent | kind.MappingEndEvent):
            top = stack.pop()
            size, anchor = top.size, top.anchor
            done = _entries(top, problems, file) if top.mapping else Items(tuple(top.children), top.line)
        else:
            continue
        total += 1
        if size > MOST_NODES or total > MOST_NODES:
            raise _StopError(f"the file unfolds to more than {MOST_NODES} values.", line)
        if anchor is not None:
            anchors[anchor] = (done, size)
        if stack:
            stack[-1].children.append(done)
            stack[-1].size += size
            if stack[-1].size > MOST_NODES:
                raise _StopError(f"the file unfolds to more than {MOST_NODES} values.", line)
        else:
            root = done
    return root


def _refuse_tag(event: Any, line: int) -> None:
    tag = getattr(event, "tag", None)
    if tag is None:
        return
    text = str(tag)
    if text not in _PLAIN_TAGS and text != "!":
        raise _StopError(f"the tag {shortened(text)} is not read; the file may hold plain values only.", line, text)


def _entries(top: _Open, problems: Problems, file: str) -> Entries:
    entries: list[tuple[Scalar, Node]] = []
    first: dict[str, int] = {}
    for key, value in zip(top.children[::2], top.children[1::2], strict=True):
        if not isinstance(key, Scalar):
            raise _StopError("a key is a word, not a list or a mapping.", key.line)
        if key.text in first:
            problems.error(
                f"the key {shortened(key.text)!r} is there twice, first in line {first[key.text]}.",
                file,
                key.line,
                key.text,
            )
            continue
        first[key.text] = key.line
        entries.append((key, value))
    return Entries(tuple(entries), top.line)
