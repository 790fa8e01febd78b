"""The neutral robot: frozen data, SI, no engine's words."""

from .inertia import Inertia
from .names import MESH_SUFFIXES, is_label, is_mesh_path, is_name
from .pose import Pose, Vector3
from .robot import (
    TERM_KINDS,
    Arm,
    ArmSpring,
    Bend,
    Drive,
    FrictionModel,
    Joint,
    JointKind,
    Mount,
    Robot,
    Sensor,
    Shape,
    Slip,
    Spring,
    Stage,
    Stick,
    Term,
    TermKind,
)
from .veitschegger_wu import VeitscheggerWu

__all__ = [
    "MESH_SUFFIXES",
    "TERM_KINDS",
    "Arm",
    "ArmSpring",
    "Bend",
    "Drive",
    "FrictionModel",
    "Inertia",
    "Joint",
    "JointKind",
    "Mount",
    "Pose",
    "Robot",
    "Sensor",
    "Shape",
    "Slip",
    "Spring",
    "Stage",
    "Stick",
    "Term",
    "TermKind",
    "Vector3",
    "VeitscheggerWu",
    "is_label",
    "is_mesh_path",
    "is_name",
]
