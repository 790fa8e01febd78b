"""MJCF as people write it, imported, against MuJoCo's own reading."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mbexport.core.database import Database
from mbexport.core.importing import Imported, import_model

DOCUMENTED = """
<mujoco model="documentation style">
  <compiler angle="degree" eulerseq="zyx" autolimits="true"/>
  <option gravity="0.3 -0.2 -9.7" timestep="0.001"/>
  <default>
    <joint armature="0.1" damping="1"/>
    <geom density="700"/>
    <default class="wrist">
      <joint armature="0.02" frictionloss="0.5" axis="0 1 0"/>
      <geom type="capsule" size="0.03"/>
      <default class="finger">
        <joint type="slide" range="-0.02 0.05" stiffness="200" springref="0.01"/>
      </default>
    </default>
  </default>
  <asset><material name="metal"/></asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="plane" size="1 1 0.1"/>
    <body name="turret" pos="0.1 0.2 0.3" euler="20 -10 35">
      <joint name="pan" axis="0.1 0.2 1" range="-170 170" ref="15"/>
      <inertial pos="0.01 0.02 0.1" mass="4" fullinertia="0.05 0.06 0.04 0.005 -0.004 0.003"/>
      <body name="upper" pos="0 0.05 0.4" axisangle="1 1 0 40">
        <joint name="lift" pos="0.02 -0.03 0.01" axis="1 0 0" damping="2.5" range="-90 45"/>
        <geom type="box" size="0.04 0.05 0.2" pos="0.01 0 0.2" euler="10 20 30"/>
        <geom type="cylinder" size="0.05 0.1" pos="0 0.02 0.1" zaxis="1 2 3"/>
        <frame pos="0 0 0.05" xyaxes="0 1 0 -1 0.2 0">
          <geom type="ellipsoid" size="0.05 0.04 0.06" pos="0.02 0 0"/>
          <body name="fore" pos="0.02 0.01 0.4" quat="0.9 0.1 -0.3 0.2" childclass="wrist">
            <joint name="elbow" ref="-30" range="-150 10"/>
            <geom fromto="0 0 0 0.1 0.2 0.25"/>
            <geom type="sphere" size="0.06" mass="0.4" pos="0.1 0.2 0.25"/>
            <body name="camera" pos="0 0.1 0"><geom type="box" size="0.02 0.02 0.02"/></body>
            <body name="hand" pos="0.1 0.2 0.25" zaxis="1 -1 0.5">
              <joint name="grip" class="finger" axis="1 0.5 0" pos="0.3 0.2 0.1"/>
              <geom size="0.02 0.04"/>
              <inertial pos="0 0 0.03" mass="0.3" diaginertia="0.001 0.002 0.0015" euler="10 0 40"/>
              <site name="tcp" pos="0.01 0 0.12" euler="0 45 0"/>
            </body>
          </body>
        </frame>
      </body>
    </body>
    <body name="cup" pos="1 0 0"><freejoint/><geom size="0.05"/></body>
  </worldbody>
  <actuator>
    <motor joint="lift" gear="50" armature="1e-4" damping="2e-4"/>
    <position joint="elbow" kp="100"/>
  </actuator>
</mujoco>
"""

SETTINGS = """
<mujoco>
  <compiler angle="radian" eulerseq="XYz" inertiafromgeom="true" inertiagrouprange="0 1" boundmass="0.2"
            boundinertia="1e-3" balanceinertia="true" settotalmass="12"/>
  <worldbody>
    <body name="a" euler="0.1 0.2 0.3">
      <joint name="one" axis="0 0 -1"/>
      <inertial pos="5 5 5" mass="100" diaginertia="1 1 1"/>
      <geom type="box" size="0.1 0.2 0.3" group="1"/>
      <geom type="box" size="1 1 1" group="2"/>
      <body name="b" pos="0 0.5 0" euler="1.1 -0.7 0.4">
        <joint name="two" type="slide" axis="1 1 0"/>
        <inertial pos="0.1 0 0" mass="0.1" diaginertia="1e-4 1e-4 3e-4"/>
        <body name="c" pos="0.2 0 0.1">
          <joint name="three" axis="0 1e-6 1"/>
          <geom type="box" size="0.02" fromto="0 0 0 0.3 0.1 0"/>
          <geom type="ellipsoid" size="0.02" fromto="0.1 0 0 0.1 0.1 0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

SEVERAL_ON_ONE_BODY = """
<mujoco>
  <option><flag gravity="enable"/></option>
  <worldbody>
    <body name="a" pos="0 0 1" euler="30 0 0">
      <joint name="x" type="slide" axis="1 0 0" ref="0.2"/>
      <joint name="roll" axis="1 0.2 0" pos="0 0.1 0" ref="20"/>
      <joint name="pitch" axis="0 1 0" pos="0.1 0 0.1"/>
      <geom type="capsule" size="0.05 0.2" pos="0.1 0.1 0.2"/>
      <body name="b" pos="0.3 0 0.2"><joint name="last" axis="0 0 1"/><geom type="box" size="0.1 0.05 0.02"/></body>
    </body>
  </worldbody>
</mujoco>
"""


def joint_names(imported: Imported) -> list[str]:
    mapping = imported.remarks[0].removeprefix("joints: ")
    return [pair.split(" = ")[1] for pair in mapping.split(", ")]


def rotors(database: Database) -> np.ndarray:
    inertia = np.zeros(database.n)
    for row in database.effects.get("rotor_inertia", ()):
        inertia[row.at - 1] = row.values["inertia"]
    return inertia


def worst_errors(path: Path, imported: Imported, tip: str, site: bool, statics: Callable[..., Any]) -> list[float]:
    """Of tip, mass matrix with rotors, gravity and passive torques, against MuJoCo, over random states."""
    import mujoco

    database, names = imported.database, joint_names(imported)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    positions = [model.jnt_qposadr[model.joint(name).id] for name in names]
    speeds = [model.jnt_dofadr[model.joint(name).id] for name in names]
    rng = np.random.default_rng(3)
    worst = [0.0] * 4
    for _ in range(20):
        q, dq = rng.uniform(-2.0, 2.0, size=database.n), rng.uniform(-1.0, 1.0, size=database.n)
        data.qpos[:] = model.qpos0
        data.qpos[positions] = q
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        gravity = data.qfrc_bias[speeds].copy()
        data.qvel[speeds] = dq
        mujoco.mj_forward(model, data)
        passive = data.qfrc_passive[speeds].copy()
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        place = np.eye(4)
        seen = data.site(tip) if site else data.body(tip)
        place[:3, :3], place[:3, 3] = seen.xmat.reshape(3, 3), seen.xpos
        ours = statics(database, q)
        expected = np.zeros(database.n)
        for row in database.effects.get("viscous_friction", ()):
            expected[row.at - 1] -= row.values["coefficient"] * dq[row.at - 1]
        for row in database.effects.get("joint_spring", ()):
            expected[row.at - 1] -= row.values["stiffness"] * (q[row.at - 1] - row.values["rest"])
        pairs = [
            (ours.tip, place),
            (ours.mass + np.diag(rotors(database)), full[np.ix_(speeds, speeds)]),
            (ours.gravity, gravity),
            (expected, passive),
        ]
        for k, (mine, theirs) in enumerate(pairs):
            scale = max(1.0, float(np.abs(theirs).max())) if k else 1.0
            worst[k] = max(worst[k], float(np.abs(mine - theirs).max()) / scale)
    return worst


@pytest.mark.parametrize(
    ("text", "tip", "site"),
    [(DOCUMENTED, "tcp", True), (DOCUMENTED, "hand", False), (SETTINGS, "c", False), (SEVERAL_ON_ONE_BODY, "b", False)],
)
@pytest.mark.filterwarnings("ignore")
def test_the_import_is_the_original(
    text: str, tip: str, site: bool, statics: Callable[..., Any], model_file: Callable[..., Path]
) -> None:
    path = model_file(text)
    errors = worst_errors(path, import_model(path, tip), tip, site, statics)
    assert max(errors) < 1e-10, errors


def test_effects_and_limits_mean_the_same(model_file: Callable[..., Path]) -> None:
    database = import_model(model_file(DOCUMENTED), "tcp").database
    pan, _, elbow, grip = database.joints
    assert (pan.lower, pan.upper) == (-math.radians(170), math.radians(170))
    assert pan.home == math.radians(15)
    assert elbow.home == math.radians(-30)
    assert (grip.kind, grip.lower, grip.upper, grip.home) == ("prismatic", -0.02, 0.05, 0.0)
    assert database.gravity == (0.3, -0.2, -9.7)
    values = {name: {row.at: tuple(row.values.values()) for row in rows} for name, rows in database.effects.items()}
    assert values == {
        "coulomb_friction": {3: (0.5,), 4: (0.5,)},
        "joint_spring": {4: (200.0, 0.01)},
        "rotor_inertia": {1: (0.1,), 2: (0.1 + 50.0**2 * 1e-4,), 3: (0.02,), 4: (0.02,)},
        "viscous_friction": {1: (1.0,), 2: (2.5 + 50.0**2 * 2e-4,), 3: (1.0,), 4: (1.0,)},
    }


def test_what_cannot_be_said_is_listed(model_file: Callable[..., Path]) -> None:
    remarks = "\n".join(import_model(model_file(DOCUMENTED), "tcp").remarks)
    for said in (
        "they hang on what stands still: 'cup'",
        "'camera' is fixed to 'fore'",
        "actuators are left out",
        "geoms are left out",
        "joint_1 = pan, joint_2 = lift, joint_3 = elbow, joint_4 = grip",
    ):
        assert said in remarks


def test_arms_between_joints_of_one_body_have_no_mass(model_file: Callable[..., Path]) -> None:
    imported = import_model(model_file(SEVERAL_ON_ONE_BODY))
    assert [body.mass > 0.0 for body in imported.database.inertias] == [False, False, True, True]
    assert imported.database.inertia_check == "warn"
    assert any("'a' has 3 joints; arm_1 to arm_2" in remark for remark in imported.remarks)


def test_what_is_switched_off_stays_off(model_file: Callable[..., Path]) -> None:
    text = DOCUMENTED.replace(
        '<option gravity="0.3 -0.2 -9.7" timestep="0.001"/>',
        '<option gravity="0.3 -0.2 -9.7"><flag gravity="disable" spring="disable"/></option>',
    )
    database = import_model(model_file(text), "tcp").database
    assert database.gravity == (0.0, 0.0, 0.0)
    assert "joint_spring" not in database.effects
    assert "viscous_friction" in database.effects


def test_included_files_are_read_from_the_folder(model_file: Callable[..., Path], statics: Callable[..., Any]) -> None:
    model_file(
        '<mujocoinclude><body name="b"><joint name="j"/><geom type="box" size="1 2 3"/></body></mujocoinclude>',
        "parts/b.xml",
    )
    path = model_file('<mujoco><worldbody><include file="parts/b.xml"/></worldbody></mujoco>')
    assert max(worst_errors(path, import_model(path), "b", False, statics)) < 1e-10


def random_model(seed: int) -> str:
    """A chain of bodies with orientations written in all ways, joints of both kinds, and all solids."""
    rng = np.random.default_rng(seed)

    def numbers(count: int, scale: float = 1.0) -> str:
        return " ".join(repr(float(x)) for x in rng.normal(size=count) * scale)

    def turned() -> str:
        ways = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
        way = str(rng.choice(list(ways)))
        return f'{way}="{numbers(ways[way], 30.0 if way == "euler" else 1.0)}"'

    def joint(number: int) -> str:
        kind = rng.choice(["hinge", "slide"], p=[0.75, 0.25])
        near = rng.uniform() < 0.3
        axis = f"{10.0 ** rng.uniform(-9, -2)!r} 0 1" if near else numbers(3)
        return (
            f'<joint name="j{number}" type="{kind}" axis="{axis}" pos="{numbers(3, 0.2)}" ref="{numbers(1)}" '
            f'armature="{rng.uniform()!r}" damping="{rng.uniform()!r}" stiffness="{rng.uniform()!r}" '
            f'springref="{numbers(1)}"/>'
        )

    def solid() -> str:
        sizes = " ".join(repr(float(x)) for x in rng.uniform(0.05, 0.2, size=3))
        kind = str(rng.choice(["sphere", "capsule", "cylinder", "ellipsoid", "box"]))
        place = f'pos="{numbers(3, 0.2)}" {turned()}'
        if kind != "sphere" and rng.uniform() < 0.4:
            place = f'fromto="{numbers(6, 0.3)}"'
        weight = f'mass="{rng.uniform(0.1, 2.0)!r}"' if rng.uniform() < 0.5 else f'density="{rng.uniform(100, 3000)!r}"'
        return f'<geom type="{kind}" size="{sizes}" {place} {weight}/>'

    bodies, number = "", int(rng.integers(2, 6))
    for i in reversed(range(number)):
        joints = "".join(joint(3 * i + k) for k in range(int(rng.integers(1, 3))))
        solids = "".join(solid() for _ in range(int(rng.integers(1, 4))))
        bodies = f'<body name="b{i}" pos="{numbers(3, 0.4)}" {turned()}>{joints}{solids}{bodies}</body>'
    sequence = "".join(rng.choice(list("xyzXYZ"), size=3))
    return f'<mujoco><compiler eulerseq="{sequence}"/><worldbody>{bodies}</worldbody></mujoco>'


@pytest.mark.parametrize("seed", range(25))
def test_random_models(seed: int, statics: Callable[..., Any], model_file: Callable[..., Path]) -> None:
    text = random_model(seed)
    path = model_file(text)
    imported = import_model(path)
    tip = imported.remarks[1].split("'")[1]
    errors = worst_errors(path, imported, tip, False, statics)
    assert max(errors) < 1e-10, errors
