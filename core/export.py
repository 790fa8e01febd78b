"""Emission: a robot to the files of one or more formats, with a report of what each format could say."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import RefusedError, UsageError
from .expansion import expanded
from .files import write_whole
from .representation import Robot
from .simulation.backend import Backend, Emission, Program
from .simulation.backends import backend_named
from .simulation.program import whole_program

if TYPE_CHECKING:
    from .control import Control
    from .motion import MotionLaw

# what a script runs by itself where nothing is said [s]
DEFAULT_DURATION = 1.0
CONCEPT_SCHEMA = "mbexport-concepts/1"


def default_program(robot: Robot, motion: MotionLaw | None = None, control: Control | None = None) -> Program:
    """What an emitted script runs: the motion imposed, or under a controller; without a motion it holds home."""
    from .control import Control
    from .motion import hold

    law = motion or hold(robot.home(), DEFAULT_DURATION)
    return Program(law, control or Control(), law.duration, 1.0e-3)


def export(
    robot: Robot,
    backends: Sequence[str],
    folder: Path | str,
    *,
    motion: MotionLaw | None = None,
    control: Control | None = None,
    meshes: Path | None = None,
    strict: bool = False,
    force: bool = False,
) -> dict[str, Emission]:
    """Emit a robot in several formats; everything is written, or nothing.

    Args:
        robot: As built.
        backends: Names of the backends.
        folder: Where to; with several backends each gets a folder of its name in it.
        motion: What an emitted script runs by itself; None: it holds home.
        control: Under which controller; None: the motion is imposed.
        meshes: Folder that the robot's meshes are relative to (its database's); they are copied beside each model.
        strict: A datum that a format approximates or cannot say is an error.
        force: Write over files that are there.

    Returns:
        What was emitted, by backend.

    Raises:
        RefusedError: A backend refuses the robot, or `strict` and something is not exact; nothing is written.
        UsageError: A file is in the way.
    """
    emissions = _emitted(robot, [backend_named(name) for name in dict.fromkeys(backends)], motion, control)
    if strict:
        _insist_on_exact(emissions)
    files: dict[str, str | bytes] = {}
    pictures = _mesh_files(robot, meshes)
    for name, emission in emissions.items():
        prefix = f"{name}/" if len(emissions) > 1 else ""
        files.update({prefix + path: content for path, content in pictures.items()})
        files.update({prefix + path: content for path, content in (*emission.files.items(), *emission.packed.items())})
        files[f"{prefix}{robot.name}.concepts.json"] = concept_report(robot, emission)
    write_whole(Path(folder), files, force=force)
    return emissions


def _emitted(
    robot: Robot, backends: Sequence[Backend], motion: MotionLaw | None, control: Control | None
) -> dict[str, Emission]:
    """What each backend makes of a robot, in their order; compilers work while the others emit."""
    early = sorted(backends, key=lambda backend: not backend.compiles)
    begun = {backend.name: _begun(robot, backend, motion, control) for backend in early}
    return {backend.name: begun[backend.name]() for backend in backends}


def _mesh_files(robot: Robot, folder: Path | None) -> dict[str, bytes]:
    """The robot's meshes by their relative names; they must be there, since models refer to them."""
    names = sorted({shape.mesh for stage in robot.stages for shape in stage.arm.shapes if shape.mesh})
    if names and folder is None:
        raise UsageError(f"{robot.name} has meshes ({names[0]} ...); say in which folder they are (meshes=...).")
    files: dict[str, bytes] = {}
    for name in names:
        try:
            files[name] = ((folder or Path()) / name).read_bytes()
        except OSError as error:
            raise UsageError(f"mesh {name!r} of {robot.name} cannot be read: {error.strerror}.") from error
    return files


def emit(robot: Robot, backend: Backend, motion: MotionLaw | None = None, control: Control | None = None) -> Emission:
    """What one backend makes of a robot.

    Raises:
        RefusedError: It refuses the robot.
    """
    return _begun(robot, backend, motion, control)()


def _begun(robot: Robot, backend: Backend, motion: MotionLaw | None, control: Control | None) -> Callable[[], Emission]:
    program = default_program(robot, motion, control)
    # a model without a program of its own is for torque: its passive joints are free joints on springs
    imposed = program.control.mode == "motion" and backend.scripted
    whole = expanded(robot, imposed=imposed)
    reason = backend.refusal(whole.robot, None)
    if reason is not None:
        raise RefusedError(f"{backend.name} refuses {robot.name}: {reason}")
    if robot.effects or motion is not None or control is not None:
        from .simulation.step import choose_step, poses_of

        poses = whole.spread(poses_of(robot, program.motion))
        step = choose_step(whole.robot, backend, imposed=program.control.mode == "motion", poses=poses)
        program = replace(program, step=step)
    return backend.begin(whole.robot, whole_program(whole, program))


def concept_report(robot: Robot, emission: Emission) -> str:
    """What became of every datum, as JSON text."""
    counts = Counter(concept.status for concept in emission.concepts)
    report: dict[str, Any] = {
        "schema": CONCEPT_SCHEMA,
        "robot": robot.name,
        "level": robot.level,
        "effects": list(robot.effects),
        "source_hash": robot.source_hash,
        "backend": emission.backend,
        "main": emission.main,
        "counts": {status: counts[status] for status in ("exact", "approximated", "impossible")},
        "notes": list(robot.notes),
        "concepts": [asdict(concept) for concept in emission.concepts],
    }
    return json.dumps(report, indent=1) + "\n"


def _insist_on_exact(emissions: dict[str, Emission]) -> None:
    inexact = [
        f"  {name}: {concept.datum} at {concept.at} is {concept.status}: {concept.how}"
        for name, emission in emissions.items()
        for concept in emission.concepts
        if concept.status != "exact"
    ]
    if inexact:
        raise RefusedError("--strict, and not everything can be said exactly:\n" + "\n".join(inexact))
