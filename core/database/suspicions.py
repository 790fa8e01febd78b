"""What is not wrong in a database but makes one look twice."""

from __future__ import annotations

from .database import Database
from .problems import Problems


def suspect(database: Database, problems: Problems) -> None:
    """Note as warnings what is suspicious in a database that could be read."""
