"""An emitted URDF file and script, running in PyBullet, in a connection of its own."""

from __future__ import annotations

import locale
import os
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import RefusedError
from ..core.simulation.backend import Emission, MachineState, Vector
from ..core.simulation.drive_sheet import DriveSheet
from .driven import DrivenEngine
from .pybullet_step import DriveStep
from .script import run_script


@contextmanager
def quiet() -> Generator[None]:
    """Keep what PyBullet's C code prints out of the process's streams."""
    sys.stdout.flush()
    sys.stderr.flush()
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # noqa: PTH123 (os.devnull is a name, not a place)
        kept = [(stream, os.dup(stream)) for stream in (1, 2)]
        try:
            for stream, _ in kept:
                os.dup2(nowhere.fileno(), stream)
            yield
        finally:
            for stream, copy in kept:
                os.dup2(copy, stream)
                os.close(copy)


@contextmanager
def decimal_points() -> Generator[None]:
    """Numbers have a point while PyBullet's C code reads them.

    In a process that speaks a language with decimal commas it takes 0.45 for 0, and says nothing.
    """
    before = locale.setlocale(locale.LC_NUMERIC)
    locale.setlocale(locale.LC_NUMERIC, "C")
    try:
        yield
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


class PybulletEngine(DrivenEngine):
    """The model that the emitted script loads. PyBullet steps the arms; the drives are stepped beside it, compiled."""

    def __init__(self, emission: Emission) -> None:
        """Load an emission.

        Raises:
            RefusedError: PyBullet cannot load the file.
        """
        with quiet():
            self._bullet: Any = import_module("pybullet")
        self._model: Any = None
        with tempfile.TemporaryDirectory(prefix="mbexport-") as folder:
            for name, text in emission.files.items():
                (Path(folder) / name).write_text(text, encoding="utf-8")
            self._script = run_script(emission.files[emission.main], str(Path(folder) / emission.main))
            with quiet(), decimal_points():
                try:
                    self._model = self._script["build"]()
                    self._script["mass_matrix"](self._model, [0.0] * len(self._model.joints))
                except (self._bullet.error, SystemError) as error:
                    self.close()
                    raise RefusedError(f"PyBullet cannot take {self._script['URDF']}: {error}") from error
        super().__init__(DriveSheet.from_data(self._script["DRIVES"]))
        self._drive_step = DriveStep(self.drives)
        self.command = self._drive_step.command
        self._body, self._client, self._joints = self._model.body, self._model.client, self._model.joints

    def tool_in_base(self, q: Vector) -> Vector:
        """From the loaded model's frames."""
        return self._script["tool_in_base"](self._model, q)

    def tools_in_base(self, q: Vector) -> Vector:
        """From the loaded model's frames."""
        return self._script["tool_in_base"](self._model, q)

    def mass_matrix(self, q: Vector) -> Vector:
        """As PyBullet calculates it."""
        return self._script["mass_matrix"](self._model, q)

    def bias(self, q: Vector, dq: Vector) -> Vector:
        """As PyBullet calculates it."""
        return self._script["inverse_dynamics"](self._model, q, dq, np.zeros(self.n))

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """As PyBullet calculates it."""
        return self._script["inverse_dynamics"](self._model, q, dq, ddq)

    def close(self) -> None:
        """End the connection."""
        if self._model is not None:
            self._bullet.disconnect(physicsClientId=self._model.client)
            self._model = None

    def _start(self, state: MachineState) -> None:
        self._drive_step.start(state, self._imposed)
        self._script["place"](self._model, state.q, state.dq)

    def _integrate(self, duration: float, steps: int) -> None:
        h = duration / steps
        bullet, body, client, joints, drive = self._bullet, self._body, self._client, self._joints, self._drive_step
        read, write, step, mode = (
            bullet.getJointStates,
            bullet.setJointMotorControlArray,
            bullet.stepSimulation,
            bullet.TORQUE_CONTROL,
        )
        q, dq, torque, needs_mass = drive.q, drive.dq, drive.torque, drive.needs_mass
        still = [0.0] * self.n
        bullet.setTimeStep(h, client)
        if drive.constant:
            forces = (self.drives.table.gain * self.command).tolist()
            for _ in range(steps):
                write(body, joints, mode, forces=forces, physicsClientId=client)
                step(client)
            states = read(body, joints, client)
            q[:], dq[:] = [state[0] for state in states], [state[1] for state in states]
            self._check_finite(duration)
            return
        position, speed = q.tolist(), dq.tolist()
        for k in range(steps):
            if needs_mass:
                drive.mass_matrix[:] = bullet.calculateMassMatrix(body, position, physicsClientId=client)
                state = (position, speed, still)
                drive.bias[:] = bullet.calculateInverseDynamics(body, *state, physicsClientId=client)
            drive.step(self._t + k * h, h)
            write(body, joints, mode, forces=torque.tolist(), physicsClientId=client)
            step(client)
            states = read(body, joints, client)
            position = [state[0] for state in states]
            speed = [state[1] for state in states]
            q[:] = position
            dq[:] = speed
        self._check_finite(duration)

    def _check_finite(self, duration: float) -> None:
        # PyBullet goes on at its limit of speed where a motion has exploded
        if not np.max(np.abs(self._drive_step.dq)) < self._script["UNLIMITED"]:
            raise self._not_finite(self._t + duration)

    def _integrated(self) -> MachineState:
        drive = self._drive_step
        rigid = ~self.elastic
        theta, dtheta = np.where(rigid, drive.q, drive.theta), np.where(rigid, drive.dq, drive.dtheta)
        return MachineState(self._t, drive.q.copy(), drive.dq.copy(), theta, dtheta)
