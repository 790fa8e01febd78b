"""What tests of the search share: questions put to a pendulum that nothing of the package moves, and searches."""

import math

from mbexport.core.database import load
from mbexport.core.diagnosis.hypothesis import Hypothesis
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.search import search
from mbexport.core.diagnosis.state import Search
from mbexport.core.effects import EffectRow, effect_named

from .pendulums import pendulum_run

NO_SPRING = EffectRow(1, {"stiffness": 0.0, "rest": 0.0})
COLUMNS = [column.name for column in effect_named("link_inertia").columns]
RIGID_BEARING = dict.fromkeys(("kx", "ky", "kz", "krx", "kry", "krz"), math.inf)
RIGID_BEARING |= dict.fromkeys(("bx", "by", "bz", "brx", "bry", "brz"), 0.0)


def question(against=None, **options):
    runs = [pendulum_run(seed=seed, **({"against": against} if against else {}), **options) for seed in (1, 2)]
    return problem(load("pendulum"), "rigid", runs)


def found(asked):
    whiten = whitening(asked)
    state = Search(asked, whiten)
    state.begin()
    return search(state), whiten


def having(asked, whiten, parts, findings):
    """A search that has found these."""
    state = Search(asked, whiten)
    state.begin()
    state.take(findings, refined(asked, whiten, findings, parts))
    return state


def row(hypothesis: Hypothesis):
    return hypothesis.values(hypothesis.scale) or {}
