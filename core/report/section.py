"""A page is a list of sections; a section is a class that fills one template.

To add a section, write a class with `template` and `values` and its template in templates/report/, and put it into a
page's list. Templates escape nothing by themselves: text goes through the filter `xml`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from ..rendering import render


class Section(ABC):
    """One part of a page.

    Attributes:
        title: Heading; "" for none.
        template: File in templates/report/.
    """

    title: ClassVar[str] = ""
    template: ClassVar[str]

    @abstractmethod
    def values(self) -> dict[str, Any]:
        """What the template shows; {} where there is nothing to show, and the section is left out."""

    def html(self) -> str:
        """The section as HTML, "" where there is nothing to show."""
        values = self.values()
        return render(f"report/{self.template}", title=self.title, **values) if values else ""


def page(title: str, sections: Sequence[Section]) -> str:
    """A self-contained HTML page: style and pictures inside, nothing to load.

    Args:
        title: Of the browser's window.
        sections: In their order.
    """
    bodies = [html for html in (section.html() for section in sections) if html]
    return render("report/page.html.j2", title=title, bodies=bodies)
