"""Veitschegger-Wu parameters from where the joints of a serial chain stand: the inverse of reading a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..representation import Pose, Vector3, VeitscheggerWu
from ..representation.veitschegger_wu import cos_sin

PARALLEL = 0.05
"""Sine of the angle below which two axes count as near-parallel (2.9 deg) and beta is used.

Their common normal is as far away as their distance over this sine: 20 times at the threshold, which costs two of
sixteen digits. Misalignments of real arms are a hundred times smaller, twists by design ten times larger."""

MEET = 1e-9
"""Distance of two axes, over the robot's length, below which they count as meeting when x is given its sense."""


@dataclass(frozen=True, slots=True)
class JointAxis:
    """Where a joint stands at zero.

    Attributes:
        origin: A point of the axis, the joint's real place, in the root frame [m].
        direction: Unit vector along the axis in the root frame; a joint's variable grows about or along it.
    """

    origin: Vector3
    direction: Vector3


@dataclass(frozen=True, slots=True)
class Fit:
    """A serial chain in Veitschegger-Wu parameters. Row i of links, with row i of corrections, belongs to arm i.

    Attributes:
        base_in_root: Frame 0; its z axis is the axis of joint 1.
        base_correction: Row 0 of the corrections: places joint 1 in the base.
        links: One row an arm, at the zeros of the joints' variables.
        corrections: After each link, the real place of the next joint; the last one is zero.
        arms_in_root: Frame of each arm in the root at zero, as the rows give it.
        tool_in_arm: The tip in the last arm's frame.
    """

    base_in_root: Pose
    base_correction: VeitscheggerWu
    links: tuple[VeitscheggerWu, ...]
    corrections: tuple[VeitscheggerWu, ...]
    arms_in_root: tuple[Pose, ...]
    tool_in_arm: Pose


def fit_chain(joints: Sequence[JointAxis], tip_in_root: Pose) -> Fit:
    """Parameters of the chain whose joints stand at the given axes and whose tip stands at tip_in_root at zero.

    Frame 0 stands on the axis of joint 1 at the point nearest to the root's origin, turned as little as possible.
    Frame i has its z axis on the axis of joint i + 1; the last one stands on the z axis of the tip. Each row is
    found from the frame that the rows before it really give, so that rounding does not add up along the chain.

    Args:
        joints: Axes of joints 1 to n (n >= 1) at the zeros of their variables. A prismatic joint moves the same
            wherever its axis stands; it is left at its origin.
        tip_in_root: Pose of the tip in the root frame with all variables zero.
    """
    base = _base_in_root(joints[0])
    frame = base.matrix()
    size = max(math.hypot(*place) for place in (tip_in_root.xyz, *(joint.origin for joint in joints)))
    base_correction = VeitscheggerWu(d=_settled(_point_in(frame, joints[0].origin)[2], size))
    tip = tip_in_root.matrix()
    targets = [*joints[1:], JointAxis(tip_in_root.xyz, (float(tip[0, 2]), float(tip[1, 2]), float(tip[2, 2])))]
    links: list[VeitscheggerWu] = []
    corrections: list[VeitscheggerWu] = []
    arms: list[Pose] = []
    for target in targets:
        link = link_to_axis(_point_in(frame, target.origin), _direction_in(frame, target.direction), size)
        frame = frame @ link.matrix()
        links.append(link)
        arms.append(Pose.from_matrix(frame))
        corrections.append(VeitscheggerWu(d=_settled(_point_in(frame, target.origin)[2], size)))
    corrections[-1] = VeitscheggerWu()  # that row would be the flange, and the tool says where the tip is
    return Fit(base, base_correction, tuple(links), tuple(corrections), tuple(arms), arms[-1].inverse() @ tip_in_root)


def link_to_axis(origin: Vector3, direction: Vector3, size: float = 0.0) -> VeitscheggerWu:
    """Parameters whose frame has its z axis on a given line of the frame before it.

    Axes at an angle: the common normal, beta = 0 (Denavit and Hartenberg, 1955), x along it away from the axis
    before, or, where the axes meet, whichever way turns less. Near-parallel axes have it far away or nowhere: there
    the new frame stands at `origin` itself, alpha and beta turn its z axis (Hayati, 1983; Veitschegger and Wu, 1986),
    and d, which would be free, is the origin's height. Together they reach any line in space.

    Args:
        origin: A point of the line [m].
        direction: Unit vector along the line.
        size: Length of the robot [m], whose rounding counts as zero; at least the distance of `origin`.
    """
    size = max(size, math.hypot(*origin))
    px, py, pz = (_settled(c, size) for c in origin)
    zx, zy, zz = (_settled(c, 1.0) for c in direction)
    sine = math.hypot(zx, zy)
    if sine >= PARALLEL:
        theta, alpha = math.atan2(zx, -zy), math.atan2(sine, zz)
        a = _settled((zx * py - zy * px) / sine, size)
        backwards = not -_QUARTER < theta <= _QUARTER if abs(a) <= MEET * size else a < 0.0
        if backwards:
            a, alpha = -a, -alpha
            theta += -math.pi if theta > 0.0 else math.pi
        foot = (zx * px + zy * py) / sine**2
        return VeitscheggerWu(alpha, a + 0.0, theta, _settled(pz - foot * zz, size))
    a = math.hypot(px, py)
    theta = math.atan2(py, px) if a else 0.0
    c, s = cos_sin(theta)
    along, across = c * zx + s * zy, c * zy - s * zx
    return VeitscheggerWu(math.atan2(0.0 - across, zz), a, theta, pz, math.atan2(along, math.hypot(across, zz)))


_QUARTER = math.pi / 2 * (1.0 - 1e-6)


def _settled(value: float, size: float) -> float:
    """The value, or 0 where it is the rounding of numbers of that size; tables are to show 0 and 90 degrees."""
    return value if abs(value) > 1e-15 * size else 0.0


def _point_in(frame: NDArray[np.float64], point: Vector3) -> Vector3:
    """A point of the root in a frame, shape (4, 4), that stands in the root."""
    x, y, z = (float(c) for c in frame[:3, :3].T @ (np.array(point) - frame[:3, 3]))
    return (x, y, z)


def _direction_in(frame: NDArray[np.float64], direction: Vector3) -> Vector3:
    x, y, z = (float(c) for c in frame[:3, :3].T @ np.array(direction))
    return (x, y, z)


def _base_in_root(joint: JointAxis) -> Pose:
    """The root's frame at the foot of its perpendicular on the joint's axis, turned the shortest way onto the axis.

    An axis that points down is reached from Rx(180 deg): noise on a vertical axis then cannot swing the base.
    """
    x, y, z = joint.direction
    along = x * joint.origin[0] + y * joint.origin[1] + z * joint.origin[2]
    ox, oy, oz = (
        _settled(o - along * c, math.hypot(*joint.origin)) for o, c in zip(joint.origin, (x, y, z), strict=True)
    )
    up = 1.0 if z >= 0.0 else -1.0
    h = 1.0 + abs(z)
    # shortest turn of z onto (x, up y, up z), then the half turn about x where up is -1
    rotation = (
        (1.0 - x * x / h, -x * up * y / h, x),
        (-x * y / h, up * (1.0 - y * y / h), y),
        (-up * x, -y, z),
    )
    return Pose((ox, oy, oz), rotation)
