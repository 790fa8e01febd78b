"""Judging findings by runs that no fit saw, in evidence and in simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..database import Database
from ..effects import EffectRow
from ..errors import MbexportError, RefusedError
from ..recording import Run
from .beyond import DROOP, KNEE, LIMIT
from .bounces import Bounces, bounces
from .compared import mode_of, residuals
from .cutting import cutting
from .diagnosis import HowFar, Overlay, Rejected
from .fit import blocks
from .found import Found, as_hard_as_a_contact, at_points, gives_alone, hung, rows_of, without_bodies
from .gap import Gap, gap_of
from .held import (
    BEYOND_DOUBT,
    CONTACT,
    CRUMB,
    GONE,
    HARMS,
    HELPS,
    LITTLE,
    MOST_LEFT,
    MOSTLY,
    NOT_EXCITED,
    OTHER_LAW,
    TOO_FAST,
    UNREAL,
    UNTOLD,
    WILD,
    Held,
)
from .how_far import Fold, corrected, how_far, name_of
from .hypothesis import GIVING
from .model import robot_of
from .noise import Noise, noise_floor
from .nuisances import STAMPS_OF_TAU, Whitening, whitening
from .other_laws import begun_from, straightened, with_knees
from .polish import KnownSlopes, polished, unsure
from .problem import BODIES, Problem, problem
from .refine import PLAY, Refined, refined, vanished
from .resimulate import free_arms, resimulated, steps_of
from .stamps import FINE, LONGEST_HELD, SHORTEST, held_said, with_held_torque
from .unseen import EARNS, NOTHING, OTHER_FORM, Split, Unseen, in_parts, judged, splits, worth_by
from .words import listed

Vector = NDArray[np.float64]

# what is left of a gap by numbers that are as good as runs of seconds make them, as part of it
EXACT = 0.01
# part by which all findings together must make it shrink where the interval of how far is wide
PLAINLY = 0.2
# log evidence on runs that no fit saw that no chance makes, of what closes most of the gap there
NO_CHANCE = 50.0
# part of a gap's energy along the motion of runs that no fit saw that findings may leave, where nothing else judges
MOTION_HELPS = 0.9
# into how many times as many steps what a spring rings at may cut a run: hard ones, and play, need ten
FINER = 50.0
# what gives way, and swings by itself
SPRINGS = (*GIVING, "link_flexibility")
FREE = (
    "Next to nothing presses the arm of {joints} to a side of its play, and no log says where it was left: these runs "
    "were simulated from where their first moments have it. `mbexport simulate` begins in the middle, and is off until "
    "the motor has taken the arm along."
)
OUTWEIGHED = (
    "With {names} the held-out runs are simulated no better. Along their motion it is beyond doubt, and the fitted "
    "runs, each left out in turn, are simulated plainly better with it. Hold out a run that moves like one that is "
    "fitted to have it confirmed."
)
# how often findings that simulated do harm get numbers from simulation, which takes many runs of it
TRIES = 2


@dataclass(frozen=True, slots=True, eq=False)
class _Turns:
    """Fitted runs, one cut in parts, each judged by fits that did not see it.

    Attributes:
        runs: They.
        ways: How they are set apart.
        worth: What findings are worth there.
    """

    runs: tuple[Run, ...]
    ways: tuple[Split, ...]
    worth: Unseen


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """Judges findings by runs that no fit saw.

    Attributes:
        database: The robot as it is known.
        level: Of the nominal model.
        backend: Engine of the figures.
        backends: Where the corrected robot is simulated too.
        tell: Is told what is being done.
        whole, whiten: The question that all runs put, and its nuisances.
        ways: How runs are set apart.
        runs: All of them.
        slopes: What runs simulated change by with numbers.
    """

    database: Database
    level: str
    backend: str
    backends: Sequence[str]
    tell: Callable[[str], None]
    whole: Problem
    whiten: Whitening
    ways: Sequence[Split]
    runs: Sequence[Run]
    slopes: KnownSlopes = field(default_factory=KnownSlopes)

    @property
    def by_bands(self) -> bool:
        """Whether nothing but the measured motion is simulated: all noise is in accelerations."""
        return all(mode_of(run) == "unknown" for run in self.runs)

    def held(self, findings: Sequence[Found]) -> Held:
        """What of findings holds, in evidence and in simulation."""
        found, unseen, dropped = self._tame(findings)
        failed = {(item.effect, item.at) for item in dropped if item.why in (GONE, TOO_FAST, UNREAL)}
        how_far, overlays, after = self._how_far(found, unseen)
        small = _small(findings, dropped)
        idle = self._idle(found, unseen, how_far)
        if small and idle is not None:
            # what is small along the motion may be most of what simulation speaks against the others by
            begun = Held(tuple(found), unseen, dropped, failed, how_far, overlays, after, (), self.by_bands)
            if (closed := self._closed(begun, small)) is not begun:
                return closed
        numbers: tuple[Refined, ...] = ()
        tries = TRIES
        while idle is not None:
            better, gains = False, None
            if tries and not numbers and (numbers := self.numbers(found, unseen, far=True)):
                # right names may come with numbers that simulated do harm
                tries -= 1
                other = replace(unseen, rows=rows_of_splits(found, numbers))
                with suppress(RefusedError):
                    closer = self._how_far(found, other)
                    better = (closer[0].shrinks_by or 0.0) > (how_far.shrinks_by or 0.0)
                    if better:
                        unseen, (how_far, overlays, after) = other, closer
                        gains = self._by_these(found, unseen, idle)
            if not better:
                dropped = (*dropped, Rejected(idle.effect, idle.place, GONE))
                found, unseen, more = self._tame([item for item in found if item is not idle])
                dropped, numbers = (*dropped, *more), ()
                how_far, overlays, after = self._how_far(found, unseen)
            idle = self._idle(found, unseen, how_far, gains)
        if found and self.by_bands and how_far.shrinks_by is None and unseen.open > MOTION_HELPS:
            # where simulation's noise hides the gap the motion judges
            dropped = (*dropped, *(Rejected(item.effect, item.place, GONE) for item in found))
            found, unseen, _ = self._tame([])
            how_far, overlays, after = self._how_far(found, unseen)
        numbers = numbers if found and unseen.rows == rows_of_splits(found, numbers) else ()
        if not found:
            # nor may what simulation alone speaks against stand in the way of what it does not
            failed |= {(item.effect, item.at) for item in dropped if item.why == GONE}
        held = Held(tuple(found), unseen, dropped, failed, how_far, overlays, after, numbers, self.by_bands)
        return self._closed(held, _small(findings, dropped))

    def _by_these(self, found: Sequence[Found], unseen: Unseen, item: Found) -> tuple[float, ...]:
        """Gains of findings, that of one by the numbers that stand there, where that is less.

        What simulation spoke against by the evidence's numbers has that evidence by no others.
        """
        k = next(k for k, other in enumerate(found) if other is item)
        if unseen.numbers_beyond and unseen.numbers_beyond[k]:
            return unseen.gains
        worth = worth_by(self.whole, self.whiten, found, self.ways, unseen.rows, k)
        return tuple(min(gain, worth) if j == k else gain for j, gain in enumerate(unseen.gains))

    def _tame(self, findings: Sequence[Found]) -> tuple[list[Found], Unseen, tuple[Rejected, ...]]:
        """What helps on runs that no fit saw and can be simulated there, its worth, and what was dropped."""
        found, unseen, dropped = self._kept(findings)
        while (wild := self._wild(found, unseen)) is not None:
            found, unseen, more = self._kept([item for item in found if item is not wild])
            dropped = (*dropped, Rejected(wild.effect, wild.place, WILD), *more)
        return found, self._cut(found, unseen), dropped

    def _cut(self, found: Sequence[Found], unseen: Unseen) -> Unseen:
        """Every split's rows, limits with a knee cutting where its fitted runs say."""
        if not self._knees(found):
            return unseen
        rows = [
            self.cut(found, {item.key: row for item, row in zip(found, old, strict=True)}, way.seen)
            for way, old in zip(self.ways, unseen.rows, strict=True)
        ]
        return replace(unseen, rows=tuple(tuple(there[item.key] for item in found) for there in rows))

    def cut(
        self, found: Sequence[Found], rows: Mapping[tuple[str, int], EffectRow], runs: Sequence[int]
    ) -> dict[tuple[str, int], EffectRow]:
        """Rows of findings, limits with a knee cutting where simulation of some runs, as numbers, says."""
        if not (joints := self._knees(found)):
            return dict(rows)
        return cutting(self.database, self.level, [self.runs[k] for k in runs], rows, joints, self.backend)

    def _knees(self, found: Sequence[Found]) -> list[int]:
        """Numbers of the joints whose limits were found to have a knee."""
        return [item.at for item in found if item.effect == LIMIT and KNEE in item.row.values]

    def _needed(self, found: Sequence[Found]) -> set[tuple[str, int]]:
        """Keys of what gives before clamped outputs, without which nothing could move there."""
        return {item.key for item in found if gives_alone(self.whole, found, item)}

    def _idle(
        self, found: Sequence[Found], unseen: Unseen, how_far: HowFar, gains: Sequence[float] | None = None
    ) -> Found | None:
        """The finding that does not help simulation, of those that simulation judges; gains other than the unseen's."""
        return self._idle_or_outweighed(found, unseen, how_far, gains)[0]

    def _idle_or_outweighed(
        self, found: Sequence[Found], unseen: Unseen, how_far: HowFar, gains: Sequence[float] | None = None
    ) -> tuple[Found | None, list[Found]]:
        """The finding that does not help simulation, and those of which other runs say far more for it."""
        kept, gains = self._kept_anyway(found, unseen, how_far), gains or unseen.gains
        outweighed: list[Found] = []
        while (idle := _least_helpful(found, gains, how_far, kept)) is not None:
            if not self._outweighed(found, gains, how_far, idle):
                return idle, outweighed
            kept.add(idle.key)
            outweighed.append(idle)
        return None, outweighed

    def _kept_anyway(self, found: Sequence[Found], unseen: Unseen, how_far: HowFar) -> set[tuple[str, int]]:
        """Keys of findings that simulation does not judge: others need them, or no engine has their law.

        Nor what gives, where simulation hides the gap in its noise and the motion of runs that no fit saw has little
        left with it: no chance comes to that. Of a spring that stiffens engines know a straight one, which rings
        elsewhere, and of a limit with a knee one that cuts, which is reached elsewhere. Where the motion of runs that
        no fit saw has little left with the law that was found, that is what there is, whatever the catalogue's does;
        and so is what stands beside it, of which that leaves as little to see. Nor does it judge play in which an arm
        bounces, where what it leaves is no more than it makes of next to nothing.
        """
        bends = unseen.beyond < MOST_LEFT and unseen.open * unseen.beyond < LITTLE
        sure = zip(found, unseen.numbers_beyond, unseen.gains, strict=True) if bends else ()
        others = {item.key for item, number, gain in sure if gain >= (BEYOND_DOUBT if number else NO_CHANCE)}
        if how_far.shrinks_by is None and unseen.open < MOSTLY:
            gives = (k for k, item in enumerate(found) if item.effect in SPRINGS)
            others |= {found[k].key for k in gives if unseen.gains[k] >= NO_CHANCE}
        loose = {
            item.key
            for item, gain in zip(found, unseen.gains, strict=True)
            if item.effect == PLAY and gain >= NO_CHANCE and how_far.shrinks_by is not None
        }
        if loose - others and (bounced := self.bounces(found, unseen)) and bounced.says_all:
            others |= loose
        return self._needed(found) | others

    def bounces(self, found: Sequence[Found], unseen: Unseen) -> Bounces | None:
        """What bouncing in play makes of next to nothing on runs that no fit saw; None where nothing has play."""
        judged_by = [
            (self.runs[k], [replace(item, row=row) for item, row in zip(found, rows, strict=True)])
            for way, rows in zip(self.ways, unseen.rows, strict=True)
            for k in way.unseen
        ]
        return bounces(self.database, self.level, self.backend, judged_by)

    def _closed(self, held: Held, small: Sequence[Found]) -> Held:
        """With the small cause that closes the gap in simulation, where one does: a loop may make much of it.

        Or a plain part of it, where it is beyond chance along the motion and no other form of what was found.
        """
        if not held.found or held.adequate or self.by_bands:
            return held
        for item in small:
            found = (*held.found, item)
            unseen = judged(self.whole, self.whiten, found, self.ways)
            if min(unseen.gains) < EARNS:
                continue
            other = self.with_one_more(held, found, unseen)
            # a little goes over any threshold
            plain = unseen.gains[-1] >= NO_CHANCE and unseen.own[-1] >= MOST_LEFT
            more = HELPS if other is not None and other.adequate else PLAINLY if plain else math.inf
            if other is not None and other.by > held.by + more:
                return other
        return held

    def with_one_more(
        self, held: Held, found: tuple[Found, ...], unseen: Unseen, numbers: tuple[Refined, ...] = ()
    ) -> Held | None:
        """What holds, with one finding more; None where no engine can simulate that or one of them does not help."""
        try:
            how_far, overlays, after = self._how_far(found, unseen)
        except RefusedError:
            return None
        if self._idle(found, unseen, how_far) is not None:
            return None
        last = found[-1]
        dropped = tuple(item for item in held.dropped if (item.effect, item.at) != (last.effect, last.place))
        return replace(
            held,
            found=found,
            unseen=unseen,
            dropped=dropped,
            how_far=how_far,
            overlays=overlays,
            after=after,
            numbers=numbers,
        )

    def closer(self, held: Held) -> tuple[list[Refined], Held]:
        """Every split's fit with numbers from simulation and what holds so; none where the gap shrinks less by them.

        What comes to nothing there was the motion's and not the robot's: it goes, and the others are fitted again.
        """
        numbers, rest = held.numbers, held
        if not numbers:
            numbers = self.numbers(held.found, held.unseen)
            if not numbers:
                return [], held
            try:
                how_far, overlays, after = self._how_far(
                    held.found, replace(held.unseen, rows=rows_of_splits(held.found, numbers)), numbers
                )
            except RefusedError:
                return [], held
            if (how_far.shrinks_by or 0.0) < held.by - HARMS:
                return [], held
            rest = replace(held, how_far=how_far, overlays=overlays, after=after)
        by, without = rest.by, rest.how_far.without
        idle = {
            item.key
            for item in held.found
            # a torque that is recorded as its tick begins knows a delay, however short, from none
            if (item.effect == "delay" or by < (without.get(name_of(item)) or 0.0) + HELPS)
            and all(vanished(number, item) for number in numbers)
        }
        if idle:
            rest = self.held([item for item in held.found if item.key not in idle])
            gone = tuple(Rejected(item.effect, item.place, GONE) for item in held.found if item.key in idle)
            rest = replace(rest, dropped=(*held.dropped, *gone, *rest.dropped), no_law=held.no_law, rings=held.rings)
            return self.closer(rest) if rest.found else ([], rest)
        return list(numbers), rest

    def without_untold(self, held: Held, untold: Collection[Found]) -> Held:
        """What holds without findings of which there may as well be nothing."""
        rest = self.held([item for item in held.found if item not in untold])
        gone = tuple(Rejected(item.effect, item.place, UNTOLD) for item in untold)
        dropped = (*held.dropped_but(rest), *rest.dropped, *gone)
        return replace(rest, dropped=dropped, no_law=held.no_law, rings=held.rings)

    def numbers(self, found: Sequence[Found], unseen: Unseen, *, far: bool = False) -> tuple[Refined, ...]:
        """Every split's fit with numbers from simulation; () where there is none."""
        self.tell("numbers from simulation")
        numbers: list[Refined] = []
        for way, old in zip(self.ways, unseen.rows, strict=True):
            part = self.whole.only(way.seen)
            there = [_as_found(item, row) for item, row in zip(found, old, strict=True)]
            whiten, parts = self.whiten.only(self.whole.evidence.places(way.seen)), blocks(part.evidence)
            fit = straightened(part, whiten, there, refined(part, whiten, there, parts), parts)
            fit = replace(fit, rows=self.cut(found, fit.rows, way.seen))
            number = polished(
                part, self.level, [self.runs[k] for k in way.seen], fit, self.backend, far=far, known=self.slopes
            )
            if number is None:
                return ()
            numbers.append(number)
        return tuple(numbers)

    def _kept(self, found: Sequence[Found]) -> tuple[list[Found], Unseen, tuple[Rejected, ...]]:
        """The findings that help on runs that no fit saw; the worst of the others goes first."""
        kept: list[Found] = list(found)
        dropped: list[Rejected] = []
        # what the held-out runs do not excite is judged by the others, each left out in turn: its evidence there
        trusted: dict[tuple[str, int], float] = {}
        while kept:
            if (contact := as_hard_as_a_contact(self.whole, kept)) is not None:
                kept.remove(contact)
                dropped.append(Rejected(contact.effect, contact.place, CONTACT))
                continue
            if (fast := self._too_fast(kept)) is not None:
                kept.remove(fast)
                dropped.append(Rejected(fast.effect, fast.place, TOO_FAST))
                continue
            self.tell("what each finding is worth on runs that no fit saw")
            unseen = judged(self.whole, self.whiten, kept, self.ways)
            if (softer := self._softly(kept, unseen)) is not None:
                kept = softer
                continue
            unreal: set[tuple[str, int]] = {
                key
                for rows in unseen.rows
                for key in without_bodies(
                    self.whole, [replace(item, row=row) for item, row in zip(kept, rows, strict=True)]
                )
            }
            if (bodies := at_points(self.whole, kept, unreal) or hung(self.whole, kept, unreal)) is not None:
                kept = bodies
                continue
            if unreal:
                dropped += [Rejected(item.effect, item.place, UNREAL) for item in kept if item.key in unreal]
                kept = [item for item in kept if item.key not in unreal]
                continue
            # without what gives nothing could move before a clamped output
            needed = trusted.keys() | self._needed(kept)
            if not self.by_bands:
                # along a motion a delay is hardly told from stamps; what it does to a loop, simulation knows
                needed |= {item.key for item in kept if item.effect == "delay"}
            # the first cause of a gap is no other form of the law of a second one
            first = int(np.argmax(unseen.gains))
            theirs = [
                k for k, item in enumerate(kept) if k != first and item.key not in needed and unseen.own[k] < MOST_LEFT
            ]
            if theirs:
                item = kept.pop(min(theirs, key=lambda k: unseen.own[k]))
                dropped.append(Rejected(item.effect, item.place, OTHER_LAW))
                continue
            gains = [math.inf if item.key in needed else gain for item, gain in zip(kept, unseen.gains, strict=True)]
            worst = min(range(len(kept)), key=lambda k: gains[k])
            if gains[worst] >= EARNS:
                # no law of another form is late
                shares = [
                    math.inf if item.effect == "delay" or item.key in needed else share
                    for item, share in zip(kept, unseen.shares, strict=True)
                ]
                # nor is it a second one, however small its part of every channel is
                shares[first] = math.inf
                worst = int(np.argmin(shares))
                if shares[worst] >= OTHER_FORM:
                    held_there = (trusted.get(item.key, gain) for item, gain in zip(kept, unseen.gains, strict=True))
                    return kept, replace(unseen, gains=tuple(held_there)), tuple(dropped)
                if (gain := self._in_turn(kept, worst)) is not None:
                    trusted[kept[worst].key] = gain
                    continue
                item = kept.pop(worst)
                dropped.append(Rejected(item.effect, item.place, CRUMB))
                continue
            still = unseen.moves[worst] < NOTHING
            if still and (gain := self._in_turn(kept, worst)) is not None and gains[worst] >= -OTHER_FORM * gain:
                trusted[kept[worst].key] = gain
                continue
            item = kept.pop(worst)
            why = NOT_EXCITED if still else GONE
            dropped.append(Rejected(item.effect, item.place, why))
        return [], Unseen((), (), (), (), tuple(() for _ in self.ways)), tuple(dropped)

    def _too_fast(self, found: Sequence[Found]) -> Found | None:
        """A spring with so little behind it that engines need far shorter steps than the run does; None: no such."""
        run = self.runs[0]

        def steps(*some: Found) -> float:
            return steps_of(robot_of(self.database, self.level, run, rows_of(some)), run, self.backend)

        # what cannot be at all is told for that
        with suppress(MbexportError):
            return next((item for item in found if item.effect in SPRINGS and steps(item) > FINER * steps()), None)
        return None

    def _softly(self, found: Sequence[Found], unseen: Unseen) -> list[Found] | None:
        """The findings, a torque limit with a knee that leaves little of what is open; None where none is wanted.

        Runs that come near a limit here and there are fitted as well by one that cuts a little lower: what no fit saw
        tells them apart.
        """
        if unseen.open < OTHER_FORM:
            return None
        way = self.ways[0]
        part, whiten = self.whole.only(way.seen), self.whiten.only(self.whole.evidence.places(way.seen))
        parts = blocks(part.evidence)
        for k, item in enumerate(found):
            if item.effect != LIMIT or KNEE in item.row.values:
                continue
            rows = {one.key: row for one, row in zip(found, unseen.rows[0], strict=True)}
            there = [replace(one, row=rows[one.key]) for one in found]
            fit = refined(part, whiten, there, parts)
            row = begun_from(part, whiten, there, fit, parts, item, with_knees(fit, item)).rows[item.key]
            softer = [*found[:k], replace(item, row=row), *found[k + 1 :]]
            other = judged(self.whole, self.whiten, softer, self.ways)
            if other.open * other.beyond < MOST_LEFT * unseen.open:
                return softer
        return None

    def _in_turn(self, found: Sequence[Found], k: int) -> float | None:
        """Log evidence of finding k on the runs that were fitted, each left out in turn; one alone is cut in parts.

        None where it does not hold there either, where much of these is not understood, of which a part proves nothing,
        or where all runs take turns already.
        """
        turns = self._turns(found)
        if turns is None:
            return None
        worth = turns.worth
        earns = worth.gains[k] >= EARNS and worth.shares[k] >= OTHER_FORM and worth.own[k] >= MOST_LEFT
        return worth.gains[k] if earns and worth.open * worth.beyond < OTHER_FORM else None

    def _turns(self, found: Sequence[Found]) -> _Turns | None:
        """What findings are worth on the runs that were fitted, each left out in turn; None where all do so already."""
        if len(self.ways) > 1:
            return None
        seen = self.ways[0].seen
        whole, whiten = self.whole.only(seen), self.whiten.only(self.whole.evidence.places(seen))
        runs = tuple(self.runs[k] for k in seen)
        if len(seen) == 1:
            runs = in_parts(runs[0])
            whole = problem(self.database, self.level, runs)
            whiten = whitening(whole)
        ways = splits(len(runs), 0)
        return _Turns(runs, ways, judged(whole, whiten, found, ways))

    def _outweighed(self, found: Sequence[Found], gains: Sequence[float], answer: HowFar, item: Found) -> bool:
        """Whether other runs say far more for a finding than the simulated held-out ones, by a little, against it.

        A law of another form may be nearest to the real one where held-out runs hardly go. So one that is beyond doubt
        along their motion stays if each fitted run, left out in turn, is simulated plainly better with it.
        """
        k = next(k for k, other in enumerate(found) if other is item)
        harm = (answer.without.get(name_of(item)) or 0.0) - (answer.shrinks_by or 0.0)
        # of a delay evidence knows nothing
        doubted = item.effect == "delay" or gains[k] < BEYOND_DOUBT
        if self.by_bands or doubted or harm > OTHER_FORM or (turns := self._turns(found)) is None:
            return False
        worth = turns.worth
        if worth.gains[k] < NO_CHANCE or worth.open * worth.beyond >= OTHER_FORM or worth.own[k] < MOST_LEFT:
            return False
        folds = [
            Fold(
                tuple(replace(other, row=row) for other, row in zip(found, rows, strict=True)),
                tuple(turns.runs[j] for j in way.unseen),
            )
            for way, rows in zip(turns.ways, worth.rows, strict=True)
        ]
        try:
            there, _ = how_far(self.database, self.level, folds, self.backend)
        except RefusedError:
            return False
        return (there.shrinks_by or 0.0) - (there.without.get(name_of(item)) or 0.0) >= PLAINLY

    def _wild(self, found: Sequence[Found], unseen: Unseen) -> Found | None:
        """The finding without which the robot can be simulated, where with all of them no engine can."""

        def goes(without: int | None) -> bool:
            return any(self._goes(found, unseen, without, engine) for engine in engines)

        engines = dict.fromkeys((self.backend, *self.backends))
        if not found or goes(None):
            return None
        least_first = sorted(range(len(found)), key=lambda k: unseen.gains[k])
        return found[next((k for k in least_first if goes(k)), least_first[0])]

    def _goes(self, found: Sequence[Found], unseen: Unseen, without: int | None, engine: str) -> bool:
        """Whether an engine can simulate the unseen runs with the findings, but for one of them."""
        try:
            for way, rows in zip(self.ways, unseen.rows, strict=True):
                table = rows_of([replace(found[k], row=row) for k, row in enumerate(rows) if k != without])
                for run in (self.runs[k] for k in way.unseen):
                    nominal = robot_of(self.database, self.level, run)
                    resimulated(robot_of(self.database, self.level, run, table), nominal, run, engine)
        except RefusedError:
            return False
        return True

    def _how_far(
        self, found: Sequence[Found], unseen: Unseen, numbers: Sequence[Refined] = ()
    ) -> tuple[HowFar, tuple[Overlay, ...], Gap | None]:
        """How far the gap shrinks where no fit saw it, and the gap that is left; with the splits' fits, if known."""
        folds = [
            Fold(
                tuple(replace(item, row=row) for item, row in zip(found, rows, strict=True)),
                self._in_step(found, rows, way),
                unsure(self.database, self.level, [self.runs[j] for j in way.seen], number, self.slopes)
                if number
                else {},
            )
            for way, rows, number in zip(self.ways, unseen.rows, numbers or [None] * len(self.ways), strict=True)
        ]
        answer, overlays = self._simulated(folds, bool(found))
        if not found:
            return answer, overlays, None
        judged_runs = [run for fold in folds for run in fold.runs]
        told = list(zip(judged_runs, overlays, corrected(self.database, self.level, folds), strict=True))
        gaps = [residuals(run, overlay.before, robot) for run, overlay, robot in told]
        left = [residuals(run, overlay.after, robot) for run, overlay, robot in told]
        noises = [noise_floor(self.database, self.level, run) for run in judged_runs]
        fitted = [_as_fitted(noise, gap) for noise, gap in zip(noises, gaps, strict=True)]
        nominal = robot_of(self.database, self.level, judged_runs[0])
        return answer, overlays, gap_of(left, noises, judged_runs, nominal, fitted)

    def said_of_torques(self, held: Held) -> list[str]:
        """What to say of torques that unknown controllers plainly hold."""
        return [
            held_said(self.runs[k], samples)
            for way, rows in zip(self.ways, held.unseen.rows, strict=True)
            if held.found and (samples := self._holds(held.found, rows, way)) >= 2.0 * SHORTEST
            for k in way.unseen
        ]

    def said_of_turns(self, held: Held) -> list[str]:
        """What to say of findings with which the held-out runs are simulated no better."""
        _, outweighed = self._idle_or_outweighed(held.found, held.unseen, held.how_far)
        names = listed(f"{item.effect} at {item.place}" for item in outweighed)
        return [OUTWEIGHED.format(names=names)] if outweighed else []

    def said_of_play(self, held: Held) -> list[str]:
        """What to say of arms that nothing presses to a side of the play that was found."""
        if not any(item.effect == PLAY for item in held.found):
            return []
        table = rows_of(held.found)
        free = {k for run in self.runs for k in free_arms(robot_of(self.database, self.level, run, table), run)}
        return [FREE.format(joints=listed(f"joint {joint}" for joint in sorted(free)))] if free else []

    def _in_step(self, found: Sequence[Found], rows: Sequence[EffectRow], way: Split) -> tuple[Run, ...]:
        """The runs that a split did not see, their torques held as long as those that it saw say."""
        samples = self._holds(found, rows, way)
        return tuple(with_held_torque(self.runs[k], samples) for k in way.unseen)

    def _holds(self, found: Sequence[Found], rows: Sequence[EffectRow], way: Split) -> float:
        """For how many samples a torque is held, as the runs that a split saw say; 0 where controllers are known.

        It acts half of that later than it is recorded, which the motion that it makes tells.
        """
        if not self.by_bands:
            return 0.0
        part, whiten = self.whole.only(way.seen), self.whiten.only(self.whole.evidence.places(way.seen))
        table = rows_of([replace(item, row=row) for item, row in zip(found, rows, strict=True)])
        late = whiten.amounts(part.misfit(table)).get(STAMPS_OF_TAU, 0.0)
        return FINE * round(min(max(-2.0 * late, 0.0), LONGEST_HELD) / FINE)

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


def _small(findings: Sequence[Found], dropped: Sequence[Rejected]) -> list[Found]:
    """Findings that were dropped for being small, or what another form of a law may leave of one joint.

    A load, a heavier arm or a tilt is felt at more joints than the one whose law may have another form.
    """
    small = {(item.effect, item.at) for item in dropped if item.why == CRUMB}
    widely = (item for item in dropped if item.at == "robot" or item.effect in BODIES)
    small |= {(item.effect, item.at) for item in widely if item.why == OTHER_LAW}
    return [item for item in findings if (item.effect, item.place) in small]


def _least_helpful(
    found: Sequence[Found], gains: Sequence[float], how_far: HowFar, needed: Collection[tuple[str, int]] = ()
) -> Found | None:
    """The finding that helps the simulation least on runs that no fit saw, where it, or all together, do not help.

    Where its evidence there is beyond doubt, it is enough that it does no harm: in a sum over all channels the loudest
    drown what closes the gap of a quiet one. What then helps plainly stays though its interval is wide: where a loop
    gives way, as at a drive's limit, little decides how far. What the others need is none.
    """
    total, sure = how_far.shrinks_by, how_far.ci95
    counts = [k for k, item in enumerate(found) if item.key not in needed]
    if total is None or sure is None or not counts:
        # simulation alone judges a delay; a spring rings with whatever a motion has in its band; and a smaller gain
        # makes less of its sensor's noise, which looks like a better fit
        doubtful = (found[k] for k in counts)
        return next((item for item in doubtful if item.effect in ("delay", *SPRINGS) or _smaller(item)), None)
    helps: list[float] = []
    for item, gain in ((found[k], gains[k]) for k in counts):
        help_there = total - (how_far.without.get(name_of(item)) or 0.0)
        # of a delay evidence knows nothing: what is stamped a tick late says as much
        doubted = gain < BEYOND_DOUBT or item.effect == "delay"
        helps.append(help_there - (HELPS if doubted else -HARMS))
    least = int(np.argmin(helps))
    item, gain = found[counts[least]], gains[counts[least]]
    # where one moment decides (a limit that is reached once) all that is not sure is how often it comes
    harmless = total > OTHER_FORM and sure[0] > -HARMS
    plain = (total > PLAINLY or harmless) and gain >= BEYOND_DOUBT
    return item if helps[least] < 0.0 or (sure[0] <= 0.0 and not plain) else None


def _as_found(item: Found, row: EffectRow) -> Found:
    """A finding with other numbers; a limit that was found to have a knee has it still, and a drooping motor is one."""
    kept = {name: item.row.values[name] for name in (KNEE, DROOP) if name in item.row.values}
    return replace(item, row=EffectRow(row.at, {**row.values, **kept}))


def rows_of_splits(found: Sequence[Found], numbers: Sequence[Refined]) -> tuple[tuple[EffectRow, ...], ...]:
    """Findings' rows in every split."""
    return tuple(tuple(number.rows[item.key] for item in found) for number in numbers)


def _smaller(item: Found) -> bool:
    """Whether it is a controller's gain, and smaller than it is said to be."""
    return item.effect == "controller_gain" and min(item.row.values["kp"], item.row.values["kd"]) < 1.0


def _as_fitted(noise: Noise, gap: Mapping[str, Vector]) -> Noise:
    """The noise that a model leaves whose numbers were fitted: they are known to EXACT of the gap that they close."""
    tolerance = dict(noise.tolerance)
    for name, values in gap.items():
        there = np.maximum(np.isfinite(values).sum(axis=0), 1)
        size = np.sqrt(np.nansum(np.square(values), axis=0) / there)
        tolerance[name] = np.hypot(tolerance[name], EXACT * size)
    return replace(noise, tolerance=tolerance)
