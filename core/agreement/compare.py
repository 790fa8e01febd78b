"""Every voice against every other: the worst difference of a quantity, where it is, and its gate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..motion import MotionLaw
from ..simulation.backend import Vector
from .exercise import exercise_ends
from .gates import OPEN, ORDER_FLOOR, ORDER_TOLERANCE, PAPER_REACH, Manner, limit
from .quantities import scales
from .reference import Tables, out_and_back
from .runs import Run
from .scenarios import Scenario

# joints whose torque stays below this part of the largest are judged by that part
SMALL = 1.0e-3
# two instants closer than this are one [s]
INSTANT = 1.0e-9


@dataclass(frozen=True, slots=True)
class Figure:
    """One comparison of two voices.

    Attributes:
        scenario: "statics", or the name of the run.
        signal: What is compared; its gate's name.
        voices: The two.
        value: Worst difference, in the gate's unit (relative ones are plain numbers); inf where one has no answer.
        gate: The largest that passes.
        manner: How the less exact of the two came to its numbers.
        at: Worst joint, or pair of joints of a matrix; "" where there is none.
        instant: Worst state's number (statics), or time [s].
    """

    scenario: str
    signal: str
    voices: tuple[str, str]
    value: float
    gate: float
    manner: Manner
    at: str
    instant: float

    @property
    def passed(self) -> bool:
        """The difference is within its gate."""
        return self.value <= self.gate


@dataclass(frozen=True, slots=True)
class Order:
    """Observed order of convergence of a first-order integrator in one run.

    Attributes:
        scenario: Name of the run.
        voice: Whose.
        against: The voice of higher order that its errors are taken from.
        steps: Larger and smaller step [s].
        errors: Of the tool's position there [m].
        order: log2 of their ratio.
        judged: The errors are far enough above what no step removes, and the equations smooth in this run.
    """

    scenario: str
    voice: str
    against: str
    steps: tuple[float, float]
    errors: tuple[float, float]
    order: float
    judged: bool

    @property
    def passed(self) -> bool:
        """Of order one, or not to be judged."""
        return not self.judged or abs(self.order - 1.0) <= ORDER_TOLERANCE


def joint(number: int) -> str:
    """Name of a joint from its index."""
    return f"joint_{number + 1}"


def compare_statics(answers: Mapping[str, Mapping[str, Vector]], reach: float) -> list[Figure]:
    """Figures of all pairs, the first voice's answers giving the scale.

    Args:
        answers: Voice to quantity to values; the first index counts the states.
        reach: Of the robot [m].
    """
    figures: list[Figure] = []
    for a, b in combinations(answers, 2):
        by = scales(answers[a])
        for signal in answers[a]:
            if signal in answers[b]:
                value, at, state = static_difference(signal, answers[a][signal], answers[b][signal], by)
                gate = limit(signal, ("algebra", "algebra"), reach=reach, step=0.0)
                figures.append(Figure("statics", signal, (a, b), value, gate.value, "algebra", at, float(state)))
    return figures


def static_difference(signal: str, a: Vector, b: Vector, by: Mapping[str, Vector]) -> tuple[float, str, int]:
    """Worst difference of two answers, the joint (or pair) and the state where it is."""
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        state = int(np.argmin(np.isfinite(a + b).reshape(len(a), -1).all(axis=1)))
        return math.inf, "", state
    if signal == "tool_position":
        distance = np.linalg.norm(a - b, axis=-1)
        return float(distance.max()), "", int(distance.argmax())
    if signal == "tool_orientation":
        angle = turned_by(a, b)
        return float(angle.max()), "", int(angle.argmax())
    scale = np.broadcast_to(by[signal], a.shape)
    # what is zero for the trusted voice is judged by what the other makes of it
    own = np.max(np.abs(b), axis=0)
    safe = np.where(scale > 0.0, scale, np.where(own > 0.0, own, 1.0))
    ratio = np.abs(a - b) / safe
    where = np.unravel_index(int(ratio.argmax()), ratio.shape)
    index = [int(i) for i in where]
    return float(ratio[where]), _place(signal, index, a.shape), index[0]


def _place(signal: str, index: Sequence[int], shape: tuple[int, ...]) -> str:
    if signal == "mass_matrix":
        i, j = sorted(index[1:])
        return joint(i) if i == j else f"{joint(i)}, {joint(j)}"
    if signal in {"drive_torque", "acceleration"}:
        n = shape[-1] // 2
        return f"{joint(index[1] % n)}, {'arm' if index[1] < n else 'motor'} side"
    return joint(index[1])


def turned_by(a: Vector, b: Vector) -> Vector:
    """Angle between orientations [rad], shape (m,); exact for small ones."""
    chord = np.linalg.norm(a - b, axis=(-2, -1)) / (2.0 * math.sqrt(2.0))
    return 2.0 * np.arcsin(np.clip(chord, 0.0, 1.0))


def compare_runs(scenario: Scenario, runs: Sequence[Run], reach: float) -> list[Figure]:
    """Figures of all pairs of runs, and of those by themselves against the command.

    Args:
        scenario: What was run.
        runs: Of each voice, first-order ones at two steps and extrapolated.
        reach: Of the robot [m].
    """
    figures: list[Figure] = []
    whole = [run for run in runs if not run.half]
    exact = _exact_enough(scenario, whole, reach)
    for a, b in combinations(whole, 2):
        if a.voice == b.voice or {a.manner, b.manner} == {"first", "extrapolated"}:
            continue
        narrow = "explicit" not in (a.manner, b.manner) or a.voice in exact or b.voice in exact
        of_pair = _compare_two(scenario, a, b, reach, narrow=narrow)
        if (a.knocks or b.knocks) and not all(figure.passed for figure in of_pair):
            at_half = _compare_halves(scenario, runs, (a.voice, b.voice), reach)
            of_pair = [x if x.passed else at_half.get(x.signal, x) for x in of_pair]
        figures += [figure for figure in of_pair if figure not in figures]
    return figures


def _compare_two(scenario: Scenario, a: Run, b: Run, reach: float, *, narrow: bool) -> list[Figure]:
    """Figures of one pair of runs."""
    figures: list[Figure] = []
    manners: tuple[Manner, Manner] = (a.manner, b.manner)
    step = max((run.step for run in (a, b) if run.manner == "first"), default=0.0)
    pair = (a.voice, b.voice)
    gate = limit(scenario.tip, manners, reach=reach, step=step, narrow=narrow)
    at, value, t = _worst_tip(a, b, reach, scenario)
    figures.append(Figure(scenario.name, scenario.tip, pair, value, gate.value, gate.manner, at, t))
    if any(scenario.elastic):
        bend = limit("deflection", manners, reach=reach, step=step)
        value, allowed, at, t = _worst_deflection(a, b, bend.value, bend.absolute * _lengths(scenario, reach))
        figures.append(Figure(scenario.name, "deflection", pair, value, allowed, bend.manner, at, t))
    elif not scenario.integrated:
        torque = limit("imposed_torque", manners, reach=reach, step=step)
        value, at, t = _worst_torque(a, b)
        figures.append(Figure(scenario.name, "imposed_torque", pair, value, torque.value, torque.manner, at, t))
    return figures


def _compare_halves(scenario: Scenario, runs: Sequence[Run], pair: tuple[str, str], reach: float) -> dict[str, Figure]:
    """Signal to figure of two voices whose play opens and closes, at half their steps; none where one has no such run.

    The gate is the pair's own and OPEN times what halving their steps changed.
    """
    half = [run for voice in pair for run in runs if run.voice == voice and run.half]
    whole = [
        run for voice in pair for run in runs if run.voice == voice and not run.half and run.manner != "extrapolated"
    ]
    if len(half) < len(pair) or len(whole) < len(pair):
        return {}
    a, b = half
    manners: tuple[Manner, Manner] = (a.manner, b.manner)
    step = max((run.step for run in half if run.manner == "first"), default=0.0)
    gate = limit(scenario.tip, manners, reach=reach, step=step)
    allowed = gate.value + OPEN * sum(_tip_distance(x, y) for x, y in zip(whole, half, strict=True))
    at, value, t = _worst_tip(a, b, reach, scenario)
    found = {scenario.tip: Figure(scenario.name, scenario.tip, pair, value, allowed, "halved", at, t)}
    bend = limit("deflection", manners, reach=reach, step=step)
    absolute = bend.absolute * _lengths(scenario, reach)
    for x, y in zip(whole, half, strict=True):
        absolute += OPEN * np.max(np.abs(x.q_link - x.theta - y.q_link + y.theta), axis=0)
    value, allowed, at, t = _worst_deflection(a, b, bend.value, absolute)
    found["deflection"] = Figure(scenario.name, "deflection", pair, value, allowed, "halved", at, t)
    return found


def _lengths(scenario: Scenario, reach: float) -> Vector:
    """What an absolute part of a gate is multiplied by at each joint: slides scale with the robot, shape (n,)."""
    slides = np.array([stage.joint.kind == "prismatic" for stage in scenario.robot.stages])
    return np.where(slides, reach / PAPER_REACH, 1.0)


def _exact_enough(scenario: Scenario, runs: Sequence[Run], reach: float) -> set[str]:
    """Voices of higher order that an extrapolated run can be held against by its own gate.

    That is the one nearest to it, and those that agree with that one within the gate: where they differ by more, it is
    their own step that shows, and the wider gate of the two counts.
    """
    explicit = [run for run in runs if run.manner == "explicit" and np.isfinite(run.tip).all()]
    allowed = limit(scenario.tip, ("extrapolated", "extrapolated"), reach=reach, step=0.0).value
    exact: set[str] = set()
    for run in runs:
        if run.manner == "extrapolated" and np.isfinite(run.tip).all() and explicit:
            nearest = min(explicit, key=lambda other, run=run: _tip_distance(run, other))
            exact |= {other.voice for other in explicit if _tip_distance(nearest, other) <= allowed}
    return exact


def _worst_tip(a: Run, b: Run, reach: float, scenario: Scenario) -> tuple[str, float, float]:
    """Joint that moves the tool most there, distance [m], time [s]."""
    if not (np.isfinite(a.tip).all() and np.isfinite(b.tip).all()):
        bad = ~np.isfinite(a.tip + b.tip).all(axis=1)
        return "", math.inf, float(a.t[int(np.argmax(bad))])
    distance = np.linalg.norm(a.tip - b.tip, axis=1)
    k = int(distance.argmax())
    lever = np.array([1.0 if stage.joint.kind == "prismatic" else reach for stage in scenario.robot.stages])
    moved = np.abs(a.q_link[k] - b.q_link[k]) * lever
    return (joint(int(moved.argmax())) if moved.any() else ""), float(distance[k]), float(a.t[k])


def _worst_deflection(a: Run, b: Run, relative: float, absolute: Vector) -> tuple[float, float, str, float]:
    """Relative difference, its gate, joint, time [s]: where the difference over its gate is largest."""
    bent_a, bent_b = a.q_link - a.theta, b.q_link - b.theta
    if not np.isfinite(bent_a + bent_b).all():
        return math.inf, relative, "", float(a.t[int(np.argmax(~np.isfinite(bent_a + bent_b).all(axis=1)))])
    peak = np.max(np.abs(bent_a), axis=0)
    ratio = np.abs(bent_a - bent_b) / (relative * peak + absolute)
    k, i = (int(x) for x in np.unravel_index(int(ratio.argmax()), ratio.shape))
    if peak[i] == 0.0:
        # a rigid joint among elastic ones
        return float(ratio[k, i] * relative), relative, joint(i), float(a.t[k])
    gate = relative + float(absolute[i] / peak[i])
    return float(ratio[k, i] * gate), gate, joint(i), float(a.t[k])


def _worst_torque(a: Run, b: Run) -> tuple[float, str, float]:
    """Difference of the drives' torques over the joint's peak, joint, time [s]."""
    if not np.isfinite(a.tau + b.tau).all():
        return math.inf, "", float(a.t[int(np.argmax(~np.isfinite(a.tau + b.tau).all(axis=1)))])
    peak = np.max(np.abs(a.tau), axis=0)
    ratio = np.abs(a.tau - b.tau) / np.maximum(np.maximum(peak, SMALL * float(peak.max())), 1e-300)
    k, i = (int(x) for x in np.unravel_index(int(ratio.argmax()), ratio.shape))
    return float(ratio[k, i]), joint(i), float(a.t[k])


def compare_commands(scenario: Scenario, runs: Sequence[Run], voice: str) -> list[Figure]:
    """What the drives followed, held against the command as the fifth voice has it: place, and torque of the loop.

    A shift of the reference that all engines share shows here and nowhere else.

    Args:
        scenario: What was run, on the exercise.
        runs: Of each voice.
        voice: Name of the fifth voice.
    """
    start, turn = exercise_ends(scenario.robot, scenario.duration)
    elastic = np.array(scenario.elastic)
    judged = elastic if elastic.any() else ~elastic
    figures: list[Figure] = []
    for run in runs:
        if run.half or run.manner == "extrapolated":
            continue
        q, dq = out_and_back(run.t, start, turn, scenario.duration)
        if scenario.imposed:
            signal, error = "followed", np.where(judged, np.abs(run.theta - q), 0.0)
        else:
            kp, kd = np.array(scenario.control.kp), np.array(scenario.control.kd)
            torque = kp * (q - run.theta) + kd * (dq - run.dtheta)
            peak = np.max(np.abs(torque), axis=0)
            signal = "control_torque"
            error = np.abs(run.tau - torque) / np.maximum(np.maximum(peak, SMALL * float(peak.max())), 1e-300)
        k, i = (int(x) for x in np.unravel_index(int(np.argmax(error)), error.shape))
        gate = limit(signal, ("algebra", "algebra"), reach=PAPER_REACH, step=0.0)
        value = float(error[k, i]) if np.isfinite(error).all() else math.inf
        pair = (voice, run.voice)
        figures.append(Figure(scenario.name, signal, pair, value, gate.value, "algebra", joint(i), float(run.t[k])))
    return figures


def compare_knots(scenario: Scenario, runs: Sequence[Run], tables: Tables, voice: str) -> list[Figure]:
    """What the motor sides followed of a motion of the database, held against its table's text at its knots."""
    reported = any(stage.sensor.position_offset for stage in scenario.robot.stages)
    if scenario.motion_name not in tables.motions or reported:
        return []
    knots, positions = tables.motions[scenario.motion_name]
    judged = np.array(scenario.elastic)
    figures: list[Figure] = []
    for run in runs:
        if run.half or run.manner == "extrapolated" or not judged.any():
            continue
        nearest = np.clip(np.searchsorted(run.t, knots - INSTANT), 0, len(run.t) - 1)
        met = np.abs(run.t[nearest] - knots) < INSTANT
        if not met.any():
            continue
        error = np.where(judged, np.abs(run.theta[nearest[met]] - positions[met]), 0.0)
        k, i = (int(x) for x in np.unravel_index(int(np.argmax(error)), error.shape))
        gate = limit("followed", ("algebra", "algebra"), reach=PAPER_REACH, step=0.0)
        value = float(error[k, i]) if np.isfinite(error).all() else math.inf
        t = float(knots[met][k])
        figures.append(Figure(scenario.name, "followed", (voice, run.voice), value, gate.value, "algebra", joint(i), t))
    return figures


def plainly_controlled(scenario: Scenario) -> bool:
    """The loop's torque is kp (q_cmd - q) + kd (dq_cmd - dq), at once and whole, on the exercise."""
    robot, control = scenario.robot, scenario.control
    if scenario.motion_name != "exercise":
        return False
    reported = any(stage.sensor.position_offset or stage.sensor.torque_offset for stage in robot.stages)
    if scenario.imposed:
        return not reported
    cut = any(math.isfinite(stage.drive.torque_limit) for stage in robot.stages) or control.torque_limit
    other = robot.delay or robot.kp_factor or robot.kd_factor or control.feedforward != "none"
    return not (cut or other or reported)


def compare_motions(tables: Tables, laws: Mapping[str, MotionLaw], voice: str) -> list[Figure]:
    """The motions of the database at their knots, as read, held against the text of their tables."""
    figures: list[Figure] = []
    for name, (t, q) in tables.motions.items():
        if name in laws and laws[name].n == q.shape[1]:
            error = np.abs(laws[name].at(t)[0] - q)
            k, i = (int(x) for x in np.unravel_index(int(np.argmax(error)), error.shape))
            gate = limit("knots", ("algebra", "algebra"), reach=PAPER_REACH, step=0.0)
            pair = (voice, f"motion {name}")
            figures.append(
                Figure("statics", "knots", pair, float(error[k, i]), gate.value, "algebra", joint(i), float(t[k]))
            )
    return figures


def orders(scenario: Scenario, runs: Sequence[Run]) -> list[Order]:
    """Observed orders of the first-order voices of a run whose equations are smooth."""
    exact = [run for run in runs if run.manner == "explicit"] or [run for run in runs if run.manner == "implicit"]
    if not exact or not scenario.ordered:
        return []
    trusted = exact[0]
    floor = max((_tip_distance(trusted, run) for run in exact[1:]), default=0.0)
    floor = max(floor, 1e-13 * float(np.max(np.abs(trusted.tip))))
    found: list[Order] = []
    for whole in (run for run in runs if run.manner == "first" and not run.half):
        halves = [run for run in runs if run.voice == whole.voice and run.half]
        if not halves:
            continue
        errors = (_tip_distance(whole, trusted), _tip_distance(halves[0], trusted))
        usable = math.isfinite(errors[0]) and errors[0] > 0.0 and errors[1] > 0.0
        order = math.log2(errors[0] / errors[1]) if usable else math.nan
        # where play opens and closes, equations are not smooth
        judged = usable and errors[1] > ORDER_FLOOR * floor and not (whole.knocks or trusted.knocks)
        steps = (whole.step, halves[0].step)
        found.append(Order(scenario.name, whole.voice, trusted.voice, steps, errors, order, judged))
    return found


def _tip_distance(a: Run, b: Run) -> float:
    return float(np.max(np.linalg.norm(a.tip - b.tip, axis=1)))
