"""Staubli TX40: motor angles and motor torques of one log at 5 kHz, cut in time, as runs.

    mbexport import DATA/urdf/tx40_mdh_modified.urdf -o tx40
    python staubli_tx40.py DATA/data OUT

The file has motor angles [rad] and motor torques [N m]. Positions are inv(R) times motor angles, R being the gear
ratios and R[6,5] = 32: the motor of axis 6 turns when axis 5 does. Torques are R's transpose times those of the motors.
Both are sums of columns in log.yaml; the angles' offsets are those of the imported model.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

RATE = 5000.0
GEAR = (32.0, 32.0, 45.0, -48.0, 45.0, 32.0)
OFFSET = (0.0, -math.pi / 2, math.pi / 2, 0.0, 0.0, 0.0)


def log_yaml() -> str:
    """The mapping from motors to joints."""
    lines = ["control: {mode: unknown}", "signals:", f"  t: {{rate: {RATE!r}}}"]
    for i, (gear, offset) in enumerate(zip(GEAR, OFFSET, strict=True), start=1):
        column = f"{{angle_6: {1 / gear!r}, angle_5: {-1 / GEAR[4]!r}}}" if i == 6 else f"{{angle_{i}: {1 / gear!r}}}"
        lines.append(f"  q_{i}: {{column: {column}, offset: {offset!r}}}")
    for i, gear in enumerate(GEAR, start=1):
        column = f"{{torque_5: {gear!r}, torque_6: {GEAR[5]!r}}}" if i == 5 else f"{{torque_{i}: {gear!r}}}"
        lines.append(f"  tau_{i}: {{column: {column}}}")
    lines.append("source: github.com/thanhndv212/figaroh-examples, examples/staubli_TX40 (Apache-2.0)")
    return "\n".join(lines) + "\n"


def convert(data: Path, out: Path, pieces: int) -> None:
    """Runs part-1, part-2 ... of equal length in time.

    Args:
        data: Folder with pos_read_data.csv and curr_data.csv.
        out: Gets a folder a run.
        pieces: How many.
    """
    angle = np.loadtxt(data / "pos_read_data.csv", delimiter=",", skiprows=1)
    torque = np.loadtxt(data / "curr_data.csv", delimiter=",", skiprows=1)
    header = ",".join([f"angle_{i}" for i in range(1, 7)] + [f"torque_{i}" for i in range(1, 7)])
    for k, rows in enumerate(np.array_split(np.hstack([angle, torque]), pieces), start=1):
        run = out / f"part-{k}"
        run.mkdir(parents=True, exist_ok=True)
        np.savetxt(run / "data.csv", rows, fmt="%.17g", delimiter=",", header=header, comments="")
        (run / "log.yaml").write_text(log_yaml(), encoding="utf-8")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="TX40: motor angles and torques as runs of mbexport.")
    parser.add_argument("data", type=Path, help="folder with pos_read_data.csv and curr_data.csv")
    parser.add_argument("out", type=Path, help="folder for the runs")
    parser.add_argument("--pieces", type=int, default=3, help="runs to cut the log into")
    arguments = parser.parse_args()
    convert(arguments.data, arguments.out, arguments.pieces)


if __name__ == "__main__":
    main()
