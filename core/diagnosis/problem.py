"""The question put to the search: which effects' rows make a robot that says what was measured."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..build import assembled
from ..database import Database
from ..database.bodies import TRIANGLE_SLACK, fault_of, shortage_of
from ..effects import EffectRow
from ..errors import MbexportError
from ..kinematics import dynamics
from ..recording import Run
from ..representation import Inertia, Robot
from .beyond import beyond_of, with_harmonics
from .evidence import Evidence, gather
from .inverse import Said, said
from .model import Rows, level_rows, merged, tables

Vector = NDArray[np.float64]
# what weighs on every joint before it
BODIES = ("link_inertia", "payload")
# and what motors move
WEIGH = (*BODIES, "rotor_inertia")
# what a robot leaves that cannot be, in units of noise
FAR = 1.0e3
# and what one may leave that swings itself to pieces: squares of more than that are no numbers any longer
FARTHEST = 1.0e9
# a wave longer than two turns is none
LEAST_CYCLES = 0.5
# part of a wave that is one, on the whole way of its joint
LEAST_WAVE = 0.75
# part of an arm's largest moment that may be missing in the sum of the others, and what is put there beyond it
ALMOST, SPARE = 0.01, 1.0e-4
# an arm that is off by more [rad], or by more of all arms' length, is another robot's
MOST_TURNED, MOST_MOVED = 0.5, 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A nominal robot and its evidence.

    Attributes:
        database: The robot's.
        known: Rows of the effects that the nominal robot has.
        bodies: Database of each run: with what its log says hangs there.
        evidence: What was measured.
    """

    database: Database
    known: Rows
    bodies: tuple[Database, ...]
    evidence: Evidence

    def robots(self, rows: Rows) -> list[Robot]:
        """The robot with these rows beside (or instead of) the known ones, one a run."""
        every = with_harmonics(merged(self.known, rows))
        made: dict[int, Robot] = {}
        for body in self.bodies:
            if id(body) not in made:
                made[id(body)] = assembled(body, every, many=True)
        return [made[id(body)] for body in self.bodies]

    def residual(self, rows: Rows) -> Vector:
        """Measured minus said with these rows, in units of noise, shape (N,)."""
        return self.evidence.residual(self.robots(rows), beyond_of(rows))

    def misfit(self, rows: Rows) -> Vector:
        """The residual, or FAR everywhere where there can be no such robot, shape (N,)."""
        try:
            left = self.residual(rows)
        except MbexportError:
            return np.full(len(self.evidence.weights), FAR)
        return np.where(np.isfinite(left), np.clip(left, -FARTHEST, FARTHEST), FAR)

    def spoken(self, rows: Rows) -> list[Said]:
        """What the sensors would have said in each run."""
        e, beyond = self.evidence, beyond_of(rows)
        return [
            said(robot, run, nominal, creep, beyond)
            for robot, run, nominal, creep in zip(self.robots(rows), e.runs, e.nominals, e.creeps, strict=True)
        ]

    def only(self, chosen: Sequence[int]) -> Problem:
        """The same question put to some of the runs, in their old order."""
        bodies = tuple(self.bodies[k] for k in sorted(chosen))
        return replace(self, bodies=bodies, evidence=self.evidence.only(chosen))

    def heard(self, rows: Rows, *, exactly: bool = False) -> Problem:
        """The same question in units of the noise that a robot with these rows makes; itself where that is alike.

        Args:
            rows: What the robot has.
            exactly: Where it is alike, too.
        """
        try:
            evidence = self.evidence.heard(self.robots(rows), beyond_of(rows), exactly=exactly)
        except MbexportError:
            return self
        return self if evidence is self.evidence else replace(self, evidence=evidence)

    def lighter(self, rows: Rows) -> Vector:
        """What part of the inertia that its motor moves each joint keeps with these rows, at most all, shape (n,).

        In the middle of the first run.
        """
        if not any(effect in rows for effect in WEIGH):
            return np.ones(self.database.n)
        try:
            robot = self.robots(rows)[0]
        except MbexportError:
            return np.ones(self.database.n)
        q, nominal = self.evidence.runs[0].q, self.evidence.nominals[0]
        own, plain = (_moved_by_motors(one, q[len(q) // 2]) for one in (robot, nominal))
        return np.clip(own / np.maximum(plain, 1e-300), 0.0, 1.0)

    def farthest(self, column: str) -> float:
        """How far one of an arm's five numbers may be off [rad or m]."""
        if column in ("alpha", "theta", "beta"):
            return MOST_TURNED
        tool = math.hypot(*self.database.tool.pose().xyz)
        reach = tool + sum(math.hypot(*link.pose().xyz) for link in self.database.kinematics)
        return MOST_MOVED * max(reach, 1e-2)

    def way(self) -> Vector:
        """The range of every joint's position over all runs [rad or m], shape (n,)."""
        return np.ptp(np.concatenate([run.q for run in self.evidence.runs]), axis=0)

    def fewest_cycles(self, at: int) -> float:
        """Of a joint's wave, a turn: it goes through most of itself on the joint's way, or it is but a bend."""
        return max(LEAST_CYCLES, LEAST_WAVE * 2.0 * np.pi / max(float(self.way()[at - 1]), 1e-6))

    def impossible(self, rows: Rows) -> tuple[str, ...]:
        """Why arms of the robot with these rows are no bodies, "" for those that are or never were."""
        plain = self.robots({})[0]
        try:
            there = self.robots(rows)[0]
        except MbexportError as error:
            return (str(error),) * len(plain.stages)
        return tuple(
            fault_of(stage.arm.inertia) or ("its mass is not above 0" if stage.arm.inertia.mass <= 0.0 else "")
            if fault_of(before.arm.inertia) is None and before.arm.inertia.mass > 0.0
            else ""
            for stage, before in zip(there.stages, plain.stages, strict=True)
        )

    def rounded_out(self, fitted: Mapping[tuple[str, int], EffectRow]) -> Mapping[tuple[str, int], EffectRow]:
        """Rows with a little more of all moments of arms that are bodies but for so much; the same where none is so.

        Of a flat arm, or one whose moments were published with few digits, hardly any mass can be taken, or put
        elsewhere, without its moments being beyond what a body has; by so little nobody knows them.
        """
        heavy = {key: key[1] or self.database.n for key in sorted(fitted) if key[0] in BODIES}
        if not heavy:
            return fitted
        before = self.robots({})[0]
        try:
            there = self.robots(tables(fitted))[0]
        except MbexportError:
            return fitted
        rows, done = dict(fitted), set[int]()
        for key, at in heavy.items():
            inertia = there.stages[at - 1].arm.inertia
            # what never was a body need not be one
            if at in done or inertia.mass <= 0.0 or fault_of(before.stages[at - 1].arm.inertia):
                continue
            part = shortage_of(inertia)
            if not TRIANGLE_SLACK < part <= ALMOST:
                continue
            done.add(at)
            more = (part + SPARE) * float(np.linalg.eigvalsh(inertia.tensor())[-1])
            values = fitted[key].values
            wider = {name: values[name] + more for name in ("Ixx", "Iyy", "Izz")}
            rows[key] = EffectRow(key[1], {**values, **wider})
        return rows

    def row_at(self, effect: str, at: int, rows: Rows) -> EffectRow | None:
        """The row that stands for an effect at a place."""
        return next((row for row in merged(self.known, rows).get(effect, ()) if row.at == at), None)


def problem(database: Database, level: str, runs: Sequence[Run]) -> Problem:
    """The question for a robot at a level, and runs of it."""
    known = level_rows(database, level)
    bodies: dict[tuple[tuple[str, float], ...], Database] = {}
    for run in runs:
        key = tuple(sorted(run.payload.items()))
        bodies.setdefault(key, _loaded(database, run.payload))
    each = tuple(bodies[tuple(sorted(run.payload.items()))] for run in runs)
    nominals = [assembled(body, known, many=True) for body in each]
    return Problem(database, known, each, gather(runs, nominals))


def _loaded(database: Database, payload: Mapping[str, float]) -> Database:
    """The database with a known payload fixed to its last arm."""
    if not payload:
        return database
    body = Inertia(
        payload["mass"],
        (payload["x"], payload["y"], payload["z"]),
        *(payload[name] for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")),
    )
    return replace(database, inertias=(*database.inertias[:-1], database.inertias[-1] + body))


def _moved_by_motors(robot: Robot, q: Vector) -> Vector:
    """Inertia of the arms behind each joint and of its rotor, at motor positions q (n,), shape (n,)."""
    arms = dynamics(robot, always_compiled=True).mass_matrix(q[None, :])[0]
    return np.diagonal(arms) + [0.0 if stage.drive.dummy else stage.drive.inertia for stage in robot.stages]
