"""What of findings holds on runs that no fit saw, and why others do not."""

from __future__ import annotations

from dataclasses import dataclass

from .diagnosis import HowFar, Overlay, Rejected
from .found import Found
from .gap import Gap
from .refine import Refined
from .unseen import OTHER_FORM, Unseen

# why a finding does not hold
UNREAL = "needs a body that cannot exist"
GONE = "no gain on held-out data"
NOT_EXCITED = "not excited by the held-out runs"
UNTOLD = "how much of it there is cannot be told from nothing"
CRUMB = "no more than what is left where a law has another form"
WILD = "no engine can simulate the robot with it under this controller"
TOO_FAST = "rings far faster than anything that these runs show"
GROWS = "with others it only follows a resistance that grows faster than with its joint's speed"
OTHER_LAW = "no more than what is left where the law of another finding at its joint has another form"
CONTACT = "no more than how hard its play's contact is, which nobody knows"
# by how much a finding must make the gap of unseen runs shrink, as part of the gap before
HELPS, HARMS, BEYOND_DOUBT = 0.01, 0.002, 15.0
# part of what a finding takes away that the laws of others at its joint must leave it, or it is theirs; of what all
# leave, the part that other forms of their laws may leave where no cause is missing
MOST_LEFT = 0.4
# part of the gap that a spring which stiffens may leave to be its cause, where a straight one closes nothing of it
LITTLE = 0.25
# part of a gap that is most of it
MOSTLY = 0.5


@dataclass(frozen=True, slots=True)
class NoLaw:
    """A resistance that no law of the catalogue is.

    Attributes:
        joint: From 1.
        said: What is told of it.
    """

    joint: int
    said: str


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """What holds on runs that no fit saw.

    Attributes:
        found: Findings.
        unseen: What they are worth there.
        dropped: Those that do not hold.
        failed: Effects and places of those whose evidence does not hold, or whose body cannot be.
        how_far: How far the gap shrinks there.
        overlays: Its curves.
        after: The gap that is left; None where nothing was found.
        numbers: Every split's fit with numbers from simulation, where it was by these that the findings hold; else ().
        by_bands: Nothing but the measured motion was simulated, so that bands know more than mean squares.
        no_law: What was found stands for, as the catalogue's nearest; None where that has its law.
        rings: What was found is a drive that rings, found in simulation: the measured motion is no witness of it.
    """

    found: tuple[Found, ...]
    unseen: Unseen
    dropped: tuple[Rejected, ...]
    failed: set[tuple[str, str]]
    how_far: HowFar
    overlays: tuple[Overlay, ...]
    after: Gap | None
    numbers: tuple[Refined, ...] = ()
    by_bands: bool = False
    no_law: NoLaw | None = None
    rings: bool = False

    @property
    def bends(self) -> set[tuple[str, str]]:
        """Effects and places of those that were no more than another form of a law."""
        return {(item.effect, item.at) for item in self.dropped if item.why == OTHER_LAW}

    @property
    def by(self) -> float:
        """How far the gap shrinks."""
        return (self.how_far.shrinks_by or 0.0) if self.found else 0.0

    @property
    def explains(self) -> bool:
        """Whether what is left is no more than noise."""
        return self.after is not None and self.after.is_noise and not self._hidden

    @property
    def _hidden(self) -> bool:
        """Whether what is left stands out in a band of what a mean square takes for noise."""
        return self.by_bands and self.unseen.stands_out and self.after is not None and self.after.is_noise

    @property
    def open(self) -> float:
        """Part of the gap's energy that is left; 0 where that is noise, 1 where nobody knows."""
        if self.explains:
            return 0.0
        if self._hidden:
            return self.unseen.open
        by = self.how_far.shrinks_by
        return 1.0 if not self.found or by is None else min(1.0, (1.0 - by) ** 2)

    @property
    def adequate(self) -> bool:
        """Whether what is left is no more than noise, or than a law leaves whose form is not quite the real one's."""
        return self.open < OTHER_FORM

    def dropped_but(self, other: Held) -> tuple[Rejected, ...]:
        """Those dropped here that another set of findings neither has nor drops."""
        said = {(item.effect, item.place) for item in other.found} | {(r.effect, r.at) for r in other.dropped}
        return tuple(item for item in self.dropped if (item.effect, item.at) not in said)
