"""What sliders and switches make of a database."""

import math
from dataclasses import replace

import pytest

import mbexport
from mbexport.core.effects import catalogue
from mbexport.core.errors import RefusedError
from mbexport.core.studio import Bench
from mbexport.core.studio.bench import tables_of
from mbexport.core.studio.knobs import REACHES, knobs, round_step
from mbexport.core.study.values import Place, value_at

STIFFNESS = Place("joint_compliance", "stiffness", "joint", 2)
MASS = Place("inertia", "mass", "arm", 1)


def test_a_changed_number_is_in_database_and_robot(bench):
    changed = bench.changed(MASS, 2.5)
    assert changed.database().inertias[0].mass == 2.5
    assert changed.robot().stages[0].arm.inertia.mass == 2.5
    assert bench.database() == bench.original
    assert changed.nominal(MASS) == value_at(bench.original, MASS)
    assert changed.changed(MASS, bench.nominal(MASS)).values == {}


def test_switches_take_effects_out_and_bring_them_in(bench):
    assert "joint_compliance" in bench.effects
    off = bench.switched("joint_compliance", False)
    assert all(stage.drive.spring is None for stage in off.robot().stages)
    assert off.switched("joint_compliance", True).robot() == bench.robot()
    # to change its number is to want it
    assert "joint_compliance" in off.changed(STIFFNESS, 1.0e4).effects


@pytest.mark.parametrize("effect", sorted(catalogue()))
def test_every_effect_can_be_brought_in_and_moved(effect):
    bench = Bench.of(mbexport.load("imece2013"), "rigid").switched(effect, True)
    assert bench.robot().effects == (effect,)
    for column in tables_of(bench.original)[effect]:
        for knob in knobs(bench, effect, column):
            assert knob.low <= knob.value <= knob.high
    first = next(iter(tables_of(bench.original)[effect]))
    knob = knobs(bench, effect, first)[0]
    moved = bench.changed(knob.place, knob.si(knob.low + 0.6 * (knob.high - knob.low)))
    assert math.isfinite(value_at(moved.database(), knob.place))


def test_a_single_row_of_an_effect_comes_with_what_it_needs():
    bench = Bench.of(mbexport.load("imece2013"), "rigid")
    changed = bench.changed(Place("stribeck_friction", "torque", "joint", 3), 5.0)
    (row,) = changed.database().effects["stribeck_friction"]
    assert row.at == 3
    assert row.values["velocity"] > 0.0
    assert changed.robot().effects == ("stribeck_friction",)
    # switched off again it is gone, and its number is kept for when it comes back
    assert "stribeck_friction" not in changed.switched("stribeck_friction", False).database().effects


def test_what_no_body_can_be_is_refused(bench):
    with pytest.raises(RefusedError, match="mass"):
        bench.changed(MASS, -1.0).robot()


def test_what_is_saved_is_what_acted(bench, tmp_path):
    from mbexport.core.studio.saving import save_database

    changed = bench.changed(STIFFNESS, 1234.5).switched("payload", True)
    changed = changed.changed(Place("payload", "mass", "robot", 0), 1.5)
    folders = [save_database(changed, tmp_path), save_database(bench, tmp_path)]
    assert [folder.name for folder in folders] == ["database-1", "database-2"]
    again = mbexport.load(str(folders[0]))
    assert value_at(again, STIFFNESS) == 1234.5
    robot, expected = mbexport.build(again, "studio"), changed.robot()
    assert robot.effects == changed.effects
    assert robot.stages == expected.stages


@pytest.mark.parametrize("reach", REACHES)
@pytest.mark.parametrize("name", ["imece2013", "scara"])
def test_every_number_has_a_slider(name, reach):
    bench = Bench.of(mbexport.load(name))
    count = 0
    for table, columns in tables_of(bench.original).items():
        for column in columns:
            for knob in knobs(bench, table, column, reach):
                assert knob.low <= knob.value <= knob.high
                assert knob.low < knob.high
                assert 0.0 < knob.step <= knob.high - knob.low
                definition = knob.place.definition()
                assert definition.minimum <= knob.si(knob.low) * (1 + 1e-12)
                count += 1
    assert count > 150


def test_sliders_are_in_degrees_and_millimetres():
    bench = Bench.of(mbexport.load("imece2013"))
    length = knobs(bench, "kinematics", "a")[1]
    angle = knobs(bench, "kinematics", "alpha")[0]
    assert (length.unit, length.value) == ("mm", pytest.approx(680.0))
    assert (angle.unit, angle.value) == ("deg", pytest.approx(90.0))
    assert length.si(length.value) == pytest.approx(0.68)
    fine = knobs(bench, "kinematics", "a", "fine")[1]
    assert (fine.low, fine.high) == (pytest.approx(612.0), pytest.approx(748.0))


def test_a_number_set_beyond_the_range_stays_on_its_slider(bench):
    far = bench.changed(STIFFNESS, 100.0 * bench.nominal(STIFFNESS))
    knob = knobs(far, "joint_compliance", "stiffness", "fine")[1]
    assert knob.high == knob.value == pytest.approx(100.0 * bench.nominal(STIFFNESS))


def test_corrections_that_change_the_motion_do_not_move():
    bench = Bench.of(mbexport.load("imece2013"))
    assert all(knob.free for knob in knobs(bench, "corrections", "d"))
    assert not knobs(bench, "corrections", "a")[0].free


def test_tables_in_the_modified_convention_are_left_out(bench):
    modified = replace(bench.original, kinematics_convention="modified")
    assert "kinematics" in tables_of(bench.original)
    assert "kinematics" not in tables_of(modified)


@pytest.mark.parametrize(("step", "rounded"), [(0.0072, 0.005), (1.0, 1.0), (360.0, 200.0), (0.0, 1.0), (2e-7, 2e-7)])
def test_steps_are_round(step, rounded):
    assert round_step(step) == pytest.approx(rounded)
