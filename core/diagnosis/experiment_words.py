"""The next experiment in words: what the robot does, what each cause would show, how far apart they would be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .found import Found
from .words import SIGNALS, capitalised, cause_in_words, listed, percent, quantity

# what a cause does that others do not, as the end of a sentence that begins with its name
SHOWS = {
    "backlash": "lets the arm lag by the same way whatever the torque, and shows where the load changes its side",
    "base_tilt": "turns gravity in every joint at once",
    "controller_gain": "grows with the tracking error, however the robot moves",
    "coulomb_friction": "is the same against every motion, slow or fast",
    "delay": "shifts the torque in time, the more the faster it changes",
    "encoder_offset": "shifts every posture, and gravity with it",
    "hysteresis": "builds up over a small way after each reversal, at any speed",
    "joint_compliance": "gives in proportion to the load, and rings",
    "joint_compliance_6d": "lets the arm tilt at its bearing, as the load has it",
    "joint_spring": "pulls in proportion to the joint's own angle, whatever the others do",
    "kinematic_error": "moves the tool as the posture has it",
    "link_flexibility": "bends with the load, and moves the tool",
    "link_inertia": "follows gravity and the accelerations of all joints before it, as the posture has it",
    "load_friction": "grows with the load that the gear carries",
    "payload": "loads every joint at once",
    "rotor_inertia": "goes with the joint's own acceleration, the same in every posture",
    "stribeck_friction": "is there when slow and gone when fast",
    "torque_constant": "grows with the torque itself",
    "torque_limit": "cuts the highest torques and nothing else",
    "torque_offset": "is the same at all times, whichever way the joint moves",
    "torque_ripple": "repeats with the joint's angle, whatever the speed",
    "transmission_error": "repeats with the joint's angle, the more the faster",
    "viscous_friction": "grows with speed",
}  # fmt: skip
# below this share of the effect two causes say the same
_SAME = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two causes along a motion, the first taken for the truth, in the direction in which they are harder to tell.

    Attributes:
        one: The truth.
        other: Fitted to it.
        sigmas: What the fit leaves, in standard deviations of all noise: root of twice the evidence against it.
        share: The same as part of the first cause's whole effect.
        signal, index: Channel with most of it.
        rms: What is left there [unit].
        unit: Of it.
        enough, enough_share: What it takes to tell them apart.
    """

    one: Found
    other: Found
    sigmas: float
    share: float
    signal: str
    index: int
    rms: float
    unit: str
    enough: float
    enough_share: float

    @property
    def margin(self) -> float:
        """1 and above: they are told apart; evidence and share, the lesser."""
        return min((self.sigmas / self.enough) ** 2, self.share / self.enough_share)

    @property
    def apart(self) -> bool:
        """Whether the motion tells them apart."""
        return self.margin >= 1.0

    @property
    def names(self) -> tuple[str, str]:
        """Both causes in words."""
        return (_name(self.one), _name(self.other))


def why_in_words(duration: float | None, words: str, pairs: Sequence[Pair]) -> str:
    """What the motion separates (begun in lower case), what the robot does, what each cause shows, what stays open.

    Args:
        duration: Of the motion [s]; None: there is none.
        words: What the robot does.
        pairs: The nearest first.
    """
    if duration is None:
        if not pairs:
            return "No motion within the limits was found that the drives can make."
        return " ".join(_never(pair) for pair in pairs)
    split = [pair for pair in pairs if pair.apart]
    worst = split[0]
    if len(split) == len(pairs) > 1:
        what = f"{listed(dict.fromkeys(name for _, name in _both(split)))} from each other"
    else:
        what = listed(f"{one} from {other}" for one, other in (pair.names for pair in split))
    text = [f"separates {what}: for {duration:.0f} s {words}."]
    shows = {name: SHOWS[found.effect] for found, name in _both(split) if found.effect in SHOWS}
    if shows:
        text.append(capitalised("; ".join(f"{name} {what}" for name, what in shows.items())) + ".")
    one, other = worst.names
    nearest = " (the nearest two)" if len(split) > 1 else ""
    text.append(
        f"If it is {one}, the best {other} would miss{nearest} by {worst.sigmas:.0f} standard deviations of all noise, "
        f"{percent(worst.share)} of the effect's energy, most of it in {_channel(worst)} "
        f"({quantity(worst.rms, worst.unit, 2)} rms)."
    )
    text += [_never(pair) for pair in pairs if not pair.apart]
    return " ".join(text)


def because_in_words(pair: Pair, words: str) -> str:
    """Why two causes are one finding, as a clause; with the motion that would split them, if there is one."""
    if pair.apart:
        return f"these runs do not show where they differ; they would where {words}"
    if pair.share < _SAME:
        return "they say the same in every motion that these sensors see"
    return "they stay too near to each other in every motion within the limits"


def _never(pair: Pair) -> str:
    one, other = pair.names
    if pair.share < _SAME:
        return f"No motion can split {one} and {other}: with these sensors they say the same in each that was tried."
    return (
        f"No motion within the limits splits {one} and {other}: at best {percent(pair.share)} of the effect's energy "
        f"is left, {pair.sigmas:.1f} standard deviations of all noise."
    )


def _both(pairs: Iterable[Pair]) -> list[tuple[Found, str]]:
    return [(found, _name(found)) for pair in pairs for found in (pair.one, pair.other)]


def _name(found: Found) -> str:
    return cause_in_words(found.effect, found.place)


def _channel(pair: Pair) -> str:
    if pair.signal == "ee":
        return f"the tool's position along {'xyz'[pair.index]}"
    what = "motor torque" if pair.signal == "u" else SIGNALS.get(pair.signal, pair.signal)
    return f"the {what} of joint {pair.index + 1}"
