"""Co-simulation: against what it must be equal to, against equations written here, and at the orders of theory."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mbexport.core.build import build
from mbexport.core.control import Control, default_pd
from mbexport.core.cosimulation import ContinuousController, Coupling, loop_of, measure, run_coupled, run_monolithic
from mbexport.core.cosimulation.extrapolation import Extrapolation
from mbexport.core.database import FrozenMap, load
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.motion import MotionLaw, from_table
from mbexport.core.simulation import backend_named, simulate

BACKENDS = ("exudyn", "mjcf", "pybullet", "urdf")
PINOCCHIO = backend_named("urdf")


@pytest.fixture(scope="module")
def arm():
    return build(load("planar2r"), "compliant")


@pytest.fixture(scope="module")
def bare():
    return build(load("planar2r"), "rigid")


def moving(robot, still=0.0, end=0.3):
    """From home to elsewhere and back after standing for a while, smooth to the third derivative at least."""
    home = np.array(robot.home())
    times = np.array([0.0, still, still + 0.15, still + 0.3]) if still else np.array([0.0, 0.15, 0.3])
    q = np.array([home] * (len(times) - 2) + [home + end, home])
    q[-2:] = home + end, home
    return from_table(times, q, np.zeros_like(q), np.zeros_like(q))


def loop(robot, law=None, duration=0.12, control=None, **controller):
    law = moving(robot) if law is None else law
    rules = control or default_pd(robot, feedforward="gravity")
    return loop_of(robot, ContinuousController.of(robot, rules, law, **controller), duration)


# -- the parts --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0, 1, 2])
def test_polynomials_of_the_order_are_foretold_exactly(order):
    powers = np.random.default_rng(order).normal(size=(order + 1, 2))

    def signal(t):
        return sum(power * t**k for k, power in enumerate(powers))

    told = Extrapolation(order, 0.1, signal(0.0))
    for k in range(4):
        told.hear(0.1 * k, signal(0.1 * k))
    for t in (0.3, 0.34, 0.4):
        assert told.at(t) == pytest.approx(signal(t), abs=1e-12)
    # one order more is not
    assert np.abs(told.at(0.4) - signal(0.4) - 0.1).max() > 1e-3


@pytest.mark.parametrize("order", [1, 2])
def test_two_held_values_carry_impulse_and_first_moment(order):
    told = Extrapolation(order, 0.1, np.array([0.3]))
    for k, value in enumerate((1.0, -0.4, 2.0)):
        told.hear(0.1 * k, np.array([value]))
    begin, length = 0.23, 0.04
    points, weights = np.polynomial.legendre.leggauss(4)
    at = begin + 0.5 * length * (points + 1.0)
    values = np.array([told.at(t)[0] for t in at])
    first, second = (value[0] for value in told.held_twice(begin, length))
    assert 0.5 * (first + second) == pytest.approx(0.5 * weights @ values)
    moment = 0.5 * length * weights @ (values * (at - begin - 0.5 * length))
    assert (second - first) * length**2 / 8.0 == pytest.approx(moment)


# -- equal to a sampled controller where it is one --------------------------------------------------------------------


@pytest.mark.parametrize("backend", BACKENDS)
def test_held_without_states_it_is_the_sampled_controller(backend, arm):
    """One communication step a tick, and nothing of the controller left to solve."""
    control = default_pd(arm, rate=500.0, feedforward="gravity")
    law = moving(arm)
    one = loop(arm, law, 0.06, control, lag=0.0)
    run = run_coupled(one, Coupling(1.0 / control.rate), backend_named(backend))
    ours = simulate(arm, backend, law, control, duration=0.06, rate=control.rate, start=one.start)
    assert np.abs(run.tip - ours.tip).max() < 1e-14
    assert np.abs(run.q - ours.joints["q_link"]).max() < 1e-14
    assert np.abs(run.torque - ours.joints["tau"]).max() < 1e-10


def test_memory_is_feedback_that_is_a_step_late(arm):
    """A delay of the torque, with a command that is as much too early, is the same."""
    control = default_pd(arm, rate=500.0)
    interval = 1.0 / control.rate
    law = moving(arm, still=0.02)
    one = loop(arm, law, 0.1, control, lag=0.0)
    run = run_coupled(one, Coupling(interval, memory=True), PINOCCHIO)
    late, early = replace(arm, delay=interval), MotionLaw(law.knots - interval, law.coefficients)
    ours = simulate(late, "urdf", early, control, duration=0.1, rate=control.rate, start=one.start)
    assert np.abs(run.tip - ours.tip).max() < 1e-12
    without = run_coupled(one, Coupling(interval), PINOCCHIO)
    assert np.abs(run.tip - without.tip).max() > 1e-4


# -- the reference, against equations of this file --------------------------------------------------------------------

# the numbers of examples/robots/planar2r, typed again
MASS, LENGTH, INERTIA = (2.4, 1.2), (0.5, 0.4), (0.05024, 0.01612)
COM = (0.25, 0.2)
STIFFNESS, DAMPING, ROTOR = np.array([2500.0, 900.0]), np.array([4.0, 0.8]), np.array([0.30, 0.08])
VERTICAL = 9.81


def textbook(q, dq):
    """Mass matrix and bias of two rods in a vertical plane (Siciliano et al., 2009, section 7.3.2)."""
    (m1, m2), (a1, _), (l1, l2) = MASS, LENGTH, COM
    c1, c2, s2, c12 = math.cos(q[0]), math.cos(q[1]), math.sin(q[1]), math.cos(q[0] + q[1])
    coupled = INERTIA[1] + m2 * (l2**2 + a1 * l2 * c2)
    matrix = np.array(
        [
            [INERTIA[0] + m1 * l1**2 + INERTIA[1] + m2 * (a1**2 + l2**2 + 2 * a1 * l2 * c2), coupled],
            [coupled, INERTIA[1] + m2 * l2**2],
        ]
    )
    h = -m2 * a1 * l2 * s2
    weight = m2 * l2 * VERTICAL * c12
    bias = np.array([2 * h * dq[0] * dq[1] + h * dq[1] ** 2, -h * dq[0] ** 2])
    return matrix, bias + np.array([(m1 * l1 + m2 * a1) * VERTICAL * c1 + weight, weight])


def textbook_tip(q):
    return np.column_stack([LENGTH[0] * np.cos(q[:, 0]) + LENGTH[1] * np.cos(q.sum(axis=1)),
                            LENGTH[0] * np.sin(q[:, 0]) + LENGTH[1] * np.sin(q.sum(axis=1))])  # fmt: skip


@pytest.mark.parametrize("elastic", [True, False])
def test_the_loop_in_one_piece_is_that_of_the_textbook(elastic, arm, bare):
    """Elastic or rigid, PD with integral part behind a lag, feedforward of gravity: equations and start of our own."""
    robot = arm if elastic else bare
    kp, kd, ki, lag = np.array([900.0, 250.0]), np.array([40.0, 8.0]), np.array([1800.0, 500.0]), 2.0e-3
    control = Control("pd", tuple(kp), tuple(kd), "gravity")
    law = moving(robot)
    one = loop(robot, law, 0.15, control, lag=lag, integral=0.5)
    times = np.linspace(0.0, 0.15, 16)

    def slopes(t, x):
        q, theta, dq, dtheta, z, tau = x.reshape(6, 2)
        wanted, speed, _ = law.at(t)
        seen, rate = (theta, dtheta) if elastic else (q, dq)
        asked = kp * (wanted - seen) + kd * (speed - rate) + ki * z + textbook(wanted, np.zeros(2))[1]
        matrix, bias = textbook(q, dq)
        if elastic:
            spring = STIFFNESS * (theta - q) + DAMPING * (dtheta - dq)
            bend, turn = np.linalg.solve(matrix, spring - bias), (tau - spring) / ROTOR
        else:
            bend, turn = np.linalg.solve(matrix, tau - bias), np.zeros(2)
        return np.concatenate([dq, dtheta, bend, turn, wanted - seen, (asked - tau) / lag])

    # at rest: what the feedforward leaves of gravity, the gains hold
    home = np.array(robot.home())
    q = theta = home
    for _ in range(60):
        load = textbook(q, np.zeros(2))[1]
        theta = home - (load - textbook(home, np.zeros(2))[1]) / kp
        q = theta - load / STIFFNESS if elastic else theta
    start = np.concatenate([q, theta, np.zeros(4), np.zeros(2), load])
    found = solve_ivp(slopes, (0.0, 0.15), start, method="DOP853", t_eval=times, rtol=1e-11, atol=1e-11)
    reference = run_monolithic(one, times)
    tip = textbook_tip(found.y[:2].T)
    assert np.abs(reference.q - found.y[:2].T).max() < 1e-9
    # the robot's plane is x z of the world, y z of nothing: its base is turned about x
    assert np.abs(reference.tip[:, :2] - tip).max() < 1e-9
    assert np.abs(tip - tip[0]).max() > 0.05


# -- what coupling costs ----------------------------------------------------------------------------------------------


def orders(robot, **options):
    """Errors on a motion that is slow enough for the communication steps."""
    home = np.array(robot.home())
    slow = from_table([0.0, 0.4], [home, home + 0.3], np.zeros((2, 2)), np.zeros((2, 2)))
    study = measure(loop(robot, slow, 0.1), PINOCCHIO, (1e-3, 5e-4), **options)
    return study, {kind: found[-1] for kind, found in study.observed_orders().items()}


def test_every_order_of_extrapolation_converges_at_its_own(arm):
    study, found = orders(arm)
    assert found["held"] == pytest.approx(1.0, abs=0.3)
    assert found["extrapolated, order 1"] == pytest.approx(2.0, abs=0.25)
    assert found["extrapolated, order 2"] == pytest.approx(3.0, abs=0.5)
    finest = [study.curve(order, False)[-1].largest for order in (0, 1, 2)]
    assert finest[0] > 30.0 * finest[1] > 30.0**2 * finest[2]


def test_memory_makes_the_tip_early_by_a_step_and_of_first_order(arm):
    study, found = orders(arm, orders=(1,), memory=True)
    assert found["extrapolated, order 1, memory"] == pytest.approx(1.0, abs=0.15)
    for plain, late in zip(study.curve(1, False), study.curve(1, True), strict=True):
        # a whole step where the motion is slow for the loop, less where it is fast
        assert 0.45 < (late.earlier - plain.earlier) / late.interval < 1.2
        assert late.largest > 10.0 * plain.largest


@pytest.mark.parametrize("backend", ["mjcf", "exudyn", "pybullet"])
def test_every_engine_comes_to_the_same_reference(backend, bare):
    one = loop(bare, duration=0.08)
    apart = []
    for interval in (2e-3, 1e-3):
        run = run_coupled(one, Coupling(interval, 1), backend_named(backend))
        apart.append(np.abs(run.tip - run_monolithic(one, run.t).tip).max())
    # an engine of first order has an error of its own, which communication does not take away
    assert apart[1] < (5e-4 if backend == "pybullet" else 0.4 * apart[0])


def test_passive_joints_take_part(bare):
    row = {column.name: column.default for column in effect_named("link_flexibility").columns}
    effects = {
        "link_flexibility": (EffectRow(1, {**row, "ku": 5.0e3, "kv": 6.0e3, "bu": 20.0, "bv": 20.0}),),
        "rotor_inertia": (EffectRow(1, {"inertia": 0.3}),),
        "encoder_offset": (EffectRow(2, {"offset": 0.01}),),
        "torque_constant": (EffectRow(1, {"gain": 0.9}),),
        "viscous_friction": (EffectRow(2, {"coefficient": 0.4}),),
    }
    robot = build(replace(load("planar2r"), effects=FrozenMap(effects), levels=FrozenMap({})))
    one = loop(robot, duration=0.05)
    run = run_coupled(one, Coupling(5e-4, 2), PINOCCHIO)
    reference = run_monolithic(one, run.t)
    assert run.q.shape == reference.q.shape == (101, 2)
    assert np.abs(run.tip - reference.tip).max() < 2e-6
    assert np.abs(run.tip - run_monolithic(loop(bare, duration=0.05), run.t).tip).max() > 1e-4


def test_the_controller_has_a_solver_of_its_own(arm):
    """Its own steps matter at its own order, and not to the communication."""
    coarse, fine, finest = (
        run_coupled(loop(arm, duration=0.04, lag=4e-3, step=step), Coupling(4e-3), PINOCCHIO).torque
        for step in (4e-3, 2e-3, 1e-4)
    )
    errors = [np.abs(torque - finest).max() for torque in (coarse, fine)]
    assert errors[0] > 8.0 * errors[1] > 0.0


def test_a_coupling_that_is_unstable_is_said_to_be(bare):
    study = measure(loop(bare, duration=0.6), PINOCCHIO, (60e-3, 2e-3), orders=(2,), memory=True)
    stable = {(one.interval, one.memory): one.stable for one in study.measured}
    assert stable == {(60e-3, False): False, (2e-3, False): True, (60e-3, True): False, (2e-3, True): True}
    assert study.to_json()["measured"][0]["largest"] is None
    assert {run.coupling.interval for run in study.runs} == {2e-3}


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda arm: Coupling(0.0), UsageError, "above 0"),
        (lambda arm: Coupling(1e-3, 3), UsageError, "0 .held., 1 or 2"),
        (lambda arm: loop(arm, control=Control()), UsageError, "mode pd, not motion"),
        (lambda arm: loop(arm, lag=-1.0), UsageError, "lag of -1.0 s"),
        (lambda arm: loop(arm, integral=0.0), UsageError, "reset time"),
        (lambda arm: loop(arm, step=0.0), UsageError, "step of 0.0 s for the controller"),
        (lambda arm: loop(arm, duration=-1.0), UsageError, "duration -1.0 s"),
        (lambda arm: loop(replace(arm, delay=0.01)), RefusedError, "the effect delay"),
        (lambda arm: measure(loop(arm), PINOCCHIO, (3e-3, 2e-3)), UsageError, "whole multiples"),
        (lambda arm: measure(loop(arm), PINOCCHIO, (1.0,)), UsageError, "longer than the run"),
        (lambda arm: measure(loop(arm), PINOCCHIO, ()), UsageError, "no communication step"),
        (lambda arm: run_coupled(loop(arm), Coupling(1e-3), PINOCCHIO, 1.0), RefusedError, "unstable"),
    ],
)
def test_wrong_use_is_told(make, error, said, arm):
    with pytest.raises(error, match=said):
        make(arm)


def test_friction_with_a_memory_has_no_loop_in_one_piece():
    robot = build(load("planar2r"), "friction")
    one = loop(robot)
    with pytest.raises(RefusedError, match=r"joint_1 has friction with a memory \(coulomb_friction\)"):
        run_monolithic(one, np.array([0.0, 0.01]))


def test_friction_that_sticks_is_held_against_a_fine_coupling():
    """Which is as near to the loop itself as it says: a coupling four times finer still is no further away."""
    robot = build(load("planar2r"), "friction")
    one = loop(robot, duration=0.06)
    study = measure(one, PINOCCHIO, (2e-3, 1e-3), orders=(0,))
    reference = study.reference
    assert reference.coupling == Coupling(1e-3 / 8, 2)
    assert reference.known_to is not None
    finer = run_coupled(one, Coupling(1e-3 / 32, 1), PINOCCHIO)
    assert np.abs(finer.tip[::32] - reference.tip).max() < 2.0 * reference.known_to
    assert study.observed_orders()["held"][-1] == pytest.approx(1.0, abs=0.3)
    assert min(found.largest for found in study.measured) > 10.0 * reference.known_to
    assert study.to_json()["reference"]["because"] == "joint_1 has friction with a memory (coulomb_friction)"
