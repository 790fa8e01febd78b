"""What a fleet's diagnoses say together: a row a case, a row a finding, and which causes come up how often."""

from __future__ import annotations

import csv
import io
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..diagnosis.written import JSON_FILE, PAGE_FILE
from .cases import Case
from .run import RECORD, read_json

CASES_FILE, FINDINGS_FILE = "cases.csv", "findings.csv"
VERDICTS = ("no_gap", "explained", "partly_explained", "unexplained")
_CASE = (
    "case", "robot", "verdict", "findings", "joint", "joint_share", "shrinks_by", "ci_low", "ci_high",
    "unexplained_share", "next_experiment", "failed", "reason",
)  # fmt: skip
_FINDING = ("case", "effect", "at", "probability", "parameter", "value", "low", "high", "unit", "may_as_well_be")


@dataclass(frozen=True, slots=True)
class Found:
    """A finding of one case.

    Attributes:
        effect, at: As diagnosis.json has them.
        probability: Of it.
        parameters: Name -> value, lower and upper end of its 95 % interval, unit.
        alike: Other names, "effect at".
    """

    effect: str
    at: str
    probability: float
    parameters: dict[str, tuple[float, float, float, str]]
    alike: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Result:
    """One case of a fleet.

    Attributes:
        case: Its name.
        robot: Its database's name; "" where it failed.
        verdict: As diagnosis.json has it; "" where it failed.
        found: The findings.
        joint: Where most of the gap is, "" for nowhere; with its share.
        shrinks_by: How far the gap shrinks on runs that no fit saw, with its interval; None where it cannot be said.
        unexplained: Share of the gap that nothing explains.
        next_experiment: What the next experiment is for; "" for none.
        failed, reason: "" where there is a diagnosis.
    """

    case: str
    robot: str = ""
    verdict: str = ""
    found: tuple[Found, ...] = ()
    joint: tuple[str, float] = ("", 0.0)
    shrinks_by: tuple[float, float, float] | None = None
    unexplained: float = 0.0
    next_experiment: str = ""
    failed: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Common:
    """A cause that came up.

    Attributes:
        effect, at: What and where.
        cases: In which.
        medians: Parameter -> its median over these, least, largest, unit.
    """

    effect: str
    at: str
    cases: tuple[str, ...]
    medians: dict[str, tuple[float, float, float, str]]


@dataclass(frozen=True, slots=True)
class Fleet:
    """All cases, in the order of their names."""

    results: tuple[Result, ...]

    def verdicts(self) -> dict[str, int]:
        """How many cases have which verdict, failed ones beside them."""
        counts = {verdict: sum(one.verdict == verdict for one in self.results) for verdict in VERDICTS}
        return counts | {"failed": sum(bool(one.failed) for one in self.results)}

    def common(self) -> tuple[Common, ...]:
        """Every cause that was found, the most frequent first."""
        groups: dict[tuple[str, str], list[tuple[str, Found]]] = {}
        for one in self.results:
            for found in one.found:
                groups.setdefault((found.effect, found.at), []).append((one.case, found))
        out: list[Common] = []
        for (effect, at), members in groups.items():
            medians: dict[str, tuple[float, float, float, str]] = {}
            for name, (_, _, _, unit) in members[0][1].parameters.items():
                values = [found.parameters[name][0] for _, found in members if name in found.parameters]
                medians[name] = (statistics.median(values), min(values), max(values), unit)
            out.append(Common(effect, at, tuple(case for case, _ in members), medians))
        return tuple(sorted(out, key=lambda one: (-len(one.cases), one.effect, one.at)))

    def summary(self) -> dict[str, Any]:
        """The whole for machines."""
        return {
            "schema": "mbexport-fleet-summary/1",
            "cases": len(self.results),
            "verdicts": self.verdicts(),
            "causes": [
                {
                    "effect": one.effect,
                    "at": one.at,
                    "cases": list(one.cases),
                    "parameters": {
                        name: {"median": middle, "least": low, "largest": high, "unit": unit}
                        for name, (middle, low, high, unit) in one.medians.items()
                    },
                }
                for one in self.common()
            ],
            "failed": [
                {"case": one.case, "failed": one.failed, "reason": one.reason} for one in self.results if one.failed
            ],
        }

    def files(self) -> dict[str, str]:
        """The two tables, for spreadsheets: numbers with all digits."""
        cases = [
            (
                one.case,
                one.robot,
                one.verdict,
                "; ".join(f"{found.effect} {found.at}" for found in one.found),
                *((one.joint[0], repr(one.joint[1])) if one.joint[0] else ("", "")),
                *(("", "", "") if one.shrinks_by is None else map(repr, one.shrinks_by)),
                "" if one.failed else repr(one.unexplained),
                one.next_experiment,
                one.failed,
                one.reason,
            )
            for one in self.results
        ]
        findings = [
            (
                one.case,
                found.effect,
                found.at,
                repr(found.probability),
                name,
                *map(repr, values),
                unit,
                "; ".join(found.alike),
            )
            for one in self.results
            for found in one.found
            for name, (*values, unit) in found.parameters.items()
        ]
        return {CASES_FILE: _table(_CASE, cases), FINDINGS_FILE: _table(_FINDING, findings)}


def fleet_of(cases: Sequence[Case], folder: Path) -> Fleet:
    """What the diagnoses in a fleet's folder say.

    Args:
        cases: Which.
        folder: As `run_fleet` filled it.
    """
    return Fleet(tuple(_result(case.name, folder / case.name) for case in cases))


def page_of(case: str) -> str:
    """A case's own page, relative to the fleet's."""
    return f"{case}/{PAGE_FILE}"


def _result(case: str, folder: Path) -> Result:
    record = read_json(folder / RECORD)
    said = read_json(folder / JSON_FILE)
    if record.get("failed") or not said or not record:
        return Result(
            case,
            failed=str(record.get("failed") or "missing"),
            reason=str(record.get("reason") or "it was not diagnosed."),
        )
    shares = {name: float(share["share"]) for name, share in said["where"]["joints"].items()}
    most = max(sorted(shares), key=lambda name: shares[name], default="")
    holdout = said["how_far"]["holdout"]
    by, ends = holdout["shrinks_by"], holdout["ci95"]
    following = said["next_experiment"]
    return Result(
        case,
        robot=said["robot"],
        verdict=said["verdict"],
        found=tuple(_found(item) for item in said["which"]),
        # where there is no gap, shares are those of noise
        joint=(most, shares[most]) if most and shares[most] > 0.0 and said["verdict"] != "no_gap" else ("", 0.0),
        shrinks_by=None if by is None or ends is None else (by, ends[0], ends[1]),
        unexplained=float(said["unexplained"]["share"]),
        next_experiment="" if following is None else following["why"],
    )


def _found(item: dict[str, Any]) -> Found:
    parameters = {
        name: (float(one["value"]), float(one["ci95"][0]), float(one["ci95"][1]), str(one["unit"]))
        for name, one in item["parameters"].items()
    }
    alike = tuple(f"{one['effect']} {one['at']}" for one in item["indistinguishable_from"])
    return Found(item["effect"], item["at"], float(item["probability"]), parameters, alike)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
