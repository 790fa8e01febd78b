"""Units as the controller of a co-simulation: what they do is what the same law does where its equations are known."""

import json

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.cli import main
from mbexport.core.control import Control, Signals, default_pd, read_unit
from mbexport.core.cosimulation import (
    ContinuousController,
    Coupling,
    UnitInLoop,
    loop_of,
    measure,
    run_coupled,
    run_monolithic,
)
from mbexport.core.database import load
from mbexport.core.errors import RefusedError, UsageError
from mbexport.core.motion import point_to_point
from mbexport.core.simulation import backend_named

pytestmark = pytest.mark.usefixtures("fmpy")
PINOCCHIO = backend_named("urdf")
DURATION = 0.06


@pytest.fixture(scope="module")
def pd(robot):
    return default_pd(robot)


@pytest.fixture
def signals(pd):
    gains = {"kp": pd.kp, "kd": pd.kd}
    return Signals(parameters={f"{name}_{i + 1}": gain for name, row in gains.items() for i, gain in enumerate(row)})


@pytest.fixture
def unit(pd_unit, signals):
    return read_unit(pd_unit(2), 2, signals)


@pytest.fixture
def theirs(robot, unit, law):
    return loop_of(robot, UnitInLoop.of(robot, unit, law), DURATION)


@pytest.fixture
def ours(robot, pd, law):
    return loop_of(robot, ContinuousController.of(robot, pd, law, lag=0.0), DURATION)


@pytest.mark.parametrize("coupling", [Coupling(2e-3), Coupling(1e-3, 2), Coupling(2e-3, 1, memory=True)])
def test_a_unit_is_coupled_as_the_same_law_of_ours(coupling, ours, theirs):
    one, other = (run_coupled(loop, coupling, PINOCCHIO) for loop in (ours, theirs))
    assert np.abs(one.tip - other.tip).max() < 1e-13
    assert np.abs(one.torque - other.torque).max() < 1e-9
    assert np.abs(one.tip - one.tip[0]).max() > 1e-3


def test_what_a_unit_is_held_against_is_the_loop_itself(ours, theirs):
    """Coupled finely it is where the equations have it, as near as is said; and all orders are found against it."""
    study = measure(theirs, PINOCCHIO, (2e-3, 1e-3))
    reference = study.reference
    assert reference.because == "the controller's unit does not show its equations"
    off = np.abs(reference.tip - run_monolithic(ours, reference.t).tip).max()
    assert off < 2.0 * reference.known_to < 1e-8
    found = [orders[-1] for orders in study.observed_orders().values()]
    assert found == pytest.approx([1.0, 2.0, 3.0], abs=0.5)


def test_the_robots_limits_act_on_a_unit(robot, unit, law):
    rules = Control("torque", torque_limit=(9.0, 2.0))
    loop = loop_of(robot, UnitInLoop.of(robot, unit, law, rules), 0.01)
    torque = run_coupled(loop, Coupling(1e-3), PINOCCHIO).torque
    assert np.abs(torque).max(axis=0).tolist() == [9.0, 2.0]


def test_a_unit_that_fails_ends_the_study(robot, pd_unit, law):
    unit = read_unit(pd_unit(2), 2, Signals(parameters={"fault_1": 1.0}))
    with pytest.raises(RefusedError, match=r"cannot take its step at t = 0.00[56].*too hot"):
        run_coupled(loop_of(robot, UnitInLoop.of(robot, unit, law), DURATION), Coupling(1e-3), PINOCCHIO)


def test_what_does_not_fit_is_told(robot, unit, law, pd):
    with pytest.raises(UsageError, match="the control part says mode pd"):
        UnitInLoop.of(robot, unit, law, pd)
    with pytest.raises(UsageError, match="gives 2 torques"):
        pendulum = build(load("pendulum"))
        UnitInLoop.of(pendulum, unit, point_to_point((0.0,), (0.1,), 0.1))


def test_the_command_line_couples_a_unit(pd_unit, signals, tmp_path, capsys):
    said = tmp_path / "signals.yaml"
    said.write_text(f"parameters: {json.dumps(signals.parameters)}\n")
    words = ["cosimulate", "planar2r", "--backend", "urdf", "--motion", "excitation", "--level", "rigid"]
    words += ["--duration", "0.02", "--interval", "0.002", "--interval", "0.001", "--order", "0", "--memory"]
    words += ["--controller", str(pd_unit(2)), "--signals", str(said)]

    def status(*more):
        with pytest.raises(SystemExit) as ended:
            main([*words, *more])
        return ended.value.code or 0

    for name in ("a", "b"):
        assert status("-o", str(tmp_path / name)) == 0
    files = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert files == {path.name: path.read_bytes() for path in (tmp_path / "b").iterdir()}
    facts = json.loads(files["cosimulation.json"])
    assert facts["controller"]["file"] == "pd.fmu"
    assert facts["reference"]["interval"] == 0.001 / 8
    page = files["cosimulation.html"].decode()
    assert "pd.fmu, a unit of FMI 2.0 (by hand), with a solver of its own" in page
    assert "cannot be solved in one piece: the controller" in page
    for more in ("--lag", "--integral"):
        assert status(more, "0.1", "-o", str(tmp_path / "c")) == 2
        assert "has its own law" in capsys.readouterr().err
