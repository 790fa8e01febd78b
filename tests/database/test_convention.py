"""The modified convention: an independent chain of Craig's rows moves as the standard one that is read from it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mbexport.core.database import load


def tables(rows, bodies, prismatic):
    kinematics = "arm alpha a theta d\n"
    inertia = "arm mass x y z Ixx Iyy Izz Ixy Ixz Iyz\n"
    joints = "joint type\n"
    for number, (row, body, slides) in enumerate(zip(rows, bodies, prismatic, strict=True), 1):
        t = body.tensor
        values = [body.mass, *body.com, t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]
        kinematics += f"{number} " + " ".join(repr(float(x)) for x in row) + "\n"
        inertia += f"{number} " + " ".join(repr(float(x)) for x in values) + "\n"
        joints += f"{number} {'prismatic' if slides else 'revolute'}\n"
    return {"kinematics.dat": kinematics, "inertia.dat": inertia, "joints.dat": joints}


@pytest.mark.parametrize("seed", range(6))
def test_the_same_robot(small, chain, craig, body, pose_of, seed: int):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    rows = rng.uniform(-1.5, 1.5, (n, 4))
    if seed % 2:
        rows[0, :2] = 0.0
        rows[:, 0] = np.round(rows[:, 0]) * math.pi / 2
    prismatic = [bool(x) for x in rng.integers(0, 2, n)]
    bodies = []
    for _ in range(n):
        points = rng.normal(size=(3, 5)) * 0.1
        second = points @ points.T
        bodies.append(body(float(rng.uniform(1, 5)), rng.normal(size=3) * 0.1, np.trace(second) * np.eye(3) - second))
    base_xyz, base_rpy, tool_xyz, tool_rpy = rng.uniform(-1, 1, (4, 3))
    settings = (
        f"name: craig\nkinematics_convention: modified\nbase: {{xyz: {base_xyz.tolist()}, rpy: {base_rpy.tolist()}}}\n"
        f"tool: {{xyz: {tool_xyz.tolist()}, rpy: {tool_rpy.tolist()}}}\n"
    )
    robot = load(small({"robot.yaml": settings, **tables(rows, bodies, prismatic)}))
    assert robot.kinematics_convention == "modified"
    assert all(row.beta == 0.0 for row in robot.kinematics)
    for _ in range(5):
        q = rng.uniform(-2, 2, n)
        ours = chain(robot, q)
        his = craig(rows, bodies, prismatic, q, pose_of(base_xyz, base_rpy), pose_of(tool_xyz, tool_rpy))
        assert np.allclose(ours.tip, his.tip, rtol=0, atol=1e-13)
        assert np.allclose(ours.mass_matrix(), his.mass_matrix(), rtol=0, atol=1e-12)
        assert np.allclose(ours.gravity_load(), his.gravity_load(), rtol=0, atol=1e-12)


def test_the_base_stays_to_the_bit_where_it_takes_nothing_up(small):
    text = "name: craig\nkinematics_convention: modified\nbase: {xyz: [0.1, 0.2, 0.3], rpy: [0.1, 0.2, 0.3]}\n"
    table = "arm alpha a theta d\n1 0 0 0 0.2\n2 -1.5707963267948966 0.3 0 0.1\n"
    robot = load(small({"robot.yaml": text, "kinematics.dat": table}))
    assert robot.base.xyz == robot.base.rpy == (0.1, 0.2, 0.3)
    assert robot.kinematics[0].alpha == -math.pi / 2
    assert robot.kinematics[0].a == 0.3
    assert robot.kinematics[1].alpha == robot.kinematics[1].a == 0.0


def test_shapes_stay_where_they_are(small, pose_of):
    text = "name: craig\nkinematics_convention: modified\n"
    text += "visuals:\n  1:\n    - {kind: sphere, size: [0.1], xyz: [0.1, 0, 0]}\n"
    table = "arm alpha a theta d\n1 0 0 0 0.2\n2 1.5707963267948966 0.3 0 0\n"
    robot = load(small({"robot.yaml": text, "kinematics.dat": table, "joints.dat": None}))
    # Craig's frame 1 stands 0.2 m up; the sphere is 0.1 m along its x
    row, shape = robot.kinematics[0], robot.visuals[0][0]
    world = row.matrix() @ pose_of(shape.placement.xyz, shape.placement.rpy)
    assert np.allclose(world[:3, 3], [0.1, 0, 0.2], atol=1e-15)
