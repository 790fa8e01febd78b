"""A co-simulation unit of the Functional Mock-up Interface 2.0: its description, its C sources, its archive."""

from __future__ import annotations

import hashlib
import io
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..core.errors import RefusedError
from ..core.kinematics.dynamics import chain_table
from ..core.rendering import number, render
from ..core.representation import Robot
from ..core.simulation.backend import Program
from ..core.simulation.compiled import uses_load
from ..core.simulation.drive_law import ERROR_SLOPE
from ..core.simulation.drive_sheet import DriveSheet
from .commanded import commanded
from .fmu_kernels import kernel_text, law_name, law_text
from .fmu_variables import UNITS, Variable, law_parameters, variables_of

TORQUE_IN, MOTION_IN, PROGRAM = 1, 2, 3
# no contraction of products and sums, so that every compiler computes the same; nothing of this machine in the file
COMPILER_OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-s")
# an archive's dates: those of a zip's first day, so that the same robot gives the same bytes
FIRST_DAY = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Unit:
    """What an archive holds.

    Attributes:
        identifier: Name of the binary; an identifier of C.
        texts: File within the archive to text.
        variables: The real variables, by number.
        mode: What drives the joints where nothing is said: TORQUE_IN, MOTION_IN or PROGRAM.
    """

    identifier: str
    texts: Mapping[str, str]
    variables: tuple[Variable, ...]
    mode: int


def c_initializer(value: Any) -> str:
    """A number or nested lists of numbers as C initializes with them."""
    if isinstance(value, np.ndarray):
        return c_initializer(value.tolist())
    if isinstance(value, list | tuple):
        parts = [c_initializer(part) for part in cast("list[Any]", value)]
        return "{" + (", ".join(parts) or "0") + "}"
    if isinstance(value, int):
        return str(int(value))
    if math.isinf(value):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"
    return number(value)


def unit_of(robot: Robot, program: Program, header: list[str]) -> Unit:
    """The unit of a robot.

    Args:
        robot: With its passive joints.
        program: Of all its joints; what the unit runs by itself, and how it is meant to be driven.
        header: What stands at the head of every file.

    Raises:
        RefusedError: A law has no form in C, or the robot finds no rest to start from.
    """
    sheet = DriveSheet.of(robot)
    start = commanded(robot, program).start
    terms = [term for stage in robot.stages for term in stage.drive.terms]
    table = sheet.table(_nowhere)
    first = table.first.tolist()
    variables = variables_of(robot, program, start.theta) + tuple(law_parameters(robot, first))
    imposed = program.control.mode == "motion"
    still = program.motion.coefficients.shape[0] == 1
    mode = (MOTION_IN if still else PROGRAM) if imposed else TORQUE_IN
    identifier = re.sub(r"\W", "_", robot.name, flags=re.ASCII)
    q_cmd, dq_cmd, ddq_cmd = program.motion.at(0.0)
    slips = [stage.drive.slips for stage in robot.stages]
    values: dict[str, Any] = {
        "header": header,
        "n": robot.n,
        "terms": len(terms),
        "slips": len(table.slip_level),
        "knots": len(program.motion.knots),
        "powers": program.motion.coefficients.shape[0],
        "motion": program.motion,
        "kernels": kernel_text(),
        "laws": law_text(sheet.laws()),
        "law_names": [law_name(term.effect, term.law) for term in terms],
        "driven": [int(not stage.drive.passive) for stage in robot.stages],
        "dummy": [int(stage.drive.dummy) for stage in robot.stages],
        "first_term": _first_terms(robot),
        "slip_stiffness_share": [slip.stiffness / sum(s.stiffness for s in row) for row in slips for slip in row],
        "slip_level_share": [_share(slip.level, sum(s.level for s in row)) for row in slips for slip in row],
        "needs_load": int(
            any(
                uses_load(t.effect, t.law)
                for stage in robot.stages
                if not stage.drive.spring
                for t in stage.drive.terms
            )
        ),
        "sag": start.q - start.theta,
        "tool_rotation": robot.tool_in_last_joint().rotation_matrix(),
        "tool_position": robot.tool_in_last_joint().xyz,
        "q_cmd": q_cmd,
        "dq_cmd": dq_cmd,
        "ddq_cmd": ddq_cmd,
        "tau_cmd": [0.0] * robot.n,
        "mode": mode,
        "step": program.step,
        "delay": robot.delay,
        "theta_start": start.theta,
        "torque_limit": [stage.drive.torque_limit for stage in robot.stages],
        "gap": [stage.drive.spring.gap if stage.drive.spring else 0.0 for stage in robot.stages],
        "hysteresis_torque": [sum(slip.level for slip in row) for row in slips],
        "hysteresis_stiffness": [sum(slip.stiffness for slip in row) for row in slips],
        "position_offset": [stage.sensor.position_offset for stage in robot.stages],
        "torque_offset": [stage.sensor.torque_offset for stage in robot.stages],
        "chain": chain_table(robot)._asdict(),
        "drives": {name: value for name, value in table._asdict().items() if name != "laws"},
        "error_slope": ERROR_SLOPE,
        "places": [variable.place for variable in variables],
        "outputs": sum(variable.causality == "output" for variable in variables),
        "c": c_initializer,
    }
    interface = render("fmu/fmi2.h.j2")
    # the unit names itself by what it is made of
    guid = _guid(render("fmu/unit.c.j2", **values, guid="") + interface + repr(variables))
    description = render(
        "fmu/modelDescription.xml.j2",
        header=header,
        name=robot.name,
        guid=guid,
        description=f"{robot.name} at level {robot.level}, {robot.n} joints",
        identifier=identifier,
        duration=program.duration,
        mode=mode,
        units={unit: factors for unit, factors in UNITS.items() if any(v.unit == unit for v in variables)},
        variables=variables,
        outputs=[k for k, variable in enumerate(variables, start=1) if variable.causality == "output"],
    )
    texts = {
        "modelDescription.xml": description,
        "sources/fmi2.h": interface,
        "sources/unit.c": render("fmu/unit.c.j2", **values, guid=guid),
    }
    return Unit(identifier, texts, variables, mode)


def _nowhere(effect: str, law: str) -> int:
    """Address of a law, where none is called."""
    return 0


def _share(part: float, whole: float) -> float:
    return part / whole if whole else 0.0


def _first_terms(robot: Robot) -> list[int]:
    """For each term the number of the first term of the same effect at the same joint."""
    first: list[int] = []
    for stage in robot.stages:
        begin = len(first)
        effects = [term.effect for term in stage.drive.terms]
        first += [begin + effects.index(effect) for effect in effects]
    return first


def _guid(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def compiler() -> str | None:
    """The C compiler of this machine; None where there is none."""
    return next((found for name in ("gcc", "cc", "clang") if (found := shutil.which(name))), None)


def binary_place(identifier: str) -> str:
    """Where in an archive the binary of this platform stands."""
    platform, suffix = {"win32": ("win64", "dll"), "darwin": ("darwin64", "dylib")}.get(sys.platform, ("linux64", "so"))
    return f"binaries/{platform}/{identifier}.{suffix}"


def compiled_unit(unit: Unit, with_compiler: str) -> bytes:
    """The unit's sources as a shared library of this platform.

    Raises:
        RefusedError: The compiler refuses them.
    """
    with tempfile.TemporaryDirectory(prefix="mbexport-") as folder:
        for name, text in unit.texts.items():
            if name.startswith("sources/"):
                (Path(folder) / Path(name).name).write_text(text, encoding="utf-8")
        # names without a folder, so that no trace of this one gets into the file
        command = [with_compiler, *COMPILER_OPTIONS, "-o", "unit.bin", "unit.c", "-lm"]
        surroundings = {**os.environ, "LC_ALL": "C"}
        done = subprocess.run(command, cwd=folder, env=surroundings, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RefusedError(f"fmu: {with_compiler} cannot compile {unit.identifier}: {done.stderr.strip()[:500]}")
        return (Path(folder) / "unit.bin").read_bytes()


def archive(files: Mapping[str, str | bytes]) -> bytes:
    """Files as a zip archive: the same files give the same bytes."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_STORED) as packed:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, FIRST_DAY)
            entry.external_attr = 0o644 << 16
            packed.writestr(entry, content)
    return memory.getvalue()
