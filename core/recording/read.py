"""Recorded runs from disk: a folder with log.yaml and data, or a data file with a YAML beside it of the same name."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..control import Control, LogFile, read_control, read_locked, read_log, read_noise, read_payload
from ..data_file import DATA_SUFFIXES, column_names, data_file_of, read_columns
from ..errors import Problem, RunFileError
from ..signals import JOINT_SIGNALS, POSITION_SIGNALS, TURN_SIGNALS
from .mapping import Recipe, recipes_of
from .run import MEASURED, LeftOut, Run, Vector
from .sensors import bad_samples
from .stamps import copied_rows, rows_in_order, uneven_steps

if TYPE_CHECKING:
    from ..database import Database

LOG = "log.yaml"
_KEYS = ("control", "noise", "signals", "locked", "payload", "source", "simulation", "warnings")
# what a mode cannot do without
_COMMANDS = {"pd": "q_cmd", "motion": "q_cmd", "torque": "tau_cmd"}


def read_run(path: Path, database: Database) -> Run:
    """A run as it was recorded: columns mapped to signals in SI, bad samples found, named and NaN.

    Args:
        path: The run's folder, or its data file (CSV or Parquet) with a YAML beside it of the same name.
        database: The robot; how many joints there are, and which of them slide.

    Raises:
        RunFileError: With file, row and column of what is wrong.
    """
    data, log_path = _files_of(path)
    log = read_log(log_path)
    _check_keys(log)
    control = read_control(log_path, database.n)
    noise = read_noise(log_path, database.n) if log.data.get("noise") else {}
    locked = read_locked(log_path)
    if any(joint > database.n for joint in locked):
        message = f"the robot has joints 1 to {database.n}"
        raise RunFileError((log.problem("locked", list(locked), message),))
    recipes = recipes_of(log, column_names(data), database.joints, str(data))
    _check_signals(recipes, control, database.n, str(data), log)
    t, channels, left_out = _channels(data, recipes)
    signals = _signals(channels, database.n)
    run = Run(
        name=path.name if path.is_dir() else path.stem,
        t=t,
        signals=signals,
        control=control,
        noise={name: np.array(values * 3 if name == "ee" else values) for name, values in noise.items()},
        locked=locked,
        payload=read_payload(log_path),
        source=str(log.data.get("source") or ""),
        left_out=(),
        rate=1.0 / float(np.median(np.diff(t))),
    )
    return bad_samples(run, left_out, database)


def read_runs(paths: Sequence[Path], database: Database) -> tuple[Run, ...]:
    """Several runs; a folder of runs counts as its runs, by name.

    Raises:
        RunFileError: A run is wrong, given twice, or a folder holds none.
    """
    found: list[Path] = []
    for path in paths:
        found += [path] if _is_run(path) or not path.is_dir() else _runs_in(path)
    whole = [path.resolve() for path in found]
    for number, path in enumerate(whole):
        if path in whole[:number]:
            raise RunFileError((Problem("this run is given twice", file=str(found[number])),))
    return tuple(read_run(path, database) for path in found)


def _is_run(path: Path) -> bool:
    return path.is_dir() and ((path / LOG).is_file() or any((path / f"data{end}").is_file() for end in DATA_SUFFIXES))


def _runs_in(folder: Path) -> list[Path]:
    children = sorted(folder.iterdir())
    runs = [child for child in children if _is_run(child)]
    runs += [child for child in children if child.suffix in DATA_SUFFIXES and child.with_suffix(".yaml").is_file()]
    if not runs:
        message = f"holds no run: neither folders with {LOG} nor data files with a YAML beside them"
        raise RunFileError((Problem(message, file=str(folder)),))
    return sorted(runs)


def _files_of(path: Path) -> tuple[Path, Path]:
    """Data and log of a run."""
    if path.is_dir():
        return data_file_of(path), path / LOG
    if path.suffix not in DATA_SUFFIXES:
        message = f"is no run: a folder with {LOG}, or a file that ends in {' or '.join(DATA_SUFFIXES)}"
        raise RunFileError((Problem(message if path.exists() else "there is no such run", file=str(path)),))
    beside = path.with_suffix(".yaml")
    if not beside.is_file() and path.stem == "data" and (path.parent / LOG).is_file():
        return path, path.parent / LOG
    return path, beside


def _check_keys(log: LogFile) -> None:
    problems = [
        log.problem(key, None, f"unknown key (did you mean {near[0]}?)")
        for key in log.data
        if key not in _KEYS and (near := difflib.get_close_matches(key, _KEYS, 1, 0.75))
    ]
    if problems:
        raise RunFileError(problems)


def _check_signals(recipes: Mapping[str, Recipe], control: Control, n: int, file: str, log: LogFile) -> None:
    """Whether there is what a run cannot do without."""
    missing = [f"q_{i}" for i in range(1, n + 1) if f"q_{i}" not in recipes]
    if missing:
        message = f"a run of {n} joints has the measured positions q_1 ... q_{n}, by name or in the log's `signals`"
        raise RunFileError((Problem(message, file=file, column=missing[0]),))
    if not any(
        f"{signal}_{i}" in recipes for signal in ("q_cmd", "tau_cmd", "tau", "tau_link") for i in range(1, n + 1)
    ):
        message = "a run has one of q_cmd, tau_cmd, tau and tau_link beside the measured positions"
        raise RunFileError((Problem(message, file=file),))
    command = _COMMANDS.get(control.mode)
    for i in range(1, n + 1):
        if command and f"{command}_{i}" not in recipes:
            message = f"mode {control.mode} needs {command}_{i}; mode unknown compares measured torques only"
            raise RunFileError((log.problem("control.mode", control.mode, message),))


def _channels(data: Path, recipes: Mapping[str, Recipe]) -> tuple[Vector, dict[str, Vector], list[LeftOut]]:
    """Times from 0 and every channel (m,) at them."""
    columns = sorted({name for recipe in recipes.values() for name in recipe.columns})
    file = read_columns(data, columns)
    clock = recipes["t"]
    t = np.arange(len(next(iter(file.values())))) / clock.rate if clock.rate else clock.values(file)
    keep, left_out = rows_in_order(t, str(data))
    t = t[keep] - t[keep][0]
    channels = {name: recipe.values(file)[keep] for name, recipe in recipes.items() if name != "t"}
    measured = [values for name, values in channels.items() if name.rpartition("_")[0] in MEASURED or "ee_" in name]
    positions = [values for name, values in channels.items() if name.rpartition("_")[0] == "q"]
    copied, more = copied_rows(t, np.column_stack(measured), np.column_stack(positions))
    t = t[~copied]
    channels = {name: values[~copied] for name, values in channels.items()}
    left_out += more + uneven_steps(t)
    for name, recipe in recipes.items():
        if recipe.delay:
            channels[name], lost = _earlier(t, channels[name], recipe.delay, name)
            left_out += lost
    return t, channels, left_out


def _earlier(t: Vector, values: Vector, delay: float, name: str) -> tuple[Vector, list[LeftOut]]:
    """A channel that the file has a delay late, at the time when it was measured."""
    from scipy.interpolate import CubicSpline

    known = np.isfinite(values)
    wanted = t + delay
    step = float(np.median(np.diff(t)))
    shifted = np.full_like(values, math.nan)
    if known.sum() > 3:
        right = np.clip(np.searchsorted(t, wanted - 1e-9 * step), 0, len(t) - 1)
        left = np.where(np.abs(t[right] - wanted) < 1e-9 * step, right, np.maximum(right - 1, 0))
        there = known[left] & known[right] & (wanted >= t[0] - 1e-9 * step) & (wanted <= t[-1] + 1e-9 * step)
        shifted[there] = CubicSpline(t[known], values[known])(wanted[there])
        exact = there & (left == right)
        shifted[exact] = values[left[exact]]
    lost = (wanted < t[0] - 1e-9 * step) | (wanted > t[-1] + 1e-9 * step)
    if not lost.any():
        return shifted, []
    message = f"{name} was measured {delay!r} s before its stamp; {lost.sum()} samples at the record's end have none"
    return shifted, [LeftOut(name, "delay", float(t[lost][0]), float(t[lost][-1]), int(lost.sum()), message)]


def _signals(channels: Mapping[str, Vector], n: int) -> dict[str, Vector]:
    """Channels side by side: signal -> (m, n); those of joints that have none are NaN."""
    m = len(next(iter(channels.values())))
    signals: dict[str, Vector] = {}
    nothing = np.full(m, math.nan)
    for signal in JOINT_SIGNALS:
        names = [f"{signal}_{i}" for i in range(1, n + 1)]
        if any(name in channels for name in names):
            signals[signal] = np.column_stack([channels.get(name, nothing) for name in names])
    if any(name in channels for name in POSITION_SIGNALS):
        signals["ee"] = np.column_stack([channels.get(name, nothing) for name in POSITION_SIGNALS])
    if all(name in channels for name in TURN_SIGNALS):
        quaternion = np.column_stack([channels[name] for name in TURN_SIGNALS])
        length = np.linalg.norm(quaternion, axis=1)
        signals["ee_rot"] = _one_way_round(quaternion / np.where(length > 0.0, length, math.nan)[:, None])
    return signals


def _one_way_round(quaternions: Vector) -> Vector:
    """Unit quaternions (m, 4) with the sign of those before them; both are one rotation, and a jump would be noise."""
    out = quaternions.copy()
    known = np.flatnonzero(np.isfinite(out).all(axis=1))
    turns = np.sum(out[known[1:]] * out[known[:-1]], axis=1) < 0.0
    out[known[1:]] *= np.cumprod(np.where(turns, -1.0, 1.0))[:, None]
    return out
