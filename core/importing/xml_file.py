"""Reading XML of strangers: bounded, without document types or entities, every element with its line."""

from __future__ import annotations

import xml.sax
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import AttributesImpl, Locator

from defusedxml import DefusedXmlException, DTDForbidden
from defusedxml.sax import parseString

from ..errors import ModelFileError, Problem

LARGEST_FILE = 16 * 1024 * 1024
"""Bytes. Meshes stand in files of their own; the largest robot descriptions in use have a tenth of this."""

DEEPEST = 250
"""Nested elements; readers recurse that deep. A chain of 48 joints nests 50."""

MOST_ELEMENTS = 100_000


@dataclass(frozen=True, slots=True)
class Element:
    """One element of a file.

    Attributes:
        tag: Its name, a prefix included as it stands.
        attributes: Name to text.
        children: In the file's order.
        file: Name of the file it stands in.
        line: From 1.
    """

    tag: str
    attributes: Mapping[str, str]
    children: list[Element]
    file: str
    line: int

    def all(self, *tags: str) -> Iterator[Element]:
        """Children of these names, in the file's order."""
        return (child for child in self.children if child.tag in tags)

    def first(self, tag: str) -> Element | None:
        """The first child of this name."""
        return next(self.all(tag), None)

    def walk(self) -> Iterator[Element]:
        """The element and all below it."""
        yield self
        for child in self.children:
            yield from child.walk()


class _Reader(ContentHandler):
    """Builds the elements and stops at what is too much."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.file = file
        self.root: Element | None = None
        self.open: list[Element] = []
        self.count = 0
        self.locator: Locator | None = None

    def setDocumentLocator(self, locator: Locator) -> None:  # noqa: N802 (the name is the interface's)
        self.locator = locator

    def startElement(self, name: str, attrs: AttributesImpl) -> None:  # noqa: N802
        line = (self.locator.getLineNumber() if self.locator else None) or 1
        self.count += 1
        if len(self.open) >= DEEPEST or self.count > MOST_ELEMENTS:
            what = f"nested deeper than {DEEPEST}" if len(self.open) >= DEEPEST else f"more than {MOST_ELEMENTS}"
            raise ModelFileError([Problem(f"elements are {what}; no robot is", self.file, line)])
        element = Element(name, dict(attrs.items()), [], self.file, line)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def endElement(self, name: str) -> None:  # noqa: N802
        self.open.pop()


def read_file(path: Path, name: str) -> bytes:
    """The content of a file of bounded size.

    Args:
        path: The file.
        name: What messages call it.

    Raises:
        ModelFileError: It is not there, no file, or too large.
    """
    try:
        if path.exists() and not path.is_file():
            raise ModelFileError([Problem("is no file", name)])
        with path.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise ModelFileError([Problem(f"cannot be read: {reason or error}", name)]) from error
    if len(content) > LARGEST_FILE:
        raise ModelFileError([Problem(f"is larger than {LARGEST_FILE // 1024**2} MiB; no robot description is", name)])
    return content


def parse_xml(content: bytes, name: str) -> Element:
    """The root element of an XML text.

    Args:
        content: The text.
        name: What messages call it.

    Raises:
        ModelFileError: It is no XML, too large, or holds a document type or entities.
    """
    reader = _Reader(name)
    try:
        parseString(content, reader, forbid_dtd=True)
    except DTDForbidden as error:
        raise ModelFileError(
            [Problem("holds a document type (<!DOCTYPE ...>), which is refused; delete that line", name)]
        ) from error
    except DefusedXmlException as error:
        raise ModelFileError(
            [Problem(f"holds entities or outside references, which are refused: {error}", name)]
        ) from (error)
    except xml.sax.SAXParseException as error:
        raise ModelFileError([Problem(f"is no XML: {error.getMessage()}", name, error.getLineNumber())]) from error
    except (xml.sax.SAXException, ValueError, LookupError) as error:
        raise ModelFileError([Problem(f"is no XML: {error}", name)]) from error
    if reader.root is None:
        raise ModelFileError([Problem("is no XML: there is no element in it", name)])
    return reader.root
