"""The indices, on functions whose indices are known."""

from __future__ import annotations

import numpy as np
import pytest

from mbexport.core.study import design, parse_vary
from mbexport.core.study.sensitivity import level_means, sensitivity

XYZ = [f"gravity.{axis}[SI]@robot=-3.141592653589793:3.141592653589793:9" for axis in "xyz"]


def plan(planar, sampling, count=None, texts=XYZ):
    return design([parameter for text in texts for parameter in parse_vary(text, planar)], sampling, count, seed=1)


def ishigami(x):
    """Ishigami and Homma (1990), with a = 7 and b = 0.1."""
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


FIRST, TOTAL = (0.3139, 0.4424, 0.0), (0.5576, 0.4424, 0.2437)


def test_sobol_finds_the_indices_of_ishigami(planar):
    chosen = plan(planar, "sobol", 5 * 2048)
    found = sensitivity(chosen, "tip_rms", ishigami(chosen.values))
    assert found.method == "sobol"
    assert found.values["first"] == pytest.approx(FIRST, abs=0.03)
    assert found.values["total"] == pytest.approx(TOTAL, abs=0.03)
    assert max(found.values["total_ci"]) < 0.08
    again = sensitivity(chosen, "tip_rms", ishigami(chosen.values))
    assert again.values == found.values


def test_any_samples_give_first_indices(planar):
    chosen = plan(planar, "lhs", 4000)
    found = sensitivity(chosen, "tip_rms", ishigami(chosen.values))
    assert found.method == "rbd_fast"
    assert found.values["first"] == pytest.approx(FIRST, abs=0.04)


def test_a_grid_gives_the_indices_of_its_levels(planar):
    chosen = plan(planar, "grid", texts=["gravity.x[SI]@robot=0,1", "gravity.y[SI]@robot=0,2"])
    x, y = chosen.values.T
    # variances: 3^2/4 of x alone, (2 * 1)^2 of y, (4/4)^2 of both together
    found = sensitivity(chosen, "tip_rms", 3 * (x - 0.5) + 2 * (y - 1) + 4 * (x - 0.5) * (y - 1))
    assert found.values["first"] == pytest.approx((2.25 / 10.25, 4 / 10.25))
    assert found.values["total"] == pytest.approx((6.25 / 10.25, 8 / 10.25))
    levels, means = level_means(chosen, 1, np.array([1.0, 2.0, 3.0, np.nan]))
    assert (levels.tolist(), means.tolist()) == ([0.0, 2.0], [2.0, 2.0])


def test_morris_finds_the_slopes_of_a_line(planar):
    chosen = plan(planar, "morris", 60)
    found = sensitivity(chosen, "tip_rms", chosen.values @ np.array([2.0, -0.5, 0.0]))
    assert found.values["mean_effect"] == pytest.approx((4 * np.pi, np.pi, 0.0), abs=1e-9)
    assert found.values["spread_effect"] == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert found.ranking == "mean_effect"


def test_blocks_with_a_failed_variant_are_left_out(planar):
    chosen = plan(planar, "sobol", 5 * 1024)
    y = ishigami(chosen.values)
    y[[7, 8, 1000]] = np.nan
    found = sensitivity(chosen, "tip_rms", y)
    assert found.note == "2 of 1024 blocks are left out, for a variant in them failed"
    assert found.values["total"] == pytest.approx(TOTAL, abs=0.05)


def test_where_nothing_can_be_said_it_is_said_why(planar):
    chosen = plan(planar, "lhs", 20)
    assert "too few" in sensitivity(chosen, "tip_rms", ishigami(chosen.values)).note
    chosen = plan(planar, "sobol", 40)
    assert sensitivity(chosen, "tip_rms", np.full(40, 0.3)).note == "no variant differs"
    assert "too few" in sensitivity(chosen, "tip_rms", np.full(40, np.nan)).note
    assert sensitivity(chosen, "tip_rms", np.full(40, np.nan)).ranking == ""
