"""Franka Emika Panda: one log of an exciting motion, about 1 kHz, one value a line, cut in time, as runs.

    python franka_panda.py DATA OUT

The file's stamps are those of the computer that wrote it, up to some milliseconds off, and every sixteenth of its rows
is the one before it again. The robot's clock ticks once a millisecond: how many ticks lie between two rows follows from
how far the joints went at their measured speeds, a whole number to a tenth in all but one row of 10,000.

Torques are those of sensors behind the gears. Friction is in them all the same, that of what turns behind the sensor,
so they are `tau` here: as `tau_link` no friction could be found in them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

LOG = """control: {mode: unknown}
source: github.com/marcocognetti/FrankaEmikaPandaDynModel (GPL-3.0)
"""


TICK = 1.0e-3
# sum of squared speeds from which they tell the time [rad^2/s^2]
TELLING = 0.05


def ticks(t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """The robot's clock at each row, from 0 [ticks], shape (m,).

    Args:
        t: Stamps of the file [s], shape (m,); they tell the time where the robot rests.
        q, dq: Positions [rad] and speeds [rad/s], shape (m, 7).
    """
    went, speed = np.diff(q, axis=0), 0.5 * (dq[1:] + dq[:-1])
    energy = np.sum(speed**2, axis=1)
    step = np.where(energy > TELLING, np.sum(went * speed, axis=1) / np.maximum(energy, TELLING), np.diff(t))
    return np.concatenate([[0.0], np.cumsum(np.maximum(np.round(step / TICK), 0.0))])


def convert(data: Path, out: Path, pieces: int) -> None:
    """Runs part-1, part-2 ... of equal length.

    Args:
        data: Folder rbt_log.
        out: Gets a folder a run.
        pieces: How many.
    """

    def values(name: str, width: int) -> np.ndarray:
        return np.loadtxt(data / f"exciting_traj_{name}.txt").reshape(-1, width)

    stamps, q, dq, tau = (values(*part) for part in (("time", 1), ("positions", 7), ("velocity", 7), ("torques", 7)))
    clock = ticks(stamps[:, 0], q, dq)
    fresh = np.diff(clock, prepend=-1.0) > 0.0
    table = np.column_stack([TICK * clock, q, dq, tau])[fresh]
    header = ",".join(["t"] + [f"{signal}_{i}" for signal in ("q", "dq", "tau") for i in range(1, 8)])
    for k, rows in enumerate(np.array_split(table, pieces), start=1):
        run = out / f"part-{k}"
        run.mkdir(parents=True, exist_ok=True)
        np.savetxt(run / "data.csv", rows, fmt="%.17g", delimiter=",", header=header, comments="")
        (run / "log.yaml").write_text(LOG, encoding="utf-8")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Panda: a log of one value a line as runs of mbexport.")
    parser.add_argument("data", type=Path, help="folder rbt_log")
    parser.add_argument("out", type=Path, help="folder for the runs")
    parser.add_argument("--pieces", type=int, default=3, help="runs to cut the log into")
    arguments = parser.parse_args()
    convert(arguments.data, arguments.out, arguments.pieces)


if __name__ == "__main__":
    main()
