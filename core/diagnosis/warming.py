"""Friction that is another one at the end of a run than at its beginning, as where a drive warms up.

No law of the catalogue knows of time: a level in the middle closes most of such a gap, and would be called its cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .fit import blocks, edges_of, spread
from .forms import FRICTION, forms_of, made_by, torque_column
from .found import rows_of
from .held import MOSTLY, Held, NoLaw
from .judge import Judge
from .refine import refined
from .words import effect_in_words

Vector = NDArray[np.float64]

# over which parts of the longest run friction comes to where it stays
TIMES = (0.125, 0.25, 0.5, 1.0)
# log evidence by which it must be another one: of friction that stays as it is there were 2 at most, of such that warms
# up 72 at least
SAYS_MORE = 20.0
WARMS_SAID = "{friction} at joint {joint} that is {part:.0f} % {other} in the second half of a run than in the first"


def with_warming(judge: Judge, held: Held) -> Held:
    """What holds, with the friction that goes with a run's time; itself where none does, or more is known already."""
    rubs = [k for k, item in enumerate(held.found) if item.effect in FRICTION]
    if held.no_law or not rubs:
        return held
    part, whiten = judge.whole, judge.whiten
    parts = blocks(part.evidence)
    fit = refined(part, whiten, held.found, parts)
    sigma = spread(fit.left, parts)
    found = [replace(item, row=fit.rows[item.key]) for item in held.found]
    every = part.spoken(rows_of(found))
    times = [run.t for run in part.evidence.runs]
    longest = max(float(t[-1]) for t in times)
    best = SAYS_MORE
    for k in rubs:
        i, made = found[k].at - 1, made_by(part, found, k, every)
        forms = [form.column for form in forms_of(part, found, k, every)]
        beside = np.column_stack([fit.slope, *([whiten(np.column_stack(forms))] if forms else [])])

        def tells(
            shapes: Sequence[Vector], unit: Vector, i: int = i, made: list[Vector] = made, beside: Vector = beside
        ) -> tuple[float, float]:
            torques = [torque * shape for torque, shape in zip(made, shapes, strict=True)]
            return _tells(fit.left / unit, beside / unit[:, None], whiten(torque_column(part, i, torques)) / unit)

        fades = [[np.exp(-t / (time * longest)) for t in times] for time in TIMES]
        gain, fade = max(((tells(one, sigma)[1], one) for one in fades), key=lambda told: told[0])
        # part of what stands above noise, where any does, and no other form says
        rest = _without(fit.left, beside)
        above = sum(max(float(rest[a:b] @ rest[a:b]) - (b - a), 0.0) for a, b in edges_of(parts))
        if gain > best and 2.0 * tells(fade, np.ones_like(sigma))[1] > MOSTLY * above:
            best = gain
            early = [(t < 0.5 * longest).astype(float) for t in times]
            power = sum(float(torque @ torque) for torque in made)
            usual = sum(float(torque**2 @ shape) for torque, shape in zip(made, early, strict=True)) / power
            more, _ = tells([shape - usual for shape in early], sigma)
            begins, ends = 1.0 + more * (1.0 - usual), 1.0 - more * usual
            said = WARMS_SAID.format(
                friction=effect_in_words(found[k].effect),
                joint=found[k].at,
                part=100.0 * abs(ends / begins - 1.0),
                other="less" if ends < begins else "more",
            )
            held = replace(held, no_law=NoLaw(found[k].at, said))
    return held


def _tells(left: Vector, beside: Vector, column: Vector) -> tuple[float, float]:
    """How much of a column takes most out of what is left, and the log evidence of it.

    Args:
        left: In units of what a model may miss, shape (N,).
        beside: What may change as well, shape (N, p).
        column: What is asked about, shape (N,).
    """
    left, column = _without(left, beside), _without(column, beside)
    power = float(column @ column)
    if not power > 0.0:
        return 0.0, 0.0
    along = float(column @ left)
    return -along / power, 0.5 * along**2 / power


def _without(values: Vector, columns: Vector) -> Vector:
    """Values (N,) without what columns (N, p) say of them."""
    axes, _ = np.linalg.qr(columns)
    return np.asarray(values - axes @ (axes.T @ values), dtype=np.float64)
