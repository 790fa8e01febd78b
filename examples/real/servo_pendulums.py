"""Dynamixel XL330 and Feetech STS3250, each with a weight on a stick: logs of position control, as runs.

    python servo_pendulums.py DATA OUT

OUT gets a folder a servo: its robot, and a run a log. A servo's own controller makes a share of the supply's voltage
out of the position's error; what its motor makes of a volt at standstill is in its data sheet. What speed takes from
that (back EMF) is viscous friction here. The XL330 reports the share (`load`), so that its torque is known too.
Logs in which the motor is switched off on the way are left out.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Servo:
    """What a data sheet says of a servo.

    Attributes:
        folder: Of its logs.
        stall: Torque at standstill [N m] at `volts`.
        volts: Supply [V].
        gain: Share of the supply a radian of error and a unit of the firmware's gain.
        full: Reported `load` of the whole supply; 0 where it is not reported.
        limit: Largest share.
    """

    folder: str
    stall: float
    volts: float
    gain: float
    full: float
    limit: float


# gains: XL330, 4096 steps a turn / 256, of 885 (ROBOTIS e-manual); STS3250, as measured by the authors for its kind
SERVOS = {
    "xl330": Servo("raw", 0.52, 5.0, 4096.0 / (2.0 * np.pi) / 256.0 / 885.0, 885.0, 1.0),
    "sts3250": Servo("feetech", 4.9, 12.0, 0.166, 0.0, 0.97),
}
# a compact weight: what it adds to mass times length squared is a few hundredths
RADIUS_OF_GYRATION = 0.015


def robot(name: str, mass: float, length: float) -> dict[str, str]:
    """Tables of a weight on a stick; 0 hangs down, the plane is x and z of the world."""
    inertia = mass * RADIUS_OF_GYRATION**2
    return {
        "robot.yaml": f"""name: {name}_pendulum
gravity: [0, 0, -9.80665]
base: {{xyz: [0, 0, 0], rpy: [{np.pi / 2!r}, 0, 0]}}
tolerance: {{mass: 0.02, com: 0.002, inertia: 0.5, length: 0, angle: 0}}
source: weight and length of the logs, github.com/Rhoban/bam; the stick is not weighed
""",
        "kinematics.dat": f"arm alpha a theta[deg] d\n1 0 {length!r} -90 0\n",
        "inertia.dat": f"arm mass x y z Ixx Iyy Izz\n1 {mass!r} 0 0 0 {inertia!r} {inertia!r} {inertia!r}\n",
        "joints.dat": "joint type\n1 continuous\n",
    }


def log_yaml(servo: Servo, gain: float, volts: float) -> str:
    """The servo's controller as a spring that has no more torque than its motor at standstill."""
    torque = servo.stall / servo.volts * volts
    return f"""control:
  mode: pd
  kp: [{gain * servo.gain * torque!r}]
  kd: [0.0]
  torque_limit: [{servo.limit * torque!r}]
source: github.com/Rhoban/bam (Apache-2.0)
"""


def table(servo: Servo, entries: list[dict[str, Any]]) -> tuple[list[str], np.ndarray]:
    """Columns of a log, in SI, and their names."""
    column = {key: np.array([float(entry[key]) for entry in entries]) for key in entries[0]}
    names, values = ["t", "q_cmd_1", "q_1"], [column["timestamp"], column["goal_position"], column["position"]]
    if servo.full:
        # a number of 16 bits with a sign
        share = ((column["load"] + 2**15) % 2**16 - 2**15) / servo.full
        names.append("tau_1")
        values.append(share * column["input_volts"] * servo.stall / servo.volts)
    return names, np.column_stack(values)


def convert(data: Path, out: Path) -> None:
    """Robots and runs of every servo.

    Args:
        data: Folder with the logs' folders.
        out: Gets <servo>/robot and <servo>/runs.
    """
    for name, servo in SERVOS.items():
        for path in sorted((data / servo.folder).glob("*.json")):
            log = json.loads(path.read_text(encoding="utf-8"))
            if not all(entry["torque_enable"] for entry in log["entries"]):
                print(f"{path.name}: the motor is switched off on the way; left out")
                continue
            tables = robot(name, log["mass"], log["length"])
            folder = out / name / "robot"
            folder.mkdir(parents=True, exist_ok=True)
            for file, text in tables.items():
                (folder / file).write_text(text, encoding="utf-8")
            run = out / name / "runs" / f"{log['trajectory']}-kp{log['kp']}"
            run.mkdir(parents=True, exist_ok=True)
            names, values = table(servo, log["entries"])
            np.savetxt(run / "data.csv", values, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
            (run / "log.yaml").write_text(log_yaml(servo, log["kp"], log["vin"]), encoding="utf-8")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Logs of servo pendulums as runs of mbexport.")
    parser.add_argument("data", type=Path, help="folder with `raw` and `feetech`")
    parser.add_argument("out", type=Path, help="folder for robots and runs")
    arguments = parser.parse_args()
    convert(arguments.data, arguments.out)


if __name__ == "__main__":
    main()
