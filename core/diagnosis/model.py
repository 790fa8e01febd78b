"""The robot that a run is held against: the database at a level, what hangs there, and effects on top."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ..build import CONTACT_DAMPING_RATIO, assembled
from ..database import Database, FrozenMap
from ..effects import EffectRow, effect_named
from ..recording import Run
from ..representation import Robot, Stage

Rows = Mapping[str, tuple[EffectRow, ...]]


def robot_of(database: Database, level: str, run: Run, effects: Rows | None = None) -> Robot:
    """The database at a level with the run's declared payload, and with effects that were found.

    Args:
        database: The robot as its database knows it.
        level: Which of the database's own effects count.
        run: Its log's payload hangs there beside the database's own.
        effects: Rows that replace the level's at their places, or stand beside them.

    Raises:
        UsageError: No such level.
    """
    rows = merged(level_rows(database, level), effects or {})
    robot = assembled(database, rows, many=True)
    if run.payload:
        robot = effect_named("payload").apply(robot, (EffectRow(0, FrozenMap(run.payload)),))
    return _held(robot)


def _held(robot: Robot) -> Robot:
    """The robot, the contacts that stand for rigid gears with an error damped critically.

    As hard as play's, which rings on for many ticks, such a contact and a quick controller of a light motor drive each
    other to where no rigid gear goes.
    """

    def damped(stage: Stage) -> Stage:
        spring = stage.drive.spring
        if spring is None or not spring.stands_in:
            return stage
        calm = replace(spring, damping=spring.damping / CONTACT_DAMPING_RATIO)
        return replace(stage, drive=replace(stage.drive, spring=calm))

    return replace(robot, stages=tuple(map(damped, robot.stages)))


def level_rows(database: Database, level: str) -> dict[str, tuple[EffectRow, ...]]:
    """Rows of the effects that a level uses.

    Raises:
        UsageError: No such level.
    """
    return {name: database.effects[name] for name in database.level_effects(level)}


def merged(rows: Rows, others: Rows) -> dict[str, tuple[EffectRow, ...]]:
    """Rows, replaced where others have one of the same effect and place."""
    whole = dict(rows)
    for name, new in others.items():
        by_place = {row.at: row for row in whole.get(name, ())} | {row.at: row for row in new}
        whole[name] = tuple(by_place[at] for at in sorted(by_place))
    return whole


def tables(rows: Mapping[tuple[str, int], EffectRow]) -> dict[str, tuple[EffectRow, ...]]:
    """Rows by effect and number of their place, as tables in the order of places."""
    out: dict[str, tuple[EffectRow, ...]] = {}
    for (effect, _), row in sorted(rows.items()):
        out[effect] = (*out.get(effect, ()), row)
    return out
