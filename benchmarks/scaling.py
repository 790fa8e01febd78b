"""What the number of joints costs: emission in every format and simulation in every engine, 6 to 48 joints.

python benchmarks/scaling.py
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

import mbexport
from mbexport.core.control import Control
from mbexport.core.motion import point_to_point
from mbexport.core.representation import Arm, Drive, Inertia, Joint, Robot, Spring, Stage, VeitscheggerWu
from mbexport.core.simulation import Program, backend_named, backend_names

JOINTS = (6, 12, 24, 48)
STEP = 1.0e-4


def snake(n: int) -> Robot:
    """A compliant chain of n equal arms of 0.1 m whose axes turn about one another; it hangs."""
    arm = Inertia(1.0, (-0.05, 0.0, 0.0), 2e-3, 3e-3, 3e-3)
    stages = tuple(
        Stage(
            Joint(f"joint_{i + 1}"),
            Arm(f"arm_{i + 1}", VeitscheggerWu(alpha=math.pi / 2 * (-1) ** i, a=0.1), inertia=arm),
            Drive(inertia=0.1, spring=Spring(2.0e4, 20.0)),
        )
        for i in range(n)
    )
    template = mbexport.build(mbexport.load("pendulum"), "rigid")
    return replace(template, name=f"snake{n}", stages=stages, effects=("joint_compliance", "rotor_inertia"))


def fastest(action, repeats: int = 5) -> float:
    """Shortest of some times [s]."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        action()
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    """Print emission time and step time for each size, and the slope of both in a log-log fit."""
    names = [name for name in backend_names() if backend_named(name).runs]
    print(f"{'':<10} {'emission [ms] at joints':<40} {'':>6} {'step [us] at joints':<40}")
    print(f"{'backend':<10} " + " ".join(f"{n:>8}" for n in JOINTS) + "  slope  " + " ".join(f"{n:>8}" for n in JOINTS))
    for name in names:
        backend = backend_named(name)
        emitted, stepped = [], []
        for n in JOINTS:
            robot = snake(n)
            motion = point_to_point(np.zeros(n), np.full(n, 0.05), 1.0)
            program = Program(motion, Control(), 1.0, STEP)
            backend.emit(robot, program)
            emitted.append(fastest(lambda r=robot, b=backend, p=program: b.emit(r, p)))

            def run(duration: float, r: Robot = robot, b=backend, m=motion) -> None:
                mbexport.simulate(r, b, m, duration=duration, rate=100.0, step=STEP)

            run(0.01)
            # the difference of two lengths is free of emission and loading
            short, long = fastest(lambda: run(0.05), 3), fastest(lambda: run(0.25), 3)
            stepped.append((long - short) / (0.2 / STEP))
        slope = np.polyfit(np.log(JOINTS), np.log(emitted), 1)[0]
        print(
            f"{name:<10} "
            + " ".join(f"{1e3 * value:>8.1f}" for value in emitted)
            + f"  {slope:>5.2f}  "
            + " ".join(f"{1e6 * value:>8.1f}" for value in stepped)
        )


if __name__ == "__main__":
    main()
