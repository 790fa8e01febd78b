"""A closed loop that can be solved in one piece or in two: robot, command, continuous controller, start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError, UsageError
from ..expansion import Expansion, expanded
from ..kinematics import dynamics
from ..representation import Robot
from ..simulation.backend import MachineState
from ..simulation.settle import controlled_start
from .partner import Partner

if TYPE_CHECKING:
    from ..motion import MotionLaw

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """What is coupled.

    Attributes:
        robot: At its level.
        whole: The robot as engines run it, with its passive joints.
        controller: Of the driven joints.
        duration: [s].
        start: Of all joints: at rest in equilibrium under the controller at the command of t = 0; without gains, at
            rest at that command.
        offsets: What the encoders of the driven joints add, shape (n,) [rad or m].
    """

    robot: Robot
    whole: Expansion
    controller: Partner
    duration: float
    start: MachineState
    offsets: Vector

    def seen(self, state: MachineState) -> tuple[Vector, Vector]:
        """Position and speed of the driven joints as the encoders report them, shapes (n,)."""
        driven = list(self.whole.driven)
        return state.theta[driven] + self.offsets, state.dtheta[driven]


@dataclass(slots=True)
class _SpreadGains:
    """Gains of all joints, as a start is settled by them."""

    kp: Vector
    feedforward: Vector

    def feedforward_at_start(self) -> Vector:
        """Torque added at t = 0, shape (n,)."""
        return self.feedforward


def loop_of(robot: Robot, controller: Partner, duration: float | None = None) -> Loop:
    """A closed loop, settled.

    Args:
        robot: At its level.
        controller: Of this robot.
        duration: How long [s]; None: the motion's duration.

    Raises:
        UsageError: The duration is none.
        RefusedError: The robot's delay would be one more delay in the loop; or it finds no rest.
    """
    length = controller.motion.duration if duration is None else duration
    if not length > 0.0:
        raise UsageError(f"duration {length!r} s: it must be above 0.")
    if robot.delay:
        raise RefusedError(
            f"{robot.name}: the effect delay belongs to a sampled controller, which a co-simulation has not; leave it "
            "out."
        )
    whole = expanded(robot, imposed=False)
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    motion: MotionLaw = controller.motion.shifted(-offsets).spread(whole.driven, whole.robot.n)
    gains = _SpreadGains(whole.spread(controller.kp), whole.spread(controller.feedforward_at_start()))
    start = controlled_start(whole.robot, dynamics(whole.robot), motion, gains)
    return Loop(robot, whole, controller, length, start, offsets)
