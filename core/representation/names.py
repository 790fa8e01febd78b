"""Names and paths that are safe wherever they are emitted: they can end no string, comment or line, and no folder."""

from __future__ import annotations

import re
from functools import lru_cache

MESH_SUFFIXES = (".dae", ".glb", ".gltf", ".msh", ".obj", ".off", ".ply", ".stl")
"""Meshes stand beside emitted scripts, so a file that Python or MATLAB would run (numpy.py) must not pass as one."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
_LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_MESH = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. +-]*(?:/[A-Za-z0-9_][A-Za-z0-9_. +-]*)*")


@lru_cache(maxsize=1024)
def is_name(text: str) -> bool:
    """Whether a text serves as a file's name and, but for hyphens, as an identifier: a robot, an arm, a joint."""
    return _NAME.fullmatch(text) is not None


def is_label(text: str) -> bool:
    """Whether a text serves as a part of a file's name: a level, a motion."""
    return _LABEL.fullmatch(text) is not None


def is_mesh_path(text: str) -> bool:
    """Whether a text is a relative path of a mesh that stays in its folder."""
    return len(text) <= 200 and text.lower().endswith(MESH_SUFFIXES) and _MESH.fullmatch(text) is not None
