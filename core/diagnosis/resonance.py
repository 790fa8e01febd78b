"""Springs by their resonance: where a soft one rings, its signature holds near its own stiffness only.

What gives is looked for along its whole range, one softness after the other, and one width of play after the other; the
search takes those that come nearest and frees their numbers.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from ..errors import MbexportError
from .beyond import STIFFENING
from .hypotheses import possible
from .hypothesis import Hypothesis, Values, clamped, defaults
from .inverse import stretch_of
from .model import Rows, merged
from .problem import Problem
from .scales import Scales

# how far each gives under its plain load: an angle [rad] or a part of its arm's length, each so many times the last
LEAST, MOST, STEPS = 3.0e-4, 0.1, 20
# of the critical damping: what rings long is near at its own stiffness only
DAMPED = 0.1
# how wide play is [rad or m], each so many times the last, and up to which part of its joint's way; and how many times
# as many are tried where a gap is loudest, for an arm that bounces is near the truth within a tenth of its width only
NARROW, WIDE, WIDTHS, WIDEST, FINER = 1.0e-4, 5.0e-2, 13, 0.5, 5
# of springs that stiffen, by what part of itself one is stiffer at its root mean square stretch
HARDER = (0.3, 1.0, 3.0)
# what turns, by effect, and what damps it
TURNING: Mapping[str, tuple[str, ...]] = {
    "joint_compliance": ("stiffness",),
    "joint_compliance_6d": ("krx", "kry"),
    "link_flexibility": ("ku", "kv"),
}
DAMPING: Mapping[str, str] = {"stiffness": "damping", "krx": "brx", "kry": "bry", "ku": "bu", "kv": "bv"}


def springs(problem: Problem, rows: Rows, scales: Scales, skip: Collection[tuple[str, int]]) -> list[Hypothesis]:
    """Everything that could give beside these rows, from hard to soft, but for what to skip.

    Args:
        problem: The question.
        rows: What was found.
        scales: Loads of the joints.
        skip: Effects and numbers of places.
    """
    taken = {(name, row.at) for name in TURNING for row in rows.get(name, ())} | set(skip)
    out: list[Hypothesis] = []
    for name, columns in TURNING.items():
        for at in range(1, problem.database.n + 1):
            known = problem.row_at(name, at, {})
            if (name, at) in taken or known is not None or not possible(problem, name, at) or clamped(problem, at):
                continue
            weight, lever = scales.weight[at - 1], scales.lever[at - 1]
            # as a rod bears itself
            load, inertia = weight * lever, weight / 9.81 * lever**2 / 3.0
            if name == "joint_compliance":
                # a light arm behind a heavy rotor winds its drive up by its own load alone
                load, inertia = scales.borne[at - 1], scales.inertia[at - 1]
            for give in np.geomspace(LEAST, MOST, STEPS).tolist():
                out.append(_spring(name, at, columns, load / give, inertia))
    return out


def _spring(name: str, at: int, columns: tuple[str, ...], stiffness: float, inertia: float) -> Hypothesis:
    """One that is as stiff in each of its directions; its numbers are how much softer each is, as logarithms."""

    def values(beta: np.ndarray) -> Values:
        out = defaults(name)
        for column, softer in zip(columns, beta.tolist(), strict=True):
            out[column] = stiffness * math.exp(-softer)
            out[DAMPING[column]] = DAMPED * 2.0 * math.sqrt(out[column] * inertia)
        return out

    one = np.ones(len(columns))
    return Hypothesis(name, at, f"{stiffness:.3g}", values, one, -np.inf * one, alone=False, curved=True)


def clearances(
    problem: Problem, rows: Rows, skip: Collection[tuple[str, int]], loud: Collection[int] = ()
) -> list[Hypothesis]:
    """Play at every joint that may have some beside these rows, from narrow to wide, but for what to skip.

    Where an arm flies from one side of it to the other says nothing of where it does in a narrower one.

    Args:
        problem: The question.
        rows: What was found.
        skip: Effects and numbers of places.
        loud: Numbers of joints at which widths are tried finely.
    """
    gives = ("backlash", "joint_compliance")
    ways = problem.way()
    out: list[Hypothesis] = []
    for at in range(1, problem.database.n + 1):
        there = any(problem.row_at(effect, at, rows) for effect in gives)
        if there or ("backlash", at) in skip or clamped(problem, at):
            continue
        widest = WIDEST * float(ways[at - 1])
        count = FINER * (WIDTHS - 1) + 1 if at in loud else WIDTHS
        out += [_clearance(at, gap) for gap in np.geomspace(NARROW, WIDE, count).tolist() if gap < widest]
    return out


def _clearance(at: int, gap: float) -> Hypothesis:
    """One so wide [rad or m]; its number is how much wider it is, as a logarithm."""

    def values(beta: np.ndarray) -> Values:
        return defaults("backlash") | {"gap": gap * math.exp(float(beta[0]))}

    one = np.ones(1)
    return Hypothesis("backlash", at, f"{gap:.3g} wide", values, one, -np.inf * one, alone=False, curved=True)


def stiffening(problem: Problem, rows: Rows, straight: Hypothesis) -> list[Hypothesis]:
    """Springs as stiff as a straight one at that one's root mean square stretch beside these rows, and that stiffen.

    One that stiffens rings nowhere as a straight one does, but gives about as far.
    """
    return [_stiffening(problem, rows, straight, harder) for harder in HARDER]


def _stiffening(problem: Problem, rows: Rows, straight: Hypothesis, harder: float) -> Hypothesis:
    columns = TURNING[straight.effect]

    def values(beta: np.ndarray) -> Values | None:
        row = straight.rows(np.zeros_like(straight.scale))
        plain = straight.values(beta)
        # looked for when it is asked for: of one that was tried before nobody asks
        stretch = stretch_along(problem, merged(rows, row), straight.effect, straight.at) if row else 0.0
        if plain is None or not stretch > 0.0:
            return None
        softer = {name: plain[name] / (1.0 + harder) for name in columns}
        return {**plain, **softer, STIFFENING: harder / stretch**2}

    form = f"{straight.form} stiffening {harder:g}"
    return Hypothesis(straight.effect, straight.at, form, values, straight.scale, straight.lower, False, True)


@np.errstate(over="ignore", invalid="ignore")
def stretch_along(problem: Problem, rows: Rows, effect: str, at: int) -> float:
    """Root mean square stretch of the spring of an effect at a place along all runs [rad or m]; 0 of no such robot."""
    try:
        robots = problem.robots(rows)
        along = zip(robots, problem.evidence.runs, problem.evidence.nominals, strict=True)
        squares = [float(np.mean(stretch_of(robot, run, nominal, effect, at) ** 2)) for robot, run, nominal in along]
    except MbexportError:
        return 0.0
    mean = math.sqrt(float(np.mean(squares)))
    return mean if math.isfinite(mean) else 0.0
