"""The whole diagnosis: suspects that are no physics, the search, what it is worth on unseen runs, the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..database import Database, with_effects
from ..errors import RefusedError, RunFileError
from ..recording import Run, known_together
from ..representation import JointKind
from ..simulation.backends import backend_named, backend_names
from .alike import Alike, alike
from .between_rows import between_rows, hides
from .beyond import SPRINGS
from .bodies import plainer_loads
from .demonstration import shown
from .diagnosis import Diagnosis, LeftOutSamples, NextExperiment
from .doubts import Doubts, doubted, doubts_of, untold
from .experiment import Experiment, design
from .findings import finding, largest_first, probability, rejected
from .fit import blocks
from .found import Found, rows_of
from .gap import LEVEL, shows, shows_in_band
from .growing import without_growing
from .held import HELPS, Held
from .in_simulation import closed_in_simulation, late_in_simulation
from .judge import Judge
from .model import Rows, level_rows, robot_of
from .noise import noise_floor
from .nuisances import SPEED_IS_LATE, whitening
from .numerics import late_beside
from .other_laws import straightened
from .polish import polished
from .problem import Problem, problem
from .refine import Refined, in_one_turn, refined
from .righted import Righted, Righting
from .scores import scores
from .search import one_cause_more, search
from .state import Search, prune
from .suspect import Suspect
from .told_apart import told_apart
from .tolerated import with_tolerances
from .tried import ALIKE, ALIKE_SHARE
from .two_ways import Apart, reaching, ways_apart
from .unconfirmed import UNDERSTOOD, Unconfirmed, leaves_most, nowhere_else, unconfirmed
from .unfitted import with_geometry, with_moments
from .unresolved import resolved
from .unseen import fall_short, in_parts, splits
from .verdict import Asked, concluded
from .warming import with_warming

Vector = NDArray[np.float64]
Tell = Callable[[str], None]

# runs that a perfect model would leave so with such a chance show nothing to look for
HARDLY = 0.05
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
class _Ask:
    """What is asked.

    Attributes:
        runs: To fit.
        holdout: To judge by.
        cut: Names of those that are cut in time once they are put right; a single run always is.
        beside: What is no physics and stands beside effects: it is put right first.
    """

    runs: Sequence[Run]
    holdout: Sequence[Run]
    cut: Collection[str] = ()
    beside: Suspect | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """What an ask comes to.

    Attributes:
        diagnosis: The answer.
        again: Why some runs should be cut and all fitted, or what that did not confirm.
        open: Part of the gap's energy that is not understood, 0 where the verdict is that it is explained.
    """

    diagnosis: Diagnosis
    again: Unconfirmed | None
    open: float


@dataclass(frozen=True, slots=True, eq=False)
class _Diagnosing:
    """What stays the same through a diagnosis."""

    database: Database
    level: str
    backend: str
    backends: Sequence[str]
    tell: Tell

    @property
    def _righting(self) -> Righting:
        return Righting(self.database, self.level, self.backend, self.tell)

    def of(self, runs: Sequence[Run], holdout: Sequence[Run]) -> Diagnosis:
        """The answer; of runs in parts where these alone show the gap, or what the fitted ones show fails."""
        asked = self._of(_Ask(runs, holdout))
        answer, again = asked.diagnosis, asked.again
        if again is None:
            return answer
        parts = self._of(_Ask([*runs, *holdout], (), again.cut))
        apart, still = parts.diagnosis, parts.again
        if not apart.which or parts.open > UNDERSTOOD or parts.open >= asked.open:
            return replace(answer, notes=(*answer.notes, still.why)) if still else answer
        names = tuple(run.name for run in (*runs, *holdout))
        return replace(apart, runs=names, left_out=answer.left_out, notes=(*apart.notes, again.said))

    def _of(self, ask: _Ask) -> _Answer:
        """The answer, with numerics put right or beside effects."""
        given = [resolved(run) for run in known_together([*ask.runs, *ask.holdout])]
        given = [ask.beside.change(run) for run in given] if ask.beside else given
        righted = self._righting.righted(given)
        if righted.instead:
            # what makes more than half of a gap need not be its cause, where an effect makes all of it
            instead = self._answered(ask, given, righted.instead)
            left = (1.0 - (instead.diagnosis.how_far.shrinks_by or 0.0)) ** 2
            if instead.diagnosis.verdict == "explained" and left < CLEARLY_LESS * righted.left:
                return instead
        return self._answered(ask, given, righted)

    def _answered(self, ask: _Ask, given: Sequence[Run], righted: Righted) -> _Answer:
        """The answer to what is asked of runs that are put right.

        Args:
            ask: What is asked.
            given: All runs.
            righted: They, put right.
        """
        before, holdout = righted.gap, ask.holdout
        to_cut = ask.cut or [run.name for run in given if len(given) == 1]
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
        fitted = self._righting.gap([ready[k] for k in fitted_on]) if holdout else before
        parts = blocks(seen.evidence)
        # windows of half a second show less of what rings than the measured motion
        loud = before.chance < LEVEL and (fitted.chance < HARDLY or shows(state.left, parts))
        quiet = fitted.is_noise
        if judge.by_bands:
            loud = shows_in_band(state.left, parts)
            quiet = not loud
        looking = righted.numerical == "none" and loud and len(state.left) > 0
        if looking:
            state, judge = self._one_by_one(state, judge)
            state = search(state, self._found_so_far, leaves_most if ask.cut else None)
            if ask.beside is None and (late := self._late_beside(state, [ready[k] for k in fitted_on])):
                return self._of(replace(ask, beside=late))
            if ask.cut and leaves_most(state):
                state.begin()
                looking = False
        state, judge, held = self._found(state, judge, looking=looking)
        held, fit, names = self._with_numbers(state, judge, held, every=not holdout)
        experiment = self._next(state, held.found, names)
        asked = Asked(whole, whiten, before, righted.numerical, quiet, bool(holdout))
        end = concluded(asked, judge, held, state.found)
        if holdout:
            again = unconfirmed(whole, ready, ways[0], state, end.verdict, end.unexplained, alone=end.unseen)
        else:
            again = nowhere_else(state) if ask.cut and end.verdict == "unexplained" else None
        effects = rows_of(held.found)
        since = {run.name: run.since for run in ready}
        beside = (ask.beside.beside_said(given),) if ask.beside else ()
        answer = Diagnosis(
            robot=self.database.name,
            verdict=end.verdict,
            where=before.where,
            which=tuple(
                finding(held.found[k], self._kind(held.found[k]), held.unseen.gains[k], fit, names[k])
                for k in largest_first(held)
                if fit is not None
            ),
            rejected=(*held.dropped, *rejected(state, held.found, held.dropped, names)),
            how_far=held.how_far.as_heard or held.how_far,
            unexplained=end.unexplained,
            next_experiment=experiment,
            runs=tuple(run.name for run in ask.runs),
            holdout=tuple(run.name for run in holdout),
            left_out=tuple(
                LeftOutSamples(run.name, item.channel, item.reason, item.message)
                for run in given
                for item in run.left_out
            ),
            effects=effects,
            level=self.level,
            corrected=with_effects(self.database, effects, self.level),
            notes=(*beside, *righted.notes, *end.notes),
            scores=scores(begun, {item.key: probability(item.gain, math.inf) for item in held.found}),
            overlays=tuple(overlay.drawable(since[overlay.run]) for overlay in held.overlays),
        )
        return _Answer(answer, again, 0.0 if end.verdict == "explained" else end.not_understood)

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

    def _with_numbers(
        self, state: Search, judge: Judge, held: Held, *, every: bool
    ) -> tuple[Held, Refined | None, list[tuple[Alike, ...]]]:
        """What holds by the names that hold best, its fit in line with simulation, and what else each may be called.

        Args:
            state: With the runs that were fitted.
            judge: Of the findings.
            held: The findings.
            every: Every run was judged once; the last numbers may see them all.
        """
        held, fit, names = self._named(state, judge, held)
        while fit is not None:
            named = dict(zip((item.key for item in held.found), names, strict=True))
            held, fit, doubts, apart = self._in_line(state, judge, held, fit, every=every)
            names = [named[item.key] for item in held.found]
            question, parts = (state.problem, state.whiten), blocks(state.problem.evidence)
            whole = with_moments(*question, fit, parts)
            if not (out := untold(state.problem, held.found, fit, whole, doubts)):
                fit = reaching(with_geometry(*question, whole, parts), apart)
                break
            held = judge.without_untold(held, out)
            fit, names = self._names(state, held.found)
        return held, fit, names

    def _named(self, state: Search, judge: Judge, held: Held) -> tuple[Held, Refined | None, list[tuple[Alike, ...]]]:
        """What holds by the names that hold best, its fit, and what else each finding may be called."""
        fit, names = self._names(state, held.found)
        names, better = told_apart(judge, held.found, names)
        # what looks like the better name may be better still, with numbers that were not asked of it before
        for _ in range(MOST_RENAMED):
            better = better or _plainer(state, judge, held.found, fit)
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
    ) -> tuple[Held, Refined, Doubts, Apart]:
        """Findings with their numbers, from simulation where these are no worse, and how far these may be others.

        By other forms of their laws, and by what the measured motion says where simulation says something else.

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
            # from afar the motion knows little of them
            apart = ways_apart(fit, last) if last and not far else {}
            # how tolerances give way is reckoned stiffly there: not what they make of a spring's ringing
            fit = with_tolerances(state.problem, state.whiten, last or fit, parts, SPRINGS)
        else:
            # numbers from simulation know of them
            apart = {}
            fit = with_tolerances(state.problem, state.whiten, fit, parts)
        fit = in_one_turn(doubted(fit, doubts))
        held = replace(kept, found=tuple(replace(item, row=fit.rows[item.key]) for item in kept.found))
        return held, fit, doubts, apart

    def _found_so_far(self, what: str) -> None:
        self.tell(f"found {what}, looking on")

    def _kind(self, item: Found) -> JointKind:
        """Of the joint that a finding is at; what is at arms and robots has one unit for both."""
        return self.database.joints[max(item.at, 1) - 1].kind

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


def _plainer(state: Search, judge: Judge, found: Sequence[Found], fit: Refined | None) -> tuple[Found, ...] | None:
    """Findings with the plainest load that holds as well on runs that no fit saw; None where none is plainer."""
    if fit is None:
        return None
    for plainer in plainer_loads(state.problem, state.whiten, found, fit, blocks(state.problem.evidence)):
        ours, its = fall_short(judge.whole, judge.whiten, [found, plainer], judge.ways)
        if its.nats - ours.nats < ALIKE:
            return tuple(plainer)
    return None
