"""A run that has not been made yet: what sensors would say of a robot along a planned motion, and how well they would.

No engine moves it. The motors are where the plan says; the command is what a controller needs for that, noise is what
the recorded runs had at each frequency.
"""

from __future__ import annotations

import math
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.controller import feedforward_along
from ..motion import MotionLaw
from ..recording import Run
from ..representation import Robot
from .evidence import REST, Channel, Evidence, frequencies_of
from .inverse import said
from .model import Rows
from .prepare import CREEP, HIGHEST_BAND, KEPT, Prepared
from .problem import Problem
from .sensed import noise_in

Vector = NDArray[np.float64]

# samples a period of the band's end, and bounds of their rate [Hz]
FINE, SLOWEST, FASTEST = 5.0, 100.0, 250.0
# what a motion stirs up lies below so many times its own highest frequency
HARMONICS = 4.0
# part of a motion's energy (of its accelerations) below its highest frequency
NEARLY_ALL = 0.99


def imagined(problem: Problem, law: MotionLaw, truth: Rows, *, rate: float | None = None) -> Problem:
    """The question that a run along a motion would put, if these rows were the truth.

    Args:
        problem: As the recorded runs put it; the next is made as that with most channels was.
        law: Motion of the motors.
        truth: Effects beside the known ones.
        rate: Of the grid [Hz]; None: as the motion needs it.

    Returns:
        The same question about one run; its residual for `truth` is next to 0.
    """
    evidence = problem.evidence
    place = template(evidence)
    recorded = evidence.runs[place].run
    robot, nominal = problem.robots(truth)[place], evidence.nominals[place]
    band = _band(law, problem)
    fs = rate or min(max(FINE * band, SLOWEST), FASTEST)
    t = np.arange(int(law.duration * fs + 1e-9) + 1) / fs
    q, dq, ddq = law.at(t)
    present = [name for name in ("tau", "tau_link", "q_link", "ee") if name in evidence.runs[place].measured]
    shapes = {name: (len(t), 3 if name == "ee" else law.n) for name in present}
    edge = int(np.ceil(1.5 * KEPT / band * fs))
    missing = {name: np.zeros(shape, dtype=bool) for name, shape in ({"q": q.shape} | shapes).items()}
    # nothing was measured that would show where arms begin
    plan = Prepared(_run(recorded, t, {"q": q}), t, 1.0 / fs, band, q, dq, ddq, {}, missing, edge)
    creep = _creep(recorded, band, dq)
    # what is to be asked for does not depend on the command
    plain = replace(plan, run=replace(plan.run, control=replace(recorded.control, mode="torque")))
    torque = said(robot, plain, nominal, creep)
    if recorded.control.mode == "torque":
        plan = replace(plan, measured={"tau_cmd": torque.tau})
    elif recorded.control.mode == "pd":
        # as it needs the motion's torque, with its own inertia of the motor sides
        needed = torque.tau - feedforward_along(nominal, recorded.control, q, dq, ddq)
        plan = replace(plan, run=_run(recorded, t, {"q": q} | _commanded(robot, recorded, t, q, dq, needed)))
    speech = said(robot, plan, nominal, creep)
    plan = replace(plan, measured={**plan.measured, **{name: getattr(speech, name) for name in present}})
    masks = _masks(plan, creep, present)
    channels, weights = _weights(evidence, place, plan)
    whole = Evidence(
        (plan,), (nominal,), channels, weights, (masks,), (creep,), (_mixes(evidence, plan),), (evidence.asks[place],)
    )
    return Problem(problem.database, problem.known, (problem.bodies[place],), whole)


def template(evidence: Evidence) -> int:
    """Number of the run with most channels, the first of these."""
    counts = [sum(channel.run == number for channel in evidence.channels) for number in range(len(evidence.runs))]
    return counts.index(max(counts))


def _run(recorded: Run, t: Vector, signals: dict[str, Vector]) -> Run:
    """A run as the next one would be recorded, as far as it matters here."""
    return replace(recorded, name="next", t=t, signals=signals, locked=(), left_out=())


def _band(law: MotionLaw, problem: Problem) -> float:
    """Up to which frequency it is worth looking [Hz]."""
    t = np.linspace(0.0, law.duration, max(512, int(law.duration * 100.0)))
    power = (np.abs(np.fft.rfft(law.at(t)[2], axis=0)) ** 2).sum(axis=1)
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    fastest = float(np.searchsorted(share, NEARLY_ALL)) / law.duration
    usual = float(np.mean([run.band for run in problem.evidence.runs]))
    rate = min(run.run.rate for run in problem.evidence.runs)
    return min(max(usual, HARMONICS * fastest), HIGHEST_BAND, 0.2 * rate)


def _creep(recorded: Run, band: float, dq: Vector) -> Vector:
    """Speed below which a joint counts as standing, as for recorded runs."""
    noise = noise_in(recorded, "q").sigma * 2.0 * np.pi * band * np.sqrt(2.0 * band / recorded.rate)
    return np.maximum(np.maximum(CREEP * np.abs(dq).max(axis=0), 3.0 * noise), 1e-9)


def _commanded(robot: Robot, recorded: Run, t: Vector, q: Vector, dq: Vector, needed: Vector) -> dict[str, Vector]:
    """The command that makes a controller ask for a torque along a motion: kp e + kd e' = torque, q_cmd = q + e."""
    signal: Any = import_module("scipy.signal")

    control = recorded.control
    kp = np.array(control.kp) * np.array(robot.kp_factor or [1.0] * robot.n)
    kd = np.array(control.kd) * np.array(robot.kd_factor or [1.0] * robot.n)
    h = float(t[1] - t[0])
    error, rate = np.zeros_like(q), np.zeros_like(q)
    for i in range(q.shape[1]):
        if kp[i] > 0.0:
            # the bilinear rule; settled at the start
            numerator, denominator = [h, h], [kp[i] * h + 2.0 * kd[i], kp[i] * h - 2.0 * kd[i]]
            begin = signal.lfilter_zi(numerator, denominator) * needed[0, i]
            error[:, i] = signal.lfilter(numerator, denominator, needed[:, i], zi=begin)[0]
        if kd[i] > 0.0:
            rate[:, i] = (needed[:, i] - kp[i] * error[:, i]) / kd[i]
    return {"q_cmd": q + error, "dq_cmd": dq + rate}


def _masks(plan: Prepared, creep: Vector, present: list[str]) -> dict[str, Vector]:
    """What counts: no edges, and no torque of a joint around a turn or a rest, as of recorded runs.

    Nor that of one that stands all the time: what friction holds there is not known before it has been recorded.
    """
    ndimage: Any = import_module("scipy.ndimage")

    whole = np.ones(plan.q.shape)
    whole[: plan.edge] = whole[len(whole) - plan.edge :] = 0.0
    stands = np.abs(plan.dq) < creep
    turns = np.zeros_like(stands)
    turns[1:] = np.diff(np.signbit(plan.dq), axis=0)
    period = 1.0 / (plan.band * plan.h)
    rests = ndimage.binary_opening(stands, np.ones((max(3, int(REST / plan.h)), 1), dtype=bool))
    unsure = np.zeros_like(stands)
    for flags, samples in ((stands | turns, 0.5 * period), (rests, period)):
        around = np.ones((2 * math.ceil(samples) + 1, 1), dtype=bool)
        unsure |= np.asarray(ndimage.binary_dilation(flags, around))
    masks = dict.fromkeys(present, whole) | dict.fromkeys(("tau", "u"), np.where(unsure, 0.0, whole))
    if "ee" in present:
        masks["ee"] = np.repeat(whole[:, :1], 3, axis=1)
    return masks


def _weights(evidence: Evidence, place: int, plan: Prepared) -> tuple[tuple[Channel, ...], Vector]:
    """Channels of the recorded runs, with the noise that these had at each frequency."""
    f = frequencies_of(plan)
    power: dict[tuple[str, int], list[Vector]] = {}
    # an experiment is judged without orientations
    wanted = {(c.signal, c.index) for c in evidence.channels if c.run == place and c.signal != "ee_rot"}
    for channel in evidence.channels:
        if (channel.signal, channel.index) not in wanted:
            continue
        run = evidence.runs[channel.run]
        variance = run.h / evidence.weights[channel.first : channel.last] ** 2
        known = frequencies_of(run)
        # beyond what was compared, noise grows as that of accelerations does at most
        beyond = np.maximum(f / max(float(known[-1]), 1e-9), 1.0) ** 4
        level: Vector = np.asarray(np.interp(f, known, variance), dtype=float)
        power.setdefault((channel.signal, channel.index), []).append(level * beyond / plan.h)
    channels: list[Channel] = []
    weights: list[Vector] = []
    for number, ((signal, index), levels) in enumerate(sorted(power.items())):
        channels.append(Channel(0, signal, index, number * len(f), (number + 1) * len(f)))
        weights.append(1.0 / np.sqrt(np.mean(levels, axis=0)))
    return tuple(channels), np.concatenate(weights)


def _mixes(evidence: Evidence, plan: Prepared) -> dict[int, Vector]:
    """What of the noise of "tau" is in "u" at each frequency, as in the recorded runs."""
    f = frequencies_of(plan)
    found: dict[int, list[Vector]] = {}
    for run, mixes in zip(evidence.runs, evidence.mixes, strict=True):
        for joint, mix in mixes.items():
            found.setdefault(joint, []).append(np.asarray(np.interp(f, frequencies_of(run), mix), dtype=float))
    return {joint: np.mean(levels, axis=0) for joint, levels in found.items()}
