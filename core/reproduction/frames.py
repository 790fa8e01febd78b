"""Figures 3 and 4: the frames of the chain, and of the joints at their real places."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..build import build
from ..database import with_effects
from ..effects import EffectRow, effect_named
from ..expansion import expanded
from ..kinematics import dynamics, kinematics
from ..representation import Robot, VeitscheggerWu
from .case import LEVEL, Case
from .statics import sagged_positions

Array = NDArray[np.float64]

BEARINGS = "joint_compliance_6d"


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The arm in its zero state, without and with the geometry corrections.

    Attributes:
        chain: Where joint 1 ... n and the flange stand by the Veitschegger-Wu chain alone, in the base, shape
            (n + 1, 4, 4).
        real: The same with the geometry corrections (equation 4).
        shifts: How far each correction moves its frame [m], shape (n + 1,).
        turns: By what angle [rad], shape (n + 1,).
        equation_1: Largest difference of an element of the arms' transforms, whose beta is 0, from the paper's
            equation 1 written out.
        tip: Tool centre point in the zero state [m], shape (3,).
        same_motion: Largest relative difference that the corrections make to mass matrix and gravity torques along
            the path, where joints give about their own axes only.
        bearings: What they make to the tip's sag along the path where the bearings tilt, too [m].
        bearing_sag: Largest sag there [m].
    """

    chain: Array
    real: Array
    shifts: Array
    turns: Array
    equation_1: float
    tip: Array
    same_motion: float
    bearings: float
    bearing_sag: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "chain_m": self.chain[:, :3, 3].tolist(),
            "real_m": self.real[:, :3, 3].tolist(),
            "shift_m": self.shifts.tolist(),
            "turn_rad": self.turns.tolist(),
            "equation_1": self.equation_1,
            "tip_m": self.tip.tolist(),
            "corrections_and_dynamics_relative": self.same_motion,
            "corrections_and_tilting_bearings_m": self.bearings,
            "sag_with_tilting_bearings_m": self.bearing_sag,
        }


def frames(case: Case) -> Frames:
    """The frames of figures 3 and 4, and what the corrections change."""
    robot = case.rigid
    chain = kinematics(robot)
    zero = np.zeros(robot.n)
    arms = chain.arms_in_base(zero)
    before = np.concatenate([np.eye(4)[None], arms])
    placed = np.array([robot.correction_before(i).pose().matrix() for i in range(robot.n)])
    flange = robot.stages[-1].arm.correction.pose().matrix()
    corrections = np.concatenate([placed, flange[None]])
    trace = np.einsum("kii->k", corrections[:, :3, :3])
    positions = case.motion.at(case.motion.knots)[0]
    bare = _without_corrections(robot)
    tilting = _tilting(case)
    along = case.motion.at(case.corners)[0]
    real_sag, bare_sag = _sag_of(tilting, along), _sag_of(_without_corrections(tilting), along)
    return Frames(
        chain=before,
        real=before @ corrections,
        shifts=np.linalg.norm(corrections[:, :3, 3], axis=1),
        turns=np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)),
        equation_1=max(
            float(np.max(np.abs(stage.arm.link.pose().matrix() - denavit_hartenberg(stage.arm.link))))
            for stage in robot.stages
        ),
        tip=chain.tool_in_base(zero)[:3, 3],
        same_motion=max(
            _relative(dynamics(robot).mass_matrix(positions), dynamics(bare).mass_matrix(positions)),
            _relative(dynamics(robot).gravity(positions), dynamics(bare).gravity(positions)),
        ),
        bearings=float(np.max(np.linalg.norm(real_sag - bare_sag, axis=1))),
        bearing_sag=float(np.max(np.linalg.norm(real_sag, axis=1))),
    )


def denavit_hartenberg(link: VeitscheggerWu) -> Array:
    """Equation 1 of the paper, element by element, shape (4, 4); beta is left out."""
    c, s = np.cos(link.theta), np.sin(link.theta)
    ca, sa = np.cos(link.alpha), np.sin(link.alpha)
    return np.array(
        [
            [c, -s * ca, s * sa, link.a * c],
            [s, c * ca, -c * sa, link.a * s],
            [0.0, sa, ca, link.d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _without_corrections(robot: Robot) -> Robot:
    none = VeitscheggerWu()
    stages = tuple(replace(stage, arm=replace(stage.arm, correction=none)) for stage in robot.stages)
    return replace(robot, base_correction=none, stages=stages)


def _relative(one: Array, other: Array) -> float:
    return float(np.max(np.abs(one - other)) / np.max(np.abs(one)))


def _tilting(case: Case) -> Robot:
    """The arm whose bearings tilt as easily as the paper's joints turn: kx and ky of table 6's K.

    The paper gives no numbers for its six-component springs ("further development"); these are ours.
    """
    compliance = case.database.effects["joint_compliance"]
    columns = {column.name: column.default or 0.0 for column in effect_named(BEARINGS).columns}
    rows = tuple(
        EffectRow(row.at, {**columns, "krx": row.values["stiffness"], "kry": row.values["stiffness"]})
        for row in compliance
    )
    return build(with_effects(case.database, {BEARINGS: rows}), effects=[BEARINGS, *case.database.level_effects(LEVEL)])


def _sag_of(robot: Robot, theta: Array) -> Array:
    """How far the tip sags below where rigid joints would hold it [m], shape (m, 3), on motor sides theta (m, n)."""
    whole = expanded(robot, imposed=True)
    chain, held = kinematics(whole.robot), whole.spread(theta)
    rest = sagged_positions(whole.robot, held)
    return chain.tool_in_base(rest)[:, :3, 3] - chain.tool_in_base(held)[:, :3, 3]
