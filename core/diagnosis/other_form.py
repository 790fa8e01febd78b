"""What is left as another form of a finding's law, or against what simulation says."""

from __future__ import annotations

from .forms import BEYOND_SAID, HALF_SAID, TWICE_SAID, is_wave
from .gap import SHOWS_IN_BAND
from .held import HELPS, LITTLE, MOST_LEFT, Held
from .judge import Judge
from .refine import PLAY
from .turning import turning
from .unseen import OTHER_FORM, Along, Bent, along, bent, of_other_widths
from .words import BOUNCES_SAID, TURNS_SAID

# part of the gap that may be another form of a law whose cause is known; a gear's error that comes twice as often as
# well may leave more, as inertia takes it by the square of how often it comes
MOST_BENT = 0.25
# part of the gap along the measured motion that contradicts findings by which simulation has none
CONTRADICTS = 0.3


def other_form(judge: Judge, held: Held) -> Bent | None:
    """Which other form of a finding's law what is left goes as, where that leaves next to nothing of the gap.

    Or little of it, of a law beyond the catalogue's. Play in which an arm bounces has as many forms as runs.
    """
    if not held.found or held.explains:
        return None
    return _form_of(judge, held) or _bouncing(judge, held) or _turning(judge, held)


def _form_of(judge: Judge, held: Held) -> Bent | None:
    """Another form of a law that what is left goes as."""
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


def _bouncing(judge: Judge, held: Held) -> Bent | None:
    """Play in which an arm bounces, where what is left of a gap that it makes smaller is no more than that makes."""
    place = next((k for k, item in enumerate(held.found) if item.effect == PLAY), None)
    if place is None or held.adequate or held.by < HELPS:
        return None
    bounced = judge.bounces(held.found, held.unseen)
    if bounced is None or not bounced.says_all or held.open * bounced.leaves >= OTHER_FORM:
        return None
    return Bent(bounced.leaves, place, BOUNCES_SAID)


def _turning(judge: Judge, held: Held) -> Bent | None:
    """Dry friction that turns in another way, where that is all that is left and the measured motion is at peace."""
    if held.adequate or judge.by_bands or held.open > MOST_BENT:
        return None
    turned = turning([judge.runs[k] for way in judge.ways for k in way.unseen], held.overlays, held.found)
    if turned is None or held.open * turned.leaves >= OTHER_FORM:
        return None
    motion = along(judge.whole, judge.whiten, held.found, judge.ways)
    return Bent(turned.leaves, turned.place, TURNS_SAID) if motion.share < OTHER_FORM else None


def contradicted(judge: Judge, held: Held) -> Along | None:
    """What the measured motion has left of a gap that simulation takes for closed; None where that is little.

    A loop makes little of a torque that it holds against: what is near the cause closes its gap as well.
    """
    if not held.found or not held.adequate or judge.by_bands or held.rings:
        return None
    left = along(judge.whole, judge.whiten, held.found, judge.ways)
    if _speaks_against(left, held):
        others = (along(judge.whole, judge.whiten, found, judge.ways) for found in of_other_widths(held.found))
        left = min((left, *others), key=lambda one: one.share)
    if not _speaks_against(left, held):
        return None
    rows = [[item.row for item in held.found] for _ in judge.ways]
    form = bent(judge.whole, judge.whiten, held.found, judge.ways, rows)
    return None if form and form.leaves < MOST_LEFT else left


def _speaks_against(left: Along, held: Held) -> bool:
    """Whether so much is left along the motion that it contradicts."""
    return left.share * held.unseen.beyond >= CONTRADICTS and left.loudest >= SHOWS_IN_BAND
