"""An emitted Exudyn script, running: the model that its own functions build, under Exudyn's explicit solver."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..core.errors import RefusedError
from ..core.simulation.backend import MachineState, Vector
from ..core.simulation.drive_sheet import DriveSheet
from ..core.simulation.drives import Drives
from .driven import DrivenEngine
from .exudyn_stage import Stage


class ExudynEngine(DrivenEngine):
    """The model that the emitted script builds, stepped by Exudyn's explicit solver.

    Exudyn holds three models of the robot: its arms alone for statics, and, made when first needed, one whose motor
    sides move by torque and one whose motor sides follow a motion.
    """

    def __init__(self, script: dict[str, Any]) -> None:
        """Take the names that the script defines."""
        super().__init__(DriveSheet.from_data(script["DRIVES"]))
        self._script = script
        self._arms = script["build"]("none")
        self._motor = np.array(script["motor_coordinates"](True))
        self._models: dict[bool, _Driven] = {}
        self._running: _Driven | None = None

    def tool_in_base(self, q: Vector) -> Vector:
        """From sensors on the last link."""
        return self._script["tool_in_base"](self._arms, q)

    def mass_matrix(self, q: Vector) -> Vector:
        """From the solver's system mass matrix."""
        return self._script["mass_matrix_and_bias"](self._arms, q, np.zeros(self.n))[0]

    def bias(self, q: Vector, dq: Vector) -> Vector:
        """From the right-hand side of the equations of motion."""
        return self._script["mass_matrix_and_bias"](self._arms, q, dq)[1]

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """Mass matrix times acceleration, and bias."""
        mass, bias = self._script["mass_matrix_and_bias"](self._arms, q, dq)
        return mass @ ddq + bias

    def motor_inertia(self) -> Vector:
        """The mass matrix with the drives, less that of the arms."""
        driven = self._driven(imposed=False)
        with self._aside(driven):
            zeros = np.zeros(len(driven.model.x))
            both, _ = self._script["mass_matrix_and_bias"](driven.model, zeros, zeros)
        arms = self.mass_matrix(np.zeros(self.n))
        return np.diag(both)[self._motor] - np.where(self.elastic, 0.0, np.diag(arms))

    def drive_torque(self, q: Vector, dq: Vector, theta: Vector, dtheta: Vector) -> tuple[Vector, Vector]:
        """The right-hand side of the equations of motion with the drives, less that of the arms."""
        _, against = super().drive_torque(q, dq, theta, dtheta)
        driven = self._driven(imposed=False)
        with self._aside(driven):
            driven.hold(np.zeros(self.n))
            self.drives.load[:] = 0.0
            self.drives.stick_anchor[:] = theta
            self.drives.slip_anchor[:] = np.repeat(theta, np.diff(self.drives.table.slip_first))
            x, v = self._coordinates(driven, q, dq, theta, dtheta)
            total = -self._script["mass_matrix_and_bias"](driven.model, x, v)[1]
        total[: self.n] += self.bias(q, dq)
        # at a rigid joint both act on one coordinate
        on_arm = total[: self.n] - np.where(self.elastic, 0.0, against)
        return on_arm, np.where(self.elastic, total[self._motor], against)

    def hold(self, torque: Vector) -> None:
        """Into the force vector of the drives' object too, where Exudyn does all that the drives do."""
        super().hold(torque)
        if self._running is not None:
            self._running.hold(torque)

    def close(self) -> None:
        """Let Exudyn's containers go."""
        self._models.clear()
        self._running = None

    def _start(self, state: MachineState) -> None:
        self._running = None
        if self._imposed is None or self.elastic.any():
            driven = self._running = self._driven(imposed=self._imposed is not None)
            driven.stage.impose(self._imposed)
            driven.hold(np.zeros(self.n))
            x, v = self._coordinates(driven, state.q, state.dq, state.theta, state.dtheta)
            self._script["place"](driven.model, state.t, x, v)

    def _integrate(self, duration: float, steps: int) -> None:
        assert self._running is not None
        self._running.stage.begin(self._t, duration / steps)
        try:
            self._script["advance"](self._running.model, self._t, duration, steps)
        except RuntimeError as error:
            raise RefusedError(str(error)) from error

    def _integrated(self) -> MachineState:
        assert self._running is not None
        x, v = self._running.model.x, self._running.model.v
        motor = self._running.model.motor
        return MachineState(self._t, x[: self.n].copy(), v[: self.n].copy(), x[motor], v[motor])

    def _driven(self, *, imposed: bool) -> _Driven:
        if imposed not in self._models:
            self._models[imposed] = _Driven(self._script, self.drives, self._arms, imposed=imposed)
        return self._models[imposed]

    def _coordinates(
        self, driven: _Driven, q: Vector, dq: Vector, theta: Vector, dtheta: Vector
    ) -> tuple[Vector, Vector]:
        x, v = np.zeros(len(driven.model.x)), np.zeros(len(driven.model.x))
        x[driven.model.motor], v[driven.model.motor] = theta, dtheta
        x[: self.n], v[: self.n] = q, dq
        return x, v

    @contextmanager
    def _aside(self, driven: _Driven) -> Generator[None]:
        """Ask a model something at another state, and leave everything as it was."""
        model, command, memory = driven.model, driven.stage.command.copy(), self.drives.numbers.copy()
        t, x, v = model.mbs.systemData.GetTime(), model.x.copy(), model.v.copy()
        yield
        self.drives.numbers[:] = memory
        driven.hold(command)
        self._script["place"](model, t, x, v)


class _Driven:
    """The model with its drives, whose motor sides are free or imposed.

    Attributes:
        model: As the script built it.
        stage: The drives at each stage of the integrator.
    """

    def __init__(self, script: dict[str, Any], drives: Drives, arms: Any, *, imposed: bool) -> None:
        self._script, self._drives, self._arms = script, drives, arms
        self._native = script["LINEAR"] and not imposed
        motors = "imposed" if imposed else "free"
        accepted = self._accepted if drives.remembers else None
        self.model = script["build"](motors) if self._native else script["build"](motors, self._force, accepted)
        self.stage = Stage(drives, self.model.x, self.model.v, script["FLYWHEEL"])
        self._out = self.stage.out
        self._loads = drives.needs_load and not imposed

    def hold(self, torque: Vector) -> None:
        """Motor torques before the drives' gain."""
        self.stage.command[:] = torque
        if self._native:
            self._script["hold"](self.model, torque)

    def _force(self, mbs: Any, t: float, item: int, x: list[float], v: list[float]) -> Vector:
        """Torque on every coordinate; Exudyn asks at each stage."""
        if self._loads:
            self._solve_load(t)
        self.stage.evaluate(t, False)
        return self._out

    def _accepted(self, mbs: Any, t: float) -> bool:
        """What slips has slipped for good; Exudyn tells after each step."""
        if self._loads:
            self._solve_load(t)
        self.stage.evaluate(t, True)
        return True

    def _solve_load(self, t: float) -> None:
        """Torque that rigid joints pass, solved together with the accelerations."""
        self.stage.evaluate(t, False)
        drives = self._drives
        q, dq, theta, dtheta = (drives.q.copy(), drives.dq.copy(), drives.theta.copy(), drives.dtheta.copy())
        mass, bias = self._script["mass_matrix_and_bias"](self._arms, q, dq)
        drives.evaluate_loaded(t, q, dq, theta, dtheta, self.stage.command, mass, bias)
