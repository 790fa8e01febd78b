"""Springs that stiffen: what a fit along the measured motion may say of them beyond the catalogue's law.

T = K s (1 + stiffening s^2). Harmonic drives, bearings and bent arms do so, by half and more under their own load, and
then the catalogue's straight law leaves most of the gap, or another cause is nearer to it. No table of a database and
no engine knows this number: it goes with a finding's row while causes compete, and goes out of it with the spring's
chord in its place.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from ..expansion import Expansion
from ..representation import Robot
from .model import Rows

Vector = NDArray[np.float64]

# beside the columns of a row [1/rad^2 or 1/m^2]
STIFFENING = "stiffening"
# the columns that are springs
SPRINGS: Mapping[str, tuple[str, ...]] = {
    "joint_compliance": ("stiffness",),
    "joint_compliance_6d": ("kx", "ky", "kz", "krx", "kry", "krz"),
    "link_flexibility": ("ku", "kv"),
}
# (effect, number of its place, stiffening) of each spring that has any
Stiffening = tuple[tuple[str, int, float], ...]


def stiffening_of(rows: Rows) -> Stiffening:
    """Which springs of some rows stiffen."""
    return tuple(
        (effect, row.at, row.values[STIFFENING])
        for effect in SPRINGS
        for row in rows.get(effect, ())
        if row.values.get(STIFFENING, 0.0)
    )


def of_joints(robot: Robot, whole: Expansion, stiffening: Stiffening) -> Vector:
    """Stiffening of every joint of an expanded robot, shape (k,)."""
    out = np.zeros(whole.robot.n)
    for effect, at, value in stiffening:
        for k in places(robot, whole, effect, at):
            out[k] = value
    return out


def places(robot: Robot, whole: Expansion, effect: str, at: int) -> list[int]:
    """Joints of an expanded robot, from 0, that are the springs of an effect at joint or arm `at`."""
    own = whole.driven[at - 1]
    if effect == "joint_compliance":
        return [own]
    stage = robot.stages[at - 1]
    end = whole.driven[at] if at < robot.n else whole.robot.n
    begins = f"{stage.arm.name if effect == 'link_flexibility' else stage.joint.name}_"
    behind = [k for k in range(own + 1, end) if whole.robot.stages[k].joint.name.startswith(begins)]
    return [own, *behind] if effect == "joint_compliance_6d" else behind


def straight(row: EffectRow) -> EffectRow:
    """A row without the stiffening of its springs."""
    return EffectRow(row.at, {name: value for name, value in row.values.items() if name != STIFFENING})
