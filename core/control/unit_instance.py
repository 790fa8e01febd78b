"""A controller's unit in this process. Making an instance loads and executes the native code of its file."""

from __future__ import annotations

import ctypes
import os
import shutil
import tempfile
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from .unit_file import ControllerUnit, fmpy_module

Vector = NDArray[np.float64]

# the last of what a unit says before it fails
_REMEMBERED = 3


class UnitInstance:
    """One instance of a unit, from its unpacking to its end.

    Attributes:
        inputs: What its inputs are set to next, in the order of the unit's, shape (m,).
    """

    def __init__(self, unit: ControllerUnit) -> None:
        """Unpack and load it.

        Raises:
            RefusedError: Its binary cannot be loaded, or it cannot be made.
        """
        fmpy, fmi2 = fmpy_module(), fmpy_module("fmpy.fmi2")
        self._unit = unit
        self._said: list[str] = []
        self._component: Any = None
        self._folder = tempfile.mkdtemp(prefix="mbexport-")
        references = [reference for reference, _ in unit.inputs]
        self.inputs: Vector = np.zeros(len(references))
        self._torques: Vector = np.zeros(len(unit.torques))
        self._given = _call_arguments(references, self.inputs)
        self._taken = _call_arguments(unit.torques, self._torques)
        self._callbacks = self._listening(fmi2)
        here = Path.cwd()
        try:
            fmpy.extract(str(unit.path), self._folder)
            with self._guarded("be loaded"):
                self._fmu: Any = fmi2.FMU2Slave(
                    guid=unit.guid,
                    unzipDirectory=self._folder,
                    modelIdentifier=unit.identifier,
                    instanceName="controller",
                )
                self._fmu.instantiate(callbacks=self._callbacks)
            self._component = self._fmu.component
            if not self._component:
                raise self._failed("be instantiated", "")
        except BaseException:
            self.close()
            raise
        finally:
            # the loader goes to the library's folder and stays there where it fails
            os.chdir(here)

    def initialize(self) -> None:
        """Set up with its parameters and the inputs, and stay where outputs can be looked at."""
        with self._guarded("be initialized"):
            self._fmu.setupExperiment(startTime=0.0)
            for reference, kind, value in self._unit.constants:
                if kind == "Real":
                    self._fmu.setReal([reference], [value])
                else:
                    setter = self._fmu.setInteger if kind == "Integer" else self._fmu.setBoolean
                    setter([reference], [int(value)])
            self._fmu.enterInitializationMode()
            for reference, value in self._unit.held:
                self._fmu.setReal([reference], [value])
            self._set()

    def looked_at(self) -> Vector:
        """Torques at the inputs while it is being initialized, shape (n,)."""
        with self._guarded("give its outputs"):
            self._set()
            return self._get().copy()

    def begin(self) -> None:
        """End of initialization."""
        with self._guarded("be initialized"):
            self._fmu.exitInitializationMode()

    def step(self, t: float, duration: float) -> Vector:
        """Torques after a communication step at t [s] with the inputs, shape (n,).

        Raises:
            RefusedError: It does not take the step, or gives what is no number.
        """
        with self._guarded(f"take its step at t = {t!r} s"):
            self._set()
            self._fmu.doStep(t, duration)
            torques = self._get()
        if not np.isfinite(torques).all():
            joint = int(np.argmin(np.isfinite(torques)))
            raise self._failed(f"go on at t = {t!r} s", f"its tau_{joint + 1} is {float(torques[joint])!r}")
        return torques

    def close(self) -> None:
        """Give back the instance, the library and what was unpacked."""
        if self._component:
            # a unit that failed may refuse to be ended, and is given up all the same
            with suppress(Exception):
                self._fmu.terminate()
            with suppress(Exception):
                self._fmu.freeInstance()
            self._component = None
        shutil.rmtree(self._folder, ignore_errors=True)

    def _set(self) -> None:
        self._fmu.fmi2SetReal(self._component, *self._given)

    def _get(self) -> Vector:
        self._fmu.fmi2GetReal(self._component, *self._taken)
        return self._torques

    def _listening(self, fmi2: Any) -> Any:
        """Callbacks that keep what the unit says, and print nothing."""

        def hear(_: Any, __: Any, ___: Any, ____: Any, message: bytes | None) -> None:
            self._said.append((message or b"").decode("utf-8", "replace").strip())
            del self._said[:-_REMEMBERED]

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(hear)
        callbacks.allocateMemory = fmi2.defaultCallbacks.allocateMemory
        callbacks.freeMemory = fmi2.defaultCallbacks.freeMemory
        # messages are formats with arguments behind, which only C can put together
        add: Callable[[Any], None] = fmpy_module("fmpy.logging").addLoggerProxy
        add(ctypes.byref(callbacks))
        return callbacks

    @contextmanager
    def _guarded(self, doing: str) -> Generator[None, None, None]:
        try:
            yield
        except RefusedError:
            raise
        except Exception as error:
            # FMPy raises bare Exception where a library cannot be loaded or a call fails
            raise self._failed(doing, " ".join(str(error).split())) from error

    def _failed(self, doing: str, why: str) -> RefusedError:
        said = "; ".join(text for text in (why, *self._said) if text)
        told = "".join(char if char.isprintable() else " " for char in said)[:500]
        return RefusedError(f"controller {self._unit.path.name} cannot {doing}{f': {told}' if told else ''}.")


def _call_arguments(references: Sequence[int], values: Vector) -> tuple[Any, int, Any]:
    """References, how many, and where their values stand, as the interface's calls have them."""
    numbers = (ctypes.c_uint * len(references))(*references)
    return numbers, len(references), values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
