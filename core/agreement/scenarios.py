"""The runs that are compared: rigid and elastic, imposed and controlled, without and with friction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..control import Control, default_pd
from ..errors import MbexportError
from ..motion import MotionLaw, motion_named
from ..representation import Drive, Robot
from .exercise import exercise
from .quantities import smooth

if TYPE_CHECKING:
    from ..database import Database

SCENARIOS = {
    "rigid_motion": "rigid joints, imposed motion",
    "rigid_loop": "rigid joints, closed loop",
    "compliant_motion": "elastic joints, imposed motion",
    "compliant_loop": "elastic joints, closed loop",
    "friction_loop": "closed loop with smooth friction",
    "stick_loop": "closed loop with friction that sticks",
}
"""Name and what it is, in the order in which a fault shows."""

# the longest steps that first-order integrators are judged at [s]
RIGID_STEP = 1.0e-3
ELASTIC_STEP = 1.0e-4


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """One run, the same in every engine.

    Attributes:
        name: Key of SCENARIOS.
        robot: The robot with what this run has of it.
        motion: Command.
        motion_name: "exercise", or a name that the motions know.
        control: Mode motion or pd.
        duration: [s].
        tip: Gate of the tool's position.
        first_step: Longest step of a first-order integrator [s].
        ordered: The equations are smooth, so that an integrator shows its order.
    """

    name: str
    robot: Robot
    motion: MotionLaw
    motion_name: str
    control: Control
    duration: float
    tip: str
    first_step: float
    ordered: bool = True

    @property
    def imposed(self) -> bool:
        """The motor sides follow the motion."""
        return self.control.mode == "motion"

    @property
    def elastic(self) -> tuple[bool, ...]:
        """Where motor and arm side are two coordinates."""
        return tuple(stage.drive.spring is not None for stage in self.robot.stages)

    @property
    def integrated(self) -> bool:
        """There is something to integrate: the robot is moved by torque, or a part of it gives."""
        return not self.imposed or gives(self.robot)


def scenarios(
    robot: Robot, names: Sequence[str], duration: float, *, database: Database | None = None
) -> tuple[Scenario, ...]:
    """Those of the named runs that this robot has.

    Args:
        robot: At its level.
        names: Keys of SCENARIOS.
        duration: Of each [s].
        database: Whose motions are used, where one is asked for by name.
    """
    rigid, compliant = as_rigid(robot), without_friction(robot)
    elastic = gives(robot)
    calm = exercise(robot, duration)
    path, path_name = calm, "exercise"
    if elastic and {"compliant_motion", "compliant_loop"} & set(names):
        path, path_name = _path(robot, calm, duration, database)
    made = {
        "rigid_motion": Scenario(
            "rigid_motion", rigid, calm, "exercise", Control(), duration, "imposed_tip", RIGID_STEP
        ),
        "rigid_loop": Scenario(
            "rigid_loop", rigid, calm, "exercise", default_pd(rigid), duration, "rigid_loop_tip", RIGID_STEP
        ),
    }
    if elastic:
        made["compliant_motion"] = Scenario(
            "compliant_motion", compliant, path, path_name, Control(), duration, "compliant_tip", ELASTIC_STEP
        )
        made["compliant_loop"] = Scenario(
            "compliant_loop", compliant, path, path_name, default_pd(compliant), duration, "loop_tip", ELASTIC_STEP
        )
    if rubs(robot):
        loop = default_pd(robot)
        made["friction_loop"] = Scenario(
            "friction_loop", smooth(robot), calm, "exercise", loop, duration, "friction_tip", ELASTIC_STEP
        )
        if robot.friction.model == "stick":
            made["stick_loop"] = Scenario(
                "stick_loop", robot, calm, "exercise", loop, duration, "stick_tip", ELASTIC_STEP, ordered=False
            )
    return tuple(made[name] for name in SCENARIOS if name in made and name in names)


def _path(robot: Robot, calm: MotionLaw, duration: float, database: Database | None) -> tuple[MotionLaw, str]:
    """A path with corners where the robot can follow one: the paper's, else a motion of the database, else none."""
    for name in ("greca", *(database.motions if database else ())):
        try:
            law = motion_named(robot, name, database=database)
        except MbexportError:
            continue
        if law.duration >= duration:
            return law, name
    return calm, "exercise"


def gives(robot: Robot) -> bool:
    """Whether some joint, bearing or arm is elastic."""
    return any(stage.drive.spring or stage.mount or stage.bend for stage in robot.stages)


def rubs(robot: Robot) -> bool:
    """Whether some drive has friction beyond the linear one."""
    return any(
        stage.drive.slips or any(term.kind in ("level", "resistance") for term in stage.drive.terms)
        for stage in robot.stages
    )


def as_rigid(robot: Robot) -> Robot:
    """The robot with rigid joints and arms, no friction beyond the linear one; rotors stay, dummy parts go."""
    robot = replace(robot, stages=tuple(replace(stage, mount=None, bend=None) for stage in robot.stages))
    return _with_drives(
        robot,
        lambda drive: replace(
            drive,
            spring=None,
            inertia=0.0 if drive.dummy else drive.inertia,
            dummy=False,
            terms=(),
            slips=(),
            stick=None,
        ),
    )


def without_friction(robot: Robot) -> Robot:
    """The robot without friction beyond the linear one."""
    return _with_drives(
        robot,
        lambda drive: replace(
            drive,
            terms=tuple(term for term in drive.terms if term.kind not in ("level", "resistance")),
            slips=(),
            stick=None,
        ),
    )


def _with_drives(robot: Robot, change: Callable[[Drive], Drive]) -> Robot:
    stages = tuple(replace(stage, drive=change(stage.drive)) for stage in robot.stages)
    return robot if stages == robot.stages else replace(robot, stages=stages)
