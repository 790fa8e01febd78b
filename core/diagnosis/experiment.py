"""The experiment that would split what recorded runs cannot tell apart.

Several causes explain the runs alike. A motion is wanted along which they do not: for each of a library of small
experiments within the robot's limits, one cause is taken for the truth, another is fitted to what its sensors would
say, and what the fit cannot mimic is counted in units of noise. The motion whose worst pair stands furthest apart
is chosen, then varied a little. Everything goes along imagined motions by inverse dynamics; no engine runs.

    others = [other for other in found if other is not item]             # all of them search.Found
    names = (item, *(one.found for one in alike(state, found, item)))    # each with its numbers, fitted to these runs
    left = float(np.sqrt(np.mean(state.left**2)))                        # of what the best fit leaves
    planned = design(asked, names, others, misfit=left)                  # asked: the Problem
    planned.next()                                                       # NextExperiment; None: no motion can
    planned.why                                                          # sentences for the report, in either case

Where a motion separates some pairs only, the sentences say which; `planned.because(a, b)` is the reason for one pair,
to stand beside the name. `demonstration.shown` tries the motion in an engine, with noise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..effects import effect_named
from ..motion import MotionLaw
from ..motion.excitation import ACCELERATION, AMPLITUDE, SHARE, SPEED
from ..motion.probes import Probe, Room, one_after_the_other, probes, stretched, units
from ..motion.tables import table_of_law
from ..signals import joint_unit
from .contender import THRESHOLD
from .diagnosis import NextExperiment
from .experiment_words import Pair, because_in_words, why_in_words
from .found import Found, rows_of
from .imagined import imagined, template
from .mimic import Model, Sizes, Weigh, as_it_is
from .model import Rows, merged
from .nuisances import whitening
from .problem import Problem
from .tried import ALIKE_SHARE

Vector = NDArray[np.float64]

# of the names of a finding, so many are looked at
MOST_NAMES = 4
# joints that get small experiments of their own
MOST_JOINTS = 2
SHORTEST, LONGEST = 6.0, 12.0
# causes that say the same to this part of the effect, in so many motions of the library, the rich ones first, always do
SAME = 1e-9
TRIED = 3
# motions that may be looked at closely, and (longer, smaller) forms of the best
FINALISTS = 3
VARIED = ((1.0, 0.6), (1.6, 1.0))
# a motion may take this part of a torque limit
EFFORT = 0.9
SLOWER = (1.25, 1.6, 2.0)
# so many times what it takes is as clear as can be
CLEAR = 10.0
# of a close fit
_ROUNDS = 3
# what a controller follows well ends at this part of its own frequency
FOLLOWED = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """What would split the names of a finding.

    Attributes:
        law: Motion to be commanded; None where no motion within the limits splits any two of them.
        words: What the robot does, as a clause.
        pairs: How far apart each two of the names would be, the nearest first.
        why: Sentences for the report.
    """

    law: MotionLaw | None
    words: str
    pairs: tuple[Pair, ...]
    why: str

    @property
    def splits(self) -> bool:
        """Whether some two are told apart."""
        return self.law is not None

    def next(self) -> NextExperiment | None:
        """As a diagnosis has it."""
        return None if self.law is None else NextExperiment(self.why, table_of_law(self.law))

    def because(self, one: Found, other: Found) -> str:
        """What keeps two names from being told apart, and whether this motion would, as a clause."""
        names = {(one.effect, one.at), (other.effect, other.at)}
        pair = next((p for p in self.pairs if {(p.one.effect, p.one.at), (p.other.effect, p.other.at)} == names), None)
        return "" if pair is None else because_in_words(pair, self.words)


def design(
    problem: Problem,
    names: Sequence[Found],
    others: Sequence[Found] = (),
    *,
    misfit: float = 1.0,
    duration: float | None = None,
) -> Experiment:
    """A motion that would tell names of one finding apart.

    It stays within the database's limits of position, speed and torque (SHARE of them), without limits within what the
    recorded runs did, or what `motion.excitation` takes for any robot. The next run is thought of as recorded like
    these: controller, channels, noise. A fit to it alone must tell; of the recorded runs only the numbers that are no
    amounts (a speed, a stiffness) are held near to what they were.

    Args:
        problem: The recorded runs.
        names: Two or more causes that explain them alike, the finding first, with their numbers; MOST_NAMES count.
        others: What else was found; their numbers are free in every fit.
        misfit: Rms of what the best fit of the recorded runs leaves, in units of noise; below 1 counts as 1.
        duration: Of the motion [s]; None: as the longest run, within SHORTEST and LONGEST.

    Returns:
        The motion and how far apart the names are along it; without a motion where none splits any two.
    """
    if len(names) < 2:
        raise ValueError("an experiment splits two names or more")
    length = duration or min(max(SHORTEST, *(float(run.t[-1]) for run in problem.evidence.runs)), LONGEST)
    bench = _Bench(problem, tuple(names)[:MOST_NAMES], tuple(others), max(misfit, 1.0))
    room = bench.room()
    scored = bench.scored([_Trial(probe, room, length) for probe in bench.library()])
    if not scored:
        return Experiment(None, "", (), why_in_words(None, "", ()))
    if scored[0][0].count:
        firsts = [trial.probe for _, trial in scored[:2]]
        more = [_Trial(one_after_the_other(*firsts), room, length)] if len(firsts) == 2 else []
        best = scored[0][1]
        more += [replace(best, length=length * longer, room=room.smaller(part)) for longer, part in VARIED]
        scored = _ranked([*scored, *bench.scored(more)])
    # the figures are those with everything free and with all that nothing is blamed for; they may cost the first place
    closely: list[tuple[_Score, _Trial]] = []
    for rough, trial in scored[:FINALISTS]:
        closely += bench.scored([trial], closely=True)
        if closely and closely[-1][0].count >= rough.count:
            break
    score, trial = _ranked(closely)[0]
    law = score.law if score.count else None
    words = trial.probe.words if score.count else ""
    return Experiment(law, words, score.pairs, why_in_words(None if law is None else law.duration, words, score.pairs))


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    probe: Probe
    room: Room
    length: float


@dataclass(frozen=True, slots=True, eq=False)
class _Score:
    """How well a motion splits; the larger `order` the better."""

    law: MotionLaw
    pairs: tuple[Pair, ...]

    @property
    def count(self) -> int:
        """Pairs that are told apart."""
        return sum(pair.apart for pair in self.pairs)

    @property
    def order(self) -> tuple[int, float, float, float]:
        """Pairs that are told apart, how clearly the worst of them is, by how much, and how near the others come."""
        apart = [pair for pair in self.pairs if pair.apart]
        clear = min((min(pair.margin, CLEAR) for pair in apart), default=0.0)
        sigmas = min((pair.sigmas for pair in apart), default=0.0)
        return (self.count, clear, sigmas, sum(min(pair.margin, 1.0) for pair in self.pairs))


def _ranked(scored: list[tuple[_Score, _Trial]]) -> list[tuple[_Score, _Trial]]:
    """The best first; of equals the first."""
    return sorted(scored, key=lambda entry: entry[0].order, reverse=True)


class _Bench:
    """What is the same for all motions."""

    def __init__(self, problem: Problem, names: tuple[Found, ...], others: tuple[Found, ...], misfit: float) -> None:
        self._problem = problem
        self._names = names
        self._others = others
        self._misfit = misfit
        self._rest = rows_of(others)
        self._place = template(problem.evidence)
        self._robot = problem.robots(self._rest)[self._place]
        self._sizes = Sizes(problem)
        self._same: dict[tuple[int, int], list[Pair]] = {}

    def library(self) -> list[Probe]:
        """Small experiments about the joints that the names speak of."""
        joints = self._joints()
        control = self._problem.evidence.runs[self._place].run.control
        highest = [math.inf] * len(joints)
        if control.mode == "pd":
            from ..kinematics import dynamics

            inertia = np.diag(dynamics(self._robot).mass_matrix(self.room().centre))
            for k, j in enumerate(joints):
                motor = self._robot.stages[j].drive.inertia
                highest[k] = FOLLOWED * math.sqrt(control.kp[j] / (float(inertia[j]) + motor)) / (2.0 * math.pi)
        tool = "ee" in self._problem.evidence.runs[self._place].measured
        return list(probes(self._robot, joints, highest, tool=tool))

    def _joints(self) -> list[int]:
        """From 0, those that the names stand at; for names of the whole robot, where these differ most."""
        n = self._robot.n
        found: list[int] = []
        for name in self._names:
            if effect_named(name.effect).key != "robot" and name.at - 1 not in found:
                found.append(name.at - 1)
        if not found:
            found = [min(1, n - 1), n - 1] if n > 2 else list(range(n))
        return found[:MOST_JOINTS]

    def room(self) -> Room:
        """Within the limits, without these within what the runs did."""
        runs = self._problem.evidence.runs
        low, high = (
            np.min([run.q.min(axis=0) for run in runs], axis=0),
            np.max([run.q.max(axis=0) for run in runs], axis=0),
        )
        fastest = np.max([np.abs(run.dq).max(axis=0) for run in runs], axis=0)
        unit = units(self._robot)
        joints = [stage.joint for stage in self._robot.stages]
        lower, upper = (np.array([getattr(joint, side) for joint in joints]) for side in ("lower", "upper"))
        centre = 0.5 * (low + high)
        half = np.maximum(0.5 * (high - low), 0.0)
        wide = np.where(half > 0.1 * unit, half, 0.5 * AMPLITUDE * unit)
        bounded = np.isfinite(lower) & np.isfinite(upper)
        swing = np.where(bounded, np.maximum(half, AMPLITUDE * unit), wide)
        swing = np.where(bounded, np.minimum(swing, 0.5 * SHARE * (upper - lower)), swing)
        centre = np.clip(centre, lower + swing / SHARE, upper - swing / SHARE)
        limit = np.array([joint.velocity for joint in joints])
        speed = np.where(np.isfinite(limit), SHARE * limit, np.maximum(fastest, SPEED * unit))
        hardest = np.max([np.quantile(np.abs(run.ddq), 0.99, axis=0) for run in runs], axis=0)
        return Room(centre, swing, speed, np.maximum(hardest, ACCELERATION * unit))

    def scored(self, trials: Sequence[_Trial], *, closely: bool = False) -> list[tuple[_Score, _Trial]]:
        """The best first; motions that take more torque than there is are left out."""
        out: list[tuple[_Score, _Trial]] = []
        for trial in trials:
            planned = self._allowed(trial.probe.make(trial.room, trial.length))
            if planned is not None:
                law, asked = planned
                out.append((_Score(law, self._pairs(asked, closely=closely)), trial))
        return _ranked(out)

    def _rows(self, item: Found) -> Rows:
        return merged(self._rest, rows_of([item]))

    def _allowed(self, law: MotionLaw) -> tuple[MotionLaw, Problem] | None:
        """The motion, slower where it takes too much torque, and the question that it puts."""
        control = self._problem.evidence.runs[self._place].run.control
        stated = np.array([stage.joint.effort for stage in self._robot.stages])
        limit = EFFORT * np.minimum(stated, np.array(control.torque_limit or [math.inf] * len(stated)))
        truth = self._rows(self._names[0])
        for slower in (1.0, *SLOWER):
            plan = law if slower == 1.0 else stretched(law, slower)
            asked = imagined(self._problem, plan, truth)
            measured = asked.evidence.runs[0].measured
            if np.isinf(limit).all():
                return plan, asked
            taken = measured["tau"] if "tau" in measured else asked.spoken(truth)[0].tau
            if np.all(np.abs(taken) <= limit):
                return plan, asked
        return None

    def _pairs(self, asked: Problem, *, closely: bool) -> tuple[Pair, ...]:
        """How far apart each two names are along a motion, the nearest first."""
        whiten = whitening(asked) if closely else as_it_is
        models = [Model(asked, self._rest, name, self._others, self._sizes, whiten) for name in self._names]
        without = asked.residual(self._rest)
        pairs: list[Pair] = []
        for a, b in itertools.combinations(range(len(models)), 2):
            known = self._same.get((a, b), [])
            if not closely and len(known) >= TRIED and all(pair.share < SAME for pair in known):
                # what rich motions do not show, poor ones do not
                pairs.append(known[0])
                continue
            both = [
                self._pair(asked, whiten, truth, other, without, rounds=_ROUNDS if closely else 1)
                for truth, other in ((models[a], models[b]), (models[b], models[a]))
            ]
            pair = min(both, key=lambda one: one.margin)
            self._same.setdefault((a, b), []).append(pair)
            pairs.append(pair)
        return tuple(sorted(pairs, key=lambda pair: pair.margin))

    def _pair(self, asked: Problem, whiten: Weigh, truth: Model, other: Model, without: Vector, rounds: int) -> Pair:
        """What is left of one cause's signal once another has mimicked it."""
        left = other.mimicking(truth.said, rounds)
        weighed, whole = whiten(left), whiten(without - truth.said)
        energy = float(weighed @ weighed)
        evidence = asked.evidence
        best = max(evidence.channels, key=lambda c: float(np.sum(left[c.first : c.last] ** 2)))
        part = slice(best.first, best.last)
        rms = float(np.sqrt(np.sum((left[part] / evidence.weights[part]) ** 2) / len(evidence.runs[0].t)))
        return Pair(
            one=truth.name,
            other=other.name,
            sigmas=math.sqrt(energy) / self._misfit,
            share=energy / max(float(whole @ whole), 1e-30),
            signal=best.signal,
            index=best.index,
            rms=rms,
            unit=_unit(asked, best.signal, best.index),
            enough=math.sqrt(2.0 * THRESHOLD),
            enough_share=ALIKE_SHARE,
        )


def _unit(problem: Problem, signal: str, index: int) -> str:
    """Of a channel."""
    if signal == "ee":
        return "m"
    # "u": the controller's own torque
    return joint_unit("tau" if signal == "u" else signal, problem.database.joints[index].kind)
