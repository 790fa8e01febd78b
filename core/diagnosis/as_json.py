"""diagnosis.json, key by key as the contract has it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from .diagnosis import SCHEMA, Diagnosis

MOTION_FILE = "motions/next.dat"


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """The contract's mapping, ready for json.dumps."""
    where, how_far, rest = diagnosis.where, diagnosis.how_far, diagnosis.unexplained
    following = diagnosis.next_experiment
    backends: dict[str, Any] = dict(how_far.backends)
    return {
        "schema": SCHEMA,
        "robot": diagnosis.robot,
        "verdict": diagnosis.verdict,
        "where": {
            "signals": {name: asdict(gap) for name, gap in where.signals.items()},
            "joints": {name: asdict(share) for name, share in where.joints.items()},
            "when": [asdict(phase) for phase in where.when],
            "bands": [asdict(band) for band in where.bands],
            "depends_on": [asdict(variable) for variable in where.depends_on],
        },
        "which": [asdict(finding) for finding in diagnosis.which],
        "rejected": [asdict(item) for item in diagnosis.rejected],
        "how_far": {
            "holdout": {
                "runs": list(diagnosis.holdout),
                "before": dict(how_far.before),
                "after": dict(how_far.after),
                "noise": dict(how_far.noise),
                "floor": dict(how_far.floor),
                "shrinks_by": how_far.shrinks_by,
                "ci95": how_far.ci95,
                "signals": dict(how_far.signals),
            },
            "by_effect": [asdict(share) for share in how_far.by_effect],
            "backends": backends | dict.fromkeys(how_far.refused),
            "refused": dict(how_far.refused),
            "without": dict(how_far.without),
        },
        "unexplained": asdict(rest),
        "next_experiment": None if following is None else {"why": following.why, "motion": MOTION_FILE},
        "data": {
            "level": diagnosis.level,
            "runs": list(diagnosis.runs),
            "left_out": [asdict(item) for item in diagnosis.left_out],
            "notes": list(diagnosis.notes),
        },
    }
