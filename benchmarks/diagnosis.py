"""How long a diagnosis takes: three runs of 10 s of a six-joint arm with a load and friction that its model lacks.

    python benchmarks/diagnosis.py [--cores]

A Puma 560 is moved by Exudyn (a load of 1.2 kg, more Coulomb friction at joint 2, a pd controller with inverse dynamics
of the robot without them, positions, speeds and torques at 500 Hz with noise) and diagnosed in MuJoCo: where, which and
how far in one engine, two runs fitted and one held out, and each of the three left out in turn. Each is a process of
its own, reading included. With --cores the same on one core beside it: what the others are worth.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROBOT = "puma560"
DURATION, RATE = 10.0, 500.0
EFFECTS = {
    "payload.dat": "robot mass x y z\nrobot 1.2 0 0 0.08\n",
    "coulomb_friction.dat": "joint torque\n2 14\n",
}
LOG = """control:
  mode: pd
  kp: [3000, 6000, 2500, 120, 100, 60]
  kd: [120, 300, 110, 5, 4, 2.5]
  feedforward: inverse_dynamics
  rate: 1000
noise: {q: 2.0e-5, dq: 2.0e-3, tau: 0.3}
"""
RECORDED = ("t", "q_cmd", "dq_cmd", "ddq_cmd", "q", "dq", "tau")


def motion(seed: int) -> str:
    """A motion table: four sines a joint that begin and end at rest."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, DURATION + 0.5 / RATE, 1.0 / RATE)
    q = np.zeros((len(t), 6))
    for joint in range(6):
        for harmonic in range(1, 5):
            turn = 2.0 * np.pi * 0.1 * harmonic * (1.0 + 0.1 * rng.uniform())
            q[:, joint] += 0.5 * rng.normal() / harmonic * np.sin(turn * t + rng.uniform(0.0, 2.0 * np.pi))
    for near in (np.clip(t, 0.0, 1.0), np.clip(DURATION - t, 0.0, 1.0)):
        q *= (near**3 * (10.0 - 15.0 * near + 6.0 * near**2))[:, None]
    rows = (" ".join(f"{value:.9f}" for value in (time, *row)) for time, row in zip(t, q, strict=True))
    return "t " + " ".join(f"q{joint}" for joint in range(1, 7)) + "\n" + "\n".join(rows) + "\n"


def recorded(folder: Path) -> list[Path]:
    """Runs as a robot's log would have them: without what has no sensor."""
    import pandas as pd

    effects = folder / "effects"
    effects.mkdir()
    for name, text in EFFECTS.items():
        (effects / name).write_text(text)
    (folder / "log.yaml").write_text(LOG)
    runs: list[Path] = []
    for number in range(3):
        (folder / f"motion-{number}.dat").write_text(motion(number))
        run = folder / f"run-{number}"
        mbexport(
            *(
                "simulate",
                ROBOT,
                "--backend",
                "exudyn",
                "--motion",
                f"motion-{number}.dat",
                "--with-effects",
                "effects",
            ),
            *("--control", "log.yaml", "--rate", str(RATE), "--noise", "--seed", str(number), "-o", run.name),
            folder=folder,
        )
        data = pd.read_csv(run / "data.csv")
        kept = [name for name in data.columns if name.rpartition("_")[0] in RECORDED or name in RECORDED]
        data[kept].to_csv(run / "data.csv", index=False)
        runs.append(run)
    return runs


def mbexport(*words: str, folder: Path, cores: int | None = None) -> float:
    """Wall time of one command [s], on all cores or, where a system can say so, the first few."""
    everywhere = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    began = time.perf_counter()
    try:
        if everywhere:
            os.sched_setaffinity(0, everywhere[:cores])
        subprocess.run(
            [Path(sys.executable).with_name("mbexport"), *words],
            check=True,
            capture_output=True,
            cwd=folder,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )
    finally:
        if everywhere:
            os.sched_setaffinity(0, everywhere)
    return time.perf_counter() - began


def main() -> None:
    """Print a line a way of judging."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cores", action="store_true", help="the same on one core beside it")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = [run.name for run in recorded(folder)]
        for words, held in ((runs[:2], ("--holdout", runs[2])), (runs, ())):
            said = "one run held out" if held else "each left out in turn"
            times: list[float] = []
            for cores in (1, None) if options.cores else (None,):
                answer = f"answer-{len(words)}-{cores}"
                arguments = ("diagnose", ROBOT, *words, *held, "--backends", "mjcf", "-o", answer)
                times.append(mbexport(*arguments, folder=folder, cores=cores))
                which = json.loads((folder / answer / "diagnosis.json").read_text())["which"]
            found = ", ".join(f"{one['effect']} at {one['at']}" for one in which)
            share = f", {times[0] / times[-1]:.2f} times as fast as on one core ({times[0]:.1f} s)" if times[1:] else ""
            print(f"{said:<22} {times[-1]:6.1f} s on {os.cpu_count()} cores{share}: {found}", flush=True)


if __name__ == "__main__":
    main()
