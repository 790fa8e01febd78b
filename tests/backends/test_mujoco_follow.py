"""A controlled run of MuJoCo as one piece: to the bit what it is step by step, in threads beside one another too."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from mbexport.backends import mujoco_follow
from mbexport.backends.mujoco_engine import MujocoEngine
from mbexport.core.control import Control
from mbexport.core.errors import RefusedError
from mbexport.core.motion import point_to_point
from mbexport.core.representation import Drive, Sensor, Slip, Spring, Stick, Term
from mbexport.core.simulation import MachineState, simulate

N = 3
PD = Control("pd", kp=(900.0, 700.0, 500.0), kd=(60.0, 50.0, 40.0), feedforward="inverse_dynamics", rate=500.0)
MOTION = point_to_point([0.0] * N, [0.4, -0.3, 0.2], 0.4)
UNSEEN = ("tau_link", "tool")


def term(effect, *parameters):
    return Term(effect, "level", "level", parameters)


STICK = Stick(1.0e-4, 1.0e-3)
DRIVES = {
    "rigid": lambda i: Drive(inertia=2.0, damping=3.0),
    "elastic": lambda i: Drive(inertia=2.0, spring=Spring(4.0e3 + 300.0 * i, 20.0), torque_limit=40.0),
    "one elastic": lambda i: Drive(inertia=2.0, spring=Spring(4.0e3, 20.0) if i == 1 else None),
    "smooth friction": lambda i: Drive(inertia=2.0, terms=(term("coulomb_friction", 5.0 + i),)),
    "sticking": lambda i: Drive(inertia=2.0, terms=(term("coulomb_friction", 5.0 + i),), stick=STICK),
    "friction under load": lambda i: Drive(inertia=2.0, terms=(term("load_friction", 0.1),), stick=STICK),
    "play": lambda i: Drive(inertia=2.0, spring=Spring(4.0e3, 20.0, 2.0e-4)),
    "hysteresis": lambda i: Drive(inertia=2.0, slips=(Slip(900.0, 3.0), Slip(300.0, 2.0))),
}
CONTROLS = {
    "pd": PD,
    "limited": replace(PD, torque_limit=(12.0, 9.0, 6.0)),
    "speeds of positions": replace(PD, differenced=2.0),
    "speeds somewhat late": replace(PD, differenced=0.3),
    "positions ahead": replace(PD, ahead=0.3),
    "a command that is held": replace(PD, every=4),
}


def run(robot, control=PD, **more):
    return simulate(robot, "mjcf", MOTION, control, rate=250.0, without=UNSEEN, **more).joints


@pytest.fixture
def stepwise(monkeypatch):
    """The same run step by step."""

    def made(*args, **more):
        with monkeypatch.context() as patch:
            patch.setattr(MujocoEngine, "follow", lambda *_: False)
            return run(*args, **more)

    return made


def same(some, others):
    assert some.keys() == others.keys()
    for name, values in some.items():
        np.testing.assert_array_equal(values, others[name], err_msg=name)


@pytest.mark.parametrize("drive", DRIVES)
def test_a_run_as_one_piece_is_the_run_step_by_step(random_robot, stepwise, drive):
    robot = random_robot(5, N, DRIVES[drive])
    whole = run(robot)
    assert np.abs(whole["q"] - whole["q_cmd"]).max() > 1e-6
    same(whole, stepwise(robot))


@pytest.mark.parametrize("control", CONTROLS)
def test_every_controller_acts_as_it_does_step_by_step(random_robot, stepwise, control):
    robot = random_robot(6, N, DRIVES["smooth friction"])
    whole = run(robot, CONTROLS[control])
    same(whole, stepwise(robot, CONTROLS[control]))
    if control != "pd":
        assert not np.array_equal(whole["tau"], run(robot)["tau"])


@pytest.mark.parametrize("delay", [0.0031, 0.004])
def test_delays_offsets_and_recorded_torques(random_robot, stepwise, delay):
    """Ticks, switches and rows of three rates: a step of MuJoCo has another length on the way to each."""
    robot = replace(random_robot(7, N, DRIVES["sticking"]), delay=delay)
    stages = tuple(replace(stage, sensor=Sensor(0.01 * i, 0.5)) for i, stage in enumerate(robot.stages, 1))
    robot = replace(robot, stages=stages)
    same(run(robot), stepwise(robot))
    torque = np.random.default_rng(1).normal(0.0, 4.0, (201, N))
    recorded = {"control": Control("torque", rate=500.0), "torque": torque}
    same(run(robot, **recorded), stepwise(robot, **recorded))


def test_it_is_one_piece_indeed(random_robot, monkeypatch):
    """Nothing else advances the engine; what only drives know is asked step by step."""
    robot = random_robot(5, N, DRIVES["smooth friction"])
    monkeypatch.setattr(MujocoEngine, "advance", lambda *_: pytest.fail("step by step"))
    run(robot)
    with pytest.raises(pytest.fail.Exception):
        simulate(robot, "mjcf", MOTION, PD)


def test_runs_in_threads_are_what_they_are_alone(random_robot):
    """Each way of calling drives at once, and none: callbacks belong to the process."""
    robots = [random_robot(seed, N, drive) for seed in (1, 2) for drive in DRIVES.values()]
    alone = [run(robot) for robot in robots]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(3):
            for some, others in zip(alone, pool.map(run, robots), strict=True):
                same(some, others)
    assert mujoco.get_mjcb_control() is None


def test_a_run_that_breaks_down_says_when(random_robot, stepwise):
    robot = random_robot(5, N, DRIVES["smooth friction"])
    wild = MachineState(0.0, np.zeros(N), np.full(N, 1e200), np.zeros(N), np.full(N, 1e200))
    said = []
    for go in (run, stepwise):
        with pytest.raises(RefusedError, match="no longer finite at t = ") as refused:
            go(robot, start=wild)
        said.append(str(refused.value))
    assert said[0] == said[1]
    # and leaves its seat
    assert mujoco.get_mjcb_control() is None


def test_without_mujocos_own_step_a_run_goes_step_by_step(random_robot, monkeypatch):
    robot = random_robot(5, N, DRIVES["smooth friction"])
    whole = run(robot)
    monkeypatch.setattr("mbexport.backends.mujoco_engine.timestep_of", lambda model: None)
    same(whole, run(robot))


def test_the_step_is_where_mujoco_reads_it():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'
    )
    model.opt.timestep = 0.125
    found = mujoco_follow.timestep_of(model)
    assert found is not None
    assert found[0] == model.opt.timestep == 0.125
    found[0] = 0.25
    assert model.opt.timestep == 0.25
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert data.time == 0.25
