from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from mbexport.core.database import (
    Database,
    FrozenMap,
    MotionTable,
    Placement,
    Tolerance,
    Visual,
    built_in,
    load,
    write,
)
from mbexport.core.effects import EffectRow, catalogue, effect_named
from mbexport.core.errors import UsageError
from mbexport.core.representation import FrictionModel, Inertia, Joint, VeitscheggerWu


@pytest.mark.parametrize("name", built_in())
@pytest.mark.parametrize("form", ["folder", "yaml"])
def test_a_write_followed_by_a_read_changes_nothing(name: str, form, tmp_path: Path):
    robot = load(name)
    write(robot, tmp_path / "out", form)
    again = load(tmp_path / "out")
    assert again == robot
    assert again.content_hash() == robot.content_hash()
    # and what is written from it is the same to the byte
    write(again, tmp_path / "again", form)
    files = sorted(path.relative_to(tmp_path / "out") for path in (tmp_path / "out").rglob("*") if path.is_file())
    assert files == sorted(p.relative_to(tmp_path / "again") for p in (tmp_path / "again").rglob("*") if p.is_file())
    for file in files:
        assert (tmp_path / "out" / file).read_bytes() == (tmp_path / "again" / file).read_bytes()


def test_yaml_is_one_file_of_any_name(tmp_path: Path):
    robot = load("scara")
    assert write(robot, tmp_path / "a" / "arm.yaml", "yaml") == (tmp_path / "a" / "arm.yaml",)
    assert load(tmp_path / "a" / "arm.yaml") == robot


def test_the_yaml_form_is_yaml_for_other_programs(tmp_path: Path):
    from ruamel.yaml import YAML

    write(load("scara"), tmp_path / "scara.yaml", "yaml")
    content = YAML(typ="safe").load(tmp_path / "scara.yaml")
    assert content["name"] == "scara"
    assert content["kinematics"][0][:3] == ["arm", "alpha[rad]", "a[m]"]
    assert content["kinematics"][2][1] == math.pi
    assert content["joints"][3][2] == 0.0
    assert isinstance(content["inertia"][3][7], float)
    assert content["effects"]["rotor_inertia"][3] == [3, 9.0]


def test_nothing_is_written_over_without_force(tmp_path: Path):
    write(load("pendulum"), tmp_path / "out")
    before = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    with pytest.raises(UsageError, match="exists already"):
        write(load("puma560"), tmp_path / "out")
    assert {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()} == before
    write(replace(load("pendulum"), dummy_inertia=0.25), tmp_path / "out", force=True)
    assert load(tmp_path / "out").dummy_inertia == 0.25


def test_what_could_not_be_read_again_is_not_written(small, tmp_path: Path, monkeypatch):
    # the package's name `write` is the function
    module = sys.modules["mbexport.core.database.write"]
    monkeypatch.setattr(module, "MOST_ROWS", 100)
    monkeypatch.setattr(module, "MOST_NODES", 300)
    t = tuple(float(i) for i in range(100))
    q = tuple((0.0, 0.0) for _ in t)
    robot = replace(load(small()), motions=FrozenMap({"long": MotionTable(t, q)}))
    with pytest.raises(UsageError, match="write it as a folder"):
        write(robot, tmp_path / "long.yaml", "yaml")
    write(robot, tmp_path / "long")
    assert load(tmp_path / "long") == robot
    longer = replace(robot, motions=FrozenMap({"long": MotionTable((*t, 100.0), (*q, (0.0, 0.0)))}))
    with pytest.raises(UsageError, match="101 rows"):
        write(longer, tmp_path / "longer")
    assert not (tmp_path / "longer").exists()
    assert not (tmp_path / "long.yaml").exists()


def test_meshes_go_along(small, tmp_path: Path):
    visuals = "1:\n  - {kind: mesh, mesh: meshes/arm.stl, xyz: [0, 0, 0.1]}\n"
    folder = small({"visuals.yaml": visuals, "meshes/arm.stl": b"solid \xff"})
    robot = load(folder)
    written = write(robot, tmp_path / "copy")
    assert tmp_path / "copy" / "meshes" / "arm.stl" in written
    assert (tmp_path / "copy" / "meshes" / "arm.stl").read_bytes() == b"solid \xff"
    assert load(tmp_path / "copy") == robot
    with pytest.raises(UsageError, match="says no folder"):
        write(replace(robot, folder=None), tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_a_written_database_is_standard(small, tmp_path: Path):
    text = "name: small\nproducts_of_inertia: integral\nkinematics_convention: modified\n"
    table = "arm mass x y z Ixx Iyy Izz Ixy\n1 4 0 0 0 1 1 1 0.1\n2 2 0 0 0.1 1 1 1 0\n"
    robot = load(small({"robot.yaml": text, "inertia.dat": table}))
    write(robot, tmp_path / "copy")
    again = load(tmp_path / "copy")
    assert again == robot
    assert (again.products_of_inertia, again.kinematics_convention) == ("tensor", "standard")
    assert (robot.products_of_inertia, robot.kinematics_convention) == ("integral", "modified")


number = st.floats(allow_nan=False, allow_infinity=False)
moderate = st.floats(-1e3, 1e3)
positive = st.floats(1e-300, 1e300)
# a joint's home is between its limits, and no further out than this
limit = st.floats(-1e308, 1e308) | st.sampled_from([-math.inf, math.inf])
vector = st.tuples(number, number, number)
text = st.text(st.characters(exclude_categories=["Cs", "Cc"]) | st.sampled_from("\n\t\"'\\#:{}[]&*!%@`"), max_size=40)
label = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,9}", fullmatch=True)
placement = st.builds(Placement, vector, vector)


@st.composite
def joints(draw, number: int) -> Joint:
    lower, upper = sorted((draw(limit), draw(limit)))
    lower = -1.0 if lower == math.inf else lower
    upper = max(lower, 1.0) if upper == -math.inf else upper
    home = draw(st.floats(max(lower, -1e308), min(upper, 1e308)))
    kind = draw(st.sampled_from(["revolute", "prismatic"]))
    return Joint(f"joint_{number}", kind, lower, upper, draw(positive), draw(positive | st.just(math.inf)), home)


@st.composite
def inertias(draw) -> Inertia:
    moment = draw(st.floats(1e-200, 1e200))
    products = st.floats(-0.2, 0.2)
    return Inertia(
        draw(positive), draw(vector), moment, moment * 1.1, moment, *(moment * draw(products) for _ in range(3))
    )


@st.composite
def databases(draw) -> Database:
    n = draw(st.integers(1, 4))
    five = st.builds(VeitscheggerWu, number, number, number, number, number)
    arms = tuple(draw(joints(i)) for i in range(1, n + 1))
    corrections = tuple(
        VeitscheggerWu(theta=draw(number), d=draw(number), a=draw(number) if joint.kind == "prismatic" else 0.0)
        for joint in arms
    )
    effects: dict[str, tuple[EffectRow, ...]] = {}
    for name in draw(st.sets(st.sampled_from(sorted(catalogue())), max_size=3)):
        effect = effect_named(name)
        last = {"robot": 0, "arm": n, "joint": n}[effect.key]
        places = sorted(draw(st.sets(st.integers(min(last, 1), last), max_size=n)))
        rows = []
        for at in places:
            values = {
                column.name: draw(
                    st.floats(
                        max(column.minimum, -1e300),
                        min(column.maximum, 1e300),
                        exclude_min=column.exclusive,
                        exclude_max=column.exclusive,
                    )
                )
                for column in effect.columns
            }
            if effect.check(values) is None:
                rows.append(EffectRow(at, FrozenMap(values)))
        effects[name] = tuple(rows)
    if "joint_compliance_6d" in effects:
        # one spring along a joint's axis, not two
        sprung = {row.at for row in effects.get("joint_compliance", ())}
        rigid = {"kz": math.inf, "krz": math.inf, "bz": 0.0, "brz": 0.0}
        rows = [
            EffectRow(row.at, FrozenMap({**row.values, **rigid})) if row.at in sprung else row
            for row in effects["joint_compliance_6d"]
        ]
        check = effect_named("joint_compliance_6d").check
        effects["joint_compliance_6d"] = tuple(row for row in rows if check(row.values) is None)
    motions = {}
    for name in draw(st.sets(label, max_size=2)):
        t = tuple(sorted(draw(st.sets(number, min_size=2, max_size=4))))
        rates = draw(st.integers(0, 2))
        parts = [tuple(tuple(draw(number) for _ in range(n)) for _ in t) for _ in range(rates + 1)]
        motions[name] = MotionTable(t, *parts)
    visual = st.builds(Visual, st.just("box"), st.tuples(positive, positive, positive), placement) | st.builds(
        Visual, st.just("sphere"), st.tuples(positive), placement, st.just(""), st.tuples(*[st.floats(0, 1)] * 4)
    )
    visuals = tuple(tuple(draw(st.lists(visual, max_size=2))) for _ in range(n))
    levels = {
        name: tuple(sorted(draw(st.sets(st.sampled_from(sorted(effects)))))) if effects else ()
        for name in draw(st.sets(label, max_size=2)) - {"full", "rigid", "custom"}
    }
    return Database(
        name=draw(st.from_regex(r"[A-Za-z][A-Za-z0-9_-]{0,9}", fullmatch=True)),
        kinematics=tuple(draw(five) for _ in range(n)),
        inertias=tuple(draw(inertias()) for _ in range(n)),
        joints=arms,
        corrections=(*corrections, draw(five)),
        gravity=draw(vector),
        base=draw(placement),
        tool=draw(placement),
        effects=FrozenMap(sorted(effects.items())),
        motions=FrozenMap(sorted(motions.items())),
        visuals=visuals if any(visuals) else (),
        levels=FrozenMap(sorted(levels.items())),
        dummy_inertia=draw(positive),
        friction=FrictionModel(draw(st.sampled_from(["stick", "smooth"])), draw(positive)),
        tolerance=Tolerance(*(draw(st.floats(0, 1e300)) for _ in range(5))),
        source=draw(text),
        remarks=tuple(remark for remark in draw(st.lists(text, max_size=2)) if remark),
    )


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    # shrinking a whole database takes minutes; what fails is printed as it was drawn
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(databases())
def test_any_database_comes_back(tmp_path_factory, robot: Database):
    folder = tmp_path_factory.mktemp("any")
    write(robot, folder / "folder")
    write(robot, folder / "one.yaml", "yaml")
    for path in (folder / "folder", folder / "one.yaml"):
        again = load(path)
        assert again == robot
        assert again.content_hash() == robot.content_hash()
