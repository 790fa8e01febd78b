"""What the backends share: heads of files, common refusals, and the sheet beside an emitted model."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from ..core.representation import Robot
from ..core.simulation.backend import Emission, Program
from ..core.simulation.concepts import Answer, Fate, concepts_of, joint_data
from ..core.simulation.drive_sheet import DriveSheet

# the list of a robot's data stands in the core, and is at hand here for those who write backends
__all__ = [
    "SHEET_SUFFIX",
    "UNLIMITED",
    "Answer",
    "Fate",
    "Sheet",
    "concepts_of",
    "header_lines",
    "joint_data",
    "sheet_name",
    "sheet_of",
    "sheet_text",
    "weightless_motor",
]

SHEET_SUFFIX = ".drives.json"
# What formats write that ask for a number where the robot has no limit
UNLIMITED = 1.0e9


def weightless_motor(robot: Robot, program: Program | None) -> str | None:
    """Why a robot cannot be moved by torque: it has an elastic joint without inertia between torque and spring."""
    if program is not None and program.control.mode != "motion":
        for stage in robot.stages:
            if stage.drive.spring and stage.drive.inertia == 0.0:
                return (
                    f"joint_compliance at {stage.joint.name} without an inertia of its motor side can only be moved by "
                    "imposed motion; give it rotor_inertia, or dummy_inertia above 0"
                )
    return None


def header_lines(robot: Robot, *conventions: str) -> list[str]:
    """What stands at the head of every emitted file: whose it is, its units, conventions, level and notes."""
    friction = robot.friction
    return [
        f"{robot.name}, emitted by mbexport",
        f"source: sha256 {robot.source_hash or 'unknown'} of the database's content",
        f"level: {robot.level}; effects: {', '.join(robot.effects) or 'none'}",
        "units: SI (m, kg, s, rad, N, N m)",
        *conventions,
        f"friction model: {friction.model}, velocity {friction.velocity!r}",
        *(f"note: {note}" for note in robot.notes),
    ]


@dataclass(frozen=True, slots=True)
class Sheet:
    """What stands beside an emitted model for the engine that runs it.

    Attributes:
        drives: The drives.
        gravity: In the world [m/s^2].
    """

    drives: DriveSheet
    gravity: tuple[float, float, float]


def sheet_name(robot: Robot) -> str:
    """File name of the sheet beside a model."""
    return robot.name + SHEET_SUFFIX


def sheet_text(robot: Robot) -> str:
    """The sheet beside a model, JSON: drives, and everything else that some format cannot say."""
    data = DriveSheet.of(robot).to_data()
    for joint, stage in zip(data["joints"], robot.stages, strict=True):
        joint["home"] = stage.joint.home
        limits = {name: getattr(stage.joint, name) for name in ("lower", "upper", "velocity", "effort")}
        joint["limits"] = {name: None if math.isinf(value) else value for name, value in limits.items()}
        joint["position_offset"] = stage.sensor.position_offset
        joint["torque_offset"] = stage.sensor.torque_offset
    data["gravity"] = list(robot.gravity)
    data["delay"] = robot.delay
    data["kp_factor"] = list(robot.kp_factor)
    data["kd_factor"] = list(robot.kd_factor)
    return json.dumps(data, indent=1) + "\n"


def sheet_of(emission: Emission) -> Sheet:
    """The sheet of an emission, read from its text."""
    text = next(text for name, text in emission.files.items() if name.endswith(SHEET_SUFFIX))
    data: dict[str, Any] = json.loads(text)
    x, y, z = (float(value) for value in data["gravity"])
    return Sheet(DriveSheet.from_data(data), (x, y, z))
