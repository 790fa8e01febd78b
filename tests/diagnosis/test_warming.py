"""Friction that changes along a run: a level in the middle is not the whole cause."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.database import FrozenMap, load
from mbexport.core.diagnosis.diagnosis import HowFar
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.held import Held, NoLaw
from mbexport.core.diagnosis.judge import Judge
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import refined
from mbexport.core.diagnosis.unseen import splits
from mbexport.core.diagnosis.verdict import unexplained_of, verdict_of
from mbexport.core.diagnosis.warming import WARMS_SAID, with_warming
from mbexport.core.effects import EffectRow

from .pendulums import pendulum_run

KNOWN = {"coulomb_friction": (EffectRow(1, FrozenMap({"torque": 0.3})),)}


def told(against, effect="coulomb_friction", known=None, seeds=(1, 2), **values):
    """What holds, of one finding whose numbers are fitted to pendulums on which a torque acts."""
    database = load("pendulum")
    if known:
        database = replace(database, effects=FrozenMap(known))
    runs = [pendulum_run(against=against, seed=seed) for seed in seeds]
    asked = problem(database, "full", runs)
    judge = Judge(database, "full", "mjcf", [], lambda _: None, asked, whitening(asked), splits(len(runs), 0), runs)
    begun = Found(effect, 1, EffectRow(1, values), 50.0)
    fit = refined(asked, judge.whiten, [begun], blocks(asked.evidence))
    found = (replace(begun, row=fit.rows[begun.key]),)
    far = HowFar({}, {}, {}, 0.9, (0.8, 1.0), {})
    held = Held(found, SimpleNamespace(open=0.0, stands_out=False), (), set(), far, (), SimpleNamespace(is_noise=True))
    return held, with_warming(judge, held)


@pytest.mark.parametrize(
    ("against", "part", "other"),
    [
        # means of the two halves of 4 s
        (lambda t, q, dq: 0.6 * np.sign(dq) * (0.7 + 0.3 * np.exp(-t / 0.8)), 0.709 / 0.81 - 1.0, "less"),
        (lambda t, q, dq: 0.6 * np.sign(dq) * (0.7 + 0.1 * t), 0.25, "more"),
    ],
)
def test_friction_that_goes_with_a_runs_time_is_no_friction_that_stays(against, part, other):
    held, rest = told(against, torque=0.5)
    assert rest.found == held.found
    assert rest.no_law is not None
    assert rest.no_law.joint == 1
    words = re.fullmatch(
        WARMS_SAID.format(friction="Coulomb friction", joint=1, part=0, other=other).replace("0 %", "(.*) %"),
        rest.no_law.said,
    )
    assert words is not None
    assert float(words[1]) == pytest.approx(100.0 * abs(part), abs=4.0)
    assert (verdict_of(held, True, None, None), verdict_of(rest, True, None, None)) == ("explained", "partly_explained")
    left = unexplained_of("partly_explained", None, rest, None, None)
    assert (left.joints, left.looks_like) == ({"joint_1": 1.0}, rest.no_law.said)


def test_of_friction_that_a_database_knows_all_of_it_warms_up():
    """Found is a little less than was known; of the whole of it a tenth goes."""
    _, rest = told(lambda t, q, dq: 0.3 * np.sign(dq) * (0.8 + 0.2 * np.exp(-t / 0.8)), known=KNOWN, torque=0.28)
    assert rest.no_law is not None
    assert float(rest.no_law.said.split(" that is ")[1].split()[0]) == pytest.approx(
        100.0 * (1.0 - 0.806 / 0.873), abs=3.0
    )


@pytest.mark.parametrize(
    ("against", "effect", "values"),
    [
        (lambda t, q, dq: 0.08 * np.sign(dq), "coulomb_friction", {"torque": 0.07}),
        # another one there than back
        (lambda t, q, dq: np.where(dq > 0.0, 0.09, -0.07), "coulomb_friction", {"torque": 0.07}),
        # a damper that yields
        (lambda t, q, dq: 0.06 * dq / (1.0 + 0.4 * np.abs(dq)), "viscous_friction", {"coefficient": 0.04}),
        # what is no friction
        (lambda t, q, dq: 0.1 * (1.0 + t), "torque_offset", {"torque": 0.1}),
    ],
)
def test_friction_of_another_form_stays_what_it_is(against, effect, values):
    held, rest = told(against, effect, **values)
    assert rest is held


def test_what_is_not_most_of_what_is_left_is_not_told_as_that():
    """Of enough runs the evidence is beyond doubt, and beside another cause that nobody found it may be anything."""
    seeds = tuple(range(6))
    held, rest = told(lambda t, q, dq: friction(t, dq) + 0.6 * np.sin(30.0 * q), torque=0.5, seeds=seeds)
    assert rest is held
    _, alone = told(lambda t, q, dq: friction(t, dq), torque=0.5, seeds=seeds)
    assert alone.no_law is not None


def friction(t, dq):
    return 0.6 * np.sign(dq) * (0.6 + 0.4 * np.exp(-t / 0.8))


def test_what_is_known_to_be_no_friction_stays_that():
    held, _ = told(lambda t, q, dq: 0.08 * np.sign(dq), seeds=(1,), torque=0.07)
    grows = replace(held, no_law=NoLaw(1, "a drag"))
    assert with_warming(None, grows) is grows
