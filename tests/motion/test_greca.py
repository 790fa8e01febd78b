"""The Greek key: its picture in space, its derivatives, and what it says where it cannot be drawn."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mbexport.core.database import Database
from mbexport.core.errors import UsageError
from mbexport.core.kinematics import kinematics, reach
from mbexport.core.motion import MotionLaw, greca
from mbexport.core.motion.greca import KNOT_SPACING, meander
from mbexport.core.motion.tables import law_of_table, table_of_law
from mbexport.core.representation import Arm, Joint, Pose, Robot, Stage, VeitscheggerWu

ROBOTS = ("imece2013", "puma560", "arm7", "scara", "planar2r")


@pytest.fixture(scope="module")
def drawn(rigid: Callable[[str], Robot]) -> Callable[[str], MotionLaw]:
    return cache(lambda name: greca(rigid(name)))


def in_its_plane(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Coordinates of points in the plane that fits them best, and how far the worst is from it."""
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    return centred @ axes[:2].T, float(np.abs(centred @ axes[2]).max())


def test_meander_is_a_greek_key() -> None:
    corners = meander(3)
    edges = np.diff(corners, axis=0)
    assert len(corners) == 25
    assert np.all((edges == 0).sum(axis=1) == 1)  # along x or y, never both
    assert np.all(np.einsum("ij,ij->i", edges[1:], edges[:-1])[7::8] >= 0)  # cells go on, they do not turn back
    points = {tuple(corner) for corner in corners}
    assert len(points) == len(corners)  # it never crosses itself at a corner
    assert np.allclose((corners.min(axis=0) + corners.max(axis=0)) / 2, 0)


@pytest.mark.parametrize("name", ROBOTS)
def test_draws_the_meander(rigid: Callable[[str], Robot], drawn: Callable[[str], MotionLaw], name: str) -> None:
    robot, law = rigid(name), drawn(name)
    chain = kinematics(robot)
    # corners are where the tool rests
    q, dq, ddq = law.at(law.knots)
    resting = np.abs(dq).max(axis=1) < 1e-12
    corners = chain.tool_in_base(q[resting])[:, :3, 3]
    want = meander(2)
    assert len(corners) == len(want)
    unit = np.linalg.norm(corners[1] - corners[0]) / 3.0
    lengths = np.linalg.norm(corners[:, None] - corners[None], axis=-1)
    assert np.allclose(lengths, unit * np.linalg.norm(want[:, None] - want[None], axis=-1), rtol=0, atol=1e-12)
    assert np.allclose(ddq[resting], 0.0, atol=1e-12)
    # between knots it stays on its edges, in one plane
    t = np.linspace(0.0, law.duration, 3001)
    tools = chain.tool_in_base(law.at(t)[0])
    _, off = in_its_plane(tools[:, :3, 3])
    assert off < 1e-8
    ends = np.flatnonzero(resting) * KNOT_SPACING
    for i in range(len(corners) - 1):
        on_edge = tools[(t >= ends[i]) & (t <= ends[i + 1]), :3, 3] - corners[i]
        direction = (corners[i + 1] - corners[i]) / np.linalg.norm(corners[i + 1] - corners[i])
        assert np.linalg.norm(on_edge - np.outer(on_edge @ direction, direction), axis=1).max() < 1e-8
        assert np.diff(on_edge @ direction).min() > -1e-9  # never backwards
    if robot.n >= 3:
        assert np.abs(tools[:, :3, :3] - tools[0, :3, :3]).max() < 1e-8  # the tool keeps its orientation
    assert 4.0 <= law.duration <= 8.0


@pytest.mark.parametrize("name", ROBOTS)
def test_keeps_limits_and_rests_at_the_ends(
    rigid: Callable[[str], Robot], drawn: Callable[[str], MotionLaw], name: str
) -> None:
    robot, law = rigid(name), drawn(name)
    q, dq, _ = law.at(np.linspace(0.0, law.duration, 5001))
    for i, stage in enumerate(robot.stages):
        assert stage.joint.lower <= q[:, i].min()
        assert q[:, i].max() <= stage.joint.upper
        assert np.abs(dq[:, i]).max() <= stage.joint.velocity
    for t in (0.0, law.duration):
        assert np.allclose(law.at(t)[1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["imece2013", "scara"])
def test_speeds_and_accelerations_by_differences(
    rigid: Callable[[str], Robot], drawn: Callable[[str], MotionLaw], name: str
) -> None:
    """Of the knots' numbers, which come from the Jacobian, against the positions that inverse kinematics found."""
    law = drawn(name)
    q, dq, ddq = law.at(law.knots)
    resting = np.abs(dq).max(axis=1) < 1e-12
    # five knots of one edge: a smooth function, differentiated to fourth order
    for k in range(2, len(q) - 2):
        if resting[k - 1 : k + 2].any():
            continue
        speed = (8 * (q[k + 1] - q[k - 1]) - q[k + 2] + q[k - 2]) / (12 * KNOT_SPACING)
        bend = (16 * (q[k + 1] + q[k - 1]) - q[k + 2] - q[k - 2] - 30 * q[k]) / (12 * KNOT_SPACING**2)
        assert np.allclose(speed, dq[k], atol=2e-3 * np.abs(dq).max())
        assert np.allclose(bend, ddq[k], atol=2e-2 * np.abs(ddq).max())


def test_paper_arm_draws_level_with_the_tool_down(
    rigid: Callable[[str], Robot], drawn: Callable[[str], MotionLaw]
) -> None:
    robot = rigid("imece2013")
    tools = kinematics(robot).tool_in_base(drawn("imece2013").at(np.linspace(0, 6, 100))[0])
    assert np.allclose(tools[:, :3, 2], [0, 0, -1], atol=1e-9)
    assert np.ptp(tools[:, 2, 3]) < 1e-8
    assert abs(tools[0, 1, 3]) == pytest.approx(0.14 * reach(robot), abs=1e-9)


def test_shipped_table_is_what_greca_gives(
    database: Callable[[str], Database], drawn: Callable[[str], MotionLaw]
) -> None:
    """examples/robots/imece2013/motions/greca.dat; `table_of_law` and `database.write` make it anew."""
    shipped = database("imece2013").motions["greca"]
    made = table_of_law(drawn("imece2013"))
    assert shipped.t == made.t
    for got, want in ((shipped.q, made.q), (shipped.dq, made.dq), (shipped.ddq, made.ddq)):
        assert np.allclose(got, want, rtol=0, atol=1e-12)
    law = law_of_table(shipped)
    t = np.linspace(0, 6.16, 500)
    # round-off of the knots' positions, by the spacing to the power of the derivative
    for power, (got, want) in enumerate(zip(law.at(t), drawn("imece2013").at(t), strict=True)):
        assert np.allclose(got, want, rtol=0, atol=1e-13 / KNOT_SPACING**power)


def test_slower_where_a_joint_is(rigid: Callable[[str], Robot]) -> None:
    robot = rigid("planar2r")
    stages = tuple(replace(stage, joint=replace(stage.joint, velocity=0.5)) for stage in robot.stages)
    slow = greca(replace(robot, stages=stages), duration=2.0)
    assert slow.duration > 6.0
    assert 0.4 < np.abs(slow.at(np.linspace(0, slow.duration, 3000))[1]).max() <= 0.5


def test_width_and_posture_are_obeyed(rigid: Callable[[str], Robot]) -> None:
    robot = rigid("planar2r")
    law = greca(robot, width=0.1, cells=1, duration=4.0, posture=(0.3, 1.2))
    x = kinematics(robot).tool_in_base(law.at(law.knots)[0])[:, :3, 3]
    assert np.linalg.norm(x[-1] - x[0]) == pytest.approx(0.1)
    centre = kinematics(robot).tool_in_base([0.3, 1.2])[:3, 3]
    assert np.linalg.norm((x.max(axis=0) + x.min(axis=0)) / 2 - centre) < 0.05
    # a 4 by 3 cell
    assert np.linalg.norm(x[:, None] - x[None], axis=-1).max() == pytest.approx(0.125)


def test_one_joint_draws_nothing(rigid: Callable[[str], Robot]) -> None:
    with pytest.raises(UsageError, match="pendulum has one joint"):
        greca(rigid("pendulum"))


def test_says_why_it_cannot() -> None:
    """Two crossing axes move the tool on a sphere: there is no plane."""
    stages = (
        Stage(Joint("joint_1"), Arm("arm_1", VeitscheggerWu(alpha=math.pi / 2))),
        Stage(Joint("joint_2"), Arm("arm_2", VeitscheggerWu(a=0.5))),
    )
    pan_tilt = Robot("pan_tilt", (0.0, 0.0, -9.81), Pose(), VeitscheggerWu(), stages)
    with pytest.raises(UsageError, match=r"pan_tilt cannot draw a Greek key .* m wide around any of"):
        greca(pan_tilt)


def test_says_that_it_is_too_wide(rigid: Callable[[str], Robot]) -> None:
    with pytest.raises(UsageError, match=r"cannot draw a Greek key 3 m wide.*tool at .* off"):
        greca(rigid("imece2013"), width=3.0)
