"""Every number of a database can be named, read and changed, and nothing else changes with it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from mbexport.core.database import FrozenMap, load
from mbexport.core.effects import EffectRow, catalogue, effect_named
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.study.values import find_places, value_at, with_values

NAMES = [
    ("kinematics.a", "arm_2", 0.4),
    ("kinematics.beta", "arm_1", 0.0),
    ("corrections.theta", "arm_0", 0.0),
    ("corrections.d", "arm_2", 0.0),
    ("inertia.mass", "arm_2", 1.2),
    ("inertia.x", "arm_1", -0.25),
    ("inertia.Izz", "arm_1", 0.05024),
    ("inertia.Ixy", "arm_1", 0.0),
    ("joints.home", "joint_1", math.radians(30)),
    ("gravity.z", "robot", -9.81),
    ("base.roll", "robot", 1.5707963267948966),
    ("tool.x", "robot", 0.0),
    ("dummy_inertia", "robot", 1.0),
    ("friction.velocity", "robot", 1.0e-3),
    ("joint_compliance.stiffness", "joint_2", 900.0),
    ("rotor_inertia.inertia", "joint_1", 0.30),
    ("payload.mass", "robot", None),
]


@pytest.mark.parametrize(("name", "at", "value"), NAMES)
def test_a_number_is_read_and_changed_alone(planar, name, at, value):
    (place,) = find_places(name, at, planar)
    assert place.name == f"{name}@{at}"
    assert value_at(planar, place) == (None if value is None else pytest.approx(value, rel=1e-15, abs=0.0))
    value = value_at(planar, place)
    new = 1.0e-4 if value is None else value * 0.999 - 1.0e-6
    changed = with_values(planar, [place], [new])
    assert value_at(changed, place) == new
    if value is None:
        assert dict(changed.effects["payload"][0].values) == {
            **dict.fromkeys(("x", "y", "z", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"), 0.0),
            "mass": new,
        }
        assert replace(changed, effects=planar.effects) == planar
    else:
        assert with_values(changed, [place], [value]) == planar
    assert changed != planar


def test_several_numbers_change_together(planar):
    places = [place for name, at in (("inertia.x", "arm_1"), ("inertia.mass", "arm_1"), ("inertia.mass", "arm_2"))
              for place in find_places(name, at, planar)]  # fmt: skip
    changed = with_values(planar, places, [0.1, 7.0, 8.0])
    assert changed.inertias[0].com == (0.1, 0.0, 0.0)
    assert [inertia.mass for inertia in changed.inertias] == [7.0, 8.0]


def test_all_means_every_row(planar):
    assert [place.at for place in find_places("joint_compliance.stiffness", "all", planar)] == [1, 2]
    assert [place.at for place in find_places("corrections.theta", "all", planar)] == [0, 1, 2]
    partly = replace(planar, effects=FrozenMap({"rotor_inertia": planar.effects["rotor_inertia"][1:]}))
    assert [place.at for place in find_places("rotor_inertia.inertia", "all", partly)] == [2]


def test_every_effect_can_be_named(planar):
    for name in catalogue():
        effect = effect_named(name)
        at = {"joint": "joint_1", "arm": "arm_1", "robot": "robot"}[effect.key]
        for column in effect.columns:
            (place,) = find_places(f"{name}.{column.name}", at, planar)
            assert place.definition() == column


def test_units_follow_the_joint():
    scara = load("scara")
    kinds = [joint.kind for joint in scara.joints]
    places = find_places("joint_compliance.stiffness", "all", scara) + find_places(
        "coulomb_friction.torque", "all", scara
    )
    for place in places:
        slides = kinds[place.at - 1] == "prismatic"
        unit = {"stiffness": ("N*m/rad", "N/m"), "torque": ("N*m", "N")}[place.column][slides]
        assert place.unit(scara) == unit
    assert "prismatic" in {kinds[place.at - 1] for place in places}


@pytest.mark.parametrize(
    ("name", "at", "message"),
    [
        ("joint_complianc.stiffness", "joint_1", "did you mean 'joint_compliance'"),
        ("joint_compliance.stifness", "joint_1", "did you mean 'stiffness'"),
        ("joint_compliance.stiffness", "arm_1", "joint_1, joint_2"),
        ("joint_compliance.stiffness", "joint_3", "joint_1, joint_2"),
        ("inertia.mass", "arm_0", "arm_1, arm_2"),
        ("joints.upper", "joint_1", "known: home"),
        ("gravity", "robot", "known: x, y, z"),
        ("", "robot", "known: "),
    ],
)
def test_a_wrong_name_gets_the_nearest(planar, name, at, message):
    with pytest.raises(UsageError, match=message):
        find_places(name, at, planar)


def test_converted_tables_are_not_varied(planar):
    with pytest.raises(UsageError, match="modified convention"):
        find_places("kinematics.a", "arm_1", replace(planar, kinematics_convention="modified"))


@pytest.mark.parametrize(
    ("name", "at", "value", "message"),
    [
        ("inertia.mass", "arm_1", -1.0, "above zero"),
        ("inertia.Izz", "arm_1", 0.2, "no body can have"),
        ("inertia.Iyy", "arm_1", -0.1, "not positive definite"),
        ("joints.home", "joint_2", 3.0, "outside of the limits"),
        ("joint_compliance.stiffness", "joint_1", 0.0, "must be above"),
        ("gravity.x", "robot", float("nan"), "must be finite"),
        ("stribeck_friction.torque", "joint_1", 1.0, "stribeck_friction.velocity@joint_1 must be given"),
    ],
)
def test_impossible_numbers_are_refused(planar, name, at, value, message):
    with pytest.raises(RefusedError, match=message):
        with_values(planar, find_places(name, at, planar), [value])


def test_published_bodies_stand_where_the_database_takes_them(planar):
    (place,) = find_places("inertia.mass", "arm_1", planar)
    taken = with_values(replace(planar, inertia_check="warn"), [place], [0.0])
    assert taken.inertias[0].mass == 0.0


def test_rows_stay_in_order(planar):
    lone = replace(planar, effects=FrozenMap({"rotor_inertia": (EffectRow(2, FrozenMap({"inertia": 1.0})),)}))
    (place,) = find_places("rotor_inertia.inertia", "joint_1", lone)
    assert [row.at for row in with_values(lone, [place], [0.5]).effects["rotor_inertia"]] == [1, 2]
