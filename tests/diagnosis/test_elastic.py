"""Arms behind springs along a recorded motion, against an integrator of SciPy's."""

import math
from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.diagnosis.elastic import mass_matrix_among
from mbexport.core.diagnosis.inverse import _gives
from mbexport.core.diagnosis.problem import problem
from mbexport.core.effects import EffectRow
from mbexport.core.export import export
from mbexport.core.kinematics import dynamics
from mbexport.core.kinematics.rigid_body import place_joints

from .pendulums import INERTIA, WEIGHT, soft_run


@pytest.mark.parametrize("omega", [20.0, 45.0])
def test_seconds_of_ringing_stay_in_phase(omega):
    """Sampled at 250 Hz; a period that is too long by (omega h)^2 / 12 leaves many times the noise after 4 s."""
    stiffness, damping = INERTIA * omega**2, 0.05
    run = soft_run(stiffness, damping, noisy=False)
    asked = problem(load("pendulum"), "rigid", [run])
    row = EffectRow(1, {"stiffness": stiffness, "damping": damping})
    rigid, soft = (asked.residual(rows) for rows in ({}, {"joint_compliance": (row,)}))
    assert np.mean(rigid**2) > 100.0
    assert np.mean(soft**2) < 0.2


def test_a_spring_much_stiffer_than_the_record_is_fast_is_rigid():
    run = soft_run(INERTIA * 4000.0**2, 0.0, noisy=False)
    asked = problem(load("pendulum"), "rigid", [run])
    row = EffectRow(1, {"stiffness": INERTIA * 4000.0**2, "damping": 0.0})
    rigid, hard = (asked.residual(rows) for rows in ({}, {"joint_compliance": (row,)}))
    assert np.mean((hard - rigid) ** 2) < 0.1


@pytest.mark.parametrize("weight", [0.0, WEIGHT])
def test_an_arm_that_floats_in_its_clearance_is_caught_and_not_thrown(weight):
    """A contact of 500 Hz, a record of 250 Hz: followed as it is, it would throw the arm back ever harder."""
    gap, omega = 0.002, 2.0 * np.pi * 500.0
    row = {"stiffness": INERTIA * omega**2, "damping": 0.3 * INERTIA * omega}
    run = soft_run(**row, gap=gap, weight=weight, duration=2.0)
    known = load("pendulum") if weight else replace(load("pendulum"), gravity=(0.0, 0.0, 0.0))
    asked = problem(known, "rigid", [run])
    (place,) = (c for c in asked.evidence.channels if c.signal == "q_link")

    def rows(size):
        return {"backlash": (EffectRow(1, row | {"gap": size}),)} if size else {}

    def left(size):
        return float(np.mean(asked.residual(rows(size))[place.first : place.last] ** 2))

    assert left(gap) < 0.01 * left(0.0)
    assert left(gap) < 0.1 * min(left(0.7 * gap), left(1.3 * gap))
    rigid, caught = (np.abs(asked.spoken(rows(size))[0].tau).max() for size in (0.0, gap))
    assert caught < 5.0 * rigid


@pytest.mark.parametrize(("name", "some"), [("arm7", [0, 3, 6]), ("scara", [1, 2]), ("puma560", [5])])
def test_the_mass_matrix_among_some_joints_is_pinocchios(name, some, tmp_path):
    """A sliding joint among them, and those before them still."""
    robot = build(load(name), "rigid")
    export(robot, ["urdf"], tmp_path)
    model = pinocchio.buildModelFromUrdf(str(next(tmp_path.rglob("*.urdf"))))
    data = model.createData()
    q = np.random.default_rng(4).uniform(-1.0, 1.0, model.nq)
    theirs = pinocchio.crba(model, data, q)
    theirs = np.triu(theirs) + np.triu(theirs, 1).T
    chain, n = dynamics(robot).table, robot.n
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    place_joints(chain, q, rotation, position)
    ours = np.empty((len(some), len(some)))
    mass_matrix_among(chain, np.array(some), rotation, position, ours)
    np.testing.assert_allclose(ours, theirs[np.ix_(some, some)], rtol=1e-9, atol=1e-12)


def test_what_an_engine_needs_where_a_gear_wobbles_gives_nothing():
    asked = problem(load("pendulum"), "rigid", [soft_run(INERTIA * 400.0, 0.05)])
    wave = EffectRow(1, {"amplitude": 1e-3, "cycles": 20.0, "phase": 0.0})
    spring = EffectRow(1, {"stiffness": 1e6, "damping": 1.0})
    play = EffectRow(1, {"gap": 1e-4, "stiffness": math.inf, "damping": math.inf})
    for beside, gives in (({}, False), ({"joint_compliance": (spring,)}, True), ({"backlash": (play,)}, True)):
        drive = asked.robots({"transmission_error": (wave,), **beside})[0].stages[0].drive
        assert _gives(drive) is gives
