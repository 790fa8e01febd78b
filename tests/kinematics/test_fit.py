"""Veitschegger-Wu parameters from axes, held against the axes themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mbexport.core.kinematics.fit import PARALLEL, Fit, JointAxis, fit_chain, link_to_axis
from mbexport.core.representation import Pose

Array = NDArray[np.float64]


def turn(axis: Array, angle: float) -> Array:
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def moved(joint: JointAxis, prismatic: bool, q: float) -> Array:
    """Displacement of everything beyond a joint, in the root: the product of exponentials, no parameters in it."""
    matrix = np.eye(4)
    axis, point = np.array(joint.direction), np.array(joint.origin)
    if prismatic:
        matrix[:3, 3] = q * axis
    else:
        matrix[:3, :3] = turn(axis, q)
        matrix[:3, 3] = point - matrix[:3, :3] @ point
    return matrix


def elementary(axis: int, angle: float = 0.0, shift: float = 0.0) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = turn(np.eye(3)[axis], angle)
    matrix[axis, 3] = shift
    return matrix


def row_matrix(row: object, prismatic: bool, q: float) -> Array:
    """Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), by elementary products."""
    theta, d = (row.theta, row.d + q) if prismatic else (row.theta + q, row.d)  # type: ignore[attr-defined]
    return (
        elementary(2, theta)
        @ elementary(2, shift=d)
        @ elementary(0, shift=row.a)  # type: ignore[attr-defined]
        @ elementary(0, row.alpha)  # type: ignore[attr-defined]
        @ elementary(1, row.beta)  # type: ignore[attr-defined]
    )


def worst_error(fit: Fit, joints: Sequence[JointAxis], kinds: Sequence[bool], tip: Array, q: Array) -> float:
    """Of the tip, of every joint's real place and of every axis, at q, against the product of exponentials."""
    errors: list[float] = []
    frame, so_far = fit.base_in_root.matrix(), np.eye(4)
    for i, (joint, kind) in enumerate(zip(joints, kinds, strict=True)):
        correction = fit.base_correction if i == 0 else fit.corrections[i - 1]
        place = frame @ row_matrix(correction, False, 0.0)
        errors.append(float(np.abs(place[:, 3] - so_far @ np.array([*joint.origin, 1.0])).max()))
        errors.append(float(np.abs(place[:3, 2] - so_far[:3, :3] @ np.array(joint.direction)).max()))
        so_far = so_far @ moved(joint, kind, float(q[i]))
        frame = frame @ row_matrix(fit.links[i], kind, float(q[i]))
    errors.append(float(np.abs(frame @ fit.tool_in_arm.matrix() - so_far @ tip).max()))
    return max(errors)


def as_axis(origin: Array, direction: Array) -> JointAxis:
    ox, oy, oz = (float(c) for c in origin)
    x, y, z = (float(c) for c in direction / np.linalg.norm(direction))
    return JointAxis((ox, oy, oz), (x, y, z))


@st.composite
def chains(draw: st.DrawFn) -> tuple[list[JointAxis], list[bool], Array, Array]:
    """Axes anyhow to each other: crossing, meeting, parallel, opposed, on one line, off parallel by 1e-9 to 1e-1."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = draw(st.integers(1, 8))
    origin, direction = rng.normal(size=3), rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    joints: list[JointAxis] = []
    for _ in range(n):
        match draw(st.sampled_from(["any", "parallel", "opposed", "nearly", "right"])):
            case "any":
                direction = rng.normal(size=3)
            case "opposed":
                direction = -direction
            case "nearly":
                axis = rng.normal(size=3)
                direction = turn(axis / np.linalg.norm(axis), 10.0 ** draw(st.floats(-9.0, -1.0))) @ direction
            case "right":
                direction = np.eye(3)[draw(st.integers(0, 2))] * draw(st.sampled_from([1.0, -1.0]))
            case _:
                pass
        direction = direction / np.linalg.norm(direction)
        match draw(st.sampled_from(["away", "along", "same"])):
            case "away":
                origin = origin + rng.normal(size=3)
            case "along":
                origin = origin + rng.normal() * direction
            case _:
                pass
        joints.append(as_axis(origin, direction))
    kinds = draw(st.lists(st.booleans(), min_size=n, max_size=n))
    tip = np.eye(4)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    tip[:3, :3] = rotation * np.linalg.det(rotation)
    tip[:3, 3] = rng.normal(size=3)
    return joints, kinds, tip, rng.uniform(-3.0, 3.0, size=n)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(chains())
def test_any_axes_are_reached_to_rounding(chain: tuple[list[JointAxis], list[bool], Array, Array]) -> None:
    joints, kinds, tip, q = chain
    fit = fit_chain(joints, Pose.from_matrix(tip))
    assert worst_error(fit, joints, kinds, tip, q) < 1e-13
    assert worst_error(fit, joints, kinds, tip, 0.0 * q) < 1e-13


@settings(max_examples=150, deadline=None, derandomize=True)
@given(chains())
def test_numbers_stay_at_the_robots_size(chain: tuple[list[JointAxis], list[bool], Array, Array]) -> None:
    """No common normal runs away: what near-parallel axes cost is bounded by the threshold."""
    joints, _, tip, _ = chain
    fit = fit_chain(joints, Pose.from_matrix(tip))
    size = 2.0 * max(float(np.linalg.norm(o)) for o in [*(joint.origin for joint in joints), tip[:3, 3]])
    for row in (*fit.links, *fit.corrections):
        assert abs(row.a) <= size * (1.0 + 1.0 / PARALLEL)
        assert abs(row.d) <= 2.0 * size / PARALLEL
        assert max(abs(row.theta), abs(row.alpha), abs(row.beta)) <= math.pi


@settings(max_examples=150, deadline=None, derandomize=True)
@given(chains())
def test_corrections_never_change_a_motion(chain: tuple[list[JointAxis], list[bool], Array, Array]) -> None:
    joints, _, tip, _ = chain
    fit = fit_chain(joints, Pose.from_matrix(tip))
    for row in (fit.base_correction, *fit.corrections):
        assert (row.alpha, row.a, row.beta) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("angle", [1e-9, 1e-7, 1e-5, 1e-3, 1e-2])
def test_near_parallel_axes_take_beta(angle: float) -> None:
    """Hayati's case: the misalignment is said by alpha and beta, and the frame stands at the joint."""
    link = link_to_axis((0.0, 0.4, 0.1), (0.0, math.sin(angle), math.cos(angle)))
    assert (link.a, link.d) == (0.4, 0.1)
    assert link.theta == math.pi / 2
    assert link.beta == pytest.approx(angle, rel=1e-9)


def test_axes_at_an_angle_are_plain_denavit_hartenberg() -> None:
    link = link_to_axis((0.3, 0.2, 0.7), (0.0, -1.0, 0.0))
    assert (link.alpha, link.a, link.theta, link.d, link.beta) == (math.pi / 2, 0.3, 0.0, 0.7, 0.0)


def test_parallel_axes_keep_the_joints_height() -> None:
    link = link_to_axis((0.0, -0.5, 0.25), (0.0, 0.0, 1.0))
    assert (link.alpha, link.a, link.theta, link.d, link.beta) == (0.0, 0.5, -math.pi / 2, 0.25, 0.0)


def test_opposed_axes_turn_half_about_x() -> None:
    link = link_to_axis((0.5, 0.0, 0.0), (0.0, 0.0, -1.0))
    assert (link.alpha, link.a, link.theta, link.d, link.beta) == (math.pi, 0.5, 0.0, 0.0, 0.0)


def test_meeting_axes_turn_the_shorter_way_whatever_the_noise() -> None:
    for noise in (0.0, 1e-13, -1e-13):
        link = link_to_axis((noise, 0.0, 0.3), (0.0, -1.0, 0.0), 1.0)
        assert (link.alpha, link.theta, link.d) == (math.pi / 2, 0.0, 0.3)
        assert link.a == noise


def test_the_base_is_the_root_where_joint_1_stands_on_its_z_axis() -> None:
    fit = fit_chain([JointAxis((0.0, 0.0, 0.333), (0.0, 0.0, 1.0))], Pose())
    assert fit.base_in_root == Pose()
    assert fit.base_correction.d == 0.333


def test_noise_on_a_hanging_axis_does_not_swing_the_base() -> None:
    bases = [
        fit_chain([as_axis(np.zeros(3), np.array([dx, dy, -1.0]))], Pose()).base_in_root.rotation_matrix()
        for dx, dy in ((0.0, 0.0), (1e-12, 0.0), (-1e-12, 1e-12))
    ]
    for base in bases:
        np.testing.assert_allclose(base, np.diag([1.0, -1.0, -1.0]), atol=1e-11)
