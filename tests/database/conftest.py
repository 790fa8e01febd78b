"""Statics by plain sums, which know nothing of the code under test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def rx(angle: float) -> Matrix:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def ry(angle: float) -> Matrix:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def rz(angle: float) -> Matrix:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def move(x: float, y: float, z: float) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def from_rpy(xyz: Sequence[float], rpy: Sequence[float]) -> Matrix:
    return move(*xyz) @ rz(rpy[2]) @ ry(rpy[1]) @ rx(rpy[0])


@dataclass
class Body:
    """Mass properties in a frame, tensor about the center of mass."""

    mass: float
    com: Matrix
    tensor: Matrix


@dataclass
class Chain:
    """Frames of the bodies and axes of the joints in the world, and what follows from them by sums."""

    axes: list[Matrix]
    frames: list[Matrix]
    tip: Matrix
    bodies: list[Body]
    prismatic: list[bool]
    gravity: Matrix

    def mass_matrix(self) -> Matrix:
        n = len(self.axes)
        total = np.zeros((n, n))
        for jv, jw, body, frame in self._jacobians():
            r = frame[:3, :3]
            total += body.mass * jv.T @ jv + jw.T @ r @ body.tensor @ r.T @ jw
        return total

    def gravity_load(self) -> Matrix:
        return -sum((body.mass * jv.T @ self.gravity for jv, _, body, _ in self._jacobians()), np.zeros(len(self.axes)))

    def _jacobians(self) -> list[tuple[Matrix, Matrix, Body, Matrix]]:
        out = []
        for k, (body, frame) in enumerate(zip(self.bodies, self.frames, strict=True)):
            com = frame[:3, :3] @ body.com + frame[:3, 3]
            jv, jw = np.zeros((3, len(self.axes))), np.zeros((3, len(self.axes)))
            for i in range(k + 1):
                z, origin = self.axes[i][:3, 2], self.axes[i][:3, 3]
                if self.prismatic[i]:
                    jv[:, i] = z
                else:
                    jv[:, i], jw[:, i] = np.cross(z, com - origin), z
            out.append((jv, jw, body, frame))
        return out


def standard_chain(database, q: Sequence[float]) -> Chain:
    """A database's chain, by the contract's formula."""
    here = from_rpy(database.base.xyz, database.base.rpy)
    axes, frames = [], []
    for row, joint, x in zip(database.kinematics, database.joints, q, strict=True):
        axes.append(here)
        slides = joint.kind == "prismatic"
        turned = rz(row.theta + (0 if slides else x)) @ move(0, 0, row.d + (x if slides else 0))
        here = here @ turned @ move(row.a, 0, 0) @ rx(row.alpha) @ ry(row.beta)
        frames.append(here)
    bodies = [
        Body(i.mass, np.array(i.com), np.array([[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]]))
        for i in database.inertias
    ]
    tip = here @ from_rpy(database.tool.xyz, database.tool.rpy)
    slides = [joint.kind == "prismatic" for joint in database.joints]
    return Chain(axes, frames, tip, bodies, slides, np.array(database.gravity))


def craig_chain(
    rows: Sequence[Sequence[float]],
    bodies: Sequence[Body],
    prismatic: Sequence[bool],
    q: Sequence[float],
    base: Matrix,
    tool: Matrix,
) -> Chain:
    """A chain by Craig's rows (alpha, a, theta, d), bodies in his frames."""
    here = base
    axes, frames = [], []
    for (alpha, a, theta, d), slides, x in zip(rows, prismatic, q, strict=True):
        here = here @ rx(alpha) @ move(a, 0, 0)
        axes.append(here)
        here = here @ rz(theta + (0 if slides else x)) @ move(0, 0, d + (x if slides else 0))
        frames.append(here)
    return Chain(axes, frames, here @ tool, list(bodies), list(prismatic), np.array([0, 0, -9.81]))


@pytest.fixture
def chain() -> Callable[..., Chain]:
    return standard_chain


@pytest.fixture
def craig() -> Callable[..., Chain]:
    return craig_chain


@pytest.fixture
def body() -> type[Body]:
    return Body


@pytest.fixture
def pose_of() -> Callable[..., Matrix]:
    return from_rpy
