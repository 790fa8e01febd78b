"""Kinematics and rigid-body dynamics of the arms."""

from .dynamics import Dynamics, chain_table, dynamics
from .forward import Kinematics, arms_in_base, jacobian, joints_in_base, kinematics, reach, tool_in_base
from .rigid_body import ChainTable

__all__ = [
    "ChainTable",
    "Dynamics",
    "Kinematics",
    "arms_in_base",
    "chain_table",
    "dynamics",
    "jacobian",
    "joints_in_base",
    "kinematics",
    "reach",
    "tool_in_base",
]
