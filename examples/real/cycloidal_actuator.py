"""Printed cycloidal actuator, clamped, torque ramped up and down: play (+-4 N m) and stiffness (+-40 N m), as runs.

    python cycloidal_actuator.py LOG OUT

LOG is one build's file; OUT gets its robot and a run a ramp, play-0 ... and stiffness-100 .... The encoder sits on the
motor and counts turns of the output. Stamps come from a timer of 15.6 ms, some seven rows under each, and are spread
evenly between its ticks. The torque is the motor's own (current times constant): beyond some 26 N m it does not follow
the command, which is left out for that. Nobody says where the output was clamped: 0 is the middle of a ramp's way.
"""

from __future__ import annotations

import argparse
import csv
import gzip
from pathlib import Path

import numpy as np

COLUMNS = ("TIME", "POSITION", "TORQUE", "test_nr")
# from here on tests are ramps of +-40 N m
STIFFNESS = 100
ROBOT = {
    "robot.yaml": """name: cycloidal_actuator
gravity: [0, 0, 0]
source: github.com/JelmerV/Anti-Backlash-Cycloidal-Actuator; what is clamped to the output does not matter and is ours
""",
    "kinematics.dat": "arm alpha a theta d\n1 0 0.2 0 0\n",
    "inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 1.0 -0.1 0 0 0.001 0.005 0.005\n",
    "joints.dat": "joint type\n1 continuous\n",
}


def log_yaml(middle: float) -> str:
    """The mapping; `middle` is the position [turns of the output] that becomes 0."""
    return f"""control: {{mode: unknown}}
locked: [1]
signals:
  q_1: {{column: {{position: {2.0 * np.pi!r}}}, offset: {-2.0 * np.pi * middle!r}}}
  tau_1: {{column: torque}}
source: github.com/JelmerV/Anti-Backlash-Cycloidal-Actuator (CC BY-SA 4.0)
"""


def convert(log: Path, out: Path) -> None:
    """Robot and runs of one build.

    Args:
        log: A torqueramp file, .csv or .csv.gz.
        out: Gets robot and runs.
    """
    text = gzip.decompress(log.read_bytes()) if log.suffix == ".gz" else log.read_bytes()
    lines = csv.DictReader(text.decode("utf-8").splitlines())
    table = np.array([[float(row[name]) for name in COLUMNS] for row in lines])
    (out / "robot").mkdir(parents=True, exist_ok=True)
    for name, text in ROBOT.items():
        (out / "robot" / name).write_text(text, encoding="utf-8")
    for number in np.unique(table[:, 3]).astype(int).tolist():
        stamps, position, torque = table[table[:, 3] == number, :3].T
        ticks = np.flatnonzero(np.diff(stamps, prepend=stamps[0] - 1.0) > 0.0)
        # after the last tick nothing tells the time
        last = int(ticks[-1])
        t = np.interp(np.arange(last), ticks, stamps[ticks]) - stamps[0]
        values = np.column_stack([t, position[:last], torque[:last]])
        run = out / "runs" / f"{'stiffness' if number >= STIFFNESS else 'play'}-{number}"
        run.mkdir(parents=True, exist_ok=True)
        np.savetxt(run / "data.csv", values, fmt="%.17g", delimiter=",", header="t,position,torque", comments="")
        middle = 0.5 * float(position.min() + position.max())
        (run / "log.yaml").write_text(log_yaml(middle), encoding="utf-8")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Cycloidal actuator: torque ramps as runs of mbexport.")
    parser.add_argument("log", type=Path, help="a torqueramp file of one build")
    parser.add_argument("out", type=Path, help="folder for robot and runs")
    arguments = parser.parse_args()
    convert(arguments.log, arguments.out)


if __name__ == "__main__":
    main()
