"""What a run's columns are called, and in which unit each is: the names that the format of runs has."""

from __future__ import annotations

from .representation import JointKind

# of every joint, with _1, _2 ... behind, in the order of a data file's columns
JOINT_SIGNALS = ("q_cmd", "dq_cmd", "ddq_cmd", "tau_cmd", "q", "dq", "q_link", "tau", "tau_link")
# of the tool centre point in the base [m], and its orientation as a unit quaternion
POSITION_SIGNALS = ("ee_x", "ee_y", "ee_z")
TURN_SIGNALS = ("ee_qw", "ee_qx", "ee_qy", "ee_qz")

# of a revolute joint, of a prismatic one
_UNITS = {"q": ("rad", "m"), "dq": ("rad/s", "m/s"), "ddq": ("rad/s^2", "m/s^2"), "tau": ("N*m", "N")}


def joint_unit(signal: str, kind: JointKind) -> str:
    """SI unit of a joint's signal, named without its number."""
    return _UNITS[signal.split("_", maxsplit=1)[0]][kind == "prismatic"]
