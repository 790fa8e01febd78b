"""Whether a planned experiment does what it promises: each name in turn the truth in an engine, with noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..control import Control
from ..errors import UsageError
from ..motion import MotionLaw
from ..recording import Run
from ..simulation import Backend, Trace, simulate
from .contender import THRESHOLD
from .evidence import gather, sample
from .experiment import Experiment
from .fit import blocks, spread
from .found import Found, rows_of
from .imagined import template
from .mimic import Model, Sizes
from .model import merged
from .nuisances import whitening
from .problem import Problem
from .sensed import noise_in
from .tried import ALIKE_SHARE
from .words import capitalised, cause_in_words, percent

Vector = NDArray[np.float64]

# of a fit
ROUNDS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """One name as the truth, the others fitted to what its robot recorded.

    Attributes:
        truth: The name.
        nearest: That of the others which fits best.
        gain: Log evidence of the truth above it.
        share: What the other leaves more, as part of the energy that the truth takes.
    """

    truth: Found
    nearest: Found
    gain: float
    share: float

    @property
    def told(self) -> bool:
        """Whether the search would name the truth and not the other."""
        return self.gain >= THRESHOLD and self.share >= ALIKE_SHARE

    @property
    def words(self) -> str:
        """The outcome as a sentence."""
        truth, other = (cause_in_words(item.effect, item.place) for item in (self.truth, self.nearest))
        if self.told:
            return (
                f"{capitalised(truth)} simulated is found as such: {other} falls {self.gain:.0f} short in log evidence."
            )
        if self.gain >= THRESHOLD:
            return (
                f"{capitalised(truth)} simulated is hardly told from {other}, which falls {self.gain:.0f} short in log "
                f"evidence but leaves less than {percent(ALIKE_SHARE)} more of what {truth} does there."
            )
        return f"{capitalised(truth)} simulated is not told from {other}: log evidence {self.gain:.1f}."


def shown(
    planned: Experiment,
    problem: Problem,
    names: Sequence[Found],
    others: Sequence[Found] = (),
    *,
    backend: Backend | str = "mjcf",
    seed: int = 0,
) -> tuple[Shown, ...]:
    """Simulate the planned motion with each name as the truth, and see which the evidence is for.

    The controller, the sensors and their noise are the recorded runs'. Torque mode, which makes no motion of its own,
    and mode unknown are simulated with imposed motion and compared by torque.

    Args:
        planned: With a motion.
        problem: The recorded runs.
        names: As given to `design`.
        others: The same.
        backend: Engine, or its name.
        seed: Of the noise.

    Raises:
        UsageError: The experiment has no motion.
        RefusedError: The engine refuses a robot.
    """
    if planned.law is None:
        raise UsageError("no motion was planned that could be shown.")
    return tuple(
        _shown(planned.law, problem, truth, [name for name in names if name is not truth], others, backend, seed)
        for truth in names
    )


def _shown(
    law: MotionLaw,
    problem: Problem,
    truth: Found,
    names: Sequence[Found],
    others: Sequence[Found],
    backend: Backend | str,
    seed: int,
) -> Shown:
    place = template(problem.evidence)
    recorded, nominal = problem.evidence.runs[place].run, problem.evidence.nominals[place]
    robot = problem.robots(merged(rows_of(others), rows_of([truth])))[place]
    control = recorded.control if recorded.control.mode == "pd" else Control()
    trace = simulate(robot, backend, law, control, rate=recorded.rate, nominal=nominal)
    run = _recorded(trace, recorded, seed)
    asked = Problem(problem.database, problem.known, (problem.bodies[place],), gather([run], [nominal]))
    whiten, parts = whitening(asked), blocks(asked.evidence)
    rest, sizes = rows_of(others), Sizes(problem)

    def leaves(name: Found) -> Vector:
        return whiten(Model(asked, rest, name, others, sizes, whiten).mimicking(0.0, ROUNDS))

    right, without = leaves(truth), whiten(asked.residual(rest))
    sigma = spread(right, parts)
    best = float(np.sum((right / sigma) ** 2))
    energy = max(float(without @ without) - float(right @ right), 1e-9)
    outcomes: list[Shown] = []
    for name in names:
        left = leaves(name)
        gain = 0.5 * (float(np.sum((left / sigma) ** 2)) - best)
        outcomes.append(Shown(truth, name, gain, (float(left @ left) - float(right @ right)) / energy))
    return min(outcomes, key=lambda one: one.gain)


def _recorded(trace: Trace, like: Run, seed: int) -> Run:
    """A simulated run as the recorded ones are: their signals, their noise."""
    random = np.random.default_rng(seed)
    signals: dict[str, Vector] = {}
    for name in ("q_cmd", "dq_cmd", "ddq_cmd", "q", "tau", "tau_link", "q_link", "ee"):
        imposed = like.control.mode != "pd"
        if name not in like.signals and not (name == "tau" and like.control.mode == "torque"):
            continue
        values = trace.tip if name == "ee" else trace.joints.get(name)
        if values is None or (imposed and like.control.mode != "motion" and name.endswith("_cmd")):
            continue
        signals[name] = values
        if name in like.signals and not name.endswith("_cmd"):
            signals[name] = values + sample(noise_in(like, name), len(trace.t), random)
    control = Control("unknown") if like.control.mode == "torque" else like.control
    stated = {name: sigma for name, sigma in like.noise.items() if name in signals}
    return replace(like, name="next", t=trace.t, signals=signals, control=control, noise=stated, locked=(), left_out=())
