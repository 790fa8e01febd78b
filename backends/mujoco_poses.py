"""The tool's pose at many positions, MuJoCo's forward kinematics asked in one piece of compiled code."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.simulation.compiled import compile_text
from .mujoco_call import address_of, called

if TYPE_CHECKING:
    from ..core.simulation.backend import Vector


class Posed(NamedTuple):
    """What compiled code needs of an engine; n joints.

    Attributes:
        kinematics: Address of mj_kinematics.
        model, data: Addresses of its mjModel and mjData.
        position: MuJoCo's coordinates, shape (nv,).
        arm: Coordinates of the arms, shape (n,).
        base_rotation, base_position: Of the base in MuJoCo's world, shapes (9,) and (3,).
        tool_rotation, tool_position: Of the tool centre point there.
    """

    kinematics: int
    model: int
    data: int
    position: Any
    arm: Any
    base_rotation: Any
    base_position: Any
    tool_rotation: Any
    tool_position: Any


def posed(model: Any, data: Any, arm: Any, base: int, tool: int) -> Posed:
    """Of a model and its data, by coordinates of the arms, number of the base's body and of the tool's site."""
    return Posed(
        *(address_of("mj_kinematics"), model._address, data._address),
        *(data.qpos, arm, data.xmat[base], data.xpos[base], data.site_xmat[tool], data.site_xpos[tool]),
    )


def tools_at(engine: Posed, q: Vector) -> Vector:
    """Poses of the tool in the base at positions q (m, n), shape (m, 4, 4)."""
    poses = np.zeros((len(q), 4, 4))
    _compiled()(engine, np.ascontiguousarray(q, dtype=np.float64), poses)
    return poses


@cache
def _compiled() -> Any:
    return compile_text(_pose)


def _pose(engine: Posed, q: Vector, poses: Vector) -> None:
    engine.position[:] = 0.0
    base, tool = engine.base_rotation, engine.tool_rotation
    for k in range(len(q)):
        for j in range(len(engine.arm)):
            engine.position[engine.arm[j]] = q[k, j]
        called(engine.kinematics, engine.model, engine.data)
        for row in range(3):
            for i in range(3):
                along = base[3 * i + row]
                for column in range(3):
                    poses[k, row, column] += along * tool[3 * i + column]
                poses[k, row, 3] += along * (engine.tool_position[i] - engine.base_position[i])
        poses[k, 3, 3] = 1.0
