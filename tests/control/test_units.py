"""Controllers as FMI units: what is said of those that do not fit, and that those that do drive every engine."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.cli import main
from mbexport.core.control import Control, Signals, default_pd, read_signals, read_unit
from mbexport.core.database import load
from mbexport.core.errors import InputError, RefusedError, RunFileError, UsageError
from mbexport.core.kinematics import dynamics
from mbexport.core.recording import read_run
from mbexport.core.simulation import simulate
from mbexport.core.simulation.backend import MachineState

pytestmark = pytest.mark.usefixtures("fmpy")
BACKENDS = ("exudyn", "mjcf", "pybullet", "urdf")


@pytest.fixture(scope="module")
def pd(robot):
    return default_pd(robot, rate=500.0)


def gains(pd):
    """The parameters of the unit that make it this controller."""
    return {f"{name}_{i + 1}": gain for name in ("kp", "kd") for i, gain in enumerate(getattr(pd, name))}


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_pd_of_another_tool_is_the_pd_of_ours_in_every_engine(backend, robot, law, pd, pd_unit):
    """From one start to the last bit; each settled by itself, the unit by gains that were found, to 1e-14."""
    unit = read_unit(pd_unit(2, step=1.0 / pd.rate), 2, Signals(parameters=gains(pd)))
    assert unit.rate == pytest.approx(pd.rate)
    home = np.array(robot.home())
    start = MachineState(0.0, home + 0.01, np.zeros(2), home, np.zeros(2))
    for begin, same in ((start, 0.0), (None, 1e-13)):
        ours = simulate(robot, backend, law, pd, duration=0.06, start=begin)
        theirs = simulate(robot, backend, law, unit=unit, duration=0.06, start=begin)
        for signal in ("q_cmd", "q", "q_link", "dq"):
            assert np.abs(ours.joints[signal] - theirs.joints[signal]).max() <= 100.0 * same, signal
        assert np.abs(ours.tip - theirs.tip).max() <= same
        assert np.abs(ours.tip - ours.tip[0]).max() > 1e-3
    assert theirs.facts["controller"]["start"] == "in equilibrium under the controller"
    assert theirs.facts["control"] == {"mode": "torque", "rate": unit.rate}
    assert np.array_equal(theirs.joints["tau_cmd"], theirs.joints["tau"])


def test_limits_delay_and_passive_joints_are_the_robots_own(pd_unit, law, pd, robot):
    """What lies between a controller and the motor is the same for a unit."""
    stages = tuple(replace(stage, drive=replace(stage.drive, torque_limit=9.0)) for stage in robot.stages)
    slow = replace(robot, stages=stages, delay=3.0e-3)
    unit = read_unit(pd_unit(2), 2, Signals(parameters=gains(pd)))
    ours = simulate(slow, "urdf", law, replace(pd, torque_limit=(12.0, 7.0)), duration=0.06)
    rules = Control("torque", rate=pd.rate, torque_limit=(12.0, 7.0))
    theirs = simulate(slow, "urdf", law, rules, unit=unit, duration=0.06)
    assert np.abs(ours.tip - theirs.tip).max() < 1e-13
    assert np.abs(theirs.joints["tau"]).max(axis=0).tolist() == [9.0, 7.0]


def test_names_in_brackets_and_names_of_a_file_mean_the_same(pd_unit, robot, law, pd, tmp_path):
    plain = simulate(robot, "urdf", law, unit=read_unit(pd_unit(2), 2, Signals(parameters=gains(pd))), duration=0.02)
    renamed = {"q_1": "q[1]", "tau_2": "tau[2]", "q_cmd_1": "wanted", "tau_1": "u1", "dq_cmd_2": "rest"}
    path = pd_unit(2, name="other.fmu", names=renamed)
    told = [f"  {name}: {value!r}" for name, value in gains(pd).items()]
    lines = ["inputs: {wanted: q_cmd_1, rest: dq_cmd_2}", "outputs: {u1: tau_1}", "parameters:", *told]
    (tmp_path / "signals.yaml").write_text("\n".join(lines) + "\n")
    unit = read_unit(path, 2, read_signals(tmp_path / "signals.yaml"))
    run = simulate(robot, "urdf", law, unit=unit, duration=0.02)
    assert np.array_equal(run.tip, plain.tip)
    held = replace(unit, inputs=unit.inputs[:-1], held=((unit.inputs[-1][0], 2.0),))
    assert not np.array_equal(simulate(robot, "urdf", law, unit=held, duration=0.02).tip, plain.tip)


def test_without_gains_it_starts_at_rest_at_the_command(pd_unit, robot, law):
    """Gains of zero are none; the first torque then acts on a robot that stands where it was told to."""
    unit = read_unit(pd_unit(2), 2, Signals(parameters={"kp_1": 0.0}))
    run = simulate(robot, "urdf", law, unit=unit, duration=0.01)
    assert run.facts["controller"]["start"] == "at rest at the command"
    assert np.array_equal(run.joints["q"][0], np.array(robot.home()))
    sagged = run.joints["q_link"][0] - run.joints["q"][0]
    springs = np.array([stage.drive.spring.stiffness for stage in robot.stages])
    assert sagged == pytest.approx(-dynamics(robot).gravity(run.joints["q_link"][0]) / springs, rel=1e-9)


def wrong_units(pd_unit, tmp_path):
    """(path, what has to be said) of units that cannot be used."""
    (tmp_path / "text.fmu").write_text("no archive")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with zipfile.ZipFile(tmp_path / "escapes.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<a/>")
        archive.writestr("../../escaped", "out")
    with zipfile.ZipFile(tmp_path / "broken.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="2.0">')
    yield tmp_path / "none.fmu", "there is no such file"
    yield tmp_path, "is no unit"
    yield tmp_path / "text.fmu", "a .fmu is a zip archive"
    yield tmp_path / "empty.fmu", "no modelDescription.xml"
    yield tmp_path / "escapes.fmu", "outside of its folder"
    yield tmp_path / "broken.fmu", "cannot be read"
    yield pd_unit(2, name="v1.fmu", version="1.0"), "it is of FMI 1.0; a controller is a co-simulation unit of FMI 2.0"
    yield pd_unit(2, name="v3.fmu", version="3.0"), "FMI 3.0"
    yield pd_unit(2, name="me.fmu", kind="ModelExchange"), "model exchange only"
    yield pd_unit(2, name="win.fmu", place="binaries/win64/pd.dll"), "binaries for win64 only"
    yield pd_unit(2, name="bare.fmu", place="sources/pd.c"), "no binary at all; `fmpy compile`"
    yield pd_unit(2, name="u.fmu", names={"tau_2": "u"}), "no output gives tau_2; its outputs are tau_1, u"
    yield pd_unit(2, name="in.fmu", names={"q_1": "x"}), "column x: no signal of a robot has this name"
    yield pd_unit(3, name="three.fmu"), "it means joint 3, and the robot has 2"
    yield pd_unit(2, name="twice.fmu", names={"tau_2": "tau[1]"}), "given by another output already"


def test_units_that_do_not_fit_are_told_all_that_is_wrong(pd_unit, tmp_path):
    for path, said in wrong_units(pd_unit, tmp_path):
        with pytest.raises(InputError) as caught:
            read_unit(path, 2)
        assert said in str(caught.value), path.name
    both = pd_unit(2, name="both.fmu", names={"tau_1": "u1", "tau_2": "u2", "q_1": "x"}, place="binaries/win64/pd.dll")
    with pytest.raises(InputError) as caught:
        read_unit(both, 2)
    assert len(caught.value.problems) == 3
    assert not (tmp_path.parent / "escaped").exists()


def test_a_file_of_signals_that_does_not_fit_is_told(pd_unit, tmp_path):
    path = tmp_path / "signals.yaml"
    path.write_text("inputs: {x: tau_1}\noutputs: {u: q_1}\nparameters: {kp_1: high}\nextra: 1\n")
    with pytest.raises(RunFileError) as caught:
        read_signals(path)
    assert [problem.line for problem in caught.value.problems] == [4, 1, 2, 3]
    path.write_text("inputs: {x: q_1}\nparameters: {gain: 3}\n")
    with pytest.raises(InputError, match="column x: the unit has no input of that name") as caught:
        read_unit(pd_unit(2), 2, read_signals(path))
    assert "the unit has no parameter of that name; it has kp_1" in str(caught.value)


@pytest.mark.parametrize(
    ("fault", "said"),
    [(1.0, "cannot take its step at t = 0.006 s: .*too hot at 0.006 s"), (2.0, "its tau_1 is nan")],
)
def test_a_unit_that_fails_is_told_with_its_own_words(fault, said, pd_unit, robot, law):
    unit = read_unit(pd_unit(2), 2, Signals(parameters={"fault_1": fault}))
    with pytest.raises(RefusedError, match=said):
        simulate(robot, "urdf", law, unit=unit, duration=0.02)


def test_a_binary_that_is_none_or_of_another_unit_is_refused(pd_unit, robot, law, tmp_path):
    path = pd_unit(2)
    other = replace(read_unit(path, 2), guid="another")
    with pytest.raises(RefusedError, match=r"cannot be loaded: .*guid another is not mine"):
        simulate(robot, "urdf", law, unit=other, duration=0.02)
    with zipfile.ZipFile(path) as archive:
        texts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "text.fmu", "w") as archive:
        for name, content in texts.items():
            archive.writestr(name, b"no library" if name.endswith(".so") else content)
    with pytest.raises(RefusedError, match="cannot be loaded"):
        simulate(robot, "urdf", law, unit=read_unit(tmp_path / "text.fmu", 2), duration=0.02)


def test_reading_a_unit_executes_nothing_of_it(pd_unit, tmp_path):
    """Its library is not even one."""
    with zipfile.ZipFile(pd_unit(2)) as archive:
        texts = {name: archive.read(name) for name in archive.namelist()}
    path = tmp_path / "junk.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in texts.items():
            archive.writestr(name, b"junk" if name.endswith(".so") else content)
    assert read_unit(path, 2).tool == "by hand"


def test_the_command_line_runs_a_unit_and_its_run_is_one_that_can_be_read(pd_unit, tmp_path, capsys):
    words = ["simulate", "planar2r", "--backend", "urdf", "--motion", "excitation", "--duration", "0.02"]
    (tmp_path / "rate.yaml").write_text("control: {mode: torque, rate: 250, torque_limit: [5, 5]}\n")
    unit = pd_unit(2)
    with pytest.raises(SystemExit) as ended:
        main([*words, "--controller", str(unit), "--control", str(tmp_path / "rate.yaml"), "-o", str(tmp_path / "run")])
    assert not ended.value.code
    run = read_run(tmp_path / "run", load("planar2r"))
    assert run.control == Control("torque", rate=250.0, torque_limit=(5.0, 5.0))
    assert {"q_cmd", "tau_cmd"} <= set(run.signals)
    wrong = (["--controller", str(tmp_path / "none.fmu")], ["--signals", str(tmp_path / "rate.yaml")])
    for more, said in zip(wrong, ("no such file", "--controller"), strict=True):
        with pytest.raises(SystemExit) as ended:
            main([*words, *more, "-o", str(tmp_path / "other")])
        printed = capsys.readouterr().err
        assert ended.value.code == 2
        assert said in printed
        assert "Traceback" not in printed


def test_what_excludes_each_other_is_told(pd_unit, robot, law, pd):
    unit = read_unit(pd_unit(2), 2)
    with pytest.raises(UsageError, match="the control part says mode pd"):
        simulate(robot, "urdf", law, pd, unit=unit, duration=0.02)
    with pytest.raises(UsageError, match="gives 2 torques"):
        simulate(build(load("pendulum")), "urdf", "hold", unit=unit, duration=0.02)
    with pytest.raises(RefusedError, match="controller_gain"):
        simulate(replace(robot, kp_factor=(1.0, 1.1)), "urdf", law, unit=unit, duration=0.02)
