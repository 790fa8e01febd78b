"""Do all engines run the same robot, and is it the robot of the tables?"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MbexportError, PluginError, RefusedError, UsageError
from ..kinematics import reach
from ..motion import hold, motion_named
from ..representation import Robot
from ..simulation.backend import Backend, Engine, Program, Vector
from ..simulation.backends import backend_named, backend_names
from ..simulation.step import choose_step
from .agreement import Agreement, Omission, RunFacts, Voice
from .compare import (
    Order,
    compare_commands,
    compare_knots,
    compare_motions,
    compare_runs,
    compare_statics,
    orders,
    plainly_controlled,
)
from .convergence import convergence
from .culprit import TABLES, Evidence, Finding, find
from .quantities import COUNT, STATICS, States, ask_engine, ask_tables, random_states, smooth
from .reference import Tables, UnreadError, read
from .runs import Run, no_run, refusal, run_all
from .scenarios import SCENARIOS, Scenario, gives, scenarios

if TYPE_CHECKING:
    from ..database import Database

DURATION = 2.0
"""Of every run [s]: longer ones grow differences that no integrator is to blame for."""

ORDERS = "convergence"
"""Name of the study of error against step, beside STATICS and SCENARIOS."""


def agree(
    source: str | Path | Database,
    backends: str | Iterable[str | Backend] = "all",
    level: str = "full",
    *,
    effects: Iterable[str] | None = None,
    with_effects: Path | None = None,
    quantities: Iterable[str] | None = None,
    duration: float = DURATION,
    states: int = COUNT,
    tell: Callable[[str, int, int], None] | None = None,
) -> Agreement:
    """Compare backends, and the text of the tables, on one robot.

    Args:
        source: A database: its path, the name of a built-in robot, or in memory.
        backends: "all" (every one that can run; others are named), or names, or backends.
        level: Of the robot.
        effects: Names of effects instead of a level.
        with_effects: Folder of effects' tables that count at any level, and whose rows replace the database's.
        quantities: Names of static quantities and of runs (quantities.STATICS, scenarios.SCENARIOS), and "convergence",
            the errors against the step; None: all.
        duration: Of every run [s].
        states: How many random states statics are asked at.
        tell: Called with what is being done, how much is done and how much there is.

    Raises:
        UsageError: Unknown names.
        InputError: The database is wrong.
    """
    from ..build import build
    from ..database import Database, load, load_effects, write
    from ..database import with_effects as replaced
    from ..database.sources import find as find_source

    known = (*STATICS, *SCENARIOS, ORDERS)
    wanted = tuple(known if quantities is None else quantities)
    for name in wanted:
        if name not in known:
            raise UsageError(f"no quantity {name!r}; known: {', '.join(known)}.")
    if not duration > 0.0:
        raise UsageError(f"duration {duration!r} s: it must be above 0.")
    left_out: list[Omission] = []
    chosen = _backends(backends, left_out)
    with tempfile.TemporaryDirectory() as scratch:
        if isinstance(source, Database):
            # the fifth voice needs a text
            path = Path(scratch) / "robot"
            write(source, path)
            database = source
        else:
            path, database = find_source(source), load(source)
        names = None if effects is None else tuple(effects)
        level = level if names is None else "full"
        if with_effects is not None:
            database = replaced(database, load_effects(with_effects, database, level), level)
        robot = build(database, level, names)
        used = robot.effects if names is not None else None

        def text_of(only: Iterable[str] | None) -> Tables:
            return read(path, only, level, replaced=with_effects)

        tables = bare = None
        without: dict[str, Callable[[], Tables]] = {}
        try:
            tables, bare = text_of(used), text_of(())
            every = tuple(tables.effects)
            without = {name: lambda name=name: text_of([other for other in every if other != name]) for name in every}
        except UnreadError as error:
            left_out.append(Omission(TABLES, "everything", f"{error}"))
        return _compared(
            _Subject(robot, database, tables, bare, without), chosen, wanted, duration, states, left_out, tell
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Subject:
    """The robot in all its forms."""

    robot: Robot
    database: Database
    tables: Tables | None
    bare: Tables | None
    without: Mapping[str, Callable[[], Tables]]


def _backends(wanted: str | Iterable[str | Backend], left_out: list[Omission]) -> tuple[Backend, ...]:
    """The backends asked for; with "all" a broken one is left out by name."""
    if wanted == "all":
        found: list[Backend] = []
        for name in backend_names():
            try:
                found.append(backend_named(name))
            except PluginError as error:
                left_out.append(Omission(name, "everything", str(error)))
        return tuple(found)
    chosen = [wanted] if isinstance(wanted, str) else list(wanted)
    installed = backend_names()
    for name in chosen:
        if isinstance(name, str) and name not in installed:
            raise UsageError(f"no backend {name!r}; installed: {', '.join(installed)}, or all.")
    return tuple(backend_named(entry) if isinstance(entry, str) else entry for entry in chosen)


def _compared(
    subject: _Subject,
    backends: Sequence[Backend],
    wanted: Sequence[str],
    duration: float,
    count: int,
    left_out: list[Omission],
    tell: Callable[[str, int, int], None] | None,
) -> Agreement:
    robot = subject.robot
    size = reach(robot)
    statics = tuple(name for name in STATICS if name in wanted)
    to_run = scenarios(robot, wanted, duration, database=subject.database)
    study = _studied(robot, wanted, to_run, duration, subject.database)
    total = len(backends) * (1 + len(to_run) + (study is not None)) + (study is not None)
    done = 0

    def told(what: str) -> None:
        nonlocal done
        if tell is not None:
            tell(what, done, total)
        done += 1

    states = random_states(robot, count)
    answers: dict[str, Mapping[str, Vector]] = {}
    if subject.tables is not None:
        try:
            answers[TABLES] = ask_tables(subject.tables, states, statics)
        except UnreadError as error:
            left_out.append(Omission(TABLES, "static_sag", str(error)))
            answers[TABLES] = ask_tables(subject.tables, states, [name for name in statics if name != "static_sag"])
        silent = [name for name in statics if name not in answers[TABLES]]
        if silent and subject.tables.drives_unsaid:
            reason = f"it does not read {', '.join(subject.tables.drives_unsaid)}"
            left_out.append(Omission(TABLES, ", ".join(silent), reason))
    able: list[Backend] = []
    not_loaded: dict[str, str] = {}
    for backend in backends:
        if not backend.runs:
            left_out.append(Omission(backend.name, "everything", "it is emitted only: its engine does not run here"))
            continue
        told(f"{backend.name}: at rest")
        try:
            answers[backend.name] = _ask(backend, robot, states, statics)
            able.append(backend)
        except RefusedError as error:
            left_out.append(Omission(backend.name, "everything", str(error)))
        except _LoadError as error:
            # data that no body can have may be refused; anything else that was emitted must load
            if subject.database.inertia_check == "warn":
                left_out.append(Omission(backend.name, "everything", str(error)))
            else:
                not_loaded[backend.name] = str(error)
    figures = compare_statics(answers, size)
    if subject.tables is not None and subject.tables.motions:
        figures += compare_motions(subject.tables, _laws(subject), TABLES)
    runs: dict[str, tuple[Scenario, Sequence[Run]]] = {}
    facts: list[RunFacts] = []
    found_orders: list[Order] = []
    for scenario in to_run:
        of_scenario: list[Run] = []
        broken: dict[str, str] = {}
        for backend in able:
            told(f"{backend.name}: {SCENARIOS[scenario.name]}")
            reason = refusal(scenario, backend)
            if reason is not None:
                left_out.append(Omission(backend.name, scenario.name, reason))
                continue
            try:
                of_scenario += run_all(scenario, backend)
            except RefusedError as error:
                broken[backend.name] = str(error)
        if of_scenario:
            # where others run, not to run is a disagreement
            of_scenario += [no_run(of_scenario[0], name) for name in broken]
        else:
            left_out += [Omission(name, scenario.name, reason) for name, reason in broken.items()]
        runs[scenario.name] = (scenario, of_scenario)
        facts.append(_facts(scenario, of_scenario))
        figures += compare_runs(scenario, of_scenario, size)
        if subject.tables is not None and plainly_controlled(scenario):
            figures += compare_commands(scenario, of_scenario, TABLES)
        elif subject.tables is not None and scenario.imposed:
            figures += compare_knots(scenario, of_scenario, subject.tables, TABLES)
        found_orders += orders(scenario, of_scenario)
    labels = {TABLES: "the tables' text"} if subject.tables is not None else {}
    labels |= {backend.name: f"{backend.name} ({backend.engine})" for backend in able}
    evidence = Evidence(
        labels=labels,
        robot=robot,
        database=subject.database,
        tables=subject.tables,
        bare=subject.bare,
        without=subject.without,
        states=states,
        answers=answers,
        runs=runs,
        figures=figures,
        orders=found_orders,
    )
    return Agreement(
        robot=robot.name,
        level=robot.level,
        effects=robot.effects,
        source_hash=robot.source_hash,
        notes=robot.notes,
        reach=size,
        voices=_voices(subject.tables, able),
        left_out=tuple(left_out),
        runs=tuple(facts),
        figures=tuple(figures),
        orders=tuple(found_orders),
        convergence=convergence(study, able, told) if study is not None else None,
        findings=(*_not_loaded(backends, not_loaded), *find(evidence)),
        evidence=evidence,
    )


class _LoadError(Exception):
    """An engine refuses what its own backend emitted without objection."""


@contextmanager
def _must_run() -> Generator[None]:
    """What was emitted without objection may not be refused any more."""
    try:
        yield
    except RefusedError as error:
        raise _LoadError(str(error)) from error


def _not_loaded(backends: Sequence[Backend], reasons: Mapping[str, str]) -> Iterator[Finding]:
    for backend in backends:
        if backend.name in reasons:
            place = "The fault lies in its export."
            sentence = f"{backend.name} ({backend.engine}): its export cannot be run: {reasons[backend.name]} {place}"
            yield Finding((backend.name,), "export", "refused", "robot", sentence)


def _voices(tables: Tables | None, backends: Sequence[Backend]) -> tuple[Voice, ...]:
    fifth = (Voice(TABLES, "the tables' text"),) if tables is not None else ()
    return fifth + tuple(
        Voice(
            backend.name,
            f"{backend.name} ({backend.engine})",
            backend.engine,
            backend.version(),
            backend.integrator,
            backend.order,
            backend.gate_class,
        )
        for backend in backends
    )


def _ask(backend: Backend, robot: Robot, states: States, quantities: Sequence[str]) -> Mapping[str, Vector]:
    """The static answers of one backend."""
    from ..control import Control

    step = choose_step(robot, backend, imposed=False, poses=np.array([robot.home()]))
    loop = Control("torque")
    program = Program(hold(robot.home(), 1.0), loop, 1.0, step)
    opened: list[Engine] = []

    def engine_of(model: Robot) -> Engine:
        reason = backend.refusal(model, program)
        if reason is not None:
            raise RefusedError(reason)
        emission = backend.emit(model, program)
        with _must_run():
            opened.append(backend.load(emission))
        return opened[-1]

    try:
        engine = engine_of(robot)
        made: list[Engine] = []

        def moving() -> Engine:
            if not made:
                same = robot.friction.model == "smooth" or not any(stage.drive.terms for stage in robot.stages)
                made.append(engine if same else engine_of(smooth(robot)))
            return made[0]

        springs = [stage.drive.spring for stage in robot.stages]
        elastic = [spring is not None for spring in springs]
        play = [spring.gap if spring else 0.0 for spring in springs]
        base = robot.base.matrix()
        with _must_run():
            return ask_engine(engine, base, states, quantities, moving=moving, elastic=elastic, step=step, play=play)
    finally:
        for engine in opened:
            engine.close()


def _studied(
    robot: Robot, wanted: Sequence[str], made: Sequence[Scenario], duration: float, database: Database
) -> Scenario | None:
    """The run of the study of error against step: the closed loop, elastic where the robot is."""
    if ORDERS not in wanted:
        return None
    loops = ("rigid_loop", "compliant_loop")
    there = [scenario for scenario in made if scenario.name == loops[gives(robot)]]
    return there[0] if there else scenarios(robot, loops, duration, database=database)[-1]


def _laws(subject: _Subject) -> dict[str, Any]:
    """The motions of the database as they were read; one that cannot be is told by the reader."""
    laws: dict[str, Any] = {}
    for name in subject.database.motions:
        try:
            laws[name] = motion_named(subject.robot, name, database=subject.database)
        except MbexportError:
            continue
    return laws


def _facts(scenario: Scenario, runs: Sequence[Run]) -> RunFacts:
    steps = {run.voice: run.step for run in runs if not run.half}
    knocks = tuple(dict.fromkeys(run.voice for run in runs if run.knocks))
    title = SCENARIOS[scenario.name]
    return RunFacts(scenario.name, title, scenario.motion_name, scenario.duration, steps, knocks)
