"""What is left as another form of a finding's law, or against what simulation says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .forms import BEYOND_SAID, HALF_SAID, TWICE_SAID, is_wave
from .found import Found
from .gap import SHOWS_IN_BAND
from .held import LITTLE, MOST_LEFT, Held
from .judge import Judge
from .refine import PLAY, widths_about
from .unseen import OTHER_FORM, Along, Bent, along, bent

# part of the gap that may be another form of a law whose cause is known; a gear's error that comes twice as often as
# well may leave more, as inertia takes it by the square of how often it comes
MOST_BENT = 0.25
# part of the gap along the measured motion that contradicts findings by which simulation has none
CONTRADICTS = 0.3


def other_form(judge: Judge, held: Held) -> Bent | None:
    """Which other form of a finding's law what is left goes as, where that leaves next to nothing of the gap.

    Or little of it, of a law beyond the catalogue's.
    """
    if not held.found or held.explains:
        return None
    bends, beyond = held.unseen.beyond, None
    if bends < MOST_LEFT and held.open * bends < LITTLE:
        place = next(k for k, number in enumerate(held.unseen.numbers_beyond) if number)
        beyond = Bent(bends, place, BEYOND_SAID[held.found[place].effect])
        if held.open * bends < OTHER_FORM:
            return beyond
    if held.adequate:
        return None
    much = held.open > MOST_BENT
    if much and not any(is_wave(item) for item in held.found):
        return beyond
    form = bent(judge.whole, judge.whiten, held.found, judge.ways, held.unseen.rows)
    if form is None or (much and form.said not in (TWICE_SAID, HALF_SAID)):
        return beyond
    return form if form.leaves < MOST_LEFT and held.open * form.leaves < OTHER_FORM else beyond


def contradicted(judge: Judge, held: Held) -> Along | None:
    """What the measured motion has left of a gap that simulation takes for closed; None where that is little.

    A loop makes little of a torque that it holds against: what is near the cause closes its gap as well.
    """
    if not held.found or not held.adequate or judge.by_bands or held.rings:
        return None
    left = along(judge.whole, judge.whiten, held.found, judge.ways)
    if _speaks_against(left, held):
        others = (along(judge.whole, judge.whiten, found, judge.ways) for found in _of_other_widths(held.found))
        left = min((left, *others), key=lambda one: one.share)
    if not _speaks_against(left, held):
        return None
    rows = [[item.row for item in held.found] for _ in judge.ways]
    form = bent(judge.whole, judge.whiten, held.found, judge.ways, rows)
    return None if form and form.leaves < MOST_LEFT else left


def _speaks_against(left: Along, held: Held) -> bool:
    """Whether so much is left along the motion that it contradicts."""
    return left.share * held.unseen.beyond >= CONTRADICTS and left.loudest >= SHOWS_IN_BAND


def _of_other_widths(found: Sequence[Found]) -> list[list[Found]]:
    """Findings with each play a little narrower or wider."""
    return [
        [replace(other, row=row) if other is item else other for other in found]
        for item in found
        if item.effect == PLAY
        for row in widths_about(item.row)
    ]
