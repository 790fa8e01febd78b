"""The page of a diagnosis: the verdict in plain words, then what shows it, then what is open and what comes next."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ..diagnosis.as_json import MOTION_FILE
from ..diagnosis.diagnosis import Diagnosis
from ..diagnosis.words import (
    SIGNALS,
    capitalised,
    cause_in_words,
    effect_in_words,
    estimate,
    finding_in_words,
    how_far_in_words,
    left_out_in_words,
    listed,
    open_in_words,
    percent,
    place_in_words,
    quantity,
    rivals_in_words,
    unseen_runs,
    verdict_in_words,
    where_in_words,
)
from .diagnosis_pictures import (
    dependence_picture,
    gap_picture,
    motion_picture,
    scores_by_effect,
    waterfall_picture,
    where_picture,
)
from .pictures import Picture
from .section import Section, page

# effects below this share of the gap are named, not drawn
SHOWN = 0.005
_TONES = {"no_gap": "", "explained": "", "partly_explained": "partly", "unexplained": "no"}


def diagnosis_page(diagnosis: Diagnosis) -> str:
    """The whole page as HTML."""
    sections = (
        DiagnosisAnswer(diagnosis),
        DiagnosisGap(diagnosis),
        DiagnosisCause(diagnosis),
        DiagnosisHowFar(diagnosis),
        DiagnosisWhere(diagnosis),
        DiagnosisNext(diagnosis),
        DiagnosisRejected(diagnosis),
        DiagnosisData(diagnosis),
    )
    return page(f"{diagnosis.robot}: {verdict_in_words(diagnosis)}", sections)


def _there(*pictures: Picture | None) -> list[Picture]:
    return [made for made in pictures if made is not None]


@dataclass(frozen=True, slots=True)
class DiagnosisAnswer(Section):
    """The verdict: a sentence a finding, what it cannot be told from, how far the gap shrinks."""

    diagnosis: Diagnosis
    template: ClassVar[str] = "diagnosis_answer.html.j2"

    def values(self) -> dict[str, Any]:
        """Sentences."""
        answer = self.diagnosis
        findings = [
            {
                "what": capitalised(cause_in_words(found.effect, found.at)),
                "rest": finding_in_words(found).partition(cause_in_words(found.effect, found.at)[1:])[2],
                "rivals": rivals_in_words(found.indistinguishable_from),
            }
            for found in answer.which
        ]
        return {
            "robot": answer.robot,
            "tone": _TONES[answer.verdict],
            "verdict": verdict_in_words(answer),
            "no_gap": answer.verdict == "no_gap",
            "where": where_in_words(answer),
            "findings": findings,
            "how_far": how_far_in_words(answer),
            "open": open_in_words(answer),
            "facts": self._facts(),
        }

    def _facts(self) -> list[tuple[str, str]]:
        answer = self.diagnosis
        facts = [("runs", str(len(answer.runs)))]
        if answer.holdout:
            facts.append(("held out", str(len(answer.holdout))))
        if answer.which:
            facts.append(("judged on", unseen_runs(answer)))
        return facts


@dataclass(frozen=True, slots=True)
class DiagnosisGap(Section):
    """The gap before and after, drawn and in numbers."""

    diagnosis: Diagnosis
    template: ClassVar[str] = "diagnosis_gap.html.j2"

    def values(self) -> dict[str, Any]:
        """The picture and a row a signal."""
        answer = self.diagnosis
        found, where = answer.how_far, answer.where.signals
        judged = bool(answer.which) and bool(found.before)
        rows: list[dict[str, Any]] = []
        for signal, gap in where.items():
            if judged and signal not in found.before:
                continue
            shrinks = found.signals.get(signal)
            rows.append(
                {
                    "signal": capitalised(SIGNALS.get(signal, signal)),
                    "before": quantity(found.before[signal] if judged else gap.rms, gap.unit),
                    "after": quantity(found.after[signal], gap.unit) if judged and signal in found.after else "",
                    "noise": quantity(found.noise.get(signal, gap.noise) if judged else gap.noise, gap.unit),
                    "shrinks": "not significant" if shrinks is None else percent(shrinks),
                }
            )
        return {
            "heading": "The gap, before and after" if judged else "Measured against simulated",
            "pictures": _there(gap_picture(answer)),
            "rows": rows,
            "judged": judged,
            "unseen": unseen_runs(answer),
        }


@dataclass(frozen=True, slots=True)
class DiagnosisCause(Section):
    """Why these effects: what the gap goes with, and how every effect did at every place."""

    diagnosis: Diagnosis
    template: ClassVar[str] = "diagnosis_cause.html.j2"

    def values(self) -> dict[str, Any]:
        """The picture, and the map as a table."""
        answer = self.diagnosis
        pictures, scores = _there(dependence_picture(answer)), scores_by_effect(answer)
        if answer.verdict == "no_gap" or not (pictures or scores):
            return {}
        found = {(finding.effect, finding.at) for finding in answer.which}
        named = {finding.effect for finding in answer.which}
        shown = {
            name: places
            for name, places in scores.items()
            if name in named or max(share for share, _ in places.values()) >= SHOWN
        }
        numbers = sorted({_number(at) for places in shown.values() for at in places if at != "robot"})
        alike = {(rival.effect, rival.at) for finding in answer.which for rival in finding.indistinguishable_from}
        rows: list[dict[str, Any]] = []
        for name, places in shown.items():
            by_number = {_number(at): at for at in places if at != "robot"}
            cells = [_cell(name, by_number.get(k), places, found, alike) for k in numbers]
            whole = _cell(name, "robot" if "robot" in places else None, places, found, alike)
            rows.append({"name": capitalised(effect_in_words(name)), "cells": cells, "whole": whole})
        little = [effect_in_words(name) for name in scores if name not in shown]
        return {
            "heading": "Why" if answer.which else "What it goes with, and what was tried",
            "pictures": pictures,
            "numbers": numbers,
            "with_whole": any("robot" in places for places in shown.values()),
            "rows": rows,
            "little": listed(sorted(little)),
            "alike": bool(alike & {(score.effect, score.at) for score in answer.scores}),
            "found": bool(found),
        }


def _number(at: str) -> int:
    match = re.search(r"\d+", at)
    return int(match[0]) if match else 0


def _cell(
    effect: str,
    at: str | None,
    places: dict[str, tuple[float, float]],
    found: set[tuple[str, str]],
    alike: set[tuple[str, str]],
) -> dict[str, Any] | None:
    """A cell of the map; None where the effect was not looked at there."""
    if at is None:
        return None
    share, probability = places[at]
    mark = "found" if (effect, at) in found else "alike" if (effect, at) in alike else ""
    return {
        "share": f"{100.0 * share:.0f}" if share >= SHOWN or mark == "found" else "",
        # the deeper, the more it explains; text stays readable on all of them
        "shade": f"{min(max(share, 0.0), 1.0) * 0.55:.2f}",
        "mark": mark,
        "title": f"{cause_in_words(effect, at)}: takes {percent(max(share, 0.0))} of the gap's energy by itself; "
        f"probability {percent(probability)}",
    }


@dataclass(frozen=True, slots=True)
class DiagnosisHowFar(Section):
    """How far the gap shrinks: by effect, in every engine, and with each effect taken out again."""

    diagnosis: Diagnosis
    title: ClassVar[str] = "How far the gap shrinks"
    template: ClassVar[str] = "diagnosis_how_far.html.j2"

    def values(self) -> dict[str, Any]:
        """The waterfall, the engines, the edit test, and every parameter."""
        answer, how_far = self.diagnosis, self.diagnosis.how_far
        if not answer.which:
            return {}
        engines = [(name, _bar(share)) for name, share in how_far.backends.items() if share is not None]
        refused = sorted(how_far.refused.items())
        refused += [(n, "no figure") for n, s in how_far.backends.items() if s is None and n not in how_far.refused]
        without = [
            (cause_in_words(*name.split(" ", 1)), _bar(share))
            for name, share in how_far.without.items()
            if share is not None and " " in name
        ]
        parameters = [
            (capitalised(cause_in_words(found.effect, found.at)), name, *estimate(parameter))
            for found in answer.which
            for name, parameter in found.parameters.items()
        ]
        return {
            "pictures": _there(waterfall_picture(answer)),
            "engines": engines,
            "refused": refused,
            "without": without,
            "total": _bar(how_far.shrinks_by) if how_far.shrinks_by is not None else None,
            "parameters": parameters,
            "level": answer.level,
        }


def _bar(share: float) -> dict[str, str]:
    """A share as a text and the length of its bar."""
    return {"text": percent(share), "length": f"{100.0 * min(max(share, 0.0), 1.0):.1f}"}


@dataclass(frozen=True, slots=True)
class DiagnosisWhere(Section):
    """Where the gap lies."""

    diagnosis: Diagnosis
    title: ClassVar[str] = "Where the gap lies"
    template: ClassVar[str] = "diagnosis_where.html.j2"

    def values(self) -> dict[str, Any]:
        """Bars, and what is left at which joint."""
        answer = self.diagnosis
        pictures = _there(where_picture(answer))
        if not pictures:
            return {}
        left = sorted(answer.unexplained.joints.items(), key=lambda item: -item[1])
        return {
            "pictures": pictures,
            "share": percent(answer.unexplained.share),
            "looks": answer.unexplained.looks_like.strip().rstrip("."),
            "left": [(capitalised(place_in_words(name)), _bar(share)) for name, share in left if share >= SHOWN],
            "open": answer.verdict != "no_gap" and answer.unexplained.share > 0.0,
            "found": bool(answer.which),
        }


@dataclass(frozen=True, slots=True)
class DiagnosisNext(Section):
    """The experiment that would say more."""

    diagnosis: Diagnosis
    title: ClassVar[str] = "The next experiment"
    template: ClassVar[str] = "diagnosis_next.html.j2"

    def values(self) -> dict[str, Any]:
        """Why, and its picture."""
        following = self.diagnosis.next_experiment
        if following is None:
            return {}
        return {
            "why": capitalised(following.why.strip().rstrip(".")),
            "file": MOTION_FILE,
            "pictures": _there(motion_picture(self.diagnosis)),
        }


@dataclass(frozen=True, slots=True)
class DiagnosisRejected(Section):
    """What was looked at and does not stand."""

    diagnosis: Diagnosis
    title: ClassVar[str] = "Looked at and rejected"
    template: ClassVar[str] = "diagnosis_rejected.html.j2"

    def values(self) -> dict[str, Any]:
        """Reason, then effect, then its places."""
        reasons: dict[str, dict[str, list[str]]] = {}
        for item in self.diagnosis.rejected:
            reasons.setdefault(item.why.strip().rstrip("."), {}).setdefault(item.effect, []).append(item.at)
        groups = [
            (
                capitalised(why),
                sum(len(places) for places in effects.values()),
                [(capitalised(effect_in_words(effect)), _places(places)) for effect, places in sorted(effects.items())],
            )
            for why, effects in reasons.items()
        ]
        return {"groups": groups, "count": len(self.diagnosis.rejected)} if groups else {}


def _places(places: Sequence[str]) -> str:
    """joint_1, joint_2, joint_3 as joints 1, 2, 3."""
    if any(at == "robot" for at in places):
        return "whole robot"
    kinds: dict[str, list[int]] = {}
    for at in places:
        kinds.setdefault(at.partition("_")[0], []).append(_number(at))
    return "; ".join(
        f"{kind}{'s' if len(numbers) > 1 else ''} {', '.join(str(k) for k in sorted(numbers))}"
        for kind, numbers in kinds.items()
    )


@dataclass(frozen=True, slots=True)
class DiagnosisData(Section):
    """The runs, what of them was left out, and what a reader should know."""

    diagnosis: Diagnosis
    title: ClassVar[str] = "The data"
    template: ClassVar[str] = "diagnosis_data.html.j2"

    def values(self) -> dict[str, Any]:
        """Runs, bad samples, notes."""
        answer = self.diagnosis
        return {
            "runs": answer.runs,
            "holdout": answer.holdout,
            "sentence": left_out_in_words(answer),
            "left_out": [(item.run, item.channel, item.reason, item.message) for item in answer.left_out],
            "notes": answer.notes,
        }
