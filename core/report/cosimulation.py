"""The page of a co-simulation: what the communication step costs the tip, and what memory does."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..cosimulation import CouplingStudy, Measured, Reference
from ..cosimulation.study import kind_named
from ..files import write_whole
from .cosimulation_pictures import MILLIMETRES, MILLISECONDS, cosimulation_picture, cosimulation_svg
from .section import Section, page

PAGE = "cosimulation.html"
FILES = ("cosimulation.json", "errors.csv", "errors.svg", PAGE)


def write_cosimulation(study: CouplingStudy, folder: Path, *, force: bool = False) -> tuple[Path, ...]:
    """Write a study whole or not at all: numbers, table, picture, page."""
    content = (
        json.dumps(study.to_json(), indent=1) + "\n",
        study.table(),
        cosimulation_svg(study),
        cosimulation_page(study),
    )
    return write_whole(folder, dict(zip(FILES, content, strict=True)), force=force)


def cosimulation_page(study: CouplingStudy) -> str:
    """The whole page as HTML."""
    sections = (CouplingAnswer(study), CouplingPicture(study), CouplingTable(study))
    return page(f"{study.loop.robot.name}: co-simulation", sections)


def answer_of(study: CouplingStudy) -> str:
    """What was found, in a sentence."""
    longest = max((one for one in study.measured if one.stable), key=lambda one: one.interval, default=None)
    if longest is None:
        return "no communication step holds the loop together"
    held = next((one for one in study.measured if one.stable and one.interval == longest.interval), longest)
    return (
        f"a communication step of {MILLISECONDS * held.interval:.4g} ms takes the tip "
        f"{MILLIMETRES * held.largest:.3g} mm off ({kind_named(held.order, held.memory)})"
    )


@dataclass(frozen=True, slots=True)
class CouplingAnswer(Section):
    """The sentence, and the conditions."""

    study: CouplingStudy
    template: ClassVar[str] = "cosimulation_answer.html.j2"

    def values(self) -> dict[str, Any]:
        """What was coupled."""
        study, facts = self.study, self.study.to_json()
        return {
            "robot": facts["robot"],
            "answer": answer_of(study),
            "engine": f"{facts['engine']} {facts['version']}",
            "integrator": facts["integrator"],
            "step": f"{MILLISECONDS * study.step:.4g}",
            "controller": study.loop.controller.in_words(),
            "against": _against(study.reference),
            "duration": f"{study.loop.duration:.4g}",
            "effects": ", ".join(facts["effects"]) or "none",
            "source_hash": facts["source_hash"],
        }


def _against(reference: Reference) -> str:
    """What the tip is held against, in a sentence."""
    coupling, known_to = reference.coupling, reference.known_to
    if coupling is None or known_to is None:
        return "Distances are those of the tip from where it is when both are solved in one piece."
    return (
        f"The loop cannot be solved in one piece: {reference.because}. Distances are those of the tip from where it is "
        f"when both communicate every {MILLISECONDS * coupling.interval:.4g} ms "
        f"({kind_named(coupling.order, coupling.memory)}), which is itself within about "
        f"{MILLIMETRES * known_to:.2g} mm: so far it moves when that step is halved."
    )


@dataclass(frozen=True, slots=True)
class CouplingPicture(Section):
    """What can be seen."""

    study: CouplingStudy
    template: ClassVar[str] = "pictures.html.j2"

    def values(self) -> dict[str, Any]:
        """The one picture."""
        return {"pictures": [cosimulation_picture(self.study)]}


@dataclass(frozen=True, slots=True)
class CouplingTable(Section):
    """All numbers."""

    study: CouplingStudy
    title: ClassVar[str] = "Every coupling"
    template: ClassVar[str] = "cosimulation_table.html.j2"

    def values(self) -> dict[str, Any]:
        """A row a coupling, with the order of convergence from the step before."""
        rows: list[tuple[str, list[str]]] = []
        for order, memory in self.study.kinds():
            before: Measured | None = None
            for one in self.study.measured:
                if (one.order, one.memory) != (order, memory):
                    continue
                rows.append((kind_named(order, memory), _cells(one, before)))
                before = one if one.stable else None
        return {"rows": rows}


def _cells(one: Measured, before: Measured | None) -> list[str]:
    step = f"{MILLISECONDS * one.interval:.4g}"
    if not one.stable:
        return [step, "unstable", "", "", "", ""]
    observed = ""
    if before is not None:
        observed = f"{math.log(before.largest / one.largest) / math.log(before.interval / one.interval):.2f}"
    lengths = [f"{MILLIMETRES * value:.3g}" for value in (one.largest, one.rms)]
    return [step, *lengths, observed, f"{MILLISECONDS * one.earlier:.3g}", f"{one.peak:.4f}"]
