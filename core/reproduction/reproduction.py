"""The whole study: every figure of the paper, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..simulation import backend_named
from .case import DAMPING_RATIO, FREQUENCY, KEY_EDGES, RATE, REST, TICK, Case, Tell, paper_case
from .closed_loop import LONGER_STEPS, OTHER_FREQUENCIES, ClosedLoop, closed_loop
from .derivatives import Derivatives, derivatives
from .frames import Frames, frames
from .misalignment import Misalignment, misalignment
from .open_loop import OpenLoop, open_loop
from .path import DesiredPath, desired_path

SCHEMA = "mbexport-paper/1"
PAPER = (
    "S. Baglioni, F. Cianetti, C. Braccesi, L. Landi: Parametric multibody modeling of antropomorphic robot to predict "
    "joint compliance influence on end effector positioning. IMECE2013-64815, ASME, 2013"
)


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """What came out.

    Attributes:
        case: What was run.
        frames: Figures 3 and 4.
        path: Figure 11.
        open_loop: Figure 12.
        closed_loop: Figure 13.
        derivatives: Codes that differentiate the motion law by themselves.
        misalignment: The beta sweep.
    """

    case: Case
    frames: Frames
    path: DesiredPath
    open_loop: OpenLoop
    closed_loop: ClosedLoop
    derivatives: Derivatives
    misalignment: Misalignment

    @property
    def whole(self) -> bool:
        """All of the path was run, not its first edges only."""
        return len(self.case.corners) > 2 * KEY_EDGES

    def choices(self) -> tuple[tuple[str, str], ...]:
        """What the paper leaves open, and what was taken: (what, choice)."""
        case = self.case
        extent = np.ptp(self.path.places, axis=0)
        return (
            (
                "the path's size, place and time",
                f"{1e3 * extent[1]:.1f} by {1e3 * extent[0]:.1f} mm, level, {case.motion.duration!r} s, from rest to "
                f"rest "
                "along every edge",
            ),
            ("gains", f"{FREQUENCY!r} Hz and a damping ratio of {DAMPING_RATIO!r} for every joint by itself at home"),
            ("feedforward", "the torques that hold the rigid arms at the command"),
            ("inertia of the dummy parts", f"{case.database.dummy_inertia!r} of the arm's diagonal mass-matrix entry"),
            ("communication step", f"{1e3 * TICK!r} ms, the controller's period too"),
            ("sign of the products of inertia", "elements of the tensor (-integral of xy dm)"),
            ("record", f"{RATE!r} Hz, and {REST!r} s of rest after the motion, in which the arm rings freely"),
        )

    def engines(self) -> tuple[dict[str, Any], ...]:
        """Who took part, the reference first."""
        backends = [backend_named(name) for name in self.case.backends]
        return tuple(
            {
                "backend": backend.name,
                "engine": backend.engine,
                "version": backend.version(),
                "integrator": backend.integrator,
                "order": backend.order,
                "step_s": self.open_loop.steps[backend.name],
            }
            for backend in backends
        )

    def to_json(self) -> dict[str, Any]:
        """All numbers as plain data; the same study gives the same."""
        from .statements import statements

        case = self.case
        return {
            "schema": SCHEMA,
            "paper": PAPER,
            "robot": case.database.name,
            "source_hash": case.database.content_hash(),
            "edges": len(case.corners) - 1,
            "engines": list(self.engines()),
            "left_out": dict(case.left_out),
            "choices": dict(self.choices()),
            "notes": list(case.compliant.notes),
            "statements": [statement.to_json() for statement in statements(self)],
            "figures_3_and_4": self.frames.to_json(),
            "figure_11": self.path.to_json(),
            "figure_12": self.open_loop.to_json(),
            "figure_13": self.closed_loop.to_json(),
            "derivatives": self.derivatives.to_json(),
            "misalignment": self.misalignment.to_json(),
        }


def reproduce(
    backends: Sequence[str] | None = None, edges: int | None = None, tell: Tell = lambda what, done, total: None
) -> Reproduction:
    """Do the paper's study again.

    Args:
        backends: Names; None: all that run here.
        edges: Only the first edges of the path; None: all of them.
        tell: Called before each run with what it is, how many are done, and how many there are.

    Raises:
        UsageError: The path has not that many edges.
        RefusedError: No engine can run.
        PluginError: A backend that was asked for by name is unknown or broken.
    """
    case = paper_case(backends, edges, tell)
    case.total = _runs(len(case.backends))
    path = desired_path(case)
    drawn = frames(case)
    opened = open_loop(case)
    closed = closed_loop(case, opened)
    found = Reproduction(case, drawn, path, opened, closed, derivatives(case), misalignment(case))
    tell("done", case.done, case.total)
    return found


def _runs(engines: int) -> int:
    """How many runs the study has on so many engines."""
    every_engine = ("figure 11", "figure 12", "figure 13", "figure 13 with Memory", "misaligned axes")
    once = 1 + 1 + len(LONGER_STEPS) + len(OTHER_FREQUENCIES) + 1
    laws = 4 + (2 if engines > 1 else 0)
    return len(every_engine) * engines + once + laws
