"""Real URDF files, imported, against Pinocchio's reading of the same files."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mbexport.core.database import Database, load, write
from mbexport.core.importing import import_model

DATA = pytest.importorskip("pybullet_data").getDataPath()

ROBOTS = [
    ("franka_panda/panda.urdf", "panda_grasptarget", 7),
    ("franka_panda/panda.urdf", "panda_leftfinger", 8),
    ("kuka_iiwa/model.urdf", None, 7),
    ("xarm/xarm6_robot.urdf", None, 6),
    ("xarm/xarm6_with_gripper.urdf", "link6", 6),
]


def file(name: str) -> Path:
    return Path(DATA) / name


def joint_names(remarks: tuple[str, ...]) -> list[str]:
    mapping = next(remark for remark in remarks if remark.startswith("joints: "))
    return [pair.split(" = ")[1] for pair in mapping.removeprefix("joints: ").split(", ")]


def original(path: Path, joints: list[str]) -> Any:
    """The file as Pinocchio reads it, all other joints held at zero."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(path))
    others = [i for i, name in enumerate(model.names) if i > 0 and name not in joints]
    return pinocchio.buildReducedModel(model, others, pinocchio.neutral(model))


def worst_errors(
    database: Database, path: Path, tip: str, joints: list[str], statics: Callable[..., Any]
) -> list[float]:
    """Of tip, mass matrix and gravity over random states, relative to the largest entry for the last two."""
    import pinocchio

    model = original(path, joints)
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in joints]
    rng = np.random.default_rng(7)
    worst = [0.0, 0.0, 0.0]
    for _ in range(20):
        q = rng.uniform(-math.pi, math.pi, size=len(joints))
        state = np.zeros(model.nq)
        state[order] = q
        ours = statics(database, q)
        pinocchio.framesForwardKinematics(model, data, state)
        mass = pinocchio.crba(model, data, state)
        mass = (np.triu(mass) + np.triu(mass, 1).T)[np.ix_(order, order)]
        gravity = pinocchio.computeGeneralizedGravity(model, data, state)[order]
        place = data.oMf[model.getFrameId(tip)].homogeneous
        for k, (mine, theirs) in enumerate([(ours.tip, place), (ours.mass, mass), (ours.gravity, gravity)]):
            scale = max(1.0, float(np.abs(theirs).max())) if k else 1.0
            worst[k] = max(worst[k], float(np.abs(mine - theirs).max()) / scale)
    return worst


@pytest.mark.parametrize(("name", "tip", "n"), ROBOTS)
def test_the_import_is_the_original(name: str, tip: str | None, n: int, statics: Callable[..., Any]) -> None:
    imported = import_model(file(name), tip)
    joints = joint_names(imported.remarks)
    assert imported.database.n == len(joints) == n
    tool = next(remark for remark in imported.remarks if remark.startswith("the tool stands at")).split("'")[1]
    assert max(worst_errors(imported.database, file(name), tool, joints, statics)) < 1e-10


def test_a_planted_fault_would_show(statics: Callable[..., Any]) -> None:
    """The comparison sees a micrometre, a gram and a product of inertia with the wrong sign."""
    imported = import_model(file("xarm/xarm6_robot.urdf"))
    joints = joint_names(imported.remarks)
    good = imported.database
    rows, bodies = good.kinematics, good.inertias
    longer = replace(good, kinematics=(rows[0], replace(rows[1], a=rows[1].a + 1e-6), *rows[2:]))
    heavier = replace(good, inertias=(*bodies[:-1], replace(bodies[-1], mass=bodies[-1].mass + 1e-3)))
    flipped = replace(good, inertias=(bodies[0], replace(bodies[1], yz=-bodies[1].yz), *bodies[2:]))
    for fault, signals in ((longer, {0, 1, 2}), (heavier, {1, 2}), (flipped, {1})):
        errors = worst_errors(fault, file("xarm/xarm6_robot.urdf"), "link6", joints, statics)
        assert {k for k, error in enumerate(errors) if error > 1e-8} == signals


@pytest.mark.parametrize(("name", "tip"), [(name, tip) for name, tip, _ in ROBOTS])
def test_what_is_written_is_read_again(name: str, tip: str | None, tmp_path: Path) -> None:
    database = import_model(file(name), tip).database
    write(database, tmp_path / "robot")
    assert load(tmp_path / "robot") == database


def test_limits_and_friction_arrive() -> None:
    database = import_model(file("xarm/xarm6_robot.urdf")).database
    first = database.joints[1]
    assert (first.lower, first.upper, first.velocity, first.effort) == (-2.059, 2.0944, 3.14, 50.0)
    assert [row.values["torque"] for row in database.effects["coulomb_friction"]] == [1.0] * 6
    assert [row.values["coefficient"] for row in database.effects["viscous_friction"]] == [1.0] * 6
    assert set(database.effects) == {"coulomb_friction", "viscous_friction"}


def test_two_arms_of_the_xarm_are_no_bodies() -> None:
    """As published, links 2 and 3 break the triangle: kept with a warning, or mended on demand."""
    kept = import_model(file("xarm/xarm6_robot.urdf"))
    assert kept.database.inertia_check == "warn"
    named = [remark for remark in kept.remarks if "no body can have this inertia" in remark]
    assert [remark.split(":")[0] for remark in named] == ["arm_2 (link2)", "arm_3 (link3)"]
    assert all("kept as it stands" in remark for remark in named)

    mended = import_model(file("xarm/xarm6_robot.urdf"), repair=True)
    assert mended.database.inertia_check == "error"
    assert sum("repaired: principal moments" in remark for remark in mended.remarks) == 2
    for i, (before, after) in enumerate(zip(kept.database.inertias, mended.database.inertias, strict=True)):
        assert (before == after) is (i not in {1, 2})
        low, middle, high = np.linalg.eigvalsh(after.tensor())
        assert low > 0.0
        assert high <= low + middle


def test_the_gripper_rides_on_the_last_arm() -> None:
    panda = import_model(file("franka_panda/panda.urdf"), "panda_hand")
    assert panda.database.inertias[-1].mass == pytest.approx(0.2 + 0.81 + 0.1 + 0.1)
    assert any("'panda_finger_joint1' at 0.0 m moves beside the chain" in remark for remark in panda.remarks)


def test_the_same_file_gives_the_same_database() -> None:
    first, second = (import_model(file("kuka_iiwa/model.urdf")) for _ in range(2))
    assert first == second
    assert first.database.content_hash() == second.database.content_hash()
    assert DATA not in first.database.source + " ".join(first.remarks)
