"""Rigid-body dynamics against Pinocchio, against energy, and compiled against plain."""

from __future__ import annotations

import inspect
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mbexport.core.kinematics import chain_table, dynamics, kinematics, rigid_body
from mbexport.core.representation import Arm, Inertia, Joint, Pose, Robot, Stage, VeitscheggerWu

CASES = [(seed, n) for seed, n in enumerate((1, 2, 3, 5, 6, 8))]


def pinocchio_model(robot: Robot):
    """The robot in Pinocchio from the Veitschegger-Wu chain as the paper states it, not from our joint frames.

    Body of arm i stands in the chain's frame; its joint turns about the z axis of the frame before it.
    """
    pin = pytest.importorskip("pinocchio")
    model = pin.Model()
    base = robot.base.matrix()
    model.gravity = pin.Motion(base[:3, :3].T @ np.array(robot.gravity), np.zeros(3))
    parent, before = 0, pin.SE3.Identity()
    for stage in robot.stages:
        make = pin.JointModelRZ if stage.joint.kind == "revolute" else pin.JointModelPZ
        parent = model.addJoint(parent, make(), before, stage.joint.name)
        link = pin.SE3(stage.arm.link.matrix())
        body = stage.arm.inertia
        model.appendBodyToJoint(parent, pin.Inertia(body.mass, np.array(body.com), body.tensor()), link)
        before = link
    tool = before * pin.SE3(robot.tool.matrix())
    model.addFrame(pin.Frame("tool", parent, 0, tool, pin.FrameType.OP_FRAME))
    return pin, model, model.createData()


@pytest.mark.parametrize(("seed", "n"), CASES)
def test_agrees_with_pinocchio(random_robot: Callable[[int, int], Robot], seed: int, n: int) -> None:
    robot = random_robot(seed, n)
    pin, model, data = pinocchio_model(robot)
    ours, chain = dynamics(robot), kinematics(robot)
    rng = np.random.default_rng(100 + seed)
    for _ in range(5):
        q, dq, ddq = rng.uniform(-2, 2, size=(3, n))
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))
        assert np.max(np.abs(ours.mass_matrix(q) - M) / scale) < 1e-13
        for got, want in (
            (ours.inverse_dynamics(q, dq, ddq), pin.rnea(model, data, q, dq, ddq).copy()),
            (ours.bias(q, dq), pin.nonLinearEffects(model, data, q, dq).copy()),
            (ours.gravity(q), pin.computeGeneralizedGravity(model, data, q).copy()),
        ):
            assert np.max(np.abs(got - want)) < 1e-13 * (1.0 + np.max(np.abs(want)))
        pin.forwardKinematics(model, data, q, dq, ddq)
        pin.updateFramePlacements(model, data)
        tool = model.getFrameId("tool")
        assert np.allclose(chain.tool_in_base(q), data.oMf[tool].homogeneous, rtol=0, atol=1e-14)
        aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.computeFrameJacobian(model, data, q, tool, aligned).reshape(6, n)
        assert np.allclose(chain.jacobian(q), J, rtol=0, atol=1e-13)
        acceleration = pin.getFrameClassicalAcceleration(model, data, tool, aligned)
        got = chain.jacobian(q) @ ddq + chain.jacobian_rate(q, dq) @ dq
        assert np.allclose(got, np.concatenate([acceleration.linear, acceleration.angular]), rtol=0, atol=1e-12)


def test_compiled_and_batched_equal_plain(random_robot: Callable[[int, int], Robot]) -> None:
    robot = random_robot(3, 5)
    plain, fast = dynamics(robot), dynamics(robot, always_compiled=True)
    q, dq, ddq = np.random.default_rng(1).uniform(-2, 2, size=(3, 2, 3, 5))
    many_m, many_tau = plain.mass_matrix(q), plain.inverse_dynamics(q, dq, ddq)
    assert many_m.shape == (2, 3, 5, 5)
    for at in np.ndindex(2, 3):
        assert np.allclose(many_m[at], plain.mass_matrix(q[at]), rtol=1e-14, atol=1e-14)
        assert np.allclose(many_tau[at], plain.inverse_dynamics(q[at], dq[at], ddq[at]), rtol=1e-13, atol=1e-13)
        assert np.array_equal(fast.mass_matrix(q[at]), many_m[at])


def test_mass_matrix_and_bias_give_inverse_dynamics(random_robot: Callable[[int, int], Robot]) -> None:
    robot = random_robot(4, 6)
    q, dq, ddq = np.random.default_rng(2).uniform(-2, 2, size=(3, 6))
    M, h, tau = np.empty((6, 6)), np.empty(6), np.empty(6)
    table = chain_table(robot)
    rigid_body.mass_matrix_and_bias(table, q, dq, M, h)
    rigid_body.inverse_dynamics(table, q, dq, ddq, tau)
    assert np.allclose(M @ ddq + h, tau, rtol=1e-12, atol=1e-12)


def test_power_is_the_rate_of_energy(random_robot: Callable[[int, int], Robot]) -> None:
    """d/dt (kinetic + potential) = tau dq, the potential from the bodies' own places, not from the dynamics."""
    robot = random_robot(5, 4)
    ours, chain = dynamics(robot), kinematics(robot)
    gravity_in_base = robot.base.rotation_matrix().T @ np.array(robot.gravity)

    def energy(t: float) -> float:
        q, dq = motion(t)[:2]
        frames = chain.arms_in_base(q)
        heights = [
            -stage.arm.inertia.mass * gravity_in_base @ (frame[:3, :3] @ np.array(stage.arm.inertia.com) + frame[:3, 3])
            for stage, frame in zip(robot.stages, frames, strict=True)
        ]
        return 0.5 * dq @ ours.mass_matrix(q) @ dq + sum(heights)

    w = np.array([1.0, 1.7, 0.6, 2.3])

    def motion(t: float):
        return np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)

    for t in (0.3, 1.1, 2.0):
        q, dq, ddq = motion(t)
        h = 1e-3
        rate = (8 * (energy(t + h) - energy(t - h)) - energy(t + 2 * h) + energy(t - 2 * h)) / (12 * h)
        assert ours.inverse_dynamics(q, dq, ddq) @ dq == pytest.approx(rate, rel=1e-8)


def test_a_link_is_remembered_by_all_that_it_depends_on(random_robot: Callable[[int, int], Robot]) -> None:
    robot = random_robot(11, 4)
    first, arm = robot.stages[0], robot.stages[1].arm
    arms = (
        replace(arm, inertia=replace(arm.inertia, mass=arm.inertia.mass + 1.0)),
        replace(arm, link=replace(arm.link, a=arm.link.a + 0.1)),
        replace(arm, correction=VeitscheggerWu(a=0.1)),
        replace(arm, in_joint=Pose((0.1, 0.0, 0.0))),
    )
    joint = replace(robot.stages[1].joint, in_previous=Pose((0.0, 0.2, 0.0)))
    stages = [*(replace(robot.stages[1], arm=one) for one in arms), replace(robot.stages[1], joint=joint)]
    others = [replace(robot, stages=(first, stage, *robot.stages[2:])) for stage in stages]
    others.append(replace(robot, base_correction=VeitscheggerWu(alpha=0.5)))
    plain = chain_table(robot)
    for other in others:
        changed = chain_table(other)
        assert any(not np.array_equal(one, two) for one, two in zip(changed, plain, strict=True))
        for i in range(robot.n):
            body, placed = other.inertia_in_joint(i), other.joint_in_previous(i)
            assert changed.mass[i] == body.mass
            assert np.array_equal(changed.tensor[i], body.tensor())
            assert np.array_equal(changed.com[i], body.com)
            assert np.array_equal(changed.rotation[i], placed.rotation_matrix())
            assert np.array_equal(changed.position[i], placed.xyz)


def test_pendulum_by_hand() -> None:
    """A point-like bob on a horizontal axis: M = m l^2 + I, gravity = m g l cos(q)."""
    arm = Arm("arm_1", VeitscheggerWu(a=0.5), inertia=Inertia(2.0, (-0.1, 0.0, 0.0), 0.01, 0.02, 0.03))
    robot = Robot(
        "pendulum",
        (0.0, 0.0, -9.81),
        Pose.from_rpy((0.0, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)),  # z of the base lies flat, y points up
        VeitscheggerWu(),
        (Stage(Joint("joint_1"), arm),),
    )
    for q in (0.0, 0.4, -2.0):
        assert dynamics(robot).mass_matrix([q])[0, 0] == pytest.approx(2.0 * 0.4**2 + 0.03, rel=1e-14)
        assert dynamics(robot).gravity([q])[0] == pytest.approx(2.0 * 9.81 * 0.4 * math.cos(q), rel=1e-13)
    tilted = replace(robot, base=Pose())
    assert dynamics(tilted).gravity([0.4])[0] == pytest.approx(0.0, abs=1e-14)


def test_single_states_load_no_compiler() -> None:
    code = (
        "import sys;"
        "from mbexport.core.kinematics import dynamics, kinematics, inverse_kinematics, reach;"
        "from mbexport.core.representation import *;"
        "r = Robot('a', (0, 0, -9.81), Pose(), VeitscheggerWu(),"
        " (Stage(Joint('joint_1'), Arm('arm_1', VeitscheggerWu(a=1.0), inertia=Inertia(1.0))),));"
        "dynamics(r).mass_matrix(r.home());"
        "print([m for m in ('numba', 'scipy', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_text_stands_alone() -> None:
    """The functions' text needs nothing of the package: it goes verbatim into scripts."""
    space: dict[str, object] = {"__name__": "script"}
    exec(compile(inspect.getsource(rigid_body), "script", "exec"), space)
    assert "mbexport" not in inspect.getsource(rigid_body)
    assert callable(space["mass_matrix_and_bias"])
