"""Motion laws: position, speed and acceleration of every joint, from one source."""

from .evaluate import MotionTable, motion_at
from .law import MotionLaw, from_table, hold

__all__ = ["MotionLaw", "MotionTable", "from_table", "hold", "motion_at"]
