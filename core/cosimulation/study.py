"""What the communication step costs: errors of the tip against the loop itself, over steps, orders and memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError, UsageError
from ..simulation.backend import Backend
from .coupling import CoupledRun, Coupling, engine_of, run_in
from .loop import Loop
from .reference import LOST, Reference, reference_of

Vector = NDArray[np.float64]
Tell = Callable[[str], None]

SCHEMA = "mbexport-cosimulation/1"
STEPS = (4.0e-3, 2.0e-3, 1.0e-3, 5.0e-4, 2.5e-4)
"""Communication steps where none are asked for [s]."""
ORDERS = (0, 1, 2)


@dataclass(frozen=True, slots=True)
class Measured:
    """What one coupling makes of the tip, against the reference.

    Attributes:
        interval: Communication step [s].
        order: Of the extrapolation.
        memory: One communication step of delay in the feedback.
        largest, rms: Distance of the tip from the reference's [m]; inf where the coupling is unstable.
        earlier: How much earlier the tip is on its path, by least squares [s]; nan where unstable.
        peak: The largest deviation as a multiple of the reference's; nan where unstable.
    """

    interval: float
    order: int
    memory: bool
    largest: float
    rms: float
    earlier: float
    peak: float

    @property
    def stable(self) -> bool:
        """Whether the coupling holds the loop together."""
        return math.isfinite(self.largest)


@dataclass(frozen=True, slots=True, eq=False)
class CouplingStudy:
    """Errors over communication steps.

    Attributes:
        loop: What was coupled.
        backend: Whose engine integrated the robot.
        step: Its integration step, at most [s].
        reference: The loop's own motion.
        measured: A coupling each, by memory, order and falling step.
        runs: Of the longest step that is stable with every order asked for: those couplings' runs.
    """

    loop: Loop
    backend: Backend
    step: float
    reference: Reference
    measured: tuple[Measured, ...]
    runs: tuple[CoupledRun, ...]

    def curve(self, order: int, memory: bool) -> tuple[Measured, ...]:
        """The stable couplings of one kind, the longest step first."""
        return tuple(one for one in self.measured if (one.order, one.memory) == (order, memory) and one.stable)

    def kinds(self) -> tuple[tuple[int, bool], ...]:
        """(order, memory) of all couplings, each once, in order."""
        return tuple(dict.fromkeys((one.order, one.memory) for one in self.measured))

    def observed_orders(self) -> dict[str, list[float]]:
        """Order of convergence between steps that follow each other, from the longest on, by kind of coupling."""
        found: dict[str, list[float]] = {}
        for order, memory in self.kinds():
            curve = self.curve(order, memory)
            found[kind_named(order, memory)] = [
                math.log(a.largest / b.largest) / math.log(a.interval / b.interval) for a, b in pairwise(curve)
            ]
        return found

    def to_json(self) -> dict[str, Any]:
        """As plain data; what is unstable has no numbers."""
        robot = self.loop.robot
        rows = [{k: v if _is_plain(v) else None for k, v in asdict(one).items()} for one in self.measured]
        return {
            "schema": SCHEMA,
            "robot": robot.name,
            "level": robot.level,
            "effects": list(robot.effects),
            "source_hash": robot.source_hash,
            "backend": self.backend.name,
            "engine": self.backend.engine,
            "version": self.backend.version(),
            "integrator": self.backend.integrator,
            "step": self.step,
            "duration": self.loop.duration,
            "controller": self.loop.controller.facts(),
            "reference": self.reference.to_json(),
            "measured": rows,
            "observed_orders": self.observed_orders(),
        }

    def table(self) -> str:
        """A row a coupling, as CSV with all digits."""
        names = list(Measured.__dataclass_fields__)
        rows = [",".join(repr(float(getattr(one, name))) for name in names) for one in self.measured]
        return "\n".join([",".join(names), *rows]) + "\n"


def kind_named(order: int, memory: bool) -> str:
    """A kind of coupling in words."""
    held = "held" if order == 0 else f"extrapolated, order {order}"
    return f"{held}, memory" if memory else held


def measure(
    loop: Loop,
    backend: Backend,
    steps: Sequence[float] = STEPS,
    orders: Iterable[int] = ORDERS,
    *,
    memory: bool = False,
    step: float | None = None,
    tell: Tell = lambda _: None,
) -> CouplingStudy:
    """Run a loop with every communication step, order, and with memory too where wanted.

    Args:
        loop: What is coupled.
        backend: Whose engine integrates the robot.
        steps: Communication steps [s]; each a whole multiple of the shortest.
        orders: Of the extrapolation.
        memory: Each coupling with memory too.
        step: Integration step of the robot, at most [s].
        tell: Called with what is being done.

    Raises:
        UsageError: Steps that do not fit together.
        RefusedError: The backend refuses this robot, or the loop has no motion to hold couplings against.
    """
    descending = sorted(set(steps), reverse=True)
    couplings = [
        Coupling(interval, order, late)
        for late in ((False, True) if memory else (False,))
        for order in sorted(set(orders))
        for interval in descending
    ]
    finest = _finest(descending, loop.duration)
    engine, h = engine_of(loop, backend, step)
    try:
        tell("the loop itself")
        times: Vector = np.arange(math.floor(loop.duration / finest + 1.0e-9) + 1, dtype=float) * finest
        reference = reference_of(loop, engine, h, times)
        kept: list[tuple[Measured, CoupledRun | None]] = []
        for coupling in couplings:
            tell(f"{1e3 * coupling.interval!r} ms, {kind_named(coupling.order, coupling.memory)}")
            try:
                with np.errstate(all="ignore"):
                    run = run_in(engine, loop, coupling, h)
            except RefusedError:
                # no longer finite
                run = None
            kept.append((_measured(coupling, run, reference, finest), run))
    finally:
        engine.close()
    measured = tuple(one for one, _ in kept)
    shown = next((s for s in descending if all(one.stable for one in measured if one.interval == s)), descending[-1])
    runs = tuple(run for one, run in kept if run is not None and one.stable and one.interval == shown)
    return CouplingStudy(loop, backend, h, reference, measured, runs)


def _finest(steps: Sequence[float], duration: float) -> float:
    """The shortest of the steps, of which the others are multiples."""
    if not steps:
        raise UsageError("no communication step was given.")
    for step in steps:
        ratio = step / steps[-1]
        if abs(ratio - round(ratio)) > 1.0e-9 * ratio:
            raise UsageError(
                f"communication steps have to be whole multiples of the shortest, {steps[-1]!r} s; {step!r} s is none."
            )
    if steps[0] > duration:
        raise UsageError(f"a communication step of {steps[0]!r} s is longer than the run, {duration!r} s.")
    return steps[-1]


def _measured(coupling: Coupling, run: CoupledRun | None, reference: Reference, finest: float) -> Measured:
    lost = Measured(coupling.interval, coupling.order, coupling.memory, math.inf, math.inf, math.nan, math.nan)
    if run is None or not np.isfinite(run.tip).all():
        return lost
    at = slice(None, None, round(coupling.interval / finest))
    places = slice(0, len(run.t))
    true, wanted = reference.tip[at][places], reference.commanded[at][places]
    apart: Vector = np.linalg.norm(run.tip - true, axis=1)
    if not apart.max() < LOST:
        return lost
    deviation, own = true - wanted, run.tip - wanted
    slope: Vector = np.asarray(np.gradient(reference.tip, reference.t, axis=0))[at][places]
    square = float((slope * slope).sum())
    return Measured(
        coupling.interval,
        coupling.order,
        coupling.memory,
        float(apart.max()),
        float(np.sqrt(np.mean(apart**2))),
        float(((run.tip - true) * slope).sum() / square) if square else 0.0,
        float(np.linalg.norm(own, axis=1).max() / np.linalg.norm(deviation, axis=1).max()),
    )


def _is_plain(value: object) -> bool:
    return not isinstance(value, float) or math.isfinite(value)
