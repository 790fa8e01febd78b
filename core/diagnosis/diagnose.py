"""The whole diagnosis: suspects that are no physics, the search, what it is worth on unseen runs, the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..database import Database, with_effects
from ..effects import effect_named
from ..errors import RefusedError, RunFileError
from ..recording import Run, known_together
from ..representation import JointKind
from ..simulation.backends import backend_named, backend_names
from .alike import Alike, alike
from .between_rows import between_rows, hides
from .beyond import SPRINGS
from .contender import THRESHOLD, Contender
from .demonstration import shown
from .diagnosis import (
    Diagnosis,
    Finding,
    LeftOutSamples,
    NextExperiment,
    Overlay,
    Parameter,
    Rejected,
    Rival,
    Unexplained,
    Verdict,
)
from .doubts import Doubts, doubted, doubts_of, untold
from .experiment import Experiment, design
from .fit import blocks
from .forms import DROOPS_SAID, SOFTLY_SAID, STIFFENS_SAID, TWICE_SAID
from .found import Found, rows_of
from .gap import LEVEL, PLAIN, PLAIN_IN_BAND, Gap, gap_of, shows, shows_in_band, shows_plainly
from .growing import without_growing
from .held import HELPS, NOT_EXCITED, UNREAL, Held
from .how_far import name_of
from .in_simulation import closed_in_simulation, late_in_simulation
from .judge import Judge
from .model import Rows, level_rows, robot_of
from .moments import with_moments
from .noise import Noise, noise_floor
from .nuisances import SPEED_IS_LATE, whitening
from .numerics import HALF, NUMERICAL, late_beside, loudest_of, numerics, part_left, suspected
from .other_form import contradicted, other_form
from .other_laws import straightened
from .placed import place_of
from .polish import polished
from .problem import Problem, problem
from .refine import BEARING, Refined, in_one_turn, range_of, refined
from .resimulate import each_simulated, residuals, resimulated
from .scores import scores
from .search import one_cause_more, search
from .stamps import TORQUES, shift_of, shift_said, torque_shift_of, torque_shift_said, unshifted
from .state import BEYOND_DOUBT, Search, prune
from .suspect import Suspect
from .told_apart import told_apart
from .tolerated import with_tolerances
from .tried import ALIKE_SHARE
from .unconfirmed import UNDERSTOOD, Unconfirmed, leaves_most, named_as, nearly_alone, nowhere_else, unconfirmed
from .unresolved import resolved
from .unseen import NOTHING, OTHER_FORM, Along, Bent, in_parts, splits
from .warming import with_warming
from .words import cause_in_words, percent, variable_in_words

Vector = NDArray[np.float64]
Tell = Callable[[str], None]

# how much of a gap is no physics and cannot be put right: "much" where effects may say all of it as well, and "half"
# where none are looked for
Numerical = Literal["none", "much", "half", "all"]
STUCK = "would never slip on these runs: a spring says the same"
NO_PHYSICS = (
    "Simulated under its controller the robot leaves more than noise, but along the measured motion nothing is left: "
    "that is what holds, stamps, tolerances and noise in the loop do, and no physics."
)
ALL_STAND = (
    "Every joint stands all the time, and its friction may bear any load: nothing but the standing positions can be "
    "compared. Record a run in which the joints move."
)
# runs that a perfect model would leave so with such a chance show nothing to look for
HARDLY = 0.05
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
CONTRADICTED = (
    "With these effects simulation leaves no more than noise of the gap, but along the measured motion {part} of it is "
    "left: the controller holds against what they do not say, and they may stand for another cause."
)
NEAREST_HELPS_NOT = (
    "Once {effect} at {place} {said}, {part} of the gap is left along the measured motion of runs that no fit saw. No "
    "engine has that law, and the {nearest} that the corrected model has in its place makes the simulation no better: "
    "the cause is found, and the corrected model is not."
)
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
# how often evidence beyond doubt is of something else: in 4 of 63 findings on the set of the blind bank for tuning
ELSEWHERE = 0.06
# of a number one standard deviation at least, as part of it: what another integrator's step and hold move it by
FINEST = 1.0e-3
# of a run that can be compared
FEWEST_ROWS, SHORTEST_RUN = 50, 0.5
# names of a finding that are tried as the truth in simulation
SHOWN = 2
# how often noise is worked out anew from what was found
HEARD = 2
# and causes are looked for one by one
MOST_HIDDEN = 8
# part of what numerics leave that effects may leave, to be looked for in their place
CLEARLY_LESS = 0.25
# standard errors above none at which the measured motion says that speeds are late
SURELY = 5.0
# how often findings take the names that hold best
MOST_RENAMED = 2


def diagnose(
    database: Database,
    runs: Sequence[Run],
    holdout: Sequence[Run] = (),
    *,
    level: str = "full",
    backend: str = "mjcf",
    backends: Sequence[str] | None = None,
    progress: bool = False,
) -> Diagnosis:
    """Where the gap between a robot and its model lies, which effects cause it, how far it shrinks with them.

    Args:
        database: The robot as it is known.
        runs: Recorded runs of it.
        holdout: Runs that no fit may see; none: each run is left out in turn, a single one in parts.
        level: Of the nominal model.
        backend: Engine of the figures.
        backends: Where the corrected robot is simulated again; None: in every engine that is there.
        progress: Tell on standard error what is being done.

    Raises:
        UsageError: There is no such level or backend.
        RunFileError: A run is too short to compare.
        RefusedError: The backend cannot run the robot.
    """
    engine = backend_named(backend)
    others = backend_names() if backends is None else tuple(backends)
    engines = [name for name in others if backend_named(name).runs] if backends is None else list(others)
    level_rows(database, level)
    for run in (*runs, *holdout):
        _long_enough(run)
    with _telling(progress) as tell:
        return _Diagnosing(database, level, engine.name, engines, tell).of(runs, holdout)


def _long_enough(run: Run) -> None:
    if len(run.t) < FEWEST_ROWS or run.duration < SHORTEST_RUN:
        raise RunFileError(
            f"run {run.name}: {len(run.t)} rows over {run.duration:.3g} s are too few to tell a gap; "
            f"there must be at least {FEWEST_ROWS} rows and {SHORTEST_RUN:g} s."
        )


@contextmanager
def _telling(progress: bool) -> Generator[Tell]:
    """A line on a terminal that says what is being done, nothing elsewhere."""
    if not progress:
        yield lambda what: None
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("reading") as status:
        yield status.update


@dataclass(frozen=True, slots=True, eq=False)
class _Righted:
    """Runs with what is no physics put right.

    Attributes:
        runs: As they are compared.
        gap: Theirs.
        numerical: How much of it is what cannot be put right.
        left: Part of the energy of the gap as it was that goes with no suspect.
    """

    runs: Sequence[Run]
    gap: Gap
    numerical: Numerical
    left: float


@dataclass(frozen=True, slots=True, eq=False)
class _Diagnosing:
    """What stays the same through a diagnosis."""

    database: Database
    level: str
    backend: str
    backends: Sequence[str]
    tell: Tell

    def of(self, runs: Sequence[Run], holdout: Sequence[Run]) -> Diagnosis:
        """The answer; of runs in parts where these alone show the gap, or what the fitted ones show fails."""
        answer, again = self._of(runs, holdout)
        if again is None:
            return answer
        apart, still = self._of([*runs, *holdout], (), cut=again.cut)
        if not apart.which or (apart.verdict != "explained" and apart.unexplained.share > UNDERSTOOD):
            return replace(answer, notes=(*answer.notes, still.why)) if still else answer
        names = tuple(run.name for run in (*runs, *holdout))
        return replace(apart, runs=names, left_out=answer.left_out, notes=(*apart.notes, again.said))

    def _of(
        self,
        runs: Sequence[Run],
        holdout: Sequence[Run],
        *,
        cut: Collection[str] = (),
        beside: Suspect | None = None,
        physics: bool = False,
    ) -> tuple[Diagnosis, Unconfirmed | None]:
        """The answer of runs, and why some should be cut and all fitted, or what that did not confirm.

        Args:
            runs: To fit.
            holdout: To judge by.
            cut: Names of those that are cut in time once they are put right; a single run always is.
            beside: What is no physics and stands beside effects: it is put right first.
            physics: Effects are looked for though more than half of the gap may be numerics.
        """
        given = [resolved(run) for run in known_together([*runs, *holdout])]
        notes: list[str] = [beside.beside_said(given)] if beside else []
        given = [beside.change(run) for run in given] if beside else given
        righted = self._ready(given, notes, physics=physics)
        before, numerical = righted.gap, righted.numerical
        if numerical == "much":
            # what makes more than half of a gap need not be its cause, where an effect makes all of it
            answer, again = self._of(runs, holdout, cut=cut, beside=beside, physics=True)
            left = (1.0 - (answer.how_far.shrinks_by or 0.0)) ** 2
            if answer.verdict == "explained" and left < CLEARLY_LESS * righted.left:
                return answer, again
        to_cut = cut or [run.name for run in given if len(given) == 1]
        ready = [part for run in righted.runs for part in (in_parts(run) if run.name in to_cut else (run,))]
        self.tell("what noise and tolerances may do")
        whole = self._between(problem(self.database, self.level, ready), ready, {})
        whiten = whitening(whole)
        ways = splits(len(ready), len(holdout))
        judge = Judge(self.database, self.level, self.backend, self.backends, self.tell, whole, whiten, ways, ready)
        fitted_on = ways[0].seen if holdout else tuple(range(len(ready)))
        seen, seen_whiten = whole.only(fitted_on), whiten.only(whole.evidence.places(fitted_on))
        state = begun = Search(seen, seen_whiten)
        state.begin()
        fitted = self._gap([ready[k] for k in fitted_on]) if holdout else before
        parts = blocks(seen.evidence)
        # windows of half a second show less of what rings than the measured motion
        loud = before.chance < LEVEL and (fitted.chance < HARDLY or shows(state.left, parts))
        quiet = fitted.is_noise
        if judge.by_bands:
            loud = shows_in_band(state.left, parts)
            quiet = not loud
        looking = numerical == "none" and loud and len(state.left) > 0
        if looking:
            state, judge = self._one_by_one(state, judge)
            state = search(state, self._found_so_far, leaves_most if cut else None)
            if beside is None and (late := self._late_beside(state, [ready[k] for k in fitted_on])):
                return self._of(runs, holdout, cut=cut, beside=late)
            if cut and leaves_most(state):
                state.begin()
                looking = False
        state, judge, held = self._found(state, judge, looking=looking)
        heard, heard_whiten = judge.whole, judge.whiten
        held, fit, names = self._named(state, judge, held)
        while fit is not None:
            named = dict(zip((item.key for item in held.found), names, strict=True))
            held, fit, doubts = self._in_line(state, judge, held, fit, every=not holdout)
            names = [named[item.key] for item in held.found]
            if not (out := untold(state.problem, held.found, fit, doubts)):
                break
            held = judge.without_untold(held, out)
            fit, names = self._names(state, held.found)
        experiment = self._next(state, held.found, names)
        along = whiten(whole.residual({})), blocks(whole.evidence)
        compared = len(whole.evidence.weights) > 0
        seen_too = not compared or (shows_in_band if judge.by_bands else shows)(*along)
        if not compared:
            notes.append(ALL_STAND)
        elif not (held.found or before.is_noise or seen_too or judge.by_bands):
            notes.append(NO_PHYSICS)
        after = held.after
        # what no run that judges shows clearly is nothing to explain
        gap = not before.is_noise and seen_too and held.how_far.shrinks_by is not None
        if judge.by_bands and compared:
            # nor is a mean square of all frequencies a judge of what a band shows
            gap = gap or shows_in_band(*along, PLAIN_IN_BAND if all(map(_torques_stated, ready)) else PLAIN)
        drowned = numerical == "none" and not gap and not held.found and shows_plainly(*along)
        if drowned:
            notes.append(PLAIN_ALONG)
        gap = numerical != "all" and (gap or drowned)
        unheld = [] if quiet else _unheld(state.found, held)
        form, against = other_form(judge, held), contradicted(judge, held)
        verdict = _verdict(held, gap or bool(unheld), form, against)
        left_open = bool(holdout) and verdict in ("unexplained", "partly_explained")
        alone = left_open and nearly_alone(heard, heard_whiten, ways[0], rows_of(held.found))
        if verdict == "unexplained" and not unheld and (quiet or alone):
            notes.append(UNSEEN)
        elif verdict == "unexplained" and not gap:
            notes.append(UNHELD.format(names=named_as(unheld)))
        elif verdict == "partly_explained" and alone:
            notes.append(LEFT_UNSEEN)
        if against:
            notes.append(CONTRADICTED.format(part=percent(against.share)))
        beyond = form is not None and held.unseen.numbers_beyond[form.place] and form.said in NEAREST
        if form and beyond and (held.how_far.shrinks_by or 0.0) <= HELPS:
            item, part = held.found[form.place], percent(held.unseen.open * form.leaves)
            words = {"said": form.said, "nearest": NEAREST[form.said]}
            notes.append(NEAREST_HELPS_NOT.format(effect=item.effect, place=item.place, part=part, **words))
        notes += [*judge.said_of_torques(held), *judge.said_of_play(held), *outside_names(held.found)]
        effects = rows_of(held.found)
        unexplained = _unexplained(verdict, after or before, held, form, against)
        if holdout:
            unseen = bool({UNSEEN, LEFT_UNSEEN} & set(notes))
            again = unconfirmed(whole, ready, ways[0], state, verdict, unexplained, alone=unseen)
        else:
            again = nowhere_else(state) if cut and verdict == "unexplained" else None
        since = {run.name: run.since for run in ready}
        answer = Diagnosis(
            robot=self.database.name,
            verdict=verdict,
            where=before.where,
            which=tuple(
                _finding(held.found[k], self._kind(held.found[k]), held.unseen.gains[k], fit, names[k])
                for k in _largest_first(held)
                if fit is not None
            ),
            rejected=(*held.dropped, *_rejected(state, held.found, held.dropped, names)),
            how_far=held.how_far.as_heard or held.how_far,
            unexplained=unexplained,
            next_experiment=experiment,
            runs=tuple(run.name for run in runs),
            holdout=tuple(run.name for run in holdout),
            left_out=tuple(
                LeftOutSamples(run.name, item.channel, item.reason, item.message)
                for run in given
                for item in run.left_out
            ),
            effects=effects,
            level=self.level,
            corrected=with_effects(self.database, effects, self.level),
            notes=tuple(notes),
            scores=scores(begun, {item.key: probability(item.gain, math.inf) for item in held.found}),
            overlays=tuple(_drawable(overlay, since[overlay.run]) for overlay in held.overlays),
        )
        return answer, again

    def _ready(self, runs: Sequence[Run], notes: list[str], *, physics: bool) -> _Righted:
        """The runs with what is no physics put right, their gap, and how much of it is what cannot be put right."""
        notes += self._numerics(runs[loudest_of(*self._left(runs))])
        stamps: list[str] = []
        ready = [self._in_time(run, stamps) for run in runs]
        self.tell("where the gap lies")
        before = self._gap(ready)
        suspect, part = (None, 1.0) if before.is_noise else self._suspected(runs, ready)
        if suspect is None:
            notes += stamps
            return _Righted(ready, before, "none", part)
        if part > NUMERICAL and not suspect.exact:
            if physics:
                notes += [*stamps, suspect.outdone_said(runs, part)]
                return _Righted(ready, before, "none", part)
            notes += [*stamps, suspect.half_said(runs)]
            # what is most joints' own is theirs, whatever makes another joint's
            return _Righted(ready, before, "much" if part < HALF else "half", part)
        notes.append(suspect.said(runs))
        changed = [suspect.change(run) for run in runs]
        after = self._gap(changed)
        kind = "none" if suspect.exact else "all" if after.is_noise or part < OTHER_FORM else "half"
        return _Righted(changed, after, kind, part)

    def _found(self, state: Search, judge: Judge, *, looking: bool) -> tuple[Search, Judge, Held]:
        """The search gone on to its end, what judged it, and what of its findings holds."""
        if looking:
            state, judge = self._heard(state, judge)
        held, begun = judge.held(state.found), state
        # what holds on the runs that were fitted alone may stand in the way of what holds everywhere; and what bends
        # another finding's law, of what goes with that one as well
        for out, closes in ((held.failed, False), (held.bends, True)):
            if not out or held.explains or (closes and held.adequate):
                continue
            other = search(state.without(out), self._found_so_far)
            again = judge.held(other.found)
            # where noise of accelerations hides how far, what is open is known along the motion
            closer = judge.by_bands and again.open < held.open - HELPS
            better = closer or again.by > held.by + HELPS
            if better and (again.adequate or not closes):
                state, held = other, replace(again, dropped=(*held.dropped_but(again), *again.dropped))
                break
        if looking:
            held = with_warming(judge, without_growing(judge, closed_in_simulation(judge, held, begun)))
        return state, judge, held

    def _one_by_one(self, state: Search, judge: Judge) -> tuple[Search, Judge]:
        """The search gone on by one cause after the other, where what happens between rows hides them.

        What the robot as it is known does there is not what it does with the largest cause: of a command that jumps, a
        load leaves more of that than most causes are.
        """
        if hides(state.problem.evidence) and (late := late_in_simulation(judge, state)):
            state.found = [late]
            state, judge = self._settled(state, judge)
        for _ in range(MOST_HIDDEN):
            if not hides(state.problem.evidence) or not one_cause_more(state, self._found_so_far):
                break
            state, judge = self._settled(state, judge)
        return state, judge

    def _settled(self, state: Search, judge: Judge) -> tuple[Search, Judge]:
        """What was found and what happens between rows with it, each as the other has it."""
        for _ in range(HEARD):
            whole = self._between(judge.whole, judge.runs, rows_of(state.found))
            if whole is judge.whole:
                break
            state, judge = self._asked_anew(state, judge, whole)
        return state, judge

    def _heard(self, state: Search, judge: Judge) -> tuple[Search, Judge]:
        """The search gone on, and its judge, in units of the noise that the robot with what was found makes."""
        for _ in range(HEARD):
            rows, whole = rows_of(state.found), judge.whole
            # what jumps from one side to the other makes no noise that any weight could be for
            if any(item.effect in SPRINGS for item in state.found):
                whole = whole.heard(rows)
            if whole.evidence.between:
                whole = self._between(whole, judge.runs, rows)
            if whole is judge.whole:
                break
            self.tell("what noise the robot makes with what was found")
            state, judge = self._asked_anew(state, judge, whole)
            state = search(state, self._found_so_far)
        return state, judge

    @staticmethod
    def _asked_anew(state: Search, judge: Judge, whole: Problem) -> tuple[Search, Judge]:
        """What was found fitted anew to the same question as it is heard now, and its judge."""
        count = len(judge.runs)
        some = tuple(range(count)) if len(state.problem.evidence.runs) == count else judge.ways[0].seen
        whiten = judge.whiten.told_by(judge.whole.evidence, whole.evidence)
        part = whole.only(some)
        parts = blocks(part.evidence)
        again = state.heard(part, whiten.only(whole.evidence.places(some)))
        prune(again, state.found, refined(again.problem, again.whiten, state.found, parts), parts)
        return again, replace(judge, whole=whole, whiten=whiten)

    def _between(self, whole: Problem, runs: Sequence[Run], rows: Rows) -> Problem:
        """The question of runs less what happens between their rows, of a robot with what was found."""
        evidence = between_rows(self.database, self.level, runs, whole.evidence, rows, self.backend)
        return whole if evidence is whole.evidence else replace(whole, evidence=evidence)

    def _named(self, state: Search, judge: Judge, held: Held) -> tuple[Held, Refined | None, list[tuple[Alike, ...]]]:
        """What holds by the names that hold best, its fit, and what else each finding may be called."""
        fit, names = self._names(state, held.found)
        names, better = told_apart(judge, held.found, names)
        # what looks like the better name may be better still, with numbers that were not asked of it before
        for _ in range(MOST_RENAMED):
            if better is None or (again := judge.held(better)).open >= held.open + ALIKE_SHARE:
                break
            held = replace(again, no_law=held.no_law, rings=held.rings)
            fit, names = self._names(state, held.found)
            names, better = told_apart(judge, held.found, names)
        return held, fit, names

    def _names(self, state: Search, found: Sequence[Found]) -> tuple[Refined | None, list[tuple[Alike, ...]]]:
        """The findings' joint fit, None where there are none, and what looks like each."""
        if not found:
            return None, []
        fit = refined(state.problem, state.whiten, found, blocks(state.problem.evidence))
        names: list[tuple[Alike, ...]] = []
        for item in found:
            self.tell(f"what looks like {item.effect} at {item.place}")
            names.append(alike(state, found, fit, item))
        return fit, names

    def _in_line(
        self, state: Search, judge: Judge, held: Held, fit: Refined, *, every: bool
    ) -> tuple[Held, Refined, Doubts]:
        """Findings with their numbers, from simulation where these are no worse, and how far other forms move these.

        Args:
            state: With the runs that were fitted.
            judge: Of the findings.
            held: The findings.
            fit: Their joint fit.
            every: Every run was judged once; the last numbers may see them all.
        """
        numbers, kept = judge.closer(held)
        parts = blocks(state.problem.evidence)
        if kept.found and len(kept.found) < len(held.found):
            fit = refined(state.problem, state.whiten, kept.found, parts)
        question, seen = (state.problem, state.whiten, kept.found), judge.ways[0].seen
        nearest = straightened(*question, fit, parts)
        nearest = replace(nearest, rows=judge.cut(kept.found, nearest.rows, range(len(judge.runs)) if every else seen))
        doubts, fit = doubts_of(*question, fit, nearest, parts), nearest
        if numbers:
            far = bool(kept.numbers)
            whole = (state.problem, self.level, judge.runs, fit, self.backend)
            last = polished(*whole, far=far, known=judge.slopes) if every else numbers[0]
            # how tolerances give way is reckoned stiffly there: not what they make of a spring's ringing
            fit = with_tolerances(state.problem, state.whiten, last or fit, parts, SPRINGS)
        else:
            # numbers from simulation know of them
            fit = with_tolerances(state.problem, state.whiten, fit, parts)
        fit = in_one_turn(with_moments(state.problem, state.whiten, doubted(fit, doubts), parts))
        return replace(kept, found=tuple(replace(item, row=fit.rows[item.key]) for item in kept.found)), fit, doubts

    def _found_so_far(self, what: str) -> None:
        self.tell(f"found {what}, looking on")

    def _kind(self, item: Found) -> JointKind:
        """Of the joint that a finding is at; what is at arms and robots has one unit for both."""
        return self.database.joints[max(item.at, 1) - 1].kind

    def _numerics(self, run: Run) -> tuple[str, ...]:
        """What a step and a hold change is a matter of the model, told on one run."""
        self.tell(f"step and hold of {run.name}")
        robot = robot_of(self.database, self.level, run)
        noise = noise_floor(self.database, self.level, run)
        return numerics(robot, robot, run, self.backend, noise).notes

    def _in_time(self, run: Run, notes: list[str]) -> Run:
        """The run with its stamps put right, if they are off."""
        self.tell(f"stamps of {run.name}")
        robot = robot_of(self.database, self.level, run)
        noise = noise_floor(self.database, self.level, run)
        simulated = resimulated(robot, robot, run, self.backend)
        if shift := shift_of(run, robot, simulated, noise):
            notes.append(shift_said(run, shift))
            return unshifted(run, shift)
        if shift := torque_shift_of(run, robot, simulated, noise):
            notes.append(torque_shift_said(run, shift))
        return unshifted(run, shift, ("tau",))

    def _suspected(self, runs: Sequence[Run], ready: Sequence[Run]) -> tuple[Suspect | None, float]:
        """What no log says of a controller or of stamps that leaves less than stamps put right, and which part."""
        self.tell("what the log does not say of its controller")
        robots = [robot_of(self.database, self.level, run) for run in runs]
        left, noises = self._left(runs)
        return suspected(robots, runs, self.backend, noises, part_left(left, self._left(ready)[0], noises))

    def _late_beside(self, state: Search, runs: Sequence[Run]) -> Suspect | None:
        """Speeds of a controller that are late beside what was found, so that they would go for some of it.

        The largest findings are asked first: what was found last may go for them already.
        """
        found = sorted(state.found, key=lambda item: -item.gain)
        sure = SURELY * state.whiten.unsure().get(SPEED_IS_LATE, 1.0)
        nominals = [robot_of(self.database, self.level, run) for run in runs]
        noises = [noise_floor(self.database, self.level, run) for run in runs]
        for count in range(1, len(found) + 1):
            rows = rows_of(found[:count])
            late = state.whiten.amounts(state.problem.misfit(rows)).get(SPEED_IS_LATE, 0.0)
            if late > sure:
                robots = [robot_of(self.database, self.level, run, rows) for run in runs]
                if suspect := late_beside(robots, nominals, runs, self.backend, noises, late):
                    return suspect
        return None

    def _gap(self, runs: Sequence[Run]) -> Gap:
        """The gap of the robot as it is known."""
        return gap_of(*self._left(runs), runs, robot_of(self.database, self.level, runs[0]))

    def _left(self, runs: Sequence[Run]) -> tuple[Sequence[Mapping[str, Vector]], Sequence[Noise]]:
        """What the robot as it is known leaves of each run, and what a perfect model would."""

        def apart(run: Run) -> Mapping[str, Vector]:
            robot = robot_of(self.database, self.level, run)
            return residuals(run, resimulated(robot, robot, run, self.backend), robot)

        left = each_simulated(apart, runs, self.backend)
        return left, [noise_floor(self.database, self.level, run) for run in runs]

    def _next(self, state: Search, found: Sequence[Found], names: Sequence[Sequence[Alike]]) -> NextExperiment | None:
        """A motion that splits the names of the first finding that has several and can be split."""
        for item, others in zip(found, names, strict=True):
            if others:
                self.tell(f"the experiment that would tell {item.effect} at {item.place} from what looks like it")
                rest = [other for other in found if other is not item]
                left = float(np.sqrt(np.mean(state.left**2)))
                alternatives = (item, *(one.found for one in others))
                planned = design(state.problem, alternatives, rest, misfit=left)
                proposal = planned.next()
                if proposal is not None:
                    self.tell("that experiment in simulation")
                    return replace(proposal, why=f"{proposal.why} {self._shown(planned, state, alternatives, rest)}")
        return None

    def _shown(self, planned: Experiment, state: Search, names: Sequence[Found], rest: Sequence[Found]) -> str:
        """What becomes of the experiment in an engine, each of the first names in turn the truth."""
        try:
            outcome = shown(planned, state.problem, names[:SHOWN], rest, backend=self.backend)
        except RefusedError as error:
            return f"It could not be tried in simulation: {error}"
        return " ".join(one.words for one in outcome)


def _drawable(overlay: Overlay, since: float) -> Overlay:
    """An overlay from a time on, without what leads up to it, and without orientations, which are no curves."""
    rows = overlay.t >= since

    def curves(signals: Mapping[str, Vector]) -> dict[str, Vector]:
        return {name: values[rows] for name, values in signals.items() if name != "ee_rot"}

    return replace(
        overlay,
        t=overlay.t[rows],
        measured=curves(overlay.measured),
        before=curves(overlay.before),
        after=curves(overlay.after),
        noise={name: sigma for name, sigma in overlay.noise.items() if name != "ee_rot"},
    )


def outside_names(found: Sequence[Found]) -> list[str]:
    """What else findings may be that is in no catalogue."""
    return [RINGS] if any(item.effect == BEARING for item in found) else []


def _torques_stated(run: Run) -> bool:
    """Whether the noise of all that a run has of torques is stated."""
    return all(name in run.noise for name in TORQUES if run.has(name))


def _unheld(found: Sequence[Found], held: Held) -> list[Found]:
    """What the fitted runs show beyond doubt and the held-out ones do not excite, where nothing holds."""
    silent = {(item.effect, item.at) for item in held.dropped if item.why == NOT_EXCITED}
    there = [item for item in found if (item.effect, item.place) in silent and item.gain >= BEYOND_DOUBT]
    return [] if held.found else there


def _verdict(held: Held, gap: bool, form: Bent | None, against: Along | None) -> Verdict:
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


def _largest_first(held: Held) -> list[int]:
    """Places of the findings, that first without which the gap shrinks least where no fit saw it."""
    without = [held.how_far.without.get(name_of(item)) for item in held.found]
    return sorted(range(len(without)), key=lambda k: -math.inf if (by := without[k]) is None else by)


def _finding(item: Found, kind: JointKind, gain: float, fit: Refined, others: Sequence[Alike]) -> Finding:
    """A finding with its numbers' intervals; numbers that no run shows have none, and are not told."""
    units = {column.name: column.unit_for(kind) for column in effect_named(item.effect).columns}
    parameters: dict[str, Parameter] = {}
    for k in fit.numbers_of(item.key):
        if fit.shown[k]:
            name = fit.free[k][2]
            value = item.row.values[name]
            half = 1.96 * math.hypot(math.sqrt(max(float(fit.covariance[k, k]), 0.0)), FINEST * value)
            least, most = range_of(item.effect, name)
            parameters[name] = Parameter(value, (max(value - half, least), min(value + half, most)), units[name])
    rivals = tuple(Rival(one.found.effect, one.found.place, one.because) for one in others)
    # along unseen motions a delay is hardly told from stamps: simulation judged it there
    unseen = math.inf if item.effect == "delay" else gain
    row = {name: value for name, value in item.row.values.items() if math.isfinite(value)}
    return Finding(item.effect, item.place, probability(item.gain, unseen), parameters, rivals, row)


def probability(seen: float, unseen: float) -> float:
    """That a finding is there, from the log evidence that it has where it was fitted and where it was not.

    However strong the evidence, it is evidence among the causes that were thought of.
    """
    nats = min(seen - 0.5 * THRESHOLD, unseen)
    return float((1.0 - ELSEWHERE) / (1.0 + math.exp(-min(nats, 30.0) / 2.0)))


def _rejected(
    state: Search, found: Sequence[Found], dropped: Sequence[Rejected], names: Sequence[Sequence[Alike]]
) -> list[Rejected]:
    """Everything else that was looked at, by name and place."""
    said = {(item.effect, item.place) for item in found} | {(item.effect, item.at) for item in dropped}
    said |= {(one.found.effect, one.found.place) for others in names for one in others}
    out: list[Rejected] = []
    for (effect, at), contender in sorted(_best_forms(state).items()):
        place = place_of(effect, at)
        if (effect, place) in said:
            continue
        if (effect, at) in state.unreal:
            out.append(Rejected(effect, place, STUCK if effect == "hysteresis" else UNREAL))
        else:
            silent = contender.shows < NOTHING
            out.append(
                Rejected(effect, place, "not excited by these runs" if silent else "no gain beside what was found")
            )
    return out


def _best_forms(state: Search) -> dict[tuple[str, int], Contender]:
    """Of every effect at every place the form that did best alone."""
    best: dict[tuple[str, int], Contender] = {}
    for contender in state.first:
        best.setdefault(contender.hypothesis.key, contender)
    return best


def _unexplained(verdict: Verdict, after: Gap, held: Held, form: Bent | None, against: Along | None) -> Unexplained:
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
