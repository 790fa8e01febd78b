"""Figures 11 to 13 against what can be known of them without running an engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mbexport.core.agreement.reference import read
from mbexport.core.cosimulation import ContinuousController, Coupling, loop_of, run_coupled
from mbexport.core.kinematics import dynamics, kinematics
from mbexport.core.reproduction.closed_loop import Late
from mbexport.core.reproduction.memory import late_feedback
from mbexport.core.reproduction.modes import arm_modes, loop_growth, loop_modes, modes_of
from mbexport.core.reproduction.open_loop import about_corner
from mbexport.core.reproduction.peaks import Peak, across, pairs_of, peaks_of, turns
from mbexport.core.reproduction.ringing import ringing
from mbexport.core.reproduction.statics import linear_sag, sagged_positions
from mbexport.core.simulation import backend_named, simulate

ROOT = Path(__file__).resolve().parents[2]


def test_the_path_is_straight_from_corner_to_corner(study):
    assert study.path.crooked < 1e-8
    assert study.path.tilt < 1e-8
    assert max(study.path.engines.values()) < 1e-13


def test_the_sag_is_that_of_the_tables_text(case):
    """Springs carry the weight: K (theta - q) = g(q), and the fifth voice finds the same q from the files' text."""
    theta = case.motion.at(case.corners)[0]
    q = sagged_positions(case.compliant, theta)
    k = np.array([1.8e5, 6.7e4, 1.8e5, 6.7e4, 3.1e4, 3.1e4])
    assert np.allclose(k * (theta - q), dynamics(case.compliant).gravity(q), atol=1e-8)
    tables = read(ROOT / "examples" / "robots" / "imece2013", ("joint_compliance",))
    assert np.allclose(q, [tables.sag(row) for row in theta], atol=1e-13)
    # the text book's one-shot estimate is a little off, as it must be
    sag = kinematics(case.compliant).tool_in_base(q)[:, :3, 3] - case.command(case.corners)
    off = np.abs(linear_sag(case.compliant, theta) - sag).max() / np.abs(sag).max()
    assert 1e-4 < off < 2e-2


def test_figure_12_shifts_along_z_and_swings_about_the_sag(study):
    data = study.open_loop.to_json()
    assert data["start_against_static_sag_m"] < 1e-12
    assert data["shift_z_m"]["most"] < 0.0
    assert data["shift_z_m"]["mean"] == pytest.approx(data["static_sag_z_m"]["mean"], rel=0.1)
    assert data["engines_of_high_order_apart_m"]["largest"] < 1e-12
    assert data["halving_the_step_m"] < 1e-10


def test_the_arm_rings_with_its_eigenvalues(study):
    for seen, known, close in (
        (study.open_loop.measured, study.open_loop.predicted, 1e-4),
        (study.closed_loop.measured[0], study.closed_loop.predicted[0], 2e-3),
        (study.closed_loop.measured[1], study.closed_loop.predicted[1], 2e-3),
    ):
        assert seen
        for one, other in zip(seen, known, strict=True):
            assert one.frequency == pytest.approx(other.frequency, rel=close)
            assert one.damping_ratio == pytest.approx(other.damping_ratio, rel=20 * close)


def test_eigenvalues_of_one_joint_are_those_of_the_formula(case):
    """All other joints stiff as rock: w^2 = K / M, damping ratio b / (2 sqrt(K M))."""
    from dataclasses import replace

    stages = list(case.compliant.stages)
    for i in range(1, 6):
        drive = replace(stages[i].drive, spring=replace(stages[i].drive.spring, stiffness=1e13, damping=0.0))
        stages[i] = replace(stages[i], drive=drive)
    q = np.zeros(6)
    slowest = arm_modes(replace(case.compliant, stages=tuple(stages)), q)[0]
    mass = dynamics(case.compliant).mass_matrix(q)[0, 0]
    w, ratio = np.sqrt(1.8e5 / mass), 1.3e3 / (2 * np.sqrt(1.8e5 * mass))
    assert slowest.damping_ratio == pytest.approx(ratio, rel=1e-4)
    assert slowest.frequency == pytest.approx(w * np.sqrt(1 - ratio**2) / (2 * np.pi), rel=1e-4)


def test_late_feedback_makes_the_loop_quicker(case):
    control = case.control()
    q = np.zeros(6)
    on_time, late = (loop_modes(case.compliant, q, control, ticks)[0] for ticks in (0, 5))
    assert late.frequency > on_time.frequency
    assert late.damping_ratio < on_time.damping_ratio
    assert loop_growth(case.compliant, q, control) < 1.0


def test_a_record_is_taken_apart_into_what_it_was_made_of():
    t = np.linspace(0.0, 0.5, 501)
    wanted = (-6.0 + 38.0j, -11.0 + 53.0j)
    parts = [np.exp(s * t) for s in wanted]
    values = np.column_stack([(parts[0] + 0.7 * parts[1]).real, (0.4j * parts[0] - parts[1]).real])
    found = sorted(ringing(t, values), key=lambda mode: mode.frequency)
    for mode, known in zip(found, modes_of(np.array(wanted)), strict=True):
        assert mode.frequency == pytest.approx(known.frequency, rel=1e-8)
        assert mode.damping_ratio == pytest.approx(known.damping_ratio, rel=1e-8)


def test_memory_is_feedback_of_one_tick_before(case):
    """Against the loop written out here: a PD law on what was measured one tick ago, its torques held."""
    control, late = case.control(), 1e-3
    robot, early = late_feedback(case.compliant, case.motion, late)
    run = simulate(robot, "mjcf", early, control, duration=0.1)
    ticks = np.arange(101) * 1e-3
    q_cmd, dq_cmd, _ = case.motion.at(ticks)
    feed = dynamics(case.rigid).gravity(q_cmd)
    kp, kd = np.array(control.kp), np.array(control.kd)
    # what the run measured a tick before makes the torque that it reports now
    tau = kp * (q_cmd[1:] - run.joints["q"][:-1]) + kd * (dq_cmd[1:] - run.joints["dq"][:-1]) + feed[1:]
    assert np.allclose(run.joints["tau"][1:], tau, atol=1e-7 * np.abs(tau).max())
    on_time = kp * (q_cmd[1:] - run.joints["q"][1:]) + kd * (dq_cmd[1:] - run.joints["dq"][1:]) + feed[1:]
    assert np.abs(run.joints["tau"][1:] - on_time).max() > 1e-2


def test_memory_is_that_of_the_co_simulation(case):
    """A controller that is coupled to the engine, and reads what was one communication step before, moves it alike."""
    control, late, duration = case.control(), 1e-3, 0.2
    robot, early = late_feedback(case.compliant, case.motion, late)
    ours = simulate(robot, "mjcf", early, control, duration=duration)
    controller = ContinuousController.of(case.compliant, control, case.motion, lag=0.0)
    loop = loop_of(case.compliant, controller, duration)
    theirs = run_coupled(loop, Coupling(late, memory=True), backend_named("mjcf"), ours.facts["step"])
    without = run_coupled(loop, Coupling(late), backend_named("mjcf"), ours.facts["step"])
    # but for the first millisecond, in which ours has heard of a command that is to come
    assert np.abs(ours.tip - theirs.tip).max() < 2e-4 * np.abs(without.tip - theirs.tip).max()


def test_memory_anticipates_by_its_step(study):
    for late in study.closed_loop.memory.values():
        assert isinstance(late, Late)
        assert late.shift == pytest.approx(late.late, rel=0.1)
    steps = study.closed_loop.longer
    assert [one.late for one in steps] == [1e-3, 2e-3, 5e-3]
    for one in steps:
        assert one.shift == pytest.approx(one.late, rel=0.1)
    # on the torque both feedback and command are late, and the path stays
    assert abs(study.closed_loop.on_torque.shift) < 0.1e-3


def test_the_loop_oscillates_more_and_engines_agree_on_the_peaks(study):
    closed, opened = study.closed_loop.to_json(), study.open_loop.to_json()
    assert closed["oscillation_m"] > opened["oscillation_m"]
    (row,) = closed["agreement_on_peaks"].values()
    assert row["peaks"] == row["of"] == closed["peaks"]["number"] > 0
    assert row["height_m"] < 1e-12
    assert closed["negligible_dummy"]["growth_per_tick"] > 1.0


def test_peaks_are_found_to_a_fraction_of_a_sample():
    t = np.linspace(0.0, 1.0, 1001)
    found = turns(t, 2e-3 * np.cos(2 * np.pi * 3.0 * (t - 0.0123)))
    assert [when for when, _, _ in found] == pytest.approx(0.0123 + np.arange(6) / 6, abs=1e-6)
    assert [height for _, height, _ in found] == pytest.approx([2e-3, -2e-3] * 3, abs=1e-8)
    assert [left for _, _, left in found] == [True, False] * 3


def test_left_of_an_edge_is_left():
    begin, end = np.zeros(3), np.array([0.0, 2.0, 0.0])
    assert across(np.array([[-0.1, 1.0, 5.0], [0.2, 0.3, 0.0]]), begin, end) == pytest.approx([0.1, -0.2])


def test_peaks_of_other_edges_and_other_turns_are_no_pairs():
    one = (Peak(0, 0.1, 1e-3, True), Peak(1, 0.5, -1e-3, False))
    assert pairs_of(one, (Peak(0, 0.101, 1e-3, False), Peak(0, 0.5, -1e-3, False))) == []
    assert pairs_of(one, (Peak(0, 0.103, 9e-4, True),)) == [(one[0], Peak(0, 0.103, 9e-4, True))]


def test_what_strays_is_measured_from_the_nearer_edge():
    t = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    tip = np.array([[0, 0, 0], [0.5, 0.1, 0], [1.2, 0.0, 0], [1.0, 0.5, 0], [1.0, 1.0, 0]])
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], dtype=float)
    assert about_corner(t, tip, np.array([0.0, 1.0, 2.0]), places, 1) == pytest.approx([0.1, 0.2, 0.0])
    assert len(peaks_of(t, tip, np.array([0.0, 1.0, 2.0]), places)) == 0
