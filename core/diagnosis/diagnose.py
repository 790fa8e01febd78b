"""The whole diagnosis: suspects that are no physics, the search, what it is worth on unseen runs, the verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..database import Database, with_effects
from ..effects import effect_named
from ..errors import RefusedError
from ..recording import Run
from ..representation import JointKind
from ..simulation.backends import backend_named, backend_names
from .alike import Alike, alike
from .demonstration import shown
from .diagnosis import (
    Diagnosis,
    Finding,
    HowFar,
    LeftOutSamples,
    NextExperiment,
    Overlay,
    Parameter,
    Rejected,
    Rival,
    Score,
    Unexplained,
    Verdict,
    Where,
)
from .experiment import Experiment, design
from .fit import Part, blocks
from .how_far import Fold, how_far, name_of
from .model import level_rows, merged, robot_of
from .noise import Noise, loudest, noise_floor, significance
from .nuisances import Whitening, whitening
from .numerics import hold_said, numerics, shift_of, shift_said, unshifted, without_hold
from .polish import polished
from .problem import Problem, problem
from .refine import Refined, refined
from .resimulate import residuals, resimulated
from .search import ALIKE, THRESHOLD, Contender, Found, Search, gives_alone, place_of, rows_of, search, without_bodies
from .unseen import EARNS, NOTHING, OTHER_FORM, Split, Unseen, fall_short, in_parts, judged, splits
from .where import where
from .words import variable_in_words

Vector = NDArray[np.float64]
Tell = Callable[[str], None]

# how rarely a perfect model may be called wrong
LEVEL = 0.01
# what is left of a gap by numbers that are as good as runs of seconds make them, as part of it
EXACT = 0.01
# part of the loudest channel's mean square that a hold must change to be suspected, and that is left where it was that
HOLD, NUMERICAL = 0.2, 0.1
# mean squares, in units of noise, that are more than noise not well known: of a channel, and of one of its bands
SHOWS, SHOWS_IN_BAND, SHORTEST_BAND = 2.0, 5.0, 6
UNREAL = "needs a body that cannot exist"
STUCK = "would never slip on these runs: a spring says the same"
GONE = "no gain on held-out data"
CRUMB = "no more than what is left where a law has another form"
NO_PHYSICS = (
    "Simulated under its controller the robot leaves more than noise, but along the measured motion nothing is left: "
    "that is what holds, stamps, tolerances and noise in the loop do, and no physics."
)
WILD = "no engine can simulate the robot with it under this controller"
# how often evidence beyond doubt is of something else: in 4 of 63 findings on the blind bank, on its set for tuning
ELSEWHERE = 0.06
# names of a finding that are tried as the truth in simulation
SHOWN = 2
# by how much a finding must make the gap of unseen runs shrink, as part of the gap before
HELPS, HARMS, BEYOND_DOUBT = 0.01, 0.002, 15.0


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
        RefusedError: The backend cannot run the robot.
    """
    engine = backend_named(backend)
    others = backend_names() if backends is None else tuple(backends)
    engines = [name for name in others if backend_named(name).runs] if backends is None else list(others)
    level_rows(database, level)
    with _telling(progress) as tell:
        return _Diagnosing(database, level, engine.name, engines, tell).of(runs, holdout)


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
class _Gap:
    """Measured minus simulated of all runs, and how surely that is more than noise.

    Attributes:
        where: The gap's places.
        chance: Probability that a perfect model would leave as much.
        loudest: Largest mean square of a channel in units of noise.
    """

    where: Where
    chance: float
    loudest: float

    @property
    def is_noise(self) -> bool:
        """Whether a perfect model might leave it: by chance, or because no noise is known that well."""
        return self.chance >= LEVEL or self.loudest <= SHOWS


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """What holds on runs that no fit saw.

    Attributes:
        found: Findings.
        unseen: What they are worth there.
        dropped: Those that do not hold.
        failed: Effects and places of those whose evidence does not hold, or whose body cannot be.
        how_far: How far the gap shrinks there.
        overlays: Its curves.
        after: The gap that is left; None where nothing was found.
    """

    found: tuple[Found, ...]
    unseen: Unseen
    dropped: tuple[Rejected, ...]
    failed: set[tuple[str, str]]
    how_far: HowFar
    overlays: tuple[Overlay, ...]
    after: _Gap | None

    @property
    def by(self) -> float:
        """How far the gap shrinks."""
        return (self.how_far.shrinks_by or 0.0) if self.found else 0.0

    @property
    def explains(self) -> bool:
        """Whether what is left is no more than noise."""
        return self.after is not None and self.after.is_noise

    def dropped_but(self, other: _Held) -> tuple[Rejected, ...]:
        """Those dropped here that another set of findings neither has nor drops."""
        said = {(item.effect, item.place) for item in other.found} | {(r.effect, r.at) for r in other.dropped}
        return tuple(item for item in self.dropped if (item.effect, item.at) not in said)


@dataclass(frozen=True, slots=True, eq=False)
class _Diagnosing:
    """What stays the same through a diagnosis."""

    database: Database
    level: str
    backend: str
    backends: Sequence[str]
    tell: Tell

    def of(self, runs: Sequence[Run], holdout: Sequence[Run]) -> Diagnosis:
        """The answer."""
        given = [*runs, *holdout]
        notes: list[str] = []
        parts = in_parts(runs[0]) if len(given) == 1 else tuple(given)
        held_by = self._numerics(parts[0], notes)
        ready: Sequence[Run] = [self._in_time(run, notes) for run in parts]
        ways = splits(len(ready), len(holdout))
        self.tell("where the gap lies")
        before = self._gap(ready)
        if not before.is_noise and held_by > HOLD * before.loudest:
            ready, before = self._without_hold(ready, before, notes)
        self.tell("what noise and tolerances may do")
        whole = problem(self.database, self.level, ready)
        whiten = whitening(whole)
        fitted_on = ways[0].seen if holdout else tuple(range(len(ready)))
        seen, seen_whiten = whole.only(fitted_on), whiten.only(whole.evidence.places(fitted_on))
        state = Search(seen, seen_whiten)
        state.begin()
        if before.chance < LEVEL:
            state = search(state, self._found_so_far)
        held = self._held(whole, whiten, state, ways, ready)
        if held.failed and not held.explains:
            # what holds on the runs that were fitted alone may stand in the way of what holds everywhere
            other = search(state.without(held.failed), self._found_so_far)
            again = self._held(whole, whiten, other, ways, ready)
            if again.by > held.by + HELPS:
                state, held = other, replace(again, dropped=(*held.dropped_but(again), *again.dropped))
        found, unseen, dropped = held.found, held.unseen, held.dropped
        how_far, overlays, after = held.how_far, held.overlays, held.after
        fit = refined(seen, seen_whiten, found, blocks(seen.evidence)) if found else None
        names = [self._alike(state, found, fit, item) for item in found if fit is not None]
        names, better = self._told_apart(whole, whiten, found, names, ways)
        if better is not None:
            again = self._held(whole, whiten, replace(state, found=list(better)), ways, ready)
            if again.by > held.by:
                held, found, unseen, dropped = again, again.found, again.unseen, again.dropped
                how_far, overlays, after = held.how_far, held.overlays, held.after
                fit = refined(seen, seen_whiten, found, blocks(seen.evidence))
                names = [self._alike(state, found, fit, item) for item in found]
                names, _ = self._told_apart(whole, whiten, found, names, ways)
        if fit is not None:
            found = tuple(replace(item, row=fit.rows[item.key]) for item in found)
            closer = self._closer(whole, whiten, held, ways, ready)
            if closer is not None:
                numbers, how_far, overlays, after = closer
                if not holdout:
                    # every run judged once; the last numbers may see them all
                    numbers = [polished(seen, self.level, ready, fit, self.backend) or fit]
                fit = numbers[0]
                found = tuple(replace(item, row=fit.rows[item.key]) for item in found)
        experiment = self._next(state, found, names)
        seen_too = _shows(seen_whiten(seen.residual({})), blocks(seen.evidence))
        if not found and not before.is_noise and not seen_too:
            notes.append(NO_PHYSICS)
        verdict = _verdict(found, not before.is_noise and seen_too, after is not None and not after.is_noise)
        effects = rows_of(found)
        return Diagnosis(
            robot=self.database.name,
            verdict=verdict,
            where=before.where,
            which=tuple(
                _finding(item, self._kind(item), gain, fit, others)
                for item, gain, others in zip(found, unseen.gains, names, strict=True)
                if fit is not None
            ),
            rejected=(*dropped, *_rejected(state, found, dropped, names)),
            how_far=how_far,
            unexplained=_unexplained(verdict, before, after or before, how_far),
            next_experiment=experiment,
            runs=tuple(run.name for run in runs),
            holdout=tuple(run.name for run in holdout),
            left_out=tuple(
                LeftOutSamples(run.name, item.channel, item.reason, item.message)
                for run in given
                for item in run.left_out
            ),
            effects=effects,
            corrected=with_effects(self.database, merged(self.database.effects, effects)),
            notes=tuple(notes),
            scores=_scores(state, found),
            overlays=tuple(_drawable(overlay) for overlay in overlays),
        )

    def _found_so_far(self, what: str) -> None:
        self.tell(f"found {what}, looking on")

    def _held(
        self, whole: Problem, whiten: Whitening, state: Search, ways: Sequence[Split], ready: Sequence[Run]
    ) -> _Held:
        """What of a search's findings holds on runs that no fit saw, in evidence and in simulation."""
        found, unseen, dropped = self._kept(whole, whiten, state.found, ways)
        while (wild := self._wild(ready, ways, found, unseen)) is not None:
            dropped = (*dropped, Rejected(wild.effect, wild.place, WILD))
            found, unseen, more = self._kept(whole, whiten, [item for item in found if item is not wild], ways)
            dropped = (*dropped, *more)
        failed = {(item.effect, item.at) for item in dropped if item.why in (GONE, UNREAL)}
        how_far, overlays, after = self._how_far(ready, ways, found, unseen)
        while (idle := _idle(found, unseen.gains, how_far)) is not None:
            dropped = (*dropped, Rejected(idle.effect, idle.place, GONE))
            found, unseen, more = self._kept(whole, whiten, [item for item in found if item is not idle], ways)
            dropped = (*dropped, *more)
            how_far, overlays, after = self._how_far(ready, ways, found, unseen)
        return _Held(tuple(found), unseen, dropped, failed, how_far, overlays, after)

    def _closer(
        self, whole: Problem, whiten: Whitening, held: _Held, ways: Sequence[Split], ready: Sequence[Run]
    ) -> tuple[list[Refined], HowFar, tuple[Overlay, ...], _Gap | None] | None:
        """Every split's fit with numbers from simulation, and how far the gap shrinks so, where that is no less."""
        self.tell("numbers from simulation")
        numbers: list[Refined] = []
        for way, old in zip(ways, held.unseen.rows, strict=True):
            part = whole.only(way.seen)
            there = [replace(item, row=row) for item, row in zip(held.found, old, strict=True)]
            fit = refined(part, whiten.only(whole.evidence.places(way.seen)), there, blocks(part.evidence))
            number = polished(part, self.level, [ready[k] for k in way.seen], fit, self.backend)
            if number is None:
                return None
            numbers.append(number)
        rows = tuple(tuple(number.rows[item.key] for item in held.found) for number in numbers)
        try:
            how_far, overlays, after = self._how_far(ready, ways, held.found, replace(held.unseen, rows=rows))
        except RefusedError:
            return None
        return (numbers, how_far, overlays, after) if (how_far.shrinks_by or 0.0) >= held.by - HARMS else None

    def _wild(self, runs: Sequence[Run], ways: Sequence[Split], found: Sequence[Found], unseen: Unseen) -> Found | None:
        """The finding without which the robot can be simulated, where with all of them no engine can."""

        def goes(without: int | None) -> bool:
            return any(self._goes(runs, ways, found, unseen, without, engine) for engine in engines)

        engines = dict.fromkeys((self.backend, *self.backends))
        if not found or goes(None):
            return None
        least_first = sorted(range(len(found)), key=lambda k: unseen.gains[k])
        return found[next((k for k in least_first if goes(k)), least_first[0])]

    def _goes(
        self,
        runs: Sequence[Run],
        ways: Sequence[Split],
        found: Sequence[Found],
        unseen: Unseen,
        without: int | None,
        engine: str,
    ) -> bool:
        """Whether an engine can simulate the unseen runs with the findings, but for one of them."""
        try:
            for way, rows in zip(ways, unseen.rows, strict=True):
                table = rows_of([replace(found[k], row=row) for k, row in enumerate(rows) if k != without])
                for run in (runs[k] for k in way.unseen):
                    nominal = robot_of(self.database, self.level, run)
                    resimulated(robot_of(self.database, self.level, run, table), nominal, run, engine)
        except RefusedError:
            return False
        return True

    def _kind(self, item: Found) -> JointKind:
        """Of the joint that a finding is at; what is at arms and robots has one unit for both."""
        return self.database.joints[max(item.at, 1) - 1].kind

    def _numerics(self, run: Run, notes: list[str]) -> float:
        """What a step and a hold change is a matter of the model, told on one run; the hold's largest mean square."""
        self.tell(f"step and hold of {run.name}")
        robot = robot_of(self.database, self.level, run)
        noise = noise_floor(self.database, self.level, run)
        found = numerics(robot, robot, run, self.backend, noise)
        notes += found.notes
        sigma = noise.sigma
        return max((float(np.max(error / sigma[name])) ** 2 for name, error in found.hold_error.items()), default=0.0)

    def _in_time(self, run: Run, notes: list[str]) -> Run:
        """The run with its stamps put right, if they are off."""
        self.tell(f"stamps of {run.name}")
        robot = robot_of(self.database, self.level, run)
        noise = noise_floor(self.database, self.level, run)
        shift = shift_of(run, resimulated(robot, robot, run, self.backend), noise)
        if shift:
            notes.append(shift_said(run, shift))
        return unshifted(run, shift)

    def _without_hold(self, runs: Sequence[Run], before: _Gap, notes: list[str]) -> tuple[Sequence[Run], _Gap]:
        """The runs as a continuous controller would have made them, where that explains the gap or nearly all of it."""
        quick = [other for run in runs if (other := without_hold(run)) is not None]
        if len(quick) < len(runs):
            return runs, before
        self.tell("a controller without a hold")
        gap = self._gap(quick)
        if not gap.is_noise and gap.loudest > NUMERICAL * before.loudest:
            return runs, before
        notes += [hold_said(run) for run in runs]
        return quick, gap

    def _gap(self, runs: Sequence[Run]) -> _Gap:
        """The gap of the robot as it is known."""
        robots = [robot_of(self.database, self.level, run) for run in runs]
        left = [
            residuals(run, resimulated(robot, robot, run, self.backend))
            for run, robot in zip(runs, robots, strict=True)
        ]
        noises = [noise_floor(self.database, self.level, run) for run in runs]
        return _Gap(where(left, noises, runs, robots[0]), significance(left, noises), loudest(left, noises))

    def _kept(
        self, whole: Problem, whiten: Whitening, found: Sequence[Found], ways: Sequence[Split]
    ) -> tuple[list[Found], Unseen, tuple[Rejected, ...]]:
        """The findings that help on runs that no fit saw; the worst of the others goes first."""
        kept = list(found)
        dropped: list[Rejected] = []
        # what the held-out runs do not excite is judged by the others, each left out in turn
        trusted: set[tuple[str, int]] = set()
        while kept:
            self.tell("what each finding is worth on runs that no fit saw")
            unseen = judged(whole, whiten, kept, ways)
            unreal = {
                key
                for rows in unseen.rows
                for key in without_bodies(whole, [replace(item, row=row) for item, row in zip(kept, rows, strict=True)])
            }
            if unreal:
                dropped += [Rejected(item.effect, item.place, UNREAL) for item in kept if item.key in unreal]
                kept = [item for item in kept if item.key not in unreal]
                continue
            gains = [math.inf if item.key in trusted else gain for item, gain in zip(kept, unseen.gains, strict=True)]
            worst = min(range(len(kept)), key=lambda k: gains[k])
            if gains[worst] >= EARNS:
                # no law of another form is late
                shares = [
                    math.inf
                    if item.effect == "delay" or item.key in trusted or gives_alone(whole, kept, item)
                    else share
                    for item, share in zip(kept, unseen.shares, strict=True)
                ]
                worst = int(np.argmin(shares))
                if shares[worst] >= OTHER_FORM:
                    return kept, unseen, tuple(dropped)
                item = kept.pop(worst)
                dropped.append(Rejected(item.effect, item.place, CRUMB))
                continue
            still = unseen.moves[worst] < NOTHING
            if still and self._in_turn(whole, whiten, kept, ways)[worst] >= EARNS:
                trusted.add(kept[worst].key)
                continue
            item = kept.pop(worst)
            why = "not excited by the held-out runs" if still else GONE
            dropped.append(Rejected(item.effect, item.place, why))
        return [], Unseen((), (), (), tuple(() for _ in ways)), tuple(dropped)

    def _in_turn(
        self, whole: Problem, whiten: Whitening, found: Sequence[Found], ways: Sequence[Split]
    ) -> Sequence[float]:
        """What findings earn on the runs that were fitted, each left out in turn; nothing where it is one alone."""
        seen = ways[0].seen
        if len(ways) > 1 or len(seen) < 2:
            return [0.0] * len(found)
        folds = [
            Split(tuple(seen[k] for k in way.seen), tuple(seen[k] for k in way.unseen)) for way in splits(len(seen), 0)
        ]
        return judged(whole, whiten, found, folds).gains

    def _alike(self, state: Search, found: Sequence[Found], fit: Refined, item: Found) -> tuple[Alike, ...]:
        self.tell(f"what looks like {item.effect} at {item.place}")
        return alike(state, found, fit, item)

    def _told_apart(
        self,
        whole: Problem,
        whiten: Whitening,
        found: Sequence[Found],
        names: Sequence[tuple[Alike, ...]],
        ways: Sequence[Split],
    ) -> tuple[list[tuple[Alike, ...]], tuple[Found, ...] | None]:
        """Names that hold on runs that no fit saw, and the findings by those that hold best, where that are others."""
        kept: list[tuple[Alike, ...]] = []
        best = list(found)
        for k, (item, others) in enumerate(zip(found, names, strict=True)):
            if not others:
                kept.append(others)
                continue
            self.tell(f"which name of {item.effect} at {item.place} holds on runs that no fit saw")
            options = (item, *(one.found for one in others))
            short = fall_short(whole, whiten, [[*found[:k], one, *found[k + 1 :]] for one in options], ways)
            if short[0] > ALIKE:
                best[k] = options[int(np.argmin(short))]
            kept.append(tuple(one for one, less in zip(others, short[1:], strict=True) if less - short[0] < THRESHOLD))
        changed = any(one is not other for one, other in zip(best, found, strict=True))
        return kept, tuple(best) if changed else None

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

    def _how_far(
        self, runs: Sequence[Run], ways: Sequence[Split], found: Sequence[Found], unseen: Unseen
    ) -> tuple[HowFar, tuple[Overlay, ...], _Gap | None]:
        """How far the gap shrinks where no fit saw it, and the gap that is left."""
        folds = [
            Fold(
                tuple(replace(item, row=row) for item, row in zip(found, rows, strict=True)),
                tuple(runs[k] for k in way.unseen),
            )
            for way, rows in zip(ways, unseen.rows, strict=True)
        ]
        answer, overlays = self._simulated(folds, bool(found))
        if not found:
            return answer, overlays, None
        judged_runs = [run for fold in folds for run in fold.runs]
        gaps = [residuals(run, overlay.before) for run, overlay in zip(judged_runs, overlays, strict=True)]
        left = [residuals(run, overlay.after) for run, overlay in zip(judged_runs, overlays, strict=True)]
        noises = [noise_floor(self.database, self.level, run) for run in judged_runs]
        robot = robot_of(self.database, self.level, judged_runs[0])
        fitted = [_as_fitted(noise, gap) for noise, gap in zip(noises, gaps, strict=True)]
        gap = _Gap(where(left, noises, judged_runs, robot), significance(left, fitted), loudest(left, fitted))
        return answer, overlays, gap

    def _simulated(self, folds: Sequence[Fold], found: bool) -> tuple[HowFar, tuple[Overlay, ...]]:
        """How far the gap shrinks, in the engine asked for, or in the first other that takes the corrected robot."""
        refusal: RefusedError | None = None
        for engine in dict.fromkeys((self.backend, *(self.backends if found else ()))):
            try:
                rest = self.backends if found else (engine,)
                return how_far(self.database, self.level, folds, engine, rest, self.tell)
            except RefusedError as error:
                refusal = error
        assert refusal is not None
        raise refusal


def _drawable(overlay: Overlay) -> Overlay:
    """An overlay without orientations, which are no curves over time."""

    def curves(signals: Mapping[str, Vector]) -> dict[str, Vector]:
        return {name: values for name, values in signals.items() if name != "ee_rot"}

    return replace(
        overlay,
        measured=curves(overlay.measured),
        before=curves(overlay.before),
        after=curves(overlay.after),
        noise=curves(overlay.noise),
    )


def _idle(found: Sequence[Found], gains: Sequence[float], how_far: HowFar) -> Found | None:
    """The finding that helps the simulation least on runs that no fit saw, where it, or all together, do not help.

    Where its evidence there is beyond doubt, it is enough that it does no harm: in a sum over all channels the loudest
    drown what closes the gap of a quiet one.
    """
    total, sure = how_far.shrinks_by, how_far.ci95
    if total is None or sure is None or not found:
        # a smaller gain makes less of its sensor's noise, which looks like a better fit
        return next((item for item in found if item.effect == "controller_gain" and _smaller(item)), None)
    helps: list[float] = []
    for item, gain in zip(found, gains, strict=True):
        help_there = total - (how_far.without.get(name_of(item)) or 0.0)
        helps.append(help_there - (HELPS if gain < BEYOND_DOUBT else -HARMS))
    least = int(np.argmin(helps))
    return found[least] if helps[least] < 0.0 or sure[0] <= 0.0 else None


def _smaller(gain: Found) -> bool:
    """Whether a controller's gain is found smaller than it is said to be."""
    return min(gain.row.values["kp"], gain.row.values["kd"]) < 1.0


def _as_fitted(noise: Noise, gap: Mapping[str, Vector]) -> Noise:
    """The noise that a model leaves whose numbers were fitted: they are known to EXACT of the gap that they close."""
    tolerance = dict(noise.tolerance)
    for name, values in gap.items():
        there = np.maximum(np.isfinite(values).sum(axis=0), 1)
        size = np.sqrt(np.nansum(np.square(values), axis=0) / there)
        tolerance[name] = np.hypot(tolerance[name], EXACT * size)
    return replace(noise, tolerance=tolerance)


def _shows(left: Vector, parts: Sequence[Part]) -> bool:
    """Whether the measured motion itself takes what the model does not say.

    A controller that acts on its sensors' noise moves the robot by what no simulation knows, and nobody knows noise
    exactly; along the measured motion neither is a gap.
    """
    whole = {(part.begin, part.end) for part in parts}
    return any(float(np.mean(left[a:b] ** 2)) > SHOWS for a, b in whole) or any(
        float(np.mean(left[part.first : part.last] ** 2)) > SHOWS_IN_BAND
        for part in parts
        if part.last - part.first >= SHORTEST_BAND
    )


def _verdict(found: Sequence[Found], before: bool, after: bool) -> Verdict:
    """The verdict, from whether there is a gap before and after."""
    if found:
        return "partly_explained" if after else "explained"
    return "unexplained" if before else "no_gap"


def _finding(item: Found, kind: JointKind, gain: float, fit: Refined, others: Sequence[Alike]) -> Finding:
    """A finding with its numbers' intervals."""
    units = {column.name: column.unit_for(kind) for column in effect_named(item.effect).columns}
    parameters: dict[str, Parameter] = {}
    for k, (effect, at, name) in enumerate(fit.free):
        if (effect, at) == (item.effect, item.at):
            value, half = item.row.values[name], 1.96 * math.sqrt(max(float(fit.covariance[k, k]), 0.0))
            parameters[name] = Parameter(value, (value - half, value + half), units[name])
    rivals = tuple(Rival(one.found.effect, one.found.place, one.because) for one in others)
    return Finding(item.effect, item.place, probability(item.gain, gain), parameters, rivals)


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
        if (effect, at) in state.banned:
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


def _scores(state: Search, found: Sequence[Found]) -> tuple[Score, ...]:
    """How well each effect at each place does alone."""
    there = {(item.effect, item.at): item for item in found}
    return tuple(
        Score(
            effect,
            place_of(effect, at),
            one.explains,
            probability(there[effect, at].gain, math.inf) if (effect, at) in there else 0.0,
        )
        for (effect, at), one in sorted(_best_forms(state).items())
    )


def _unexplained(verdict: Verdict, before: _Gap, after: _Gap, how_far: HowFar) -> Unexplained:
    """What is left of the gap's energy, where, and what it goes with."""
    if verdict in ("no_gap", "explained"):
        return Unexplained(0.0, {}, "")
    by = how_far.shrinks_by
    share = 1.0 if verdict == "unexplained" or by is None else float(min(1.0, (1.0 - by) ** 2))
    joints = {name: joint.share for name, joint in after.where.joints.items() if joint.share > 0.0}
    goes = after.where.depends_on[:2]
    looks = " and ".join(f"a function of {variable_in_words(one.variable)}" for one in goes if one.strength > 0.1)
    return Unexplained(share, joints, looks or "nothing that one variable explains")
