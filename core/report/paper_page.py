"""The page of the paper's study done again: what agrees first, then statement by statement, figure by figure."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..files import write_whole
from ..reproduction import Reproduction, Statement, statements
from ..reproduction.modes import Mode
from .paper_geometry_pictures import frames_drawing, misalignment_drawing, path_drawing
from .paper_motion_pictures import (
    closed_loop_drawing,
    derivatives_drawing,
    memory_drawing,
    open_loop_drawing,
)
from .pictures import Drawing, inside
from .section import Section, page

PAGE_FILE = "report.html"
JSON_FILE = "paper.json"
PICTURES = "pictures"

DRAWINGS = {
    "figures_3_and_4": frames_drawing,
    "figure_11": path_drawing,
    "figure_12": open_loop_drawing,
    "figure_13": closed_loop_drawing,
    "memory": memory_drawing,
    "derivatives": derivatives_drawing,
    "misalignment": misalignment_drawing,
}
"""Name of each picture, and what draws it."""

_TITLES = {
    "figures_3_and_4": "Figures 3 and 4: the frames",
    "figure_11": "Figure 11: the Greca",
    "figure_12": "Figure 12: open loop, elastic joints",
    "figure_13": "Figure 13: closed loop, elastic joints",
    "memory": "The Memory block",
    "derivatives": "Each code differentiates by itself",
    "misalignment": "Misaligned axes: beta",
}
_TONES = {"reproduced": "good", "not reproduced": "bad"}


def drawings(study: Reproduction) -> dict[str, Drawing]:
    """Every picture of a study, by name."""
    return {name: draw(study) for name, draw in DRAWINGS.items()}


def write_paper(study: Reproduction, folder: Path, *, force: bool = False) -> tuple[Path, ...]:
    """Write a study: the page, its pictures as files, and all numbers; whole or not at all.

    Raises:
        UsageError: A file is in the way.
    """
    pictures = {name: (drawing.svg(), drawing) for name, drawing in drawings(study).items()}
    files: dict[str, str | bytes] = {
        PAGE_FILE: paper_page(study, pictures),
        JSON_FILE: json.dumps(study.to_json(), indent=1) + "\n",
        **{f"{PICTURES}/{name}.svg": svg for name, (svg, _) in pictures.items()},
    }
    return write_whole(folder, files, force=force)


def paper_page(study: Reproduction, pictures: dict[str, tuple[bytes, Drawing]]) -> str:
    """The whole page as HTML."""
    figures = (PaperFigure(study, name, svg, drawing) for name, (svg, drawing) in pictures.items())
    return page(
        "IMECE2013-64815, done again",
        (PaperAnswer(study), PaperStatements(study), *figures, PaperChoices(study), PaperOrigin(study)),
    )


@dataclass(frozen=True, slots=True)
class PaperAnswer(Section):
    """How many of the paper's statements hold, and the study's main numbers."""

    study: Reproduction
    template: ClassVar[str] = "paper_answer.html.j2"

    def values(self) -> dict[str, Any]:
        """Counts and the size of the study."""
        study, all_of_them = self.study, statements(self.study)
        counts = Counter(statement.verdict for statement in all_of_them)
        opened, closed = study.open_loop.to_json(), study.closed_loop.to_json()
        return {
            "counts": counts,
            "failed": counts["not reproduced"],
            "judged": counts["reproduced"] + counts["not reproduced"] + counts["differs"],
            "facts": [
                ("shift along z", f"{1e3 * opened['shift_z_m']['mean']:.2f} mm"),
                ("in the plane, open loop", f"{1e3 * opened['in_plane_m']['largest']:.2f} mm"),
                ("closed loop", f"{1e3 * closed['in_plane_m']['largest']:.2f} mm"),
                ("engines", str(len(study.case.backends))),
                ("edges of the path", str(len(study.case.corners) - 1)),
            ],
            "whole": study.whole,
        }


@dataclass(frozen=True, slots=True)
class PaperStatements(Section):
    """The paper's statements beside ours."""

    study: Reproduction
    title: ClassVar[str] = "What the paper says, and what ours says"
    template: ClassVar[str] = "paper_statements.html.j2"

    def values(self) -> dict[str, Any]:
        """A row a statement."""

        def row(statement: Statement) -> dict[str, str]:
            return {**statement.to_json(), "tone": _TONES.get(statement.verdict, "")}

        return {"rows": [row(statement) for statement in statements(self.study)]}


@dataclass(frozen=True, slots=True)
class PaperFigure(Section):
    """One picture, with its numbers below it."""

    study: Reproduction
    name: str
    svg: bytes
    drawing: Drawing
    template: ClassVar[str] = "paper_figure.html.j2"

    def values(self) -> dict[str, Any]:
        """The picture and its table."""
        heads, rows = _TABLES[self.name](self.study) if self.name in _TABLES else ([], [])
        return {
            "heading": _TITLES[self.name],
            "picture": inside(self.svg, self.drawing.alt, self.drawing.caption),
            "heads": heads,
            "rows": rows,
        }


def _modes(measured: tuple[Mode, ...], predicted: tuple[Mode, ...], when: str) -> list[list[str]]:
    return [
        [
            f"{when}, oscillation {k}",
            f"{a.frequency:.4f}",
            f"{b.frequency:.4f}",
            f"{a.damping_ratio:.4f}",
            f"{b.damping_ratio:.4f}",
        ]
        for k, (a, b) in enumerate(zip(measured, predicted, strict=True), start=1)
    ]


_MODE_HEADS = ["after the motion", "seen [Hz]", "eigenvalue [Hz]", "damping ratio seen", "eigenvalue's"]


def _open_loop_table(study: Reproduction) -> tuple[list[str], list[list[str]]]:
    return _MODE_HEADS, _modes(study.open_loop.measured, study.open_loop.predicted, "open loop")


def _closed_loop_table(study: Reproduction) -> tuple[list[str], list[list[str]]]:
    closed = study.closed_loop
    rows = [
        *_modes(closed.measured[0], closed.predicted[0], "without Memory"),
        *_modes(closed.measured[1], closed.predicted[1], "with Memory"),
    ]
    return _MODE_HEADS, rows


def _derivatives_table(study: Reproduction) -> tuple[list[str], list[list[str]]]:
    heads = [
        "what the code is given",
        "speed off by [rad/s]",
        "acceleration [rad/s^2]",
        "rigid torque [N m]",
        "tip [um]",
        "expected [um]",
    ]
    rows = [
        [
            name.replace("_", " "),
            f"{one.speed:.2e}",
            f"{one.acceleration:.2e}",
            f"{one.torque:.1f}",
            f"{1e6 * one.tip:.1f}",
            f"{1e6 * one.expected:.1f}",
        ]
        for name, one in ((operator.name, operator) for operator in study.derivatives.operators)
        if one.tip > 0.0
    ]
    return heads, rows


def _memory_table(study: Reproduction) -> tuple[list[str], list[list[str]]]:
    closed = study.closed_loop
    rows: list[list[str]] = []
    named = [(f"feedback {1e3 * late.late:.0f} ms old", late) for late in closed.longer]
    for what, late in (*named, (f"torque {1e3 * closed.on_torque.late:.0f} ms late", closed.on_torque)):
        mean = f"{1e3 * sum(late.peaks) / len(late.peaks):+.3f}" if late.peaks else "-"
        highest = f"{1e3 * max(map(abs, late.heights)):.3f}" if late.heights else "-"
        rows.append([what, f"{1e3 * late.shift:+.4f}", mean, highest])
    return [
        "along the first key",
        "path earlier [ms]",
        "peaks earlier, mean [ms]",
        "peaks' heights change, at most [mm]",
    ], rows


_TABLES = {
    "figure_12": _open_loop_table,
    "figure_13": _closed_loop_table,
    "memory": _memory_table,
    "derivatives": _derivatives_table,
}


@dataclass(frozen=True, slots=True)
class PaperChoices(Section):
    """What the paper leaves open, what was chosen, and what another choice would do."""

    study: Reproduction
    title: ClassVar[str] = "What the paper leaves open"
    template: ClassVar[str] = "paper_choices.html.j2"

    def values(self) -> dict[str, Any]:
        """Choices, and other ones along the first key."""
        others = [
            (choice.what, f"{1e3 * choice.oscillation:.2f}", f"{1e3 * choice.in_plane:.2f}")
            for choice in self.study.closed_loop.choices
        ]
        return {"choices": self.study.choices(), "others": others}


@dataclass(frozen=True, slots=True)
class PaperOrigin(Section):
    """Who took part."""

    study: Reproduction
    title: ClassVar[str] = "Who took part"
    template: ClassVar[str] = "paper_origin.html.j2"

    def values(self) -> dict[str, Any]:
        """Engines, their peaks and their differences, and what was left out."""
        study = self.study
        peaks = study.closed_loop.agreement_on_peaks()
        engines = [
            {
                **engine,
                "step": f"{1e3 * engine['step_s']:.3g}",
                "height": f"{peaks[engine['backend']]['height_m']:.1e}"
                if peaks.get(engine["backend"], {}).get("height_m") is not None
                else "-",
            }
            for engine in study.engines()
        ]
        return {
            "engines": engines,
            "left_out": study.case.left_out,
            "source_hash": study.case.database.content_hash(),
            "reference": study.case.reference,
            "halved": f"{study.open_loop.own_error:.1e}",
            "notes": study.case.compliant.notes,
            "json": JSON_FILE,
        }
