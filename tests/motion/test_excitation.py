from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.errors import UsageError
from mbexport.core.motion import excitation
from mbexport.core.representation import Robot

ROBOTS = ("imece2013", "puma560", "arm7", "scara", "planar2r", "pendulum")


@pytest.mark.parametrize("name", ROBOTS)
def test_keeps_limits_and_begins_and_ends_at_rest_at_home(rigid: Callable[[str], Robot], name: str) -> None:
    robot = rigid(name)
    law = excitation(robot)
    assert law.duration == 10.0
    q, dq, ddq = law.at(np.linspace(0.0, 10.0, 5001))
    for i, stage in enumerate(robot.stages):
        joint = stage.joint
        assert q[:, i].min() >= joint.lower - 1e-12
        assert q[:, i].max() <= joint.upper + 1e-12
        assert np.abs(dq[:, i]).max() <= joint.velocity
        assert np.ptp(q[:, i]) > 0.1  # it does move
    assert np.abs(ddq).max() <= 8.0
    for t in (0.0, 10.0):
        at = law.at(t)
        assert np.allclose(at[0], robot.home(), rtol=0, atol=1e-14)
        assert np.allclose(at[1:], 0.0, atol=1e-12)


def test_speeds_and_accelerations_by_differences(rigid: Callable[[str], Robot]) -> None:
    law = excitation(rigid("scara"), seed=3)
    h = 1e-4
    t = np.linspace(0.1, 9.9, 400)
    (before, dq_before, _), (_, dq, ddq), (after, dq_after, _) = law.at(t - h), law.at(t), law.at(t + h)
    assert np.allclose((after - before) / (2 * h), dq, atol=1e-6)
    assert np.allclose((dq_after - dq_before) / (2 * h), ddq, atol=1e-3)
    # ... and at the knots the numbers are those of the sines, not of the polynomials: continuous to third order
    step = law.knots[1] - law.knots[0]
    q, dq, ddq = law.at(law.knots)
    bend = (16 * (q[3:-1] + q[1:-3]) - q[4:] - q[:-4] - 30 * q[2:-2]) / (12 * step**2)
    assert np.allclose(bend[60:-60], ddq[62:-62], atol=1e-3)


def test_is_band_limited(rigid: Callable[[str], Robot]) -> None:
    """Between 0.5 and 2 Hz lies nearly all of the energy of what is between the ramps."""
    law = excitation(rigid("arm7"), lowest=0.5, highest=2.0, duration=20.0)
    t = np.arange(0.0, 20.0, 0.01)
    q = law.at(t)[0] - np.array(rigid("arm7").home())
    window = np.hanning(len(t))[:, None]
    power = np.abs(np.fft.rfft(q * window, axis=0)) ** 2
    f = np.fft.rfftfreq(len(t), 0.01)
    inside = (f >= 0.3) & (f <= 2.3)
    assert (power[inside].sum(axis=0) / power.sum(axis=0)).min() > 0.99
    assert power[f > 4.0].sum() < 1e-6 * power.sum()


def test_home_at_a_limit(rigid: Callable[[str], Robot]) -> None:
    robot = rigid("planar2r")
    joint = replace(robot.stages[0].joint, lower=0.0, upper=0.4, home=0.0, velocity=0.5)
    robot = replace(robot, stages=(replace(robot.stages[0], joint=joint), robot.stages[1]))
    q, dq, _ = excitation(robot).at(np.linspace(0.0, 10.0, 5001))
    assert q[:, 0].min() >= -1e-15
    assert 0.2 < q[:, 0].max() <= 0.4
    assert np.abs(dq[:, 0]).max() <= 0.5


def test_seed_chooses_the_phases(rigid: Callable[[str], Robot]) -> None:
    robot = rigid("pendulum")
    assert np.array_equal(excitation(robot, seed=1).coefficients, excitation(robot, seed=1).coefficients)
    assert not np.allclose(excitation(robot, seed=1).coefficients, excitation(robot, seed=2).coefficients)


def test_acceleration_limit_is_obeyed(rigid: Callable[[str], Robot]) -> None:
    ddq = excitation(rigid("arm7"), acceleration=0.7).at(np.linspace(0, 10, 5001))[2]
    assert 0.5 < np.abs(ddq).max() <= 0.7


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": 0.5}, r"no whole period between 0\.1 and 1\.0 Hz; take 1\.0 s or longer"),
        ({"amplitude": 0.0}, "must be above 0"),
        ({"highest": math.inf}, "must be above 0"),
    ],
)
def test_bad_options(rigid: Callable[[str], Robot], options: dict[str, float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        excitation(rigid("pendulum"), **options)  # type: ignore[arg-type]  # numbers only
