"""The controller against its law, tick by tick."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.control import Control, Controller, default_pd
from mbexport.core.errors import UsageError
from mbexport.core.kinematics import dynamics
from mbexport.core.motion import MotionLaw, point_to_point
from mbexport.core.representation import Arm, Drive, Inertia, Joint, Pose, Robot, Sensor, Stage, VeitscheggerWu

KP, KD = np.array([100.0, 50.0]), np.array([3.0, 2.0])


def robot(**drive: float) -> Robot:
    """Two rods in a vertical plane."""
    stages = tuple(
        Stage(
            Joint(f"joint_{i + 1}", home=0.3),
            Arm(f"arm_{i + 1}", VeitscheggerWu(a=0.5), inertia=Inertia(2.0, (-0.25, 0.0, 0.0), 0.01, 0.05, 0.05)),
            Drive(**drive),  # type: ignore[arg-type]  # numbers only
            Sensor(),
        )
        for i in range(2)
    )
    return Robot("rods", (0.0, -9.81, 0.0), Pose(), VeitscheggerWu(), stages)


def law() -> MotionLaw:
    return point_to_point([0.0, 0.0], [1.0, -0.5], 0.5)


def pd(**changes: object) -> Control:
    return replace(Control("pd", tuple(KP), tuple(KD), rate=200.0), **changes)  # type: ignore[arg-type]


def ticked(controller: Controller, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    for k in range(len(controller.tick_times)):
        controller.tick(k, q[k], dq[k])
    return np.array([controller.held(k) for k in range(len(controller.tick_times))])


def measured(controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.random.default_rng(5).normal(size=(2, len(controller.tick_times), 2)))


@pytest.mark.parametrize("feedforward", ["none", "gravity", "inverse_dynamics"])
def test_law(feedforward: str) -> None:
    plant = replace(robot(), kp_factor=(0.5, 2.0), kd_factor=(1.0, 3.0))
    nominal = robot()
    controller = Controller(nominal, plant, pd(feedforward=feedforward), law(), 0.5)
    q, dq = measured(controller)
    got = ticked(controller, q, dq)
    q_cmd, dq_cmd, ddq_cmd = law().at(controller.tick_times)
    arms = dynamics(nominal)
    added = {
        "none": np.zeros_like(q),
        "gravity": np.array([arms.gravity(x) for x in q_cmd]),
        "inverse_dynamics": np.array([arms.inverse_dynamics(*x) for x in zip(q_cmd, dq_cmd, ddq_cmd, strict=True)]),
    }[feedforward]
    want = KP * (0.5, 2.0) * (q_cmd - q) + KD * (1.0, 3.0) * (dq_cmd - dq) + added
    assert np.allclose(got, want, rtol=1e-13, atol=1e-12)
    assert np.allclose(controller.feedforward_at_start(), added[0], rtol=1e-13, atol=1e-12)


def test_ticks_and_switches() -> None:
    """The delay is no multiple of the tick: the torque of each tick begins to act exactly so much later."""
    controller = Controller(robot(), replace(robot(), delay=0.0123), pd(), law(), 0.5)
    assert len(controller.tick_times) == 101
    assert np.array_equal(controller.tick_times, np.arange(101) / 200.0)
    assert np.array_equal(controller.switch_times, np.arange(101) / 200.0 + 0.0123)


@pytest.mark.parametrize(("own", "drive"), [(5.0, math.inf), (math.inf, 5.0), (5.0, 20.0), (20.0, 5.0)])
def test_the_smaller_limit_cuts(own: float, drive: float) -> None:
    free = Controller(robot(), robot(), pd(), law(), 0.5)
    cut = Controller(robot(), robot(torque_limit=drive), pd(torque_limit=(own, own)), law(), 0.5)
    q, dq = measured(free)
    uncut = ticked(free, q, dq)
    assert np.abs(uncut).max() > 50.0
    assert np.array_equal(ticked(cut, q, dq), np.clip(uncut, -5.0, 5.0))


def test_torque_mode_gives_what_was_commanded_within_limits() -> None:
    torque = np.random.default_rng(1).normal(size=(120, 2))
    control = Control("torque", rate=200.0, torque_limit=(0.5, math.inf))
    controller = Controller(robot(), robot(), control, law(), 0.5, torque)
    q, dq = measured(controller)
    got = ticked(controller, q, dq)
    assert np.array_equal(got[:, 1], torque[:101, 1])
    assert np.array_equal(got[:, 0], np.clip(torque[:101, 0], -0.5, 0.5))
    with pytest.raises(UsageError, match=r"shape \(100, 2\); \(101, 2\) is needed"):
        Controller(robot(), robot(), control, law(), 0.5, torque[:100])


def test_reset_forgets() -> None:
    controller = Controller(robot(), robot(), pd(), law(), 0.5)
    controller.tick(0, np.ones(2), np.ones(2))
    assert controller.held(0).any()
    controller.reset()
    assert not controller.held(0).any()


def test_default_gains() -> None:
    """kp = (2 pi 5)^2 (M_ii(home) + J), kd = 1.4 (2 pi 5) (M_ii(home) + J), M of two rods by hand."""
    plant = robot(inertia=0.7)
    cos = math.cos(0.3)
    inner = 0.05 + 2.0 * 0.25**2
    m22 = inner
    m11 = inner + 0.05 + 2.0 * (0.5**2 + 0.25**2 + 2 * 0.5 * 0.25 * cos)
    w = 2 * math.pi * 5.0
    control = default_pd(plant)
    assert control.kp == pytest.approx((w * w * (m11 + 0.7), w * w * (m22 + 0.7)), rel=1e-12)
    assert control.kd == pytest.approx((1.4 * w * (m11 + 0.7), 1.4 * w * (m22 + 0.7)), rel=1e-12)
    assert control.mode == "pd"
    assert control.rate == 1000.0


def test_a_command_that_is_held_changes_at_every_few_ticks() -> None:
    plant = robot()
    controller = Controller(plant, plant, pd(every=3, feedforward="gravity"), law(), 0.5)
    q, dq = measured(controller)
    got = ticked(controller, q, dq)
    given = controller.tick_times[np.arange(len(controller.tick_times)) // 3 * 3]
    q_cmd, dq_cmd, _ = law().at(given)
    expected = KP * (q_cmd - q) + KD * (dq_cmd - dq) + dynamics(plant).gravity(q_cmd)
    np.testing.assert_allclose(got, expected, rtol=1e-12)


@pytest.mark.parametrize("ticks", [0.1, 1, 2.5, 4])
def test_speeds_as_differences_of_positions(ticks: float) -> None:
    """Of a position that grows with t^2 they are the speed half of these ticks ago, also of parts of a tick."""
    plant = robot()
    controller = Controller(plant, plant, pd(differenced=ticks), law(), 0.5)
    t = controller.tick_times
    growing = np.column_stack([t**2, -3.0 * t**2])
    accelerations = np.array([2.0, -6.0])
    got = ticked(controller, growing, accelerations * t[:, None])
    seen = accelerations * (t[:, None] - 0.5 * ticks / 200.0)
    q_cmd, dq_cmd, _ = law().at(t)
    expected = KP * (q_cmd - growing) + KD * (dq_cmd - seen)
    begun = math.ceil(ticks)
    np.testing.assert_allclose(got[begun:], expected[begun:], rtol=1e-9)
    # a run's first tick has nothing before it
    np.testing.assert_allclose(got[0], KD * dq_cmd[0] + KP * q_cmd[0], rtol=1e-12)


def test_positions_that_are_seen_ahead() -> None:
    """Of a position that grows evenly they are where it is a part of a tick later."""
    plant = robot()
    controller = Controller(plant, plant, pd(ahead=0.3), law(), 0.5)
    t = controller.tick_times
    speeds = np.array([2.0, -6.0])
    got = ticked(controller, speeds * t[:, None], np.broadcast_to(speeds, (len(t), 2)))
    q_cmd, dq_cmd, _ = law().at(t)
    expected = KP * (q_cmd - speeds * (t[:, None] + 0.3 / 200.0)) + KD * (dq_cmd - speeds)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9)
