"""Figures 3 and 4 and the beta sweep, against a chain that is written out here by itself."""

from __future__ import annotations

import numpy as np
import pytest

from mbexport.core.kinematics import kinematics
from mbexport.core.representation import VeitscheggerWu
from mbexport.core.reproduction.frames import denavit_hartenberg
from mbexport.core.reproduction.misalignment import ANGLES, tip_per_angle, with_beta

# tables 1 and 2 of the paper: alpha [deg], a [m], theta [deg], d [m]; d of the corrections [m]
ARMS = ((90, 0.26, 0, 0.27), (0, 0.68, 90, 0), (90, 0, 0, 0), (-90, 0, 0, 0.67), (90, 0, 0, 0), (0, 0, 0, 0.155))
CORRECTIONS = (0.072, 0.072, 0.432, 0.0, 0.132, 0.0)


def turn(axis, angle):
    i, j = [k for k in range(3) if k != axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i], matrix[i, j] = np.sin(angle), -np.sin(angle)
    # about y the other way round
    return matrix.T if axis == 1 else matrix


def shift(x=0.0, y=0.0, z=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def arm(alpha, a, theta, d, beta=0.0):
    return turn(2, theta) @ shift(z=d) @ shift(x=a) @ turn(0, alpha) @ turn(1, beta)


def tip(q, betas=(0.0,) * 6):
    frame = np.eye(4)
    for (alpha, a, theta, d), angle, beta in zip(ARMS, q, betas, strict=True):
        frame = frame @ arm(np.radians(alpha), a, np.radians(theta) + angle, d, beta)
    return frame[:3, 3]


def test_the_frames_of_figure_3_are_those_of_the_chain(study):
    frame = np.eye(4)
    for (alpha, a, theta, d), shown in zip(ARMS, study.frames.chain[1:], strict=True):
        frame = frame @ arm(np.radians(alpha), a, np.radians(theta), d)
        assert np.allclose(shown, frame, atol=1e-14)
    assert np.allclose(study.frames.tip, tip(np.zeros(6)), atol=1e-14)


def test_the_frames_of_figure_4_are_moved_by_table_2(study):
    frames = study.frames
    assert np.allclose(frames.shifts, (0.0, *CORRECTIONS), atol=1e-15)
    for before, after, d in zip(frames.chain[1:], frames.real[1:], CORRECTIONS, strict=True):
        assert np.allclose(after[:3, 3], before[:3, 3] + d * before[:3, 2], atol=1e-14)
    # the wrist's first frame leaves the elbow
    assert np.allclose(frames.chain[3, :3, 3], frames.chain[2, :3, 3], atol=1e-14)
    assert frames.real[3, 0, 3] == pytest.approx(0.26 + 0.432)


def test_corrections_matter_only_where_bearings_tilt(study):
    assert study.frames.same_motion < 1e-14
    assert 1e-4 < study.frames.bearings < study.frames.bearing_sag


def test_equation_1_is_beta_zero_and_tells_a_beta():
    link = VeitscheggerWu(alpha=0.3, a=0.2, theta=-1.1, d=0.4)
    assert np.allclose(denavit_hartenberg(link), link.pose().matrix(), atol=1e-15)
    crooked = VeitscheggerWu(alpha=0.3, a=0.2, theta=-1.1, d=0.4, beta=1e-3)
    assert np.abs(denavit_hartenberg(crooked) - crooked.pose().matrix()).max() > 1e-4


def test_the_beta_sweep_is_that_of_another_chain(study, case):
    found = study.misalignment
    q = study.case.motion.at(found.t)[0]
    straight = np.array([tip(row) for row in q])
    for number in range(6):
        for k, angle in enumerate(ANGLES):
            betas = [angle if i == number else 0.0 for i in range(6)]
            away = np.linalg.norm(np.array([tip(row, betas) for row in q]) - straight, axis=1)
            assert found.largest[number, k] == pytest.approx(away.max(), abs=1e-14)
            assert found.mean[number, k] == pytest.approx(away.mean(), abs=1e-14)
    assert max(found.engines.values()) < 1e-13


def test_the_jacobian_of_beta_is_its_difference(case):
    q = case.motion.at(case.corners)[0]
    rates = tip_per_angle(case.rigid, q)
    step = 1e-6
    for number in range(6):
        ends = [kinematics(with_beta(case.database, {number: s})).tool_in_base(q)[:, :3, 3] for s in (step, -step)]
        assert np.allclose(rates[number], (ends[0] - ends[1]) / (2 * step), atol=1e-9)
    assert np.abs(rates[5]).max() < 1e-12
