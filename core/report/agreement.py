"""The page of an agreement: the answer first, then why, then pictures, then every number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ..agreement import Agreement, Figure
from ..agreement.culprit import TABLES, WORDS, judge
from ..agreement.gates import GATES
from ..agreement.scenarios import SCENARIOS
from .agreement_pictures import all_pictures
from .section import Section, page


def agreement_page(agreement: Agreement) -> str:
    """The whole page as HTML."""
    sections = (
        Answer(agreement),
        Why(agreement),
        Pictures(agreement),
        Quantities(agreement),
        Orders(agreement),
        Participants(agreement),
        Pairs(agreement),
    )
    word = "agree" if agreement.agreed else "do not agree"
    return page(f"{agreement.robot}: the engines {word}", sections)


@dataclass(frozen=True, slots=True)
class Answer(Section):
    """Yes or no, in one line, and on what."""

    agreement: Agreement
    template: ClassVar[str] = "answer.html.j2"

    def values(self) -> dict[str, Any]:
        """The verdict and the robot."""
        answer = self.agreement
        engines = [voice for voice in answer.voices if voice.name != TABLES]
        beyond = sum(not figure.passed for figure in answer.figures)
        return {
            "agreed": answer.agreed,
            "robot": answer.robot,
            "level": answer.level,
            "effects": ", ".join(answer.effects) or "none",
            "engines": len(engines),
            "tables": len(engines) < len(answer.voices),
            "comparisons": len(answer.figures),
            "beyond": beyond,
            "source_hash": answer.source_hash,
        }


@dataclass(frozen=True, slots=True)
class Why(Section):
    """The sentences."""

    agreement: Agreement
    template: ClassVar[str] = "why.html.j2"

    def values(self) -> dict[str, Any]:
        """Sentences, notes and what was left out."""
        answer = self.agreement
        return {
            "agreed": answer.agreed,
            "sentences": answer.sentences,
            "notes": answer.notes,
            "left_out": [
                (o.voice, "" if o.scenario == "everything" else o.scenario, o.reason) for o in answer.left_out
            ],
        }


@dataclass(frozen=True, slots=True)
class Pictures(Section):
    """What can be seen."""

    agreement: Agreement
    template: ClassVar[str] = "pictures.html.j2"

    def values(self) -> dict[str, Any]:
        """The pictures there are."""
        pictures = all_pictures(self.agreement)
        return {"pictures": pictures} if pictures else {}


@dataclass(frozen=True, slots=True)
class Quantities(Section):
    """Every quantity of every voice, held against those that agree."""

    agreement: Agreement
    title: ClassVar[str] = "Every quantity, every voice"
    template: ClassVar[str] = "quantities.html.j2"

    def values(self) -> dict[str, Any]:
        """Rows by scenario and signal, a cell a voice."""
        answer = self.agreement
        voices = [voice for voice in answer.evidence.labels if any(voice in f.voices for f in answer.figures)]
        groups: dict[str, list[dict[str, Any]]] = {}
        for scenario, signal in dict.fromkeys((f.scenario, f.signal) for f in answer.figures):
            of_row = [f for f in answer.figures if (f.scenario, f.signal) == (scenario, signal)]
            odd, trusted, common, _ = judge(answer.evidence, scenario, signal)
            agreeing = [v for v in answer.evidence.labels if v not in odd]
            cells = [_cell(of_row, voice, [trusted] if common else agreeing) for voice in voices]
            if any(cells):
                gates = list(dict.fromkeys(f"{gate:.0e}" for gate in sorted({figure.gate for figure in of_row})))
                heading = "At rest" if scenario == "statics" else SCENARIOS[scenario].capitalize()
                groups.setdefault(heading, []).append(
                    {
                        "signal": WORDS[signal],
                        "unit": "relative" if GATES[signal].unit == "1" else GATES[signal].unit,
                        "cells": cells,
                        "gates": gates[0] if len(gates) == 1 else f"{gates[0]} to {gates[-1]}",
                    }
                )
        return {"voices": voices, "groups": groups} if groups else {}


def _cell(figures: Sequence[Figure], voice: str, others: Sequence[str]) -> dict[str, Any] | None:
    """The worst figure of a voice against those that agree; None where it was not compared."""
    held = [figure for figure in figures if voice in figure.voices and set(figure.voices) - {voice} <= set(others)]
    if not held:
        return None
    worst = max(held, key=lambda figure: figure.value / figure.gate)
    where = f"{worst.at}, " if worst.at else ""
    instant = f"state {int(worst.instant)}" if worst.scenario == "statics" else f"t = {worst.instant:.3f} s"
    passed = all(figure.passed for figure in held)
    return {
        "value": _text(worst.value),
        "passed": passed,
        "title": f"{' and '.join(worst.voices)}: {where}{instant}; gate {worst.gate:.1e} ({worst.manner})",
    }


def _text(value: float) -> str:
    return "0" if value == 0.0 else f"{value:.1e}" if value < float("inf") else "none"


@dataclass(frozen=True, slots=True)
class Orders(Section):
    """Whether first-order engines converge as such."""

    agreement: Agreement
    title: ClassVar[str] = "First-order integrators"
    template: ClassVar[str] = "orders.html.j2"

    def values(self) -> dict[str, Any]:
        """Rows of observed orders."""
        rows = [
            {
                "scenario": SCENARIOS[order.scenario],
                "voice": order.voice,
                "against": order.against,
                "steps": f"{order.steps[0]!r}, {order.steps[1]!r}",
                "errors": f"{_text(order.errors[0])}, {_text(order.errors[1])}",
                "order": f"{order.order:.2f}",
                "judged": order.judged,
                "passed": order.passed,
            }
            for order in self.agreement.orders
        ]
        return {"rows": rows} if rows else {}


@dataclass(frozen=True, slots=True)
class Participants(Section):
    """Who ran, how, and at which step."""

    agreement: Agreement
    title: ClassVar[str] = "Who took part"
    template: ClassVar[str] = "participants.html.j2"

    def values(self) -> dict[str, Any]:
        """Voices with their steps."""
        answer = self.agreement
        runs = [run for run in answer.runs if run.steps]
        voices = [
            {
                "name": voice.name,
                "engine": f"{voice.engine} {voice.version}" if voice.engine else "the text itself, by matrix products",
                "integrator": voice.integrator or "none",
                "gate_class": voice.gate_class or "-",
                "steps": [f"{1e3 * run.steps[voice.name]:.3g}" if voice.name in run.steps else "-" for run in runs],
            }
            for voice in answer.voices
        ]
        return {
            "voices": voices,
            "runs": [(run.title, run.motion, run.duration) for run in runs],
            "knocking": [run.title for run in runs if run.knocks],
        }


@dataclass(frozen=True, slots=True)
class Pairs(Section):
    """Every comparison, for those who want all of them."""

    agreement: Agreement
    title: ClassVar[str] = "Every pair"
    template: ClassVar[str] = "pairs.html.j2"

    def values(self) -> dict[str, Any]:
        """All figures, those beyond their gates first."""
        rows = [
            {
                "scenario": "at rest" if figure.scenario == "statics" else SCENARIOS[figure.scenario],
                "signal": WORDS[figure.signal],
                "pair": " and ".join(figure.voices),
                "value": _text(figure.value),
                "gate": f"{figure.gate:.1e}",
                "manner": figure.manner,
                "at": figure.at,
                "instant": f"{int(figure.instant)}" if figure.scenario == "statics" else f"{figure.instant:.3f} s",
                "passed": figure.passed,
            }
            for figure in sorted(self.agreement.figures, key=lambda figure: figure.passed)
        ]
        return {"rows": rows} if rows else {}
