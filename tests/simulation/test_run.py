"""Runs that no engine comes to the end of, and the step that others take."""

from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.control import Control
from mbexport.core.database import load
from mbexport.core.errors import RefusedError
from mbexport.core.kinematics import dynamics
from mbexport.core.representation import Drive, Inertia
from mbexport.core.simulation import backend_named, backend_names, simulate
from mbexport.core.simulation.step import largest_eigenvalue

ENGINES = [name for name in backend_names() if backend_named(name).runs]


@pytest.mark.parametrize("engine", ENGINES)
def test_gains_that_throw_an_arm_about_are_refused_in_words(engine):
    wild = Control("pd", kp=(1.0e7, 1.0e7), kd=(0.0, 0.0), rate=200.0)
    with pytest.raises(RefusedError, match=r"no longer finite at t = 0\.0\d+ s: take a smaller step or weaker gains"):
        simulate(build(load("planar2r"), "rigid"), engine, "excitation", wild, duration=1.0)


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
