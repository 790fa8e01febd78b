"""Load friction: gears rub the more, the more torque they pass."""

from __future__ import annotations

from typing import Any

from .effect import Column, Effect, Law


def level(p: Any, t: float, theta: float, dtheta: float, q: float, dq: float, load: float) -> float:
    """mu abs(T), sticking like Coulomb friction; T is what the drive passes to the arm."""
    return p[0] * abs(load)


class LoadFriction(Effect):
    """mu abs(T) sign(theta'), solved with the accelerations (Dohring et al., 1993; Bittencourt et al., 2010)."""

    name = "load_friction"
    key = "joint"
    columns = (Column("coefficient", minimum=0.0, maximum=1.0),)
    laws = (Law("level", level, uses_load=True),)

    def check(self, values: Any) -> str | None:
        """At 1 the gear locks itself."""
        mu = values["coefficient"]
        return f"coefficient is {mu!r}; it must be below 1, where the gear locks itself" if mu >= 1.0 else None
