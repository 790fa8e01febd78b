"""Gates and comparisons on numbers made up for them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.agreement.compare import Figure, Order, compare_runs, compare_statics, orders, turned_by
from mbexport.core.agreement.gates import GATES, PAPER_REACH, limit
from mbexport.core.agreement.quantities import SMALL_TORQUE, random_states
from mbexport.core.agreement.reference import turn
from mbexport.core.agreement.runs import Run
from mbexport.core.agreement.scenarios import SCENARIOS, scenarios
from mbexport.core.build import build
from mbexport.core.database import load


@pytest.fixture(scope="module")
def arm():
    return build(load("planar2r"), "full")


def test_limits_scale_with_reach_and_step():
    def value(*manners, reach=PAPER_REACH, step=0.0):
        return limit("rigid_loop_tip", manners, reach=reach, step=step).value

    assert value("explicit", "explicit") == 1e-9
    assert value("implicit", "explicit") == 5e-7
    assert value("explicit", "first", step=1e-3) == pytest.approx(2.5e-4)
    assert value("explicit", "first", step=1e-4) == pytest.approx(2.5e-5)
    assert value("explicit", "extrapolated") == 1e-6
    assert value("explicit", "explicit", reach=3.4) == pytest.approx(2e-9)
    assert limit("mass_matrix", ("algebra", "algebra"), reach=17.0, step=0.0).value == 1e-10


def test_an_extrapolated_run_meets_its_own_gate_where_the_other_is_exact_enough():
    pair = ("explicit", "extrapolated")
    assert limit("compliant_tip", pair, reach=PAPER_REACH, step=0.0).value == 1e-7
    assert limit("compliant_tip", pair, reach=PAPER_REACH, step=0.0, narrow=False).value == 1e-6


def test_the_gates_are_those_that_were_measured_for():
    tip = GATES["loop_tip"]
    assert (tip.explicit, tip.implicit, tip.first, tip.first_step, tip.extrapolated) == (1e-8, 2e-5, 5e-5, 1e-4, 1e-6)
    bend = GATES["deflection"]
    assert (bend.explicit, bend.first, bend.extrapolated, bend.absolute, bend.absolute_first) == (
        1e-3, 3e-2, 1e-3, 1e-8, 1e-7,
    )  # fmt: skip


def test_angles_between_orientations():
    a = np.eye(3)[None]
    for angle in (1e-15, 1e-9, 0.3, math.pi):
        assert turned_by(a, turn(1, np.array([angle]))[:, :3, :3])[0] == pytest.approx(angle, rel=1e-6, abs=1e-16)


def test_statics_find_the_worst_joint_and_state():
    mass = np.array([np.diag([100.0, 1e-4]), np.diag([100.0, 1e-4])])
    other = mass.copy()
    other[1, 1, 1] += 1e-9
    (figure,) = compare_statics({"a": {"mass_matrix": mass}, "b": {"mass_matrix": other}}, 1.0)
    assert figure.value == pytest.approx(1e-5) and not figure.passed
    assert (figure.at, figure.instant) == ("joint_2", 1.0)


def test_torques_of_a_wrist_count_as_much_as_those_of_a_shoulder():
    mass = np.array([np.diag([100.0, 1e-4])])
    answers = {"mass_matrix": mass, "gravity": np.array([[1000.0, 0.01]])}
    other = {"mass_matrix": mass, "gravity": np.array([[1000.0, 0.01 + 1e-10]])}
    figures = {figure.signal: figure for figure in compare_statics({"a": answers, "b": other}, 1.0)}
    assert figures["gravity"].value == pytest.approx(1e-10) and figures["gravity"].at == "joint_2"


def test_rounding_on_the_idle_side_of_a_drive_does_not_count():
    a = {"drive_torque": np.array([[0.0, 50.0]])}
    b = {"drive_torque": np.array([[1e-15, 50.0]])}
    (figure,) = compare_statics({"a": a, "b": b}, 1.0)
    assert figure.passed
    b = {"drive_torque": np.array([[1e-3, 50.0]])}
    (figure,) = compare_statics({"a": a, "b": b}, 1.0)
    assert not figure.passed and figure.at == "joint_1, arm side" and SMALL_TORQUE < 1e-3


def test_what_is_zero_for_one_and_not_for_the_other_is_seen():
    a, b = {"motor_inertia": np.array([[0.0, 5.0]])}, {"motor_inertia": np.array([[1e-6, 5.0]])}
    (figure,) = compare_statics({"a": a, "b": b}, 1.0)
    assert not figure.passed and figure.at == "joint_1"


def test_what_is_no_number_never_passes():
    a, b = {"gravity": np.ones((2, 2))}, {"gravity": np.array([[1, 1], [np.nan, 1]])}
    mass = {"mass_matrix": np.array([np.eye(2)] * 2)}
    figures = compare_statics({"a": mass | a, "b": mass | b}, 1.0)
    (figure,) = (figure for figure in figures if figure.signal == "gravity")
    assert figure.value == math.inf and figure.instant == 1.0 and not figure.passed


def made_run(voice, manner, step, error, half=False, scale=1.0):
    t = np.linspace(0.0, 1.0, 11)
    tip = np.zeros((11, 3))
    tip[5, 1] = error
    theta = np.zeros((11, 2))
    q = theta + np.sin(t)[:, None] * [1e-3, 1e-4] * scale
    return Run(voice, manner, step, half, t, tip, theta, theta, q, theta)


def test_runs_are_judged_by_the_less_exact_of_the_two(arm):
    scenario = next(s for s in scenarios(arm, ["compliant_loop"], 1.0))
    runs = [
        made_run("fine", "explicit", 1e-3, 0.0),
        made_run("rough", "first", 1e-4, 2e-5),
        made_run("rough", "first", 5e-5, 1e-5, half=True),
        made_run("rough", "extrapolated", 1e-4, 3e-8),
        made_run("other", "explicit", 1e-3, 2e-8),
    ]
    figures = [figure for figure in compare_runs(scenario, runs, PAPER_REACH) if figure.signal == "loop_tip"]
    told = {(figure.voices, figure.manner): (figure.value, figure.gate, figure.passed) for figure in figures}
    assert told[("fine", "rough"), "first"] == (2e-5, pytest.approx(5e-5), True)
    assert told[("fine", "rough"), "extrapolated"] == (3e-8, pytest.approx(1e-6), True)
    assert told[("fine", "other"), "explicit"] == (2e-8, pytest.approx(1e-8), False)
    assert all(figure.instant == 0.5 for figure in figures)


def test_deflections_are_judged_joint_by_joint(arm):
    scenario = next(s for s in scenarios(arm, ["compliant_motion"], 1.0))
    a, b = (made_run(name, "explicit", 1e-3, 0.0) for name in "ab")
    b = replace(b, q_link=b.q_link * [1.0, 1.002])
    (figure,) = (f for f in compare_runs(scenario, [a, b], PAPER_REACH) if f.signal == "deflection")
    # 2e-3 of a peak whose gate is 1e-3 of it and 1e-8 rad
    peak = 1e-4 * math.sin(1.0)
    assert figure.at == "joint_2" and not figure.passed
    assert figure.value == pytest.approx(2e-3, rel=1e-6) and figure.gate == pytest.approx(1e-3 + 1e-8 / peak)


def test_the_order_is_judged_where_the_error_is_above_what_no_step_removes(arm):
    scenario = next(s for s in scenarios(arm, ["compliant_loop"], 1.0))

    def order_of(coarse, fine, floor):
        runs = [
            made_run("a", "explicit", 1e-3, 0.0),
            made_run("b", "explicit", 1e-3, floor),
            made_run("c", "first", 1e-4, coarse),
            made_run("c", "first", 5e-5, fine, half=True),
        ]
        (order,) = orders(scenario, runs)
        return order

    good = order_of(2e-5, 1e-5, 1e-12)
    assert good.order == pytest.approx(1.0) and good.judged and good.passed
    near = order_of(2e-5, 1.8e-5, 1e-12)
    assert near.judged and not near.passed
    assert not order_of(2e-5, 1.8e-5, 1e-6).judged
    assert not orders(replace(scenario, ordered=False), [])


def test_states_keep_the_limits_and_are_the_same_each_time(arm):
    scara = build(load("scara"))
    states, again = random_states(scara), random_states(scara)
    for i, stage in enumerate(scara.stages):
        assert stage.joint.lower <= states.q[:, i].min() and states.q[:, i].max() <= stage.joint.upper
    assert np.array_equal(states.q, again.q) and np.array_equal(states.near_theta, again.near_theta)
    rigid = random_states(build(load("puma560"), "rigid"))
    assert np.array_equal(rigid.q, rigid.theta) and np.array_equal(rigid.dq, rigid.dtheta)


def test_scenarios_are_those_that_the_robot_has():
    def names(robot, level):
        return [s.name for s in scenarios(build(load(robot), level), list(SCENARIOS), 0.5)]

    assert names("pendulum", "rigid") == ["rigid_motion", "rigid_loop"]
    assert names("imece2013", "full") == ["rigid_motion", "rigid_loop", "compliant_motion", "compliant_loop"]
    assert names("puma560", "full") == ["rigid_motion", "rigid_loop", "friction_loop", "stick_loop"]


def test_the_exercise_keeps_limits_of_place_and_speed():
    for name in ("scara", "puma560", "imece2013"):
        robot = build(load(name))
        (scenario,) = scenarios(robot, ["rigid_motion"], 1.0)
        q, dq, _ = scenario.motion.at(np.linspace(0, 1, 101))
        for i, stage in enumerate(robot.stages):
            assert stage.joint.lower <= q[:, i].min() and q[:, i].max() <= stage.joint.upper
            assert 0 < np.abs(dq[:, i]).max() <= stage.joint.velocity


def test_figures_and_orders_are_plain_answers():
    figure = Figure("statics", "gravity", ("a", "b"), 1e-9, 1e-10, "algebra", "joint_1", 3.0)
    assert not figure.passed and replace(figure, value=1e-10).passed
    order = Order("rigid_loop", "c", "a", (1e-3, 5e-4), (2e-5, 1e-5), math.nan, False)
    assert order.passed
