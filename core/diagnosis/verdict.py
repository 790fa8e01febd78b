"""What a search comes to: the verdict, why, and what is left open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..control import Control
from ..recording import Run
from .diagnosis import Unexplained, Verdict
from .fit import blocks
from .forms import DROOPS_SAID, SOFTLY_SAID, STIFFENS_SAID, TWICE_SAID
from .found import Found, rows_of
from .gap import PLAIN, PLAIN_IN_BAND, Gap, shows, shows_in_band, shows_plainly
from .held import HELPS, NOT_EXCITED, Held
from .judge import Judge
from .nuisances import Whitening
from .numerics import Numerical
from .other_form import contradicted, other_form
from .problem import Problem
from .refine import BEARING
from .stamps import TORQUES
from .state import BEYOND_DOUBT
from .unconfirmed import named_as, nearly_alone
from .unseen import OTHER_FORM, Along, Bent
from .words import cause_in_words, percent, place_in_words, quantity, variable_in_words

NO_PHYSICS = (
    "Simulated under its controller the robot leaves more than noise, but along the measured motion nothing is left: "
    "that is what holds, stamps, tolerances and noise in the loop do, and no physics."
)
ALL_STAND = (
    "Every joint stands all the time, and its friction may bear any load: nothing but the standing positions can be "
    "compared. Record a run in which the joints move."
)
UNSEEN = (
    "The gap stands in the held-out runs alone: the others show no more than noise of it where their joints move, and "
    "no fit could see its cause. Hold another run out, or record one more that moves alike."
)
LEFT_UNSEEN = (
    "What is left stands in the held-out runs alone: the others show next to nothing of it where their joints move, "
    "and no fit could see its cause. Hold another run out, or record one more that moves alike."
)
PLAIN_ALONG = (
    "Simulated under its controller the robot leaves no more than its noise makes there, but along the measured motion "
    "what is left is far above noise: that is a gap."
)
UNHELD = (
    "The gap stands in runs that were fitted: {names} would explain it there, but the held-out runs do not excite it, "
    "so that nothing confirms it. Hold out a run that does."
)
UNJUDGED = (
    "The gap stands in runs that were fitted, and the held-out ones show no more than noise of it: nothing that "
    "explains it could be confirmed there. Hold out a run that moves like the one that shows most of it."
)
CONTRADICTED = (
    "With these effects simulation leaves no more than noise of the gap, but along the measured motion {part} of it is "
    "left: the controller holds against what they do not say, and they may stand for another cause."
)
NEAREST_HELPS_NOT = (
    "Once {effect} at {place} {said}, {part} of the gap is left along the measured motion of runs that no fit saw. No "
    "engine has that law, and the {nearest} that the corrected model has in its place makes the simulation no better: "
    "the cause is found, and the corrected model is not."
)
LAGS = (
    "A drive at {joint} whose torque follows its command with a lag of {late} shows nearly the same as a damping gain "
    "below the logged one, and is in no catalogue: ask how fast its current loop is before the gain is blamed."
)
# part of what a damping gain lacks by which the other gain may be off, where a lag is all that it need be
AS_LOGGED = 0.3
# of each law beyond the catalogue's, the one that engines have
NEAREST = {
    STIFFENS_SAID: "straight spring",
    SOFTLY_SAID: "limit that cuts",
    DROOPS_SAID: "constant",
    TWICE_SAID: "plain wave",
}
LOOP_HIDES = "a torque along the measured motion that the controller hides"
RINGS = (
    "What rings near a joint for another reason, a mount under the base or a load that swings or sloshes, shows nearly "
    "the same as a bearing that gives, and is in no catalogue: look there before the bearing is taken apart."
)


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """What runs showed before anything was found.

    Attributes:
        whole: All of them, in the parts that are judged.
        whiten: In units of their noise.
        gap: Theirs, simulated under their controllers.
        numerical: How much of it is no physics.
        quiet: Those that were fitted show none.
        held_out: Some judge and were not fitted.
    """

    whole: Problem
    whiten: Whitening
    gap: Gap
    numerical: Numerical
    quiet: bool
    held_out: bool


@dataclass(frozen=True, slots=True, eq=False)
class Conclusion:
    """What a search comes to.

    Attributes:
        verdict: In a word.
        unexplained: What is left.
        notes: Why, in sentences.
        unseen: What is left stands in the held-out runs alone, or the whole gap does.
        not_understood: Part of the gap's energy that is left; where it is told which form a law has that no engine has,
            what that one leaves along the motion of runs that no fit saw.
    """

    verdict: Verdict
    unexplained: Unexplained
    notes: tuple[str, ...]
    unseen: bool
    not_understood: float


def concluded(asked: Asked, judge: Judge, held: Held, found: Sequence[Found]) -> Conclusion:
    """The verdict, and why.

    Args:
        asked: What the runs showed.
        judge: In units of the noise that the robot makes with what was found.
        held: What holds of that.
        found: All that the search found in the fitted runs.
    """
    gap, notes = _gap_shown(asked, judge, held)
    unjudged = [] if asked.quiet else unheld(found, held)
    form, against = other_form(judge, held), contradicted(judge, held)
    verdict = verdict_of(held, gap or bool(unjudged), form, against)
    left_open = asked.held_out and verdict in ("unexplained", "partly_explained")
    alone = left_open and nearly_alone(judge.whole, judge.whiten, judge.ways[0], rows_of(held.found))
    unseen = not unjudged and (alone or (asked.quiet and verdict == "unexplained"))
    if unseen:
        notes.append(UNSEEN if verdict == "unexplained" else LEFT_UNSEEN)
    elif verdict == "unexplained" and not gap:
        notes.append(UNHELD.format(names=named_as(unjudged)))
    elif verdict == "unexplained" and held.how_far.shrinks_by is None and _shown_by_fitted(asked, judge):
        notes.append(UNJUDGED)
    if against:
        notes.append(CONTRADICTED.format(part=percent(against.share)))
    if form and held.unseen.numbers_beyond[form.place] and form.said in NEAREST and held.by <= HELPS:
        notes.append(_nearest_helps_not(held, form))
    outside = outside_names(held.found, [run.control for run in judge.runs])
    notes += [*judge.said_of_torques(held), *judge.said_of_play(held), *judge.said_of_turns(held), *outside]
    left = unexplained_of(verdict, held.after or asked.gap, held, form, against)
    return Conclusion(verdict, left, tuple(notes), unseen, held.unseen.open * form.leaves if form else left.share)


def _gap_shown(asked: Asked, judge: Judge, held: Held) -> tuple[bool, list[str]]:
    """Whether there is a gap to explain, and what is to be said of where it does not show."""
    along = asked.whiten(asked.whole.residual({})), blocks(asked.whole.evidence)
    compared = len(asked.whole.evidence.weights) > 0
    seen_too = not compared or (shows_in_band if judge.by_bands else shows)(*along)
    notes: list[str] = []
    if not compared:
        notes.append(ALL_STAND)
    elif not (held.found or asked.gap.is_noise or seen_too or judge.by_bands):
        notes.append(NO_PHYSICS)
    # what neither a run that judges nor those that were fitted show clearly is nothing to explain
    shown = held.how_far.shrinks_by is not None or _shown_by_fitted(asked, judge)
    gap = not asked.gap.is_noise and seen_too and shown
    if judge.by_bands and compared:
        # nor is a mean square of all frequencies a judge of what a band shows
        gap = gap or shows_in_band(*along, PLAIN_IN_BAND if all(map(_torques_stated, judge.runs)) else PLAIN)
    drowned = asked.numerical == "none" and not gap and not held.found and shows_plainly(*along)
    if drowned:
        notes.append(PLAIN_ALONG)
    return asked.numerical != "all" and (gap or drowned), notes


def _shown_by_fitted(asked: Asked, judge: Judge) -> bool:
    """Whether runs that were fitted show a gap, whatever the held-out ones show."""
    return asked.held_out and not asked.quiet and not judge.by_bands


def verdict_of(held: Held, gap: bool, form: Bent | None, against: Along | None) -> Verdict:
    """The verdict.

    Args:
        held: What holds.
        gap: Whether there was a gap.
        form: Which other form of a law what is left goes as.
        against: What of the measured motion speaks against what holds.
    """
    if held.found:
        enough = held.adequate or (form is not None and held.open * form.leaves < OTHER_FORM)
        return "explained" if enough and not (against or held.no_law) else "partly_explained"
    return "unexplained" if gap else "no_gap"


def unexplained_of(verdict: Verdict, after: Gap, held: Held, form: Bent | None, against: Along | None) -> Unexplained:
    """What is left of the gap's energy, where, and what it goes with."""
    if held.no_law:
        return Unexplained(held.open, {f"joint_{held.no_law.joint}": 1.0}, held.no_law.said)
    if against:
        return Unexplained(against.share, against.joints, LOOP_HIDES)
    if verdict == "no_gap" or held.open == 0.0:
        return Unexplained(0.0, {}, "")
    joints = {name: joint.share for name, joint in after.where.joints.items() if joint.share > 0.0}
    if form:
        item = held.found[form.place]
        return Unexplained(held.open, joints, f"{cause_in_words(item.effect, item.place)}, which {form.said}")
    goes = after.where.depends_on[:2]
    looks = " and ".join(f"a function of {variable_in_words(one.variable)}" for one in goes if one.strength > 0.1)
    return Unexplained(held.open, joints, looks or "nothing that one variable explains")


def outside_names(found: Sequence[Found], controls: Sequence[Control]) -> list[str]:
    """What else findings may be that is in no catalogue, under the controllers of the runs."""
    control = controls[0]
    # of other gains a lag makes other factors
    alike = control.mode == "pd" and all(one == control for one in controls)
    notes = [RINGS] if any(item.effect == BEARING for item in found) else []
    for item in found:
        if item.effect == "controller_gain" and alike:
            kp, kd = item.row.values["kp"], item.row.values["kd"]
            logged = control.kp[item.at - 1], control.kd[item.at - 1]
            # a torque that is late by T is kp (e - T e') + kd e' to first order
            late = (1.0 - kd) * logged[1] / (kp * logged[0]) if kp * logged[0] > 0.0 else 0.0
            if late > 0.0 and abs(kp - 1.0) < AS_LOGGED * (1.0 - kd):
                notes.append(LAGS.format(joint=place_in_words(item.place), late=quantity(late, "s")))
    return notes


def unheld(found: Sequence[Found], held: Held) -> list[Found]:
    """What the fitted runs show beyond doubt and the held-out ones do not excite, where nothing holds."""
    silent = {(item.effect, item.at) for item in held.dropped if item.why == NOT_EXCITED}
    there = [item for item in found if (item.effect, item.place) in silent and item.gain >= BEYOND_DOUBT]
    return [] if held.found else there


def _nearest_helps_not(held: Held, form: Bent) -> str:
    """That a law which no engine has is the cause, and the one in its place no help."""
    item, part = held.found[form.place], percent(held.unseen.open * form.leaves)
    words = {"said": form.said, "nearest": NEAREST[form.said]}
    return NEAREST_HELPS_NOT.format(effect=item.effect, place=item.place, part=part, **words)


def _torques_stated(run: Run) -> bool:
    """Whether the noise of all that a run has of torques is stated."""
    return all(name in run.noise for name in TORQUES if run.has(name))
