from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from mbexport.core.build import build
from mbexport.core.database import Database, FrozenMap, check, load, load_effects, parse_motion, with_effects, write
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.errors import DatabaseError, RunFileError, UsageError


def test_defaults(small):
    robot = load(small())
    assert robot.n == 2
    assert robot.gravity == (0.0, 0.0, -9.81)
    assert robot.base.xyz == robot.base.rpy == robot.tool.xyz == robot.tool.rpy == (0.0, 0.0, 0.0)
    assert (robot.dummy_inertia, robot.friction.model, robot.friction.velocity) == (1.0, "stick", 1e-3)
    assert (robot.inertia_check, robot.products_of_inertia, robot.kinematics_convention) == (
        "error",
        "tensor",
        "standard",
    )
    assert len(robot.corrections) == 3
    assert robot.corrections == (type(robot.corrections[0])(),) * 3
    assert robot.joints[0].velocity == robot.joints[0].effort == math.inf
    assert robot.level_effects("full") == robot.level_effects("rigid") == ()


def test_joints_without_a_table_turn_without_limits(small):
    joints = load(small({"joints.dat": None})).joints
    assert [(j.kind, j.lower, j.upper, j.home) for j in joints] == [("revolute", -math.inf, math.inf, 0.0)] * 2


@pytest.mark.parametrize(
    ("limits", "home"), [("-1 2", 0.0), ("1 2", 1.5), ("-3 -1", -2.0), ("0.5 inf", 0.5), ("-inf -0.5", -0.5)]
)
def test_home_where_none_is_given(small, limits: str, home: float):
    folder = small({"joints.dat": f"joint lower upper\n1 {limits}\n2 -1 1\n"})
    assert load(folder).joints[0].home == home


def test_units_by_the_joint_s_kind(small):
    first, second = load(
        small({"joints.dat": "joint type velocity[deg/s|mm/s] effort[N*mm|kN]\n1 revolute 180 5\n2 prismatic 180 5\n"})
    ).joints
    assert (first.velocity, first.effort) == (math.pi, 0.005)
    assert (second.velocity, second.effort) == (0.18, 5000.0)


def test_one_unit_where_all_joints_are_of_its_kind(small):
    joints = load(small({"joints.dat": "joint lower[deg]\n1 -90\n2 -180\n"})).joints
    assert [joint.lower for joint in joints] == [-math.pi / 2, -math.pi]


def test_a_motion_s_units_go_by_column(small):
    text = "t[ms] q1[deg] q2[mm] dq1[deg/s] dq2[mm/s]\n0 0 0 0 0\n500 90 100 180 1\n"
    motion = load(small({"motions/wave.dat": text})).motions["wave"]
    assert motion.t == (0.0, 0.5)
    assert motion.q[1] == (math.pi / 2, 0.1)
    assert motion.dq is not None
    assert motion.dq[1] == (math.pi, 0.001)
    assert motion.ddq is None


SAME = {
    "order of columns": {"kinematics.dat": "d[m] theta[deg] arm a[m] alpha[deg]\n0.2 0 1 0.3 90\n0.1 0 2 0 0\n"},
    "comments and blank lines": {
        "kinematics.dat": "# table\n\n  arm alpha[deg] a[m] theta[deg] d[m]  # names\n\n1 90 0.3 0 0.2#1\n"
        "# no\n2 0 0 0 0.1\n\n"
    },
    "tabs": {"kinematics.dat": "arm\talpha[deg]\ta\ttheta\td\n1\t90\t0.3\t0\t0.2\n2\t0\t0\t0\t0.1"},
    "line ends of Windows and a byte order mark": {
        "kinematics.dat": b"\xef\xbb\xbfarm alpha[deg] a theta d\r\n1 90 0.3 0 0.2\r\n2 0 0 0 0.1\r\n",
        "robot.yaml": b"\xef\xbb\xbfname: small\r\n",
    },
    "spelling of numbers": {"kinematics.dat": "arm alpha[deg] a[mm] theta d\n1 +9.0e1 3.E2 -0 .2\n2 0 0 0 1e-1\n"},
    "a column with its default": {"kinematics.dat": "arm alpha[deg] a theta d beta\n1 90 .3 0 .2 0\n2 0 0 0 .1 0\n"},
    "zero corrections": {"corrections.dat": "arm alpha a theta d beta\n1 0 0 0 0 0\n2 0 0 0 0 0\n"},
}


@pytest.mark.parametrize("what", sorted(SAME))
def test_the_same_robot(small, what: str):
    assert load(small(SAME[what], "other")) == load(small())


YAML_ROWS = """
name: small
kinematics:
  - {arm: 1, "alpha[deg]": 90, a: 0.3, theta: 0, d: 0.2}
  - arm: 2
    alpha[deg]: 0
    a: 0
    theta: 0
    d: 0.1
inertia:
  - [arm, mass, x, y, z, Ixx, Iyy, Izz]
  - [1, 4, -0.1, 0, 0, 0.02, 0.03, 0.03]
  - [2, 2, 0, 0, 0.1, 0.01, 0.01, 0.005]
joints:
  - {joint: 1, lower[deg|m]: -170, "upper[deg|m]": 170}
  - {joint: 2, type: prismatic, "lower[deg|m]": -0.1, "upper[deg|m]": 0.4}
"""


def test_yaml_rows_as_mappings_and_as_lists(small, tmp_path: Path):
    text = YAML_ROWS.replace("lower[deg|m]: -170", '"lower[deg|m]": -170')
    (tmp_path / "small.yaml").write_text(text)
    assert load(tmp_path / "small.yaml") == load(small())
    assert load(str(tmp_path / "small.yaml")).content_hash() == load(small()).content_hash()


def test_yaml_row_without_an_optional_cell_takes_the_default(tmp_path: Path):
    text = (
        YAML_ROWS.replace("lower[deg|m]: -170, ", "")
        + "effects:\n  joint_compliance:\n    - {joint: 1, stiffness: 5}\n"
    )
    text += "    - {joint: 2, stiffness: 6, damping: 7}\nmotions:\n  wave: [[t, q1, q2], [0, 0, 0], [1, .5, 0.1]]\n"
    (tmp_path / "small.yaml").write_text(text)
    robot = load(tmp_path / "small.yaml")
    assert robot.joints[0].lower == -math.inf
    assert [row.values["damping"] for row in robot.effects["joint_compliance"]] == [0.0, 7.0]
    assert robot.motions["wave"].q == ((0.0, 0.0), (0.5, 0.1))


@pytest.mark.parametrize(
    "block",
    ["effects:\n  joint_compliance:", "effects/joint_compliance:", "joint_compliance:"],
)
def test_yaml_names_of_an_effect_s_table(small, block: str):
    indent = "    " if block.startswith("effects:") else "  "
    rows = f"name: small\n{block}\n{indent}- {{joint: 1, stiffness: 5}}\n"
    assert load(small({"robot.yaml": rows})).effects["joint_compliance"][0].values["stiffness"] == 5.0


def test_yaml_problems_have_the_cell_s_line(tmp_path: Path):
    text = YAML_ROWS.replace("lower[deg|m]: -170", '"lower[deg|m]": -170').replace("    d: 0.1", "    d: 0.1x")
    (tmp_path / "small.yaml").write_text(text)
    with pytest.raises(DatabaseError) as caught:
        load(tmp_path / "small.yaml")
    (problem,) = caught.value.problems
    assert (problem.file, problem.line, problem.column, problem.value) == ("small.yaml", 9, "d", "0.1x")


def test_yaml_infinity(small):
    for text in (".inf", "inf", "+.Inf"):
        rows = f"name: small\njoints:\n  - {{joint: 1, upper: {text}}}\n  - {{joint: 2, lower: -.inf}}\n"
        joints = load(small({"robot.yaml": rows, "joints.dat": None})).joints
        assert (joints[0].upper, joints[1].lower) == (math.inf, -math.inf)


def test_yaml_anchors_are_taken(small):
    text = "name: small\nbase: &here {xyz: [1, 2, 3]}\ntool: *here\n"
    robot = load(small({"robot.yaml": text}))
    assert robot.base == robot.tool
    assert robot.tool.xyz == (1.0, 2.0, 3.0)


def test_the_folder_s_own_yaml_may_be_named(small):
    assert load(small() / "robot.yaml") == load(small())


def test_all_problems_at_once(small):
    folder = small(
        {
            "robot.yaml": "name: small\ngravity: 9.81\nspeed: 1\n",
            "kinematics.dat": "arm alpha[mm] a theta d\n1 0 x 0 0\n2 0 0 0 nan\n",
            "inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 -4 0 0 0 1 1 1\n2 2 0 0 0.1 1 1 3\n",
            "joints.dat": "joint lower upper\n1 2 1\n2 -1 1\n",
            "effects/viscous_friction.dat": "joint coefficient\n1 -2\n3 1\n",
            "effects/jelly.dat": "joint softness\n1 2\n",
            "motions/wave.dat": "t q1 q2\n0 0 0\n0 1 1\n",
        }
    )
    with pytest.raises(DatabaseError) as caught:
        load(folder)
    places = {(p.file, p.line, p.column) for p in caught.value.problems}
    assert places == {
        ("robot.yaml", 2, "gravity"),
        ("robot.yaml", 3, "speed"),
        ("kinematics.dat", 1, "alpha"),
        ("kinematics.dat", 2, "a"),
        ("kinematics.dat", 3, "d"),
        ("inertia.dat", 2, "mass"),
        ("inertia.dat", 3, "Izz"),
        ("joints.dat", 2, "lower"),
        ("effects/viscous_friction.dat", 2, "coefficient"),
        ("effects/viscous_friction.dat", 3, "joint"),
        ("effects/jelly.dat", 1, None),
        ("motions/wave.dat", 3, "t"),
    }
    assert len(caught.value.problems) == len(places)


def test_a_broken_base_table_does_not_accuse_the_others(small):
    with pytest.raises(DatabaseError) as caught:
        load(small({"kinematics.dat": "\0"}))
    assert [p.file for p in caught.value.problems] == ["kinematics.dat"]


def test_integral_products_change_sign(small):
    table = "arm mass x y z Ixx Iyy Izz Ixy Ixz Iyz\n1 4 0 0 0 2 2 2 0.1 -0.2 0.3\n2 2 0 0 0.1 1 1 1 0 0 0.01\n"
    tensor = load(small({"inertia.dat": table}, "a"))
    integral = load(small({"inertia.dat": table, "robot.yaml": "name: small\nproducts_of_inertia: integral\n"}, "b"))
    assert tensor.inertias[0].xy == 0.1
    assert [(i.xy, i.xz, i.yz) for i in integral.inertias] == [(-0.1, 0.2, -0.3), (0.0, 0.0, -0.01)]
    assert replace(integral, inertias=tensor.inertias) == tensor


def test_the_sanity_check_looks_at_the_tensor_in_the_file_s_convention(small):
    # positive products in the tensor break the triangle here, positive integrals do not
    table = "arm mass x y z Ixx Iyy Izz Ixy Ixz Iyz\n1 4 0 0 0 .02 .02 .02 .006 .006 .006\n2 2 0 0 .1 1 1 1 0 0 0\n"
    with pytest.raises(DatabaseError, match="integral, would cure it"):
        load(small({"inertia.dat": table}, "a"))
    load(small({"inertia.dat": table, "robot.yaml": "name: small\nproducts_of_inertia: integral\n"}, "b"))
    flipped = table.replace(" .006", " -.006")
    with pytest.raises(DatabaseError, match="tensor, would cure it"):
        load(small({"inertia.dat": flipped, "robot.yaml": "name: small\nproducts_of_inertia: integral\n"}, "c"))


def test_flat_bodies_and_rods_are_bodies(small):
    load(small({"inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 4 0 0 0 .1 .2 .3\n2 2 0 0 .1 1e-9 .7 .7\n"}))


def test_data_that_no_body_can_have_stand_where_asked(small):
    table = "arm mass x y z Ixx Iyy Izz\n1 0 0 0 0 0 0.35 0\n2 2 0 0 .1 .066 .086 .0125\n"
    folder = small({"inertia.dat": table, "robot.yaml": "name: small\ninertia_check: warn\n"})
    assert load(folder).inertias[0].mass == 0.0
    told = [p for p in check(folder) if p.file == "inertia.dat"]
    assert [(p.severity, p.line) for p in told] == [("warning", 2), ("warning", 2), ("warning", 3)]


def test_small_corrections_stay_as_they_are(small):
    table = "arm alpha a theta d beta\n0 1e-10 -5e-10 0.3 0.1 0\n1 0 .2 .1 .3 9e-10\n2 .5 .5 .5 .5 .5\n"
    corrections = load(small({"corrections.dat": table})).corrections
    assert corrections[0].a == -5e-10
    assert corrections[2].beta == 0.5


def test_unlucky_spellings_are_no_numbers(small):
    for cell in ("1_0", "0x10", "\u0661", "1e", "--1", "1.2.3", "1,5", "True", "∞", "1e400"):
        with pytest.raises(DatabaseError, match="column a") as caught:
            load(small({"kinematics.dat": f"arm alpha a theta d\n1 0 {cell} 0 0\n2 0 0 0 0\n"}, "bad"))
        assert len(caught.value.problems) == 1


def test_effects_replace_the_rows_they_list(small, tmp_path: Path):
    robot = load(small({"effects/viscous_friction.dat": "joint coefficient\n1 2\n2 3\n"}))
    extra = tmp_path / "effects"
    extra.mkdir()
    (extra / "viscous_friction.dat").write_text("joint coefficient\n2 30\n")
    (extra / "payload.dat").write_text("robot mass[g]\nrobot 1500\n")
    rows = load_effects(extra, robot)
    changed = with_effects(robot, rows)
    assert [(row.at, row.values["coefficient"]) for row in changed.effects["viscous_friction"]] == [(1, 2.0), (2, 30.0)]
    assert changed.effects["payload"][0].at == 0
    assert changed.effects["payload"][0].values["mass"] == 1.5
    assert list(changed.effects) == ["payload", "viscous_friction"]
    assert robot.effects["viscous_friction"][1].values["coefficient"] == 3.0


def test_effects_that_are_given_count_at_the_level_they_are_given_for(small, tmp_path: Path):
    tables = {
        "robot.yaml": "name: small\nlevels: {dry: [coulomb_friction]}\n",
        "effects/viscous_friction.dat": "joint coefficient\n1 2\n2 3\n",
        "effects/coulomb_friction.dat": "joint torque\n1 1\n2 1\n",
    }
    robot = load(small(tables))
    rows = {
        "coulomb_friction": (EffectRow(2, FrozenMap({"torque": 7.0})),),
        "viscous_friction": (EffectRow(2, FrozenMap({"coefficient": 7.0})),),
    }
    dry, bare = with_effects(robot, rows, "dry"), with_effects(robot, rows, "rigid")
    assert dry.level_effects("dry") == bare.level_effects("rigid") == ("coulomb_friction", "viscous_friction")
    # of a table that the level has not used none of the database's own rows comes along
    assert [row.at for row in dry.effects["coulomb_friction"]] == [1, 2]
    assert [row.at for row in dry.effects["viscous_friction"]] == [2]
    assert [row.at for row in bare.effects["coulomb_friction"]] == [2]
    assert with_effects(robot, rows).level_effects("dry") == ("coulomb_friction",)
    with pytest.raises(UsageError, match="no level 'wet'"):
        with_effects(robot, rows, "wet")
    # what asks for the bodies alone has them still
    assert build(bare, "rigid").effects and not build(bare, effects=()).effects
    # nobody reads a database whose rigid level is not rigid
    assert load(write(bare, tmp_path / "bare.yaml", "yaml")[0]).level_effects("rigid") == ()


def test_springs_of_a_level_that_is_not_asked_for_are_no_rivals(small, tmp_path: Path):
    robot = load(small({"effects/joint_compliance.dat": "joint stiffness damping\n1 1e4 1\n"}))
    (tmp_path / "more").mkdir()
    columns = [column.name for column in effect_named("joint_compliance_6d").columns]
    (tmp_path / "more" / "joint_compliance_6d.dat").write_text(
        f"joint {' '.join(columns)}\n1 {' '.join('1e4' for _ in columns)}\n"
    )
    with pytest.raises(DatabaseError, match="the same spring"):
        load_effects(tmp_path / "more", robot)
    assert load_effects(tmp_path / "more", robot, "rigid")


def test_effects_of_a_folder_are_checked_like_the_database_s(small, tmp_path: Path):
    robot = load(small())
    extra = tmp_path / "more"
    extra.mkdir()
    with pytest.raises(DatabaseError, match="no folder with tables"):
        load_effects(extra, robot)
    (extra / "viscous_friction.dat").write_text("joint coefficient\n3 -1\n")
    (extra / "jelly.dat").write_text("joint softness\n1 1\n")
    with pytest.raises(DatabaseError) as caught:
        load_effects(extra, robot)
    assert [(p.file, p.line) for p in caught.value.problems] == [("jelly.dat", 1), ("viscous_friction.dat", 2)]
    with pytest.raises(DatabaseError, match="no folder with tables"):
        load_effects(tmp_path / "nowhere", robot)


def test_a_motion_by_itself(small):
    joints = load(small()).joints
    motion = parse_motion("t q1[deg] q2\n0 0 0\n1 180 0.2\n", joints)
    assert motion.q[1] == (math.pi, 0.2)
    with pytest.raises(RunFileError, match="times must grow") as caught:
        parse_motion("t q1 q2\n0 0 0\n1 0 0\n0.5 0 0\n", joints, "wave.dat")
    assert caught.value.problems[0].line == 4
    assert caught.value.problems[0].file == "wave.dat"


def test_sources_that_are_none(tmp_path: Path):
    with pytest.raises(DatabaseError, match="did you mean 'imece2013'"):
        load("imece2031")
    with pytest.raises(DatabaseError, match="no such folder"):
        load(tmp_path / "nothing")
    (tmp_path / "arm.urdf").write_text("<robot/>")
    with pytest.raises(DatabaseError, match="mbexport import"):
        load(tmp_path / "arm.urdf")
    with pytest.raises(DatabaseError):
        load("a\0b")
    with pytest.raises(DatabaseError):
        load("")
    assert [p.severity for p in check("imece2031")] == ["error"]


def test_a_built_in_name_gives_way_to_a_database_here_only(small, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pendulum").mkdir()
    assert load("pendulum").name == "pendulum"
    small(name="pendulum")
    assert load("pendulum").name == "small"


def test_databases_can_be_compared_hashed_and_sent(small):
    import copy
    import pickle

    text = {"effects/viscous_friction.dat": "joint coefficient\n1 2\n", "motions/wave.dat": "t q1 q2\n0 0 0\n1 1 0\n"}
    robot = load(small(text))
    again = load(small(text, "again"))
    assert robot == again
    assert hash(robot) == hash(again)
    assert pickle.loads(pickle.dumps(robot)) == robot
    assert copy.deepcopy(robot) == robot
    other = replace(robot, dummy_inertia=0.5)
    assert isinstance(other, Database)
    assert other != robot
    assert other.content_hash() != robot.content_hash()
    assert again.content_hash() == robot.content_hash()


def test_the_hash_does_not_know_in_which_units_the_file_was(small):
    meters = load(small({"kinematics.dat": "arm alpha a theta d\n1 0 0.072 0 0\n2 0 0 0 0.0721\n"}, "m"))
    millimeters = load(small({"kinematics.dat": "arm alpha a[mm] theta d[mm]\n1 0 72 0 0\n2 0 0 0 72.1\n"}, "mm"))
    assert meters.content_hash() == millimeters.content_hash()
