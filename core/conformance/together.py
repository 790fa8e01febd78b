"""The agreement suite on the backend under test: the tables' text, a built-in engine, and the common gates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ..agreement import Agreement, agree
from ..agreement.quantities import STATICS
from ..database import Database
from .check import Check, ConformanceError, Refusals, must
from .robots import SEEDS, random_database
from .subject import ROBOTS, Subject, database

ELASTIC = ("arm7", "imece2013", "planar2r", "scara")
RUBBING = ("planar2r", "pendulum", "puma560", "scara", "arm7")
RUNS = {
    "rigid_motion": ROBOTS,
    "rigid_loop": ROBOTS,
    "compliant_motion": ELASTIC,
    "compliant_loop": ELASTIC,
    "friction_loop": RUBBING,
    "stick_loop": RUBBING,
}
"""The scenarios of agreement, and the robots they are run on."""

SAG = "static_sag"
AT_REST = tuple(name for name in STATICS if name != SAG)
# random states that statics are asked at
STATES = 25
QUICK_SEEDS = 3
QUICK = "planar2r"


def checks() -> Iterator[Check]:
    """Of this module."""
    for name in ROBOTS:
        yield Check("statics", name, lambda subject, name=name: statics(subject, database(name)), quick=True)
    for seed in SEEDS:
        yield Check(
            "random", str(seed), lambda subject, seed=seed: statics(subject, random_database(seed)), seed < QUICK_SEEDS
        )
    for name in ELASTIC:
        yield Check("sag", name, lambda subject, name=name: compared(subject, database(name), [SAG]), quick=True)
    for scenario, robots in RUNS.items():
        for name in robots:
            yield Check(
                scenario,
                name,
                lambda subject, name=name, scenario=scenario: compared(subject, database(name), [scenario]),
                quick=name == QUICK,
            )


def statics(subject: Subject, source: Database) -> Refusals:
    """Kinematics and dynamics at random states, with all effects and with none."""
    return [
        *compared(subject, source, AT_REST, level="full"),
        *compared(subject, source, AT_REST, level="rigid"),
    ]


def compared(
    subject: Subject,
    source: Database,
    quantities: Iterable[str],
    *,
    level: str = "full",
    duration: float | None = None,
) -> Refusals:
    """All comparisons that the backend takes part in are within their gates.

    Returns:
        Why it did not take part, where it refuses an effect of the robot by name.

    Raises:
        ConformanceError: It is beyond a gate, refuses without naming an effect, or was not compared at all.
    """
    backend = subject.backend
    answer = agree(
        source,
        [subject.reference, backend],
        level,
        quantities=tuple(quantities),
        duration=subject.duration if duration is None else duration,
        states=STATES,
    )
    refusals = [omission.reason for omission in answer.left_out if omission.voice == backend.name]
    for reason in refusals:
        named = any(effect in reason for effect in answer.effects) or source.inertia_check == "warn"
        must(named, f"it refuses {source.name} at level {answer.level} and names no effect of it: {reason}")
    wrong = list(_wrong(answer, backend.name))
    if wrong:
        raise ConformanceError("\n".join([*wrong, *answer.sentences]))
    taken = any(backend.name in figure.voices for figure in answer.figures)
    must(taken or bool(refusals), f"nothing of {source.name} at level {answer.level} could be compared.")
    return refusals


def _wrong(answer: Agreement, name: str) -> Iterator[str]:
    for figure in answer.figures:
        if name in figure.voices and not figure.passed:
            a, b = figure.voices
            place = f"{figure.at or 'the tool'} ({figure.instant!r})"
            yield (
                f"{figure.scenario}, {figure.signal}: {a} and {b} differ by {figure.value!r} at {place}; "
                f"the gate is {figure.gate!r}"
            )
    for order in answer.orders:
        if order.voice == name and not order.passed:
            yield f"{order.scenario}: it converges with order {order.order!r}, errors {order.errors} at {order.steps} s"
    for finding in answer.findings:
        if finding.kind == "refused" and name in finding.voices:
            yield finding.sentence
