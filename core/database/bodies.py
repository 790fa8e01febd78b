"""Whether numbers can be the mass properties of a body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..representation import Inertia

# principal moments of a flat body lie exactly on the triangle's edge, and so do published digits after rounding
TRIANGLE_SLACK = 1e-9


def fault_of(inertia: Inertia) -> str | None:
    """Why no body can have this tensor about its center of mass, by how much; None where one can.

    A body's principal moments are positive and none is above the sum of the other two (equality: a flat body).
    """
    low, middle, high = (float(moment) for moment in np.linalg.eigvalsh(inertia.tensor()))
    if low <= 0.0:
        return (
            f"the inertia is not positive definite: its principal moments are {_digits(low)}, {_digits(middle)} and "
            f"{_digits(high)} kg*m^2"
        )
    excess = high - (low + middle)
    if excess > TRIANGLE_SLACK * high:
        return (
            f"no body can have this inertia: its largest principal moment {_digits(high)} kg*m^2 is above the sum "
            f"of the other two, {_digits(low + middle)}, by {_digits(excess)} ({100.0 * excess / high:.3f} %)"
        )
    return None


def shortage_of(inertia: Inertia) -> float:
    """By how much the largest principal moment is above the sum of the other two, as part of it; below 0 of a body.

    So much more of every moment makes it one. Infinite where a moment is not positive.
    """
    low, middle, high = (float(moment) for moment in np.linalg.eigvalsh(inertia.tensor()))
    return (high - low - middle) / high if low > 0.0 else np.inf


def other_sign(inertia: Inertia) -> Inertia:
    """The tensor as the other convention of the products of inertia would read it."""
    return replace(inertia, xy=-inertia.xy, xz=-inertia.xz, yz=-inertia.yz)


def _digits(value: float) -> str:
    return f"{value:.6e}"
