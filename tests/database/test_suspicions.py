from __future__ import annotations

import numpy as np
import pytest

from mbexport.core.database import built_in, check, load
from mbexport.core.database.suspicions import home_moments

PRODUCTS = (
    "arm mass x y z Ixx Iyy Izz Ixy Ixz Iyz\n1 4 -.1 0 0 .02 .03 .03 1e-3 1e-3 1e-3\n2 2 0 0 .1 .01 .01 .005 0 0 0\n"
)
LIMITS = (
    "joint type lower[deg|m] upper[deg|m] velocity effort home\n1 revolute {} 5 80 {}\n2 prismatic {} 0.5 300 0.1\n"
)
GOOD = {"joints.dat": LIMITS.format("-170 170", "0", "0 0.4")}

SUSPICIOUS = {
    "gravity off": ({"robot.yaml": "name: small\ngravity: [0, 0, 0]\n"}, "no gravity"),
    "gravity of the moon": ({"robot.yaml": "name: small\ngravity: [0, 0, -1.62]\n"}, "on earth it is 9.81"),
    "gravity upwards": ({"robot.yaml": "name: small\ngravity: [0, 0, 9.81]\n"}, "points up"),
    "angle in degrees": ({"kinematics.dat": "arm alpha a theta d\n1 90 0.3 0 0.2\n2 0 0 0 0.1\n"}, "alpha[deg]"),
    "limits in degrees": ({"joints.dat": GOOD["joints.dat"].replace("[deg|m]", "")}, "in degrees?"),
    "center of mass in mm": (
        {"inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 4 -100 0 0 .02 .03 .03\n2 2 0 0 .1 .01 .01 .005\n"},
        "is it in mm?",
    ),
    "inertia in kg mm^2": (
        {"inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 4 -.1 0 0 2e4 3e4 3e4\n2 2 0 0 .1 .01 .01 .005\n"},
        "another unit",
    ),
    "tiny inertia": (
        {"inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 4 -.1 0 0 2e-10 3e-10 3e-10\n2 2 0 0 .1 .01 .01 .005\n"},
        "radius of gyration",
    ),
    "sign of the products open": (
        {"inertia.dat": PRODUCTS},
        "sign of the products of inertia is open",
    ),
    "no limit of position": ({"joints.dat": LIMITS.format("-170 170", "0", "-inf inf")}, "position for joint_2"),
    "no limit of effort": ({"joints.dat": GOOD["joints.dat"].replace("300", "inf")}, "effort for joint_2"),
    "home at a limit": ({"joints.dat": LIMITS.format("0 170", "0", "0 0.4")}, "home of joint_1 stands at a limit"),
    "very soft": ({"effects/joint_compliance.dat": "joint stiffness\n1 0.1\n"}, "very soft"),
    "very stiff": ({"effects/joint_compliance.dat": "joint stiffness\n2 1e12\n"}, "very stiff"),
    "effect without rows": ({"effects/joint_compliance.dat": "joint stiffness\n"}, "acts nowhere"),
    "motion leaves the limits": (
        {"motions/far.dat": "t q1 q2\n0 0 0\n1 1 0.1\n2 4 0.2\n3 5 0.2\n"},
        "at 2 knots, first at t = 2.0 s with 4.0",
    ),
    "a file that is not read": ({"inertias.dat": "arm mass\n"}, "is not read"),
    "a file of another kind among the effects": ({"effects/notes.txt": "x\n"}, "is not read"),
    "an arm without shape": ({"visuals.yaml": "1:\n  - {kind: sphere, size: [0.1]}\n"}, "no shape for arm_2"),
}  # fmt: skip


def test_a_good_robot_is_not_suspicious(small):
    assert check(small(GOOD)) == ()


@pytest.mark.parametrize("what", sorted(SUSPICIOUS))
def test_one_warning(small, what: str):
    files, says = SUSPICIOUS[what]
    folder = small({**GOOD, **files})
    (problem,) = check(folder)
    assert problem.severity == "warning"
    assert says in problem.message
    load(folder)


def test_a_stated_sign_is_not_open(small):
    settings = "name: small\nproducts_of_inertia: tensor\n"
    assert check(small({**GOOD, "inertia.dat": PRODUCTS, "robot.yaml": settings})) == ()


def test_errors_stand_before_warnings(small):
    found = check(small({"robot.yaml": "name: small\nx: 1\n", "inertias.dat": "arm\n"}))
    assert [problem.severity for problem in found] == ["error", "warning"]


@pytest.mark.parametrize("name", built_in())
def test_the_joints_moments_are_the_mass_matrix_s_diagonal(chain, name: str):
    robot = load(name)
    home = [joint.home for joint in robot.joints]
    assert np.allclose(home_moments(robot), np.diag(chain(robot, home).mass_matrix()), rtol=1e-12)
