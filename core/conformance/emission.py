"""What is emitted: whole, the same bytes everywhere, every datum spoken of, every digit kept."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import PurePosixPath

from ..representation import Robot, Stage
from ..simulation.backend import Concept, Emission
from ..simulation.concepts import data_of
from .check import Check, ConformanceError, Refusals, must
from .subject import ROBOTS, Subject, robot

QUICK = ("planar2r", "scara")
STATUSES = ("exact", "approximated", "impossible")
# small beside every number, and larger than what rounding may take away on its way into a file
NUDGE = 1.0e-13
# what another process may differ in: seeds of hashes, language, place
ELSEWHERE = (
    {"PYTHONHASHSEED": "1", "LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0"},
    {"PYTHONHASHSEED": "4242", "LC_ALL": "de_DE.UTF-8", "LANG": "de_DE.UTF-8", "PYTHONUTF8": "1"},
)


def checks() -> Iterator[Check]:
    """Of this module."""
    for name in ROBOTS:
        quick = name in QUICK
        yield Check("emission", name, lambda subject, name=name: whole(subject, robot(name)), quick)
        yield Check("concepts", name, lambda subject, name=name: told(subject, robot(name)), quick)
        yield Check("digits", name, lambda subject, name=name: digits(subject, robot(name)), quick)
    yield Check("elsewhere", "", lambda subject: elsewhere(subject, "imece2013"), quick=True)


def whole(subject: Subject, model: Robot) -> Refusals:
    """Files with safe names and something in them, the same twice; the robot is left as it was."""
    before = repr(model)
    first, second = subject.emission(model), subject.emission(model)
    must(repr(model) == before, "emit has changed the robot.")
    name = subject.backend.name
    must(first.backend == name, f"emission.backend is {first.backend!r}; the backend is called {name!r}.")
    must(first.main in first.files, f"emission.main is {first.main!r}, which is none of {sorted(first.files)}.")
    for path, text in first.files.items():
        parts = PurePosixPath(path).parts
        safe = path and not path.startswith("/") and ".." not in parts and "\\" not in path
        must(bool(safe), f"the file {path!r} would lie outside of the folder.")
        must(bool(text.strip()), f"the file {path!r} is empty.")
        must("\r" not in text, f"the file {path!r} has carriage returns.")
    must(dict(first.files) == dict(second.files), "the same robot was emitted twice, and the texts differ.")
    must(first.concepts == second.concepts, "the same robot was emitted twice, and the concept reports differ.")
    text = "".join(first.files.values())
    must(model.source_hash in text, "no file names the hash of its source (robot.source_hash).")
    for note in model.notes:
        key = note.split(":")[0]
        must(key in text, f"no file repeats the robot's note {note!r}.")
    return ()


def told(subject: Subject, model: Robot) -> Refusals:
    """The concept report speaks of every datum of the robot, everywhere it has it."""
    concepts = subject.emission(model).concepts
    for concept in concepts:
        must(concept.status in STATUSES, f"{concept.datum} at {concept.at}: the status {concept.status!r} is none.")
        must(bool(concept.how.strip()), f"{concept.datum} at {concept.at}: how is empty.")
    silent = [
        f"{datum.name} at {at}"
        for datum in data_of(subject.whole(model).robot)
        for at, _ in datum.places
        if not any(_covers(concept, datum.name, at, datum.everywhere) for concept in concepts)
    ]
    must(not silent, f"the concept report is silent about {', '.join(silent)}.")
    return ()


def _covers(concept: Concept, datum: str, at: str, everywhere: str) -> bool:
    return concept.datum == datum and concept.at in (at, everywhere or at)


def digits(subject: Subject, model: Robot) -> Refusals:
    """A change of the 13th digit of a number changes the text, unless the report says that it is not in the files."""
    emission = subject.emission(model)
    lost = [
        what
        for what, datum, changed in _nudged(model)
        if _is_said(emission, datum) and dict(subject.emission(changed).files) == dict(emission.files)
    ]
    must(not lost, f"a change by {NUDGE!r} of itself is lost on its way into the files: {', '.join(lost)}.")
    return ()


def _is_said(emission: Emission, datum: str) -> bool:
    return any(concept.datum == datum and concept.status != "impossible" for concept in emission.concepts)


def _nudged(model: Robot) -> Iterator[tuple[str, str, Robot]]:
    """Numbers of the robot that are not 0, each with its datum and the robot in which it is a little larger."""

    def at(i: int, change: Callable[[Stage], Stage]) -> Robot:
        stages = list(model.stages)
        stages[i] = change(stages[i])
        return replace(model, stages=tuple(stages))

    more = 1.0 + NUDGE
    for i, stage in enumerate(model.stages):
        link, inertia, joint, drive = stage.arm.link, stage.arm.inertia, stage.joint, stage.drive
        for name in ("a", "d"):
            if value := getattr(link, name):
                arm = replace(stage.arm, link=replace(link, **{name: value * more}))
                yield f"{name} of {stage.arm.name}", "kinematics", at(i, lambda s, arm=arm: replace(s, arm=arm))
        for name in ("mass", "xx", "yy", "zz"):
            if value := getattr(inertia, name):
                arm = replace(stage.arm, inertia=replace(inertia, **{name: value * more}))
                yield f"{name} of {stage.arm.name}", "inertia", at(i, lambda s, arm=arm: replace(s, arm=arm))
        for name, datum in (("inertia", "rotor_inertia.inertia"), ("damping", "viscous_friction.coefficient")):
            if (value := getattr(drive, name)) and not (name == "inertia" and drive.dummy):
                new = replace(drive, **{name: value * more})
                yield f"{name} of {joint.name}'s drive", datum, at(i, lambda s, new=new: replace(s, drive=new))
        if drive.spring:
            new = replace(drive, spring=replace(drive.spring, stiffness=drive.spring.stiffness * more))
            datum = "joint_compliance.stiffness"
            yield f"stiffness of {joint.name}", datum, at(i, lambda s, new=new: replace(s, drive=new))
        for k, term in enumerate(drive.terms):
            terms = list(drive.terms)
            terms[k] = replace(term, parameters=(term.parameters[0] * more, *term.parameters[1:]))
            new = replace(drive, terms=tuple(terms))
            yield f"{term.effect} of {joint.name}", term.effect, at(i, lambda s, new=new: replace(s, drive=new))


def elsewhere(subject: Subject, name: str) -> Refusals:
    """Other processes, with other seeds of hashes, languages and folders, emit the same bytes."""
    expected = digest(subject.emission(robot(name)))
    kind = type(subject.backend)
    code = (
        "import sys; from mbexport.core.conformance.emission import emitted_elsewhere; "
        "print(emitted_elsewhere(*sys.argv[1:]))"
    )
    for settings in ELSEWHERE:
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(
                [sys.executable, "-c", code, kind.__module__, kind.__qualname__, name],
                cwd=folder,
                env={**os.environ, **settings, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
                capture_output=True,
                text=True,
                check=False,
            )
        if done.returncode:
            raise ConformanceError(f"another process with {settings} cannot emit {name}: {done.stderr.strip()[-500:]}")
        must(
            done.stdout.split() == [expected],
            f"another process with {settings} emits other bytes of {name} than this one.",
        )
    return ()


def emitted_elsewhere(module: str, kind: str, name: str) -> str:
    """Digest of what a backend, named by its class, makes of a built-in robot; for a process of its own."""
    from importlib import import_module

    backend = getattr(import_module(module), kind)()
    return digest(Subject(backend).emission(robot(name)))


def digest(emission: Emission) -> str:
    """SHA-256 of all that was emitted, the concept report included."""
    parts = [*sorted(emission.files.items()), *(repr(concept) for concept in emission.concepts)]
    return hashlib.sha256(repr((emission.main, parts)).encode()).hexdigest()
