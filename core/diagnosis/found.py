"""What was found: effects at their places with their numbers, and what cannot be among them."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from ..effects import EffectRow, effect_named
from .hypothesis import GIVING, TENSOR, clamped, defaults
from .model import Rows, tables
from .placed import Placed
from .plain import LEAST_MASS, at_a_point
from .problem import BODIES, Problem
from .refine import free_columns

# part of the hardness that a contact is taken to have (500 Hz) from which a spring beside it is but that (100 Hz)
AS_HARD = 0.04


@dataclass(frozen=True, slots=True, eq=False)
class Found(Placed):
    """An effect that was found.

    Attributes:
        effect, at: What and where.
        row: Its values.
        gain: Log evidence that it adds to the others.
        absent: Its row where it is as if it were not there; None where no row of finite numbers is that.
    """

    row: EffectRow
    gain: float
    absent: EffectRow | None = None


def rows_of(found: Sequence[Found]) -> Rows:
    """Findings as tables."""
    return tables({item.key: item.row for item in found})


def beside_or_more(found: Sequence[Found], picked: Sequence[Found]) -> list[Found]:
    """Findings and picks; a pick of an effect that is there already has more of its numbers."""
    more = {item.key: item for item in picked}
    kept = [replace(item, row=more[item.key].row) if item.key in more else item for item in found]
    there = {item.key for item in found}
    return [*kept, *(item for item in picked if item.key not in there)]


def numbers_in(found: Sequence[Found]) -> set[tuple[str, int, str]]:
    """Effect, place and column of every number that is fitted."""
    return {(*item.key, name) for item in found for name in free_columns(item.effect, item.row)}


def without_bodies(problem: Problem, found: Sequence[Found]) -> set[tuple[str, int]]:
    """Findings with which an arm is no body that can exist."""
    heavy = [item for item in found if item.effect in BODIES]
    if not heavy:
        return set()
    faults = problem.impossible(rows_of(found))
    return {item.key for item in heavy if faults[item.at - 1]}


def embodied(problem: Problem, found: Sequence[Found], unreal: Collection[tuple[str, int]]) -> list[Found] | None:
    """Findings with moments of inertia for masses at points that are no bodies without them; None: no such."""

    def thin(item: Found) -> bool:
        values = item.row.values
        return item.key in unreal and item.effect == "link_inertia" and not any(values[name] for name in TENSOR)

    def whole(item: Found) -> Found:
        least = LEAST_MASS * max(problem.database.inertias[item.at - 1].mass, 1e-3)
        values = {**item.row.values, **at_a_point(item.row.values, least)}
        return replace(item, row=EffectRow(item.at, values))

    return [whole(item) if thin(item) else item for item in found] if any(map(thin, found)) else None


def at_points(problem: Problem, found: Sequence[Found], unreal: Collection[tuple[str, int]]) -> list[Found] | None:
    """Findings with masses that are no bodies put at points: moments that runs hardly show must not cost them.

    None where there are no such moments.
    """

    def spread_out(item: Found) -> bool:
        heavy = item.effect in BODIES
        return item.key in unreal and heavy and any(item.row.values[name] for name in TENSOR)

    def point(item: Found) -> Found:
        return replace(item, row=EffectRow(item.at, {**item.row.values, **dict.fromkeys(TENSOR, 0.0)}))

    return [point(item) if spread_out(item) else item for item in found] if any(map(spread_out, found)) else None


def hung(problem: Problem, found: Sequence[Found], unreal: Collection[tuple[str, int]]) -> list[Found] | None:
    """Findings with a load at the last arm where they have more of that arm which is no body; None: no such.

    The arm's mass and first moments with moments of inertia of their own are hardly ever a body: a point that hangs
    there always is one.
    """
    last = ("link_inertia", problem.database.n)
    item = next((one for one in found if one.key == last), None)
    if item is None or last not in unreal or any(one.effect == "payload" for one in found):
        return None
    arm, load = (problem.row_at(*key, {}) for key in (last, ("payload", 0)))
    before = dict(load.values) if load else dict(defaults("payload"))
    more = {name: item.row.values[name] - (arm.values[name] if arm else 0.0) for name in ("mass", "mx", "my", "mz")}
    mass = before["mass"] + more["mass"]
    if mass <= 0.0:
        return None
    first = {axis: before["mass"] * before[axis] + more["m" + axis] for axis in "xyz"}
    values = before | {"mass": mass} | {axis: moment / mass for axis, moment in first.items()}
    there = replace(item, effect="payload", at=0, row=EffectRow(0, values), absent=EffectRow(0, before))
    return [there if one is item else one for one in found]


def never_slipping(problem: Problem, found: Sequence[Found]) -> set[tuple[str, int]]:
    """Hysteresis that slips nowhere on the way that its joint goes: a spring says the same with less."""
    loops = [item for item in found if item.effect == "hysteresis"]
    if not loops:
        return set()
    way = problem.way()
    numbers = {item.key: item.row.values for item in loops}
    return {key for key, row in numbers.items() if row["torque"] > row["stiffness"] * float(way[key[1] - 1])}


def gives_alone(problem: Problem, found: Sequence[Found], item: Found) -> bool:
    """Whether nothing else gives before a clamped output, where another finding needs its motor to move."""
    return item.effect in GIVING and item.at in stuck_joints(problem, [other for other in found if other is not item])


def stuck_joints(problem: Problem, found: Sequence[Found]) -> set[int]:
    """Joints with clamped outputs before which nothing gives, where a finding needs the motor to move."""
    moving = {item.at for item in found if effect_named(item.effect).key == "joint" and clamped(problem, item.at)}
    return moving - {item.at for item in found if item.effect in GIVING}


def as_hard_as_a_contact(problem: Problem, found: Sequence[Found]) -> Found | None:
    """A joint's spring beside play that is about as hard as the contact would be without it; None: no such."""
    for item in found:
        play = [one for one in found if one.key == ("backlash", item.at)]
        if item.effect != "joint_compliance" or not play or math.isfinite(play[0].row.values["stiffness"]):
            continue
        contact = problem.robots(rows_of(play))[0].stages[item.at - 1].drive.spring
        if contact and item.row.values["stiffness"] > AS_HARD * contact.stiffness:
            return item
    return None
