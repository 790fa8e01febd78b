"""Jinja templates to text: numbers with all their digits, names that cannot break out of the text they stand in."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any, cast
from xml.sax.saxutils import escape

if TYPE_CHECKING:
    from jinja2 import Environment


# what no XML may hold, not even escaped
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_HYPHENS = re.compile("-(?=-)")


def number(value: float) -> str:
    """Shortest text that reads back as the same float; integers as floats, -0.0 as 0.0."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float]) -> str:
    """Numbers separated by blanks."""
    return " ".join(number(value) for value in values)


def python_literal(value: Any) -> str:
    """A Python expression for plain data (numbers, strings, lists, tuples, dicts, None, bool), inf included."""
    if isinstance(value, float):
        return f'float("{value}")' if math.isinf(value) else number(value)
    if isinstance(value, dict):
        items = cast("dict[Any, Any]", value)
        return "{" + ", ".join(f"{python_literal(k)}: {python_literal(v)}" for k, v in items.items()) + "}"
    if isinstance(value, list | tuple):
        parts = [python_literal(item) for item in cast("list[Any]", value)]
        text = ", ".join(parts)
        return f"[{text}]" if isinstance(value, list) else f"({text}{',' if len(parts) == 1 else ''})"
    if value is None or isinstance(value, bool | int):
        return repr(value)
    # ASCII only, so that no character of a name can end the line or the string
    return json.dumps(str(value), ensure_ascii=False).encode("ascii", "backslashreplace").decode("ascii")


def xml_text(value: object) -> str:
    """Text that is safe in an XML attribute or element."""
    return escape(_NOT_XML.sub("\ufffd", str(value)), {'"': "&quot;", "'": "&apos;"})


def comment_line(value: object) -> str:
    """One line of text that is safe in a comment of XML, of Python and of others that end with their line."""
    # what is not printable may turn the direction of writing, too
    printable = "".join(char if char.isprintable() else "\ufffd" for char in " ".join(str(value).split()))
    return _HYPHENS.sub("- ", printable)


@cache
def environment() -> Environment:
    """The templates of the package; a name that a template lacks is an error, not an empty string."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("mbexport", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    made.filters.update(  # pyright: ignore[reportCallIssue]
        num=number, nums=numbers, py=python_literal, xml=xml_text, comment=comment_line
    )
    return made


def render(template: str, **values: Any) -> str:
    """Text of a template of templates/, e.g. "urdf/robot.urdf.j2"."""
    return environment().get_template(template).render(**values)
