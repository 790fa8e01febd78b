"""Effects that change bodies and places, against matrices that are written here."""

import numpy as np
import pytest

from mbexport.core.errors import UsageError
from mbexport.core.kinematics import dynamics, kinematics


def turn(axis, angle):
    j, k = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[j, j] = matrix[k, k] = np.cos(angle)
    matrix[j, k], matrix[k, j] = -np.sin(angle), np.sin(angle)
    return matrix


def shift(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def rods(q, errors=((0.0,) * 5, (0.0,) * 5)):
    """Frames of planar2r's two arms in its base, alpha a theta d beta of each added to its own."""
    frame, frames = np.eye(4), []
    for angle, length, (alpha, a, theta, d, beta) in zip(q, (0.5, 0.4), errors, strict=True):
        frame = (
            frame @ turn(2, angle + theta) @ shift(0, 0, d) @ shift(length + a, 0, 0) @ turn(0, alpha) @ turn(1, beta)
        )
        frames.append(frame)
    return frames


Q = np.array([0.4, -0.9])


def test_a_kinematic_error_adds_to_the_five_parameters(robot_with):
    errors = ((0.01, 2e-3, -0.02, 3e-3, 0.015), (-0.02, 1e-3, 0.01, -2e-3, 0.03))
    names = ("alpha", "a", "theta", "d", "beta")
    table = {arm + 1: dict(zip(names, row, strict=True)) for arm, row in enumerate(errors)}
    robot = robot_with("planar2r", kinematic_error=table)
    np.testing.assert_allclose(kinematics(robot).tool_in_base(Q), rods(Q, errors)[-1], atol=1e-15)


def test_a_tilted_base_turns_gravity_the_other_way_in_the_base(robot_with):
    roll, pitch = 0.2, -0.1
    robot = robot_with("planar2r", base_tilt={0: {"roll": roll, "pitch": pitch}})
    base = turn(0, np.pi / 2) @ turn(0, roll) @ turn(1, pitch)
    np.testing.assert_allclose(robot.base.matrix(), base, atol=1e-15)
    # weight of both rods, by the work it does when a joint turns
    down = base[:3, :3].T @ np.array([0.0, 0.0, -9.81])
    centers = []
    for q in (Q, *(Q + 1e-6 * e for e in np.eye(2)), *(Q - 1e-6 * e for e in np.eye(2))):
        one, two = rods(q)
        centers.append((one @ [-0.25, 0, 0, 1])[:3] * 2.4 + (two @ [-0.2, 0, 0, 1])[:3] * 1.2)
    torque = [-down @ (centers[1 + i] - centers[3 + i]) / 2e-6 for i in range(2)]
    np.testing.assert_allclose(dynamics(robot).gravity(Q), torque, rtol=1e-8)


LOAD = {"mass": 0.7, "x": 0.03, "y": 0.02, "z": 0.05, "Ixx": 1e-3, "Iyy": 2e-3, "Izz": 1.5e-3, "Ixy": 1e-4}


def about_axis(frame, origin, axis, mass, com, tensor):
    """Moment of inertia of a body about an axis (Steiner)."""
    arm = np.cross(axis, (frame @ [*com, 1.0])[:3] - origin)
    turned = frame[:3, :3].T @ axis
    return mass * arm @ arm + turned @ tensor @ turned


def test_a_payload_is_one_more_body_on_the_last_arm(robot_with):
    bare, loaded = robot_with("planar2r"), robot_with("planar2r", payload={0: LOAD})
    frame = rods(Q)[-1]
    com = np.array([LOAD["x"], LOAD["y"], LOAD["z"]])
    tensor = np.diag([LOAD["Ixx"], LOAD["Iyy"], LOAD["Izz"]])
    tensor[0, 1] = tensor[1, 0] = LOAD["Ixy"]
    z = np.array([0.0, 0.0, 1.0])
    added = dynamics(loaded).mass_matrix(Q) - dynamics(bare).mass_matrix(Q)
    # the joints' axes are z of the base, at its origin and at the first arm's end
    for i, origin in enumerate((np.zeros(3), rods(Q)[0][:3, 3])):
        assert added[i, i] == pytest.approx(about_axis(frame, origin, z, 0.7, com, tensor), rel=1e-12)
    weight = np.array([0.0, -9.81, 0.0])
    place = (frame @ [*com, 1.0])[:3]
    torque = [-0.7 * weight @ np.cross(z, place - origin) for origin in (np.zeros(3), rods(Q)[0][:3, 3])]
    np.testing.assert_allclose(dynamics(loaded).gravity(Q) - dynamics(bare).gravity(Q), torque, atol=1e-13)


def test_link_inertia_adds_to_ten_parameters_about_the_frame(robot_with):
    # the same body in the other way of writing it: first moments and tensor about the frame's origin
    com = np.array([LOAD["x"], LOAD["y"], LOAD["z"]])
    m = LOAD["mass"]
    row = {"mass": m, "mx": m * com[0], "my": m * com[1], "mz": m * com[2]}
    row |= {
        "Ixx": LOAD["Ixx"] + m * (com[1] ** 2 + com[2] ** 2),
        "Iyy": LOAD["Iyy"] + m * (com[0] ** 2 + com[2] ** 2),
        "Izz": LOAD["Izz"] + m * (com[0] ** 2 + com[1] ** 2),
        "Ixy": LOAD["Ixy"] - m * com[0] * com[1],
        "Ixz": -m * com[0] * com[2],
        "Iyz": -m * com[1] * com[2],
    }
    as_load, as_link = robot_with("planar2r", payload={0: LOAD}), robot_with("planar2r", link_inertia={2: row})
    q, dq, ddq = np.array([0.3, 1.1]), np.array([0.7, -1.3]), np.array([2.0, 1.0])
    torques = [dynamics(robot).inverse_dynamics(q, dq, ddq) for robot in (as_load, as_link)]
    np.testing.assert_allclose(*torques, rtol=1e-12)
    # and it may be negative, as an error of parameters is, but not make a body that cannot be
    lighter = robot_with("planar2r", link_inertia={1: {"mass": -0.5, "mx": 0.1, "Iyy": -0.01, "Izz": -0.01}})
    assert lighter.stages[0].arm.inertia.mass == pytest.approx(1.9)
    with pytest.raises(UsageError, match="arm_1 becomes impossible"):
        robot_with("planar2r", link_inertia={1: {"mass": -3.0}})
