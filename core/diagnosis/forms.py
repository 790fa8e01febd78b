"""What a law of another form than the real one's leaves: no second cause is named for it.

Real laws are not those of the catalogue to the last part: friction may be another one there than back, a spring may
stiffen on its way, a damper yield with speed, a gear's error come twice a turn as well. For every finding these are
columns, the change of the residual for as much of each as is plain; no more of them is taken out of what is left, with
another finding at its joint and without.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow, effect_named
from .evidence import coefficients
from .inverse import Said
from .nuisances import Whitening
from .problem import Problem
from .search import Found, rows_of

Vector = NDArray[np.float64]

# the part of a law that may go with direction, with its own size, and twice as often; and what its amount makes up for
ASIDE, BENT, TWICE, AMOUNT = 0.25, 0.4, 0.5, 0.5
# friction, that may be another one there than back
_ASIDE = ("coulomb_friction", "stribeck_friction", "viscous_friction", "load_friction", "hysteresis")
# laws that may go with another power of themselves
_POWERS: dict[str, tuple[float, ...]] = {
    "viscous_friction": (2.0,),
    "stribeck_friction": (0.5, 2.0),
    "joint_spring": (2.0, 3.0),
    "torque_constant": (2.0,),
}


def beyond_forms(
    problem: Problem, whiten: Whitening, found: Sequence[Found], k: int
) -> Callable[[Vector], Vector] | None:
    """What takes out of a rest all that laws of other findings at the joint of finding k may leave; None: no such.

    Args:
        problem: The runs.
        whiten: Their nuisances, which are out of the rest already.
        found: Findings: those that say more than the k-th does at its joint may have laws of other forms.
        k: Its place.
    """
    item = found[k]
    if effect_named(item.effect).key != "joint" or item.effect == "torque_limit":
        # where a drive stands at its limit no law of another form says so
        return None
    at_joint = [j for j, one in enumerate(found) if one.at == item.at and effect_named(one.effect).key == "joint"]
    if at_joint == [k]:
        return None
    every = problem.spoken(rows_of(found))
    sizes = {j: _size(every, _without(problem, found, j), item.at) for j in at_joint}
    columns: list[Vector] = []
    for other, size in sizes.items():
        if other != k and size > sizes[k]:
            columns += _columns(problem, found, other, every)
    if not columns:
        return None
    slope = whiten(np.column_stack(columns))

    def beyond(left: Vector) -> Vector:
        optimize: Any = import_module("scipy.optimize")
        part = optimize.lsq_linear(slope, -left, bounds=(-1.0, 1.0))
        return np.asarray(left + slope @ part.x, dtype=np.float64)

    return beyond


def _without(problem: Problem, found: Sequence[Found], k: int) -> list[Said]:
    return problem.spoken(rows_of([one for j, one in enumerate(found) if j != k]))


def _size(every: Sequence[Said], without: Sequence[Said], at: int) -> float:
    """Mean square of the torque that a finding makes at its joint."""
    made = np.concatenate([(one.tau - other.tau)[:, at - 1] for one, other in zip(every, without, strict=True)])
    return float(np.mean(made**2))


def _columns(problem: Problem, found: Sequence[Found], k: int, every: Sequence[Said]) -> list[Vector]:
    """The change of the residual for as much of each form as is plain of a finding's law."""
    item, evidence = found[k], problem.evidence
    i = item.at - 1
    without = _without(problem, found, k)
    made = [one.tau[:, i] - other.tau[:, i] for one, other in zip(every, without, strict=True)]
    most = max(float(np.max(np.abs(one), initial=0.0)) for one in made)
    if most == 0.0:
        return []
    shapes: list[list[Vector]] = []
    if item.effect in _ASIDE:
        shapes.append([ASIDE * np.sign(run.dq[:, i]) * one for run, one in zip(evidence.runs, made, strict=True)])
    if item.effect == "load_friction":
        # a gear loses less where it drives than where it is driven
        drives = [np.sign(one.tau_link[:, i]) for one in every]
        shapes.append([ASIDE * side * np.abs(one) for side, one in zip(drives, made, strict=True)])
    for power in _POWERS.get(item.effect, ()):
        shapes.append([BENT * most * np.sign(one) * np.abs(one / most) ** power for one in made])
    if "cycles" in item.row.values:
        for turned in (0.0, 0.5 * np.pi):
            values = item.row.values
            twice = {"amplitude": TWICE * values["amplitude"], "cycles": 2.0 * values["cycles"], "phase": turned}
            wave = replace(item, row=EffectRow(item.at, {**values, **twice}))
            other = problem.spoken(rows_of([*found[:k], wave, *found[k + 1 :]]))
            shapes.append([one.tau[:, i] - rest.tau[:, i] for one, rest in zip(other, without, strict=True)])
    if shapes:
        shapes.append([AMOUNT * one for one in made])
    return [_column(problem, i, shape) for shape in shapes]


def _column(problem: Problem, i: int, torques: Sequence[Vector]) -> Vector:
    """The change of the residual for more torque at a joint in every run."""
    evidence = problem.evidence
    parts: list[dict[str, list[Vector]]] = []
    for run, mask, torque in zip(evidence.runs, evidence.masks, torques, strict=True):
        change = {name: np.zeros(values.shape) for name, values in mask.items()}
        for name in ("tau", "u"):
            if name in change:
                change[name][:, i] = -torque
        parts.append(coefficients(run, change, mask))
    return evidence.weighed(parts)
