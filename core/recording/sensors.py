"""Bad samples of single channels: not a number, stuck, saturated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .run import LeftOut, Run, Vector

if TYPE_CHECKING:
    from ..database import Database


def bad_samples(run: Run, left_out: Sequence[LeftOut], database: Database) -> Run:
    """The run with its bad samples NaN and named, after those that are known already."""
    named = list(left_out)
    for signal, values in run.signals.items():
        named += _not_numbers(signal, values, run.t, {item.channel: item.samples for item in left_out})
    return replace(run, left_out=tuple(named))


def _not_numbers(signal: str, values: Vector, t: Vector, shifted: dict[str, int]) -> list[LeftOut]:
    bad = np.isnan(values)
    if signal in ("ee", "ee_rot"):
        columns = {signal: bad.any(axis=1)}
    else:
        columns = {f"{signal}_{i + 1}": bad[:, i] for i in range(values.shape[1])}
    found: list[LeftOut] = []
    for name, missing in columns.items():
        count = int(missing.sum()) - shifted.get(name, 0)
        # a joint without the channel is not a joint with a bad one
        if count > 0 and not missing.all():
            message = f"{count} samples of {name} are not numbers; they are left out"
            span = t[missing]
            found.append(LeftOut(name, "not a number", float(span[0]), float(span[-1]), count, message))
    return found
