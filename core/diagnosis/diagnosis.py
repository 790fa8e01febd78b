"""What a diagnosis says: where the gap lies, which effects cause it, how far it shrinks (contract: diagnosis.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..database import Database, MotionTable
from ..effects import EffectRow

if TYPE_CHECKING:
    import pandas

Vector = NDArray[np.float64]
Verdict = Literal["no_gap", "explained", "partly_explained", "unexplained"]
SCHEMA = "mbexport-diagnosis/1"


@dataclass(frozen=True, slots=True)
class SignalGap:
    """The gap of one signal.

    Attributes:
        rms: Root of the mean square of measured minus simulated over all of its channels [unit].
        noise: What it is judged against: the rms that a perfect model would have [unit].
        gap: sqrt(max(rms^2 - noise^2, 0)) of each channel, together, in units of noise.
        unit: Of rms and noise.
    """

    rms: float
    noise: float
    gap: float
    unit: str


@dataclass(frozen=True, slots=True)
class JointShare:
    """A joint's share of the gap's energy above noise, and its rms in units of noise with a 95 % interval."""

    share: float
    rms: float
    ci95: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Phase:
    """A phase of motion's part of the gap's energy: reversal, standstill, constant_speed or acceleration."""

    phase: str
    share: float


@dataclass(frozen=True, slots=True)
class Band:
    """A band of frequency's part of the gap's energy."""

    from_hz: float
    to_hz: float
    share: float


@dataclass(frozen=True, slots=True)
class Dependence:
    """How much of the gap a variable explains, e.g. sign(dq_2): 0 nothing, 1 all of it."""

    variable: str
    strength: float


@dataclass(frozen=True, slots=True)
class Where:
    """Where the gap lies.

    Attributes:
        signals: "tau", "q", "ee", ... -> its gap.
        joints: "joint_1" ... -> its share; shares sum to 1, or are all 0 where there is no gap.
        when, bands, depends_on: The largest first (bands: rising).
    """

    signals: Mapping[str, SignalGap]
    joints: Mapping[str, JointShare]
    when: tuple[Phase, ...] = ()
    bands: tuple[Band, ...] = ()
    depends_on: tuple[Dependence, ...] = ()


@dataclass(frozen=True, slots=True)
class Parameter:
    """A found value in SI, the total that the database should say, with its 95 % interval."""

    value: float
    ci95: tuple[float, float]
    unit: str


@dataclass(frozen=True, slots=True)
class Rival:
    """Another name that these runs cannot tell from a finding, and why."""

    effect: str
    at: str
    because: str


@dataclass(frozen=True, slots=True)
class Finding:
    """An effect that was found; names of the contract's catalogue or of a plugin; `at`: joint_N, arm_N or robot.

    `row` is what its table holds, finite numbers that no run shows included: those that are shown go with them.
    """

    effect: str
    at: str
    probability: float
    parameters: Mapping[str, Parameter]
    indistinguishable_from: tuple[Rival, ...] = ()
    row: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True, slots=True)
class Rejected:
    """An effect that was looked at and does not stand."""

    effect: str
    at: str
    why: str


@dataclass(frozen=True, slots=True)
class EffectShare:
    """What one finding adds to `shrinks_by`, in the order in which they were added."""

    effect: str
    at: str
    shrinks_by: float


@dataclass(frozen=True, slots=True)
class HowFar:
    """How far the gap shrinks on runs that no fit has seen.

    Attributes:
        before, after, noise: Signal -> rms [unit of the signal].
        shrinks_by: 1 - gap after / gap before over all signals; None unless the gap before is above twice its own
            standard error.
        ci95: Its 95 % interval: blocks of time and the noise's power drawn anew; None with shrinks_by.
        signals: Signal -> the same for it alone.
        by_effect: Shares that sum to the total.
        backends: Backend -> shrinks_by re-simulated there.
        refused: Backend -> why it has none.
        without: Finding "effect at" -> shrinks_by with it taken out again (the edit test).
        floor: Signal -> noise as it is known beforehand.
        as_heard: The same by the noise as these very runs have it, where what is left may be no more; what is told.
    """

    before: Mapping[str, float]
    after: Mapping[str, float]
    noise: Mapping[str, float]
    shrinks_by: float | None
    ci95: tuple[float, float] | None
    signals: Mapping[str, float | None]
    by_effect: tuple[EffectShare, ...] = ()
    backends: Mapping[str, float | None] = field(default_factory=dict[str, float | None])
    refused: Mapping[str, str] = field(default_factory=dict[str, str])
    without: Mapping[str, float | None] = field(default_factory=dict[str, float | None])
    floor: Mapping[str, float] = field(default_factory=dict[str, float])
    as_heard: HowFar | None = None


@dataclass(frozen=True, slots=True)
class Unexplained:
    """What is left: its share of the gap's energy, by joint, and what it looks like in words."""

    share: float
    joints: Mapping[str, float]
    looks_like: str


@dataclass(frozen=True, slots=True)
class NextExperiment:
    """A motion that would tell apart what these runs cannot, and why it would."""

    why: str
    motion: MotionTable


@dataclass(frozen=True, slots=True)
class LeftOutSamples:
    """Samples of a run that were left out: the plain sentence."""

    run: str
    channel: str
    reason: str
    message: str


@dataclass(frozen=True, slots=True)
class Score:
    """How well an effect at a place competed alone, for the joint-by-effect map.

    Attributes:
        explains: Share of the gap's energy that it takes by itself, 0 to 1.
        probability: That it is there.
    """

    effect: str
    at: str
    explains: float
    probability: float


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """One run as measured and as simulated before and after, for pictures; signals of shape (m, n) or (m, 3).

    Attributes:
        t: Times [s], shape (m,).
        measured: "q", "dq", "q_cmd", "tau", "ee", ... -> values; NaN where left out.
        before, after: Signals that were simulated with the nominal and with the corrected robot.
        noise: Signal -> standard deviation that a perfect model would leave, one a channel.
        held_out: No fit saw this run.
    """

    run: str
    t: Vector
    measured: Mapping[str, Vector]
    before: Mapping[str, Vector]
    after: Mapping[str, Vector]
    noise: Mapping[str, Vector]
    held_out: bool

    def drawable(self, since: float) -> Overlay:
        """From a time on, without what leads up to it, and without orientations, which are no curves."""
        rows = self.t >= since

        def curves(signals: Mapping[str, Vector]) -> dict[str, Vector]:
            return {name: values[rows] for name, values in signals.items() if name != "ee_rot"}

        return replace(
            self,
            t=self.t[rows],
            measured=curves(self.measured),
            before=curves(self.before),
            after=curves(self.after),
            noise={name: sigma for name, sigma in self.noise.items() if name != "ee_rot"},
        )


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The whole answer.

    Attributes:
        robot: Name of the database.
        verdict: See diagnosis.md.
        effects: Effect -> rows to put into the database (the totals), for with_effects and OUT/effects.
        corrected: The database with them, for the level that was diagnosed.
        level: Of the nominal model; it uses the effects that were found.
        runs, holdout: Names of the runs.
        notes: What a reader should know: windows, filters, what was assumed.
        scores: Every candidate that was looked at.
        overlays: The runs with their simulations, for pictures; not in the JSON.
    """

    robot: str
    verdict: Verdict
    where: Where
    which: tuple[Finding, ...]
    rejected: tuple[Rejected, ...]
    how_far: HowFar
    unexplained: Unexplained
    next_experiment: NextExperiment | None
    runs: tuple[str, ...]
    holdout: tuple[str, ...]
    left_out: tuple[LeftOutSamples, ...]
    effects: Mapping[str, tuple[EffectRow, ...]]
    corrected: Database
    level: str = "full"
    notes: tuple[str, ...] = ()
    scores: tuple[Score, ...] = ()
    overlays: tuple[Overlay, ...] = field(default=(), compare=False, repr=False)

    def to_json(self) -> dict[str, Any]:
        """diagnosis.json as the contract has it; None stands for null, infinities never occur."""
        from .as_json import as_json

        return as_json(self)

    def summary(self) -> str:
        """The verdict in a few plain lines."""
        from .words import summary

        return summary(self)

    def frame(self) -> pandas.DataFrame:
        """The findings as a table: a row a parameter, values in SI, `low` and `high` its 95 % interval."""
        from .table import frame

        return frame(self)
