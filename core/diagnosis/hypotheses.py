"""What competes: every effect of the catalogue at every place, each in the forms in which it could be there.

A hypothesis is linear near where it starts: its numbers beta move a row's values, and the residual's change with beta
is its signature. What is not linear (a Stribeck velocity, the cycles of a ripple) comes as several hypotheses, one for
each of a few values; the search's winner is refined in all of its numbers afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..effects import Column, EffectRow, catalogue, effect_named
from ..expansion import SHORTEST_BEND
from ..kinematics import dynamics
from ..representation import JointKind
from .beyond import KNEE
from .evidence import differences
from .inverse import Said
from .model import Rows
from .prepare import Prepared
from .problem import Problem
from .waves import Angle, periodic

Vector = NDArray[np.float64]
Values = dict[str, float]

# how large an amount is tried, as part of what would be a plain effect
STEP = 0.02
CYCLES = 3
# cycles beside the strongest that are tried, and how far they are apart [1 / way]
BESIDE, APART = 4, 0.6
# delays are looked for up to this one [s], and within this part of each tick
LONGEST_DELAY = 0.02
WITHIN = 0.98
FINEST_CYCLES = 0.25
# the most of them: a turn (a gear of 100 and its motor's four), or as radians a metre (six a turn of a screw of 5 mm)
MOST_CYCLES: Mapping[JointKind, float] = {"revolute": 400.0, "prismatic": 8000.0}
# times the median power of all orders that a wave's is
STANDS_OUT = 8.0
# part of a joint's torques that is no peak of noise
NEARLY_ALL = 0.999
# width of the knee, in limits, of one that is felt before it is reached
SOFT_KNEE = 0.1
_WAVES = ("transmission_error", "torque_ripple")
# waves go together whose cycles do but for this many that runs can tell apart
NEAR = 2.0
# turns of one wave in turns of another that goes with it
_TOGETHER = ((1, 1), (2, 1), (3, 1), (1, 2), (1, 3))
TENSOR: tuple[str, ...] = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
# where no torque is measured only their product shows
_SAME_UNSEEN = ("controller_gain", "torque_constant")
# what lets a motor move before a clamped output
GIVING = ("backlash", "joint_compliance", "joint_compliance_6d")


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """One effect at one place in one form.

    Attributes:
        effect: Its name.
        at: Number of joint or arm, from 1; 0 for the robot.
        form: Which of its forms, "" where there is one.
        values: beta -> the row's values; None where these are impossible.
        scale: What would be a plain amount of each number of beta; the spread of their prior.
        lower: Least value of each.
        alone: At beta = 0 it is as if the effect were not there.
        curved: Its signature holds near where it starts only.
        carried: Its other numbers say nothing without the first, as a first moment without a mass.
    """

    effect: str
    at: int
    form: str
    values: Callable[[Vector], Values | None]
    scale: Vector
    lower: Vector
    alone: bool = True
    curved: bool = False
    carried: bool = False

    @property
    def place(self) -> str:
        """joint_N, arm_N or robot."""
        return place_of(self.effect, self.at)

    @property
    def key(self) -> tuple[str, int]:
        """What it is called in a verdict."""
        return (self.effect, self.at)

    def rows(self, beta: Vector) -> Rows | None:
        """Its row as a table; None where these values are impossible."""
        values = self.values(beta)
        return None if values is None else {self.effect: (EffectRow(self.at, values),)}


def place_of(effect: str, at: int) -> str:
    """joint_N, arm_N or robot."""
    key = effect_named(effect).key
    return "robot" if key == "robot" else f"{key}_{at}"


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """What is large for each joint in these runs, shapes (n,): rms torque, speed and acceleration, range, inertia.

    With what is left of every run's torque, and of its arm sides' positions where these were measured, shapes (m, n);
    and the weight [N] that each joint bears, with the length [m] of the arms from there on, shapes (n,); the largest
    torque that the motion takes; and the rms torque that goes through each drive to the arms.
    """

    torque: Vector
    speed: Vector
    acceleration: Vector
    way: Vector
    inertia: Vector
    residual: list[Vector] = field(default_factory=list[Vector])
    turned: list[Vector] = field(default_factory=list[Vector])
    mass: float = 1.0
    length: float = 1.0
    weight: Vector = field(default_factory=lambda: np.zeros(0))
    lever: Vector = field(default_factory=lambda: np.zeros(0))
    peak: Vector = field(default_factory=lambda: np.zeros(0))
    borne: Vector = field(default_factory=lambda: np.zeros(0))


def _felt(run: Prepared, speech: Said) -> Vector | None:
    """The torque that a run's motors had: measured, or as its controller asked for it."""
    return run.measured.get("tau", speech.u)


def scales_of(problem: Problem, rows: Rows) -> Scales:
    """Scales from the runs and the robot with these rows."""
    evidence = problem.evidence
    robots = problem.robots(rows)
    spoken = problem.spoken(rows)
    borne = np.sqrt(np.mean(np.concatenate([s.tau_link**2 for s in spoken]), axis=0))
    torque = borne
    # a joint that should carry nothing may still feel its friction
    felt = [values for run, s in zip(evidence.runs, spoken, strict=True) if (values := _felt(run, s)) is not None]
    if felt:
        torque = np.maximum(torque, np.sqrt(np.mean(np.concatenate(felt) ** 2, axis=0)))
    speed = np.sqrt(np.mean(np.concatenate([run.dq**2 for run in evidence.runs]), axis=0))
    acceleration = np.sqrt(np.mean(np.concatenate([run.ddq**2 for run in evidence.runs]), axis=0))
    q = np.concatenate([run.q for run in evidence.runs])
    inertia = np.diagonal(dynamics(robots[0]).mass_matrix(q[:: max(1, len(q) // 50)]), axis1=1, axis2=2).mean(axis=0)
    left: list[Vector] = []
    turned: list[Vector] = []
    for run, speech, mask in zip(evidence.runs, spoken, evidence.masks, strict=True):
        apart = differences(run, speech)
        name = "tau" if "tau" in apart else "u" if "u" in apart else ""
        left.append(apart[name] * mask[name] if name else np.zeros_like(run.q))
        turned.append(apart["q_link"] * mask["q_link"] if "q_link" in apart else np.zeros_like(run.q))
    arms = [stage.arm for stage in robots[0].stages]
    masses = np.array([max(arm.inertia.mass, 0.0) for arm in arms])
    lengths = np.array([math.hypot(*arm.link.pose().xyz) for arm in arms])
    lengths[-1] += math.hypot(*robots[0].tool.xyz)
    reach = max(1e-2, float(lengths.sum()))
    return Scales(
        np.maximum(torque, 1e-6),
        np.maximum(speed, 1e-6),
        np.maximum(acceleration, 1e-6),
        np.maximum(problem.way(), 1e-6),
        np.maximum(inertia, 1e-9),
        left,
        turned,
        max(0.001, float(masses.max())),
        reach,
        9.81 * np.maximum(np.cumsum(masses[::-1])[::-1], 0.001),
        np.maximum(np.cumsum(lengths[::-1])[::-1], 0.01 * reach),
        np.max([_hardest(run, speech) for run, speech in zip(evidence.runs, spoken, strict=True)], axis=0),
        np.maximum(borne, 1e-6),
    )


def _hardest(run: Prepared, speech: Said) -> list[float]:
    """The largest torque that each joint's motion takes, where the smoothing's ends are not felt."""
    return [_nearly_all(torque) for torque in speech.tau[run.edge : len(run.t) - run.edge].T]


def hypotheses(problem: Problem, rows: Rows, scales: Scales, skip: Sequence[tuple[str, int]] = ()) -> list[Hypothesis]:
    """Everything that could be there beside these rows, in amounts of these scales, but for what to skip."""
    found: list[Hypothesis] = []
    n = problem.database.n
    # a motor moves before a clamped output only where something gives; nothing else can be judged before that is there
    stiff = [
        at
        for at in range(1, n + 1)
        if clamped(problem, at) and not any(problem.row_at(name, at, rows) for name in GIVING)
    ]
    there = {(effect, row.at) for effect, found_rows in rows.items() for row in found_rows}
    for name in catalogue():
        effect = effect_named(name)
        places = (0,) if effect.key == "robot" else range(1, n + 1)
        for at in places:
            if (name, at) in skip or not possible(problem, name, at):
                continue
            if (names_of_one(problem, name, at) - {(name, at)}) & there:
                continue
            if effect.key == "joint" and at in stiff:
                found += _giving(scales, name, at)
                continue
            existing = problem.row_at(name, at, rows)
            known = dict(existing.values) if existing else None
            maker = _FORMS.get(name, _plugin)
            made = [h for h in maker(problem, scales, name, at, known) if len(h.scale)]
            if name in _WAVES:
                made = [h for h in made if not _harmonic(h, rows, NEAR * 2.0 * np.pi / scales.way[at - 1])]
            found += made
    return found


def _harmonic(wave: Hypothesis, rows: Rows, apart: float) -> bool:
    """Whether a wave goes with one that was found at its joint: no error of a gear or a motor is a pure sine.

    Args:
        wave: What is asked about.
        rows: What was found.
        apart: Cycles by which these runs can tell two waves apart.
    """
    values = wave.values(wave.scale)
    if values is None:
        return False
    ratios = [
        (row.values["cycles"], values["cycles"]) for name in _WAVES for row in rows.get(name, ()) if row.at == wave.at
    ]
    return any(abs(k * other - m * own) < apart for other, own in ratios for k, m in _TOGETHER)


def twins_of(problem: Problem) -> set[tuple[str, int]]:
    """Two names of one body: what hangs at the last arm is a payload, or that arm's inertia."""
    return {("payload", 0), ("link_inertia", problem.database.n)}


def names_of_one(problem: Problem, name: str, at: int) -> set[tuple[str, int]]:
    """The names, each at its place, of which one says all that this one does on these runs; itself among them."""
    if (name, at) in (twins := twins_of(problem)):
        return twins
    if name in _SAME_UNSEEN and not any({"tau", "tau_link"} & run.measured.keys() for run in problem.evidence.runs):
        return {(other, at) for other in _SAME_UNSEEN}
    return {(name, at)}


def possible(problem: Problem, name: str, at: int) -> bool:
    """Whether an effect can say anything here."""
    database = problem.database
    runs = problem.evidence.runs
    controls = {run.run.control.mode for run in runs}
    if name == "controller_gain" and "pd" not in controls:
        return False
    if name in ("delay", "torque_limit") and not controls & {"pd", "torque"}:
        return False
    if name == "torque_constant" and not any(run.gains_act for run in runs):
        return False
    if name == "torque_offset" and not any("tau" in run.measured for run in runs):
        return False
    if name == "base_tilt" and database.base_taken_up:
        return False
    if name == "link_flexibility":
        pose = database.kinematics[at - 1].pose()
        return math.hypot(*pose.xyz) > max(SHORTEST_BEND, 1e-3)
    return True


Form = Callable[[Problem, Scales, str, int, "Values | None"], list[Hypothesis]]


def defaults(name: str) -> Values:
    """Every number of an effect's row as it is where the row says nothing, 0 where it has to say something."""
    return {column.name: 0.0 if column.default is None else column.default for column in effect_named(name).columns}


def _added(
    name: str,
    at: int,
    known: Values | None,
    scale: Mapping[str, float],
    *,
    form: str = "",
    fixed: Values | None = None,
) -> Hypothesis:
    """Numbers that add to a row's columns."""
    start = (known or defaults(name)) | (fixed or {})
    columns = tuple(scale)
    least = {column.name: column.minimum for column in effect_named(name).columns}

    def values(beta: Vector) -> Values | None:
        out = dict(start)
        for column, b in zip(columns, beta.tolist(), strict=True):
            out[column] = max(start[column] + b, least[column])
        return out

    lower = np.array([least[column] - start[column] for column in columns])
    # with numbers held that say how it goes, it is one of many forms
    return Hypothesis(name, at, form, values, np.array(list(scale.values())), lower, curved=bool(fixed))


def _torque(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"torque": scales.torque[at - 1]})]


def _viscous(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"coefficient": scales.torque[at - 1] / scales.speed[at - 1]})]


def _load(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"coefficient": 0.3})]


def _rotor(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"inertia": scales.inertia[at - 1]})]


def _stribeck(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    speeds = [known["velocity"]] if known else [part * scales.speed[at - 1] for part in (0.05, 0.15, 0.4)]
    return [
        _added(name, at, known, {"torque": scales.torque[at - 1]}, form=f"vs {v:.3g}", fixed={"velocity": v})
        for v in speeds
    ]


def _gain(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known or {"gain": 1.0}, {"gain": 0.2})]


def _controller(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"kp": 0.2, "kd": 0.2})]


def _encoder(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"offset": 0.02 if _revolute(problem, at) else 0.02 * scales.length})]


def _delay(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """From the middle of each tick: what a torque reports jumps where a delay becomes another whole number of them."""
    if known:
        return [_added(name, at, known, {"time": 0.001})]
    tick = 1.0 / min(run.run.control.rate for run in problem.evidence.runs)
    forms: list[Hypothesis] = []
    for number in range(max(1, round(LONGEST_DELAY / tick))):
        middle = (number + 0.5) * tick

        def values(beta: Vector, middle: float = middle) -> Values | None:
            aside = WITHIN * 0.5 * tick
            return {"time": middle + min(max(float(beta[0]), -aside), aside)}

        forms.append(
            Hypothesis(
                name,
                at,
                f"tick {number + 1}",
                values,
                np.array([0.5 * tick]),
                np.array([-0.5 * tick]),
                alone=False,
                curved=True,
            )
        )
    return forms


def _nearly_all(torque: Vector) -> float:
    """What hardly any of a joint's torques (m,) are beyond; 0 where there are none."""
    there = np.abs(torque[np.isfinite(torque)])
    return float(np.quantile(there, NEARLY_ALL)) if len(there) else 0.0


def _limit(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """A limit just below the largest torque: where there is one, the torque stays there, or comes near it."""
    given = [run.run.signals.get("tau", run.run.signals.get("tau_cmd")) for run in problem.evidence.runs]
    # what the motion takes, where nobody says what the motors gave
    largest = max(scales.peak[at - 1] if one is None else _nearly_all(one[:, at - 1]) for one in given)
    if largest <= 0.0 or (known and known["torque"] <= largest):
        return []

    def cut(beta: Vector) -> Values | None:
        return {"torque": max(largest - float(beta[0]), 1e-9)}

    def soft(beta: Vector) -> Values | None:
        # felt at once, and come to nowhere
        return {"torque": max((1.0 + SOFT_KNEE) * largest - float(beta[0]), 1e-9), KNEE: SOFT_KNEE}

    scale = np.array([0.2 * largest])
    return [
        Hypothesis(name, at, form, values, scale, np.array([-more * largest]), alone=False, curved=True)
        for form, values, more in (("", cut, 0.05), ("soft", soft, 0.5))
    ]


def _spring(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """-k (q - rest): linear in k and k rest."""
    k0 = known["stiffness"] if known else 0.0
    m0 = k0 * known["rest"] if known else 0.0

    def values(beta: Vector) -> Values | None:
        k, m = k0 + float(beta[0]), m0 + float(beta[1])
        if k <= 0.0:
            return {"stiffness": 0.0, "rest": 0.0}
        return {"stiffness": k, "rest": m / k}

    torque, way = scales.torque[at - 1], scales.way[at - 1]
    scale, lower = np.array([torque / way, torque]), np.array([-k0, -np.inf])
    return [Hypothesis(name, at, "", values, scale, lower, carried=True)]


def _compliance(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """1/K is what the gap is linear in; damping of a tenth of the critical one unless it is known."""
    inertia = scales.inertia[at - 1]
    torque = scales.torque[at - 1]
    gives = 1.0 / known["stiffness"] if known else 0.0
    forms: list[Hypothesis] = []
    for size in (1e-4, 1e-3, 1e-2):
        start = max(size / torque, 1e-12)

        def values(beta: Vector, start: float = start) -> Values | None:
            k = 1.0 / max(gives + start + float(beta[0]), 1e-12)
            b = known["damping"] if known else 0.1 * 2.0 * math.sqrt(k * inertia)
            return {"stiffness": k, "damping": b}

        forms.append(
            Hypothesis(
                name, at, f"{size:g}", values, np.array([start]), np.array([-0.9 * start]), alone=False, curved=True
            )
        )
    return forms


def _bearing(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """Six directions that give; each starts soft enough to be seen, hard enough to be near nothing."""
    force, lever = scales.weight[at - 1], scales.lever[at - 1]
    angles = {"krx", "kry", "krz"}
    names = ["kx", "ky", "kz", "krx", "kry", "krz"]
    own = "krz" if _revolute(problem, at) else "kz"
    names.remove(own)
    start = known or defaults(name)
    give = {k: (1e-4 / (force * lever) if k in angles else 1e-4 * lever / force) for k in names}

    def values(beta: Vector) -> Values | None:
        out = dict(start)
        for k, b in zip(names, beta.tolist(), strict=True):
            before = 0.0 if math.isinf(start[k]) else 1.0 / start[k]
            soft = before + b
            if soft > 1e-3 * give[k]:
                out[k] = 1.0 / soft
                damping = "b" + k[1:]
                if start[damping] == 0.0:
                    out[damping] = 2e-3 * out[k]
        return out

    scale = np.array([30.0 * give[k] for k in names])
    return [Hypothesis(name, at, "", values, scale, np.zeros(len(names)), curved=True)]


def _bend(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    start = known or defaults(name)
    give = 1e-3 / (scales.weight[at - 1] * scales.lever[at - 1])
    columns = ("ku", "kv")

    def values(beta: Vector) -> Values | None:
        out = dict(start)
        for k, b in zip(columns, beta.tolist(), strict=True):
            before = 1.0 / start[k] if known else 0.0
            # an arm that bends about one axis only is next to rigid about the other
            out[k] = 1.0 / max(before + b, 1e-3 * give)
            if not known:
                out["b" + k[1:]] = 2e-3 * out[k]
        return out

    return [Hypothesis(name, at, "", values, np.array([5.0 * give] * 2), np.zeros(2), curved=True)]


def _giving(scales: Scales, name: str, at: int) -> list[Hypothesis]:
    """What gives before a clamped output: a spring, or clearance before one; linear in the stiffness."""
    way = scales.way[at - 1]
    stiffness = {"stiffness": scales.torque[at - 1] / way}
    if name == "joint_compliance":
        return [_added(name, at, None, stiffness, form="clamped")]
    if name == "backlash":
        contact = {"stiffness": 0.0, "damping": 0.0}
        return [
            _added(name, at, None, stiffness, form=f"clamped {part:g}", fixed=contact | {"gap": part * way})
            for part in (0.2, 0.4, 0.6, 0.8)
        ]
    return []


def clamped(problem: Problem, at: int) -> bool:
    """Whether a joint's arm is held in every run."""
    return all(at in run.run.locked for run in problem.evidence.runs)


def _backlash(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    start = known or defaults(name)
    size = 2e-3 if _revolute(problem, at) else 2e-3 * scales.length
    if clamped(problem, at):
        # of the motor's way there
        size = 0.2 * float(scales.way[at - 1])
    forms: list[Hypothesis] = []
    # a good gear's play is a minute of arc
    for part in (0.1, 0.3, 1.0, 3.0):

        def values(beta: Vector, part: float = part) -> Values | None:
            return start | {"gap": max((start["gap"] if known else 0.0) + part * size + float(beta[0]), 0.0)}

        forms.append(
            Hypothesis(
                name,
                at,
                f"{part:g}",
                values,
                np.array([part * size]),
                np.array([-0.9 * part * size]),
                alone=False,
                curved=True,
            )
        )
    return forms


def _loop(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """Hysteresis: at a given way to slip, linear in the torque."""
    forms: list[Hypothesis] = []
    way = scales.way[at - 1]
    torque = scales.torque[at - 1]
    for part in (3e-3, 2e-2, 1e-1, 4e-1):
        slip = part * way

        def values(beta: Vector, slip: float = slip) -> Values | None:
            f = (known["torque"] if known else 0.0) + float(beta[0])
            f = max(f, 1e-9 * torque)
            return {"torque": f, "stiffness": f / slip, "slips": known["slips"] if known else 8.0}

        forms.append(Hypothesis(name, at, f"{part:g}", values, np.array([torque]), np.zeros(1), curved=True))
    return forms


def _wave(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """amplitude sin(cycles theta + phase), linear in its two quadratures; cycles from the residual's orders."""
    cycles = [known["cycles"]] if known else _orders(problem, scales, at, second=name == "transmission_error")
    size = scales.torque[at - 1] if name == "torque_ripple" else 0.0
    forms: list[Hypothesis] = []
    for c in cycles:
        plain = size or scales.torque[at - 1] / (
            scales.inertia[at - 1] * (c * scales.speed[at - 1]) ** 2 + scales.torque[at - 1]
        )
        a0, b0 = (
            (known["amplitude"] * math.cos(known["phase"]), known["amplitude"] * math.sin(known["phase"]))
            if known
            else (0.0, 0.0)
        )

        def values(beta: Vector, c: float = c, a0: float = a0, b0: float = b0) -> Values | None:
            a, b = a0 + float(beta[0]), b0 + float(beta[1])
            return {"amplitude": math.hypot(a, b), "cycles": c, "phase": math.atan2(b, a)}

        free = np.array([-np.inf, -np.inf])
        forms.append(Hypothesis(name, at, f"{c:.4g}", values, np.array([plain, plain]), free, curved=True))
    return forms


def _orders(problem: Problem, scales: Scales, at: int, *, second: bool) -> list[float]:
    """Cycles a turn at which the residual is periodic in the joint's angle, the strongest first."""
    i = at - 1
    way = scales.way[i]
    fastest = max(float(np.abs(run.dq[:, i]).max()) for run in problem.evidence.runs)
    band = min(run.band for run in problem.evidence.runs)
    highest = min(MOST_CYCLES[problem.database.joints[i].kind], 2.0 * np.pi * band / max(0.3 * fastest, 1e-9))
    finest = max(FINEST_CYCLES, 0.5 * np.pi / way)
    lowest = problem.fewest_cycles(at)
    if highest <= lowest:
        return []
    grid = np.arange(lowest, highest, finest)
    powers = [_periodic(problem, scales.residual, i, grid, itself=not second, second=second)]
    if second:
        # inertia takes a gear's error twice differentiated, weight as it is; and where an arm side's position was
        # measured, it stands there
        powers.append(_periodic(problem, scales.residual, i, grid, itself=True, second=True))
        powers.append(_periodic(problem, scales.turned, i, grid, itself=True, second=False))
    chosen: list[float] = []
    for power in sorted(powers, key=_clear, reverse=True):
        # of the clearest its highest, of the others what stands out most
        for cycles in _peaks(power, grid, way)[: 1 if chosen else CYCLES]:
            if all(abs(cycles - c) > 2.0 * np.pi / way for c in chosen):
                chosen.append(cycles)
    if not chosen:
        return []
    # a wave over this way is told from its neighbours so far apart, and what else is left moves the peak a little
    near = [chosen[0] + k * APART / way for k in range(-BESIDE, BESIDE + 1) if k]
    # of an error that comes twice a turn as well the second is the louder one, by the square of how often it comes
    once = [] if any(abs(0.5 * chosen[0] - c) * way < 0.5 * np.pi for c in chosen) else [0.5 * chosen[0]]
    return [*chosen, *(float(cycles) for cycles in (*once, *near) if cycles >= lowest)]


def _peaks(power: Vector, grid: Vector, way: float) -> list[float]:
    """Cycles of the highest peaks of a power that these runs tell apart, the highest first."""
    peaks: list[float] = []
    noise = STANDS_OUT * float(np.median(power))
    for k in np.argsort(-power):
        if power[k] <= noise or len(peaks) == CYCLES:
            # no more than the highest of so many of noise
            break
        if all(abs(grid[k] - c) > 2.0 * np.pi / way for c in peaks):
            peaks.append(float(grid[k]))
    return peaks


def _periodic(problem: Problem, left: Sequence[Vector], i: int, grid: Vector, *, itself: bool, second: bool) -> Vector:
    """Energy that a wave of each number of cycles a turn takes of what is left of every run (m, n) at joint i, (g,)."""
    angles: list[Angle] = []
    for run, values in zip(problem.evidence.runs, left, strict=True):
        # as many samples as the band needs
        every = max(1, int(1.0 / (8.0 * run.band * run.h)))
        angles.append(Angle(*(x[::every, i] for x in (run.q, run.dq, run.ddq, values))))
    return periodic(angles, grid, itself=itself, second=second)


def _clear(power: Vector) -> float:
    """How far the highest of powers stands out of all."""
    return float(power.max()) / max(float(np.median(power)), 1e-300)


def _payload(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """A body at the last arm: mass and first moments of a point, then its moments, beside one that is there already."""
    m, x = _load_scale(problem, scales), 0.3 * scales.length
    start = known or defaults(name)

    def point(beta: Vector) -> Values | None:
        mass = start["mass"] + float(beta[0])
        if mass <= 1e-9:
            return dict(defaults(name))
        first = [start["mass"] * start[axis] + float(b) for axis, b in zip("xyz", beta[1:4], strict=True)]
        return start | {"mass": mass} | {axis: value / mass for axis, value in zip("xyz", first, strict=True)}

    def body(beta: Vector) -> Values | None:
        values = point(beta[:4])
        if values is None or values["mass"] <= 1e-9:
            return values
        return values | {c: values[c] + float(b) for c, b in zip(TENSOR, beta[4:], strict=True)}

    def ball(beta: Vector) -> Values:
        return start | {c: start[c] + float(beta[0]) for c in TENSOR[:3]}

    lower = np.array([-start["mass"], *[-np.inf] * 3])
    mass, tensor = np.array([m, m * x, m * x, m * x]), np.full(len(TENSOR), m * x * x)
    free = np.full(len(TENSOR), -np.inf)
    forms = [
        Hypothesis(name, 0, "point", point, mass, lower, carried=True),
        Hypothesis(name, 0, "body", body, np.append(mass, tensor), np.append(lower, free), carried=True),
    ]
    if start["mass"] > 0.0:
        # what hangs there is as thick as it is wide, before it is known better
        least = np.array([-min(start[c] for c in TENSOR[:3])])
        forms.append(Hypothesis(name, 0, "ball", ball, np.array([start["mass"] * x * x]), least))
    return forms


def _load_scale(problem: Problem, scales: Scales) -> float:
    return max(problem.database.inertias[-1].mass, 0.1 * scales.mass)


def _arm(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """Ten parameters, and mass with first moments alone."""
    m = max(problem.database.inertias[at - 1].mass, 0.05 * scales.mass)
    x = 0.2 * scales.length
    masses = {"mass": m, "mx": m * x, "my": m * x, "mz": m * x}
    tensor: dict[str, float] = dict.fromkeys(TENSOR, m * x * x)
    return [
        _added(name, at, known, masses, form="mass"),
        _added(name, at, known, tensor, form="tensor"),
        _added(name, at, known, masses | tensor, form="all"),
    ]


def _kinematic(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    angle, length = 0.01, 0.01 * scales.length
    forms = [
        _added(name, at, known, {column: angle if column in ("alpha", "theta", "beta") else length}, form=column)
        for column in ("alpha", "a", "theta", "d", "beta")
    ]
    every = {"alpha": angle, "a": length, "theta": angle, "d": length, "beta": angle}
    forms.append(_added(name, at, known, every, form="all"))
    row = problem.row_at(name, at, {})
    middle = row.values if row else defaults(name)
    return [replace(form, values=partial(_near, problem, middle, form.values)) for form in forms]


def _near(
    problem: Problem, middle: Mapping[str, float], values: Callable[[Vector], Values | None], beta: Vector
) -> Values | None:
    """Numbers of an arm that is still that arm."""
    out = values(beta) or {}
    far = any(abs(value - middle[column]) > problem.farthest(column) for column, value in out.items())
    return None if far else out


def _tilt(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    return [_added(name, at, known, {"roll": 0.02, "pitch": 0.02})]


def _plugin(problem: Problem, scales: Scales, name: str, at: int, known: Values | None) -> list[Hypothesis]:
    """An effect of somebody else's: each column that must be given, by its unit; several values of the others."""
    effect = effect_named(name)
    free = [column for column in effect.columns if column.default is None]
    if not free:
        free = [effect.columns[0]]
    # a place without a joint of its own takes the largest
    i = at - 1 if effect.key == "joint" else int(np.argmax(scales.torque))
    units = {
        "N*m": scales.torque[i],
        "N": scales.torque[i],
        "rad": 1e-3 * scales.way[i],
        "m": 1e-3 * scales.way[i],
        "rad/s": scales.speed[i],
        "m/s": scales.speed[i],
        "N*m*s/rad": scales.torque[i] / scales.speed[i],
        "N*m/rad": scales.torque[i] / scales.way[i],
        "kg*m^2": scales.inertia[i],
        "kg": scales.mass,
        "s": 0.005,
    }

    def plain(column: Column) -> float:
        return float(units.get(column.unit.split("|")[0], 0.1))

    first, *others = free
    amounts = {first.name: plain(first)}
    forms: list[Hypothesis] = []
    for part in (0.1, 1.0, 10.0) if others else (1.0,):
        fixed = {column.name: part * plain(column) for column in others}
        forms.append(_added(name, at, known, amounts, form=f"{part:g}" if others else "", fixed=fixed))
    return forms


def _revolute(problem: Problem, at: int) -> bool:
    return problem.database.joints[at - 1].kind == "revolute"


_FORMS: dict[str, Form] = {
    "backlash": _backlash,
    "base_tilt": _tilt,
    "controller_gain": _controller,
    "coulomb_friction": _torque,
    "delay": _delay,
    "encoder_offset": _encoder,
    "hysteresis": _loop,
    "joint_compliance": _compliance,
    "joint_compliance_6d": _bearing,
    "joint_spring": _spring,
    "kinematic_error": _kinematic,
    "link_flexibility": _bend,
    "link_inertia": _arm,
    "load_friction": _load,
    "payload": _payload,
    "rotor_inertia": _rotor,
    "stribeck_friction": _stribeck,
    "torque_constant": _gain,
    "torque_limit": _limit,
    "torque_offset": _torque,
    "torque_ripple": _wave,
    "transmission_error": _wave,
    "viscous_friction": _viscous,
}
