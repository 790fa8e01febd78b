"""Which data a robot has, under one name each, and what a format made of every one of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ..representation import Robot, Stage, VeitscheggerWu
from .backend import Concept, Status

Fate = tuple[Status, str]
Answer = Callable[[str, int], Fate]
"""answer(datum, i) -> (status, how); i is the stage, from 0, and -1 for the robot or its base."""


@dataclass(frozen=True, slots=True)
class Datum:
    """One datum of a robot and where it has it.

    Attributes:
        name: As in `Concept.datum`.
        places: (where, number of the stage from 0); the robot and its base have number -1.
        everywhere: What stands for all places at once: "all arms", "all joints"; "" where they are told one by one.
    """

    name: str
    places: tuple[tuple[str, int], ...]
    everywhere: str = ""


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


def data_of(robot: Robot) -> tuple[Datum, ...]:
    """Every datum that a robot has, in a fixed order: what a concept report must speak of."""
    stages = robot.stages
    arms = tuple((stage.arm.name, i) for i, stage in enumerate(stages))
    whole = (("robot", -1),)
    found = [Datum("gravity", whole), Datum("base", whole), Datum("kinematics", arms, "all arms")]
    if robot.base_correction != VeitscheggerWu():
        found.append(Datum("corrections", (("base", -1),)))
    found.append(
        Datum("corrections", tuple(arms[i] for i, s in enumerate(stages) if s.arm.correction != VeitscheggerWu()))
    )
    found.append(Datum("inertia", arms, "all arms"))
    found.append(Datum("shapes", tuple(arms[i] for i, s in enumerate(stages) if s.arm.shapes), "all arms"))
    found.append(Datum("tool", whole))
    rows = [list(joint_data(stage)) for stage in stages]
    for name in dict.fromkeys(name for row in rows for name in row):
        places = tuple((stages[i].joint.name, i) for i, row in enumerate(rows) if name in row)
        found.append(Datum(name, places, "all joints"))
    if robot.delay:
        found.append(Datum("delay", whole))
    if any(factor != 1.0 for factor in (*robot.kp_factor, *robot.kd_factor)):
        found.append(Datum("controller_gain", whole))
    return tuple(datum for datum in found if datum.places)


def concepts_of(robot: Robot, answer: Answer) -> tuple[Concept, ...]:
    """Concept report of a robot: every datum that it has, in a fixed order; alike joints are one line.

    Args:
        robot: The robot.
        answer: What becomes of a datum at a place in the format.
    """
    lines: list[Concept] = []
    for datum in data_of(robot):
        fates = [answer(datum.name, i) for _, i in datum.places]
        if datum.everywhere and len(datum.places) == robot.n and len(set(fates)) == 1:
            lines.append(Concept(datum.name, datum.everywhere, *fates[0]))
        else:
            lines += [Concept(datum.name, at, *fate) for (at, _), fate in zip(datum.places, fates, strict=True)]
    return tuple(lines)
