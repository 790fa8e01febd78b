"""Mass for parts that have none, where a format wants parts to have some."""

from __future__ import annotations

from ..core.representation import Inertia, Robot

# in those of the lightest arm: far below what any comparison sees
NEGLIGIBLE = 1.0e-12


def negligible(robot: Robot) -> Inertia:
    """A ball that weighs next to nothing beside any arm of the robot."""
    bodies = [stage.arm.inertia for stage in robot.stages]
    mass = min((body.mass for body in bodies if body.mass), default=1.0)
    moment = min((body.xx + body.yy + body.zz for body in bodies if body.xx + body.yy + body.zz), default=mass) / 3.0
    return Inertia(NEGLIGIBLE * mass, (0.0, 0.0, 0.0), *[NEGLIGIBLE * moment] * 3)
