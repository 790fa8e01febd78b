"""What every rival is given of a case: its runs, the known model as MJCF, and the noise that it is judged against."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mbexport
from mbexport.core.database import Database, FrozenMap
from mbexport.core.diagnosis.model import robot_of
from mbexport.core.diagnosis.noise import noise_floor
from mbexport.core.diagnosis.prepare import Prepared, prepared
from mbexport.core.effects import EffectRow
from mbexport.core.recording import Run, noise_of
from mbexport.core.representation import Robot

Vector = NDArray[np.float64]
Rows = dict[str, tuple[EffectRow, ...]]

LEVEL = "full"
COLUMNS = {
    "rotor_inertia": "inertia",
    "viscous_friction": "coefficient",
    "coulomb_friction": "torque",
    "torque_offset": "torque",
}


@dataclass(frozen=True, slots=True)
class Given:
    """A case as its rivals see it.

    Attributes:
        database: The robot as it is known.
        runs, holdout: As mbexport reads them; no fit sees the second.
        mjcf: The nominal robot with what the logs say hangs there, as mbexport emits it.
        robot: The same robot, for the feedforward.
        motions: Of the runs: smoothed motion and torque on a uniform grid.
    """

    database: Database
    runs: tuple[Run, ...]
    holdout: tuple[Run, ...]
    mjcf: str
    robot: Robot
    motions: tuple[Prepared, ...]

    @property
    def n(self) -> int:
        return self.runs[0].n

    def sigma(self, signal: str) -> Vector:
        """Noise floor of a signal, tolerances and the sensor's way through the controller in it, (n,) [its unit]."""
        each = []
        for run in self.runs:
            floor = noise_floor(self.database, LEVEL, run).sigma
            each.append(floor[signal] if signal in floor else noise_of(run, signal).sigma)
        return np.sqrt(np.mean(np.square(each), axis=0))


def given(case: Path) -> Given | None:
    """A case folder, read; None where it has no motor torque."""
    database = mbexport.load(case / "robot")
    runs, holdout = (runs_of(case / name, database) for name in ("runs", "holdout"))
    if not all(run.has("tau") for run in (*runs, *holdout)):
        return None
    return known(database, runs, holdout)


def known(database: Database, runs: tuple[Run, ...], holdout: tuple[Run, ...]) -> Given:
    """Recorded runs of a robot, with all that is known of it."""
    robot = robot_of(database, LEVEL, runs[0])
    with tempfile.TemporaryDirectory() as folder:
        mbexport.export(robot, ["mjcf"], folder)
        (path,) = Path(folder).rglob("*.xml")
        text = path.read_text(encoding="utf-8")
    return Given(database, runs, holdout, text, robot, tuple(prepared(run) for run in runs))


def runs_of(folder: Path, database: Database) -> tuple[Run, ...]:
    from mbexport.core.recording import read_runs

    return read_runs(sorted(folder.iterdir()), database)


@dataclass(frozen=True, slots=True)
class Number:
    """A number that a rival fitted.

    Attributes:
        effect: What the catalogue calls it.
        joint: From 1.
        nominal, value: What the database says, and what the rival does.
        half: Half of the rival's own 95 % interval.
        shows: Torque that the difference makes along the runs, root mean square, in units of the joint's noise floor.
    """

    effect: str
    joint: int
    nominal: float
    value: float
    half: float
    shows: float

    @property
    def named(self) -> bool:
        """Whether it is called a cause: off nominal by the rival's own interval, by more than noise and tolerances."""
        return abs(self.value - self.nominal) > self.half and self.shows > 1.0

    def finding(self) -> dict:
        """As diagnosis.json has it; the rivals know no probability."""
        interval = [self.value - self.half, self.value + self.half]
        return {
            "effect": self.effect,
            "at": f"joint_{self.joint}",
            "probability": None,
            "parameters": {COLUMNS[self.effect]: {"value": self.value, "ci95": interval}},
            "indistinguishable_from": [],
        }


def rows_of(numbers: Sequence[Number]) -> Rows:
    """What a rival names, as rows of a database; the rest stays as it was."""
    rows: dict[str, list[EffectRow]] = {}
    for number in numbers:
        if number.named:
            row = EffectRow(number.joint, FrozenMap({COLUMNS[number.effect]: number.value}))
            rows.setdefault(number.effect, []).append(row)
    return {effect: tuple(parts) for effect, parts in rows.items()}
