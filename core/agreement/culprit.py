"""Who is wrong and what it looks like: from the pattern of the numbers to a plain sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..representation import ArmSpring, Robot, Spring
from ..simulation.backend import Vector
from .compare import Figure, Order
from .drive_faults import acceleration_look, armature_look, torque_look
from .exercise import exercise_ends
from .gates import GATES
from .geometry_faults import geometry_look
from .inertia_faults import inertia_look
from .look import Look, brief, listed
from .origin import build_faults, reader_faults
from .quantities import States
from .reference import Tables, out_and_back
from .run_faults import order_look, run_look, shift_text, time_shift
from .runs import Run
from .scenarios import SCENARIOS, Scenario

if TYPE_CHECKING:
    from ..database import Database

TABLES = "tables"
"""Name of the fifth voice."""

Place = Literal["export", "reader", "build", "common", "motion", "open"]

WORDS = {
    "tool_position": "tool position",
    "tool_orientation": "tool orientation",
    "mass_matrix": "mass matrix",
    "gravity": "gravity torque",
    "bias": "torque of gravity, Coriolis and centrifugal forces",
    "inverse_dynamics": "inverse dynamics",
    "motor_inertia": "motor-side inertia",
    "drive_torque": "torque of the drives",
    "acceleration": "acceleration as it runs",
    "static_sag": "static sag",
    "knots": "motion at its knots",
    "followed": "followed motion",
    "control_torque": "controller's torque",
    "imposed_torque": "drives' torque",
    "imposed_tip": "tool path",
    "rigid_loop_tip": "tool path",
    "compliant_tip": "tool path",
    "loop_tip": "tool path",
    "friction_tip": "tool path",
    "stick_tip": "tool path",
    "deflection": "deflection of the joints",
}
"""Signals in words."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One disagreement, explained.

    Attributes:
        voices: Who is wrong.
        where: "export" (one engine or what some share), "reader", "build", "common" (all engines, after the build),
            "motion" (the command itself), "open" (it cannot be told who is right).
        kind: What it looks like, in a word or two.
        at: Where in the robot: "arm_3", "joint_2", "robot" ...
        sentence: All of it for a reader.
    """

    voices: tuple[str, ...]
    where: Place
    kind: str
    at: str
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """All that was measured.

    Attributes:
        labels: Voice to its name in sentences, the fifth voice first where it speaks.
        robot: The representation.
        database: What the reader made of the tables.
        tables: The fifth voice, with its effects.
        bare: The tables without effects.
        without: Effect to the tables without it.
        states, answers: What was asked at rest, and voice to quantity to values.
        runs: Scenario's name to it and its runs.
        figures, orders: What was compared.
    """

    labels: Mapping[str, str]
    robot: Robot
    database: Database | None
    tables: Tables | None
    bare: Tables | None
    without: Mapping[str, Callable[[], Tables]]
    states: States
    answers: Mapping[str, Mapping[str, Vector]]
    runs: Mapping[str, tuple[Scenario, Sequence[Run]]]
    figures: Sequence[Figure]
    orders: Sequence[Order]

    @property
    def engines(self) -> tuple[str, ...]:
        """All voices but the fifth."""
        return tuple(voice for voice in self.labels if voice != TABLES)


@dataclass(slots=True)
class _Charge:
    """What one voice, or all engines together, is charged with."""

    look: Look
    worst: Figure | None
    common: bool = False
    open: bool = False
    voices: list[str] = field(default_factory=list[str])


def find(evidence: Evidence) -> tuple[Finding, ...]:
    """A finding for every disagreement, those with the same look told once."""
    charges: dict[tuple[str, str, bool], _Charge] = {}
    accused: set[str] = set()

    def charge(voices: Iterable[str], look: Look, worst: Figure | None, *, common: bool, undecided: bool) -> None:
        entry = charges.setdefault((look.kind, look.text, common), _Charge(look, worst, common, undecided))
        entry.voices += [voice for voice in voices if voice not in entry.voices]
        accused.update(voices)

    for signals, asks in _STATIC_GROUPS:
        failed = [f for f in evidence.figures if f.scenario == "statics" and f.signal in signals and not f.passed]
        before = set(accused)
        for signal in signals:
            of_signal = [figure for figure in failed if figure.signal == signal]
            if not of_signal:
                continue
            odd, trusted, common, undecided = judge(evidence, "statics", signal)
            for voice in odd[:1] if common else odd:
                others = set(odd) if common else {voice}
                if others & (accused if asks.alone else accused - before):
                    continue
                look = asks.look(evidence, voice, trusted, signal)
                worst = max(
                    (f for f in of_signal if {voice, trusted} == set(f.voices)), key=_excess, default=None
                ) or max(of_signal, key=_excess)
                charge(odd if common else [voice], look, worst, common=common, undecided=undecided)
    _charge_motions(evidence, charge)
    _charge_runs(evidence, charge, accused)
    for order in evidence.orders:
        if not order.passed and order.voice not in accused:
            charge([order.voice], order_look(order), None, common=False, undecided=False)
    return tuple(_told(evidence, entry) for entry in charges.values())


def _excess(figure: Figure) -> float:
    return figure.value / figure.gate if figure.gate > 0 else np.inf


def judge(evidence: Evidence, scenario: str, signal: str) -> tuple[list[str], str, bool, bool]:
    """Who is odd in a signal: (odd voices, one trusted voice, common to all engines, cannot be told).

    The largest set of voices that all agree is trusted; the one with the tables among equals. Engines that agree with
    one another and not with the tables share a fault that lies before them.
    """
    figures = [figure for figure in evidence.figures if figure.scenario == scenario and figure.signal == signal]
    voices = [voice for voice in evidence.labels if any(voice in figure.voices for figure in figures)]
    apart = {frozenset(figure.voices) for figure in figures if not figure.passed}

    def agree(group: Sequence[str]) -> bool:
        return not any(frozenset(pair) in apart for pair in combinations(group, 2))

    groups = chain.from_iterable(combinations(voices, size) for size in range(len(voices), 0, -1))
    agreeing = [group for group in groups if agree(group)]
    largest = [group for group in agreeing if len(group) == len(agreeing[0])]
    best = next((group for group in largest if TABLES in group), largest[0])
    engines = [voice for voice in voices if voice != TABLES]
    if TABLES in voices and agree(engines) and TABLES not in best and len(best) == len(engines):
        return engines, TABLES, True, False
    odd = [voice for voice in voices if voice not in best]
    undecided = len(largest) > 1 and TABLES not in best
    return odd, best[0], False, undecided


@dataclass(frozen=True, slots=True)
class _Asks:
    """How one group of static quantities is looked at.

    Attributes:
        look: (evidence, odd voice, trusted voice, signal) -> what it looks like.
        alone: Only for voices that nothing before explains.
    """

    look: Callable[[Evidence, str, str, str], Look]
    alone: bool


def _geometry(evidence: Evidence, odd: str, trusted: str, signal: str) -> Look:
    model = evidence.tables
    answers = evidence.answers[odd]
    if model is None or "tool_position" not in answers or "tool_orientation" not in answers:
        return Look("frame", "robot", f"its {WORDS[signal]} differs")
    seen = np.zeros((len(answers["tool_position"]), 4, 4))
    seen[:, :3, 3], seen[:, :3, :3] = answers["tool_position"], answers["tool_orientation"]
    seen[:, 3, 3] = 1.0
    if not np.isfinite(seen).all():
        return Look("unknown", "robot", "its tool poses are no numbers")
    return geometry_look(model, evidence.robot, evidence.states.q, seen, evidence.without)


def _inertia(evidence: Evidence, odd: str, trusted: str, signal: str) -> Look:
    model, answers = evidence.tables, evidence.answers[odd]
    if signal in ("bias", "inverse_dynamics"):
        return Look("bias", "robot", "its Coriolis and centrifugal torques differ though mass matrix and gravity agree")
    if model is None or "mass_matrix" not in answers or "gravity" not in answers:
        return Look("inertia", "robot", f"its {WORDS[signal]} differs")
    return inertia_look(
        model, evidence.robot, evidence.states.q, answers["mass_matrix"], answers["gravity"], evidence.without
    )


def _as_told(evidence: Evidence) -> Robot:
    """The representation with the drives' numbers as the tables have them."""
    tables = evidence.tables
    if tables is None or tables.drives_unsaid:
        return evidence.robot
    stages = list(evidence.robot.stages)
    for i, stage in enumerate(stages):
        gap = stage.drive.spring.gap if stage.drive.spring else 0.0
        elastic = bool(np.isfinite(tables.stiffness[i]))
        held = (ArmSpring(float(tables.spring[i]), float(tables.rest[i])),) if tables.spring[i] else ()
        drive = replace(
            stage.drive,
            inertia=float(tables.motor_inertia()[i]),
            spring=Spring(float(tables.stiffness[i]), float(tables.damping[i]), gap) if elastic else None,
            damping=float(tables.viscous[i]),
            arm_springs=held,
        )
        stages[i] = replace(stage, drive=drive)
    return replace(evidence.robot, stages=tuple(stages))


def _armature(evidence: Evidence, odd: str, trusted: str, signal: str) -> Look:
    return armature_look(_as_told(evidence), evidence.answers[trusted][signal][0], evidence.answers[odd][signal][0])


def _drive(evidence: Evidence, odd: str, trusted: str, signal: str) -> Look:
    answers = evidence.answers
    return torque_look(_as_told(evidence), evidence.states, answers[trusted][signal], answers[odd][signal])


def _acceleration(evidence: Evidence, odd: str, trusted: str, signal: str) -> Look:
    expected, seen = evidence.answers[trusted][signal], evidence.answers[odd][signal]
    if evidence.tables is None:
        return Look("unknown", "robot", "its integrator moves otherwise than its own model says")
    return acceleration_look(evidence.tables, _as_told(evidence), evidence.states, expected, seen)


def _sag(evidence: Evidence, odd: str, trusted: str, signal: str) -> Look:
    return Look("stiffness", "robot", "its static sag differs though gravity and springs agree")


_STATIC_GROUPS: tuple[tuple[tuple[str, ...], _Asks], ...] = (
    (("tool_position", "tool_orientation"), _Asks(_geometry, False)),
    (("mass_matrix", "gravity", "bias", "inverse_dynamics"), _Asks(_inertia, True)),
    (("motor_inertia",), _Asks(_armature, True)),
    (("drive_torque",), _Asks(_drive, False)),
    (("acceleration",), _Asks(_acceleration, True)),
    (("static_sag",), _Asks(_sag, True)),
)


def _charge_motions(evidence: Evidence, charge: Callable[..., None]) -> None:
    """Motions read otherwise than their tables have them."""
    for figure in evidence.figures:
        if figure.signal == "knots" and not figure.passed:
            name = figure.voices[1]
            text = f"the {name} is read otherwise than its table has it, by up to {brief(figure.value)} rad (or m)"
            look = Look("time shift", figure.at, text)
            charge([name], look, figure, common=True, undecided=False)


def _charge_runs(evidence: Evidence, charge: Callable[..., None], accused: set[str]) -> None:
    """Runs that differ where nothing at rest did: the first scenario in which a voice is odd tells."""
    for name in SCENARIOS:
        failed = [figure for figure in evidence.figures if figure.scenario == name and not figure.passed]
        if not failed or name not in evidence.runs:
            continue
        scenario, runs = evidence.runs[name]
        for signal in dict.fromkeys(figure.signal for figure in failed):
            odd, trusted, common, undecided = judge(evidence, name, signal)
            for voice in odd[:1] if common else odd:
                if voice in accused:
                    continue
                worst = max((f for f in failed if f.signal == signal and voice in f.voices), key=_excess)
                look = _run_look(evidence, scenario, runs, voice, trusted, signal)
                charge(odd if common else [voice], look, worst, common=common, undecided=undecided)


def _run_look(
    evidence: Evidence, scenario: Scenario, runs: Sequence[Run], voice: str, trusted: str, signal: str
) -> Look:
    of_voice = [run for run in runs if run.voice == voice and not run.half]
    if not of_voice:
        return Look("unknown", "robot", "it gives no run")
    odd = of_voice[0]
    if signal in ("followed", "control_torque"):
        return _command_look(scenario, odd, signal)
    others = [run for run in runs if run.voice == trusted and not run.half]
    if not others:
        return Look("unknown", "robot", f"its {WORDS[signal]} differs")
    if signal == "imposed_torque":
        return Look("armature", "robot", "the torques of its drives differ along the motion")
    passed_whole = all(
        figure.passed
        for figure in evidence.figures
        if figure.scenario == scenario.name and voice in figure.voices and figure.manner == "first"
    )
    if passed_whole and len(of_voice) > 1:
        odd = of_voice[1]
    return run_look(scenario, odd, others[-1])


def _command_look(scenario: Scenario, odd: Run, signal: str) -> Look:
    """Motion or torque against the command as the fifth voice has it."""
    start, turn = exercise_ends(scenario.robot, scenario.duration)
    q, dq = out_and_back(odd.t, start, turn, scenario.duration)
    if scenario.motion_name != "exercise":
        # only knots are known of it: the law itself is what was meant between them
        q = scenario.motion.at(odd.t)[0]
    if signal == "followed":
        late = time_shift(odd, replace(odd, theta=q, q_link=q))
    else:
        # torque = kp (q(t - late) - theta) + ...: the missing part is -late (kp dq + kd ddq)
        kp, kd = np.array(scenario.control.kp), np.array(scenario.control.kd)
        missing = odd.tau - kp * (q - odd.theta) - kd * (dq - odd.dtheta)
        rate = kp * dq + kd * np.gradient(dq, odd.t, axis=0)
        peak = np.maximum(np.max(np.abs(rate), axis=0), 1e-300)
        missing, rate = (missing / peak).ravel(), (rate / peak).ravel()
        late = -float(rate @ missing) / float(rate @ rate)
        if float(np.linalg.norm(missing + late * rate)) > 0.3 * float(np.linalg.norm(missing)):
            late = None
    if late is None:
        what = "the motor sides do not follow" if signal == "followed" else "the controller does not obey"
        return Look("command", "robot", f"{what} the command")
    return Look("time shift", "robot", shift_text(late, scenario, odd.step))


def _told(evidence: Evidence, entry: _Charge) -> Finding:
    """The charge as a sentence, with where the fault lies."""
    look, worst = entry.look, entry.worst
    names = [evidence.labels.get(voice, voice) for voice in entry.voices]
    motion = look.kind in ("time shift", "command") and (worst is None or worst.scenario != "statics")
    if entry.common and worst is not None and worst.signal == "knots":
        where, place = _before(evidence, motion=True)
        subject = "The reader"
    elif entry.common:
        where, place = ("motion", _COMMAND) if motion else _before(evidence, motion=False)
        subject = "All engines alike"
    elif entry.open:
        where, place = "open", "With these voices alone it cannot be told who is right."
        subject = f"Either {listed(names)} or the others"
    else:
        where = "export"
        single = len(names) == 1
        place = (
            f"The fault lies in {'its' if single else 'what their'} export{' or its engine' if single else 's share'}."
        )
        if single and _only_engine(evidence, entry.voices[0]):
            found, told = _before(evidence, motion=False)
            if found != "common":
                where, place = found, told
        subject = listed(names)
    figures = f" ({_figure_text(worst)})" if worst is not None else ""
    return Finding(tuple(entry.voices), where, look.kind, look.at, f"{subject}: {look.text}{figures}. {place}")


_COMMAND = "The fault lies before the emitters: in the motion law or in how a run samples it."


def _only_engine(evidence: Evidence, voice: str) -> bool:
    return evidence.engines == (voice,)


def _figure_text(figure: Figure) -> str:
    unit = {"1": "", "m": " m", "rad": " rad"}[GATES[figure.signal].unit]
    value = f"{figure.value:.1e}{unit}" if np.isfinite(figure.value) else "no number"
    scenario = "" if figure.scenario == "statics" else f"{SCENARIOS[figure.scenario]}, "
    return f"{scenario}{WORDS[figure.signal]} off by {value}, gate {figure.gate:.1e}"


def _before(evidence: Evidence, *, motion: bool) -> tuple[Place, str]:
    """Where before the emitters a common fault lies."""
    if evidence.tables is not None and evidence.bare is not None and evidence.database is not None:
        read = list(reader_faults(evidence.bare, evidence.tables, evidence.database))
        if read:
            return "reader", f"The fault lies before the emitters, in the reader: {_some(read)}."
        if motion:
            return "motion", _COMMAND
        built = list(build_faults(evidence.tables, evidence.robot))
        if built:
            return "build", f"The fault lies before the emitters, in the build: {_some(built)}."
    text = "The fault lies before the emitters, after the representation was built: in what all of them share."
    return "common", text


def _some(clauses: Sequence[str]) -> str:
    more = f"; and {len(clauses) - 3} more" if len(clauses) > 3 else ""
    return "; ".join(clauses[:3]) + more
