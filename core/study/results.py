"""The results of a study, together: the table, the indices, how the error spreads."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .experiment import NOMINAL, Outcome
from .figures import figure_names
from .ledger import INDICES_FILE, STUDY_FILE, TABLE_FILE
from .sensitivity import Sensitivity, sensitivities
from .table import frame, parquet

if TYPE_CHECKING:
    import pandas

    from .study import Study

Array = NDArray[np.float64]

INDICES_SCHEMA = "mbexport-sensitivity/1"


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """What a study found.

    Attributes:
        study: As planned.
        outcomes: Of the variants, in order.
        nominal: Of the database as it stands.
        figures: Name to values, shape (m,); nan where a variant failed.
        sensitivities: Of the tip's error: root mean square, maximum, end.
    """

    study: Study
    outcomes: tuple[Outcome, ...]
    nominal: Outcome
    figures: Mapping[str, Array]
    sensitivities: tuple[Sensitivity, ...]

    def frame(self) -> pandas.DataFrame:
        """The table: a row a variant, its parameters (SI), its figures, what failed and why."""
        return frame(self.study, self.outcomes)

    def nominal_figures(self) -> dict[str, float]:
        """Figures of the database as it stands; empty where it did not run."""
        return dict(zip(self.figures, self.nominal.figures, strict=True)) if self.nominal.figures else {}

    def strongest(self) -> str:
        """Name of the parameter that the root mean square of the tip's error owes most to; the first where none is."""
        parameters = self.study.design.parameters
        for one in self.sensitivities:
            if one.figure == "tip_rms" and one.ranking:
                return one.parameters[int(np.argmax(one.values[one.ranking]))]
        return next((parameter.name for parameter in parameters if not parameter.fixed), parameters[0].name)

    def reasons(self) -> dict[str, int]:
        """Why variants failed, sorted, and how many did so."""
        counts = Counter(f"{outcome.failed}: {outcome.reason}" for outcome in self.outcomes if outcome.failed)
        return dict(sorted(counts.items()))

    def summary(self) -> dict[str, Any]:
        """Content of sensitivity.json."""
        reasons = self.reasons()
        return {
            "schema": INDICES_SCHEMA,
            "study": self.study.hash(),
            "variants": len(self.outcomes),
            "failed": sum(reasons.values()),
            "reasons": [{"reason": reason, "variants": count} for reason, count in reasons.items()],
            "nominal": self.nominal_figures() or None,
            "nominal_failed": self.nominal.reason or None,
            "sensitivity": [asdict(one) for one in self.sensitivities],
        }

    def files(self) -> dict[str, str | bytes]:
        """What machines read: the study's description, the table, the indices."""
        return {
            STUDY_FILE: json.dumps(self.study.facts(), indent=1) + "\n",
            TABLE_FILE: parquet(self.study, self.outcomes),
            INDICES_FILE: json.dumps(self.summary(), indent=1) + "\n",
        }


def results_of(study: Study, outcomes: Mapping[int, Outcome]) -> Results:
    """The results of a study that ran.

    Args:
        study: As planned.
        outcomes: Of every variant and of the nominal one, as `run_study` gives them.
    """
    variants = tuple(outcomes[variant] for variant in range(len(study.design)))
    names = figure_names(study.experiment.database.n)
    failed = (float("nan"),) * len(names)
    columns = np.array([outcome.figures or failed for outcome in variants]).T
    figures = dict(zip(names, columns, strict=True))
    return Results(study, variants, outcomes[NOMINAL], figures, sensitivities(study.design, figures))
