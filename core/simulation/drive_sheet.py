"""The drives of a robot as text beside an exported model, and from that text back to arrays.

What a format cannot say natively stands in this sheet; a run reads it from the export, not from the robot.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..representation import ArmSpring, Drive, FrictionModel, Robot, Slip, Spring, Stick, Term
from .drive_law import ARM, ERROR, ERROR_SLOPE, LEVEL, RESISTANCE, DriveTable

SCHEMA = "mbexport-drives/1"
_KINDS = {"level": LEVEL, "resistance": RESISTANCE, "arm": ARM, "error": ERROR, "error_slope": ERROR_SLOPE}
_PARAMETERS = 8


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
            data = asdict(drive)
            data["torque_limit"] = None if math.isinf(drive.torque_limit) else drive.torque_limit
            joints.append({"joint": name, "kind": kind, **data})
        return {
            "schema": SCHEMA,
            "friction": asdict(self.friction),
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
        drives = self.drives
        terms = [term for drive in drives for term in drive.terms]
        slips = [slip for drive in drives for slip in drive.slips]
        parameters = np.zeros((len(terms), _PARAMETERS))
        for row, term in zip(parameters, terms, strict=True):
            row[: len(term.parameters)] = term.parameters
        laws = [law_of(term.effect, term.law) for term in terms]
        arm_stiffness = [0.0 if "arm_springs" in native else _total_stiffness(drive) for drive in drives]
        smooth = self.friction.model == "smooth"
        return DriveTable(
            inertia=_floats(drive.inertia for drive in drives),
            elastic=np.array([drive.spring is not None for drive in drives], dtype=np.int64),
            stiffness=_floats(drive.spring.stiffness if drive.spring else 0.0 for drive in drives),
            spring_damping=_floats(drive.spring.damping if drive.spring else 0.0 for drive in drives),
            half_gap=_floats(drive.spring.gap / 2 if drive.spring else 0.0 for drive in drives),
            damping=_floats(0.0 if "damping" in native else drive.damping for drive in drives),
            gain=_floats(drive.gain for drive in drives),
            arm_stiffness=_floats(arm_stiffness),
            arm_rest=_floats(_mean_rest(drive) for drive in drives),
            stick_displacement=_floats(
                drive.stick.displacement if drive.stick and not smooth else 0.0 for drive in drives
            ),
            stick_time=_floats(drive.stick.time if drive.stick else 0.0 for drive in drives),
            smooth_velocity=_floats(self.friction.velocity for _ in drives),
            first=np.cumsum([0, *(len(drive.terms) for drive in drives)], dtype=np.int64),
            kinds=np.array([_KINDS[term.kind] for term in terms], dtype=np.int64),
            laws=np.array(laws, dtype=np.int64) if all(isinstance(law, int) for law in laws) else laws,
            parameters=parameters,
            slip_first=np.cumsum([0, *(len(drive.slips) for drive in drives)], dtype=np.int64),
            slip_stiffness=_floats(slip.stiffness for slip in slips),
            slip_level=_floats(slip.level for slip in slips),
        )


def _floats(values: Any) -> Any:
    return np.array(list(values), dtype=float)


def _total_stiffness(drive: Drive) -> float:
    return sum(spring.stiffness for spring in drive.arm_springs)


def _mean_rest(drive: Drive) -> float:
    """Rest of the one spring that pulls as all of them together."""
    total = _total_stiffness(drive)
    return sum(spring.stiffness * spring.rest for spring in drive.arm_springs) / total if total else 0.0


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
    )
