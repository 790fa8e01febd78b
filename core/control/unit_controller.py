"""A controller whose law is in a unit: at every tick it gets the signals, takes one communication step, and is held."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError, UsageError
from ..representation import Robot
from .control import Control
from .controller import Controller
from .pd_law import cut, speed
from .unit_file import ControllerUnit
from .unit_instance import UnitInstance

if TYPE_CHECKING:
    from ..motion import MotionLaw

Vector = NDArray[np.float64]

# what its inputs are moved by, to see what gains it starts with [rad or m]
PROBE = 1.0e-4
# how far a law may be from linear, and one joint from another, to count as gains
LINEAR = 1.0e-6


class UnitController(Controller):
    """The controller of a run, with a unit for its law.

    Its gains at t = 0 are found by moving the positions that it sees while it is being initialized: where each torque
    answers to its own joint alone, and against it, the run can start in equilibrium, as under the controller of ours.

    Attributes:
        settles: Its answer is that of gains; else the run starts at rest at the command.
    """

    def __init__(
        self, unit: ControllerUnit, robot: Robot, control: Control, motion: MotionLaw, duration: float
    ) -> None:
        """Load the unit, which executes its code, and ask it for its gains.

        Args:
            unit: The controller.
            robot: Whose delay and limits act.
            control: Mode torque; its rate is that of the communication steps.
            motion: The command.
            duration: Of the run [s].

        Raises:
            RefusedError: The unit fails.
            UsageError: The control part says another mode.
        """
        if control.mode != "torque":
            raise UsageError(f"a controller's unit drives by torque; the control part says mode {control.mode}.")
        super().__init__(robot, robot, control, motion, duration)
        self._command = motion.at(control.commanded_at(self.tick_times))
        self._unit = unit
        self._interval = 1.0 / control.rate
        self._instance: UnitInstance | None = None
        self._last = -1
        kp, self._start = self._gains()
        self.settles = bool(kp.any())
        self.kp = kp

    def reset(self) -> None:
        """Forget the last run: the next tick begins with a new instance."""
        super().reset()
        self.close()
        self._last = -1

    def feedforward_at_start(self) -> Vector:
        """Torque that the unit gives where nothing is off at t = 0, shape (n,)."""
        return self._start

    def asked(self) -> Vector:
        """Torque that was asked for at every tick, after its limits, shape (m, n)."""
        return self._table.torques

    def table(self) -> None:
        """None: the law is the unit's."""
        return

    def close(self) -> None:
        """Give back the unit."""
        if self._instance is not None:
            self._instance.close()
            self._instance = None

    def tick(self, k: int, q: Vector, dq: Vector) -> None:
        """As the contract says; the same tick again changes nothing, for a unit cannot go back."""
        if k == self._last:
            return
        dq = speed(self._table, k, q, dq)
        if self._instance is None:
            self._instance = UnitInstance(self._unit)
            self._feed(self._instance, k, q, dq)
            self._instance.initialize()
            self._instance.begin()
        self._feed(self._instance, k, q, dq)
        self._table.torques[k] = self._instance.step(float(self.tick_times[k]), self._interval)
        cut(self._table, k)
        self._last = k

    def _feed(self, instance: UnitInstance, k: int, q: Vector, dq: Vector) -> None:
        q_cmd, dq_cmd, ddq_cmd = (values[k] for values in self._command)
        values = {"q": q, "dq": dq, "q_cmd": q_cmd, "dq_cmd": dq_cmd, "ddq_cmd": ddq_cmd}
        for place, (_, port) in enumerate(self._unit.inputs):
            instance.inputs[place] = values[port.signal][port.joint]

    def _gains(self) -> tuple[Vector, Vector]:
        """Gains on position, zeros where the unit has none such, and the torque where nothing is off, shapes (n,)."""
        n = len(self._unit.torques)
        q_cmd, dq_cmd = (values[0] for values in self._command[:2])
        instance = UnitInstance(self._unit)
        try:
            self._feed(instance, 0, q_cmd, dq_cmd)
            instance.initialize()

            def answer(shift: Vector) -> Vector:
                self._feed(instance, 0, q_cmd + shift, dq_cmd)
                return instance.looked_at()

            middle = answer(np.zeros(n))
            above, below = (np.array([answer(sign * row) for row in PROBE * np.eye(n)]) for sign in (1.0, -1.0))
        finally:
            instance.close()
        slope = -(above - below) / (2.0 * PROBE)
        bend = np.abs(above + below - 2.0 * middle) / PROBE
        kp = np.diag(slope).copy()
        others = np.abs(slope - np.diag(kp))
        if not (np.isfinite(slope).all() and (kp > 0.0).all() and max(others.max(), bend.max()) < LINEAR * kp.min()):
            return np.zeros(n), np.zeros(n)
        return kp, middle


def check_unit(robot: Robot, control: Control, unit: ControllerUnit) -> None:
    """Refuse a unit that does not fit a robot, or a control part that does not fit a unit.

    Raises:
        UsageError: Another mode than torque, or another number of joints.
        RefusedError: The robot scales gains that a unit does not show.
    """
    if control.mode != "torque":
        raise UsageError(
            f"{unit.path.name} is the controller, and the control part says mode {control.mode}: leave it out, or "
            "let it be of mode torque, with the rate and the torque_limit that shall hold."
        )
    if len(unit.torques) != robot.n:
        raise UsageError(f"{unit.path.name} gives {len(unit.torques)} torques, {robot.name} has {robot.n} joints.")
    if {*robot.kp_factor, *robot.kd_factor} - {1.0}:
        raise RefusedError(
            f"{robot.name}: controller_gain scales the gains of a PD, which {unit.path.name} does not show; leave the "
            "effect out."
        )
