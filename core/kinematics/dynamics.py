"""Rigid-body dynamics of a robot's arms: mass matrix, gravity, bias and inverse dynamics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..representation import Pose, Robot, Stage, VeitscheggerWu
from . import rigid_body
from .compiled import compiled
from .rigid_body import ChainTable

Array = NDArray[np.float64]

# links that are kept: of robots that are tried one after the other most are the same
_REMEMBERED = 1024


def chain_table(robot: Robot) -> ChainTable:
    """The robot's chain as arrays for the functions of `rigid_body`.

    Joints stand at their real places (corrections included) and the base's pose turns gravity into the base.
    """
    arms = [Stage(stage.joint, stage.arm) for stage in robot.stages]
    links = [_link(robot.correction_before(max(i - 1, 0)), tuple(arms[max(i - 1, 0) : i + 1])) for i in range(robot.n)]
    rotation, position, mass, com, tensor = (np.array(column) for column in zip(*links, strict=True))
    return ChainTable(
        kind=np.array([0 if stage.joint.kind == "revolute" else 1 for stage in robot.stages], dtype=np.int64),
        rotation=rotation,
        position=position,
        mass=mass,
        com=com,
        tensor=tensor,
        gravity=robot.base.rotation_matrix().T @ np.array(robot.gravity),
    )


@lru_cache(maxsize=_REMEMBERED)
def _link(correction: VeitscheggerWu, arms: tuple[Stage, ...]) -> tuple[Array, ...]:
    """Place of the last of some arms in the one before, and its mass, center of mass and tensor in its joint.

    Args:
        correction: Places the first of them.
        arms: Itself behind the one before, or alone where it stands on the base.
    """
    chain = Robot("chain", (0.0, 0.0, 0.0), Pose(), correction, arms)
    joint, body = chain.joint_in_previous(chain.n - 1), chain.inertia_in_joint(chain.n - 1)
    return joint.rotation_matrix(), np.array(joint.xyz), np.array(body.mass), np.array(body.com), body.tensor()


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """Dynamics of the arms alone (no rotors, no springs, no friction), tau = M(q) ddq + h(q, dq).

    Every method takes leading axes. One state alone runs as plain Python (about a millisecond, nothing to load); many
    states, or `always_compiled`, run compiled by Numba.

    Attributes:
        table: The chain.
        always_compiled: Compile for single states too: for loops over steps.
    """

    table: ChainTable
    always_compiled: bool = False

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.table.mass)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M(q), shape (..., n, n), of positions (..., n) [rad or m]."""
        (q,) = self._states(q)
        out = np.empty((*q.shape, self.n))
        self._functions(q)["mass_matrices"](self.table, self._rows(q), out.reshape(-1, self.n, self.n))
        return out

    def inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torques tau = M(q) ddq + h(q, dq), shape (..., n) [N m or N]; arguments broadcast."""
        q, dq, ddq = self._states(q, dq, ddq)
        out = np.empty(q.shape)
        along = self._functions(q)["inverse_dynamics_along"]
        along(self.table, self._rows(q), self._rows(dq), self._rows(ddq), out.reshape(-1, self.n))
        return out

    def bias(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """h(q, dq): Coriolis, centrifugal and gravity torques, shape (..., n) [N m or N]."""
        return self.inverse_dynamics(q, dq, np.zeros(self.n))

    def gravity(self, q: ArrayLike) -> Array:
        """Torques that hold the arms still, shape (..., n) [N m or N]."""
        return self.inverse_dynamics(q, np.zeros(self.n), np.zeros(self.n))

    def _states(self, *arguments: ArrayLike) -> list[Array]:
        arrays = np.broadcast_arrays(*(np.asarray(argument, dtype=np.float64) for argument in arguments))
        if arrays[0].ndim == 0 or arrays[0].shape[-1] != self.n:
            raise ValueError(f"states must end in {self.n} joints, not have shape {arrays[0].shape}")
        return [np.ascontiguousarray(array) for array in arrays]

    def _rows(self, array: Array) -> Array:
        return array.reshape(-1, self.n)

    def _functions(self, q: Array) -> Mapping[str, Callable[..., Any]]:
        if self.always_compiled or q.ndim > 1:
            return compiled(rigid_body.__name__)
        return vars(rigid_body)


def dynamics(robot: Robot, *, always_compiled: bool = False) -> Dynamics:
    """Dynamics of a robot's arms."""
    return Dynamics(chain_table(robot), always_compiled)
