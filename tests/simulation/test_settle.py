"""Rest before a run begins: what nothing holds is refused by name."""

from dataclasses import replace

import numpy as np
import pytest

import mbexport
from mbexport.core.errors import RefusedError
from mbexport.core.kinematics import dynamics
from mbexport.core.simulation.settle import settled


def test_a_motor_that_gives_nothing_holds_nothing(recwarn):
    robot = mbexport.build(mbexport.load("pendulum"))
    stage = robot.stages[0]
    idle = replace(robot, stages=(replace(stage, drive=replace(stage.drive, gain=0.0)),))
    with pytest.raises(RefusedError, match="holds nothing at joint_1, whose drive gives no torque"):
        settled(idle, dynamics(idle), np.array([0.3]), np.array([60.0]), np.zeros(1))
    assert not recwarn.list


def test_a_motor_rests_where_its_gain_bears_the_weight():
    robot = mbexport.build(mbexport.load("pendulum"))
    arms = dynamics(robot)
    q, theta = settled(robot, arms, np.array([0.3]), np.array([60.0]), np.zeros(1))
    assert 60.0 * (0.3 - theta[0]) == pytest.approx(arms.gravity(q)[0], rel=1e-6)
