"""The built-in robots against what was published of them."""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from mbexport.core.database import built_in, check, load

QN = [0.0, math.pi / 4, math.pi, 0.0, math.pi / 4, 0.0]

# Corke, Robotics, Vision and Control, and the tests of his toolbox: at QN, gravity 9.81 m/s^2, rotors included
PUBLISHED_GRAVITY = [0.0, 31.6399, 6.0351, 0.0, 0.0283, 0.0]
PUBLISHED_MASS = [
    [3.6594, -0.4044, 0.1006, -0.0025, 0.0, 0.0],
    [-0.4044, 4.4137, 0.3509, 0.0, 0.0024, 0.0],
    [0.1006, 0.3509, 0.9378, 0.0, 0.0015, 0.0],
    [-0.0025, 0.0, 0.0, 0.1925, 0.0, 0.0],
    [0.0, 0.0024, 0.0015, 0.0, 0.1713, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.1941],
]


def test_there_are_these():
    assert built_in() == ("arm7", "imece2013", "pendulum", "planar2r", "puma560", "scara")


@pytest.mark.parametrize("name", built_in())
def test_nothing_is_wrong_or_suspicious(name: str):
    assert check(name) == ()
    robot = load(name)
    assert robot.name == name
    assert robot.source
    for joint in robot.joints:
        assert math.isfinite(joint.velocity)
        assert math.isfinite(joint.effort)


@pytest.mark.parametrize("name", built_in())
def test_every_table_has_a_level_that_uses_it(name: str):
    robot = load(name)
    assert {effect for level in robot.levels.values() for effect in level} >= set(robot.effects) - {"rotor_inertia"}


def published_puma(folder: Path) -> Path:
    """The Puma's folder with the two completed rows as they were published."""
    shutil.copytree(load("puma560").folder or Path(), folder)
    table = (folder / "inertia.dat").read_text()
    published, count = re.subn(r"(?m)^1 .*$", "1 0 0 0 0 0 0.35 0", table)
    assert count == 1
    published, count = re.subn(r"(?m)^(3 .*)0\.0201$", r"\g<1>0.0125", published)
    assert count == 1
    (folder / "inertia.dat").write_text(published)
    with (folder / "robot.yaml").open("a") as settings:
        settings.write("inertia_check: warn\n")
    return folder


def mass_matrix(robot, chain, q):
    rotors = {row.at: row.values["inertia"] for row in robot.effects["rotor_inertia"]}
    return chain(robot, q).mass_matrix() + np.diag([rotors[joint] for joint in range(1, robot.n + 1)])


def test_the_published_puma(chain, tmp_path: Path):
    robot = load(published_puma(tmp_path / "puma"))
    assert np.allclose(chain(robot, QN).gravity_load(), PUBLISHED_GRAVITY, rtol=0, atol=6e-5)
    assert np.allclose(mass_matrix(robot, chain, QN), PUBLISHED_MASS, rtol=0, atol=6e-5)


def test_what_completing_the_puma_changes(chain, tmp_path: Path):
    ours, published = load("puma560"), load(published_puma(tmp_path / "puma"))
    rng = np.random.default_rng(560)
    for _ in range(20):
        q = rng.uniform(-3, 3, 6)
        change = chain(ours, q).mass_matrix() - chain(published, q).mass_matrix()
        expected = np.zeros((6, 6))
        expected[0, 0] = 0.0076 * math.cos(q[1] + q[2]) ** 2
        assert np.allclose(change, expected, rtol=0, atol=1e-14)
        assert np.allclose(chain(ours, q).gravity_load(), chain(published, q).gravity_load(), rtol=0, atol=1e-13)


def test_the_puma_s_drives_are_the_motors_through_their_gears():
    gears = [62.6111, 107.815, 53.7063, 76.0364, 71.923, 76.686]
    rotors = [200e-6] * 3 + [33e-6] * 3
    viscous = [1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6]
    coulomb = [
        (0.395, 0.435),
        (0.126, 0.071),
        (0.132, 0.105),
        (11.2e-3, 16.9e-3),
        (9.26e-3, 14.5e-3),
        (3.96e-3, 10.5e-3),
    ]
    effects = load("puma560").effects
    for i, g in enumerate(gears):
        assert effects["rotor_inertia"][i].values["inertia"] == pytest.approx(rotors[i] * g**2, rel=1e-14)
        assert effects["viscous_friction"][i].values["coefficient"] == pytest.approx(viscous[i] * g**2, rel=1e-14)
        assert effects["coulomb_friction"][i].values["torque"] == pytest.approx(sum(coulomb[i]) / 2 * g, rel=1e-14)


def paper_tables() -> dict[int, list[list[float]]]:
    """Number of a table to its rows, as the clean copy of the paper beside the repository has them."""
    path = Path(__file__).resolve().parents[3] / "shared" / "paper" / "tables.md"
    if not path.is_file():
        pytest.skip("the paper's tables do not stand beside the repository, in ../shared/paper")
    tables: dict[int, list[list[float]]] = {}
    current = 0
    for line in path.read_text().splitlines():
        title = re.match(r"Table (\d)", line)
        if title:
            current = int(title[1])
        elif re.fullmatch(r"[\d.eE+ -]+", line) and current:
            tables.setdefault(current, []).append([float(word) for word in line.split()])
    return tables


def test_the_paper_s_arm_is_the_paper_s():
    tables = paper_tables()
    assert sorted(tables) == [1, 2, 3, 4, 5, 6]
    robot = load("imece2013")
    for rows, parameters in ((tables[1], robot.kinematics), (tables[2], robot.corrections[1:])):
        for (_, alpha, a, theta, d, beta), row in zip(rows, parameters, strict=True):
            assert (row.alpha, row.theta, row.beta) == pytest.approx(
                [math.radians(x) for x in (alpha, theta, beta)], rel=1e-15
            )
            assert (row.a, row.d) == (a, d)
    for com, mass, products, inertia in zip(tables[3], tables[4], tables[5], robot.inertias, strict=True):
        assert inertia.com == tuple(com[1:])
        assert (inertia.mass, inertia.xx, inertia.yy, inertia.zz) == tuple(mass[1:])
        assert (inertia.xy, inertia.xz, inertia.yz) == tuple(products[1:])
    for (joint, stiffness, damping), row in zip(tables[6], robot.effects["joint_compliance"], strict=True):
        assert row.at == joint
        assert (row.values["stiffness"], row.values["damping"]) == (stiffness, damping)
    assert all(joint.home == 0.0 for joint in robot.joints)


def test_the_planar_arm_by_hand(chain):
    """Two rods: M and g of the textbook's 2R arm, angles from the horizontal."""
    robot = load("planar2r")
    m1, m2, l1, c1, c2, i1, i2, g = 2.4, 1.2, 0.5, 0.25, 0.2, 0.05024, 0.01612, 9.81
    for q1, q2 in ((0.3, -1.1), (2.0, 0.4)):
        a = i1 + i2 + m1 * c1**2 + m2 * (l1**2 + c2**2)
        b, d = m2 * l1 * c2, i2 + m2 * c2**2
        mass = [[a + 2 * b * math.cos(q2), d + b * math.cos(q2)], [d + b * math.cos(q2), d]]
        load2 = m2 * c2 * g * math.cos(q1 + q2)
        here = chain(robot, [q1, q2])
        assert np.allclose(here.mass_matrix(), mass, rtol=1e-13)
        assert np.allclose(here.gravity_load(), [(m1 * c1 + m2 * l1) * g * math.cos(q1) + load2, load2], rtol=1e-13)


def test_the_pendulum_hangs_down(chain):
    robot = load("pendulum")
    here = chain(robot, [0.0])
    assert np.allclose(here.tip[:3, 3], [0, 0, 0.5], atol=1e-15)
    assert np.allclose(chain(robot, [0.5]).gravity_load(), [1.2 * 9.81 * 0.45 * math.sin(0.5)], rtol=1e-13)


def test_the_scara_s_quill_goes_down(chain):
    robot = load("scara")
    high, low = (chain(robot, [0.1, 0.2, d, 0.0]).tip for d in (0.0, 0.15))
    assert np.allclose(high - low, [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0.15], [0, 0, 0, 0]], atol=1e-15)


def test_homes_are_away_from_singularities(chain):
    for name in ("arm7", "puma560", "scara"):
        robot = load(name)
        q = np.array([joint.home for joint in robot.joints])
        columns = []
        for i in range(robot.n):
            step = np.zeros(robot.n)
            step[i] = 1e-6
            tip, back = chain(robot, q + step).tip, chain(robot, q - step).tip
            turn = tip[:3, :3] @ back[:3, :3].T
            spin = [turn[2, 1], turn[0, 2], turn[1, 0]]
            columns.append([*(tip[:3, 3] - back[:3, 3]) / 2e-6, *(np.array(spin) / 2e-6)])
        values = np.linalg.svd(np.array(columns).T, compute_uv=False)
        assert values[min(6, robot.n) - 1] > 0.05
