"""How closely all engines agree on every effect: the worst disagreement of each, against its gate.

    python benchmarks/effects.py [ROBOT] [SECONDS] [EFFECT ...]

Every effect alone with sample rows that suit the robot, then three random sets of eight (seeds 1, 2, 3); several names
joined by + are one set. A cell is what an engine is off from Pinocchio in the signal and run where it comes nearest to
its gate, over that gate; "refused" is counted at the end with its reason. What is compared: the runs in which all of
the set acts (friction: smooth and sticking, in a closed loop; what gives: imposed and in a loop; else rigid joints,
imposed and in a loop), then kinematics, dynamics, drives and sag at rest. The last column is of what nobody integrates:
all at rest, and rigid joints whose motion is imposed.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import mbexport
from mbexport.core.agreement import Agreement, Figure, agree
from mbexport.core.agreement.quantities import STATICS
from mbexport.core.agreement.samples import SAMPLED, acting_runs, sampled

REFERENCE, OTHERS = "urdf", ("mjcf", "exudyn", "pybullet")
ROBOT, DURATION, STATES = "planar2r", 0.5, 8
SEEDS, SET = (1, 2, 3), 8


def sets(wanted: list[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Title and effects of every line."""
    if wanted:
        return [(entry, tuple(entry.split("+"))) for entry in wanted]
    lines = [(name, (name,)) for name in SAMPLED]
    for seed in SEEDS:
        names = tuple(sorted(np.random.default_rng(seed).choice(SAMPLED, SET, replace=False).tolist()))
        lines.append((f"set {seed}", names))
    return lines


def worst(answer: Agreement, engine: str, *, integrated: bool) -> Figure | None:
    """The figure of an engine against the reference that is nearest to its gate, or farthest beyond."""
    own = [
        figure
        for figure in answer.figures
        if set(figure.voices) == {engine, REFERENCE}
        and integrated == (figure.scenario != "statics" and figure.manner != "algebra")
    ]
    return max(own, key=lambda figure: figure.value / figure.gate, default=None)


def cell(figure: Figure | None) -> str:
    if figure is None:
        return "refused"
    mark = "" if figure.passed else " FAILS"
    return f"{figure.value:.1e} / {figure.gate:.1e} {figure.signal}{mark}"


def main(robot: str = ROBOT, seconds: str = str(DURATION), *wanted: str) -> None:
    """Print the table."""
    database = mbexport.load(robot)
    begin = time.perf_counter()
    print(f"{robot}, runs of {seconds} s, {STATES} states; value / gate, signal\n")
    print("| effects | " + " | ".join(OTHERS) + " | not integrated, the worst of all |")
    print("|---" * (len(OTHERS) + 2) + "|")
    refusals: list[str] = []
    disagreed: list[str] = []
    for title, names in sets(list(wanted)):
        subject = sampled(database, names)
        quantities = (*STATICS, *acting_runs(mbexport.build(subject)))
        answer = agree(subject, (REFERENCE, *OTHERS), quantities=quantities, duration=float(seconds), states=STATES)
        figures = [worst(answer, engine, integrated=True) for engine in OTHERS]
        still = [figure for engine in OTHERS if (figure := worst(answer, engine, integrated=False))]
        figures.append(max(still, key=lambda figure: figure.value / figure.gate, default=None))
        print(f"| {title} | " + " | ".join(map(cell, figures)) + " |", flush=True)
        refusals += [
            f"{title}: {omission.voice} refuses {omission.scenario}: {omission.reason}"
            for omission in answer.left_out
            if omission.voice in (REFERENCE, *OTHERS)
        ]
        disagreed += [f"{title}: {sentence}" for sentence in answer.sentences if not answer.agreed]
    print()
    for title, names in sets(list(wanted)):
        if len(names) > 1:
            print(f"{title}: {', '.join(names)}")
    print(f"\n{len(refusals)} refusals" + "".join(f"\n- {line}" for line in refusals))
    print(f"{len(disagreed)} disagreements" + "".join(f"\n- {line}" for line in disagreed))
    print(f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
