"""A controller of others in the loop: a unit of FMI 2.0, which brings its law and its solver.

Its communication step is the loop's. It gets the signals of the communication point, takes one step, and what it then
puts out is its torque from that point on; between communication points it holds what it was given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..control import Control, ControllerUnit, UnitController, check_unit
from ..representation import Robot
from .partner import Seen

if TYPE_CHECKING:
    from ..motion import MotionLaw

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class UnitInLoop:
    """A unit that fits a robot, and what was found of its gains.

    Attributes:
        unit: The file.
        robot: Whose limits act.
        control: Mode torque; its limits act, its rate counts nothing.
        motion: The command.
        kp: Gains on position that it starts with, zeros where it shows none, shape (n,).
        start: Torque that it gives where nothing is off at t = 0, shape (n,).
    """

    unit: ControllerUnit
    robot: Robot
    control: Control
    motion: MotionLaw
    kp: Vector
    start: Vector

    @staticmethod
    def of(robot: Robot, unit: ControllerUnit, motion: MotionLaw, control: Control | None = None) -> UnitInLoop:
        """A unit that drives a robot; its native code is loaded, and asked for its gains.

        Args:
            robot: Whose limits act.
            unit: The controller.
            motion: The command.
            control: Mode torque: its limits; None: none.

        Raises:
            UsageError: They do not fit together.
            RefusedError: The unit fails, or the robot scales gains.
        """
        rules = control or unit.control()
        check_unit(robot, rules, unit)
        asked = UnitController(unit, robot, rules, motion, 0.0)
        return UnitInLoop(unit, robot, rules, motion, asked.kp, asked.feedforward_at_start())

    def feedforward_at_start(self) -> Vector:
        """Torque that it gives where nothing is off at t = 0, shape (n,)."""
        return self.start

    def running(self, interval: float, count: int, q: Vector, dq: Vector) -> RunningUnit:
        """A new instance of the unit; it reads q and dq when it is first asked for its torque."""
        rules = replace(self.control, rate=1.0 / interval)
        return RunningUnit(UnitController(self.unit, self.robot, rules, self.motion, (count + 0.5) * interval))

    def in_words(self) -> str:
        """What it is."""
        tool = f" ({self.unit.tool})" if self.unit.tool else ""
        return f"{self.unit.path.name}, a unit of FMI 2.0{tool}, with a solver of its own"

    def facts(self) -> dict[str, Any]:
        """What it is, as plain data."""
        start = "in equilibrium under the controller" if self.kp.any() else "at rest at the command"
        return {**self.unit.facts(), "start": start}


class RunningUnit:
    """An instance of a unit, a tick a communication point."""

    def __init__(self, controller: UnitController) -> None:
        """Nothing has been asked yet."""
        self._controller = controller
        self._point = 0

    def torque(self, q: Vector, dq: Vector) -> Vector:
        """What it gives at the communication point, having read q and dq there, shape (n,).

        Raises:
            RefusedError: The unit fails.
        """
        self._controller.tick(self._point, q, dq)
        return self._controller.held(self._point).copy()

    def advance(self, seen: Seen) -> None:
        """It went on by itself when it was asked for its torque."""
        self._point += 1

    def close(self) -> None:
        """Give back the instance."""
        self._controller.close()
