"""What is said of a gap: waves and their cycles, play, and amounts that cost nothing."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.diagnosis.contender import Contender
from mbexport.core.diagnosis.fit import blocks
from mbexport.core.diagnosis.found import Found
from mbexport.core.diagnosis.hypotheses import hypotheses
from mbexport.core.diagnosis.hypothesis import Hypothesis
from mbexport.core.diagnosis.nuisances import whitening
from mbexport.core.diagnosis.orders import _periodic, orders_of
from mbexport.core.diagnosis.problem import problem
from mbexport.core.diagnosis.refine import bounds_of, refined
from mbexport.core.diagnosis.scales import scales_of
from mbexport.core.kinematics import dynamics
from mbexport.core.recording import Run

from .pendulums import pendulum_run
from .searching import found, question, row


def test_the_cycles_of_a_gear_are_read_where_its_output_was_measured():
    """Its torque tells nothing here: there is none."""
    runs = [pendulum_run(seed=seed) for seed in (1, 2)]
    runs = [
        replace(run, signals=run.signals | {"q_link": gear(run.signals["q"])}, noise=dict(run.noise)) for run in runs
    ]
    asked = problem(load("pendulum"), "rigid", runs)
    cycles = [row(h)["cycles"] for h in hypotheses(asked, {}, scales_of(asked, {})) if h.effect == "transmission_error"]
    assert min(abs(one - 30.0) for one in cycles) < 0.5


def test_the_cycles_that_another_signal_shows_are_tried_beside_those_of_the_clearest(monkeypatch):
    """A slope of the torque is clear, with a side lobe less than a lobe from where the arm side's position waves."""
    asked = question()
    powers = {(False, True): ((0, 60.0), (7, 12.0)), (True, True): (), (True, False): ((11, 50.0),)}

    def periodic(problem, left, i, grid, *, itself, second):
        power = np.ones(len(grid))
        for place, height in powers[itself, second]:
            power[place] = height
        grids.append(grid)
        return power

    grids: list[np.ndarray] = []
    monkeypatch.setattr("mbexport.core.diagnosis.orders._periodic", periodic)
    tried = orders_of(asked, scales_of(asked, {}), 1, second=True)
    assert set(grids[0][[0, 7, 11]]) <= set(tried)
    # farther from its neighbour than a fit goes, nearer than a lobe is wide
    assert np.pi < (grids[0][11] - grids[0][7]) * scales_of(asked, {}).way[0] <= 2.0 * np.pi * (1.0 + 1e-9)


def test_a_wave_goes_through_most_of_itself():
    """One that only bends over the whole way would take the place of a spring, and of every law of the position."""
    asked = question(lambda t, q, dq: 0.5 * (q - 0.4) * (1.0 + 0.3 * (q - 0.4) ** 2))
    fewest = bounds_of(asked, "torque_ripple", 1, "cycles")[0]
    assert fewest == pytest.approx(0.75 * 2.0 * np.pi / asked.way()[0])
    state, _ = found(asked)
    assert state.found[0].effect == "joint_spring"


@pytest.mark.parametrize("torque", [0.4, -0.4])
def test_a_steady_torque_may_be_a_spring_that_pulls_from_far_away(torque):
    """Least squares may make it one that pushes, which none does: a fit begins from a soft one."""
    asked = question(lambda t, q, dq: torque, mode="motion")
    (spring,) = (one for one in hypotheses(asked, {}, scales_of(asked, {})) if one.effect == "joint_spring")
    begun = spring.rows(np.array([-0.01, -torque]))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    left = refined(asked, whiten, [Found(*spring.key, begun["joint_spring"][0], 50.0)], parts).left
    nothing = whiten(asked.residual({}))
    assert left @ left - len(left) < 0.002 * (nothing @ nothing)


def test_a_gear_error_of_few_cycles_on_short_ways_is_read_by_its_inertia_and_its_weight():
    t = np.arange(0.0, 4.0, 0.004)
    turn = 0.5 * np.sin(np.pi * t) + 0.2 * np.sin(2.3 * np.pi * t)
    runs, left = [], []
    for begin, way in ((0.2, 0.15), (1.9, 0.18)):
        q = begin + way * turn
        dq, ddq = (np.gradient(x, t) for x in (q, np.gradient(q, t)))
        error = 1e-3 * np.sin(7.0 * q + 0.4)
        # what no law of it says is told by differences
        bent = np.gradient(np.gradient(error, t), t)
        runs.append(SimpleNamespace(band=20.0, h=0.004, q=q[:, None], dq=dq[:, None], ddq=ddq[:, None]))
        left.append((0.3 * bent + 8.0 * error)[:, None])
    asked = SimpleNamespace(evidence=SimpleNamespace(runs=runs))
    grid = np.arange(2.0, 40.0, 0.25)

    def best(left, **parts):
        return grid[np.argmax(_periodic(asked, left, 0, grid, **parts))]

    assert best(left, itself=True, second=True) == 7.0
    # neither alone is what the motor feels
    assert best(left, itself=True, second=False) != 7.0
    assert best(left, itself=False, second=True) != 7.0
    assert not np.any(_periodic(asked, [0.0 * one for one in left], 0, grid, itself=True, second=True))


def test_a_screw_has_many_cycles_a_metre():
    """As radians: one of 6 mm makes 1047 of them, where no joint that turns has more than some hundred a turn."""
    arm = load("scara")
    t = np.arange(1001) / 250.0
    q = np.zeros((len(t), 4))
    q[:, 2] = 0.05 * (1.0 - np.cos(1.3 * t))
    tau = dynamics(build(arm, "rigid")).inverse_dynamics(q, np.gradient(q, t, axis=0), np.zeros_like(q))
    tau[:, 2] += 0.5 * np.sin(1047.0 * q[:, 2])
    tau += 0.01 * np.random.default_rng(1).normal(size=tau.shape)
    noise = {"q": np.full(4, 1e-6), "tau": np.full(4, 0.01)}
    run = Run("slides", t, {"q": q, "tau": tau}, Control("unknown"), noise, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    cycles = [row(h)["cycles"] for h in hypotheses(asked, {}, scales_of(asked, {})) if h.key == ("torque_ripple", 3)]
    assert min(abs(one - 1047.0) for one in cycles) < 0.1 * 2.0 * np.pi / 0.1


def gear(q):
    """What its output shows of a motor's position, with an error of 30 cycles a turn."""
    return q + 1e-4 * np.sin(30.0 * q)


def test_what_gives_is_plain_by_the_load_that_it_bears():
    """Solid round rods of 0.5 and 0.4 m; the second joint bears the second only."""
    robot = load("planar2r")
    t = np.arange(500) / 250.0
    q = np.column_stack([0.5 * np.sin(2.0 * t), 0.3 * np.sin(3.0 * t)])
    noise = {"q": np.full(2, 1e-4), "tau": np.full(2, 0.01)}
    run = Run("swing", t, {"q": q, "tau": np.zeros_like(q)}, Control("motion"), noise, (), {}, "", (), 250.0)
    scales = scales_of(problem(robot, "rigid", [run]), {})
    first, second = (inertia.mass for inertia in robot.inertias)
    assert scales.weight == pytest.approx(9.81 * np.array([first + second, second]))
    assert scales.lever == pytest.approx([0.9, 0.4])


def test_a_number_that_is_not_there_costs_nothing():
    least, nothing = np.array([0.0, 0.0, -np.inf]), np.zeros(0)
    bearing = Hypothesis("joint_compliance_6d", 1, "", lambda beta: {}, np.ones(3), least)
    contender = Contender(bearing, 50.0, 0.6, np.array([0.0, 0.5, 0.0]), nothing, 1.0)
    assert contender.numbers == 2
    assert contender.worth == pytest.approx(0.6 / 1.1)


def test_a_good_gears_play_is_within_a_factor_of_two_of_where_a_fit_begins():
    """Begun at two minutes of arc a fit left more than nothing did, and a play of one was never tried."""
    arm = load("planar2r")
    q = 0.5 * np.sin(2.0 * np.arange(1001) / 250.0)[:, None] * (1.0, 0.8)
    run = Run("swing", np.arange(1001) / 250.0, {"q": q, "tau": q}, Control("unknown"), {}, (), {}, "", (), 250.0)
    asked = problem(arm, "rigid", [run])
    plays = [one for one in hypotheses(asked, {}, scales_of(asked, {}), ()) if one.key == ("backlash", 1)]
    begun = [one.rows(np.zeros(1))["backlash"][0].values["gap"] for one in plays]
    minute = math.radians(1.0 / 60.0)
    assert min(abs(math.log(gap / minute)) for gap in begun) < math.log(2.0)
