"""Motion: position, speed and acceleration of every joint, from one source."""

from .evaluate import MotionTable, motion_at
from .law import MotionLaw, from_table, hold, point_to_point

__all__ = ["MotionLaw", "MotionTable", "from_table", "hold", "motion_at", "point_to_point"]
