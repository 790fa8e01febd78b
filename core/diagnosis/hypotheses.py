"""What competes: every effect of the catalogue at every place, each in the forms in which it could be there.

A hypothesis is linear near where it starts: its numbers beta move a row's values, and the residual's change with beta
is its signature. What is not linear (a Stribeck velocity, the cycles of a ripple) comes as several hypotheses, one for
each of a few values; the search's winner is refined in all of its numbers afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..effects import catalogue, effect_named
from ..expansion import SHORTEST_BEND
from ..parallel import side_by_side
from .amounts import FORMS, giving, plugin
from .hypothesis import GIVING, Hypothesis, clamped
from .model import Rows
from .problem import Problem
from .scales import Scales

# waves go together whose cycles do but for this many that runs can tell apart
NEAR = 2.0
_WAVES = ("transmission_error", "torque_ripple")
# turns of one wave in turns of another that goes with it
_TOGETHER = ((1, 1), (2, 1), (3, 1), (1, 2), (1, 3))
# where no torque is measured only their product shows
_SAME_UNSEEN = ("controller_gain", "torque_constant")


def hypotheses(problem: Problem, rows: Rows, scales: Scales, skip: Sequence[tuple[str, int]] = ()) -> list[Hypothesis]:
    """Everything that could be there beside these rows, in amounts of these scales, but for what to skip."""
    n = problem.database.n
    # a motor moves before a clamped output only where something gives; nothing else can be judged before that is there
    stiff = [
        at
        for at in range(1, n + 1)
        if clamped(problem, at) and not any(problem.row_at(name, at, rows) for name in GIVING)
    ]
    there = {(effect, row.at) for effect, found_rows in rows.items() for row in found_rows}

    def forms(place: tuple[str, int]) -> list[Hypothesis]:
        name, at = place
        if place in skip or not possible(problem, name, at) or (names_of_one(problem, name, at) - {place}) & there:
            return []
        if effect_named(name).key == "joint" and at in stiff:
            return giving(scales, name, at)
        existing = problem.row_at(name, at, rows)
        known = dict(existing.values) if existing else None
        maker = FORMS.get(name, plugin)
        made = [h for h in maker(problem, scales, name, at, known) if len(h.scale)]
        if name in _WAVES:
            made = [h for h in made if not _harmonic(h, rows, NEAR * 2.0 * np.pi / scales.way[at - 1])]
        return made

    places = [
        (name, at) for name in catalogue() for at in ((0,) if effect_named(name).key == "robot" else range(1, n + 1))
    ]
    # which waves there could be is most of the work, and compiled
    return [one for some in side_by_side(forms, places) for one in some]


def _harmonic(wave: Hypothesis, rows: Rows, apart: float) -> bool:
    """Whether a wave goes with one that was found at its joint: no error of a gear or a motor is a pure sine.

    Args:
        wave: What is asked about.
        rows: What was found.
        apart: Cycles by which these runs can tell two waves apart.
    """
    values = wave.values(wave.scale)
    if values is None:
        return False
    ratios = [
        (row.values["cycles"], values["cycles"]) for name in _WAVES for row in rows.get(name, ()) if row.at == wave.at
    ]
    return any(abs(k * other - m * own) < apart for other, own in ratios for k, m in _TOGETHER)


def twins_of(problem: Problem) -> set[tuple[str, int]]:
    """Two names of one body: what hangs at the last arm is a payload, or that arm's inertia."""
    return {("payload", 0), ("link_inertia", problem.database.n)}


def names_of_one(problem: Problem, name: str, at: int) -> set[tuple[str, int]]:
    """The names, each at its place, of which one says all that this one does on these runs; itself among them."""
    if (name, at) in (twins := twins_of(problem)):
        return twins
    if name in _SAME_UNSEEN and not any({"tau", "tau_link"} & run.measured.keys() for run in problem.evidence.runs):
        return {(other, at) for other in _SAME_UNSEEN}
    return {(name, at)}


def possible(problem: Problem, name: str, at: int) -> bool:
    """Whether an effect can say anything here."""
    database = problem.database
    runs = problem.evidence.runs
    controls = {run.run.control.mode for run in runs}
    if name == "controller_gain" and "pd" not in controls:
        return False
    if name in ("delay", "torque_limit") and not controls & {"pd", "torque"}:
        return False
    if name == "torque_constant" and not any(run.gains_act for run in runs):
        return False
    if name == "torque_offset" and not any("tau" in run.measured for run in runs):
        return False
    if name == "base_tilt" and database.base_taken_up:
        return False
    if name == "link_flexibility":
        pose = database.kinematics[at - 1].pose()
        return math.hypot(*pose.xyz) > max(SHORTEST_BEND, 1e-3)
    return True
