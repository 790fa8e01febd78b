"""The universal database: one robot, one folder of tables or one YAML file."""

from .database import Database, MotionTable, Placement, Tolerance, Visual, with_effects
from .frozen import FrozenMap
from .motions import load_motion, parse_motion
from .read import check, load, load_effects
from .sources import built_in
from .write import write

__all__ = [
    "Database",
    "FrozenMap",
    "MotionTable",
    "Placement",
    "Tolerance",
    "Visual",
    "built_in",
    "check",
    "load",
    "load_effects",
    "load_motion",
    "parse_motion",
    "with_effects",
    "write",
]
