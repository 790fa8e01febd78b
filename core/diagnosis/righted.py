"""Runs with what is no physics put right: stamps, and what no log says of a controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..database import Database
from ..recording import Run
from .compared import residuals
from .gap import Gap, gap_of
from .model import robot_of
from .noise import Noise, noise_floor
from .numerics import HALF, NUMERICAL, Numerical, loudest_of, numerics, part_left, suspected
from .resimulate import each_simulated, resimulated
from .stamps import shift_of, shift_said, torque_shift_of, torque_shift_said, unshifted
from .suspect import Suspect
from .unseen import OTHER_FORM

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Righted:
    """Runs with what is no physics put right.

    Attributes:
        runs: As they are compared.
        gap: Theirs.
        numerical: How much of it is what cannot be put right.
        left: Part of the energy of the gap as it was that goes with no suspect.
        notes: What is said of it.
        instead: The runs where effects are looked for in the place of what makes much of their gap.
    """

    runs: Sequence[Run]
    gap: Gap
    numerical: Numerical
    left: float
    notes: tuple[str, ...]
    instead: Righted | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Righting:
    """The robot as it is known, which tells what is wrong with runs of it.

    Attributes:
        database, level: The robot.
        backend: Engine that simulates it.
        tell: What is being done.
    """

    database: Database
    level: str
    backend: str
    tell: Callable[[str], None]

    def righted(self, runs: Sequence[Run]) -> Righted:
        """The runs with what is no physics put right, their gap, and how much of it is what cannot be put right."""
        told = self._numerics(runs[loudest_of(*self._left(runs))])
        stamps: list[str] = []
        ready = [self._in_time(run, stamps) for run in runs]
        in_time = (*told, *stamps)
        self.tell("where the gap lies")
        before = self.gap(ready)
        suspect, part = (None, 1.0) if before.is_noise else self._suspected(runs, ready)
        if suspect is None:
            return Righted(ready, before, "none", part, in_time)
        if part > NUMERICAL and not suspect.exact:
            half = Righted(ready, before, "half", part, (*in_time, suspect.half_said(runs)))
            if part >= HALF:
                # what is most joints' own is theirs, whatever makes another joint's
                return half
            outdone = (*in_time, suspect.outdone_said(runs, part))
            return replace(half, instead=Righted(ready, before, "none", part, outdone))
        changed = [suspect.change(run) for run in runs]
        after = self.gap(changed)
        kind = "none" if suspect.exact else "all" if after.is_noise or part < OTHER_FORM else "half"
        return Righted(changed, after, kind, part, (*told, suspect.said(runs)))

    def gap(self, runs: Sequence[Run]) -> Gap:
        """The gap of the robot as it is known."""
        return gap_of(*self._left(runs), runs, robot_of(self.database, self.level, runs[0]))

    def _numerics(self, run: Run) -> tuple[str, ...]:
        """What a step and a hold change is a matter of the model, told on one run."""
        self.tell(f"step and hold of {run.name}")
        robot = robot_of(self.database, self.level, run)
        noise = noise_floor(self.database, self.level, run)
        return numerics(robot, robot, run, self.backend, noise).notes

    def _in_time(self, run: Run, notes: list[str]) -> Run:
        """The run with its stamps put right, if they are off."""
        self.tell(f"stamps of {run.name}")
        robot = robot_of(self.database, self.level, run)
        noise = noise_floor(self.database, self.level, run)
        simulated = resimulated(robot, robot, run, self.backend)
        if shift := shift_of(run, robot, simulated, noise):
            notes.append(shift_said(run, shift))
            return unshifted(run, shift)
        if shift := torque_shift_of(run, robot, simulated, noise):
            notes.append(torque_shift_said(run, shift))
        return unshifted(run, shift, ("tau",))

    def _suspected(self, runs: Sequence[Run], ready: Sequence[Run]) -> tuple[Suspect | None, float]:
        """What no log says of a controller or of stamps that leaves less than stamps put right, and which part."""
        self.tell("what the log does not say of its controller")
        robots = [robot_of(self.database, self.level, run) for run in runs]
        left, noises = self._left(runs)
        return suspected(robots, runs, self.backend, noises, part_left(left, self._left(ready)[0], noises))

    def _left(self, runs: Sequence[Run]) -> tuple[Sequence[Mapping[str, Vector]], Sequence[Noise]]:
        """What the robot as it is known leaves of each run, and what a perfect model would."""

        def apart(run: Run) -> Mapping[str, Vector]:
            robot = robot_of(self.database, self.level, run)
            return residuals(run, resimulated(robot, robot, run, self.backend), robot)

        left = each_simulated(apart, runs, self.backend)
        return left, [noise_floor(self.database, self.level, run) for run in runs]
