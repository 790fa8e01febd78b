"""What a program commands and where it starts, for formats that say it as functions of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.control import Control, Controller
from ..core.control.controller import feedforward_along
from ..core.kinematics import dynamics
from ..core.motion import MotionLaw
from ..core.representation import Robot
from ..core.simulation.backend import MachineState, Program, Vector
from ..core.simulation.settle import controlled_start, imposed_start


@dataclass(frozen=True, slots=True)
class Commanded:
    """A program's commands to the motor sides.

    Attributes:
        motion: What the motor sides follow, or are controlled to: the command less the encoders' offsets.
        start: Where a run of ours starts too.
        kp, kd: Gains with the robot's factors, shape (n,); zeros where there is no PD controller.
        limit: Cut of the commanded torque, the controller's and the drive's, shape (n,); inf is none.
        first: Torque at the start, before the drives' gain, shape (n,).
    """

    motion: MotionLaw
    start: MachineState
    kp: Vector
    kd: Vector
    limit: Vector
    first: Vector
    _command: MotionLaw
    _control: Control
    _robot: Robot

    def feedforward(self, times: Vector) -> Vector | None:
        """Torque of the nominal rigid bodies at the command, shape (m, n); None where the controller adds none."""
        if self._control.mode != "pd" or self._control.feedforward == "none":
            return None
        return feedforward_along(self._robot, self._control, *self._command.at(times))


def commanded(robot: Robot, program: Program) -> Commanded:
    """The commands of a program for a robot, both with all joints.

    Raises:
        RefusedError: The robot finds no rest to start from.
    """
    arms, control, n = dynamics(robot), program.control, robot.n
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    followed = program.motion.shifted(-offsets) if offsets.any() else program.motion
    limits = np.array([stage.drive.torque_limit for stage in robot.stages])
    if control.mode == "motion":
        start, zeros = imposed_start(robot, arms, followed), np.zeros(n)
        return Commanded(followed, start, zeros, zeros, limits, zeros, program.motion, control, robot)
    controller = Controller(robot, robot, control, program.motion, program.duration)
    start = controlled_start(robot, arms, followed, controller)
    controller.tick(0, start.theta + offsets, start.dtheta)
    limit = np.minimum(limits, control.torque_limit or np.inf)
    first = controller.held(0).copy()
    return Commanded(followed, start, controller.kp, controller.kd, limit, first, program.motion, control, robot)
