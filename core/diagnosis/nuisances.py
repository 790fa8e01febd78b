"""What no effect is blamed for: the database's tolerances, and stamps that are a sample off.

Each is a column, the change of the residual for one standard deviation of it. Marginalised, they widen the noise along
their own directions: (1 + A A^T)^(-1/2), by the singular values of A, is applied to everything that is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..build import assembled
from ..database import Database, Tolerance
from .evidence import Evidence, ahead, coefficients
from .inverse import LIGHT
from .problem import Problem

Vector = NDArray[np.float64]

# one standard deviation of how long a torque is held, in ticks: another integrator's half is three of them, and a drive
# that is a whole tick late is not to be taken for it
HOLD = 0.15
STAMPS_OF_TAU = "stamps of tau"
# in units of half a tick
SPEED_IS_LATE = "tick of the controller's speed"
_NAMES = {"hold": "hold of the torque", "speed": SPEED_IS_LATE}


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """Takes out of numbers of unit noise what nuisances may have put there.

    Attributes:
        basis: Their orthonormal directions, shape (N, r).
        shrink: What is left along each, 1 / sqrt(1 + s^2), shape (r,).
        names, columns: Each nuisance and its column of one standard deviation, shape (N, k).
    """

    basis: Vector
    shrink: Vector
    names: tuple[str, ...]
    columns: Vector

    def __call__(self, values: Vector) -> Vector:
        """Whitened numbers or columns, shape (N,) or (N, k)."""
        if not len(self.shrink):
            return values
        along = self.basis.T @ values
        less = (self.shrink - 1.0)[:, None] * along if along.ndim == 2 else (self.shrink - 1.0) * along
        return values + self.basis @ less

    def undone(self, values: Vector) -> Vector:
        """Numbers or columns as they were before they were whitened."""
        return values + self.basis @ ((1.0 / self.shrink - 1.0) * (self.basis.T @ values).T).T

    def told_by(self, before: Evidence, now: Evidence) -> Whitening:
        """The same nuisances in the units of the same evidence as it is heard otherwise now."""
        return _whitening(self.names, now.told_by(before, self.columns))

    def only(self, places: NDArray[np.int64]) -> Whitening:
        """The same nuisances, as some of the coefficients know them."""
        return _whitening(self.names, self.columns[places])

    def amounts(self, values: Vector) -> dict[str, float]:
        """How many standard deviations of each nuisance a residual asks for."""
        if not len(self.names):
            return {}
        k = self.columns.shape[1]
        stacked = np.vstack([self.columns, np.eye(k)])
        found = np.linalg.lstsq(stacked, np.concatenate([-values, np.zeros(k)]), rcond=None)[0]
        return dict(zip(self.names, found.tolist(), strict=True))

    def unsure(self) -> dict[str, float]:
        """How many standard deviations of each nuisance its amount may be off by, one standard error."""
        gram = self.columns.T @ self.columns + np.eye(len(self.names))
        return dict(zip(self.names, np.sqrt(np.diagonal(np.linalg.inv(gram))).tolist(), strict=True))


def whitening(problem: Problem) -> Whitening:
    """The nuisances of a problem."""
    tolerances = tolerance_columns(problem)
    others = [*_shifts(problem), *_clamps(problem)]
    names = [name for name, _ in (*_variations(problem.database, problem.database.tolerance), *others)]
    return _whitening(tuple(names), np.column_stack([tolerances, *(column for _, column in others)]))


def tolerance_columns(problem: Problem) -> Vector:
    """The change of the residual for one standard deviation of every number of the database, shape (N, k)."""
    base = problem.residual({})
    columns = [
        _varied(problem, change) - base for _, change in _variations(problem.database, problem.database.tolerance)
    ]
    return np.column_stack(columns) if columns else np.zeros((len(base), 0))


def _whitening(names: tuple[str, ...], matrix: Vector) -> Whitening:
    u, s, _ = np.linalg.svd(matrix, full_matrices=False)
    kept = s > 1e-3
    return Whitening(u[:, kept], 1.0 / np.sqrt(1.0 + s[kept] ** 2), names, matrix)


def _varied(problem: Problem, change: Callable[[Database], Database]) -> Vector:
    changed = {id(body): change(body) for body in problem.bodies}
    robots = [assembled(changed[id(body)], problem.known, many=True) for body in problem.bodies]
    return problem.evidence.residual(robots)


def _variations(database: Database, sigma: Tolerance) -> Iterator[tuple[str, Callable[[Database], Database]]]:
    """Each number that may be off, by one standard deviation."""
    for i in range(database.n):
        body = database.inertias[i]
        if sigma.mass:
            yield f"mass of arm_{i + 1}", _inertia(i, {"mass": body.mass * sigma.mass})
        if sigma.com:
            for axis, name in enumerate("xyz"):
                yield f"center of mass of arm_{i + 1} ({name})", _center(i, axis, sigma.com)
        if sigma.inertia:
            for name in ("xx", "yy", "zz"):
                yield f"I{name} of arm_{i + 1}", _inertia(i, {name: float(getattr(body, name)) * sigma.inertia})
        for name in ("alpha", "a", "theta", "d", "beta"):
            step = sigma.length if name in ("a", "d") else sigma.angle
            if step:
                yield f"{name} of arm_{i + 1}", _length(i, name, step)


def _inertia(i: int, steps: Mapping[str, float]) -> Callable[[Database], Database]:
    def apply(database: Database) -> Database:
        body = database.inertias[i]
        moved = replace(body, **{name: getattr(body, name) + step for name, step in steps.items()})
        return replace(database, inertias=(*database.inertias[:i], moved, *database.inertias[i + 1 :]))

    return apply


def _center(i: int, axis: int, step: float) -> Callable[[Database], Database]:
    def apply(database: Database) -> Database:
        body = database.inertias[i]
        x, y, z = body.com
        com = (x + step * (axis == 0), y + step * (axis == 1), z + step * (axis == 2))
        moved = replace(body, com=com)
        return replace(database, inertias=(*database.inertias[:i], moved, *database.inertias[i + 1 :]))

    return apply


def _length(i: int, name: str, step: float) -> Callable[[Database], Database]:
    def apply(database: Database) -> Database:
        rows = list(database.kinematics)
        rows[i] = replace(rows[i], **{name: getattr(rows[i], name) + step})
        return replace(database, kinematics=tuple(rows))

    return apply


def _shifts(problem: Problem) -> Iterator[tuple[str, Vector]]:
    """Stamps of the torque, the tool's pose or the command that are one sample off the motion's, and the hold.

    The hold: whether a torque acts from its tick on, half a tick later or earlier, as other integrators have it.
    The controller's speed: whether it is its tick's, or that half a tick ago, as differences of positions are; of one
    joint alone that looks like a rotor, and was asked in simulation before.
    """
    evidence = problem.evidence
    spoken = problem.spoken({})
    several = problem.database.n > 1
    for signal in ("tau", "tau_link", "q_link", "ee", "command", "hold", "speed"):
        parts: list[dict[str, list[Vector]]] = []
        for number, run in enumerate(evidence.runs):
            sample = 1.0 / run.run.rate
            mask = evidence.masks[number]
            change = {name: np.zeros(mask[name].shape) for name in mask}
            if signal == "command":
                if run.run.control.mode == "pd" and "u" in change:
                    _, dq, ddq = run.run.motion().at(run.t)
                    control = run.run.control
                    rate = np.array(control.kp) * dq + np.array(control.kd) * ddq
                    change["u"] = rate * sample
            elif signal == "hold":
                rate = np.gradient(spoken[number].tau, run.h, axis=0)
                for name in ("tau", "u"):
                    if name in change and run.run.control.mode in ("pd", "torque"):
                        change[name] = rate * HOLD / run.run.control.rate
            elif signal == "speed":
                if run.run.control.mode == "pd" and "u" in change and several:
                    change["u"] = np.array(run.run.control.kd) * run.ddq * 0.5 / run.run.control.rate
            elif signal in run.measured:
                rate = np.gradient(run.measured[signal], run.h, axis=0)
                if signal in change:
                    change[signal] = rate * sample
                if signal == "ee" and "ee_rot" in change:
                    turn = run.measured["ee_rot"]
                    change["ee_rot"] = ahead(turn + np.gradient(turn, axis=0), turn) * sample / run.h
            parts.append(coefficients(run, change, mask))
        column = evidence.weighed(parts)
        if np.any(column):
            yield _NAMES.get(signal, f"stamps of {signal}"), column


def _clamps(problem: Problem) -> Iterator[tuple[str, Vector]]:
    """Where in a run a clamped arm stands: known as well as the motor's torque tells that it bears nothing."""
    evidence = problem.evidence
    for number, run in enumerate(evidence.runs):
        for joint in (joint for joint in run.run.locked if "tau" in run.measured):
            parts: list[dict[str, list[Vector]]] = []
            for other, mask in zip(evidence.runs, evidence.masks, strict=True):
                change = {name: np.zeros(values.shape) for name, values in mask.items()}
                if other is run:
                    torque = run.measured["tau"][:, joint - 1]
                    change["tau"][:, joint - 1] = LIGHT * float(np.abs(torque).max())
                parts.append(coefficients(other, change, mask))
            yield f"place of the clamp of joint_{joint} in run {number + 1}", evidence.weighed(parts)
