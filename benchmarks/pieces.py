"""Controlled runs in MuJoCo as one piece of compiled code against the same runs step by step, alone and in two threads.

    python benchmarks/pieces.py

A Puma 560 with its friction follows ten seconds of its excitation under a PD controller of 1 kHz; nobody looks at the
torque behind its gears, as in a diagnosis. The ways take turns; the ratio is that of the medians.
"""

from __future__ import annotations

import statistics
import time
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import patch

import mbexport
from mbexport.backends.mujoco_engine import MujocoEngine
from mbexport.core.control import default_pd
from mbexport.core.motion import excitation
from mbexport.core.simulation.backend import Engine

DURATION, TURNS, THREADS = 10.0, 7, 2
# the contract's own method says that a run goes step by step
WAYS = {True: MujocoEngine.follow, False: Engine.follow}


def main() -> None:
    """Print a line a number of runs at a time."""
    robot = mbexport.build(mbexport.load("puma560"), "friction")
    motion, loop = excitation(robot), default_pd(robot)

    def run(number: int) -> None:
        del number
        mbexport.simulate(robot, "mjcf", motion, loop, duration=DURATION, without=("tau_link", "tool"))

    with ThreadPoolExecutor(THREADS) as pool:
        for runs in (1, THREADS):
            times: dict[bool, list[float]] = {True: [], False: []}
            for turn in range(TURNS + 1):
                for piece, way in WAYS.items():
                    with patch.object(MujocoEngine, "follow", way):
                        began = time.perf_counter()
                        list(pool.map(run, range(runs)))
                    # the first turn compiles
                    times[piece] += [time.perf_counter() - began] if turn else []
            piece, steps = (statistics.median(times[way]) for way in (True, False))
            print(
                f"{runs} at a time: {steps:.3f} s step by step, {piece:.3f} s as one piece, {steps / piece:.2f} times "
                "as fast",
                flush=True,
            )


if __name__ == "__main__":
    main()
