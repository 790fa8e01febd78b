"""Variants of the compliant paper arm through `sweep`, against bare MuJoCo loops that take the same steps.

    python benchmarks/sweep.py [VARIANTS [WORKERS]]

Every variant has other stiffnesses (Latin hypercube, 0.5 to 2 times the paper's) and draws 2 s of the Greek key, its
motion imposed. Two loops are held against it, in as many processes:

- by hand: six hinges with MuJoCo's own springs and dampers, a compiled callback that adds K theta + b theta', the tip
  read every millisecond; model, start and step are given to it. The leanest loop that finds the same tip.
- engine alone: the emitted model in one call over the 2 s, nothing read.

The three take turns in blocks of variants. Wall time is whole, processes' start included; CPU time is that of the
processes, which a busy machine hardly changes. Ratios are loop over sweep: 1 is a sweep that costs nothing.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import mbexport
from mbexport.core.control import Control
from mbexport.core.kinematics import dynamics, kinematics
from mbexport.core.parallel import cores
from mbexport.core.simulation import Program, backend_named
from mbexport.core.simulation.settle import imposed_start
from mbexport.core.study import Study, plan_study, run_study
from mbexport.core.study.figures import figure_names

DURATION = 2.0
PERIOD = 1.0e-3
BLOCK = 100
DAMPING = (1.3e3, 5.5e2, 4.0e2, 1.1e2, 39.0, 4.3)


def study_of(variants: int, seed: int) -> Study:
    """Some variants of the compliant arm."""
    return plan_study(
        mbexport.load("imece2013"),
        ["joint_compliance.stiffness@all=0.5:2"],
        level="compliant",
        duration=DURATION,
        sampling="lhs",
        count=variants,
        seed=seed,
    )


@cache
def hand_written() -> Any:
    """A loop by hand: (stiffnesses, start, step) -> tip at every millisecond, shape (m, 3)."""
    import mujoco
    import numba

    from mbexport.core.simulation.by_address import floats

    study = study_of(10, 0)
    law = study.experiment.motion
    robot = mbexport.build(mbexport.load("imece2013"), "rigid")
    emission = backend_named("mjcf").emit(robot, Program(law, Control(), DURATION, 1.0e-4))
    model = mujoco.MjModel.from_xml_string(emission.files[emission.main])
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CONSTRAINT | off.mjDSBL_CONTACT | off.mjDSBL_SENSOR)
    model.jnt_actfrclimited[:] = 0
    model.dof_damping[:] = DAMPING
    model.qpos_spring[:] = 0.0
    data = mujoco.MjData(model)
    spacing = float(law.knots[1])
    assert np.allclose(np.diff(law.knots), spacing)
    coefficients = np.ascontiguousarray(law.coefficients)
    order, pieces, n = coefficients.shape
    # calls, time at which the loop began, step
    clock, stiffness, damping = np.zeros(3), np.zeros(n), np.array(DAMPING)
    # the loop keeps them alive: compiled code has their addresses only
    kept = (clock, stiffness, damping, coefficients, data.qfrc_applied)
    at = [array.ctypes.data for array in kept]
    clock_at, stiffness_at, damping_at, table_at, applied_at = at

    @numba.cfunc("void(intp, intp)")
    def push(_: int, __: int) -> None:
        now = floats(clock_at, 3)
        stage = int(now[0]) % 4
        t = now[1] + (int(now[0]) // 4 + (0.0 if stage == 0 else 1.0 if stage == 3 else 0.5)) * now[2]
        now[0] += 1.0
        piece = min(int(t / spacing + 1.0e-9), pieces - 1)
        x = t - piece * spacing
        table = floats(table_at, order * pieces * n).reshape((order, pieces, n))
        applied = floats(applied_at, n)
        k, b = floats(stiffness_at, n), floats(damping_at, n)
        for i in range(n):
            theta = slope = 0.0
            for power in range(order):
                slope = slope * x + theta
                theta = theta * x + table[power, piece, i]
            applied[i] = k[i] * theta + b[i] * slope

    ticks = round(DURATION / PERIOD)

    def loop(springs: np.ndarray, start: np.ndarray, step: float) -> np.ndarray:
        assert kept
        steps = round(PERIOD / step)
        model.opt.timestep = PERIOD / steps
        model.jnt_stiffness[:] = stiffness[:] = springs
        mujoco.mj_resetData(model, data)
        data.qpos[:] = start
        tip = np.empty((ticks + 1, 3))
        mujoco.mj_kinematics(model, data)
        tip[0] = data.site_xpos[0]
        mujoco.set_mjcb_control(push.ctypes)
        for k in range(ticks):
            clock[:] = 0.0, k * PERIOD, PERIOD / steps
            mujoco.mj_step(model, data, steps)
            mujoco.mj_kinematics(model, data)
            tip[k + 1] = data.site_xpos[0]
        mujoco.set_mjcb_control(None)
        return tip

    return loop


@cache
def reference() -> np.ndarray:
    """Where the rigid tip is, shape (m, 3)."""
    t = np.arange(round(DURATION / PERIOD) + 1) * PERIOD
    robot = mbexport.build(mbexport.load("imece2013"), "rigid")
    return kinematics(robot).tool_in_base(study_of(10, 0).experiment.motion.at(t)[0])[:, :3, 3]


def by_hand(springs: np.ndarray, start: np.ndarray, step: float) -> float:
    """Root mean square of the tip's error in the loop by hand [m]."""
    error = hand_written()(springs, start, step) - reference()
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@cache
def loaded(step: float) -> Any:
    """The emitted model in its engine; springs are then set in place."""
    experiment = study_of(10, 0).experiment
    robot = experiment.robot()
    return backend_named("mjcf").engine_for(robot, Program(experiment.motion, Control(), DURATION, step)), robot


def engine_alone(springs: np.ndarray, _: np.ndarray, step: float) -> float:
    """The emitted model, one call."""
    engine, robot = loaded(step)
    law = the_motion()
    engine.drives.table.stiffness[:] = springs
    engine.reset(imposed_start(robot, engine, law), law)
    engine.advance(DURATION, round(DURATION / step))
    return 0.0


@cache
def the_motion() -> Any:
    """The motion, planned once a process."""
    return study_of(10, 0).experiment.motion


def starts(study: Study) -> list[np.ndarray]:
    """Where each variant hangs at first, worked out beforehand: q = theta - g(q) / K."""
    robot = mbexport.build(mbexport.load("imece2013"), "rigid")
    arms = dynamics(robot)
    theta = study.experiment.motion.at(0.0)[0]
    found = []
    for springs in study.design.values:
        q = theta.copy()
        for _ in range(40):
            q = theta - arms.gravity(q) / springs
        found.append(q)
    return found


def timed(action: Any) -> tuple[Any, float, float]:
    """What an action gives, its wall time and the CPU time of its processes, ended by then [s]."""
    began, before = time.perf_counter(), os.times()
    made = action()
    after = os.times()
    cpu = sum(getattr(after, part) - getattr(before, part) for part in ("children_user", "children_system"))
    return made, time.perf_counter() - began, cpu


def in_processes(function: Any, tasks: list[Any], workers: int) -> list[float]:
    """A loop over all tasks in spawned processes."""
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        return [future.result() for future in [pool.submit(function, *task) for task in tasks]]


def main() -> None:
    """Print times, ratios, and how far the loop by hand is from the sweep."""
    variants = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else cores()
    rms, step = (figure_names(6).index(name) for name in ("tip_rms", "step"))
    total = np.zeros((3, 2))
    worst, steps = 0.0, 0
    done = 0
    while done < variants:
        study = study_of(max(2, min(BLOCK, variants - done)), seed=done)
        begun = starts(study)
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "study"
            outcomes, *swept = timed(lambda s=study, p=place: run_study(s, p, workers=workers))
        ran = [outcomes[i] for i in range(len(study.design))]
        tasks = [(v, q, o.figures[step]) for v, q, o in zip(study.design.values, begun, ran, strict=True)]
        found, *hand = timed(lambda t=tasks: in_processes(by_hand, t, workers))
        _, *alone = timed(lambda t=tasks: in_processes(engine_alone, t, workers))
        total += [swept, hand, alone]
        worst = max(worst, *(abs(a - o.figures[rms]) for a, o in zip(found, ran, strict=True)))
        steps += sum(round(DURATION / o.figures[step]) for o in ran)
        done += len(ran)
    print(
        f"{done} variants of {DURATION} s, {steps} steps of RK4, {workers} workers; one more, nominal, is the sweep's"
    )
    print(f"{'':<14} {'wall [s]':>9} {'CPU [s]':>9} {'steps/s of CPU':>15} {'wall ratio':>11} {'CPU ratio':>10}")
    for name, (wall, cpu) in zip(("sweep", "by hand", "engine alone"), total.tolist(), strict=True):
        print(
            f"{name:<14} {wall:>9.1f} {cpu:>9.1f} {steps / cpu:>15.0f} {wall / total[0, 0]:>11.2f} "
            f"{cpu / total[0, 1]:>10.2f}"
        )
    print(f"largest difference of the tip's error (rms) between sweep and the loop by hand: {worst:.1e} m")


if __name__ == "__main__":
    main()
