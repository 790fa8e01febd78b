"""A controller as a co-simulation unit of FMI 2.0: its file, checked. Nothing of it is executed here."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import InputError, Problem, UsageError
from .control import DEFAULT_RATE, HIGHEST_RATE, Control
from .unit_signals import INPUTS, OUTPUT, Port, Signals, port_named

VERSION = "2.0"
DESCRIPTION = "modelDescription.xml"
# a description is a page of XML, and an archive that fills the disk is no controller [bytes]
LARGEST_DESCRIPTION = 2**24
LARGEST_ARCHIVE = 2**30
_NUMERIC = ("Real", "Integer", "Boolean")


@dataclass(frozen=True, slots=True)
class ControllerUnit:
    """A unit whose inputs and outputs are known to fit a robot.

    Attributes:
        path: The file.
        digest: SHA-256 of the file, hex.
        model: Name of the model.
        tool: What exported it; "" where it does not say.
        identifier: Name of its binary.
        guid: What the binary is asked for.
        inputs: Reference of a variable and the signal that it gets.
        constants: Reference, type and value of variables that are set once, before it starts.
        held: Reference and value of inputs that are held.
        torques: References of tau_1 ... tau_n, in this order.
        rate: Communication steps a second that it asks for [Hz].
    """

    path: Path
    digest: str
    model: str
    tool: str
    identifier: str
    guid: str
    inputs: tuple[tuple[int, Port], ...]
    constants: tuple[tuple[int, str, float], ...]
    held: tuple[tuple[int, float], ...]
    torques: tuple[int, ...]
    rate: float

    def control(self) -> Control:
        """How a run says what drives it: torques, at the unit's own rate."""
        return Control("torque", rate=self.rate)

    def facts(self) -> dict[str, Any]:
        """What a run says of its controller."""
        return {
            "file": self.path.name,
            "sha256": self.digest,
            "model": self.model,
            "tool": self.tool,
            "fmi": VERSION,
        }


def fmpy_module(name: str = "fmpy") -> Any:
    """A module of FMPy, which few need and which is an extra therefore.

    Raises:
        UsageError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise UsageError(f"a controller's unit is run by FMPy: pip install 'mbexport[fmi]' ({error}).") from error


def read_unit(path: Path, n: int, signals: Signals | None = None) -> ControllerUnit:
    """A controller's unit for a robot of n joints; its code is not loaded.

    Args:
        path: The .fmu.
        n: Number of joints.
        signals: What its variables mean where their names do not say it.

    Raises:
        InputError: It is no such unit, or lacks what is needed; with all problems.
        UsageError: FMPy is not installed.
    """
    fmpy = fmpy_module()
    names = _members(path)
    _check_version(path)
    try:
        description = fmpy.read_model_description(str(path))
    except Exception as error:
        # FMPy raises what its XML library raises, bare Exception too
        raise _unfit(path, f"its {DESCRIPTION} cannot be read: {_one_line(error)}") from error
    problems = _Problems(path)
    interface = description.coSimulation
    identifier = str(interface.modelIdentifier) if interface else ""
    if not interface:
        problems("it is made for model exchange only; export it for co-simulation.")
    else:
        place = f"binaries/{fmpy.platform}/{identifier}{fmpy.sharedLibraryExtension}"
        if place not in names:
            there = sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name[9:]})
            has = f"it has binaries for {', '.join(there)} only" if there else "it has no binary at all"
            cure = "; `fmpy compile` makes one of its sources" if any(n.startswith("sources/") for n in names) else ""
            problems(f"there is no binary for this platform ({place}): {has}{cure}.")
    wiring = _Wiring(problems, n, signals or Signals())
    wiring.connect(description.modelVariables)
    if problems.found:
        raise InputError(problems.found)
    asked = getattr(description.defaultExperiment, "stepSize", None)
    step = float(asked) if asked else 0.0
    return ControllerUnit(
        path,
        hashlib.sha256(path.read_bytes()).hexdigest(),
        str(description.modelName),
        str(description.generationTool or ""),
        identifier,
        str(description.guid),
        tuple(wiring.inputs),
        tuple(wiring.constants),
        tuple(wiring.held),
        tuple(wiring.torques[joint] for joint in range(n)),
        1.0 / step if step >= 1.0 / HIGHEST_RATE else DEFAULT_RATE,
    )


class _Problems:
    """Collects what is wrong with a unit."""

    def __init__(self, path: Path) -> None:
        self.found: list[Problem] = []
        self._file = str(path)

    def __call__(self, message: str, variable: str | None = None) -> None:
        self.found.append(Problem(message, file=self._file, column=variable))


class _Wiring:
    """Which variable gets which signal."""

    def __init__(self, problems: _Problems, n: int, signals: Signals) -> None:
        self.inputs: list[tuple[int, Port]] = []
        self.held: list[tuple[int, float]] = []
        self.constants: list[tuple[int, str, float]] = []
        self.torques: dict[int, int] = {}
        self._problems, self._n, self._signals = problems, n, signals

    def connect(self, variables: Any) -> None:
        by_name: dict[str, Any] = {str(variable.name): variable for variable in variables}
        mapped: tuple[tuple[Mapping[str, Any], str], ...] = (
            (self._signals.inputs, "input"),
            (self._signals.outputs, "output"),
            (self._signals.parameters, "parameter"),
        )
        for names, causality in mapped:
            for name in names:
                if name not in by_name or by_name[name].causality != causality:
                    has = [other for other, variable in by_name.items() if variable.causality == causality]
                    self._problems(f"the unit has no {causality} of that name; it has {_listed(has)}.", name)
        for name, variable in by_name.items():
            if variable.causality == "input":
                self._input(name, variable)
            elif variable.causality == "output":
                self._output(name, variable)
            elif variable.causality == "parameter" and name in self._signals.parameters:
                self._parameter(name, variable, self._signals.parameters[name])
        missing = [f"{OUTPUT}_{joint + 1}" for joint in range(self._n) if joint not in self.torques]
        if missing:
            has = [name for name, variable in by_name.items() if variable.causality == "output"]
            self._problems(
                f"no output gives {_listed(missing)}; its outputs are {_listed(has)}. Name them so, or map them "
                "in a file of signals (outputs: {u1: tau_1})."
            )

    def _input(self, name: str, variable: Any) -> None:
        said: str | float = self._signals.inputs.get(name, name)
        if variable.type != "Real":
            self._problems(f"an input has to be Real, it is {variable.type}.", name)
        elif not isinstance(said, str):
            self.held.append((int(variable.valueReference), said))
        else:
            port = port_named(said)
            if port is None or port.signal == OUTPUT:
                known = ", ".join(f"{signal}_1" for signal in INPUTS)
                self._problems(
                    f"no signal of a robot has this name ({known}, ...); map it in a file of signals "
                    f"(inputs: {{{name}: q_1}}, or a number to hold it at).",
                    name,
                )
            elif self._has(port, name):
                self.inputs.append((int(variable.valueReference), port))

    def _output(self, name: str, variable: Any) -> None:
        said: str = self._signals.outputs.get(name, name)
        port = port_named(said)
        # what else it puts out is its own business
        if port is None or port.signal != OUTPUT or not self._has(port, name):
            return
        if variable.type != "Real":
            self._problems(f"a torque has to be Real, it is {variable.type}.", name)
        elif port.joint in self.torques:
            self._problems(f"{OUTPUT}_{port.joint + 1} is given by another output already.", name)
        else:
            self.torques[port.joint] = int(variable.valueReference)

    def _parameter(self, name: str, variable: Any, value: float) -> None:
        if variable.type not in _NUMERIC:
            self._problems(f"only parameters that are numbers can be set, it is {variable.type}.", name)
        elif variable.type != "Real" and not value.is_integer():
            self._problems(f"it is {variable.type}, and {value!r} is not.", name)
        else:
            self.constants.append((int(variable.valueReference), str(variable.type), value))

    def _has(self, port: Port, name: str) -> bool:
        if port.joint < self._n:
            return True
        self._problems(f"it means joint {port.joint + 1}, and the robot has {self._n}.", name)
        return False


def _members(path: Path) -> frozenset[str]:
    """Names of the archive's files, once they are safe to unpack."""
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
    except FileNotFoundError as error:
        raise _unfit(path, "there is no such file.") from error
    except (OSError, zipfile.BadZipFile) as error:
        raise _unfit(path, f"it is no unit: a .fmu is a zip archive ({_one_line(error)}).") from error
    sizes = {entry.filename: entry.file_size for entry in entries}
    if DESCRIPTION not in sizes:
        raise _unfit(path, f"it is no unit: there is no {DESCRIPTION} in it.")
    if sizes[DESCRIPTION] > LARGEST_DESCRIPTION:
        raise _unfit(path, f"its {DESCRIPTION} has {sizes[DESCRIPTION]} bytes; it may have {LARGEST_DESCRIPTION}.")
    # of every entry: one name may stand there twice
    unpacked = sum(entry.file_size for entry in entries)
    if unpacked > LARGEST_ARCHIVE:
        raise _unfit(path, f"unpacked it has {unpacked} bytes; it may have {LARGEST_ARCHIVE}.")
    strays = [name for name in sizes if name.startswith("/") or "\\" in name or ".." in name.split("/")]
    if strays:
        raise _unfit(path, f"{strays[0]!a} would be unpacked outside of its folder.")
    return frozenset(sizes)


def _check_version(path: Path) -> None:
    """The version first: what FMPy says of another one is about everything else."""
    from defusedxml import ElementTree

    try:
        with zipfile.ZipFile(path) as archive:
            root: Any = ElementTree.fromstring(archive.read(DESCRIPTION))
    except Exception as error:
        raise _unfit(path, f"its {DESCRIPTION} cannot be read: {_one_line(error)}") from error
    version = str(root.get("fmiVersion"))
    if version != VERSION:
        raise _unfit(path, f"it is of FMI {version}; a controller is a co-simulation unit of FMI {VERSION}.")


def _unfit(path: Path, message: str) -> InputError:
    return InputError((Problem(message, file=str(path)),))


def _listed(names: list[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "") if names else "none"


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__
