"""What a fit along the measured motion may say of an effect beyond the catalogue's law.

Springs that stiffen, T = K s (1 + stiffening s^2): harmonic drives, bearings and bent arms do so, by half and more
under their own load. Torque limits that are felt before they are reached: a motor that saturates gives ever less of
what it is asked for, over a knee. Torque constants that droop, T = gain tau / sqrt(1 + 2 droop tau^2), as a motor's
iron saturates. Waves that come twice as often as well: a motor's ripple does so, and a gear's error, of which inertia
makes four times as much. Then the catalogue's law leaves most of the gap, or another cause is nearer to it. No table
of a database and no engine knows these numbers: they go with a finding's row while causes compete, and go out of it
with the catalogue's nearest law in its place.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..effects import EffectRow
from ..expansion import Expansion
from ..representation import Robot
from .model import Rows

Vector = NDArray[np.float64]

# beside the columns of a row: of a spring [1/rad^2 or 1/m^2], of a torque limit its knee's width, in limits, of a
# motor's constant how it droops [1/(N m)^2 or 1/N^2], of a wave how large it comes twice as often, in its amplitudes,
# and with which phase [rad]
STIFFENING, KNEE, DROOP, SECOND, SECOND_PHASE = "stiffening", "knee", "droop", "second", "second_phase"
# the columns that are springs
SPRINGS: Mapping[str, tuple[str, ...]] = {
    "joint_compliance": ("stiffness",),
    "joint_compliance_6d": ("kx", "ky", "kz", "krx", "kry", "krz"),
    "link_flexibility": ("ku", "kv"),
}
LIMIT, CONSTANT = "torque_limit", "torque_constant"
# the effects that go round with a position
WAVES = ("torque_ripple", "transmission_error")
# what each effect may have
_NUMBERS = {**dict.fromkeys(SPRINGS, STIFFENING), LIMIT: KNEE, CONSTANT: DROOP, **dict.fromkeys(WAVES, SECOND)}
# between what they may be; a wider knee bends the torque where there is none of it, and of a wave that comes more twice
# as often than as often, that is what comes
RANGES = {
    STIFFENING: (0.0, np.inf),
    KNEE: (0.0, 0.2),
    DROOP: (0.0, np.inf),
    SECOND: (0.0, 1.0),
    SECOND_PHASE: (-np.inf, np.inf),
}
# part of its gain that a motor keeps at least: it would be asked for anything where it can give no more
LEAST_KEPT = 0.1
# (effect, number of its place, its number beyond the catalogue) of each row that has one
Beyond = tuple[tuple[str, int, float], ...]


def beyond_of(rows: Rows) -> Beyond:
    """What some rows have beyond the catalogue's laws."""
    return tuple(
        (effect, row.at, row.values[name])
        for effect, name in _NUMBERS.items()
        for row in rows.get(effect, ())
        if row.values.get(name, 0.0)
    )


def number_of(effect: str, row: EffectRow) -> float:
    """A row's number beyond the catalogue's law; 0 where it has none."""
    return row.values.get(_NUMBERS.get(effect, ""), 0.0)


def how_many(effect: str) -> int:
    """How many numbers an effect's law has beyond the catalogue's."""
    return 2 if effect in WAVES else 1


def with_harmonics(rows: Rows) -> Rows:
    """Rows, every wave that comes twice as often as well followed by one that does."""
    split = {effect: tuple(itertools.chain(*map(harmonics, rows[effect]))) for effect in WAVES if effect in rows}
    return {**rows, **split}


def harmonics(wave: EffectRow) -> tuple[EffectRow, ...]:
    """A wave, and where it comes twice as often as well the one that does."""
    values = wave.values
    if not values.get(SECOND, 0.0):
        return (wave,)
    twice = {
        "amplitude": values[SECOND] * values["amplitude"],
        "cycles": 2.0 * values["cycles"],
        "phase": values[SECOND_PHASE],
    }
    return wave, EffectRow(wave.at, twice)


def of_springs(beyond: Beyond) -> Beyond:
    """Those of springs alone."""
    return tuple(one for one in beyond if one[0] in SPRINGS)


def at_joints(beyond: Beyond, effect: str, n: int) -> tuple[float, ...]:
    """An effect's number beyond the catalogue at every joint, 0 where it has none."""
    there = {at: value for name, at, value in beyond if name == effect}
    return tuple(there.get(i + 1, 0.0) for i in range(n))


def of_joints(robot: Robot, whole: Expansion, stiffening: Beyond) -> Vector:
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


def asked_to_give(torque: Vector, gain: Vector, droop: Vector) -> Vector:
    """What motors are asked for where they give a torque, gain tau / sqrt(1 + 2 droop tau^2) of what they are asked.

    Args:
        torque: That they give [N m or N], shape (m, n).
        gain: Of a small torque, shape (n,).
        droop: [1/(N m)^2 or 1/N^2], shape (n,).
    """
    if not droop.any():
        return torque / gain
    kept = np.maximum(gain**2 - 2.0 * droop * torque**2, (LEAST_KEPT * gain) ** 2)
    return np.asarray(torque / np.copysign(np.sqrt(kept), gain), dtype=np.float64)


def cut_softly(torque: Vector, limit: float, knee: float = 0.0) -> Vector:
    """What a motor gives of a torque near its limit: ever less, by log(1 + e^x) over the knee; cut where that is 0.

    Args:
        torque: What it is asked for [N m or N].
        limit: What it comes to [N m or N].
        knee: Width, in limits.
    """
    width = knee * limit
    if not 0.0 < width < np.inf:
        return np.asarray(np.clip(torque, -limit, limit), dtype=np.float64)
    beyond = _ramp(torque - limit, width) - _ramp(-torque - limit, width)
    return np.asarray(torque - beyond, dtype=np.float64)


def _ramp(x: Vector, width: float) -> Vector:
    """Nothing below 0 and x above it, bent over so much of x."""
    return width * np.logaddexp(0.0, x / width)


def by_catalogue(row: EffectRow) -> EffectRow:
    """A row with the catalogue's law: without what it has beyond."""
    return EffectRow(row.at, {name: value for name, value in row.values.items() if name not in RANGES})
