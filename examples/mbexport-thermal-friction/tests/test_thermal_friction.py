"""The law against what can be worked out without a simulator, and all engines against one another."""

import math

import numpy as np
import pytest
from mbexport_thermal_friction import ThermalFriction, level, resistance
from scipy.integrate import quad, solve_ivp

import mbexport
from mbexport.core.motion import hold, point_to_point

INERTIA = 0.02
ROW = {"torque": 0.3, "coefficient": 0.05, "rise": 30.0, "time": 0.4, "softening": 20.0, "drift": -0.01}
P = tuple(ROW.values())


@pytest.fixture
def wheel(tmp_path):
    """A wheel on a motor: one joint, no gravity."""

    def make(**changed):
        folder = tmp_path / "wheel"
        (folder / "effects").mkdir(parents=True, exist_ok=True)
        (folder / "robot.yaml").write_text(
            "name: wheel\ngravity: [0, 0, 0]\nfriction: {model: smooth, velocity: 1.0e-2}\n"
        )
        (folder / "kinematics.dat").write_text("arm alpha a theta d\n1 0 0.2 0 0\n")
        (folder / "inertia.dat").write_text(f"arm mass x y z Ixx Iyy Izz\n1 1 -0.2 0 0 0.01 0.01 {INERTIA}\n")
        row = {**ROW, **changed}
        cells = " ".join(repr(value) for value in row.values())
        (folder / "effects" / "thermal_friction.dat").write_text(f"joint {' '.join(row)}\n1 {cells}\n")
        return folder

    return make


def run_out(robot, backend, speed, duration):
    """The wheel is let go at a speed, no torque."""
    spinning = mbexport.MachineState(0.0, np.zeros(1), np.full(1, speed), np.zeros(1), np.full(1, speed))
    ticks = math.floor(duration * 1000) + 1
    return mbexport.simulate(
        robot,
        backend,
        hold([0.0], duration),
        mbexport.Control("torque"),
        start=spinning,
        torque=np.zeros((ticks, 1)),
        step=1e-3,
    )


def test_cold_and_warm():
    assert resistance(P, 0.0, 0, 2.0, 0, 0, 0) == 2.0 * ROW["coefficient"]
    assert resistance(P, 1e3, 0, 2.0, 0, 0, 0) == pytest.approx(2.0 * ROW["coefficient"] * math.exp(-1.5), rel=1e-12)
    assert level(P, 0.0, 0, 2.0, 0, 0, 0) == ROW["torque"]
    assert level(P, 1e3, 0, -2.0, 0, 0, 0) == pytest.approx(0.7 * ROW["torque"], rel=1e-12)
    # after one time constant the rise is 1 - 1/e of itself
    warmer = ROW["rise"] * (1 - 1 / math.e)
    assert level(P, ROW["time"], 0, 1.0, 0, 0, 0) == pytest.approx(ROW["torque"] * (1 - 0.01 * warmer), rel=1e-12)


@pytest.mark.parametrize("backend", ["mjcf", "urdf"])
def test_a_wheel_runs_out_slower_as_it_warms(wheel, backend):
    """J w' = -c(t) w, so that w = w0 exp(-integral of c / J)."""
    robot = mbexport.build(mbexport.load(wheel(torque=0.0)))
    run = run_out(robot, backend, 30.0, 1.0)

    def coefficient(t):
        warmer = ROW["rise"] * -math.expm1(-t / ROW["time"])
        return ROW["coefficient"] * math.exp(-warmer / ROW["softening"])

    for k in range(0, len(run.t), 250):
        lost, _ = quad(coefficient, 0.0, run.t[k], epsabs=1e-13, epsrel=1e-13)
        assert run.joints["dq"][k, 0] == pytest.approx(30.0 * math.exp(-lost / INERTIA), rel=1e-8)
    cold = 30.0 * math.exp(-ROW["coefficient"] / INERTIA)
    assert run.joints["dq"][-1, 0] > 2 * cold


def test_with_coulomb_against_another_solver(wheel):
    robot = mbexport.build(mbexport.load(wheel()))
    run = run_out(robot, "urdf", 30.0, 0.5)

    def slope(t, w):
        warmer = ROW["rise"] * -math.expm1(-t / ROW["time"])
        viscous = ROW["coefficient"] * math.exp(-warmer / ROW["softening"]) * w
        return -(viscous + ROW["torque"] * (1 + ROW["drift"] * warmer) * np.tanh(w / 1e-2)) / INERTIA

    other = solve_ivp(slope, (0.0, 0.5), [30.0], "DOP853", run.t, rtol=1e-12, atol=1e-12)
    assert np.allclose(run.joints["dq"][:, 0], other.y[0], rtol=1e-8, atol=1e-8)


def test_the_motor_of_an_imposed_motion_feels_it(wheel):
    robot = mbexport.build(mbexport.load(wheel()))
    law = point_to_point(np.zeros(1), np.ones(1), 1.0)
    run = mbexport.simulate(robot, "mjcf", law)
    _, dq, ddq = (values[:, 0] for values in law.at(run.t))
    friction = [
        resistance(P, t, 0, w, 0, 0, 0) + level(P, t, 0, w, 0, 0, 0) * math.tanh(w / 1e-2)
        for t, w in zip(run.t, dq, strict=True)
    ]
    assert np.allclose(run.joints["tau"][:, 0], INERTIA * ddq + friction, atol=1e-12)


def test_all_engines_agree(wheel):
    answer = mbexport.agree(wheel(), duration=0.3, quantities=["drive_torque", "acceleration", "friction_loop"])
    assert answer.agreed, answer.sentences
    assert {"urdf", "mjcf"} <= {voice.name for voice in answer.voices}


def test_a_script_carries_the_law(wheel, tmp_path):
    emission = mbexport.export(mbexport.build(mbexport.load(wheel())), ["exudyn"], tmp_path / "out")["exudyn"]
    assert "math.exp(-warmer / p[4])" in emission.files[emission.main]


def test_what_cannot_be_is_refused(wheel):
    for changed, says in (({"drift": -0.1}, "negative"), ({"time": 0.0}, "time"), ({"softening": -1.0}, "softening")):
        with pytest.raises(mbexport.InputError, match=says):
            mbexport.load(wheel(**changed))


def test_it_is_listed():
    from mbexport.core.effects import effect_named

    assert isinstance(effect_named("thermal_friction"), ThermalFriction)
