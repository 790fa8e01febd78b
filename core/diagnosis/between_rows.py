"""What happens between the rows of a record, as a simulation knows it: no model is blamed for what no row shows.

A command that jumps, or whose speed does, makes torques jump from one tick to the next. Rows a few milliseconds apart
show neither when nor what followed at once, and inverse dynamics along them leave much of a perfect model. They leave
the same of that model's own simulation under the same command, recorded at the same rows: that is taken off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..database import Database
from ..errors import MbexportError
from ..recording import Run
from ..simulation import Backend
from .evidence import Between, Evidence, Voice, coefficients, differences
from .model import Rows, robot_of
from .polish import STIFFER
from .prepare import Prepared, prepared
from .resimulate import each_simulated, resimulated, steps_of
from .starting_side import rattles

Vector = NDArray[np.float64]

# mean square of a channel in units of noise that is felt, and that hides causes
FELT, HIDES = 0.01, 1.0


def between_rows(
    database: Database, level: str, runs: Sequence[Run], evidence: Evidence, rows: Rows, backend: Backend | str
) -> Evidence:
    """The evidence less what happens between rows; itself where that is as it was, or nothing that is felt.

    Only simulations under a controller tell it: others are begun anew on the way, or move as was measured.

    Args:
        database: The robot as its database knows it.
        level: Which of the database's own effects count.
        runs: What was measured, as the evidence has them.
        evidence: Of these runs.
        rows: What was found by now.
        backend: Which engine.
    """

    def one(number: int) -> Between:
        return _of_a_run(database, level, runs[number], evidence, number, rows, backend)

    numbers = range(len(runs))
    found = each_simulated(one, numbers, backend)
    if not any(_felt(evidence, k, evidence.between_of(k), found[k]) > FELT for k in numbers):
        return evidence
    return replace(
        evidence, between=tuple(one if _felt(evidence, k, {}, one) > FELT else {} for k, one in enumerate(found))
    )


def hides(evidence: Evidence) -> bool:
    """Whether so much happens between rows that it hides causes, until it is known as the robot with these has it."""
    return any(_felt(evidence, k, {}, one) > HIDES for k, one in enumerate(evidence.between))


def _of_a_run(
    database: Database, level: str, run: Run, evidence: Evidence, number: int, rows: Rows, backend: Backend | str
) -> Between:
    robot, nominal = robot_of(database, level, run, rows), robot_of(database, level, run)
    if run.control.mode != "pd" or run.locked:
        return {}
    known = evidence.between_of(number)
    # where an arm flies in its play no simulation knows when it hits
    if rattles(robot):
        return known
    try:
        # and what is far stiffer than the robot as it is known hardly moves otherwise
        if robot != nominal and steps_of(robot, run, backend) > STIFFER * steps_of(nominal, run, backend):
            return known
        simulated = resimulated(robot, nominal, run, backend)
    except MbexportError:
        return known
    ready, creep = evidence.runs[number], evidence.creeps[number]
    own = prepared(run, ready.band, _instead(ready, simulated))
    left = differences(own, Voice(robot, evidence.nominals[number], creep).says(own))
    found = coefficients(ready, left, evidence.masks[number])
    return found if all(np.isfinite(column).all() for columns in found.values() for column in columns) else {}


def _instead(ready: Prepared, simulated: Mapping[str, Vector]) -> dict[str, Vector]:
    """What makes of a run's signals those of its simulation."""
    rotation: Any = import_module("scipy.spatial.transform").Rotation

    run = ready.run
    more = {name: values - run.signals[name] for name, values in simulated.items() if name != "ee_rot"}
    if ready.told is not None:
        more |= {f"{name}_told": more[name] for name in ("q", "dq")}
    if "ee_rot" in simulated:
        turns = np.zeros((len(run.t), 3))
        there, here = (values["ee_rot"][:, [1, 2, 3, 0]] for values in (simulated, run.signals))
        known = np.isfinite(there).all(axis=1) & np.isfinite(here).all(axis=1)
        turns[known] = (rotation.from_quat(there[known]) * rotation.from_quat(here[known]).inv()).as_rotvec()
        more["ee_rot"] = turns
    return more


def _felt(evidence: Evidence, number: int, one: Between, other: Between) -> float:
    """Largest mean square of the change from one to the other in a channel of a run, in units of noise."""
    most = 0.0
    for c in (channel for channel in evidence.channels if channel.run == number):
        here, there = (between[c.signal][c.index] if c.signal in between else 0.0 for between in (one, other))
        most = max(most, float(np.mean(np.square((there - here) * evidence.weights[c.first : c.last]))))
    return most
