"""What came of comparing engines: who agreed with whom in what, how closely, and who is wrong in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from .compare import Figure, Order
from .convergence import Convergence
from .culprit import TABLES, Evidence, Finding
from .gates import GATES

SCHEMA = "mbexport-agreement/1"


@dataclass(frozen=True, slots=True)
class Voice:
    """Who took part.

    Attributes:
        name: Backend's name, or "tables".
        label: In sentences.
        engine, version, integrator: Of a backend; "" for the tables.
        order: Of convergence; 0 where nothing is integrated.
        gate_class: "A", "B", or "" where nothing is integrated.
    """

    name: str
    label: str
    engine: str = ""
    version: str = ""
    integrator: str = ""
    order: int = 0
    gate_class: str = ""


@dataclass(frozen=True, slots=True)
class Omission:
    """What did not take part, and why.

    Attributes:
        voice: Who.
        scenario: In which run; "everything" where nowhere.
        reason: Why.
    """

    voice: str
    scenario: str
    reason: str


@dataclass(frozen=True, slots=True)
class RunFacts:
    """How one scenario was run.

    Attributes:
        scenario: Its name.
        title: In words.
        motion: Name of the command.
        duration: [s].
        steps: Voice to its integration step [s].
        knocks: Voices for which play opens and closes in it.
    """

    scenario: str
    title: str
    motion: str
    duration: float
    steps: Mapping[str, float]
    knocks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Agreement:
    """The answer, with all that it rests on.

    Attributes:
        robot, level, effects, source_hash, notes: What was compared.
        reach: Of the robot [m].
        voices: Who took part, the tables first where they speak.
        left_out: Who or what did not.
        runs: How the scenarios were run.
        figures: Every pair in every quantity.
        orders: Observed orders of first-order integrators.
        findings: A sentence for every disagreement.
        convergence: Errors against steps, where that was asked for.
        evidence: All numbers behind it, for pictures; not compared and not in the JSON.
    """

    robot: str
    level: str
    effects: tuple[str, ...]
    source_hash: str
    notes: tuple[str, ...]
    reach: float
    voices: tuple[Voice, ...]
    left_out: tuple[Omission, ...]
    runs: tuple[RunFacts, ...]
    figures: tuple[Figure, ...]
    orders: tuple[Order, ...]
    findings: tuple[Finding, ...]
    convergence: Convergence | None
    evidence: Evidence = field(compare=False, repr=False)

    @property
    def agreed(self) -> bool:
        """Something was compared, every figure is within its gate, every order is right, every export could be run."""
        passed = all(figure.passed for figure in self.figures) and all(order.passed for order in self.orders)
        return bool(self.figures) and passed and not self.findings

    @property
    def sentences(self) -> tuple[str, ...]:
        """The findings in words; where there are none, that all agree and how closely."""
        if not self.figures and not self.findings:
            return ("Nothing could be compared: fewer than two voices took part.",)
        if not self.agreed:
            return tuple(finding.sentence for finding in self.findings)
        engines = sum(voice.name != TABLES for voice in self.voices)
        worst = max(self.figures, key=lambda figure: figure.value / figure.gate)
        share = 100.0 * worst.value / worst.gate
        tables = " and the text of its tables" if engines < len(self.voices) else ""
        return (
            f"{_counted(engines)}{tables} agree on {self.robot} at level {self.level} in all "
            f"{len(self.figures)} comparisons; the one nearest to its gate takes {share:.2g} % of it.",
        )

    def worst(self) -> tuple[Figure, ...]:
        """The figure nearest to (or farthest beyond) its gate of every signal of every scenario."""
        found: dict[tuple[str, str], Figure] = {}
        for figure in self.figures:
            key = (figure.scenario, figure.signal)
            if key not in found or figure.value * found[key].gate > found[key].value * figure.gate:
                found[key] = figure
        return tuple(found.values())

    def to_json(self) -> dict[str, Any]:
        """Plain data for agreement.json; numbers that are not finite are null."""
        return {
            "schema": SCHEMA,
            "agreed": self.agreed,
            "sentences": list(self.sentences),
            "robot": self.robot,
            "level": self.level,
            "effects": list(self.effects),
            "source_hash": self.source_hash,
            "notes": list(self.notes),
            "reach": self.reach,
            "voices": [asdict(voice) for voice in self.voices],
            "left_out": [asdict(omission) for omission in self.left_out],
            "runs": [{**asdict(run), "steps": dict(run.steps), "knocks": list(run.knocks)} for run in self.runs],
            "findings": [{**asdict(finding), "voices": list(finding.voices)} for finding in self.findings],
            "figures": [
                {**_finite(asdict(figure)), "voices": list(figure.voices), "passed": figure.passed}
                for figure in self.figures
            ],
            "orders": [
                {
                    **_finite(asdict(order)),
                    "steps": list(order.steps),
                    "errors": [_number(error) for error in order.errors],
                    "passed": order.passed,
                }
                for order in self.orders
            ],
            "convergence": asdict(self.convergence) if self.convergence else None,
            "gates": [asdict(gate) for gate in GATES.values()],
        }


def _counted(engines: int) -> str:
    return f"All {engines} engines" if engines > 1 else "One engine"


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _finite(data: dict[str, Any]) -> dict[str, Any]:
    return {key: _number(value) if isinstance(value, float) else value for key, value in data.items()}
