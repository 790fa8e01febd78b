"""Co-simulation units: what importers check, and that they move as every engine does."""

import io
import subprocess
import sys
import threading
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mbexport.backends import fmu_unit
from mbexport.backends.fmu import FmuBackend
from mbexport.backends.urdf import UrdfBackend
from mbexport.core.build import build
from mbexport.core.control import Control, default_pd
from mbexport.core.database import load
from mbexport.core.errors import RefusedError
from mbexport.core.export import emit, export
from mbexport.core.kinematics import dynamics
from mbexport.core.motion import excitation, hold, point_to_point
from mbexport.core.simulation import simulate
from mbexport.core.simulation.backend import Program

fmpy = pytest.importorskip("fmpy", reason="FMPy, which imports units, is not installed (pip install mbexport[fmi])")

# class A, compliant, with room: measured are 1e-15 and less where unit and engine take the same Runge-Kutta steps
SAME = 1.0e-9
EVERYTHING = {
    "rotor_inertia": {1: {"inertia": 2.0}, 2: {"inertia": 1.0}},
    "joint_compliance": {1: {"stiffness": 4.0e3, "damping": 20.0}},
    "viscous_friction": {1: {"coefficient": 1.5}, 2: {"coefficient": 0.7}},
    "coulomb_friction": {1: {"torque": 3.0}, 2: {"torque": 1.0}},
    "stribeck_friction": {2: {"torque": 0.8, "velocity": 0.05}},
    "load_friction": {2: {"coefficient": 0.1}},
    "hysteresis": {1: {"torque": 2.0, "stiffness": 3.0e3}},
    "transmission_error": {1: {"amplitude": 1.0e-3, "cycles": 20.0}},
    "torque_ripple": {2: {"amplitude": 0.5, "cycles": 12.0}},
    "joint_spring": {2: {"stiffness": 15.0, "rest": 0.2}},
    "torque_constant": {1: {"gain": 0.95}},
    "torque_limit": {1: {"torque": 90.0}},
    "encoder_offset": {2: {"offset": 2.0e-3}},
    "delay": {0: {"time": 2.5e-3}},
}


def content_of(packed):
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        return {entry.filename: (archive.read(entry), entry.date_time) for entry in archive.infolist()}


def test_importers_find_nothing_wrong(robot_with, emitted, tmp_path):
    from fmpy.validation import validate_fmu

    path = tmp_path / "unit.fmu"
    path.write_bytes(emitted(robot_with("planar2r", **EVERYTHING), control=Control("torque")))
    assert validate_fmu(str(path)) == []


def test_the_same_robot_gives_the_same_bytes(robot_with, emitted, monkeypatch):
    robot = robot_with("planar2r", **EVERYTHING)
    first, again = emitted(robot, control=Control("torque")), emit(robot, FmuBackend(), control=Control("torque"))
    assert first == again.packed[again.main]
    content = content_of(first)
    assert list(content) == sorted(content)
    assert {date for _, date in content.values()} == {fmu_unit.FIRST_DAY}
    heavier = robot_with("planar2r", **{**EVERYTHING, "rotor_inertia": {1: {"inertia": 2.0}, 2: {"inertia": 1.1}}})
    monkeypatch.setattr("mbexport.backends.fmu.compiler", lambda: None)
    other = emit(heavier, FmuBackend(), control=Control("torque"))
    guids = [
        content_of(unit)["modelDescription.xml"][0].decode().split('guid="')[1].split('"')[0]
        for unit in (first, other.packed[other.main])
    ]
    assert guids[0] != guids[1]


@pytest.mark.parametrize("order", [["fmu", "urdf"], ["urdf", "fmu"]])
def test_the_compiler_works_while_other_formats_are_emitted(order, robot_with, monkeypatch, tmp_path):
    """Whatever the order asked for, which is the order of what comes back."""
    told = threading.Event()
    emitted_by_urdf = UrdfBackend.emit

    def emit_and_tell(self, robot, program):
        emission = emitted_by_urdf(self, robot, program)
        told.set()
        return emission

    monkeypatch.setattr(UrdfBackend, "emit", emit_and_tell)
    monkeypatch.setattr("mbexport.backends.fmu.compiler", lambda: "cc")
    monkeypatch.setattr("mbexport.backends.fmu.compiled_unit", lambda *_: b"binary" if told.wait(60.0) else b"late")
    emissions = export(robot_with("planar2r"), order, tmp_path / "out")
    assert list(emissions) == order
    packed = content_of((tmp_path / "out" / "fmu" / "planar2r.fmu").read_bytes())
    assert packed["binaries/linux64/planar2r.so" if sys.platform == "linux" else next(iter(packed))][0] == b"binary"


@pytest.mark.parametrize("name, level", [("imece2013", "compliant"), ("imece2013", "rigid"), ("scara", "full")])
def test_an_imposed_motion_moves_it_as_an_engine(name, level, emitted, opened):
    robot = build(load(name), level)
    law = excitation(robot)
    run = simulate(robot, "urdf", law, duration=0.1)
    with opened(emitted(robot, law), {"mode": 3, "step": run.facts["step"]}) as unit:
        for k in range(len(run.t)):
            if k:
                unit.step(run.t[k] - run.t[k - 1])
            pose = unit.get("ee_x", "ee_y", "ee_z")
            assert np.abs(pose - run.tip[k]).max() < SAME
            for signal, floor in (("q", 1e-12), ("dq", 1e-9), ("q_link", 1e-9), ("tau", 1e-5), ("tau_link", 1e-5)):
                assert np.abs(unit.joints(signal, robot.n) - run.joints[signal][k]).max() < floor, signal


def test_motion_from_outside_is_followed(emitted, opened):
    """Taylor's polynomial over a communication step of 1 ms: what is left is the third derivative's share."""
    robot = build(load("imece2013"), "compliant")
    law = point_to_point(robot.home(), np.array(robot.home()) + 0.4, 0.4)
    run = simulate(robot, "urdf", law, duration=0.1)

    def ports(k):
        return {
            f"{signal}_{i + 1}": run.joints[signal][k, i] for signal in ("q_cmd", "dq_cmd", "ddq_cmd") for i in range(6)
        }

    with opened(emitted(robot), inputs=ports(0)) as unit:
        assert unit.variables["mode"].start in ("2", 2)
        furthest = 0.0
        for k in range(1, len(run.t)):
            unit.set(ports(k - 1))
            unit.step(1.0e-3)
            furthest = max(furthest, np.abs(unit.get("ee_x", "ee_y", "ee_z") - run.tip[k]).max())
    assert 1e-12 < furthest < 1e-6


@pytest.mark.parametrize("effects", [EVERYTHING, {"rotor_inertia": {1: {"inertia": 2.0}, 2: {"inertia": 1.0}}}])
def test_torque_moves_it_as_an_engine(effects, robot_with, emitted, opened, controlled):
    robot = robot_with("planar2r", **effects)
    law, control = point_to_point(robot.home(), np.array(robot.home()) + 0.5, 0.3), default_pd(robot)
    run = simulate(robot, "urdf", law, control, duration=0.1)
    with opened(emitted(robot, law, control), {"step": run.facts["step"]}) as unit:
        if robot.delay:
            # a delayed robot starts under the torque that settled it
            before = {f"tau_cmd_{i + 1}": run.joints["tau"][0, i] for i in range(robot.n)}
            unit.fmu.reset()
            unit.begin({"step": run.facts["step"]}, before)
        q, tip = controlled(unit, robot, law, control, 0.1)
    assert np.abs(q - run.joints["q"]).max() < 1e-9
    assert np.abs(tip - run.tip).max() < SAME


def test_elastic_bearings_and_arms_move_it_too(robot_with, emitted, opened, controlled):
    robot = robot_with(
        "planar2r",
        joint_compliance_6d={2: {"kx": 2.0e5, "bx": 300.0, "krx": 4.0e3, "brx": 20.0}},
        link_flexibility={1: {"ku": 5.0e3, "kv": 6.0e3, "bu": 20.0, "bv": 20.0}},
        rotor_inertia={1: {"inertia": 1.0}, 2: {"inertia": 0.5}},
    )
    law, control = point_to_point(robot.home(), np.array(robot.home()) + 0.5, 0.3), default_pd(robot)
    run = simulate(robot, "urdf", law, control, duration=0.05)
    with opened(emitted(robot, law, control), {"step": run.facts["step"]}) as unit:
        _, tip = controlled(unit, robot, law, control, 0.05)
    assert np.abs(tip - run.tip).max() < SAME
    # the bearings do give
    assert np.abs(tip - simulate(robot_with("planar2r"), "urdf", law, control, duration=0.05).tip).max() > 1e-5


def test_parameters_are_the_effects_numbers(robot_with, emitted, opened):
    """A spring made softer in the unit sags as far as the robot whose database says so."""
    stiff, soft = (
        robot_with("planar2r", joint_compliance={2: {"stiffness": k, "damping": 20.0}}) for k in (8.0e3, 2.0e3)
    )
    still = hold(stiff.home(), 0.1)
    with opened(emitted(stiff), {"joint_2.joint_compliance.stiffness": 2.0e3}) as unit:
        found = unit.joints("q_link", 2)
        unit.step(0.02)
        assert np.abs(unit.joints("q_link", 2) - found).max() < 1e-12
    with opened(emitted(stiff)) as unit:
        unchanged = unit.joints("q_link", 2)
    expected = simulate(soft, "urdf", still, duration=0.01).joints["q_link"][0]
    assert np.abs(found - expected).max() < 1e-12 < np.abs(found - unchanged).max()


def test_gravity_and_masses_are_parameters(robot_with, emitted, opened):
    robot = robot_with("planar2r")
    with opened(emitted(robot), {"gravity_in_base.z": 0.0, "gravity_in_base.x": 0.0, "gravity_in_base.y": 0.0}) as unit:
        assert np.abs(unit.joints("tau", 2)).max() == 0.0
    mass = robot.stages[0].arm.inertia.mass
    with opened(emitted(robot), {"arm_1.mass": 2.0 * mass}) as unit:
        heavy = unit.joints("tau", 2)
    with opened(emitted(robot)) as unit:
        light = unit.joints("tau", 2)
    assert np.abs(light - dynamics(robot).gravity(robot.home())).max() < 1e-12
    assert np.abs(heavy - light).max() > 1e-3


def test_a_state_is_kept_and_taken_again(robot_with, emitted, opened):
    with opened(emitted(robot_with("planar2r", **EVERYTHING), control=Control("torque"))) as unit:
        unit.step(0.01)
        state = unit.fmu.getFMUState()
        unit.step(0.01)
        first = unit.joints("q_link", 2)
        unit.fmu.setFMUState(state)
        unit.t = 0.01
        assert np.abs(unit.joints("q_link", 2) - first).max() > 1e-6
        unit.step(0.01)
        assert (unit.joints("q_link", 2) == first).all()
        unit.fmu.freeFMUState(state)


def test_without_a_compiler_it_is_sources_only(robot_with, monkeypatch):
    monkeypatch.setattr("mbexport.backends.fmu.compiler", lambda: None)
    emission = emit(robot_with("planar2r"), FmuBackend())
    assert set(content_of(emission.packed[emission.main])) == {
        "modelDescription.xml",
        "sources/fmi2.h",
        "sources/unit.c",
    }
    assert "for want of a C compiler" in next(c.how for c in emission.concepts if c.datum == "binary")


def test_sources_compile_without_a_warning(robot_with, emitted, tmp_path, needs_compiler):
    content = content_of(emitted(robot_with("planar2r", **EVERYTHING), control=Control("torque")))
    for name in ("fmi2.h", "unit.c"):
        (tmp_path / name).write_bytes(content[f"sources/{name}"][0])
    strict = (
        "-std=c99",
        "-pedantic",
        "-Wall",
        "-Wextra",
        "-Wno-unused-parameter",
        "-Werror",
        "-DFMI2_FUNCTION_PREFIX=my_",
    )
    done = subprocess.run(
        [fmu_unit.compiler(), *strict, "-c", "unit.c"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[:2000]


def test_a_motor_without_inertia_is_refused():
    robot = build(load("imece2013"), "compliant")
    bare = replace(
        robot, stages=tuple(replace(stage, drive=replace(stage.drive, inertia=0.0)) for stage in robot.stages)
    )
    with pytest.raises(RefusedError, match="imposed motion"):
        FmuBackend().emit(bare, Program(hold(robot.home(), 1.0), Control("torque"), 1.0, 1.0e-3))


def test_the_unit_needs_no_python(robot_with, emitted, opened, tmp_path):
    """Its library depends on nothing but C's."""
    if not sys.platform.startswith("linux"):
        # ldd is Linux'; other systems have other tools for the same question
        pytest.skip("how a library names what it depends on is looked up on Linux only")
    content = content_of(emitted(robot_with("planar2r")))
    name = next(name for name in content if name.startswith("binaries/"))
    library = tmp_path / Path(name).name
    library.write_bytes(content[name][0])
    done = subprocess.run(["ldd", str(library)], capture_output=True, text=True, check=False)
    assert "python" not in done.stdout and "libc" in done.stdout
