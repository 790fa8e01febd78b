"""The page of a fleet: how the robots stand, what they have in common, and each with a link to its own page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..diagnosis.words import capitalised, cause_in_words, effect_in_words, listed, percent, place_in_words, quantity
from ..files import write_whole
from ..fleet import Fleet
from ..fleet.results import page_of
from .section import Section, page

PAGE_FILE = "report.html"
WORDS = {
    "no_gap": "no gap",
    "explained": "explained",
    "partly_explained": "partly explained",
    "unexplained": "unexplained",
    "failed": "not diagnosed",
}
_NAMED = 12


def write_fleet(fleet: Fleet, folder: Path) -> tuple[Path, ...]:
    """Write a fleet's tables and page into its folder, all or nothing."""
    # the folder is this fleet's by now, so that only its own tables can be in the way
    return write_whole(folder, {**fleet.files(), PAGE_FILE: fleet_page(fleet)}, force=True)


def fleet_page(fleet: Fleet) -> str:
    """The whole page as HTML."""
    count = len(fleet.results)
    sections = (FleetAnswer(fleet), FleetCommon(fleet), FleetCases(fleet))
    return page(f"{count} {'robot' if count == 1 else 'robots'} diagnosed", sections)


def _nothing(text: str) -> str:
    return text or "-"


@dataclass(frozen=True, slots=True)
class FleetAnswer(Section):
    """How many robots stand how."""

    fleet: Fleet
    template: ClassVar[str] = "fleet_answer.html.j2"

    def values(self) -> dict[str, Any]:
        """Verdicts, and the cause that comes up most."""
        count = len(self.fleet.results)
        verdicts = {WORDS[name]: number for name, number in self.fleet.verdicts().items() if number}
        common = self.fleet.common()
        most = ""
        if common and len(common[0].cases) > 1:
            what = capitalised(cause_in_words(common[0].effect, common[0].at))
            most = f"{what} comes up most often: in {len(common[0].cases)} of {count}."
        return {
            "count": count,
            "said": listed(f"{number} {name}" for name, number in verdicts.items()),
            "most": most,
            "verdicts": verdicts,
        }


@dataclass(frozen=True, slots=True)
class FleetCommon(Section):
    """Which causes come up, and how large they are."""

    fleet: Fleet
    title: ClassVar[str] = "What was found"
    template: ClassVar[str] = "fleet_common.html.j2"

    def values(self) -> dict[str, Any]:
        """A row a cause."""
        rows: list[dict[str, Any]] = []
        for one in self.fleet.common():
            sizes = [
                f"{name} {quantity(middle, unit)}"
                + (f" ({quantity(low, unit)} to {quantity(high, unit)})" if low != high else "")
                for name, (middle, low, high, unit) in one.medians.items()
            ]
            more = len(one.cases) - _NAMED
            rows.append(
                {
                    "effect": effect_in_words(one.effect),
                    "place": place_in_words(one.at),
                    "count": len(one.cases),
                    "sizes": "; ".join(sizes),
                    "cases": ", ".join(one.cases[:_NAMED]) + (f" and {more} more" if more > 0 else ""),
                }
            )
        return {"rows": rows} if rows else {}


@dataclass(frozen=True, slots=True)
class FleetCases(Section):
    """Every robot in a row."""

    fleet: Fleet
    title: ClassVar[str] = "Robot by robot"
    template: ClassVar[str] = "fleet_cases.html.j2"

    def values(self) -> dict[str, Any]:
        """Those with least explained first of all: they need a person."""
        order = {name: k for k, name in enumerate(("failed", "unexplained", "partly_explained", "explained", "no_gap"))}
        rows: list[dict[str, Any]] = []
        for one in sorted(self.fleet.results, key=lambda one: (order[one.verdict or "failed"], one.case)):
            causes = [
                cause_in_words(found.effect, found.at) + (" (or what looks like it)" if found.alike else "")
                for found in one.found
            ]
            rows.append(
                {
                    "case": one.case,
                    "page": "" if one.failed else page_of(one.case),
                    "robot": _nothing(one.robot),
                    "verdict": WORDS[one.verdict or "failed"],
                    "causes": _nothing(one.reason if one.failed else "; ".join(causes)),
                    "where": _nothing(
                        f"{place_in_words(one.joint[0])} ({percent(one.joint[1])})" if one.joint[0] else ""
                    ),
                    "shrinks": _nothing("" if one.shrinks_by is None else percent(one.shrinks_by[0])),
                    "open": _nothing("" if one.failed or one.verdict == "no_gap" else percent(one.unexplained)),
                }
            )
        return {"rows": rows}
