"""What the backends share: the list of a robot's data for concept reports, and the sheet beside an emitted model."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..core.representation import Robot, Stage, VeitscheggerWu
from ..core.simulation.backend import Concept, Emission, Program, Status
from ..core.simulation.drive_sheet import DriveSheet

SHEET_SUFFIX = ".drives.json"
# What formats write that ask for a number where the robot has no limit
UNLIMITED = 1.0e9

Fate = tuple[Status, str]
Answer = Callable[[str, int], Fate]
"""answer(datum, i) -> (status, how); i is the stage, from 0, and -1 for the robot or its base."""


def joint_data(stage: Stage) -> Iterator[str]:
    """Names of the data that one joint, with its drive and sensor, has beyond the defaults."""
    joint, drive, sensor = stage.joint, stage.drive, stage.sensor
    present = {
        "joint.type": True,
        "limits.position": not (math.isinf(joint.lower) and math.isinf(joint.upper)),
        "limits.velocity": not math.isinf(joint.velocity),
        "limits.effort": not math.isinf(joint.effort),
        "home": True,
        "rotor_inertia.inertia": drive.inertia != 0.0 and not drive.dummy,
        "dummy_inertia": drive.inertia != 0.0 and drive.dummy,
        "joint_compliance.stiffness": drive.spring is not None,
        "joint_compliance.damping": drive.spring is not None and drive.spring.damping != 0.0,
        "backlash.gap": drive.spring is not None and drive.spring.gap != 0.0,
        "viscous_friction.coefficient": drive.damping != 0.0,
        **{term.effect: True for term in sorted(drive.terms, key=lambda term: term.effect)},
        "friction.model": any(term.kind == "level" for term in drive.terms),
        "hysteresis": bool(drive.slips),
        "joint_spring": bool(drive.arm_springs),
        "torque_constant.gain": drive.gain != 1.0,
        "torque_limit.torque": not math.isinf(drive.torque_limit),
        "encoder_offset.offset": sensor.position_offset != 0.0,
        "torque_offset.torque": sensor.torque_offset != 0.0,
    }
    return (datum for datum, is_there in present.items() if is_there)


def concepts_of(robot: Robot, answer: Answer) -> tuple[Concept, ...]:
    """Concept report of a robot: every datum that it has, in a fixed order; alike joints are one line.

    Args:
        robot: The robot.
        answer: What becomes of a datum at a place in the format.
    """
    lines: list[Concept] = []

    def say(datum: str, at: str, i: int) -> None:
        status, how = answer(datum, i)
        lines.append(Concept(datum, at, status, how))

    def say_many(datum: str, places: list[tuple[str, int]], everywhere: str) -> None:
        fates = {answer(datum, i) for _, i in places}
        if len(places) == robot.n and len(fates) == 1:
            say(datum, everywhere, places[0][1])
        else:
            for at, i in places:
                say(datum, at, i)

    for datum in ("gravity", "base"):
        say(datum, "robot", -1)
    arms = [(stage.arm.name, i) for i, stage in enumerate(robot.stages)]
    say_many("kinematics", arms, "all arms")
    if robot.base_correction != VeitscheggerWu():
        say("corrections", "base", -1)
    say_many("corrections", [arms[i] for i, s in enumerate(robot.stages) if s.arm.correction != VeitscheggerWu()], "")
    say_many("inertia", arms, "all arms")
    say_many("shapes", [arms[i] for i, stage in enumerate(robot.stages) if stage.arm.shapes], "all arms")
    say("tool", "robot", -1)
    data = [list(joint_data(stage)) for stage in robot.stages]
    for datum in dict.fromkeys(datum for row in data for datum in row):
        places = [(robot.stages[i].joint.name, i) for i, row in enumerate(data) if datum in row]
        say_many(datum, places, "all joints")
    if robot.delay:
        say("delay", "robot", -1)
    if any(factor != 1.0 for factor in (*robot.kp_factor, *robot.kd_factor)):
        say("controller_gain", "robot", -1)
    return tuple(lines)


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
