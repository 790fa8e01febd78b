"""Kinematics and rigid-body dynamics of the arms."""

from .dynamics import Dynamics, chain_table, dynamics
from .forward import Kinematics, arms_in_base, jacobian, joints_in_base, kinematics, reach, tool_in_base
from .inverse import REACHED, InverseKinematics, Task, independent_joints, inverse_kinematics, shortest_turn
from .rigid_body import ChainTable

__all__ = [
    "REACHED",
    "ChainTable",
    "Dynamics",
    "InverseKinematics",
    "Kinematics",
    "Task",
    "arms_in_base",
    "chain_table",
    "dynamics",
    "independent_joints",
    "inverse_kinematics",
    "jacobian",
    "joints_in_base",
    "kinematics",
    "reach",
    "shortest_turn",
    "tool_in_base",
]
