"""From a run without noise to the files of a recorded run, and from a recipe to a database folder."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from design import as_simulated, coloured, law_of, loop_noise, true_world
from world import ROBOTS, Signals, World, robot_named, sampled, simulate


def measured(recipe: dict, row: dict, world: World | None = None) -> tuple[dict[str, np.ndarray], Signals]:
    """(columns of the data file, the same run as it truly was) of one run of a case."""
    control, sensors = recipe["control"], recipe["sensors"]
    rate = control["rate"]
    ticks = int(row["duration"] * rate + 1.0e-6) + 1
    law = law_of(recipe, row)
    noise = loop_noise(recipe, row, ticks)
    loops = sensors["loop"] and control["mode"] != "motion"
    numerical = recipe["numerical"] or ""
    truth = simulate(
        as_simulated(recipe),
        world or true_world(recipe),
        law,
        row["duration"],
        noise=noise if loops else None,
        numerical=numerical,
    )
    kept = np.arange(0, ticks, sensors["every"])
    late = lateness(row, sensors, len(kept))
    held = control["mode"] != "motion"
    values = {}
    for name in sensors["channels"]:
        values[name] = truth.channel(name)[kept].copy()
        if sensors["jitter"] and not (name == "tau" and held):
            values[name] += rate * late[:, None] * ahead(truth.channel(name))[kept]
    for number, name in enumerate(sorted(values)):
        rng = np.random.default_rng([row["noise"], 2, number])
        sigma = np.array(sensors["sigma"][name], dtype=float)
        if name in ("q", "dq"):
            values[name] += noise[kept, 0 if name == "q" else 1]
        else:
            values[name] += coloured(rng, values[name].shape, sensors["colour"]) * sigma
        step = sensors["steps"].get(name, 0.0) * sigma
        values[name] = np.where(
            step > 0.0, np.round(values[name] / np.where(step > 0.0, step, 1.0)) * step, values[name]
        )
    behind = {"shifted_stamps": values.keys(), "shifted_torque": ("tau",)}.get(numerical, ())
    for name in behind:
        if name in values:
            values[name] = row_late(values[name])
    columns: dict[str, np.ndarray] = {"t": kept / rate + late}
    q_cmd, dq_cmd, ddq_cmd = (command[kept] for command in sampled(law, ticks, rate))
    q_cmd += late[:, None] * dq_cmd + 0.5 * late[:, None] ** 2 * ddq_cmd
    dq_cmd += late[:, None] * ddq_cmd
    if control["mode"] == "torque":
        put(columns, "tau_cmd", truth.tau_cmd[kept])
    elif control["mode"] != "unknown":
        put(columns, "q_cmd", q_cmd)
        put(columns, "dq_cmd", dq_cmd)
        if control["feedforward"] == "inverse_dynamics" or control["mode"] == "motion":
            put(columns, "ddq_cmd", ddq_cmd)
    for name in ("q", "dq", "q_link", "tau", "tau_link"):
        if name in values:
            put(columns, name, values[name])
    if "ee" in values:
        for axis, label in enumerate("xyz"):
            columns[f"ee_{label}"] = values["ee"][:, axis]
        if sensors["orientation"]:
            turns = truth.ee[kept, :, :3]
            columns.update(orientation(recipe, row, row_late(turns) if numerical == "shifted_stamps" else turns))
    if sensors["gap"]:
        begin = int(sensors["gap"][0] * len(kept))
        end = begin + max(2, int(sensors["gap"][1] * rate / sensors["every"]))
        keep = np.ones(len(kept), dtype=bool)
        keep[begin:end] = False
        columns = {name: value[keep] for name, value in columns.items()}
    return columns, truth


def lateness(row: dict, sensors: dict, count: int) -> np.ndarray:
    """How much later than its tick each row was taken [s], (m,): its stamp and its values alike; the first is not."""
    rng = np.random.default_rng([row["noise"], 3])
    late = sensors["jitter"] * np.clip(np.abs(rng.normal(size=count)), 0.0, 3.0)
    late[0] = 0.0
    return late


def row_late(values: np.ndarray) -> np.ndarray:
    """What stands a row later than it was, shape as values."""
    return np.concatenate([values[:1], values[:-1]])


def ahead(values: np.ndarray) -> np.ndarray:
    """Change to the next tick, (m, n)."""
    return np.diff(values, axis=0, append=2.0 * values[-1:] - values[-2:-1])


def put(columns: dict[str, np.ndarray], name: str, values: np.ndarray) -> None:
    for i in range(values.shape[1]):
        columns[f"{name}_{i + 1}"] = values[:, i]


def orientation(recipe: dict, row: dict, turns: np.ndarray) -> dict[str, np.ndarray]:
    """Quaternions with noise."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng([row["noise"], 4])
    wobble = Rotation.from_rotvec(rng.normal(size=(len(turns), 3)) * recipe["sensors"]["sigma"]["ee_rot"])
    xyzw = (wobble * Rotation.from_matrix(turns)).as_quat()
    xyzw *= np.where(xyzw[:, 3:] < 0.0, -1.0, 1.0)
    return {f"ee_q{label}": xyzw[:, k] for k, label in zip((3, 0, 1, 2), "wxyz", strict=True)}


def data_file(columns: dict[str, np.ndarray], csv: bool) -> tuple[str, bytes]:
    """(name, content) of the data."""
    if csv:
        rows = [",".join(columns)]
        rows += [",".join(map(repr, line)) for line in np.column_stack(list(columns.values())).tolist()]
        return "data.csv", ("\n".join(rows) + "\n").encode()
    sink = io.BytesIO()
    pq.write_table(
        pa.table(columns),
        sink,
        compression="zstd",
        use_dictionary=False,
        use_byte_stream_split=True,
        write_statistics=False,
    )
    return "data.parquet", sink.getvalue()


def flow_list(values) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def log_file(recipe: dict) -> str:
    """log.yaml of every run of a case."""
    control, sensors = recipe["control"], recipe["sensors"]
    mode = control["mode"]
    lines = ["control:", f"  mode: {mode}"]
    if mode == "pd":
        lines += [
            f"  kp: {flow_list(control['kp'])}",
            f"  kd: {flow_list(control['kd'])}",
            f"  feedforward: {control['feedforward']}",
        ]
    if mode in ("pd", "torque"):
        lines.append(f"  rate: {control['rate']!r}")
    if sensors["stated"]:
        sigma = sensors["sigma"]
        parts = []
        for name in sensors["channels"]:
            step = sensors["steps"].get(name, 0.0)
            factor = math.sqrt(1.0 + step**2 / 12.0)
            value = sigma[name]
            parts.append(
                f"{name}: {flow_list([v * factor for v in value]) if isinstance(value, list) else repr(value * factor)}"
            )
        if "ee" in sensors["channels"] and sensors["orientation"]:
            parts.append(f"ee_rot: {sigma['ee_rot']!r}")
        lines.append("noise: {" + ", ".join(parts) + "}")
    if recipe["payload"]:
        load = recipe["payload"]
        lines.append("payload: {" + ", ".join(f"{k}: {v!r}" for k, v in load.items()) + "}")
    return "\n".join([*lines, "source: made by a program, no robot", ""])


UNITS = {
    "inertia": "kg*m^2|kg",
    "torque": "N*m|N",
    "coefficient": "N*m*s/rad|N*s/m",
}


def database_files(recipe: dict) -> dict[str, str]:
    """Files of the database that a case's diagnosis is given."""
    source = ROBOTS / recipe["robot"]
    files = {}
    for path in sorted(source.glob("*.dat")):
        files[path.name] = path.read_text()
    settings = robot_named(recipe["robot"]).settings
    tolerance = ", ".join(f"{k}: {v!r}" for k, v in recipe["tolerance"].items())

    def place(name: str) -> str:
        given = settings.get(name, {})
        xyz, rpy = given.get("xyz", [0, 0, 0]), given.get("rpy", [0, 0, 0])
        return f"{name}: {{xyz: {flow_list(xyz)}, rpy: {flow_list(rpy)}}}"

    files["robot.yaml"] = "\n".join(
        [
            f"name: {recipe['robot']}",
            f"gravity: {flow_list(settings['gravity'])}",
            place("base"),
            place("tool"),
            f"products_of_inertia: {settings.get('products_of_inertia', 'tensor')}",
            f"tolerance: {{{tolerance}}}",
            "source: made by a program, no robot",
            "",
        ]
    )
    robot = robot_named(recipe["robot"])
    for effect, rows in recipe["database"].items():
        if not rows:
            continue
        names = list(next(iter(rows.values())))
        mixed = any(robot.prismatic) and not all(robot.prismatic)
        # without a unit each row is in SI by its joint's kind
        heads = [f"{name}[{UNITS[name]}]" if mixed and name in UNITS else name for name in names]
        body = [" ".join([at, *(repr(float(row[name])) for name in names)]) for at, row in sorted(rows.items())]
        files[f"effects/{effect}.dat"] = "\n".join([" ".join(["joint", *heads]), *body]) + "\n"
    return files


def write_bytes(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
