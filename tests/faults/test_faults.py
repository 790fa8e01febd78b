"""Every fault must fail the agreement, and the sentence must name the right culprit, wherever the fault is planted."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import mbexport.core.database.parts
import mbexport.core.database.read
import mbexport.core.database.rows
from mbexport.core.agreement import agree
from mbexport.core.agreement.runs import step_of
from mbexport.core.agreement.scenarios import scenarios
from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.effects.effect import with_drive
from mbexport.core.motion import MotionLaw
from mbexport.core.representation import Inertia, VeitscheggerWu
from mbexport.core.simulation import backend_named

EMITTERS = ("mjcf", "urdf")
BEFORE = ("build", *EMITTERS)


def the_finding(answer, where, kind, at):
    """The one finding there must be, at the right place."""
    assert not answer.agreed
    assert len(answer.findings) == 1, answer.sentences
    finding = answer.findings[0]
    assert finding.kind == kind, finding
    assert finding.at == at, finding
    if where in ("reader", "build", "common", "motion"):
        assert finding.where == where, finding
        assert set(finding.voices) == {voice.name for voice in answer.voices if voice.name != "tables"}
        assert "before the emitters" in finding.sentence
    else:
        assert finding.voices == (where,) and finding.where == "export", finding
        assert finding.sentence.startswith(f"{where} (")
    return finding.sentence


def looked_at(subject, backends, quantities):
    return agree(subject, backends, quantities=quantities, states=12)


def mirrored(arm):
    return replace(arm, inertia=replace(arm.inertia, yz=-arm.inertia.yz))


def test_the_subject_is_healthy(healthy):
    assert healthy.is_dir()


class TestSignOfAProductOfInertia:
    @pytest.mark.parametrize("where", BEFORE)
    def test_planted_in_the_representation(self, healthy, plant, statics, arm_changed, where):
        backends = plant(where, arm_changed(3, mirrored))
        sentence = the_finding(looked_at(healthy, backends, statics), where, "inertia", "arm_3")
        assert "Iyz of arm_3 has the opposite sign (-0.024 instead of 0.024 kg m^2)" in sentence

    def test_planted_in_the_reader(self, healthy, monkeypatch, statics):
        # the file's convention is forgotten: every product keeps the integral's sign
        monkeypatch.setattr(mbexport.core.database.read, "other_sign", lambda inertia: inertia)
        arms = ", ".join(f"arm_{i}" for i in range(1, 5))
        sentence = the_finding(looked_at(healthy, ["mjcf", "urdf"], statics), "reader", "inertia", arms)
        assert "the products of inertia have the opposite sign in every arm" in sentence
        assert "Ixy of arm 1 (inertia.dat) is read as -0.921 instead of 0.921" in sentence

    def test_planted_in_the_text_of_an_export(self, healthy, faulty_backend, statics):
        def text(content):
            return re.sub(r'(name="arm_2">.*?ixy=")([^"]*)', lambda m: f"{m[1]}{-float(m[2])!r}", content, flags=re.S)

        urdf = faulty_backend("urdf", text=lambda content: text(content) if "<robot" in content else content)
        answer = looked_at(healthy, [urdf, "mjcf", "pybullet"], statics)
        assert "in the joint's frame has the opposite sign" in the_finding(answer, "urdf", "inertia", "arm_2")


class TestInertialRotation:
    def test_planted_in_the_build(self, healthy, monkeypatch, statics):
        # the tensor keeps the arm's axes while its frame becomes the joint's
        genuine = Inertia.moved

        def moved(self, here_in_new):
            turned = genuine(self, here_in_new)
            return replace(turned, **{name: getattr(self, name) for name in ("xx", "yy", "zz", "xy", "xz", "yz")})

        monkeypatch.setattr(Inertia, "moved", moved)
        arms = ", ".join(f"arm_{i}" for i in range(1, 5))
        answer = looked_at(healthy, ["mjcf", "urdf"], statics)
        assert "the rotation of the inertia is lost" in the_finding(answer, "common", "inertia", arms)

    def test_planted_in_the_reader(self, tmp_path, healthy, monkeypatch, statics):
        # Craig's rows are converted and the inertias' axes are not
        for file in healthy.rglob("*.dat"):
            (tmp_path / file.relative_to(healthy)).parent.mkdir(exist_ok=True)
            text = file.read_text()
            if file.stem == "kinematics":
                text = re.sub(r"(?m)\s+\S+$", "", text)
            if file.stem not in ("corrections", "wave"):
                (tmp_path / file.relative_to(healthy)).write_text(text)
        settings = (healthy / "robot.yaml").read_text() + "kinematics_convention: modified\n"
        (tmp_path / "robot.yaml").write_text(settings)
        assert looked_at(tmp_path, ["mjcf", "urdf"], statics).agreed

        genuine = mbexport.core.database.read.moved_inertias

        def moved_inertias(inertias, poses):
            names = ("xx", "yy", "zz", "xy", "xz", "yz")
            return tuple(
                replace(moved, **{name: getattr(given, name) for name in names})
                for given, moved in zip(inertias, genuine(inertias, poses), strict=True)
            )

        monkeypatch.setattr(mbexport.core.database.read, "moved_inertias", moved_inertias)
        answer = looked_at(tmp_path, ["mjcf", "urdf"], statics)
        finding = answer.findings[0]
        assert len(answer.findings) == 1 and finding.where == "reader" and finding.kind == "inertia"
        assert "the rotation of the inertia is lost" in finding.sentence

    def test_planted_in_the_text_of_an_export(self, healthy, faulty_backend, statics):
        def text(content):
            return re.sub(r'(name="arm_2" .*?<inertial [^>]*quat=")[^"]*', r"\g<1>1.0 0.0 0.0 0.0", content, flags=re.S)

        mjcf = faulty_backend("mjcf", text=lambda content: text(content) if "<mujoco" in content else content)
        sentence = the_finding(looked_at(healthy, [mjcf, "urdf"], statics), "mjcf", "inertia", "arm_2")
        assert "the rotation of arm_2's inertia is lost" in sentence


class TestDegreesForRadians:
    @pytest.mark.parametrize("where", BEFORE)
    def test_planted_in_the_representation(self, healthy, plant, statics, arm_changed, where):
        def wrong(arm):
            return replace(arm, link=replace(arm.link, alpha=math.degrees(arm.link.alpha)))

        backends = plant(where, arm_changed(3, wrong))
        sentence = the_finding(looked_at(healthy, backends, statics), where, "frame", "arm_3")
        assert "alpha of arm_3 is degrees taken for radians (80 rad instead of 80 deg)" in sentence

    def test_planted_in_the_reader(self, healthy, monkeypatch, statics):
        genuine = mbexport.core.database.rows.factor
        monkeypatch.setattr(
            mbexport.core.database.rows,
            "factor",
            lambda unit, si: genuine(si, si) if unit == "deg" else genuine(unit, si),
        )
        answer = looked_at(healthy, ["mjcf", "urdf"], statics)
        sentence = the_finding(answer, "reader", "frame", "all arms")
        assert "every angle is degrees taken for radians" in sentence
        assert "alpha of arm 1 (kinematics.dat) is read as 90 instead of 1.5708" in sentence

    def test_planted_in_the_text_of_an_export(self, healthy, faulty_backend, statics):
        def text(content):
            def degrees(match):
                return match[1] + " ".join(repr(math.degrees(float(x))) for x in match[2].split())

            return re.sub(r'(<joint name="joint_3".*?rpy=")([^"]*)', degrees, content, flags=re.S)

        urdf = faulty_backend("urdf", text=lambda content: text(content) if "<robot" in content else content)
        sentence = the_finding(looked_at(healthy, [urdf, "mjcf"], statics), "urdf", "frame", "joint_3")
        assert "the frame of joint_3 on arm_2 has degrees taken for radians" in sentence


class TestLostArmature:
    @staticmethod
    def lost(robot):
        return with_drive(robot, 1, lambda drive: replace(drive, inertia=0.0))

    @pytest.mark.parametrize("where", BEFORE)
    def test_planted_in_the_representation(self, healthy, plant, statics, where):
        answer = looked_at(healthy, plant(where, self.lost), statics)
        sentence = the_finding(answer, where, "armature", "joint_1")
        assert "the rotor's inertia (armature) of joint_1 is lost (0 instead of 60)" in sentence

    def test_planted_in_the_reader(self, healthy, misread, statics):
        def lost(database):
            effects = dict(database.effects)
            effects["rotor_inertia"] = effects["rotor_inertia"][1:]
            return replace(database, effects=type(database.effects)(effects))

        answer = looked_at(healthy, misread(lost), statics)
        assert "rotor_inertia has no row 1" in the_finding(answer, "reader", "armature", "joint_1")

    def test_planted_in_the_text_of_an_export(self, healthy, faulty_backend, statics):
        def text(content):
            return re.sub(r'(name="joint_1"[^>]*armature=")[^"]*', r"\g<1>0.0", content)

        mjcf = faulty_backend("mjcf", text=lambda content: text(content) if "<mujoco" in content else content)
        the_finding(looked_at(healthy, [mjcf, "urdf"], statics), "mjcf", "armature", "joint_1")


class TestLostDamping:
    @staticmethod
    def lost(robot):
        return with_drive(robot, 3, lambda drive: replace(drive, damping=0.0))

    @pytest.mark.parametrize("where", BEFORE)
    def test_planted_in_the_representation(self, healthy, plant, statics, where):
        answer = looked_at(healthy, plant(where, self.lost), statics)
        sentence = the_finding(answer, where, "damping", "joint_3")
        assert "the viscous damping of joint_3 is lost (0 instead of 20" in sentence

    def test_planted_in_the_reader(self, healthy, misread, statics):
        def lost(database):
            effects = dict(database.effects)
            rows = [
                replace(row, values={"coefficient": 0.0}) if row.at == 3 else row for row in effects["viscous_friction"]
            ]
            effects["viscous_friction"] = tuple(rows)
            return replace(database, effects=type(database.effects)(effects))

        answer = looked_at(healthy, misread(lost), statics)
        sentence = the_finding(answer, "reader", "damping", "joint_3")
        assert "coefficient of row 3 (effects/viscous_friction.dat) is read as 0 instead of 20" in sentence

    def test_a_spring_s_damper_lost_in_the_text_of_an_export(self, healthy, faulty_backend, statics):
        def text(content):
            return re.sub(r'(name="joint_2" [^>]*damping=")[^"]*', r"\g<1>0.0", content)

        mjcf = faulty_backend("mjcf", text=lambda content: text(content) if "<mujoco" in content else content)
        sentence = the_finding(looked_at(healthy, [mjcf, "urdf"], statics), "mjcf", "damping", "joint_2")
        assert "the damping of joint_2 is lost (0 instead of 550" in sentence

    @pytest.mark.parametrize("where", BEFORE)
    def test_damping_that_nobody_asked_for(self, healthy, plant, statics, where):
        def gained(robot):
            return with_drive(robot, 1, lambda drive: replace(drive, damping=drive.damping + 0.04))

        answer = looked_at(healthy, plant(where, gained), statics)
        assert "the viscous damping of joint_1 is 30.04 instead of 30" in the_finding(
            answer, where, "damping", "joint_1"
        )


class TestSwappedRows:
    @staticmethod
    def swapped(robot):
        first, second = (robot.stages[i].arm.link for i in (1, 2))
        stages = list(robot.stages)
        for i, link in ((1, second), (2, first)):
            stages[i] = replace(stages[i], arm=replace(stages[i].arm, link=link))
        return replace(robot, stages=tuple(stages))

    @pytest.mark.parametrize("where", BEFORE)
    def test_planted_in_the_representation(self, healthy, plant, statics, where):
        answer = looked_at(healthy, plant(where, self.swapped), statics)
        sentence = the_finding(answer, where, "frame", "arm_2, arm_3")
        assert "rows arm_2 and arm_3 of the kinematics are swapped" in sentence

    def test_planted_in_the_reader(self, healthy, misread, statics):
        def swapped(database):
            first, second, third, *others = database.kinematics
            return replace(database, kinematics=(first, third, second, *others))

        answer = looked_at(healthy, misread(swapped), statics)
        assert "(kinematics.dat) is read as" in the_finding(answer, "reader", "frame", "arm_2, arm_3")


class TestDefaultDamping:
    def test_pybullet_s_default_damping_left_on(self, healthy, faulty_backend, statics):
        def text(content):
            return content.replace(
                '"linearDamping": 0.0, "angularDamping": 0.0', '"linearDamping": 0.04, "angularDamping": 0.04'
            )

        backend = faulty_backend("pybullet", text=text)
        answer = looked_at(healthy, [backend, "mjcf", "urdf"], statics)
        sentence = the_finding(answer, "pybullet", "default damping", "all arms")
        assert "every link is damped by 0.04 1/s" in sentence and "default damping" in sentence


class TestShiftOfTheReference:
    def late(self, law, by):
        return MotionLaw(law.knots + by, law.coefficients)

    @pytest.mark.parametrize("name", ["mjcf", "urdf", "exudyn"])
    def test_planted_in_an_engine(self, healthy, faulty_backend, name):
        scenario = scenarios(build(load(healthy)), ["compliant_motion"], 0.2)[0]
        step = step_of(scenario, backend_named(name))

        def shifted(engine):
            genuine = engine.reset
            engine.reset = lambda state, imposed: genuine(state, imposed and self.late(imposed, step))
            return engine

        others = [other for other in ("mjcf", "urdf", "exudyn") if other != name][:2]
        backends = [faulty_backend(name, load=shifted), *others]
        answer = agree(healthy, backends, quantities=["compliant_motion"], duration=0.2)
        sentence = the_finding(answer, name, "time shift", "robot")
        assert f"the reference comes {step!r} s late: one integration step" in sentence

    def test_planted_in_the_run(self, healthy, monkeypatch):
        import mbexport.core.control.controller as controller

        genuine = controller.Controller.__init__

        def begun(self, nominal, robot, control, motion, duration, torque=None):
            late = MotionLaw(motion.knots + 1 / control.rate, motion.coefficients)
            genuine(self, nominal, robot, control, late, duration, torque)

        monkeypatch.setattr(controller.Controller, "__init__", begun)
        answer = agree(healthy, ["mjcf", "urdf"], quantities=["rigid_loop"], duration=0.4)
        sentence = the_finding(answer, "motion", "time shift", "robot")
        assert "0.001 s late: one tick of the controller" in sentence

    def test_planted_in_the_motion_law(self, healthy, monkeypatch):
        genuine = MotionLaw.at
        monkeypatch.setattr(MotionLaw, "at", lambda self, t: genuine(self, np.asarray(t) - 1e-3))
        answer = agree(healthy, ["mjcf", "urdf"], quantities=["rigid_motion"], duration=0.4)
        sentence = " ".join(answer.sentences)
        assert not answer.agreed and "0.001 s late" in sentence and "in the motion law" in sentence

    def test_planted_in_the_reader(self, healthy, misread):
        def late(database):
            table = database.motions["wave"]
            moved = replace(table, q=(table.q[0], *table.q[:-1]))
            return replace(database, motions=type(database.motions)({"wave": moved}))

        answer = agree(healthy, misread(late), quantities=["tool_position"], states=4)
        assert not answer.agreed and len(answer.findings) == 1
        finding = answer.findings[0]
        assert finding.where == "reader" and finding.kind == "time shift"
        assert "the motion wave comes one row late" in finding.sentence


def test_a_single_engine_is_held_against_the_tables(healthy, plant, statics, arm_changed):
    """With one engine only, the tables still tell whether the export or what stands before it is wrong."""
    plant("build", arm_changed(3, mirrored))
    answer = looked_at(healthy, ["urdf"], statics)
    assert answer.findings[0].where == "build" and "Iyz of arm_3" in answer.sentences[0]


def test_an_export_that_cannot_be_run_is_a_disagreement(healthy, faulty_backend, statics):
    def broken(content):
        return content.replace('mass="', 'mass="-') if "<mujoco" in content else content

    answer = looked_at(healthy, [faulty_backend("mjcf", text=broken), "urdf"], statics)
    assert not answer.agreed and "its export cannot be run" in answer.sentences[0]


def test_gravity_turned_over(healthy, faulty_backend, statics):
    def text(content):
        return content.replace("0.0 0.0 -9.81", "0.0 0.0 9.81") if "<mujoco" in content else content

    answer = looked_at(healthy, [faulty_backend("mjcf", text=text), "urdf"], statics)
    assert "gravity is (0, 0, 9.81) instead of (0, 0, -9.81)" in the_finding(answer, "mjcf", "gravity", "robot")


def test_two_faults_of_two_engines_are_two_findings(healthy, faulty_backend, statics, arm_changed):
    def swapped(robot):
        return TestSwappedRows.swapped(robot)

    backends = [
        faulty_backend("mjcf", change=arm_changed(3, mirrored)),
        faulty_backend("urdf", change=swapped),
        "exudyn",
    ]
    answer = looked_at(healthy, backends, statics)
    assert {(finding.voices, finding.kind) for finding in answer.findings} == {
        (("mjcf",), "inertia"),
        (("urdf",), "frame"),
    }


def test_a_fault_that_two_exports_share_is_told_once(healthy, faulty_backend, statics, arm_changed):
    def longer(arm):
        return replace(arm, link=arm.link + VeitscheggerWu(a=0.01))

    change = arm_changed(2, longer)
    backends = [faulty_backend(name, change=change) for name in ("urdf", "pybullet")]
    answer = looked_at(healthy, [*backends, "mjcf", "exudyn"], statics)
    assert len(answer.findings) == 1 and answer.findings[0].voices == ("urdf", "pybullet")
    assert "a of arm_2 is 0.69 instead of 0.68 m" in answer.findings[0].sentence
    assert "in what their exports share" in answer.findings[0].sentence
