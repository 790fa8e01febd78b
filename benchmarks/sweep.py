"""Variants of the compliant paper arm through `sweep`, against bare MuJoCo loops that take the same steps.

    python benchmarks/sweep.py [VARIANTS [WORKERS [FOLDER]]]

The variants are those of examples/studies/compliance.sh (0.5 to 2 times the paper's stiffnesses, 2 s of the Greek key,
the motion imposed), as many as there are in whole blocks of its sampling. FOLDER takes what the sweep finds, as
`mbexport sweep` would have left it. Two loops are held against the sweep, in as many processes:

- by hand: six hinges with MuJoCo's own springs and dampers, a compiled callback that adds K theta + b theta', the tip
  read every millisecond; model, start and step are given to it. The leanest loop that finds the same tip.
- engine alone: the emitted model in one call over the 2 s, nothing read.

The loops take one variant in four, right after the sweep. Wall time is whole, processes' start included; CPU time is
that of the processes, which a busy machine changes less. Ratios are loop over sweep: 1 is a sweep that costs nothing.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import mbexport
from mbexport.core.control import Control
from mbexport.core.kinematics import dynamics, kinematics
from mbexport.core.parallel import cores
from mbexport.core.report.study import write_study
from mbexport.core.simulation import Program, backend_named
from mbexport.core.simulation.settle import imposed_start
from mbexport.core.study import Study, plan_study, results_of, run_study
from mbexport.core.study.figures import figure_names

DURATION = 2.0
PERIOD = 1.0e-3
# loops are run for one variant in so many
EVERY = 4
SEED = 2013
DAMPING = (1.3e3, 5.5e2, 4.0e2, 1.1e2, 39.0, 4.3)


def study_of(variants: int) -> Study:
    """The paper's question on some variants."""
    return plan_study(
        mbexport.load("imece2013"),
        ["joint_compliance.stiffness@all=0.5:2"],
        level="compliant",
        duration=DURATION,
        sampling="sobol",
        count=variants,
        seed=SEED,
    )


def part_of(study: Study, chosen: Sequence[int]) -> Study:
    """The same study of some of its variants, from 0."""
    plan, rows = study.design, list(chosen)
    return replace(study, design=replace(plan, values=plan.values[rows], unit=plan.unit[rows]))


@cache
def small() -> Study:
    """What all variants share, planned once a process."""
    return study_of(64)


@cache
def hand_written() -> Any:
    """A loop by hand: (stiffnesses, start, step) -> tip at every millisecond, shape (m, 3)."""
    import mujoco
    import numba

    from mbexport.core.simulation.by_address import floats

    law = small().experiment.motion
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
    return kinematics(robot).tool_in_base(small().experiment.motion.at(t)[0])[:, :3, 3]


def by_hand(springs: np.ndarray, start: np.ndarray, step: float) -> float:
    """Root mean square of the tip's error in the loop by hand [m]."""
    error = hand_written()(springs, start, step) - reference()
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


@cache
def loaded(step: float) -> Any:
    """The emitted model in its engine; springs are then set in place."""
    experiment = small().experiment
    robot = experiment.robot()
    return backend_named("mjcf").engine_for(robot, Program(experiment.motion, Control(), DURATION, step)), robot


def engine_alone(springs: np.ndarray, _: np.ndarray, step: float) -> float:
    """The emitted model, one call."""
    engine, robot = loaded(step)
    law = small().experiment.motion
    engine.drives.table.stiffness[:] = springs
    engine.reset(imposed_start(robot, engine, law), law)
    engine.advance(DURATION, round(DURATION / step))
    return 0.0


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
    variants = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else cores()
    study = study_of(variants)
    rms, step = (figure_names(6).index(name) for name in ("tip_rms", "step"))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(sys.argv[3]) if len(sys.argv) > 3 else Path(folder) / "study"
        outcomes, *swept = timed(lambda: run_study(study, place, workers=workers))
        if len(sys.argv) > 3:
            write_study(results_of(study, outcomes), place)
    count = len(study.design)
    chosen = range(0, count, EVERY)
    begun = starts(part_of(study, chosen))
    tasks = [(study.design.values[i], q, outcomes[i].figures[step]) for i, q in zip(chosen, begun, strict=True)]
    tips, *hand = timed(lambda: in_processes(by_hand, tasks, workers))
    _, *alone = timed(lambda: in_processes(engine_alone, tasks, workers))
    worst = max(abs(tip - outcomes[i].figures[rms]) for i, tip in zip(chosen, tips, strict=True))
    print(f"{count} variants of {DURATION} s in {swept[0]:.0f} s on {workers} workers; loops over {len(tasks)} of them")
    print(f"{'':<14} {'wall [s/variant]':>17} {'CPU [s/variant]':>16} {'wall ratio':>11} {'CPU ratio':>10}")
    each = {"sweep": (swept, count), "by hand": (hand, len(tasks)), "engine alone": (alone, len(tasks))}
    for name, ((wall, cpu), number) in each.items():
        print(
            f"{name:<14} {wall / number:>17.3f} {cpu / number:>16.3f} {wall / number / (swept[0] / count):>11.2f} "
            f"{cpu / number / (swept[1] / count):>10.2f}"
        )
    print(f"largest difference of the tip's error (rms) between sweep and the loop by hand: {worst:.1e} m")


if __name__ == "__main__":
    main()
