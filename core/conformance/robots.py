"""Random robots: every frame askew, bodies off their axes, both kinds of joints, corrected, under an odd gravity."""

from __future__ import annotations

import numpy as np

from ..database import Database, FrozenMap, Placement
from ..effects import EffectRow
from ..representation import FrictionModel, Inertia, Joint, JointKind, Pose, VeitscheggerWu

SEEDS = tuple(range(8))
PRISMATIC = 0.3


def random_database(seed: int) -> Database:
    """A robot of 1 to 7 joints with rotors, some of them elastic, some rubbing; the same for the same seed."""
    random = np.random.default_rng([20130813, seed])
    n = 1 + seed % 7
    kinds: list[JointKind] = ["prismatic" if random.random() < PRISMATIC else "revolute" for _ in range(n)]
    size = random.uniform(0.2, 0.5, n)
    draw = random.uniform

    def link(i: int) -> VeitscheggerWu:
        alpha, theta = (float(x) for x in draw(-3.1, 3.1, 2))
        a, d = (float(x) for x in draw(-1.0, 1.0, 2) * size[i])
        return VeitscheggerWu(alpha, a, theta, d, float(draw(-0.1, 0.1)))

    def correction(before: JointKind) -> VeitscheggerWu:
        # what keeps the next joint's axis: of a revolute joint theta and d, of a prismatic one a too
        a, theta, d = (float(x) for x in draw(-0.2, 0.2, 3))
        return VeitscheggerWu(0.0, a if before == "prismatic" else 0.0, theta, d, 0.0)

    def body(i: int) -> Inertia:
        mass = float(draw(1.0, 10.0)) / (i + 1)
        half = draw(0.2, 1.0, 3) * size[i]
        turn = Pose.from_rpy((0.0, 0.0, 0.0), _three(draw(-3.0, 3.0, 3))).rotation_matrix()
        tensor = turn @ np.diag(mass / 3.0 * (np.sum(half**2) - half**2)) @ turn.T
        return Inertia.from_tensor(mass, draw(-0.5, 0.5, 3) * size[i], tensor)

    def rows(share: float, column: str, low: float, high: float, **more: float) -> tuple[EffectRow, ...]:
        return tuple(
            EffectRow(i + 1, {column: float(draw(low, high)), **more}) for i in range(n) if random.random() < share
        )

    effects = {
        "coulomb_friction": rows(0.5, "torque", 1.0, 9.0),
        "joint_compliance": rows(0.5, "stiffness", 5.0e4, 2.0e5, damping=200.0),
        "rotor_inertia": rows(1.0, "inertia", 0.5, 3.0),
        "viscous_friction": rows(0.5, "coefficient", 1.0, 9.0),
    }
    return Database(
        name=f"random_{seed}",
        kinematics=tuple(link(i) for i in range(n)),
        inertias=tuple(body(i) for i in range(n)),
        joints=tuple(Joint(f"joint_{i + 1}", kind) for i, kind in enumerate(kinds)),
        corrections=tuple(correction(kind) for kind in (*kinds, "revolute")),
        gravity=_three(draw(-10.0, 10.0, 3)),
        base=Placement(_three(draw(-1.0, 1.0, 3)), _three(draw(-3.0, 3.0, 3))),
        tool=Placement(_three(draw(-0.2, 0.2, 3)), _three(draw(-3.0, 3.0, 3))),
        effects=FrozenMap({name: table for name, table in effects.items() if table}),
        friction=FrictionModel("smooth", 1.0e-2),
    )


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
