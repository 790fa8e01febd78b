"""The drives of a robot as text beside an exported model, and from that text back to arrays.

What a format cannot say natively stands in this sheet; a run reads it from the export, not from the robot.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from ..representation import ArmSpring, Drive, FrictionModel, Robot, Slip, Spring, Stick, Term
from .drive_law import DriveTable
from .drive_table import drive_table

SCHEMA = "mbexport-drives/1"


@dataclass(frozen=True, slots=True)
class DriveSheet:
    """All drives of a robot.

    Attributes:
        joints: Names of the joints, base to tool.
        kinds: "revolute" or "prismatic" of each.
        drives: Their drives.
        friction: How sign() is realised.
        notes: Remarks of the export (the dummy's inertia, conventions).
    """

    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    drives: tuple[Drive, ...]
    friction: FrictionModel
    notes: tuple[str, ...] = ()

    @staticmethod
    def of(robot: Robot) -> DriveSheet:
        """The drives of a robot."""
        return DriveSheet(
            tuple(stage.joint.name for stage in robot.stages),
            tuple(stage.joint.kind for stage in robot.stages),
            tuple(stage.drive for stage in robot.stages),
            robot.friction,
            robot.notes,
        )

    def to_data(self) -> dict[str, Any]:
        """Plain data (numbers, strings, lists) with no inf in it: a missing torque limit is None."""
        joints: list[dict[str, Any]] = []
        for name, kind, drive in zip(self.joints, self.kinds, self.drives, strict=True):
            data = _plain(drive)
            data["torque_limit"] = None if math.isinf(drive.torque_limit) else drive.torque_limit
            joints.append({"joint": name, "kind": kind, **data})
        return {
            "schema": SCHEMA,
            "friction": _plain(self.friction),
            "notes": list(self.notes),
            "joints": joints,
        }

    def to_json(self) -> str:
        """JSON text, numbers with all their digits."""
        return json.dumps(self.to_data(), indent=1) + "\n"

    @staticmethod
    def from_data(data: dict[str, Any]) -> DriveSheet:
        """The sheet that `to_data` gave."""
        return DriveSheet(
            tuple(joint["joint"] for joint in data["joints"]),
            tuple(joint["kind"] for joint in data["joints"]),
            tuple(_drive(joint) for joint in data["joints"]),
            FrictionModel(**data["friction"]),
            tuple(data["notes"]),
        )

    @staticmethod
    def from_json(text: str) -> DriveSheet:
        """The sheet that `to_json` gave."""
        return DriveSheet.from_data(json.loads(text))

    def elastic(self) -> tuple[bool, ...]:
        """Where motor and arm side are two coordinates."""
        return tuple(drive.spring is not None for drive in self.drives)

    def laws(self) -> tuple[tuple[str, str], ...]:
        """(effect, law) of every law in use, each once, sorted."""
        return tuple(sorted({(term.effect, term.law) for drive in self.drives for term in drive.terms}))

    def table(self, law_of: Any, *, native: Collection[str] = ()) -> DriveTable:
        """Arrays for the drives' equations.

        Args:
            law_of: (effect, law) -> its address, or its function where the text runs uncompiled.
            native: What the engine does by itself and the equations shall leave out: "damping" (linear friction),
                "arm_springs".
        """
        return drive_table(self.to_data(), law_of, native)


def _plain(part: Any) -> Any:
    """Dataclasses as dicts all the way down; a diagnosis asks thousands of times, and `asdict` would copy numbers."""
    if isinstance(part, tuple):
        return tuple(map(_plain, part))  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
    return {name: _plain(getattr(part, name)) for name in part.__slots__} if hasattr(part, "__slots__") else part


def _drive(data: dict[str, Any]) -> Drive:
    return Drive(
        inertia=data["inertia"],
        dummy=data["dummy"],
        spring=Spring(**data["spring"]) if data["spring"] else None,
        damping=data["damping"],
        terms=tuple(
            Term(term["effect"], term["law"], term["kind"], tuple(term["parameters"])) for term in data["terms"]
        ),
        slips=tuple(Slip(**slip) for slip in data["slips"]),
        arm_springs=tuple(ArmSpring(**spring) for spring in data["arm_springs"]),
        stick=Stick(**data["stick"]) if data["stick"] else None,
        gain=data["gain"],
        torque_limit=math.inf if data["torque_limit"] is None else data["torque_limit"],
        passive=data["passive"],
    )
