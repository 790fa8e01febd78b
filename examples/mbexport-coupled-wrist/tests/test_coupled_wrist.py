"""Two joints on one axis, whose motion has a closed form, and the torque that an imposed motion takes."""

import math

import numpy as np
import pytest
from mbexport_coupled_wrist import coulomb

import mbexport
from mbexport.core.motion import point_to_point

FIRST, SECOND = 0.05, 0.02
INERTIA = np.array([[FIRST + SECOND, SECOND], [SECOND, SECOND]])


@pytest.fixture
def axle(tmp_path):
    """Two wheels on one axis, no gravity, and the table of one effect."""

    def make(effect, **row):
        folder = tmp_path / effect
        (folder / "effects").mkdir(parents=True, exist_ok=True)
        (folder / "robot.yaml").write_text("name: axle\ngravity: [0, 0, 0]\n")
        (folder / "kinematics.dat").write_text("arm alpha a theta d\n1 0 0 0 0.1\n2 0 0 0 0.1\n")
        (folder / "inertia.dat").write_text(
            f"arm mass x y z Ixx Iyy Izz\n1 1 0 0 0 0.04 0.04 {FIRST}\n2 1 0 0 0 0.02 0.02 {SECOND}\n"
        )
        at = row.pop("at", 2)
        cells = " ".join(map(repr, row.values()))
        (folder / "effects" / f"{effect}.dat").write_text(f"joint {' '.join(row)}\n{at} {cells}\n")
        return folder

    return make


@pytest.mark.parametrize("backend", ["mjcf", "urdf", "exudyn", "pybullet"])
@pytest.mark.parametrize("ratio", [1.0, -0.4])
def test_wheels_run_out_together(axle, backend, ratio):
    """M w' = -c v (v.w) with v = (ratio, 1): v.w falls as exp(-c v.M^-1 v t), what is square to v stays."""
    c = 0.03
    robot = mbexport.build(mbexport.load(axle("coupled_viscous_friction", coefficient=c, ratio=ratio)))
    speeds, v = np.array([2.0, 3.0]), np.array([ratio, 1.0])
    start = mbexport.MachineState(0.0, np.zeros(2), speeds, np.zeros(2), speeds)
    run = mbexport.simulate(
        robot,
        backend,
        point_to_point([0.0, 0.0], [0.0, 0.0], 0.5),
        mbexport.Control("torque"),
        start=start,
        torque=np.zeros((501, 2)),
        step=1.0e-3,
    )
    response = np.linalg.solve(INERTIA, v)
    rate = c * (v @ response)
    lost = (v @ speeds) * -np.expm1(-rate * run.t) / rate
    expected = speeds - c * lost[:, None] * response
    # an engine of first order is off by about rate times step
    assert run.joints["dq"] == pytest.approx(expected, abs=2e-3 if backend == "pybullet" else 2e-5)
    assert abs(expected[-1] - speeds).max() > 0.1


def test_both_joints_feel_it_along_an_imposed_motion(axle):
    """Rigid wheels take M q'', and each its part of Fc tanh(w / velocity)."""
    ratio, torque, velocity = 0.5, 0.7, 0.05
    row = {"torque": torque, "ratio": ratio, "velocity": velocity}
    robot = mbexport.build(mbexport.load(axle("coupled_coulomb_friction", **row)))
    motion = point_to_point([0.0, 0.0], [1.0, -0.3], 1.0)
    run = mbexport.simulate(robot, "mjcf", motion, mbexport.Control("motion"))
    _, dq, ddq = motion.at(run.t)
    rubs = torque * np.tanh((dq[:, 1] + ratio * dq[:, 0]) / velocity)
    assert run.joints["tau"] == pytest.approx(ddq @ INERTIA + np.outer(rubs, [ratio, 1.0]), abs=1e-6)


def test_the_law():
    assert coulomb((1.0, 2.0, 0.05), 0.0, 0, 10.0, 0, 0, 0) == pytest.approx(2.0)
    assert coulomb((1.0, 2.0, 0.05), 0.0, 0, -0.05, 0, 0, 0) == -2.0 * math.tanh(1.0)


def test_the_first_joint_has_none_before_it(axle):
    with pytest.raises(mbexport.UsageError, match="joint_1 has no joint before it"):
        mbexport.build(mbexport.load(axle("coupled_viscous_friction", coefficient=0.1, at=1)))
