"""Plain least squares along the measured motion: rotor inertia, viscous and Coulomb friction and an offset a joint.

Measured torque less that of inverse dynamics of the known model, motion and torque behind the same zero-phase filter,
where the joint moves; as many samples as the filter's band leaves independent. Of all 16 sets of the four columns the
one of least BIC whose totals are possible (no negative inertia or friction); intervals are those of least squares.
"""

from __future__ import annotations

import math
from itertools import chain, combinations
from typing import Any

import mujoco
import numpy as np
from given import Given, Number, Vector

from mbexport.core.diagnosis.prepare import Prepared

EFFECTS = ("rotor_inertia", "viscous_friction", "coulomb_friction", "torque_offset")
# a joint stands below this part of its fastest speed; friction is between its levels there
STANDS = 0.02


def fitted(case: Given) -> tuple[Number, ...]:
    """The chosen numbers of every joint that moves."""
    model: Any = mujoco.MjModel.from_xml_string(case.mjcf)
    armature, damping, friction = (
        np.array(values) for values in (model.dof_armature, model.dof_damping, model.dof_frictionloss)
    )
    model.dof_frictionloss[:] = 0.0
    noise = case.sigma("tau")
    rests = [known_torque(model, motion, friction) for motion in case.motions]
    numbers: list[Number] = []
    for i in range(case.n):
        parts = [columns_of(motion, i, rest) for motion, rest in zip(case.motions, rests, strict=True)]
        columns = np.concatenate([part[0] for part in parts])
        left = np.concatenate([part[1] for part in parts])
        nominal = np.array([armature[i], damping[i], friction[i], 0.0])
        if len(left) < 2 * len(EFFECTS):
            continue
        for k, change, spread in best(columns, left, nominal):
            shows = abs(change) * float(np.sqrt(np.mean(columns[:, k] ** 2))) / noise[i]
            value = float(nominal[k] + change)
            numbers.append(Number(EFFECTS[k], i + 1, float(nominal[k]), value, 1.96 * spread, float(shows)))
    return tuple(numbers)


def known_torque(model: Any, motion: Prepared, friction: Vector) -> Vector:
    """Torque that the known model takes along a motion, (m, n)."""
    data: Any = mujoco.MjData(model)
    out = np.empty_like(motion.q)
    for k in range(len(out)):
        data.qpos[:], data.qvel[:], data.qacc[:] = motion.q[k], motion.dq[k], motion.ddq[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse
    return out + friction * np.sign(motion.dq)


def columns_of(motion: Prepared, i: int, rest: Vector) -> tuple[Vector, Vector]:
    """(columns (m, 4), torque that the known model leaves (m,)) of a joint where it moves, thinned."""
    control = motion.run.control
    # a torque that is held from its tick on is, in the mean, that of half a tick later
    late = 0.5 / control.rate if control.mode in ("pd", "torque") else 0.0
    tau = np.interp(motion.t - late, motion.t, motion.measured["tau"][:, i])
    dq, ddq = motion.dq[:, i], motion.ddq[:, i]
    good = np.abs(dq) > STANDS * np.max(np.abs(dq), initial=1.0e-9)
    good &= ~(motion.missing["tau"][:, i] | motion.missing["q"].any(axis=1))
    good[: motion.edge] = good[len(good) - motion.edge :] = False
    kept = np.flatnonzero(good)[:: max(1, round(0.5 / motion.band / motion.h))]
    columns = np.column_stack([ddq, dq, np.sign(dq), np.ones_like(dq)])
    return columns[kept], (tau - rest[:, i])[kept]


def best(columns: Vector, left: Vector, nominal: Vector) -> list[tuple[int, float, float]]:
    """(column, change, its standard deviation) of the set of least BIC."""
    m, whole = columns.shape
    chosen: list[tuple[int, float, float]] = []
    least = math.inf
    for subset in chain.from_iterable(combinations(range(whole), size) for size in range(whole + 1)):
        part = columns[:, list(subset)]
        if np.linalg.matrix_rank(part) < len(subset):
            continue
        change = np.linalg.lstsq(part, left, rcond=None)[0]
        if any(nominal[k] + one < 0.0 and k != whole - 1 for k, one in zip(subset, change, strict=True)):
            continue
        square = float(np.sum((left - part @ change) ** 2))
        score = m * math.log(square / m) + len(subset) * math.log(m)
        if score < least:
            least = score
            covariance = square / (m - len(subset)) * np.linalg.inv(part.T @ part)
            spread = np.sqrt(np.diag(covariance))
            chosen = [(k, float(one), float(sd)) for k, one, sd in zip(subset, change, spread, strict=True)]
    return chosen
