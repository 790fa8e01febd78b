"""Motion: position, speed and acceleration of every joint, from one source."""

from .evaluate import MotionTable, motion_at
from .excitation import excitation
from .greca import greca
from .law import MotionLaw, from_table, hold, point_to_point
from .named import motion_named, motion_names

__all__ = [
    "MotionLaw",
    "MotionTable",
    "excitation",
    "from_table",
    "greca",
    "hold",
    "motion_at",
    "motion_named",
    "motion_names",
    "point_to_point",
]
