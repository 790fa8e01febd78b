"""An effect at a place, and what both are called."""

from __future__ import annotations

from dataclasses import dataclass

from ..effects import effect_named


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """An effect at a place.

    Attributes:
        effect: Its name.
        at: Number of joint or arm, from 1; 0 for the robot.
    """

    effect: str
    at: int

    @property
    def place(self) -> str:
        """joint_N, arm_N or robot."""
        return place_of(self.effect, self.at)

    @property
    def key(self) -> tuple[str, int]:
        """Effect and number of its place."""
        return (self.effect, self.at)


def place_of(effect: str, at: int) -> str:
    """joint_N, arm_N or robot."""
    key = effect_named(effect).key
    return "robot" if key == "robot" else f"{key}_{at}"
