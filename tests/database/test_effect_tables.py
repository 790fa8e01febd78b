"""Tables of effects that are no files of the project: plugins, and what two effects may not both have."""

from __future__ import annotations

import sys
from collections.abc import Mapping

import pytest

from mbexport.core.build import build
from mbexport.core.database import check, load, parts, write
from mbexport.core.effects import Column, Effect, effect_named
from mbexport.core.errors import DatabaseError, PluginError


class Warmth(Effect):
    name = "warmth"
    key = "joint"
    columns = (
        Column("rise", "K", minimum=0.0),
        Column("torque", "N*m|N", default=0.5),
        Column("angle", "rad", default=0.0, maximum=1.0),
        Column("ratio", default=1.0, maximum=2.0, exclusive=True),
    )

    def check(self, values: Mapping[str, float]) -> str | None:
        return "rise and torque may not be the same." if values["rise"] == values["torque"] else None


class Compliance6d(Effect):
    name = "joint_compliance_6d"
    key = "joint"
    columns = tuple(Column(name, "N*m/rad", default=float("inf"), infinite=True) for name in ("krx", "kry", "krz"))


@pytest.fixture
def plugins(monkeypatch):
    """Installs the effects above as if plugins brought them."""
    brought = {effect.name: effect for effect in (Warmth(), Compliance6d())}

    def named(name: str) -> Effect:
        if name == "broken":
            raise PluginError("'broken' cannot be loaded: ImportError: no module")
        return brought.get(name) or effect_named(name)

    monkeypatch.setattr(parts, "effect_named", named)
    # the package's name `write` is the function
    monkeypatch.setattr(sys.modules["mbexport.core.database.write"], "effect_named", named)
    installed = parts.catalogue
    monkeypatch.setattr(parts, "catalogue", lambda: (*installed(), *brought, "broken"))


def test_a_plugin_s_columns_units_and_defaults(small, plugins, tmp_path):
    robot = load(small({"effects/warmth.dat": "angle[deg] joint rise[K] torque[N*mm|kN]\n45 1 20 300\n0 2 5 2\n"}))
    first, second = robot.effects["warmth"]
    assert dict(first.values) == {"rise": 20.0, "torque": 0.3, "angle": pytest.approx(0.7853981633974483), "ratio": 1.0}
    assert second.values["torque"] == 2000.0
    write(robot, tmp_path / "copy")
    assert load(tmp_path / "copy") == robot


def test_a_plugin_s_bounds_are_in_si_and_its_check_is_asked(small, plugins):
    table = "joint rise angle[deg] ratio torque\n1 1 60 2 0.5\n2 0.5 50 1 0.5\n"
    with pytest.raises(DatabaseError) as caught:
        load(small({"effects/warmth.dat": table}))
    assert [(p.line, p.column) for p in caught.value.problems] == [(2, "angle"), (2, "ratio"), (3, "joint")]
    assert "at most 1.0 rad" in caught.value.problems[0].message
    assert "may not be the same" in caught.value.problems[2].message


def test_a_broken_plugin_gives_its_reason(small, plugins):
    with pytest.raises(DatabaseError, match="ImportError: no module"):
        load(small({"effects/broken.dat": "joint x\n1 1\n"}))


@pytest.mark.parametrize(("rz", "refused"), [("1e4", True), ("inf", False)])
def test_two_springs_about_one_axis(small, plugins, rz: str, refused: bool):
    folder = small(
        {
            "effects/joint_compliance.dat": "joint stiffness\n1 2e4\n",
            "effects/joint_compliance_6d.dat": f"joint krx krz\n1 1e5 {rz}\n",
        }
    )
    errors = [p for p in check(folder) if p.severity == "error"]
    assert len(errors) == refused
    if refused:
        assert (errors[0].file, errors[0].column, errors[0].value) == (
            "effects/joint_compliance_6d.dat",
            "krz",
            "10000.0",
        )
        assert "joint_1" in errors[0].message


@pytest.mark.parametrize(("component", "refused"), [("kz", True), ("krz", False)])
def test_a_sliding_drive_s_own_spring_is_the_one_along_its_axis(small, component: str, refused: bool):
    """The bearing may well turn about the axis of a joint that slides along it."""
    folder = small(
        {
            "joints.dat": "joint type lower upper velocity effort\n1 revolute -3 3 2 100\n2 prismatic -1 1 1 100\n",
            "effects/joint_compliance.dat": "joint stiffness\n2 2e4\n",
            "effects/joint_compliance_6d.dat": f"joint {component}\n2 1e5\n",
        }
    )
    errors = [p for p in check(folder) if p.severity == "error"]
    assert [(p.file, p.column) for p in errors] == [("effects/joint_compliance_6d.dat", component)] * refused
    if not refused:
        build(load(folder))


def test_springs_of_two_joints_do_not_clash(small, plugins):
    load(
        small(
            {
                "joints.dat": None,
                "effects/joint_compliance.dat": "joint stiffness\n1 2e4\n",
                "effects/joint_compliance_6d.dat": "joint krz\n2 1e4\n",
            }
        )
    )
