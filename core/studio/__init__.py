"""A robot on the bench: its numbers changed by sliders, its error seen at once, in a page of one's own browser."""

from .bench import Bench
from .paths import Drive, Paths
from .session import Session, View

__all__ = ["Bench", "Drive", "Paths", "Session", "View"]
