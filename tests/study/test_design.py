"""Which variants a study runs."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from mbexport.core.errors import UsageError
from mbexport.core.study import design, parse_vary

A, B = "joint_compliance.stiffness@joint_1", "joint_compliance.stiffness@joint_2"


def parameters(planar, *texts):
    return [parameter for text in texts for parameter in parse_vary(text, planar)]


def test_a_grid_has_every_combination_the_last_fastest(planar):
    plan = design(parameters(planar, f"{A}=1,2", f"{B}=0.5:1.5:3", "gravity.x[SI]@robot=0"))
    assert plan.values.tolist() == [[2500 * a, 900 * b, 0.0] for a, b in product((1, 2), (0.5, 1, 1.5))]
    assert plan.free == (0, 1)


@pytest.mark.parametrize(
    ("sampling", "count", "expected", "block"),
    [("random", 50, 50, 1), ("lhs", 50, 50, 1), ("sobol", 60, 64, 4), ("sobol", 1000, 1024, 4), ("morris", 31, 30, 3)],
)
def test_samples_lie_in_the_ranges_and_repeat(planar, sampling, count, expected, block):
    varied = parameters(planar, f"{A}=0.5:2", f"{B}=0.1:10:3:log", "payload.mass[SI]@robot=3")
    plan = design(varied, sampling, count, seed=5)
    assert (len(plan), plan.block) == (expected, block)
    low, high = np.array([1250.0, 90.0, 3.0]), np.array([5000.0, 9000.0, 3.0])
    assert ((plan.values >= low) & (plan.values <= high)).all()
    again, other = design(varied, sampling, count, seed=5), design(varied, sampling, count, seed=6)
    assert again.values.tobytes() == plan.values.tobytes()
    assert other.values.tobytes() != plan.values.tobytes()
    # a range with log is spread evenly in its logarithm
    assert np.log(plan.values[:, 1] / 90.0) / np.log(100.0) == pytest.approx(plan.unit[:, 1])
    assert plan.unit[:, 1].mean() == pytest.approx(0.5, abs=0.2)
    assert np.ptp(plan.values[:, 2]) == 0.0


def test_a_latin_hypercube_fills_every_row_and_column(planar):
    plan = design(parameters(planar, f"{A}=0.5:2", f"{B}=0.5:2"), "lhs", 20)
    assert (np.sort(np.floor(20 * plan.unit), axis=0) == np.arange(20)[:, None]).all()


@pytest.mark.parametrize(
    ("texts", "sampling", "count", "message"),
    [
        ((f"{A}=0.5:2",), "grid", None, "needs a count"),
        ((f"{A}=0.5:2:3",), "grid", 5, "--count is for samples"),
        ((f"{A}=0.5:2:3", f"{A}=1:2:3"), "grid", None, "varied twice"),
        ((f"{A}=0.5:2:2000", f"{B}=0.5:2:2000"), "grid", None, "4000000 variants"),
        ((f"{A}=0.5:2",), "lhs", None, "needs --count"),
        ((f"{A}=0.5:2",), "lhs", 0, "from 1 to"),
        ((f"{A}=0.5:2",), "sobol", 4, "needs --count 24 or more"),
        ((f"{A}=1,2",), "lhs", 10, "not a list"),
        ((f"{A}=1",), "lhs", 10, "needs a parameter with a range"),
        ((), "grid", None, "nothing varies"),
    ],
)
def test_what_does_not_fit_is_one_error(planar, texts, sampling, count, message):
    with pytest.raises(UsageError, match=message):
        design(parameters(planar, *texts), sampling, count)


def test_a_seed_is_not_below_zero(planar):
    with pytest.raises(UsageError, match="--seed -1"):
        design(parameters(planar, f"{A}=0.5:2"), "random", 10, -1)
