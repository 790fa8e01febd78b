"""Error against step: every engine's own integrator on one short run, at steps that halve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import RefusedError
from ..simulation.backend import Backend
from .gates import manner_of
from .runs import one_run, step_of
from .scenarios import Scenario

DURATION = 0.5
"""Of the run [s]."""
HALVINGS = 4
"""How many steps are tried, each half of the one before."""
FINER = 4
"""How much finer than the finest of them the run is that errors are taken from."""


@dataclass(frozen=True, slots=True)
class Convergence:
    """Errors of the tool's position over the step.

    Attributes:
        scenario: What was run.
        duration: [s].
        reference: Voice whose finest run the errors are taken from.
        reference_step: Its step [s].
        points: (voice, step [s], largest error of the tool's position [m]).
    """

    scenario: str
    duration: float
    reference: str
    reference_step: float
    points: tuple[tuple[str, float, float], ...]

    def order(self, voice: str) -> float | None:
        """Observed order of a voice between its two largest steps; None where there is only one."""
        errors = sorted(((step, error) for name, step, error in self.points if name == voice), reverse=True)
        if len(errors) < 2 or errors[0][1] <= 0.0 or errors[1][1] <= 0.0:
            return None
        return float(np.log2(errors[0][1] / errors[1][1]) / np.log2(errors[0][0] / errors[1][0]))


def convergence(
    scenario: Scenario, backends: Sequence[Backend], tell: Callable[[str], None] = lambda _: None
) -> Convergence | None:
    """Errors of the engines over their steps; None where none of higher order can serve as reference.

    Args:
        scenario: What to run; it is cut to DURATION.
        backends: Of all of them.
        tell: Called with what is being done.
    """
    exact = [backend for backend in backends if manner_of(backend) == "explicit"]
    if not exact:
        return None
    short = replace(scenario, duration=min(DURATION, scenario.duration))
    # ticks and records of the controller cut longer steps anyway
    largest = min(4.0 * step_of(short, exact[0]), 1.0 / short.control.rate)
    steps = [largest / 2**k for k in range(HALVINGS)]
    trusted = exact[-1]
    tell(f"{trusted.name}: reference for the orders")
    try:
        truth = one_run(short, trusted, steps[-1] / FINER)
    except RefusedError:
        return None
    points: list[tuple[str, float, float]] = []
    for backend in backends:
        tell(f"{backend.name}: error against step")
        for step in steps:
            try:
                run = one_run(short, backend, step)
            except RefusedError:
                # unstable at this step
                continue
            error = float(np.max(np.linalg.norm(run.tip - truth.tip, axis=1)))
            if np.isfinite(error):
                points.append((backend.name, step, error))
    return Convergence(short.name, short.duration, trusted.name, steps[-1] / FINER, tuple(points))
