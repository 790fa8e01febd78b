"""Six-component joint compliance: the bearing gives in every direction, as the paper's outlook asks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..errors import UsageError
from ..representation import Mount, Robot, Spring, Stage
from .effect import Column, Effect, EffectRow, with_stage

AXES = ("x", "y", "z", "rx", "ry", "rz")


class JointCompliance6d(Effect):
    """A six-component spring-damper at the joint's real place, on the arm's side of the drive.

    It stands in the frame that moves with the joint (z = axis); deflections follow one another in the order x y z rx
    ry, and rz is in series with the drive, as joint_compliance (at a prismatic joint z is, and rz follows ry). inf or
    missing: rigid there. Each component is a linear spring-damper of its own, without coupling. The outlook of
    IMECE2013-64815 asks for it.
    """

    name = "joint_compliance_6d"
    key = "joint"
    columns = (
        *(
            Column(f"k{axis}", "N*m/rad" if "r" in axis else "N/m", math.inf, 0.0, exclusive=True, infinite=True)
            for axis in AXES
        ),
        *(Column(f"b{axis}", "N*m*s/rad" if "r" in axis else "N*s/m", 0.0, 0.0) for axis in AXES),
    )
    after = ("joint_compliance",)

    def apply(self, robot: Robot, rows: Sequence[EffectRow]) -> Robot:
        """Gives the stages their mounts, and the drives the spring about their axis."""
        for row in rows:

            def change(stage: Stage, row: EffectRow = row) -> Stage:
                own = "rz" if stage.joint.kind == "revolute" else "z"
                k = {axis: row.values[f"k{axis}"] for axis in AXES}
                b = {axis: row.values[f"b{axis}"] for axis in AXES}
                drive = stage.drive
                if math.isfinite(k[own]):
                    if drive.spring is not None:
                        raise UsageError(
                            f"{stage.joint.name} has joint_compliance and a finite k{own} of {self.name}, which are "
                            "the same spring; keep one."
                        )
                    drive = replace(drive, spring=Spring(k[own], b[own]))
                del k[own], b[own]
                give = any(math.isfinite(value) for value in k.values())
                return replace(stage, drive=drive, mount=Mount(_five(k), _five(b)) if give else stage.mount)

            robot = with_stage(robot, row.at, change)
        return robot


def _five(values: dict[str, float]) -> tuple[float, float, float, float, float]:
    v, w, x, y, z = values.values()
    return v, w, x, y, z
