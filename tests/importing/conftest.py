"""Statics of a database straight from its rows: matrix products and Jacobian sums, none of the program's kinematics."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mbexport.core.database import Database

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Statics:
    """Tip in the world (4, 4), mass matrix without rotors (n, n), torques that hold the arm against gravity (n,)."""

    tip: Array
    mass: Array
    gravity: Array


def _turn(axis: int, angle: float) -> Array:
    matrix, (j, k) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    matrix[j, j] = matrix[k, k] = math.cos(angle)
    matrix[k, j] = math.sin(angle)
    matrix[j, k] = -matrix[k, j]
    return matrix


def _shift(axis: int, length: float) -> Array:
    matrix = np.eye(4)
    matrix[axis, 3] = length
    return matrix


def _placed(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    matrix = _turn(2, rpy[2]) @ _turn(1, rpy[1]) @ _turn(0, rpy[0])
    matrix[:3, 3] = xyz
    return matrix


def statics_of(database: Database, q: Array) -> Statics:
    frame = _placed(database.base.xyz, database.base.rpy)
    n = database.n
    axes, points = np.zeros((n, 3)), np.zeros((n, 3))
    mass, gravity = np.zeros((n, n)), np.zeros(n)
    for i, (row, joint, body) in enumerate(zip(database.kinematics, database.joints, database.inertias, strict=True)):
        axes[i], points[i] = frame[:3, 2], frame[:3, 3]
        slides = joint.kind == "prismatic"
        theta, d = (row.theta, row.d + q[i]) if slides else (row.theta + q[i], row.d)
        frame = frame @ _turn(2, theta) @ _shift(2, d) @ _shift(0, row.a) @ _turn(0, row.alpha) @ _turn(1, row.beta)
        com = frame[:3, :3] @ np.array(body.com) + frame[:3, 3]
        linear, angular = np.zeros((3, n)), np.zeros((3, n))
        for j in range(i + 1):
            if database.joints[j].kind == "prismatic":
                linear[:, j] = axes[j]
            else:
                linear[:, j], angular[:, j] = np.cross(axes[j], com - points[j]), axes[j]
        tensor = frame[:3, :3] @ body.tensor() @ frame[:3, :3].T
        mass += body.mass * linear.T @ linear + angular.T @ tensor @ angular
        gravity -= body.mass * linear.T @ np.array(database.gravity)
    return Statics(frame @ _placed(database.tool.xyz, database.tool.rpy), mass, gravity)


@pytest.fixture
def statics() -> Callable[[Database, Array], Statics]:
    return statics_of


@pytest.fixture
def model_file(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a text as a model file."""

    def write(text: str, name: str = "model.xml") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write
