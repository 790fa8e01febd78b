"""Which runs are cut in time so that parts of them may confirm what held-out ones do not."""

from dataclasses import replace

import pytest

from mbexport.core.database import load
from mbexport.core.diagnosis.diagnosis import Unexplained
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.unconfirmed import moves_farther, nearly_alone, those_that_show
from mbexport.core.diagnosis.unseen import Split, splits

from .pendulums import friction_free, pendulum_run


def rubs(t, q, dq):
    return 0.4 * dq


def test_the_runs_that_are_cut_are_those_that_show_the_gap():
    quiet = [pendulum_run(seed=seed, duration=1.0) for seed in (1, 2)]
    rubbing = [pendulum_run(against=rubs, seed=seed, duration=1.0) for seed in (3, 4)]

    def shows(*some):
        named = [replace(run, name=f"run-{k}") for k, run in enumerate(some)]
        return those_that_show(problem(load("pendulum"), "rigid", named), named, splits(len(some), 1)[0])

    assert shows(rubbing[0], quiet[0], quiet[1]) == ("run-0",)
    # not where there is another that may confirm it, nor where the held-out run has it
    assert shows(rubbing[0], rubbing[1], quiet[0]) == ("run-2",)
    assert shows(quiet[0], quiet[1], rubbing[0]) == ("run-2",)


@pytest.mark.parametrize(
    ("long", "joints", "farther"), [(0.5, {"joint_1": 1.0}, True), (1.5, {"joint_1": 1.0}, False), (0.5, {}, False)]
)
def test_that_held_out_runs_move_a_joint_farther_is_told_of_the_one_where_most_is_left(long, joints, farther):
    some = [pendulum_run(seed=k, duration=duration) for k, duration in ((1, long), (2, 3.0))]
    asked = problem(load("pendulum"), "rigid", some)
    said = moves_farther(asked, splits(2, 1)[0], Unexplained(0.8, joints, ""))
    assert ("over 1.57 rad in the held-out runs" in said) == farther


def test_a_gap_is_nearly_the_held_out_runs_alone_where_the_others_show_next_to_nothing_of_it():
    def asked(first, second):
        given = [pendulum_run(against=against, seed=seed) for seed, against in ((1, first), (2, second))]
        whole = problem(load("pendulum"), "rigid", given)
        way = Split((0,), (1,))
        return nearly_alone(whole, whitening(whole), way, {})

    assert asked(friction_free, rubs)
    assert not asked(rubs, rubs)
    assert not asked(rubs, friction_free)
