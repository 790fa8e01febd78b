"""Pages for people: a section is a class and a template; a page is a list of sections, whole in one file."""

from .agreement import agreement_page
from .section import Section, page

__all__ = ["Section", "agreement_page", "page"]
