"""Steps a second through the interface against the leanest hand-written loop of the same engine, side by side.

    python benchmarks/steps.py [BACKEND ...]

Each loop reads the state at every tick of a 1 kHz PD controller and applies the same torques; it uses nothing of
mbexport but the emitted text. The interface's figure is the difference of two run lengths, so emission and loading do
not count; its record (positions, speeds, torques, tip, 1 kHz) does. Loops and runs take turns; the ratio is the median.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import mbexport
from mbexport.core.control import Control, default_pd
from mbexport.core.motion import MotionLaw, point_to_point
from mbexport.core.representation import Drive, FrictionModel, Robot, Spring, Term
from mbexport.core.simulation import Program, backend_named, backend_names

STEP, TICKS, PERIOD = 1.0e-4, 400, 1.0e-3
SUBSTEPS = round(PERIOD / STEP)
TURNS = 5
LEVEL, SMOOTH = 8.0, 1.0e-2
STIFFNESS = (1.8e5, 6.7e4, 1.8e5, 6.7e4, 3.1e4, 3.1e4)
DAMPING = (1.3e3, 5.5e2, 4.0e2, 1.1e2, 39.0, 4.3)
ROTORS = (60.0, 60.0, 25.0, 3.0, 1.5, 0.5)


def robot_for(case: str) -> Robot:
    """The paper's arm with rotors: rigid, with linear springs, or rigid with smooth Coulomb friction."""
    robot = mbexport.build(mbexport.load("imece2013"), "rigid")
    stages = []
    for i, stage in enumerate(robot.stages):
        drive = Drive(inertia=ROTORS[i])
        if case == "linear":
            drive = replace(drive, spring=Spring(STIFFNESS[i], DAMPING[i]))
        if case == "friction":
            drive = replace(drive, terms=(Term("coulomb_friction", "level", "level", (LEVEL,)),))
        stages.append(replace(stage, drive=drive))
    effects = {"rigid": (), "linear": ("joint_compliance",), "friction": ("coulomb_friction",)}[case]
    model = FrictionModel("smooth", SMOOTH)
    return replace(robot, stages=tuple(stages), effects=effects, friction=model)


def reference(motion: MotionLaw, control: Control, ticks: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """kp q_cmd + kd dq_cmd at each tick, kp, kd."""
    kp, kd = np.array(control.kp), np.array(control.kd)
    q, dq, _ = motion.at(np.arange(ticks) * PERIOD)
    return kp * q + kd * dq, kp, kd


def mujoco_loop(files: dict[str, str], case: str, motion: MotionLaw, control: Control) -> Callable[[int], None]:
    """mj_step in C between ticks; friction by a Python callback with NumPy, as one writes it by hand."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(next(text for name, text in files.items() if name.endswith(".xml")))
    model.opt.timestep = STEP
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)
    model.dof_frictionloss[:] = 0.0
    data = mujoco.MjData(model)
    motors = np.arange(0, model.nv, 2) if case == "linear" else np.arange(model.nv)

    def law(_: object, d: object) -> None:
        d.qfrc_passive[:] -= LEVEL * np.tanh(d.qvel / SMOOTH)  # type: ignore[attr-defined]

    def loop(ticks: int) -> None:
        feed, kp, kd = reference(motion, control, ticks)
        mujoco.mj_resetData(model, data)
        mujoco.set_mjcb_passive(law if case == "friction" else None)
        for k in range(ticks):
            data.qfrc_applied[motors] = feed[k] - kp * data.qpos[motors] - kd * data.qvel[motors]
            mujoco.mj_step(model, data, SUBSTEPS)
        mujoco.set_mjcb_passive(None)

    return loop


def mujoco_bare_loop(files: dict[str, str], case: str, motion: MotionLaw, control: Control) -> Callable[[int], None]:
    """The same without any law: the fastest that MuJoCo is."""
    return mujoco_loop(files, "rigid" if case == "friction" else case, motion, control)


def pinocchio_loop(files: dict[str, str], case: str, motion: MotionLaw, control: Control) -> Callable[[int], None]:
    """Classical Runge-Kutta on pinocchio.aba."""
    import pinocchio as pin

    text = next(text for name, text in files.items() if name.endswith(".urdf"))
    # bounded joints have one coordinate each
    model = pin.buildModelFromXML(text.replace('type="continuous"', 'type="revolute"'))
    data = model.createData()
    n = model.nv
    rotors, k_spring, b_spring = np.array(ROTORS), np.array(STIFFNESS), np.array(DAMPING)
    if case != "linear":
        model.armature = rotors

    def slope(x: np.ndarray, tau: np.ndarray) -> np.ndarray:
        if case == "linear":
            q, theta, dq, dtheta = x[:n], x[n : 2 * n], x[2 * n : 3 * n], x[3 * n :]
            passed = k_spring * (theta - q) + b_spring * (dtheta - dq)
            return np.concatenate([dq, dtheta, pin.aba(model, data, q, dq, passed), (tau - passed) / rotors])
        q, dq = x[:n], x[n:]
        if case == "friction":
            tau = tau - LEVEL * np.tanh(dq / SMOOTH)
        return np.concatenate([dq, pin.aba(model, data, q, dq, tau)])

    def loop(ticks: int) -> None:
        feed, kp, kd = reference(motion, control, ticks)
        half = 2 * n if case == "linear" else n
        x = np.zeros(2 * half)
        motor = slice(n, 2 * n) if case == "linear" else slice(0, n)
        speed = slice(3 * n, 4 * n) if case == "linear" else slice(n, 2 * n)
        for k in range(ticks):
            tau = feed[k] - kp * x[motor] - kd * x[speed]
            for _ in range(SUBSTEPS):
                k1 = slope(x, tau)
                k2 = slope(x + STEP / 2 * k1, tau)
                k3 = slope(x + STEP / 2 * k2, tau)
                k4 = slope(x + STEP * k3, tau)
                x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    return loop


def pybullet_loop(files: dict[str, str], case: str, motion: MotionLaw, control: Control) -> Callable[[int], None]:
    """Joint states, torques, stepSimulation; rotors by the mass matrix (rigid) or beside the engine (linear)."""
    import pybullet

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(next(text for name, text in files.items() if name.endswith(".urdf")))
        client = pybullet.connect(pybullet.DIRECT)
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_MAINTAIN_LINK_ORDER
        body = pybullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
    count = pybullet.getNumJoints(body, client)
    joints = [j for j in range(count) if pybullet.getJointInfo(body, j, client)[2] != pybullet.JOINT_FIXED]
    n = len(joints)
    pybullet.setGravity(0, 0, -9.81, client)
    pybullet.setTimeStep(STEP, client)
    pybullet.setJointMotorControlArray(
        body, joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * n, physicsClientId=client
    )
    for link in range(-1, count):
        pybullet.changeDynamics(
            body, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=client
        )
    rotors, k_spring, b_spring = np.array(ROTORS), np.array(STIFFNESS), np.array(DAMPING)

    def apply(torque: np.ndarray) -> None:
        pybullet.setJointMotorControlArray(
            body, joints, pybullet.TORQUE_CONTROL, forces=torque.tolist(), physicsClientId=client
        )
        pybullet.stepSimulation(client)

    def loop(ticks: int) -> None:
        feed, kp, kd = reference(motion, control, ticks)
        for j in joints:
            pybullet.resetJointState(body, j, 0.0, 0.0, client)
        theta, dtheta = np.zeros(n), np.zeros(n)
        for step in range(ticks * SUBSTEPS):
            states = pybullet.getJointStates(body, joints, client)
            q = np.array([state[0] for state in states])
            dq = np.array([state[1] for state in states])
            motor, speed = (theta, dtheta) if case == "linear" else (q, dq)
            if step % SUBSTEPS == 0:
                tau = feed[step // SUBSTEPS] - kp * motor - kd * speed
            if case == "linear":
                passed = k_spring * (theta - q) + b_spring * (dtheta - dq)
                apply(passed)
                dtheta = dtheta + STEP * (tau - passed) / rotors
                theta = theta + STEP * dtheta
                continue
            total = tau - LEVEL * np.tanh(dq / SMOOTH) if case == "friction" else tau
            mass = np.array(pybullet.calculateMassMatrix(body, q.tolist(), client))
            bias = np.array(
                pybullet.calculateInverseDynamics(body, q.tolist(), dq.tolist(), [0.0] * n, physicsClientId=client)
            )
            apply(total - rotors * np.linalg.solve(mass + np.diag(rotors), total - bias))

    return loop


def exudyn_loop(files: dict[str, str], case: str, motion: MotionLaw, control: Control) -> Callable[[int], None]:
    """The emitted script's model, stepped by its solver tick by tick; friction by a NumPy user function."""
    script: dict[str, object] = {"__name__": "arm"}
    exec(next(text for name, text in files.items() if name.endswith(".py")), script)
    command = np.zeros(len(ROTORS))

    def rubbing(mbs: object, t: float, item: int, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return command - LEVEL * np.tanh(np.asarray(v) / SMOOTH)

    model = script["build"]("free", rubbing if case == "friction" else None)  # type: ignore[operator]
    motor = model.motor

    def loop(ticks: int) -> None:
        feed, kp, kd = reference(motion, control, ticks)
        script["place"](model, 0.0, np.zeros(len(model.x)), np.zeros(len(model.x)))  # type: ignore[operator]
        for k in range(ticks):
            tau = feed[k] - kp * model.x[motor] - kd * model.v[motor]
            if case == "friction":
                command[:] = tau
            else:
                script["hold"](model, tau)  # type: ignore[operator]
            script["advance"](model, k * PERIOD, PERIOD, SUBSTEPS)  # type: ignore[operator]

    return loop


LOOPS = {"exudyn": exudyn_loop, "mjcf": mujoco_loop, "pybullet": pybullet_loop, "urdf": pinocchio_loop}


def timed(action: Callable[[], object]) -> float:
    """Seconds of one call."""
    began = time.perf_counter()
    action()
    return time.perf_counter() - began


def compare(name: str, case: str, make: Callable[..., Callable[[int], None]]) -> tuple[float, float, float]:
    """(steps a second through the interface, by the loop, ratio): medians of several turns."""
    robot = robot_for(case)
    control = default_pd(robot)
    motion = point_to_point(np.zeros(robot.n), np.full(robot.n, 0.3), 1.0)
    backend = backend_named(name)
    files = dict(backend.emit(robot, Program(motion, control, 1.0, STEP)).files)
    loop = make(files, case, motion, control)

    def run(ticks: int) -> None:
        mbexport.simulate(robot, backend, motion, control, duration=ticks * PERIOD, step=STEP)

    run(10)
    loop(10)
    ours, theirs = [], []
    for _ in range(TURNS):
        short = timed(lambda: run(TICKS // 4))
        ours.append(TICKS * SUBSTEPS / (timed(lambda: run(TICKS + TICKS // 4)) - short))
        theirs.append(TICKS * SUBSTEPS / timed(lambda: loop(TICKS)))
    ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
    return statistics.median(ours), statistics.median(theirs), ratio


def main() -> None:
    """Print a line a case."""
    wanted = sys.argv[1:] or [name for name in backend_names() if name in LOOPS]
    print(f"{'backend':<10} {'case':<28} {'interface':>10} {'by hand':>10} {'ratio':>6} {'goal':>5}   [steps/s]")
    for name in wanted:
        for case in ("rigid", "linear", "friction"):
            figures = compare(name, case, LOOPS[name])
            goal = 0.7 if case == "friction" else 0.9
            print(f"{name:<10} {case:<28} {figures[0]:>10.0f} {figures[1]:>10.0f} {figures[2]:>6.2f} {goal:>5}")
        if name == "mjcf":
            figures = compare(name, "friction", mujoco_bare_loop)
            print(
                f"{name:<10} {'friction, against no law':<28} {figures[0]:>10.0f} {figures[1]:>10.0f} "
                f"{figures[2]:>6.2f} {0.7:>5}"
            )


if __name__ == "__main__":
    main()
