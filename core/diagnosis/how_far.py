"""How far the gap shrinks on runs that no fit has seen, re-simulated with the effects that were found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..database import Database
from ..errors import MbexportError, RefusedError
from ..recording import Run
from ..recording.run import MEASURED
from ..representation import Robot
from .blocks import DRAWS, Blocks, Sums
from .compared import compared, mode_of, residuals
from .diagnosis import EffectShare, HowFar, Overlay
from .evidence import SEED
from .found import Found, rows_of
from .gap import LEVEL
from .model import robot_of
from .noise import Noise, noise_floor
from .resimulate import each_simulated, resimulated
from .starting_side import rattles

Vector = NDArray[np.float64]
Simulated = Mapping[str, Vector]

# a gap is one where it stands two of its standard errors above none: its square stands one of its own above
CLEAR = 1.0
# by which factor what is left may differ from noise's known power and be all of it, however little is known of that
MOST = 3.0
# part of what is left that is noise at least, where all of it may be
LEAST = 0.1
COMMANDS = ("q_cmd", "dq_cmd", "ddq_cmd", "tau_cmd")


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Runs that no fit of these rows has seen.

    Attributes:
        found: In the order in which they were added, the same effects and places in every fold.
        runs: Held out.
        unsure: Signal -> mean square that the uncertainty of their numbers makes in each of its channels, shape (n,).
    """

    found: tuple[Found, ...]
    runs: tuple[Run, ...]
    unsure: Mapping[str, Vector] = field(default_factory=dict[str, Vector])


def name_of(found: Found) -> str:
    """What a person calls a finding: "effect place"."""
    return f"{found.effect} {found.place}"


def corrected(database: Database, level: str, folds: Sequence[Fold]) -> list[Robot]:
    """The robot of every run of these folds, with all that was found without it."""
    return [robot_of(database, level, run, rows_of(fold.found)) for fold in folds for run in fold.runs]


def how_far(
    database: Database,
    level: str,
    folds: Sequence[Fold],
    backend: str,
    backends: Sequence[str] = (),
    tell: Callable[[str], None] | None = None,
) -> tuple[HowFar, tuple[Overlay, ...]]:
    """How far the gap shrinks, effect by effect and together, in one engine and in others.

    Args:
        database: The robot without what was found.
        level: Which of its own effects count.
        folds: Runs with rows that were fitted without them.
        backend: Engine of the figures.
        backends: Engines in which the total is simulated too.
        tell: Is told what is being simulated.

    Raises:
        RefusedError: The engine of the figures refuses the robot.
    """
    say = tell or _say_nothing
    runs = [run for fold in folds for run in fold.runs]
    noises = [noise_floor(database, level, run) for run in runs]
    robots = corrected(database, level, folds)
    names = [name_of(found) for found in folds[0].found] if folds else []

    def simulated(chosen: Sequence[int], engine: str) -> list[Simulated]:
        say(f"{engine}: " + (", ".join(names[k] for k in chosen) or "nothing added"))

        def there(fold: Fold, run: Run) -> Simulated:
            rows = rows_of([fold.found[k] for k in chosen])
            return resimulated(robot_of(database, level, run, rows), robot_of(database, level, run), run, engine)

        pairs = [(fold, run) for fold in folds for run in fold.runs]
        return each_simulated(lambda pair: there(*pair), pairs, engine)

    def some(chosen: Sequence[int]) -> list[Simulated] | None:
        """As simulated, None where some of the findings make a robot that no controller holds."""
        try:
            return simulated(chosen, backend)
        except RefusedError:
            return None

    whole = list(range(len(names)))
    steps = [simulated([], backend)]
    partly = [some(whole[:k]) for k in whole[1:]]
    for step in partly:
        # what a robot that cannot be simulated would have taken is the next one's share
        steps.append(step or steps[-1])
    steps += [simulated(whole, backend)] if names else []
    alone = {
        names[k]: some([j for j in whole if j != k]) if k < len(names) - 1 else partly[-1] if partly else steps[0]
        for k in whole
    }
    engines: dict[str, tuple[list[Simulated], list[Simulated]]] = {}
    refused: dict[str, str] = {}
    if any(run.locked for run in runs):
        # held against inverse dynamics along their motion
        refused = dict.fromkeys(backends or (backend,), "no engine holds the joints that are clamped in these runs")
    elif any(mode_of(run) == "unknown" and rattles(robot) for run, robot in zip(runs, robots, strict=True)):
        why = "engines that move motors as they were seen to go let arms hit them like walls"
        refused = dict.fromkeys(backends or (backend,), why)
    elif backend in backends or not backends:
        engines[backend] = steps[0], steps[-1]
    for engine in (engine for engine in backends if engine != backend and engine not in refused):
        try:
            engines[engine] = simulated([], engine), simulated(whole, engine)
        except MbexportError as error:
            refused[engine] = str(error)

    def told(by: Sequence[Noise], *, heard: bool = False) -> HowFar:
        """The figures by these noises, as they are known or as they were heard."""
        shrunk = [_Shrunk(runs, robots, noises, by, steps[0], step) for step in steps]
        total = shrunk[-1]
        gaps = [float(one.after.gap()) for one in shrunk]
        without = {
            name: None if one is None else _Shrunk(runs, robots, noises, by, steps[0], one).by()
            for name, one in alone.items()
        }
        shares = (
            EffectShare(found.effect, found.place, (gaps[k] - gaps[k + 1]) / gaps[0])
            for k, found in enumerate(folds[0].found)
        )
        return HowFar(
            before={name: total.before.rms(name) for name in total.before.signals},
            after={name: total.after.rms(name) for name in total.after.signals},
            noise={name: total.before.noise(name) for name in total.before.signals},
            shrinks_by=total.by(),
            ci95=total.interval(heard=heard),
            signals={name: total.by(name) for name in total.before.signals},
            by_effect=tuple(shares) if total.by() is not None else (),
            backends={name: _Shrunk(runs, robots, noises, by, *both).by() for name, both in engines.items()},
            refused=refused,
            without=without,
            floor={name: total.known.noise(name) for name in total.known.signals},
        )

    answer = told(noises)
    if names:
        unsure = [fold.unsure for fold in folds for _ in fold.runs]
        heard = map(_heard, runs, robots, noises, steps[-1], unsure)
        answer = replace(answer, as_heard=told(list(heard), heard=True))
    overlays = tuple(
        Overlay(
            run.name,
            run.t,
            {name: run.signals[name] for name in (*_followed(run), *MEASURED) if run.has(name)} | compared(run, robot),
            before,
            after,
            noise.sigma,
            True,
        )
        for run, robot, noise, before, after in zip(runs, robots, noises, steps[0], steps[-1], strict=True)
    )
    return answer, overlays


def _followed(run: Run) -> Sequence[str]:
    """The commands that a run's motion stands for: nobody knows how an unknown controller follows its own."""
    return () if mode_of(run) == "unknown" else COMMANDS


def _heard(run: Run, robot: Robot, noise: Noise, after: Simulated, unsure: Mapping[str, Vector]) -> Noise:
    """The noise as a run has it: all that is left of a channel, where a perfect model may well leave as much.

    A few seconds of coloured noise are a third louder or quieter than they are on average, and so are the tolerances of
    one robot, which would count as a gap, or hide one. What the numbers found may be off by is none of it.
    """
    sigma = dict(noise.sigma)
    for name, values in residuals(run, after, robot).items():
        there = np.isfinite(values).any(axis=0)
        square = np.nansum(np.square(values), axis=0) / np.maximum(np.isfinite(values).sum(axis=0), 1)
        known = sigma[name] ** 2
        near = (square <= noise.most(name, MOST, LEVEL)) & (square >= known / MOST)
        may = there & near & (noise.chance(name, square) >= LEVEL)
        own = np.maximum(square - unsure.get(name, 0.0), LEAST * square)
        sigma[name] = np.where(may & (own > 0.0), np.sqrt(own), sigma[name])
    return replace(noise, sensor=sigma, tolerance={name: np.zeros_like(one) for name, one in sigma.items()})


class _Shrunk:
    """The gap of some runs before and after, with how both scatter."""

    def __init__(
        self,
        runs: Sequence[Run],
        robots: Sequence[Robot],
        noises: Sequence[Noise],
        heard: Sequence[Noise],
        before: Sequence[Simulated],
        after: Sequence[Simulated],
    ) -> None:
        """Of noises as they are known, by which there is a gap or none, and as they were heard."""
        left = [
            [residuals(run, one, robot) for run, robot, one in zip(runs, robots, simulated, strict=True)]
            for simulated in (before, after)
        ]
        blocks = [Blocks.of(one, heard, runs) for one in left]
        self.before, self.after = (block.together() for block in blocks)
        self._noises = noises
        known = Blocks.of(left[0], noises, runs)
        self.known, self._scatters = known.together(), known.drawn()
        # the same blocks of both
        self._drawn: tuple[Sums, Sums] = (blocks[0].drawn(), blocks[1].drawn())

    def by(self, signal: str | None = None) -> float | None:
        """1 - gap after / gap before, of a signal or all; None where there is no clear gap before."""
        before = float(self.before.gap(signal))
        if not float(self.known.gap(signal)) ** 2 > CLEAR * self._scatter(signal) or not before > 0.0:
            return None
        return 1.0 - float(self.after.gap(signal)) / before

    def _scatter(self, signal: str | None) -> float:
        """Standard error of the squared gap before: of its blocks, and of how well the noise is known.

        Of the square, because the gap itself cannot scatter below 0.
        """
        names = self.known.signals if signal is None else (signal,)
        blocks = np.mean([np.mean(self._scatters.relative(name), axis=-1) for name in names], axis=0)
        # channels of one signal are off together
        known = 0.0
        for name in names:
            known += float(np.mean(np.sqrt(2.0 / self._freedom(name)))) ** 2
        return float(np.hypot(np.std(blocks), np.sqrt(known) / max(1, len(names))))

    def interval(self, *, heard: bool = False) -> tuple[float, float] | None:
        """95 % of `by` when blocks are drawn anew, and `by` itself, which takes more for noise; None: no gap.

        Args:
            heard: Noise is drawn anew as well, as loud as it may be for what is known of it and no louder than what is
                left: where a perfect model may leave all of that, some of it may be a gap.
        """
        by = self.by()
        if by is None:
            return None
        before, after = self._gaps_unsure() if heard else (drawn.gap() for drawn in self._drawn)
        low, high = np.quantile(1.0 - after / np.maximum(before, 1e-300), [0.025, 0.975])
        return min(float(low), by), max(float(high), by)

    def _gaps_unsure(self) -> tuple[Vector, Vector]:
        """Gaps before and after of blocks and noises that are drawn, in units of the noise as it was heard."""
        random = np.random.default_rng(SEED)
        before, after = self._drawn
        shifts: dict[str, Vector] = {}
        for name in self.known.signals:
            freedom = self._freedom(name)
            power = self.known.noises[name] / np.maximum(self.known.counts[name], 1.0)
            drawn = power * random.chisquare(freedom, (DRAWS, len(freedom))) / freedom * after.counts[name]
            # what is left with all that was found is noise at least
            shifts[name] = after.noises[name] - np.minimum(drawn, after.squares[name])

        def gap(one: Sums) -> Vector:
            return replace(one, squares={name: values + shifts[name] for name, values in one.squares.items()}).gap()

        return gap(before), gap(after)

    def _freedom(self, name: str) -> Vector:
        """Degrees of freedom of a signal's noise, shape (n,)."""
        return np.max([noise.freedom(name) for noise in self._noises], axis=0)


def _say_nothing(what: str) -> None:
    """Nobody listens."""
