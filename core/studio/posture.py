"""Where a robot stands at rest with its motor sides at a position, and how far its tip is from where it should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..expansion import Expansion, expanded
from ..kinematics import Dynamics, Kinematics, dynamics, kinematics
from ..motion import hold
from ..representation import Robot
from ..simulation.settle import imposed_start

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Posture:
    """A robot at rest, all frames in its base.

    Attributes:
        theta: Commanded positions of the motor sides [rad or m], shape (n,).
        q: Positions of the arm sides, sagged [rad or m], shape (n,).
        arms: Veitschegger-Wu frames of the arms, shape (n, 4, 4).
        joints: Moving frames of the joints at their real places, shape (n, 4, 4).
        tool: Tool centre point, shape (4, 4).
        rigid_arms, rigid_tool: The same without any effect.
    """

    theta: Array
    q: Array
    arms: Array
    joints: Array
    tool: Array
    rigid_arms: Array
    rigid_tool: Array

    @property
    def error(self) -> Array:
        """From where the tip should be to where it is [m], in the base, shape (3,)."""
        return self.tool[:3, 3] - self.rigid_tool[:3, 3]


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """What is computed once of a robot, to find its postures quickly.

    Attributes:
        robot: With its effects.
        rigid: The same without any.
    """

    robot: Robot
    rigid: Robot
    _whole: Expansion
    _dynamics: Dynamics
    _kinematics: Kinematics
    _rigid: Kinematics
    _last: tuple[int, ...]

    @classmethod
    def of(cls, robot: Robot, rigid: Robot) -> Postures:
        """The postures of a robot.

        Raises:
            RefusedError: An arm that shall bend is too short to have a direction.
        """
        whole = expanded(robot, imposed=True)
        # bearings and bends stand as joints behind the driven one: an arm hangs on the last of them
        last = (*(i - 1 for i in whole.driven[1:]), whole.robot.n - 1)
        return cls(robot, rigid, whole, dynamics(whole.robot), kinematics(whole.robot), kinematics(rigid), tuple(last))

    def at(self, theta: Array) -> Posture:
        """The posture with the motor sides at theta, shape (n,).

        Raises:
            RefusedError: Its springs are too soft to hold it.
        """
        whole = self._whole
        offsets = np.array([stage.sensor.position_offset for stage in whole.robot.stages])
        law = hold(tuple(whole.spread(theta) - offsets), 1.0)
        q = imposed_start(whole.robot, self._dynamics, law).q
        return self._of(theta, q)

    def moving(self, theta: Array, q: Array) -> Posture:
        """The posture with the driven joints' arm sides at q, shape (n,), for pictures of a motion.

        Bearings and bends are drawn undeflected: a run records the driven joints only.
        """
        return self._of(theta, self._whole.spread(q))

    def _of(self, theta: Array, q: Array) -> Posture:
        driven, last = list(self._whole.driven), list(self._last)
        arms = self._kinematics.arms_in_base(q)
        joints = self._kinematics.joints_in_base(q)
        return Posture(
            theta,
            q[driven],
            arms[last],
            joints[driven],
            self._kinematics.tool_in_base(q),
            self._rigid.arms_in_base(theta),
            self._rigid.tool_in_base(theta),
        )
