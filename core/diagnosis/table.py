"""The findings of a diagnosis as rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .diagnosis import Diagnosis

if TYPE_CHECKING:
    import pandas

COLUMNS = (
    "effect",
    "at",
    "probability",
    "shrinks_by",
    "parameter",
    "value",
    "low",
    "high",
    "unit",
    "indistinguishable_from",
)


def rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """A row a parameter of a finding, values in SI, `low` and `high` its 95 % interval; findings in their order."""
    gains = {(share.effect, share.at): share.shrinks_by for share in diagnosis.how_far.by_effect}
    table: list[dict[str, Any]] = []
    for found in diagnosis.which:
        shared = {
            "effect": found.effect,
            "at": found.at,
            "probability": found.probability,
            "shrinks_by": gains.get((found.effect, found.at)),
            "indistinguishable_from": ", ".join(f"{r.effect} {r.at}" for r in found.indistinguishable_from),
        }
        for name, parameter in found.parameters.items():
            low, high = parameter.ci95
            values = {"parameter": name, "value": parameter.value, "low": low, "high": high, "unit": parameter.unit}
            table.append({**shared, **values})
        if not found.parameters:
            table.append(dict.fromkeys(COLUMNS) | shared)
    return table


def frame(diagnosis: Diagnosis) -> pandas.DataFrame:
    """The rows as a pandas table; without findings it has its columns and no rows."""
    import pandas as pd

    return pd.DataFrame(rows(diagnosis), columns=list(COLUMNS))
