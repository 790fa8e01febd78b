"""A motion law as splines of Adams, with what they differ from the law by.

The law is piecewise polynomials. Through its own knots AKISPL is the law itself where the law is an Akima spline, as in
the paper. Any other law gets CUBSPL, whose second derivative is continuous and which Adams recommends for motions,
through knots so dense that it stays within `TOLERANCE` of the law; position, velocity and acceleration are each given,
as the paper recommends, so that what the solver makes of the position can be held against the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from ..core.motion import MotionLaw
from ..core.simulation.backend import Vector

# what a spline's position may differ from the law [rad or m]
TOLERANCE = 1.0e-7
EXACT = 1.0e-12
# knots that a spline has at most
MOST_KNOTS = 20_000
# Adams asks for four points at least
FEWEST_KNOTS = 5
# Knots before the start and after the end, where the law stands still: they keep the spline's end conditions, which
# Adams does not name, out of the run
BEYOND = 8
# two knots closer than this are one [s]
INSTANT = 1.0e-9
# places between two knots where a spline is held against the law
PROBES = (0.2113, 0.5, 0.7887)


@dataclass(frozen=True, slots=True)
class Splines:
    """A motion law at knots.

    Attributes:
        function: "AKISPL" or "CUBSPL".
        knots: [s], shape (m,); some lie outside of the run.
        position, velocity, acceleration: Of the law at the knots, shape (m, n).
        errors: Largest difference of the position spline and of its two derivatives from the law, between the knots,
            whatever the spline's end conditions.
    """

    function: str
    knots: Vector
    position: Vector
    velocity: Vector
    acceleration: Vector
    errors: tuple[float, float, float]

    @property
    def exact(self) -> bool:
        """The position spline is the law."""
        return self.errors[0] <= EXACT

    def moves(self, joint: int) -> bool:
        """Whether that joint (from 0) moves at all."""
        return bool(np.ptp(self.position[:, joint]) > 0.0 or self.velocity[:, joint].any())


def splines_of(law: MotionLaw, duration: float) -> Splines:
    """The splines of a law over a run that begins at t = 0."""
    own = _own_knots(law, duration)
    still = _sampled("CUBSPL", law, own, (0.0, 0.0, 0.0))
    if not any(still.moves(joint) for joint in range(law.n)):
        return still
    errors = _errors(law, own, "AKISPL")
    if errors[0] <= EXACT:
        return _sampled("AKISPL", law, own, errors)
    parts = 1
    knots = own
    errors = _errors(law, _extended(law, knots), "CUBSPL")
    while errors[0] > TOLERANCE and 2 * len(knots) <= MOST_KNOTS:
        parts *= 2
        knots = _divided(own, parts)
        errors = _errors(law, _extended(law, knots), "CUBSPL")
    knots = _extended(law, knots)
    return _sampled("CUBSPL", law, knots, errors)


def _own_knots(law: MotionLaw, duration: float) -> Vector:
    inside = law.knots[(law.knots > INSTANT) & (law.knots < duration - INSTANT)]
    knots = np.concatenate([[0.0], inside, [duration]])
    while len(knots) < FEWEST_KNOTS:
        knots = _divided(knots, 2)
    return knots


def _divided(knots: Vector, parts: int) -> Vector:
    fractions = np.arange(parts) / parts
    between = knots[:-1, None] + np.diff(knots)[:, None] * fractions
    return np.append(between.ravel(), knots[-1])


def _extended(law: MotionLaw, knots: Vector) -> Vector:
    """Knots beyond the ends at which the law comes to rest, or begins at rest."""
    speed = law.at(knots[[0, -1]])[1]
    count = np.arange(1, BEYOND + 1)
    before = knots[0] - count[::-1] * (knots[1] - knots[0])
    after = knots[-1] + count * (knots[-1] - knots[-2])
    return np.concatenate([before[: BEYOND * (not speed[0].any())], knots, after[: BEYOND * (not speed[1].any())]])


def _sampled(function: str, law: MotionLaw, knots: Vector, errors: tuple[float, float, float]) -> Splines:
    return Splines(function, knots, *law.at(knots), errors)


def _errors(law: MotionLaw, knots: Vector, function: str) -> tuple[float, float, float]:
    """What a position spline differs by; of CUBSPL the worst of two end conditions, for Adams names none."""
    scipy: Any = import_module("scipy.interpolate")
    position = law.at(knots)[0]
    if function == "AKISPL":
        fits = [scipy.Akima1DInterpolator(knots, position)]
    else:
        fits = [scipy.CubicSpline(knots, position, bc_type=ends) for ends in ("not-a-knot", "natural")]
    probes = np.concatenate([knots[:-1] + fraction * np.diff(knots) for fraction in PROBES])
    exact = law.at(probes)
    worst = [max(float(np.abs(fit(probes, order) - exact[order]).max()) for fit in fits) for order in range(3)]
    return worst[0], worst[1], worst[2]
