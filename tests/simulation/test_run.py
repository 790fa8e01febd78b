"""Runs that no engine comes to the end of, and the step that others take."""

from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import assembled, build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.effects import EffectRow
from mbexport.core.errors import RefusedError
from mbexport.core.kinematics import dynamics
from mbexport.core.representation import Drive, Inertia, Term
from mbexport.core.simulation import backend_named, backend_names, simulate
from mbexport.core.simulation.step import largest_eigenvalue

ENGINES = [name for name in backend_names() if backend_named(name).runs]


@pytest.mark.parametrize("engine", ENGINES)
def test_gains_that_throw_an_arm_about_are_refused_in_words(engine):
    wild = Control("pd", kp=(1.0e7, 1.0e7), kd=(0.0, 0.0), rate=200.0)
    with pytest.raises(RefusedError, match=r"no longer finite at t = 0\.0\d+ s: take a smaller step or weaker gains"):
        simulate(build(load("planar2r"), "rigid"), engine, "excitation", wild, duration=1.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_rigid_joints_pass_on_is_what_their_arms_take_beside_a_soft_drive_whose_gear_errs(engine):
    """A spring pulls the arm of the rigid joint; speeds and accelerations are differences of the run's positions."""
    stiffness, rest = 30.0, 0.2
    rows = {
        "rotor_inertia": tuple(EffectRow(at, {"inertia": 0.05}) for at in (1, 2)),
        "joint_compliance": (EffectRow(1, {"stiffness": 4000.0, "damping": 8.0}),),
        "transmission_error": (EffectRow(1, {"amplitude": 0.003, "cycles": 5.0, "phase": 0.4}),),
        "joint_spring": (EffectRow(2, {"stiffness": stiffness, "rest": rest}),),
    }
    robot = assembled(load("planar2r"), rows)
    control = Control("pd", kp=(900.0, 400.0), kd=(60.0, 25.0), rate=1000.0)
    run = simulate(robot, engine, "excitation", control, duration=0.6, rate=1000.0)
    q = run.joints["q_link"]
    dq = np.gradient(q, run.t, axis=0)
    ddq = np.gradient(dq, run.t, axis=0)
    arms = dynamics(robot)
    takes = (arms.mass_matrix(q) @ ddq[..., None])[..., 0] + arms.bias(q, dq)
    takes[:, 1] += stiffness * (q[:, 1] - rest)
    inside = slice(5, -5)
    assert run.joints["tau_link"][inside] == pytest.approx(takes[inside], abs=2e-3 * np.abs(takes).max())


@pytest.mark.parametrize("engine", ENGINES)
def test_what_brakes_an_arm_is_borne_by_the_drive_that_moves_it_as_it_is_told(engine):
    """A law of others that acts on the arm and goes with its speed."""
    robot = build(load("planar2r"), "rigid")
    first, last = robot.stages
    pushes = Term("stribeck_friction", "level", "arm", (3.0, 0.5))
    pushed = replace(robot, stages=(first, replace(last, drive=replace(last.drive, terms=(pushes,)))))
    free, borne = (simulate(one, engine, "excitation", duration=0.3).joints for one in (robot, pushed))
    less = free["tau_link"] - borne["tau_link"]
    assert less[:, 1] == pytest.approx(3.0 * np.exp(-np.square(free["dq"][:, 1] / 0.5)), abs=1e-9)
    assert less[:, 0] == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(less[:, 1]) > 0.1


def fastest(mass):
    """Largest root of det(M s^2 + B s + K) = 0 of two arms behind their springs, whose motor sides go as they will."""
    stiffness, damping = (2500.0, 900.0), (4.0, 0.8)
    (a, b), (c, d) = ([np.poly1d([mass[i, j], 0.0, 0.0]) for j in (0, 1)] for i in (0, 1))
    own = [np.poly1d([0.0, damping[i], stiffness[i]]) for i in (0, 1)]
    return float(np.abs(((a + own[0]) * (d + own[1]) - b * c).roots).max())


@pytest.mark.parametrize("compiled", [False, True])
def test_the_largest_eigenvalue_is_that_of_the_worst_pose(compiled):
    """Of each pose by the roots of its characteristic polynomial, of an arm whose inertia goes with its pose."""
    robot = build(load("planar2r"), "compliant")
    poses = np.array([[0.3, 1.5], [0.0, 0.0], [-0.4, 3.0]])
    options = {"imposed": True, "bristles": True, "compiled": compiled}
    expected = [fastest(dynamics(robot).mass_matrix(pose)) for pose in poses]
    for pose, value in zip(poses, expected, strict=True):
        assert largest_eigenvalue(robot, poses=pose[None], **options) == pytest.approx(value, rel=1e-9)
    assert largest_eigenvalue(robot, poses=poses, **options) == pytest.approx(max(expected), rel=1e-9)
    assert max(expected) > 1.01 * expected[0]


def test_a_joint_that_moves_nothing_is_refused_with_the_pose():
    """Where the last arm weighs nothing no torque of its joint has anything to accelerate."""
    robot = build(load("planar2r"), "compliant")
    first, last = robot.stages
    empty = replace(last, arm=replace(last.arm, inertia=Inertia()), drive=Drive(damping=0.1))
    poses = np.array([[0.25, 0.5], [0.0, 0.0]])
    with pytest.raises(RefusedError, match=r"moves no inertia at all at q = \[0\.25, 0\.5\]"):
        largest_eigenvalue(replace(robot, stages=(first, empty)), imposed=False, poses=poses, bristles=True)
