"""What a user writes after --vary."""

from __future__ import annotations

import numpy as np
import pytest

from mbexport.core.errors import UsageError
from mbexport.core.study import parse_vary

K = "joint_compliance.stiffness"


def one(text, database):
    (parameter,) = parse_vary(text, database)
    return parameter


def test_factors_act_on_the_database(planar):
    parameter = one(f"{K}@joint_2=0.5:2:4", planar)
    assert (parameter.name, parameter.unit) == (f"{K}@joint_2", "N*m/rad")
    assert (parameter.scale * parameter.grid()).tolist() == pytest.approx([450.0, 900.0, 1350.0, 1800.0])


def test_a_unit_makes_values(planar):
    assert one(f"{K}[SI]@joint_2=100:200:2", planar).scale == 1.0
    millimetres = one("kinematics.a[mm]@arm_1=490:510:3", planar)
    assert (millimetres.scale * millimetres.grid()).tolist() == pytest.approx([0.49, 0.5, 0.51])
    degrees = one("kinematics.alpha[deg]@arm_1=-1:1:2", planar)
    assert (degrees.scale * degrees.grid()).tolist() == pytest.approx([-np.pi / 180, np.pi / 180])
    assert one("controller_gain.kp[SI]@joint_1=0.5:2:3", planar).unit == ""


def test_ends_are_as_written_and_logs_even(planar):
    x = one(f"{K}@joint_1=0.1:0.7:9:log", planar).grid()
    assert (x[0], x[-1]) == (0.1, 0.7)
    assert np.ptp(np.diff(np.log(x))) < 1e-12
    assert one(f"{K}@joint_1=0.1:0.7:9", planar).grid()[-1] == 0.7


def test_lists_and_single_values(planar):
    assert one(f"{K}@joint_1=2,0.5,1", planar).grid().tolist() == [2.0, 0.5, 1.0]
    fixed = one(f"{K}@joint_1=1.5", planar)
    assert fixed.fixed
    assert fixed.grid().tolist() == [1.5]
    assert [parameter.name for parameter in parse_vary(f"{K}@all=0.5:2:3", planar)] == [f"{K}@joint_1", f"{K}@joint_2"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nonsense", "is not NAME.COLUMN@PLACE=FROM:TO"),
        (f"{K}@joint_1", "is not NAME.COLUMN@PLACE=FROM:TO"),
        (f"{K}@joint_1=", "is not NAME.COLUMN@PLACE=FROM:TO"),
        (f"{K}@joint_1=a:2:3", "'a' is no finite number"),
        (f"{K}@joint_1=1:inf:3", "'inf' is no finite number"),
        (f"{K}@joint_1=2:0.5:3", "a range goes up, and 2.0 is not below 0.5"),
        (f"{K}@joint_1=1:1:3", "a range goes up"),
        (f"{K}@joint_1=1:2:1", "whole number from 2"),
        (f"{K}@joint_1=1:2:2.5", "whole number from 2"),
        (f"{K}@joint_1=1:2:3:lag", "not 'lag'"),
        (f"{K}@joint_1=1:2:3:log:4", "a range is FROM:TO"),
        (f"{K}[SI]@joint_1=-1:2:3:log", "above 0"),
        (f"{K}@joint_1=1,1", "twice"),
        (f"{K}@joint_1=-1:2:3", "stiffness must be above 0.0"),
        (f"{K}[kg]@joint_1=1:2:3", r"\[kg\] is no unit of stiffness, which is in N\*m/rad"),
        (f"{K}[nonsense]@joint_1=1:2:3", r"\[nonsense\] is no unit"),
        ("payload.mass@robot=1:2:3", r"has no value there.*'payload.mass\[kg\]@robot=FROM:TO:COUNT'"),
        ("kinematics.d@arm_1=1:2:3", r"has the value 0.0 there.*'kinematics.d\[m\]@arm_1"),
        ("corrections.alpha[deg]@arm_1=0:1:2", "would change the joint's motion"),
    ],
)
def test_a_wrong_range_is_one_error(planar, text, message):
    with pytest.raises(UsageError, match=message):
        parse_vary(text, planar)


def test_the_flange_may_be_anywhere(planar):
    assert one("corrections.alpha[deg]@arm_2=0:1:2", planar).high == 1.0
