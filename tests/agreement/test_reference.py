"""The fifth voice by itself: against closed forms, and against the package's own mathematics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbexport.core.agreement.reference import UnreadError, out_and_back, read, unit_factor
from mbexport.core.build import build
from mbexport.core.database import load, write
from mbexport.core.kinematics import dynamics, joints_in_base, tool_in_base
from mbexport.core.motion import from_table


@pytest.fixture
def two_arms(tmp_path):
    """Two slender arms in a vertical plane, turning about the world's y; masses 3 and 2 kg, lengths 0.4 and 0.3 m."""
    (tmp_path / "robot.yaml").write_text(
        "name: two\ngravity: [0, 0, -9.81]\nbase: {xyz: [0, 0, 0], rpy: [1.5707963267948966, 0, 0]}\n"
    )
    (tmp_path / "kinematics.dat").write_text("arm alpha a[mm] theta d\n1 0 400 0 0\n2 0 300 0 0\n")
    (tmp_path / "inertia.dat").write_text(
        "arm mass[g] x y z Ixx Iyy Izz\n1 3000 -0.2 0 0 1e-9 0.04 0.04\n2 2000 -0.15 0 0 1e-9 0.015 0.015\n"
    )
    return tmp_path


def test_two_arms_have_the_closed_form(two_arms):
    tables = read(two_arms)
    q = np.array([[0.3, -0.7], [1.2, 2.0]])
    dq = np.array([[1.0, -2.0], [0.5, 0.3]])
    c2, s2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    a, b, d = 3 * 0.04 + 0.04 + 2 * 0.16, 2 * 0.0225 + 0.015, 2 * 0.4 * 0.15
    mass = np.array([[[a + b + 2 * d * c, b + d * c], [b + d * c, b]] for c in c2])
    assert np.allclose(tables.mass_matrix(q), mass, rtol=1e-14, atol=0)
    first, both = np.cos(q[:, 0]), np.cos(q.sum(axis=1))
    weight = 9.81 * np.stack([(3 * 0.2 + 2 * 0.4) * first + 2 * 0.15 * both, 2 * 0.15 * both], axis=1)
    assert np.allclose(tables.gravity_torque(q), weight, rtol=1e-14, atol=1e-14)
    coriolis = np.stack([-d * s2 * (2 * dq[:, 0] * dq[:, 1] + dq[:, 1] ** 2), d * s2 * dq[:, 0] ** 2], axis=1)
    assert np.allclose(tables.bias(q, dq), weight + coriolis, rtol=1e-13, atol=1e-13)
    tip = np.stack([0.4 * first + 0.3 * both, 0 * first, 0.4 * np.sin(q[:, 0]) + 0.3 * np.sin(q.sum(axis=1))], axis=1)
    assert np.allclose(tables.tool_in_world(q)[:, :3, 3], tip, atol=1e-15)


def test_speeds_give_no_energy(random_database, tmp_path):
    """dq^T (M' - 2 C) dq = 0: the power of Coriolis and centrifugal torques is the change of M alone."""
    tables = read(random_database(tmp_path, 3, 5))
    rng = np.random.default_rng(0)
    q, dq, h = rng.uniform(-1, 1, 5), rng.uniform(-1, 1, 5), 1e-5
    rate = (tables.mass_matrix(q + h * dq) - tables.mass_matrix(q - h * dq)) / (2 * h)
    power = dq @ (tables.bias(q, dq) - tables.gravity_torque(q))
    assert power == pytest.approx(0.5 * dq @ rate @ dq, rel=1e-7)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 8), st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
def test_it_says_what_reader_build_and_dynamics_say(random_database, tmp_path_factory, n, seed, modified, integral):
    effects = () if modified else ("payload", "link_inertia", "kinematic_error", "base_tilt")
    folder = random_database(tmp_path_factory.mktemp("robot"), seed, n, effects, modified, integral)
    tables, robot = read(folder), build(load(folder))
    arms = dynamics(robot)
    q, dq = np.random.default_rng(seed).uniform(-2, 2, (2, 4, n))
    mass = tables.mass_matrix(q)
    root = np.sqrt(np.einsum("kii->ki", mass))
    assert np.max(np.abs(mass - arms.mass_matrix(q)) / (root[:, :, None] * root[:, None, :])) < 1e-11
    weight = root.max(axis=0)
    gravity = tables.gravity_torque(q)
    assert np.max(np.abs(gravity - arms.gravity(q)) / weight) < 1e-11 * np.max(np.abs(gravity) / weight)
    bias = tables.bias(q, dq)
    assert np.max(np.abs(bias - arms.bias(q, dq)) / weight) < 1e-11 * np.max(np.abs(bias) / weight)
    assert np.max(np.abs(tables.tool_in_world(q) - robot.base.matrix() @ tool_in_base(robot, q))) < 1e-13
    if not modified:
        placed = tables.real_joints_in_world(0 * q)
        assert np.max(np.abs(placed - robot.base.matrix() @ joints_in_base(robot, 0 * q))) < 1e-13


def test_both_forms_of_a_database_read_alike(random_database, tmp_path):
    folder = random_database(tmp_path / "folder", 5, 4)
    write(load(folder), tmp_path / "robot.yaml", form="yaml")
    a, b = read(folder), read(tmp_path / "robot.yaml")
    assert a.kinds == b.kinds
    for name in ("rows", "corrections", "added", "rotor", "stiffness", "damping", "viscous", "coulomb", "rest"):
        # the written form is in SI, so that angles may differ in their last digit
        assert np.allclose(getattr(a, name), getattr(b, name), rtol=1e-15, atol=0), name
    q = np.ones(4)
    assert np.allclose(a.mass_matrix(q), b.mass_matrix(q), rtol=1e-13)


def test_tables_in_rows_of_mappings_and_beside_the_settings(tmp_path):
    (tmp_path / "robot.yaml").write_text(
        "name: one\n"
        "kinematics: [{arm: 1, 'alpha[deg]': 90, a: 0.5, theta: 0, d: 0}]\n"
        "inertia: [{arm: 1, mass: 2, x: 0, y: 0, z: 0, Ixx: 1, Iyy: 1, Izz: 1}]\n"
        "joint_compliance: [{joint: 1, stiffness: .inf}]\n"
        "effects/rotor_inertia: [{joint: 1, inertia: 3}]\n"
        "motions: {up: [[t, q1], [0, 1], [2, 3]]}\n"
    )
    tables = read(tmp_path / "robot.yaml")
    assert tables.rows[0, 0] == math.pi / 2
    assert tables.stiffness[0] == math.inf
    assert tables.rotor[0] == 3.0
    assert tables.motions["up"][1].tolist() == [[1.0], [3.0]]
    assert set(tables.effects) == {"joint_compliance", "rotor_inertia"}


def test_levels_and_effects(random_database, tmp_path):
    folder = random_database(tmp_path, 5, 3)
    with (folder / "robot.yaml").open("a") as file:
        file.write("levels: {bare: [payload]}\n")
    full, rigid, bare = read(folder), read(folder, level="rigid"), read(folder, level="bare")
    assert not rigid.effects and set(bare.effects) == {"payload"} and len(full.effects) == 10
    q = np.zeros(3)
    gained = np.linalg.eigvalsh(bare.mass_matrix(q) - rigid.mass_matrix(q))
    assert gained.min() > -1e-12 and gained.max() > 0.01
    assert np.array_equal(read(folder, ["payload"]).mass_matrix(q), bare.mass_matrix(q))


def test_rows_of_another_folder_replace_the_database_s(random_database, tmp_path):
    folder = random_database(tmp_path / "robot", 5, 3, ("viscous_friction",))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "viscous_friction.dat").write_text("joint coefficient\n2 77\n")
    (tmp_path / "other" / "payload.dat").write_text("robot mass\nrobot 5\n")
    before, after = read(folder), read(folder, replaced=tmp_path / "other")
    assert after.viscous[1] == 77.0
    assert np.array_equal(np.delete(after.viscous, 1), np.delete(before.viscous, 1))
    assert after.lumps[-1][1].mass == 5.0


def test_sag_is_the_equilibrium(random_database, tmp_path):
    tables = read(random_database(tmp_path, 8, 3, ("joint_compliance", "joint_spring")))
    theta = np.array([0.3, -0.4, 0.2])
    q = tables.sag(theta)
    load_ = tables.gravity_torque(q) + tables.spring * (q - tables.rest)
    elastic = np.isfinite(tables.stiffness)
    assert np.array_equal(q[~elastic], theta[~elastic])
    assert np.allclose((tables.stiffness * (theta - q))[elastic], load_[elastic], rtol=1e-9)


def test_friction_slides_or_is_smooth(random_database, tmp_path):
    tables = read(random_database(tmp_path, 8, 2, ("coulomb_friction", "viscous_friction"), friction="stick"))
    zero, speed = np.zeros(2), np.array([2.0, -3.0])
    _, motor = tables.drive_torque(zero, zero, zero, speed)
    assert np.allclose(motor, -tables.viscous * speed - tables.coulomb * np.sign(speed))


def test_units():
    assert unit_factor("deg") == math.pi / 180
    assert unit_factor("kg*mm^2") == pytest.approx(1e-6, rel=1e-15)
    assert unit_factor("N*m*s/rad") == 1.0
    assert unit_factor("N*mm/deg") == pytest.approx(1e-3 * 180 / math.pi)
    assert unit_factor("kg*m**2/(s*rad)") == 1.0
    assert unit_factor("g·mm²") == pytest.approx(1e-9)
    with pytest.raises(UnreadError, match="furlong"):
        unit_factor("furlong")


def test_it_says_what_it_cannot_read(tmp_path, two_arms):
    (two_arms / "effects").mkdir()
    (two_arms / "effects" / "warmth.dat").write_text("arm kelvin\n1 1\n")
    with pytest.raises(UnreadError, match="warmth"):
        read(two_arms)
    assert read(two_arms, []).n == 2


def test_out_and_back_is_the_law_of_quintics():
    start, turn = np.array([0.1, -0.2]), np.array([0.5, 0.3])
    law = from_table([0, 0.7, 1.4], [start, turn, start], np.zeros((3, 2)), np.zeros((3, 2)))
    t = np.linspace(0, 1.4, 57)
    q, dq = out_and_back(t, start, turn, 1.4)
    assert np.allclose(q, law.at(t)[0], atol=1e-14) and np.allclose(dq, law.at(t)[1], atol=1e-13)
