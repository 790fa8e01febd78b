"""What a reader gathers on its way: values out of attributes, faults with their places, and remarks."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection
from dataclasses import dataclass, field

from ..errors import ModelFileError, Problem
from ..representation import Vector3
from .xml_file import Element

LARGEST = 1e15
"""Beyond it no number of a robot lies, and products of such numbers stay finite; a limit that large is none."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
SHOWN = 60
"""Characters of an offending text that a message repeats."""


@dataclass(slots=True)
class Findings:
    """Faults and remarks of one file.

    A faulty value is noted and reading goes on with a harmless one, so that all faults are told at once; `stop`
    then raises before anything is made of them.

    Attributes:
        problems: Faults, in the order found.
        remarks: What a database cannot say, and what was decided, in plain sentences.
    """

    problems: list[Problem] = field(default_factory=list[Problem])
    remarks: list[str] = field(default_factory=list[str])

    def problem(self, message: str, at: Element, column: str | None = None, value: str | None = None) -> None:
        """Note a fault at an element, once."""
        if value is not None and len(value) > SHOWN:
            value = value[:SHOWN] + "..."
        problem = Problem(message, at.file, at.line, column, value)
        if problem not in self.problems:
            self.problems.append(problem)

    def remark(self, text: str) -> None:
        """Note a remark, once."""
        if text not in self.remarks:
            self.remarks.append(text)

    def stop(self) -> None:
        """Raise what was found, if anything.

        Raises:
            ModelFileError: There are problems.
        """
        if self.problems:
            raise ModelFileError(sorted(self.problems, key=lambda problem: (problem.file or "", problem.line or 0)))

    def numbers(
        self,
        element: Element,
        name: str,
        text: str | None,
        count: int | tuple[int, int],
        default: tuple[float, ...] | None,
        *,
        minimum: float = -math.inf,
        infinite: bool = False,
    ) -> tuple[float, ...]:
        """Numbers of an attribute, separated by blanks.

        Args:
            element: Where it stands, for messages.
            name: The attribute.
            text: Its text; None where it is missing.
            count: How many there must be, or the least and the most.
            default: What a missing attribute means; None: it must be there.
            minimum: The least that is possible.
            infinite: inf is a value.
        """
        least, most = count if isinstance(count, tuple) else (count, count)
        harmless = default if default is not None else (max(minimum, 0.0),) * least
        if text is None:
            if default is None:
                self.problem(f"<{element.tag}> needs the attribute {name!r}", element)
            return harmless
        words = text.split()
        if not least <= len(words) <= most:
            wanted = str(least) if least == most else f"{least} to {most}"
            self.problem(f"{wanted} number{'s' if most > 1 else ''} must stand here", element, name, text)
            return harmless
        values: list[float] = []
        for word in words:
            value = float(word) if _NUMBER.fullmatch(word) or _INFINITE.fullmatch(word) else math.nan
            if infinite and abs(value) > LARGEST:
                value = math.copysign(math.inf, value)
            elif not abs(value) <= LARGEST:
                message = f"must be numbers separated by blanks, none above {LARGEST:.0e} in magnitude"
                self.problem(message, element, name, text)
                return harmless
            if value < minimum:
                self.problem(f"must be at least {minimum!r}", element, name, text)
                return harmless
            values.append(value)
        return tuple(values)

    def number(
        self,
        element: Element | None,
        name: str,
        default: float | None,
        *,
        minimum: float = -math.inf,
        infinite: bool = False,
    ) -> float:
        """One number of an element's attribute; the default where the element is missing too."""
        if element is None:
            return 0.0 if default is None else default
        fallback = None if default is None else (default,)
        text = element.attributes.get(name)
        return self.numbers(element, name, text, 1, fallback, minimum=minimum, infinite=infinite)[0]

    def vector(self, element: Element, name: str, default: Vector3 | None) -> Vector3:
        """Three numbers of an element's attribute."""
        x, y, z = self.numbers(element, name, element.attributes.get(name), 3, default)
        return (x, y, z)

    def unit(self, element: Element, name: str, vector: Vector3) -> Vector3:
        """A vector's direction; a vector without one is a fault."""
        length = math.hypot(*vector)
        if not 1e-10 < length < math.inf:
            self.problem("has no direction", element, name, element.attributes.get(name))
            return (0.0, 0.0, 1.0)
        x, y, z = (c / length for c in vector)
        return (x, y, z)

    def single(self, element: Element, tag: str) -> Element | None:
        """The one child of that name, if there is one; a second is a fault."""
        children = list(element.all(tag))
        if len(children) > 1:
            self.problem(f"<{element.tag}> holds a second <{tag}>", children[1])
        return children[0] if children else None

    def choice(self, element: Element, name: str, text: str, choices: Collection[str]) -> str | None:
        """The text if it is one of the choices; anything else is a fault."""
        if text in choices:
            return text
        self.problem(f"must be one of {', '.join(choices)}", element, name, text)
        return None


def nearest(name: str, known: Collection[str]) -> str:
    """A hint for a name that is not known: the nearest one, or all of them."""
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"did you mean {near[0]!r}?"
    listed = sorted(known)
    return "there are " + ", ".join(listed[:20]) + (f" and {len(listed) - 20} more" if len(listed) > 20 else "")


def listing(names: Collection[str], most: int = 8) -> str:
    """Names in one phrase, the first few of many."""
    shown = list(names)
    return ", ".join(shown[:most]) + (f" and {len(shown) - most} more" if len(shown) > most else "")
