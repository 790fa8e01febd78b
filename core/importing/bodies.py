"""Bodies put together, and what no body can have: the test and the nearest body that passes it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..database.bodies import fault_of
from ..representation import Inertia
from ..representation.inertia import steiner

LEAST_MASS = 1e-3
"""Mass [kg] that a repair gives an arm that has none; engines lose a chain's arms somewhere below 1e-5 kg."""

LEAST_GYRATION = 1e-3
"""Radius of gyration [m] that a repair leaves about every axis: a body thinner than a millimetre is no arm."""

MARGIN = 1e-9
"""Relative distance that a repaired body keeps from the limit, so that rounding cannot undo the repair."""


def put_together(parts: Sequence[Inertia]) -> Inertia:
    """Bodies fixed to each other, given in one frame; about their common center of mass, so that nothing cancels."""
    if len(parts) < 2:
        return parts[0] if parts else Inertia()
    mass = sum(part.mass for part in parts)
    if mass == 0.0:
        return Inertia.from_tensor(0.0, np.zeros(3), sum((part.tensor() for part in parts), np.zeros((3, 3))))
    com = sum((part.first_moments() for part in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        tensor += part.tensor() + part.mass * steiner(np.array(part.com) - com)
    return Inertia.from_tensor(mass, com, tensor)


def impossible(body: Inertia) -> str | None:
    """Why no body can have these mass properties, as a sentence; None where one can."""
    return "it has no mass" if body.mass <= 0.0 else fault_of(body)


@dataclass(frozen=True, slots=True)
class Repair:
    """The nearest possible body and what was changed.

    Attributes:
        body: It passes `impossible`.
        changes: In words, with figures.
    """

    body: Inertia
    changes: str


def repaired(body: Inertia) -> Repair:
    """The nearest body: mass kept if there is any, principal axes kept, moments moved least in the Frobenius norm.

    The possible tensors form a convex cone that no rotation changes, so the nearest one in the Frobenius norm has
    the same principal axes and the nearest triple of principal moments.
    """
    changes: list[str] = []
    mass = body.mass
    if mass <= 0.0:
        mass = LEAST_MASS
        changes.append(f"mass {body.mass!r} -> {mass!r} kg")
    tensor = body.tensor()
    if fault_of(body) is None:
        return Repair(replace(body, mass=mass), "; ".join(changes))
    moments, axes = np.linalg.eigh(tensor)
    wanted = _nearest_moments(moments, mass * LEAST_GYRATION**2)
    new = axes @ np.diag(wanted) @ axes.T
    new = 0.5 * (new + new.T)
    distance, norm = float(np.linalg.norm(new - tensor)), float(np.linalg.norm(tensor))
    share = f" ({100.0 * distance / norm:.3g} % of it)" if norm > 0.0 else ""
    changes.append(
        f"principal moments {_list(moments)} -> {_list(wanted)} kg m^2, "
        f"{distance:.3e} kg m^2 in the tensor's Frobenius norm{share}"
    )
    return Repair(Inertia.from_tensor(mass, np.array(body.com), new), "; ".join(changes))


def _nearest_moments(moments: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """The nearest triple with every moment at least `least` and none above the sum of the others, shape (3,).

    A projection onto six half-spaces in space: the answer is the nearest of the feasible projections onto the faces
    of every choice of up to three of them.
    """
    planes = [np.roll([1.0, 1.0, -(1.0 + MARGIN)], k) for k in range(3)] + list(np.eye(3))
    bounds = [0.0] * 3 + [least] * 3
    best = np.full(3, max(float(np.max(moments)), least))  # a ball is always possible
    for count in range(4):
        for chosen in itertools.combinations(range(6), count):
            candidate = moments
            if count:
                normals = np.array([planes[k] for k in chosen])
                gap = np.array([bounds[k] for k in chosen]) - normals @ moments
                candidate = moments + np.linalg.pinv(normals) @ gap
            feasible = all(
                float(plane @ candidate) >= bound - 1e-12 * float(np.max(np.abs(candidate)))
                for plane, bound in zip(planes, bounds, strict=True)
            )
            if feasible and np.linalg.norm(candidate - moments) < np.linalg.norm(best - moments):
                best = candidate
    return best


def _list(values: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{float(value):.6e}" for value in values) + ")"
