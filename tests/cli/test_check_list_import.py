"""The verbs that only read: check, list, import."""

from __future__ import annotations

from pathlib import Path

import pytest

from mbexport.core.database import built_in, load

URDF = """<robot name="two">
  <link name="base"/>
  <link name="upper">
    <inertial><origin xyz="0.1 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="lower">
    <inertial><origin xyz="0.1 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
  </joint>
</robot>
"""


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "two.urdf"
    path.write_text(URDF.format(mass=1))
    return path


def test_check_of_a_good_robot(mbexport):
    answer = mbexport("check", "imece2013")
    assert answer.status == 0
    assert "imece2013: 0 wrong" in answer.out


def test_check_of_a_wrong_robot_exits_1_and_tells_all(mbexport, tmp_path):
    robot = tmp_path / "wrong"
    robot.mkdir()
    (robot / "robot.yaml").write_text("name: wrong\ngravvity: [0, 0, -9.81]\n")
    (robot / "kinematics.dat").write_text("arm alpha a theta d\n1 0 one 0 0\n")
    (robot / "inertia.dat").write_text("arm mass x y z Ixx Iyy Izz\n1 -1 0 0 0 1 1 1\n")
    answer = mbexport("check", robot)
    assert answer.status == 1
    for said in ("robot.yaml:2", "gravity", "kinematics.dat:2", "'one'", "inertia.dat:2", "'-1'"):
        assert said in answer.out
    facts = mbexport("check", robot, "--json")
    assert facts.status == 1
    assert facts.json()["ok"] is False
    assert {problem["file"] for problem in facts.json()["problems"]} == {
        "robot.yaml",
        "kinematics.dat",
        "inertia.dat",
    }
    # a wrong robot is bad input to every other verb
    refused = mbexport("--to", "urdf", robot, "-o", tmp_path / "out")
    assert refused.status == 2
    assert "kinematics.dat:2" in refused.err
    assert not (tmp_path / "out").exists()


def test_check_of_nothing(mbexport):
    answer = mbexport("check", "no_such_robot", "--json")
    assert answer.status == 1
    assert "no_such_robot" in answer.out


def test_list_names_everything(mbexport):
    everything = mbexport("list", "--json").json()
    assert {row["name"] for row in everything["robots"]} == set(built_in())
    backends = {row["name"]: row for row in everything["backends"]}
    assert {"urdf", "mjcf", "exudyn", "pybullet"} <= set(backends)
    assert backends["urdf"]["engine"] == "Pinocchio"
    assert backends["mjcf"]["version"]
    assert {name for name, row in backends.items() if not row["runs"]} == {"adams", "fmu", "simscape"}
    effects = {row["name"]: row for row in everything["effects"]}
    assert "Fc sign(theta')" in effects["coulomb_friction"]["law"]
    for kind in ("backends", "effects", "robots"):
        told = mbexport("list", kind).out
        assert told.startswith(f"{kind}:\n")
        assert all(f"  {row['name']} " in told for row in everything[kind])
    told = {line.split()[0]: line for line in mbexport("list", "backends").out.splitlines()}
    assert "emits only" in told["adams"]
    assert "emits and runs" in told["mjcf"]
    assert "order 4; gates A" in told["mjcf"]


def test_a_broken_plugin_is_listed_and_hurts_nothing(mbexport, tmp_path, monkeypatch):
    (tmp_path / "broken_plugin.py").write_text("raise RuntimeError('no licence server')\n")
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[mbexport.backends]\nghost = broken_plugin:Ghost\n[mbexport.effects]\nspook = broken_plugin:Spook\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    answer = mbexport("list", "--json")
    assert answer.status == 0
    for kind, name in (("backends", "ghost"), ("effects", "spook")):
        rows = {row["name"]: row for row in answer.json()[kind]}
        assert "no licence server" in rows[name]["problem"]
        assert len(rows) > 1
    rows = {row["name"]: row for row in answer.json()["backends"]}
    assert "problem" not in rows["mjcf"]
    assert mbexport("--to", "urdf", "pendulum", "-o", tmp_path / "out").status == 0
    asked = mbexport("--to", "ghost", "pendulum", "-o", tmp_path / "other")
    assert asked.status == 2
    assert "no licence server" in asked.err


def test_import_makes_a_database(mbexport, urdf, tmp_path):
    answer = mbexport("import", urdf, "-o", tmp_path / "two")
    assert answer.status == 0
    assert "2 joints" in answer.out
    assert "joint_1 = shoulder" in answer.out
    assert load(tmp_path / "two").n == 2
    assert mbexport("check", tmp_path / "two").status == 0
    again = mbexport("import", urdf, "-o", tmp_path / "two")
    assert again.status == 2
    assert "--force" in again.err
    assert mbexport("import", urdf, "-o", tmp_path / "two.yaml", "--json").json()["robot"] == "two"
    assert load(tmp_path / "two.yaml") == load(tmp_path / "two")


def test_import_of_an_impossible_body(mbexport, tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(URDF.format(mass=0))
    kept = mbexport("import", path, "-o", tmp_path / "kept")
    assert kept.status == 0
    assert "it has no mass; kept as it stands" in kept.out
    assert load(tmp_path / "kept").inertia_check == "warn"
    repaired = mbexport("import", path, "-o", tmp_path / "repaired", "--repair")
    assert repaired.status == 0
    assert "repaired" in repaired.out
    assert load(tmp_path / "repaired").inertia_check == "error"


@pytest.mark.parametrize(
    ("text", "words", "said"),
    [
        ("<robot", [], "two.urdf"),
        ("<html></html>", [], "html"),
        (URDF.format(mass=1), ["--tip", "upperr"], "upper"),
        (None, [], "two.urdf"),
    ],
)
def test_import_of_bad_input(mbexport, tmp_path, text, words, said):
    path = tmp_path / "two.urdf"
    if text is not None:
        path.write_text(text)
    answer = mbexport("import", path, *words, "-o", tmp_path / "out")
    assert answer.status == 2
    assert said in answer.err
    assert not (tmp_path / "out").exists()
