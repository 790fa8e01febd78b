"""What is plain for a robot and its runs: torques, speeds, ways, masses, that amounts are tried by."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..kinematics import dynamics
from .evidence import differences
from .inverse import Said
from .model import Rows
from .prepare import Prepared
from .problem import Problem

Vector = NDArray[np.float64]

# part of a joint's torques that is no peak of noise
NEARLY_ALL = 0.999


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """What is large for each joint in these runs, shapes (n,): rms torque, speed and acceleration, range, inertia.

    With what is left of every run's torque, and of its arm sides' positions where these were measured, shapes (m, n);
    and the weight [N] that each joint bears, with the length [m] of the arms from there on, shapes (n,); the largest
    torque that the motion takes; and the rms torque that goes through each drive to the arms.
    """

    torque: Vector
    speed: Vector
    acceleration: Vector
    way: Vector
    inertia: Vector
    residual: list[Vector] = field(default_factory=list[Vector])
    turned: list[Vector] = field(default_factory=list[Vector])
    mass: float = 1.0
    length: float = 1.0
    weight: Vector = field(default_factory=lambda: np.zeros(0))
    lever: Vector = field(default_factory=lambda: np.zeros(0))
    peak: Vector = field(default_factory=lambda: np.zeros(0))
    borne: Vector = field(default_factory=lambda: np.zeros(0))


def _felt(run: Prepared, speech: Said) -> Vector | None:
    """The torque that a run's motors had: measured, or as its controller asked for it."""
    return run.measured.get("tau", speech.u)


def scales_of(problem: Problem, rows: Rows) -> Scales:
    """Scales from the runs and the robot with these rows."""
    evidence = problem.evidence
    robots = problem.robots(rows)
    spoken = problem.spoken(rows)
    borne = np.sqrt(np.mean(np.concatenate([s.tau_link**2 for s in spoken]), axis=0))
    torque = borne
    # a joint that should carry nothing may still feel its friction
    felt = [values for run, s in zip(evidence.runs, spoken, strict=True) if (values := _felt(run, s)) is not None]
    if felt:
        torque = np.maximum(torque, np.sqrt(np.mean(np.concatenate(felt) ** 2, axis=0)))
    speed = np.sqrt(np.mean(np.concatenate([run.dq**2 for run in evidence.runs]), axis=0))
    acceleration = np.sqrt(np.mean(np.concatenate([run.ddq**2 for run in evidence.runs]), axis=0))
    q = np.concatenate([run.q for run in evidence.runs])
    inertia = np.diagonal(dynamics(robots[0]).mass_matrix(q[:: max(1, len(q) // 50)]), axis1=1, axis2=2).mean(axis=0)
    left: list[Vector] = []
    turned: list[Vector] = []
    for run, speech, mask in zip(evidence.runs, spoken, evidence.masks, strict=True):
        apart = differences(run, speech)
        name = "tau" if "tau" in apart else "u" if "u" in apart else ""
        left.append(apart[name] * mask[name] if name else np.zeros_like(run.q))
        turned.append(apart["q_link"] * mask["q_link"] if "q_link" in apart else np.zeros_like(run.q))
    arms = [stage.arm for stage in robots[0].stages]
    masses = np.array([max(arm.inertia.mass, 0.0) for arm in arms])
    lengths = np.array([math.hypot(*arm.link.pose().xyz) for arm in arms])
    lengths[-1] += math.hypot(*robots[0].tool.xyz)
    reach = max(1e-2, float(lengths.sum()))
    return Scales(
        np.maximum(torque, 1e-6),
        np.maximum(speed, 1e-6),
        np.maximum(acceleration, 1e-6),
        np.maximum(problem.way(), 1e-6),
        np.maximum(inertia, 1e-9),
        left,
        turned,
        max(0.001, float(masses.max())),
        reach,
        9.81 * np.maximum(np.cumsum(masses[::-1])[::-1], 0.001),
        np.maximum(np.cumsum(lengths[::-1])[::-1], 0.01 * reach),
        np.max([_hardest(run, speech) for run, speech in zip(evidence.runs, spoken, strict=True)], axis=0),
        np.maximum(borne, 1e-6),
    )


def _hardest(run: Prepared, speech: Said) -> list[float]:
    """The largest torque that each joint's motion takes, where the smoothing's ends are not felt."""
    return [nearly_all(torque) for torque in speech.tau[run.edge : len(run.t) - run.edge].T]


def nearly_all(torque: Vector) -> float:
    """What hardly any of a joint's torques (m,) are beyond; 0 where there are none."""
    there = np.abs(torque[np.isfinite(torque)])
    return float(np.quantile(there, NEARLY_ALL)) if len(there) else 0.0
