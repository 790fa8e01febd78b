"""Fits of laws beyond the catalogue's, and of the catalogue's that a database and engines take in their place."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from .beyond import (
    CONSTANT,
    DROOP,
    KNEE,
    LIMIT,
    RANGES,
    SECOND,
    SECOND_PHASE,
    SPRINGS,
    STIFFENING,
    WAVES,
    by_catalogue,
    number_of,
)
from .fit import Part, gained, spread
from .hypothesis import clamped
from .model import tables
from .nuisances import Whitening
from .problem import Problem
from .refine import Refined, left_with, refined
from .resonance import stretch_along

if TYPE_CHECKING:
    from .found import Found

Vector = NDArray[np.float64]

# where fits begin: a spring that rings is nearly right near its own numbers only. Parts of the straight one's
# stiffness, and by what part of itself it is stiffer at that one's root mean square stretch
SOFTER, HARDER = (0.55, 0.75, 0.9, 1.1), (0.05, 0.2, 0.7, 2.0)
# of a limit that is felt before it is reached: times the one that cuts, and widths of the knee
HIGHER, WIDER = (0.97, 1.0, 1.05, 1.15), (0.03, 0.1)
# by which part of itself the square of a gain that droops is larger without, at the root mean square torque
DROOPS = (0.05, 0.2, 0.6)
# and the least part of that gain that the nearest constant is
LEAST_GIVEN = 0.3
# and the straight spring that is nearest: times the stiffness at rest
CHORDS = (1.0, 1.15, 1.3, 1.5, 1.75, 2.0, 2.5)
# part of what the catalogue's law leaves above noise that one beyond it leaves, or it is the catalogue's; and the log
# evidence that a knee must earn, as any other number
ANOTHER, EARNS = 0.8, 10.0
# part of the energy that is there without it which a straight spring may leave and need no other form
CLOSE = 0.02


def beyond_catalogue(
    problem: Problem,
    whiten: Whitening,
    found: Sequence[Found],
    fit: Refined,
    parts: Sequence[Part],
    item: Found,
    before: float,
) -> Refined:
    """The fit with a law beyond the catalogue's, where that leaves clearly less; else itself.

    Args:
        problem: The question.
        whiten: Its nuisances.
        found: Findings, the one that is asked about among them.
        fit: Their joint fit, with the catalogue's law of that one.
        parts: Bands of what is left.
        item: The one that is asked about.
        before: Sum of squares that is left without it.
    """
    left, loud = _above(fit), before - len(fit.left)
    if not 0.0 < left < loud or number_of(item.effect, fit.rows[item.key]):
        # it explains all, or nothing, or has another law already
        return fit
    if item.effect in SPRINGS:
        begun = stiffer(problem, fit, item) if left > CLOSE * loud else []
    elif item.effect == LIMIT:
        begun = with_knees(fit, item)
    elif item.effect == CONSTANT:
        begun = drooping(problem, fit, item)
    else:
        begun = as_harmonics(problem, whiten, fit, item) if item.effect in WAVES else []
    if not begun:
        return fit
    other = begun_from(problem, whiten, found, fit, parts, item, begun)
    if item.effect not in SPRINGS and gained(fit.left, other.left, spread(other.left, parts), parts) < EARNS:
        return fit
    return other if _above(other) < ANOTHER * left else fit


def with_knees(fit: Refined, item: Found) -> list[EffectRow]:
    """Where fits begin of a torque limit that is felt before it is reached in the place of one that cuts."""
    values = fit.rows[item.key].values
    return [
        EffectRow(item.at, {**values, "torque": higher * values["torque"], KNEE: knee})
        for higher in HIGHER
        for knee in WIDER
    ]


def drooping(problem: Problem, fit: Refined, item: Found) -> list[EffectRow]:
    """Where fits begin of a motor whose constant droops: of the root mean square torque it gives as much as it did."""
    row, i = fit.rows[item.key], item.at - 1
    gain = row.values["gain"]
    given = np.concatenate([one.tau[:, i] for one in problem.spoken(tables(fit.rows))])
    square = float(np.mean(given**2))
    if not square > 0.0:
        return []
    return [
        EffectRow(item.at, {**row.values, "gain": gain * math.sqrt(1.0 + part), DROOP: 0.5 * part / square})
        for part in DROOPS
    ]


def as_harmonics(problem: Problem, whiten: Whitening, fit: Refined, item: Found) -> list[EffectRow]:
    """Where fits begin of a wave that comes twice as often as well: the one that was found may be either of the two.

    What comes half as often is no wave where it goes round too rarely, and is looked for where it is the larger one.
    """
    row = fit.rows[item.key]
    amplitude, cycles, phase = (row.values[name] for name in ("amplitude", "cycles", "phase"))

    def changed(**values: float) -> EffectRow:
        return EffectRow(item.at, {**row.values, **values})

    def left(wave: EffectRow) -> Vector:
        return left_with(problem, whiten, tables({**fit.rows, item.key: wave}))

    def beside(often: float) -> tuple[float, float, float]:
        """Of a wave so many times as often that takes most of what is left: size in amplitudes, phase, and the rest."""
        waves = [changed(cycles=often * cycles, phase=quadrature) for quadrature in (0.0, 0.5 * math.pi)]
        columns = np.column_stack([left(wave) - nothing for wave in waves])
        sine, cosine = np.linalg.lstsq(columns, -fit.left, rcond=None)[0]
        rest = fit.left + columns @ np.array([sine, cosine])
        return math.hypot(sine, cosine), math.atan2(cosine, sine), float(rest @ rest) - len(rest)

    nothing = left(changed(amplitude=0.0))
    begun: list[EffectRow] = []
    if 0.5 * cycles >= problem.fewest_cycles(item.at):
        size, first, _ = beside(0.5)
        if size >= 1.0:
            half = {"amplitude": size * amplitude, "cycles": 0.5 * cycles, "phase": first}
            begun.append(changed(**half, **{SECOND: 1.0 / size, SECOND_PHASE: phase}))
    size, second, rest = beside(2.0)
    if size <= 1.0 and rest < ANOTHER * _above(fit):
        begun.append(changed(**{SECOND: size, SECOND_PHASE: second}))
    return begun


def stiffer(problem: Problem, fit: Refined, item: Found) -> list[EffectRow]:
    """Where fits begin of springs that stiffen, around a straight one; nowhere for what is no spring that gives."""
    row = fit.rows[item.key]
    columns = [name for name in SPRINGS[item.effect] if math.isfinite(row.values[name])]
    if not columns or clamped(problem, item.at):
        return []
    straight = {key: by_catalogue(row) for key, row in fit.rows.items()}
    stretch = stretch_along(problem, tables(straight), item.effect, item.at)
    if not stretch > 0.0:
        return []
    return [
        EffectRow(
            item.at,
            {**row.values, **{name: softer * row.values[name] for name in columns}, STIFFENING: harder / stretch**2},
        )
        for softer in SOFTER
        for harder in HARDER
    ]


def straightened(
    problem: Problem, whiten: Whitening, found: Sequence[Found], fit: Refined, parts: Sequence[Part]
) -> Refined:
    """The fit with the catalogue's laws in the place of those beyond it; itself where it has none.

    A spring that stiffens gets the straight one that is nearest, a limit with a knee one that cuts where it comes to
    (of a lower one simulation tells more than the motion), a motor that droops the constant that is nearest, and a wave
    goes without what comes twice as often.
    """
    springs = [item for item in found if STIFFENING in fit.rows[item.key].values]
    droops = [item for item in found if DROOP in fit.rows[item.key].values]
    rows = {key: by_catalogue(row) if key[0] in (*SPRINGS, CONSTANT) else row for key, row in fit.rows.items()}

    def leaves(begun: Mapping[tuple[str, int], EffectRow]) -> float:
        rest = left_with(problem, whiten, tables(begun))
        return float(rest @ rest)

    for item in springs:
        values = rows[item.key].values
        chords = [
            EffectRow(item.at, {**values, **{name: times * values[name] for name in SPRINGS[item.effect]}})
            for times in CHORDS
        ]
        rows[item.key] = min(chords, key=lambda row, key=item.key: leaves({**rows, key: row}))
    unsure = np.zeros(len(fit.free))
    for item in droops:
        before = rows[item.key].values["gain"]
        # all else as it is: beside a law that is not the real one it would move to take up for it
        rows[item.key] = _nearest_constant(rows[item.key], lambda row, key=item.key: leaves({**rows, key: row}))
        # which is nearest elsewhere is known as well as that
        unsure[fit.free.index((*item.key, "gain"))] = before - rows[item.key].values["gain"]
    if droops:
        fit = replace(fit, rows=rows, covariance=fit.covariance + np.diag(unsure**2))
    if springs:
        fit = refined(problem, whiten, [replace(item, row=rows[item.key]) for item in found], parts)
    return _without_more(problem, whiten, fit)


def _nearest_constant(row: EffectRow, leaves: Callable[[EffectRow], float]) -> EffectRow:
    """A torque constant's row with the gain that leaves least, no larger than what a small torque has."""
    optimize: Any = import_module("scipy.optimize")

    def of(gain: float) -> EffectRow:
        return EffectRow(row.at, {**row.values, "gain": gain})

    def left(gain: float) -> float:
        return leaves(of(gain))

    most = row.values["gain"]
    return of(float(optimize.minimize_scalar(left, bounds=(LEAST_GIVEN * most, most), method="bounded").x))


def _without_more(problem: Problem, whiten: Whitening, fit: Refined) -> Refined:
    """The fit with limits that cut where those with a knee come to, and plain waves; itself where all of it is so."""
    kept = [k for k, (_, _, name) in enumerate(fit.free) if name not in RANGES]
    if len(kept) == len(fit.free):
        return fit
    rows = {key: by_catalogue(row) for key, row in fit.rows.items()}
    return replace(
        fit,
        rows=rows,
        left=left_with(problem, whiten, tables(rows)),
        free=tuple(fit.free[k] for k in kept),
        covariance=fit.covariance[np.ix_(kept, kept)],
        slope=fit.slope[:, kept],
        shown=tuple(fit.shown[k] for k in kept),
    )


def begun_from(
    problem: Problem,
    whiten: Whitening,
    found: Sequence[Found],
    fit: Refined,
    parts: Sequence[Part],
    item: Found,
    begun: Sequence[EffectRow],
) -> Refined:
    """The fit that begins where a finding's row is the one of these that leaves least beside the others."""

    def leaves(row: EffectRow) -> float:
        rest = left_with(problem, whiten, tables({**fit.rows, item.key: row}))
        return float(rest @ rest)

    best = min(begun, key=leaves)
    trial = [replace(one, row=best if one.key == item.key else fit.rows[one.key]) for one in found]
    return refined(problem, whiten, trial, parts)


def _above(fit: Refined) -> float:
    """Sum of squares above noise that a fit leaves."""
    return float(fit.left @ fit.left) - len(fit.left)
