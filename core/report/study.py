"""The page of a study: how far the tip's error spreads, what it owes to which parameter, and what failed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..files import write_whole
from ..study import Results
from ..study.figures import TIP
from ..study.ledger import PAGE_FILE, PICTURE_FILE
from .section import Section, page
from .study_pictures import MEANINGS, MILLIMETRES, short_names, study_picture, study_png

METHODS = {
    "sobol": "Sobol indices by Saltelli's scheme (SALib).",
    "morris": "Elementary effects after Morris (SALib).",
    "rbd_fast": "First-order indices by random balance designs (SALib); what parameters do together is not seen.",
    "grid": "Variances over the levels of the grid.",
}
_EXTREMES = 5
_REASONS = 20


def write_study(results: Results, folder: Path) -> tuple[Path, ...]:
    """Write a study's results into its folder, all or nothing: description, table, indices, picture and page."""
    files = {**results.files(), PICTURE_FILE: study_png(results), PAGE_FILE: study_page(results)}
    # the folder is this study's by now, so that only its own results can be in the way
    return write_whole(folder, files, force=True)


def study_page(results: Results) -> str:
    """The whole page as HTML."""
    sections = (
        StudyAnswer(results),
        StudyPictures(results),
        StudyIndices(results),
        StudyParameters(results),
        StudyExtremes(results),
        StudyFailures(results),
        StudyOrigin(results),
    )
    return page(f"{results.study.experiment.database.name}: parametric study", sections)


def _text(value: float, digits: int = 4) -> str:
    """A number for people; the whole one stands in the table."""
    return f"{value:.{digits}g}"


def _millimetres(value: float) -> str:
    return _text(MILLIMETRES * value)


@dataclass(frozen=True, slots=True)
class StudyAnswer(Section):
    """Which parameter counts most, and how far the error spreads."""

    results: Results
    template: ClassVar[str] = "study_answer.html.j2"

    def values(self) -> dict[str, Any]:
        """The spread of the error, and the conditions."""
        results, facts = self.results, self.results.study.facts()
        nominal = results.nominal_figures()
        rows: list[tuple[str, list[str]]] = []
        for name in TIP:
            ran = results.figures[name][np.isfinite(results.figures[name])]
            cells = [_millimetres(nominal[name]) if nominal else "-"]
            cells += [_millimetres(float(f(ran))) if len(ran) else "-" for f in (np.min, np.median, np.max)]
            rows.append((MEANINGS[name], cells))
        known = any(one.ranking for one in results.sensitivities)
        return {
            "robot": facts["robot"],
            "strongest": results.strongest() if known else "",
            "variants": facts["variants"],
            "failed": sum(results.reasons().values()),
            "sampling": facts["sampling"],
            "engine": f"{facts['engine']} {facts['engine_version']}",
            "mode": facts["control"]["mode"],
            "duration": _text(facts["duration"]),
            "effects": ", ".join(facts["effects"]) or "none",
            "source_hash": facts["source_hash"],
            "rows": rows,
            "nominal_failed": results.nominal.reason,
        }


@dataclass(frozen=True, slots=True)
class StudyPictures(Section):
    """What can be seen."""

    results: Results
    template: ClassVar[str] = "pictures.html.j2"

    def values(self) -> dict[str, Any]:
        """The one picture."""
        return {"pictures": [study_picture(self.results)]}


@dataclass(frozen=True, slots=True)
class StudyIndices(Section):
    """The indices of every parameter."""

    results: Results
    title: ClassVar[str] = "What the tip's error owes to which parameter"
    template: ClassVar[str] = "study_indices.html.j2"

    def values(self) -> dict[str, Any]:
        """A table a figure."""
        tables: list[dict[str, Any]] = []
        for one in self.results.sensitivities:
            lengths = [("effect" in name, name) for name in one.values]
            rows = [
                (
                    parameter,
                    [_text((MILLIMETRES if length else 1.0) * one.values[name][k], 3) for length, name in lengths],
                )
                for k, parameter in enumerate(one.parameters)
            ]
            heads = [name.replace("_", " ") + (" [mm]" if length else "") for length, name in lengths]
            tables.append({"meaning": MEANINGS[one.figure], "note": one.note, "heads": heads, "rows": rows})
        return {"tables": tables, "method": METHODS[self.results.sensitivities[0].method]}


@dataclass(frozen=True, slots=True)
class StudyParameters(Section):
    """What was varied."""

    results: Results
    title: ClassVar[str] = "What varied"
    template: ClassVar[str] = "study_parameters.html.j2"

    def values(self) -> dict[str, Any]:
        """A row a parameter."""
        rows = [
            {
                "name": parameter.name,
                "database": _text(parameter.scale, 6) if parameter.factors else "-",
                "ends": [_text(parameter.scale * x, 6) for x in (parameter.low, parameter.high)],
                "unit": parameter.unit or "1",
                "spacing": parameter.spacing,
            }
            for parameter in self.results.study.design.parameters
        ]
        return {"rows": rows}


@dataclass(frozen=True, slots=True)
class StudyExtremes(Section):
    """The variants of least and most error."""

    results: Results
    title: ClassVar[str] = "Least and most error"
    template: ClassVar[str] = "study_extremes.html.j2"

    def values(self) -> dict[str, Any]:
        """A row a variant."""
        plan, figures = self.results.study.design, self.results.figures
        rms = figures["tip_rms"]
        # those that failed sort last
        order = np.argsort(rms, kind="stable")[: int(np.isfinite(rms).sum())].tolist()
        chosen: list[int] = order if len(order) <= 2 * _EXTREMES else order[:_EXTREMES] + order[-_EXTREMES:]
        labels, shared = short_names([parameter.name for parameter in plan.parameters])
        rows = [
            (
                variant,
                [_text(x) for x in plan.values[variant]],
                [_millimetres(float(figures[name][variant])) for name in TIP],
            )
            for variant in chosen
        ]
        return {"labels": labels, "shared": shared, "heads": list(MEANINGS.values()), "rows": rows} if rows else {}


@dataclass(frozen=True, slots=True)
class StudyFailures(Section):
    """Why variants failed."""

    results: Results
    title: ClassVar[str] = "What failed"
    template: ClassVar[str] = "study_failures.html.j2"

    def values(self) -> dict[str, Any]:
        """A row a reason."""
        reasons = list(self.results.reasons().items())
        return {"rows": reasons[:_REASONS], "more": len(reasons[_REASONS:])} if reasons else {}


@dataclass(frozen=True, slots=True)
class StudyOrigin(Section):
    """What it was made by."""

    results: Results
    template: ClassVar[str] = "study_origin.html.j2"

    def values(self) -> dict[str, Any]:
        """Hashes and versions."""
        facts = self.results.study.facts()
        return {
            "study": facts["study"],
            "seed": facts["seed"],
            "versions": ", ".join(
                f"{name} {version or 'not installed'}" for name, version in facts["versions"].items()
            ),
        }
