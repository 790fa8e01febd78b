"""The motion that couplings are held against: the loop in one piece, or, where it has no equations, coupled finely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from ..kinematics import kinematics
from ..simulation.backend import Engine
from .coupling import CoupledRun, Coupling, run_in
from .extrapolation import HIGHEST
from .loop import Loop
from .monolithic import run_monolithic, why_not

Vector = NDArray[np.float64]

FINER = 8
"""How many communication steps of a fine coupling are one of the shortest that is measured."""
# a tip further away than this has left the loop, and its numbers mean nothing [m]
LOST = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The loop's own motion, as well as it can be known.

    Attributes:
        t: Times [s], shape (m,).
        tip: Tool centre point in the base, shape (m, 3) [m].
        commanded: Where the rigid robot's tip would be at the command, shape (m, 3) [m].
        because: Why the loop has no equations to be solved in one piece; None where it was solved so.
        coupling: The fine coupling; None where it was solved in one piece.
        known_to: How far the tip moves at most where the communication step of the fine coupling is halved: what it
            may be off itself [m]; None where it was solved in one piece.
    """

    t: Vector
    tip: Vector
    commanded: Vector
    because: str | None = None
    coupling: Coupling | None = None
    known_to: float | None = None

    def in_words(self) -> str:
        """What it is, short."""
        return f"coupled every {1e3 * self.coupling.interval:.4g} ms" if self.coupling else "in one piece"

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        if not self.coupling:
            return {"kind": "one piece"}
        interval, order = self.coupling.interval, self.coupling.order
        return {
            "kind": "fine coupling",
            "because": self.because,
            "interval": interval,
            "order": order,
            "known_to": self.known_to,
        }


def reference_of(loop: Loop, engine: Engine, h: float, times: Vector) -> Reference:
    """The motion that couplings of a loop are held against.

    Args:
        loop: What is coupled.
        engine: With the loop's robot.
        h: Its integration step, at most [s].
        times: Multiples of the shortest communication step that is measured [s], from 0, shape (m,).

    Raises:
        RefusedError: The loop cannot be solved, in one piece or finely coupled.
    """
    commanded = kinematics(loop.robot).tool_in_base(loop.controller.motion.at(times)[0])[:, :3, 3]
    because = why_not(loop)
    if because is None:
        return Reference(times, run_monolithic(loop, times).tip, commanded)
    coupling, run, known_to = _finely(loop, engine, h, float(times[1]) / FINER)
    return Reference(times, run.tip[::FINER][: len(times)], commanded, because, coupling, known_to)


def _finely(loop: Loop, engine: Engine, h: float, interval: float) -> tuple[Coupling, CoupledRun, float]:
    """The loop coupled with this communication step, and how far twice that step takes the tip [m].

    By the highest order of extrapolation that holds together.
    """
    for order in range(HIGHEST, -1, -1):
        coupling = Coupling(interval, order)
        try:
            with np.errstate(all="ignore"):
                twice = run_in(engine, loop, Coupling(2.0 * interval, order), h).tip
                run = run_in(engine, loop, coupling, h)
        except RefusedError:
            if order:
                continue
            raise
        once = run.tip[::2]
        both = min(len(once), len(twice))
        apart = float(np.linalg.norm(once[:both] - twice[:both], axis=1).max())
        if apart < LOST:
            return coupling, run, apart
    raise RefusedError(
        f"{loop.robot.name}: not even a communication step of {interval!r} s holds the loop together, so that there is "
        "nothing to hold others against."
    )
