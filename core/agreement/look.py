"""What a difference looks like: the vocabulary of the fault finders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# a change explains a difference if it leaves less than this part of it
EXPLAINED = 1.0e-5


@dataclass(frozen=True, slots=True)
class Look:
    """What a difference looks like.

    Attributes:
        kind: One word or two: "inertia", "frame", "armature", "damping", "default damping", "stiffness", "friction",
            "gravity", "time shift", "order", "unknown" ...
        at: "arm_3", "joint_2", "robot".
        text: A clause for the sentence, without a full stop: what the odd voice has, instead of what.
    """

    kind: str
    at: str
    text: str


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: a, b and c."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def brief(value: float) -> str:
    """A number for a sentence: six digits at most."""
    rounded = float(f"{value:.6g}")
    return repr(int(rounded)) if abs(rounded) < 1e6 and rounded == int(rounded) else repr(rounded)
