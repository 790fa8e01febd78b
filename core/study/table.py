"""A study's results as one table, a row a variant."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from .experiment import Outcome
from .figures import figure_names

if TYPE_CHECKING:
    import pandas

    from .study import Study


def frame(study: Study, outcomes: Sequence[Outcome]) -> pandas.DataFrame:
    """The table: variant, the parameters' values (SI), the figures, what failed and why.

    Args:
        study: As planned.
        outcomes: Of the variants, in order; the figures of one that failed are nan.
    """
    import pandas as pd

    names = figure_names(study.experiment.database.n)
    failed = (float("nan"),) * len(names)
    columns: dict[str, Any] = {"variant": np.arange(len(outcomes))}
    columns |= {p.name: study.design.values[:, i] for i, p in enumerate(study.design.parameters)}
    figures = np.array([outcome.figures or failed for outcome in outcomes]).T
    columns |= dict(zip(names, figures, strict=True))
    columns["failed"] = [outcome.failed for outcome in outcomes]
    columns["reason"] = [outcome.reason for outcome in outcomes]
    return pd.DataFrame(columns)


def parquet(study: Study, outcomes: Sequence[Outcome]) -> bytes:
    """The table as a Parquet file whose metadata hold the study's description and the columns' units.

    The same bytes for the same results, wherever and by how many they were made.
    """
    arrow, writer = arrow_modules()
    facts = study.facts()
    plain = arrow.Table.from_pandas(frame(study, outcomes), preserve_index=False)
    fields = [
        field.with_metadata({"unit": facts["columns"][field.name]}) if field.name in facts["columns"] else field
        for field in plain.schema
    ]
    metadata = {**plain.schema.metadata, b"mbexport": json.dumps(facts).encode()}
    out = io.BytesIO()
    writer.write_table(plain.cast(arrow.schema(fields, metadata=metadata)), out)
    return out.getvalue()


def arrow_modules() -> tuple[Any, Any]:
    """pyarrow and its Parquet.

    Raises:
        UsageError: It is not installed.
    """
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise UsageError("a study's table needs pyarrow: pip install 'mbexport[study]'") from error
