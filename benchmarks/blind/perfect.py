"""What is left of cases once their truth is put in: noise, where the generator and the diagnosis know the same physics.

    python benchmarks/blind/perfect.py BANK/tune [--backend mjcf] [--only ID ...]

Two programs that share nothing but the tables reckon the same robot: what the generator recorded is held against the
diagnosis's own model of it, along the measured motion and simulated in an engine, with the effects that the sealed
truth states in the robot's tables. Cases with the catalogue's own laws alone; each is a line: the mean square of all
that is compared along the motion, in units of noise, the loudest channel there, and the loudest in simulation. Far
above 1 one of the two is wrong, or thinks its noise to be less than it is.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shrinkage import place_number

from mbexport.core.database import Database, load
from mbexport.core.diagnosis.compared import residuals
from mbexport.core.diagnosis.gap import loudest
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.resimulate import resimulated
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.errors import MbexportError
from mbexport.core.recording import Run, read_runs
from mbexport.core.recording.noise import known_together

LEVEL = "full"
Rows = dict[str, tuple[EffectRow, ...]]


@dataclass(frozen=True)
class Left:
    """What is left of a case, in units of noise.

    Attributes:
        along: Mean square of all that is compared along the motion.
        channel: Mean square of the loudest channel there.
        where: Which one that is.
        simulated: Mean square of the loudest channel in simulation; nan where an engine refuses the robot.
    """

    along: float
    channel: float
    where: str
    simulated: float


def scored(truth: dict) -> bool:
    """Whether the truth is effects of the catalogue, with its own laws, and nothing else."""
    outside = truth["case"]["class"] == "outside" or truth["numerical"]
    return not outside and all(stated["exact"] for stated in truth["stated"])


def rows_of(truth: dict) -> Rows:
    """Its effects as rows of the database's tables."""
    rows: dict[str, list[EffectRow]] = {}
    for stated in truth["stated"]:
        columns = effect_named(stated["effect"]).columns
        usual = {column.name: column.default for column in columns if column.default is not None}
        row = EffectRow(place_number(stated["at"]), {**usual, **stated["total"]})
        rows.setdefault(stated["effect"], []).append(row)
    return {effect: tuple(found) for effect, found in rows.items()}


def left_of(case: Path, truth: dict, backend: str) -> Left:
    """What is left of a case once its truth is put in."""
    database = load(case / "robot")
    runs = known_together(read_runs([case / "runs", case / "holdout"], database))
    rows = rows_of(truth)
    asked = problem(database, LEVEL, runs).heard(rows)
    left = whitening(asked)(asked.residual(rows))
    channels = asked.evidence.channels
    squares = [float(np.mean(left[one.first : one.last] ** 2)) for one in channels]
    worst = int(np.argmax(squares))
    where = f"{channels[worst].signal}_{channels[worst].index + 1}"
    return Left(float(np.mean(left**2)), squares[worst], where, simulated(database, runs, rows, backend))


def simulated(database: Database, runs: list[Run], rows: Rows, backend: str) -> float:
    """Mean square of the loudest channel of the robot simulated as it truly is."""
    robots = [(robot_of(database, LEVEL, run, rows), robot_of(database, LEVEL, run)) for run in runs]
    try:
        left = [
            residuals(run, resimulated(*pair, run, backend), pair[0]) for run, pair in zip(runs, robots, strict=True)
        ]
    except MbexportError:
        return float("nan")
    return loudest(left, [noise_floor(database, LEVEL, run) for run in runs])


def lines(bank: Path, backend: str, only: list[str]) -> Iterator[str]:
    """A line a case, and the middle of all."""
    found: list[Left] = []
    for case in sorted((bank / "cases").iterdir()):
        truth = json.loads((bank / "sealed" / f"{case.name}.json").read_text(encoding="utf-8"))
        if (only and case.name not in only) or not scored(truth):
            continue
        found.append(left := left_of(case, truth, backend))
        told = ", ".join(f"{one['effect']} {one['at']}" for one in truth["stated"]) or "nothing"
        yield (
            f"{case.name} {truth['robot']} {truth['control']['mode']}: {told}: along {left.along:.2f}, "
            f"most {left.channel:.2f} ({left.where}), simulated {left.simulated:.2f}"
        )
    for name in ("along", "channel", "simulated") if found else ():
        values = np.array([getattr(one, name) for one in found])
        low, middle, high = np.nanquantile(values, (0.05, 0.5, 0.95))
        yield f"{name}: {len(values)} cases, median {middle:.2f}, 90 % of them from {low:.2f} to {high:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bank", type=Path, help="BANK/<set>")
    parser.add_argument("--backend", default="mjcf")
    parser.add_argument("--only", nargs="*", default=[], metavar="ID")
    asked = parser.parse_args()
    for line in lines(asked.bank, asked.backend, asked.only):
        print(line, flush=True)


if __name__ == "__main__":
    main()
