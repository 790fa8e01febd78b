"""What of a robot is the same along every run, made ready once: its bodies, and its drives' friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..expansion import Expansion, expanded
from ..kinematics import Dynamics, dynamics
from ..representation import Drive, FrictionModel, Robot, Sensor
from ..simulation.compiled import law_address, reads_arm, uses_load
from ..simulation.drive_law import DriveTable
from ..simulation.drive_sheet import DriveSheet
from ..simulation.drives import Drives

Vector = NDArray[np.float64]
Kept = TypeVar("Kept")

# full at so many times the speed by which it is smoothed: tanh(5) = 0.9999
FULL = 5.0
# robots that are tried side by side, each along several runs; and their drives
_REMEMBERED = 64
_DRIVES = 512


class Itself(Generic[Kept]):
    """An object as the key of what is remembered of it, by which object it is.

    To compare all that a robot consists of takes as long as to ask it along a short run.
    """

    __slots__ = ("kept",)

    def __init__(self, kept: Kept) -> None:
        """Of an object, which lives as long as it is remembered."""
        self.kept = kept

    def __hash__(self) -> int:
        return id(self.kept)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Itself) and self.kept is cast("Itself[object]", other).kept


@dataclass(frozen=True, slots=True, eq=False)
class Rubbing:
    """What of drives makes friction and torques on arms, as rigid ones whose sticking friction is smooth.

    Attributes:
        sheet: The drives.
        table: The same as arrays.
        errs: Whether a gear among them errs.
    """

    sheet: DriveSheet
    table: DriveTable
    errs: bool

    def drives(self, creep: Sequence[float]) -> Drives:
        """The drives, which rub in full from the creeping speeds on."""
        drives = Drives(self.sheet, table=self.table)
        drives.table.smooth_velocity[:] = np.array(creep) / FULL
        return drives


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """What moves where the motion of its motors is given; n joints, k with passive ones.

    Attributes:
        robot: Without what moves no body: friction, rotors, gains, limits.
        offsets: Of its encoders, shape (n,).
        whole: Its joints with passive ones.
        arms: Their dynamics.
        gears: Errors of its gears.
    """

    robot: Robot
    offsets: Vector
    whole: Expansion
    arms: Dynamics
    gears: Rubbing


@dataclass(frozen=True, slots=True, eq=False)
class Mechanism:
    """A robot, ready to be asked along runs; n joints.

    Attributes:
        robot: The robot.
        bodies: What moves; robots that differ in friction, rotors, gains or limits alone have the same.
        whole: Its joints with passive ones.
        rubbing: Its drives' friction, or nothing where `by_motors` has it.
        by_motors: Each joint's by itself where all go as their motors move, whatever these move; else nothing.
        loose: Whether an arm of it has clearance.
        rotors: Inertia of the motor sides, shape (n,).
        dummies: Where that is the paper's dummy part, shape (n,).
        gain, bias: Motors' constants, and offsets of torque sensors, shape (n,).
        offsets: Of its encoders.
        limits: Of its motors' torques.
    """

    robot: Robot
    bodies: Bodies
    whole: Expansion
    rubbing: Rubbing | None
    by_motors: tuple[Rubbing, ...]
    loose: bool
    rotors: Vector
    dummies: NDArray[np.bool_]
    gain: Vector
    bias: Vector
    offsets: tuple[float, ...]
    limits: tuple[float, ...]


def mechanism_of(robot: Robot) -> Mechanism:
    """The robot made ready, once."""
    return _mechanism(Itself(robot))


@lru_cache(maxsize=_REMEMBERED)
def _mechanism(key: Itself[Robot]) -> Mechanism:
    robot = key.kept
    drives, sensors = [stage.drive for stage in robot.stages], [stage.sensor for stage in robot.stages]
    whole = expanded(robot, imposed=True)
    by_motors = _apart(robot) if not whole.passive and all(map(_goes_as_its_motor, drives)) else ()
    return Mechanism(
        robot,
        _bodies(_without_drives(robot)),
        whole,
        None if by_motors else rubbing_of(whole.robot),
        by_motors,
        any(drive.spring is not None and drive.spring.gap > 0.0 for drive in drives),
        np.array([drive.inertia for drive in drives]),
        np.array([drive.dummy for drive in drives]),
        np.array([drive.gain for drive in drives]),
        np.array([sensor.torque_offset for sensor in sensors]),
        tuple(sensor.position_offset for sensor in sensors),
        tuple(drive.torque_limit for drive in drives),
    )


@lru_cache(maxsize=_REMEMBERED)
def _bodies(robot: Robot) -> Bodies:
    """Equal ones are the same, so that their motion along a run is worked out once."""
    whole = expanded(robot, imposed=True)
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    return Bodies(robot, offsets, whole, dynamics(whole.robot, always_compiled=True), rubbing_of(whole.robot))


def _without_drives(robot: Robot) -> Robot:
    """The robot without what moves no body where its motors' motion is given.

    But for rotors before a clearance, which are pushed away when an arm hits their side.
    """
    stages = tuple(
        replace(
            stage,
            drive=Drive(
                inertia=stage.drive.inertia if stage.drive.spring and stage.drive.spring.gap else 0.0,
                spring=stage.drive.spring,
                terms=tuple(term for term in stage.drive.terms if term.kind == "error"),
                arm_springs=stage.drive.arm_springs if stage.drive.spring else (),
            ),
            sensor=Sensor(stage.sensor.position_offset),
        )
        for stage in robot.stages
    )
    return Robot(robot.name, robot.gravity, robot.base, robot.base_correction, stages, robot.tool)


def _goes_as_its_motor(drive: Drive) -> bool:
    """Whether what rubs in a drive, and what pulls on its arm, needs no more to be known than how its motor moves."""
    if any(term.kind == "coupled" or uses_load(term.effect, term.law) for term in drive.terms):
        return False
    # behind a spring the arm is elsewhere
    pulled = bool(drive.arm_springs) or any(reads_arm(term.effect, term.law) for term in drive.terms)
    return not (drive.spring and pulled)


def rubbing_of(robot: Robot) -> Rubbing:
    """What of a robot's drives rubs."""
    return _rubbing(_rigid(DriveSheet.of(robot)))


def _apart(robot: Robot) -> tuple[Rubbing, ...]:
    """What of a robot's drives rubs, each joint's by itself."""
    sheet = _rigid(DriveSheet.of(robot))
    return tuple(
        _rubbing(replace(sheet, joints=(name,), kinds=(kind,), drives=(drive,)))
        for name, kind, drive in zip(sheet.joints, sheet.kinds, sheet.drives, strict=True)
    )


def _rigid(sheet: DriveSheet) -> DriveSheet:
    drives = (
        replace(drive, spring=None, stick=None, inertia=0.0, gain=1.0, torque_limit=math.inf, dummy=False)
        for drive in sheet.drives
    )
    return replace(sheet, drives=tuple(drives), friction=FrictionModel("smooth"), notes=())


@lru_cache(maxsize=_DRIVES)
def _rubbing(sheet: DriveSheet) -> Rubbing:
    """Equal ones are the same."""
    errs = any(term.kind == "error" for drive in sheet.drives for term in drive.terms)
    return Rubbing(sheet, sheet.table(law_address), errs)
