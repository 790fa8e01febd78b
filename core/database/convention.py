"""From the modified convention (Craig) to the standard one.

Craig's row i is Rx(alpha) Tx(a) Rz(theta) Tz(d) with his alpha_{i-1}, a_{i-1}; the standard row is
Rz(theta) Tz(d) Tx(a) Rx(alpha). The two chains are the same product, cut at other places: the first Rx Tx goes into
the base, each further one to the row before it, so that the standard frame of arm i is Craig's followed by
Tx(a_i) Rx(alpha_i). The last frame, and with it the tool, stays where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..representation import Inertia, Pose, VeitscheggerWu
from .database import Placement, Visual


def standard_rows(modified: Sequence[VeitscheggerWu]) -> tuple[VeitscheggerWu, ...]:
    """Standard parameters of each arm; the first row's alpha and a are left for `standard_base`."""
    following = (*modified[1:], VeitscheggerWu())
    return tuple(
        VeitscheggerWu(after.alpha, after.a, row.theta, row.d) for row, after in zip(modified, following, strict=True)
    )


def standard_base(base: Placement, first: VeitscheggerWu) -> Placement:
    """The base with the first row's Rx(alpha) Tx(a) taken up."""
    if first.alpha == 0.0 and first.a == 0.0:
        return base
    return _placement(base.pose() @ VeitscheggerWu(first.alpha, first.a).pose())


def craig_in_standard(standard: Sequence[VeitscheggerWu]) -> tuple[Pose, ...]:
    """Craig's frame of each arm in the standard one."""
    return tuple(VeitscheggerWu(row.alpha, row.a).pose().inverse() for row in standard)


def moved_inertias(inertias: Sequence[Inertia], here_in_new: Sequence[Pose]) -> tuple[Inertia, ...]:
    """Mass properties seen from the other frames; unchanged where the frames are the same."""
    return tuple(
        inertia if pose == Pose() else inertia.moved(pose) for inertia, pose in zip(inertias, here_in_new, strict=True)
    )


def moved_visuals(visuals: Sequence[tuple[Visual, ...]], here_in_new: Sequence[Pose]) -> tuple[tuple[Visual, ...], ...]:
    """Shapes seen from the other frames; unchanged where the frames are the same."""
    return tuple(
        tuple(
            shape if pose == Pose() else replace(shape, placement=_placement(pose @ shape.placement.pose()))
            for shape in arm
        )
        for arm, pose in zip(visuals, here_in_new, strict=True)
    )


def _placement(pose: Pose) -> Placement:
    return Placement(pose.xyz, pose.rpy())
