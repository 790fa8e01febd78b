"""From a database and a level of complexity to the neutral robot; the one place where they meet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .effects import EffectRow, catalogue, effect_named, in_order, law_named
from .errors import UsageError
from .kinematics import dynamics
from .representation import Arm, Drive, Robot, Spring, Stage, Stick
from .shapes import draw

if TYPE_CHECKING:
    from .database import Database

# A stuck joint gives this much before it slips [rad or m]: half of what the database's contract lets it creep.
STICK_DISPLACEMENT = 5.0e-6
# at which joints move, to tell what they bear where gravity loads them with nothing [rad/s^2 or m/s^2]
ACCELERATION = 20.0
# A contact that is given no stiffness (backlash, transmission error of a rigid joint): the effects' contract.
CONTACT_FREQUENCY = 500.0
CONTACT_DAMPING_RATIO = 0.15
# robots at home that are kept: who tries many variants changes the arms of few
_REMEMBERED = 64


def build(database: Database, level: str = "full", effects: Iterable[str] | None = None) -> Robot:
    """The robot of a database with some of its effects.

    Args:
        database: As read.
        level: "full" (all of the database's effects), "rigid" (none), or one of the levels it names.
        effects: Names of effects instead of a level; each must have a table in the database.

    Raises:
        UsageError: No such level, or an effect that the database has no table for.
    """
    chosen, named = _chosen_effects(database, level, effects)
    robot = replace(
        assembled(database, {name: database.effects[name] for name in chosen}),
        level=named,
        effects=chosen,
        source_hash=database.content_hash(),
    )
    if database.inertia_check == "error":
        _insist_on_bodies(robot, database)
    return draw(robot)


def assembled(database: Database, rows: Mapping[str, Sequence[EffectRow]], *, many: bool = False) -> Robot:
    """The robot of a database with these effects' rows and no others; nothing is drawn, judged or hashed.

    For those who try variants, and in the middle of a search do not mind what no body can be.

    Args:
        database: As read.
        rows: Of its effects.
        many: It is one of thousands: what it takes is worth to be compiled.
    """
    stages = tuple(
        Stage(joint, Arm(f"arm_{i}", link, correction, inertia, shapes))
        for i, joint, link, correction, inertia, shapes in zip(
            range(1, database.n + 1),
            database.joints,
            database.kinematics,
            database.corrections[1:],
            database.inertias,
            database.shapes(),
            strict=True,
        )
    )
    robot = Robot(
        name=database.name,
        gravity=database.gravity,
        base=database.base.pose(),
        base_correction=database.corrections[0],
        stages=stages,
        tool=database.tool.pose(),
        friction=database.friction,
        effects=tuple(sorted(rows)),
    )
    for effect in in_order([effect_named(name) for name in sorted(rows)]):
        robot = effect.apply(robot, rows[effect.name])
    return finish_drives(robot, database.dummy_inertia, many=many)


def _insist_on_bodies(robot: Robot, database: Database) -> None:
    """Effects may not turn an arm into what no body can be; the database's own arms were judged as it was read."""
    from .database.bodies import fault_of

    for stage, original in zip(robot.stages, database.inertias, strict=True):
        body = stage.arm.inertia
        if body == original:
            continue
        fault = f"its mass would be {body.mass!r} kg" if body.mass <= 0.0 else fault_of(body)
        if fault is not None:
            raise UsageError(
                f"{robot.name} with {', '.join(robot.effects)}: {stage.arm.name} becomes impossible: {fault}. "
                "Correct its row of link_inertia or payload, or set inertia_check: warn."
            )


def _chosen_effects(database: Database, level: str, effects: Iterable[str] | None) -> tuple[tuple[str, ...], str]:
    """Sorted names of the effects, and the level's name."""
    tables = tuple(sorted(database.effects))
    if effects is not None:
        wanted = sorted(set(effects))
        for name in wanted:
            if name not in tables:
                unknown = name not in catalogue()
                raise UsageError(
                    f"effect {name!r} is not installed; installed: {', '.join(catalogue())}."
                    if unknown
                    else f"{database.name} has no table for effect {name!r}; it has: {', '.join(tables) or 'none'}."
                )
        return tuple(wanted), "custom"
    return database.level_effects(level), level


def finish_drives(robot: Robot, dummy_inertia: float, *, many: bool = False) -> Robot:
    """Give elastic joints without a rotor the paper's dummy part, and what sticks its bristle.

    Args:
        robot: With all effects applied.
        dummy_inertia: Fraction of the arm's diagonal mass-matrix entry at home.
        many: It is one of thousands.
    """
    needs_spring = any(stage.drive.spring for stage in robot.stages)
    needs_stick = any(sticks(stage.drive) for stage in robot.stages)
    if not needs_spring and not needs_stick:
        return robot
    arms = tuple(Stage(stage.joint, stage.arm) for stage in robot.stages)
    mass_matrix, load = _at_home(Robot(robot.name, robot.gravity, robot.base, robot.base_correction, arms), many)
    notes: list[str] = []
    stages = list(robot.stages)
    for i, stage in enumerate(stages):
        drive = stage.drive
        arm_inertia = float(mass_matrix[i, i])
        if drive.spring and drive.inertia == 0.0:
            inertia = dummy_inertia * arm_inertia
            drive = replace(drive, inertia=inertia, dummy=True)
            notes.append(
                f"{stage.joint.name}: no rotor_inertia, so its motor side is a dummy part of {inertia!r} "
                f"({dummy_inertia!r} of the arm's diagonal mass-matrix entry at home)"
            )
        if drive.spring and math.isinf(drive.spring.stiffness + drive.spring.damping):
            if not drive.inertia * arm_inertia > 0.0:
                raise UsageError(
                    f"{stage.joint.name}: a contact needs inertia on both sides to have a stiffness, and there are "
                    f"{drive.inertia!r} and {arm_inertia!r}; state its stiffness and damping, or the inertia."
                )
            spring = _contact(drive.spring, drive.inertia, arm_inertia)
            drive = replace(drive, spring=replace(spring, stands_in=spring.gap == 0.0 and wobbles(drive)))
            notes.append(
                f"{stage.joint.name}: its contact has stiffness {spring.stiffness!r} and damping {spring.damping!r}"
            )
        if drive is not stage.drive:
            stages[i] = replace(stage, drive=drive)
    if needs_stick:
        rigid = np.array([0.0 if stage.drive.spring else stage.drive.inertia for stage in stages])
        mobility = np.diag(np.linalg.inv(mass_matrix + np.diag(rigid)))
        for i, stage in enumerate(stages):
            if sticks(stage.drive):
                inertia = stage.drive.inertia if stage.drive.spring else 1.0 / float(mobility[i])
                if not inertia > 0.0:
                    raise UsageError(
                        f"{robot.name}: {stage.joint.name} would have an inertia of {inertia!r}; no bodies make that."
                    )
                passed = usual_load(float(load[i]), float(mass_matrix[i, i]))
                stick = _bristle(level_at_rest(stage.drive, passed), inertia)
                stages[i] = replace(stage, drive=replace(stage.drive, stick=stick))
    return replace(robot, stages=tuple(stages), notes=robot.notes + tuple(notes))


@lru_cache(maxsize=_REMEMBERED)
def _at_home(arms: Robot, many: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mass matrix of a robot without drives at home, shape (n, n), and how much its joints bear there, shape (n,)."""
    home, plain = np.array(arms.home()), dynamics(arms, always_compiled=many)
    return plain.mass_matrix(home), np.abs(plain.gravity(home))


def _contact(spring: Spring, motor: float, arm: float) -> Spring:
    """The spring with what it was not given: 500 Hz on the reduced inertia of both sides, damping ratio 0.15."""
    # what has no inertia of its own moves with the other side
    reduced = motor * arm / (motor + arm) if min(motor, arm) > 0.0 else max(motor, arm)
    k = spring.stiffness if math.isfinite(spring.stiffness) else (2 * math.pi * CONTACT_FREQUENCY) ** 2 * reduced
    b = spring.damping if math.isfinite(spring.damping) else 2 * CONTACT_DAMPING_RATIO * math.sqrt(k * reduced)
    return replace(spring, stiffness=k, damping=b)


def wobbles(drive: Drive) -> bool:
    """Whether a drive has a gear whose error comes and goes."""
    return any(term.kind == "error" for term in drive.terms)


def sticks(drive: Drive) -> bool:
    """Whether a drive has friction that sticks."""
    return any(term.kind == "level" for term in drive.terms)


def usual_load(gravity: float, inertia: float) -> float:
    """What a joint passes to its arms as it moves [N m or N], where these have an inertia and gravity loads it so.

    About a vertical axis, or where an arm hangs, gravity is no measure of it: rounding would be.
    """
    return max(abs(gravity), ACCELERATION * inertia)


def level_at_rest(drive: Drive, load: float) -> float:
    """Sticking friction's level at rest under a load [N m or N]."""
    return sum(
        law_named(term.effect, term.law).function(term.parameters, 0.0, 0.0, 0.0, 0.0, 0.0, load)
        for term in drive.terms
        if term.kind == "level"
    )


def _bristle(level: float, inertia: float) -> Stick:
    """A bristle that gives STICK_DISPLACEMENT at the level, critically damped on an inertia."""
    if level <= 0.0:
        return Stick(STICK_DISPLACEMENT, 0.0)
    return Stick(STICK_DISPLACEMENT, 2.0 * math.sqrt(STICK_DISPLACEMENT * inertia / level))
