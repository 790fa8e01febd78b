"""Measures what a communication step costs the paper's arm: the picture and the numbers of docs/cosimulation.md.

    python docs/make_cosimulation.py

It takes some minutes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mbexport.core.build import build
from mbexport.core.control import default_pd
from mbexport.core.cosimulation import (
    ContinuousController,
    Coupling,
    CouplingStudy,
    Measured,
    loop_of,
    measure,
    run_coupled,
)
from mbexport.core.cosimulation.study import kind_named
from mbexport.core.database import load
from mbexport.core.motion import motion_named
from mbexport.core.report.cosimulation_pictures import cosimulation_png
from mbexport.core.simulation import backend_named

DOCS = Path(__file__).resolve().parent
PICTURE = DOCS / "pictures" / "cosimulation.png"
PAGE = DOCS / "cosimulation.md"
REGION = re.compile(r"(<!-- measured: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
DURATION = 1.0
ENGINES = ("urdf", "mjcf", "exudyn", "pybullet")


def study_of_the_paper() -> CouplingStudy:
    """The paper's compliant arm on the Greek key, in MuJoCo."""
    robot = build(load("imece2013"), "compliant")
    motion = motion_named(robot, "greca")
    controller = ContinuousController.of(robot, default_pd(robot, feedforward="gravity"), motion)
    return measure(loop_of(robot, controller, DURATION), backend_named("mjcf"), memory=True)


def row(cells: list[str]) -> str:
    """A line of a table in Markdown."""
    return "| " + " | ".join(cells) + " |\n"


def couplings(study: CouplingStudy) -> Iterator[str]:
    """A line a coupling: errors, order from the step before, how early, and how high the largest deviation is."""
    yield row(["between the points", "step [ms]", "error, largest [mm]", "order", "tip earlier [ms]", "deviation"])
    yield row(["---"] * 6)
    before: Measured | None = None
    for one in study.measured:
        same = before is not None and before.stable and (one.order, one.memory) == (before.order, before.memory)
        order = (
            np.log(before.largest / one.largest) / np.log(before.interval / one.interval) if before and same else 0.0
        )
        cells = [
            f"{1e3 * one.largest:.2g}",
            f"{order:.2f}" if same else "",
            f"{1e3 * one.earlier:.3g}",
            f"{one.peak:.3f}",
        ]
        yield row(
            [
                kind_named(one.order, one.memory),
                f"{1e3 * one.interval:.4g}",
                *(cells if one.stable else ["unstable", "", "", ""]),
            ]
        )
        before = one


def engines(study: CouplingStudy) -> Iterator[str]:
    """A line an engine: one coupling in each, against the same reference."""
    coupling = Coupling(1.0e-3, 1)
    reference = study.reference
    every = round(coupling.interval / float(reference.t[1]))
    yield row(["engine", "largest step [ms]", "error, largest [mm]"])
    yield row(["---"] * 3)
    for name in ENGINES:
        backend = backend_named(name)
        run = run_coupled(study.loop, coupling, backend)
        error = np.linalg.norm(run.tip - reference.tip[::every], axis=1).max()
        yield row([backend.engine, f"{1e3 * run.step:.4g}", f"{1e3 * error:.3g}"])


def main() -> None:
    """Measure, draw, and write the page's numbers."""
    study = study_of_the_paper()
    PICTURE.write_bytes(cosimulation_png(study))
    found = {"couplings": "".join(couplings(study)), "engines": "".join(engines(study))}
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(REGION.sub(lambda match: f"{match[1]}\n{found[match[2]]}\n{match[3]}", text), encoding="utf-8")


if __name__ == "__main__":
    main()
