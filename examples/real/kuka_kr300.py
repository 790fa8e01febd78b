"""KUKA KR300 R2500 ultra: three logs of 10 s at 250 Hz, with a second encoder behind the gears of axes 1 to 3, as runs.

    python kuka_kr300.py DATA OUT [--every 2]

Angles start at 0 in a pose where axes 2 and 3 stand at -90 and 90 degrees of the robot's model. Torques are the motors'
own, and times the gear ratios in log.yaml. The second encoder is read 3.0 ms late on every axis; log.yaml says so, for
otherwise the gears look soft. Its zero is not the motor's: here they agree where a run begins.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

PERIOD = 0.004
GEAR = (1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340)
ZERO = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
LATE = 0.003
# what hung there: mass [kg] and how far before the flange [m]; what the authors' model takes between 100 and 200 kg
PAYLOAD = (150.0, 0.1)


def log_yaml(apart: list[float], payload: tuple[float, float]) -> str:
    """The mapping from the log's degrees and motor torques to joints.

    Args:
        apart: Motor's less second encoder's angle where the run begins [deg], axes 1 to 3.
        payload: Mass [kg] and distance [m].
    """
    lines = ["control: {mode: unknown}", "signals:"]
    for i, (gear, zero) in enumerate(zip(GEAR, np.radians(ZERO).tolist(), strict=True), start=1):
        lines.append(f"  q_cmd_{i}: {{column: ref_{i}, unit: deg, offset: {zero!r}}}")
        lines.append(f"  q_{i}: {{column: motor_{i}, unit: deg, offset: {zero!r}}}")
        lines.append(f"  tau_{i}: {{column: {{torque_{i}: {gear!r}}}}}")
        if i <= len(apart):
            offset = zero + float(np.radians(apart[i - 1]))
            lines.append(f"  q_link_{i}: {{column: second_{i}, unit: deg, offset: {offset!r}, delay: {LATE!r}}}")
    mass, distance = payload
    if mass:
        lines.append(f"payload: {{mass: {mass!r}, z: {distance!r}}}")
    lines.append("source: github.com/JonasWeigand/Robot_Identification (MIT)")
    return "\n".join(lines) + "\n"


def convert(data: Path, out: Path, payload: tuple[float, float], every: int = 1) -> None:
    """Runs A, B and C.

    Args:
        data: Folder of folders with a data.mat each.
        out: Gets a folder a run.
        payload: Mass [kg] and distance [m] of what hung there.
        every: Keep every such sample, behind a filter without phase that lets no faster ones through.
    """
    loadmat: Any = import_module("scipy.io").loadmat
    decimate: Any = import_module("scipy.signal").decimate

    def thinned(rows: NDArray[np.float64]) -> NDArray[np.float64]:
        return rows if every == 1 else decimate(rows, every, ftype="fir", axis=1, zero_phase=True)

    for path in sorted(data.glob("*/data.mat")):
        log = loadmat(path, squeeze_me=True, struct_as_record=False)["rec"]
        motor, second = log.act_pos_mot_deg, log.act_pos_se_deg[:3]
        columns = {"t": PERIOD * np.arange(motor.shape[1])[::every]}
        for name, values in (("ref", log.ref_pos_deg), ("motor", motor), ("second", second)):
            columns |= {f"{name}_{i}": row for i, row in enumerate(thinned(values), start=1)}
        columns |= {f"torque_{i}": row for i, row in enumerate(thinned(log.act_torque_abs_nm), start=1)}
        # the robot rests while the first samples are taken
        apart = np.mean(motor[:3, :5] - second[:, :5], axis=1).tolist()
        run = out / path.parent.name.split(" FF ")[1].split()[0]
        run.mkdir(parents=True, exist_ok=True)
        table = np.column_stack(list(columns.values()))
        np.savetxt(run / "data.csv", table, fmt="%.17g", delimiter=",", header=",".join(columns), comments="")
        (run / "log.yaml").write_text(log_yaml(apart, payload), encoding="utf-8")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="KR300: logs of three motions as runs of mbexport.")
    parser.add_argument("data", type=Path, help="folder recorded_trajectories")
    parser.add_argument("out", type=Path, help="folder for the runs")
    parser.add_argument("--payload", type=float, nargs=2, default=PAYLOAD, help="mass [kg] and distance [m]")
    parser.add_argument("--every", type=int, default=1, help="keep every such sample, behind a filter")
    arguments = parser.parse_args()
    convert(arguments.data, arguments.out, tuple(arguments.payload), arguments.every)


if __name__ == "__main__":
    main()
