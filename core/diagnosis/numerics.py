"""What is no physics, tried before any effect: our own step, and what no log says of its controller or its stamps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError
from ..expansion import expanded
from ..recording import Run
from ..representation import Robot
from ..simulation import Backend, backend_named
from ..simulation.step import choose_step, poses_of
from .compared import mode_of, residuals
from .noise import Noise, loudest
from .polish import MOST_STEPS
from .resimulate import each_simulated, resimulated, resimulated_once, steps_of
from .stamps import TORQUES
from .suspect import (
    COARSE_STEPS,
    DIFFERENCES,
    FASTER,
    LATE,
    LATE_TORQUE,
    NO_HOLD,
    Suspect,
    fine_steps,
    held_command,
    late_speeds,
    without_hold,
)

Vector = NDArray[np.float64]
Left = TypeVar("Left")
# how much of a gap is no physics and cannot be put right
Numerical = Literal["none", "half", "all"]

# of a gap's energy along what a suspect changes, what makes it worth a closer look
WORTH = 0.5
# what a suspect must change, in standard deviations of all noise together, to be told at all
SEEN = 3.0
# so near to all of what a suspect changes is there, or it is another one; where one joint's positions are all, friction
# looks late or damped as well, but of any size
ABOUT, JUST = 0.5, 0.2
# of a gap's energy along a command that is held for two ticks, what makes it worth to ask for how many it is
HINT, HELD = 0.3, (2, 3, 4, 5, 8, 10)
# how late speeds may be, as differences over so many ticks, and how often that is asked anew
LATEST, CLOSER = 20.0, 3
# less late than that is on time, and so near to how late they are is near enough
LEAST_LATE, NEAR = 0.01, 0.02
# log evidence by which late speeds must be the likelier cause than a rotor
LIKELIER = 10.0
# part of a gap's energy that is left where it was no physics, and where half of it was
NUMERICAL, HALF = 0.1, 0.5
# the same where friction lags alike; a record may even show a held command's ripple as the torque of one
LAGGING = 0.02
# joints whose own gap is of one suspect, and so much of it, that tell it where another joint's drowns them
JOINTS, MOST = 3, 0.8
# standard deviations of noise's energy above it from which a joint has a gap
CLEARLY = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Numerics:
    """What is no physics in a gap.

    Attributes:
        step: Integration step [s].
        step_error: Signal -> rms of what half the step changes, a value a channel.
        hold_error: Signal -> rms of what a controller changes that ticks faster; {} where none ticks.
        notes: The same in sentences.
    """

    step: float
    step_error: Mapping[str, Vector]
    hold_error: Mapping[str, Vector]
    notes: tuple[str, ...]


def numerics(robot: Robot, nominal: Robot, run: Run, backend: Backend | str, noise: Noise) -> Numerics:
    """Try the integrator's step and the controller's hold on a run: two or three simulations.

    Args:
        robot: As the run is compared with.
        nominal: Whose rigid bodies the controller's feedforward knows.
        run: What was measured.
        backend: The engine.
        noise: Of the run.
    """
    engine = backend_named(backend) if isinstance(backend, str) else backend
    step = step_of(robot, run, engine)
    if run.locked:
        held = " and ".join(f"joint_{joint}" for joint in run.locked)
        return Numerics(step, {}, {}, (f"In {run.name} {held} is clamped: torques are compared along its motion.",))
    base = resimulated(robot, nominal, run, backend)
    step_error = _apart(base, resimulated_once(robot, nominal, run, engine, step=0.5 * step))
    hold_error: dict[str, Vector] = {}
    if run.control.mode == "pd":
        hold_error = _apart(base, resimulated(robot, nominal, without_hold(run), backend, begun=run))
    notes = [_said(f"Half the step ({0.5 * step!r} s) changes the simulation of {run.name}", step_error, noise)]
    if hold_error:
        notes.append(_said(f"A controller {FASTER} times as fast changes that of {run.name}", hold_error, noise))
    return Numerics(step, step_error, hold_error, tuple(notes))


def suspected(
    robots: Sequence[Robot], runs: Sequence[Run], backend: Backend | str, noises: Sequence[Noise], least: float
) -> tuple[Suspect | None, float]:
    """The suspect that leaves least of some runs' gap, and which part of its energy; None if none leaves little enough.

    It has to leave less than half, or next to nothing where friction would look alike. What acts in every joint
    alike is told by most joints, too, whatever else is in another.

    Args:
        robots: As known, one a run.
        runs: What was measured.
        backend: The engine.
        noises: Of the runs.
        least: Part that is left without one.
    """
    pairs = list(zip(robots, runs, strict=True))

    def left_of_all(suspect: Suspect) -> list[dict[str, Vector]]:
        return each_simulated(lambda pair: left_by(suspect, *pair, backend), pairs, backend)

    left = [residuals(run, resimulated(robot, robot, run, backend), robot) for robot, run in pairs]
    # without a torque friction that damps may look like half of a gap
    half = HALF if all(map(tells_torque, runs)) else NUMERICAL
    worst = loudest_of(left, noises)
    best, drowned = None, None
    for suspect in suspects(robots[worst], runs[worst], backend, noises[worst]):
        try:
            changed = left_of_all(suspect)
        except RefusedError:
            continue
        part = part_left(left, changed, noises)
        if part < min(least, LAGGING if suspect.lags else NUMERICAL if suspect.fitted else half):
            best, least = suspect, part
        if drowned is None and suspect.everywhere and _in_most_joints(left, changed, noises):
            drowned = suspect
    return (best, least) if best or not drowned else (drowned, HALF)


def loudest_of(left: Sequence[Mapping[str, Vector]], noises: Sequence[Noise]) -> int:
    """Which run's gap stands farthest above noise, from 0."""
    return max(range(len(left)), key=lambda k: loudest([left[k]], [noises[k]]))


def suspects(robot: Robot, run: Run, backend: Backend | str, noise: Noise) -> list[Suspect]:
    """What of this kind may be most of the run's gap, the likeliest first: a simulation of each tells.

    Args:
        robot: As it is known, and as the controller's feedforward knows it.
        run: What was measured.
        backend: The engine.
        noise: Of the run.
    """
    if mode_of(run) != "pd":
        return []

    def left_of(*some: Suspect) -> list[tuple[Suspect, dict[str, Vector]]]:
        return each_simulated(lambda suspect: (suspect, left_by(suspect, robot, run, backend)), some, backend)

    def along(after: Mapping[str, Vector]) -> tuple[float, float]:
        return _along(whole, _in_noise(after, noise))

    left = residuals(run, resimulated(robot, robot, run, backend), robot)
    whole = _in_noise(left, noise)
    tried = left_of(NO_HOLD, DIFFERENCES, COARSE_STEPS, LATE_TORQUE)
    _, (_, half_late), (_, one_step), _ = tried
    alone = run.n == 1 and not tells_torque(run)
    if not alone:
        tried += left_of(LATE, held_command(HELD[0]))
        if along(tried[-1][1])[0] > HINT:
            # a command is late by half of what it is held, and how long that is nobody said
            tried += left_of(*map(held_command, HELD[1:]))
    for kind, alike in ((late_speeds, half_late), (fine_steps, one_step)) if tells_torque(run) else ():
        share, ticks = along(alike)
        if not share > WORTH:
            continue
        # so late a controller may hold nothing
        with suppress(RefusedError):
            late = _as_late_as_they_are(kind, lambda one: left_by(one, robot, run, backend), along, min(ticks, LATEST))
            if late and not _rather_a_rotor(robot, robot, run, backend, noise, left, late):
                tried.append((kind(late[0]), late[1]))
    likely: list[tuple[float, Suspect]] = []
    for suspect, after in tried:
        share, amount = along(after)
        much = share > WORTH and abs(amount - 1.0) < (JUST if alone else ABOUT)
        if much or (suspect.everywhere and _in_most_joints([left], [after], [noise])):
            likely.append((float(np.sum(_in_noise(after, noise) ** 2)), suspect))
    return [suspect for _, suspect in sorted(likely, key=lambda one: one[0])]


def _as_late_as_they_are(
    kind: Callable[[float], Suspect],
    left_of: Callable[[Suspect], Left],
    along: Callable[[Left], tuple[float, float]],
    ticks: float,
    tries: int = CLOSER,
) -> tuple[float, Left] | None:
    """How late speeds are, as differences over so many ticks, and what they leave; None where the gap is not theirs.

    Args:
        kind: Of ticks, whose speeds are so late.
        left_of: What a suspect leaves.
        along: Part of the gap that lies along what changes where so much is left, and how much of that.
        ticks: A guess.
        tries: How often it may be mended.
    """
    after = left_of(kind(ticks))
    share, amount = along(after)
    if not share > WORTH:
        return None
    if tries == 1 or abs(amount - 1.0) < NEAR:
        return ticks, after
    return _as_late_as_they_are(kind, left_of, along, min(ticks * amount, LATEST), tries - 1)


def late_beside(
    robots: Sequence[Robot],
    nominals: Sequence[Robot],
    runs: Sequence[Run],
    backend: Backend | str,
    noises: Sequence[Noise],
    ticks: float,
) -> Suspect | None:
    """Speeds that are late beside effects, as the measured motion says, where that is most of what simulation leaves.

    Args:
        robots: With what was found, one a run.
        nominals: As known, one a run.
        runs: What was measured.
        backend: The engine.
        noises: Of the runs.
        ticks: How late along the measured motion, as differences over so many ticks.
    """
    if not LEAST_LATE < ticks < LATEST or any(mode_of(run) != "pd" for run in runs):
        return None
    triples = list(zip(robots, nominals, runs, strict=True))

    def left_of(suspect: Suspect) -> list[dict[str, Vector]]:
        return each_simulated(lambda one: left_by(suspect, one[0], one[2], backend, nominal=one[1]), triples, backend)

    try:
        # of what is so stiff nobody awaits whether speeds are late beside it
        if sum(steps_of(robot, run, backend) for robot, run in zip(robots, runs, strict=True)) > MOST_STEPS:
            return None
        before = each_simulated(lambda one: residuals(one[2], resimulated(*one, backend), one[0]), triples, backend)
    except RefusedError:
        return None
    worst = loudest_of(before, noises)
    noise = noises[worst]
    whole = _in_noise(before[worst], noise)
    if not _loudness(whole) > CLEARLY * np.sqrt(2.0 * len(whole)):
        return None
    best, least = None, HALF
    for kind in (late_speeds, fine_steps):
        with suppress(RefusedError):
            late = _as_late_as_they_are(
                kind, left_of, lambda after: _along(whole, _in_noise(after[worst], noise)), ticks
            )
            # what is said along the motion and what simulation says must be the same
            if late is None or abs(late[0] / ticks - 1.0) > ABOUT:
                continue
            part = part_left(before, late[1], noises)
            alike = late[0], late[1][worst]
            if part < least and not _rather_a_rotor(*triples[worst], backend, noise, before[worst], alike):
                best, least = kind(late[0]), part
    return best


def _rather_a_rotor(
    robot: Robot,
    nominal: Robot,
    run: Run,
    backend: Backend | str,
    noise: Noise,
    left: Mapping[str, Vector],
    late: tuple[float, Mapping[str, Vector]],
) -> bool:
    """Whether the gap may as well be the rotor's inertia, at the loudest joint, that looks so late in positions.

    Its torque tells it from late speeds, and so do joints that are late as well; where neither shows, it is a rotor.

    Args:
        robot: What the run is compared with.
        nominal: As known.
        run: What was measured.
        backend: The engine.
        noise: Of the run.
        left: What the robot leaves.
        late: How late speeds are, as differences over so many ticks, and what they leave.
    """
    ticks, after = late
    whole = _in_noise(left, noise)
    loud = [_loudness(_of_joint([left], [noise], joint)) for joint in range(run.n)]
    joint = int(np.argmax(loud))
    stage = robot.stages[joint]

    def by_rotor(inertia: float) -> Vector:
        drive = replace(stage.drive, inertia=stage.drive.inertia + inertia)
        stages = (*robot.stages[:joint], replace(stage, drive=drive), *robot.stages[joint + 1 :])
        other = resimulated(replace(robot, stages=stages), nominal, run, backend)
        return _in_noise(residuals(run, other, robot), noise)

    inertia = -0.5 * ticks / run.control.rate * run.control.kd[joint]
    try:
        rival = by_rotor(inertia)
        rival = by_rotor(inertia * _along(whole, rival)[1])
    except RefusedError:
        return False
    return float(np.sum(_in_noise(after, noise) ** 2)) > float(np.sum(rival**2)) - 2.0 * LIKELIER


def left_by(
    suspect: Suspect, robot: Robot, run: Run, backend: Backend | str, *, nominal: Robot | None = None
) -> dict[str, Vector]:
    """Measured minus simulated where a suspect is put right, as `residuals` has it.

    Args:
        suspect: What is put right.
        robot: What the run is compared with.
        run: What was measured.
        backend: The engine.
        nominal: Whose rigid bodies the controller's feedforward knows; None: the robot's.
    """
    other = suspect.change(run)
    return residuals(other, resimulated(robot, nominal or robot, other, backend, begun=run), robot)


def tells_torque(run: Run) -> bool:
    """Whether a torque was measured."""
    return any(run.has(name) for name in TORQUES)


def part_left(
    before: Sequence[Mapping[str, Vector]], after: Sequence[Mapping[str, Vector]], noises: Sequence[Noise]
) -> float:
    """Part of some runs' gap that is left of it, by its energy above noise; all where there is no such energy.

    Below 0 where less is left than noise was thought to be: of two that leave so little one may still leave less.
    """
    loud, still = (
        sum(_loudness(_in_noise(one, noise)) for one, noise in zip(left, noises, strict=True))
        for left in (before, after)
    )
    return still / loud if loud > 0.0 else 1.0


def _in_most_joints(
    before: Sequence[Mapping[str, Vector]], after: Sequence[Mapping[str, Vector]], noises: Sequence[Noise]
) -> bool:
    """Whether most joints with a gap, three or more, have the one that a suspect makes, each by its own channels."""
    n = max((one[name].shape[1] for one in before for name in one if not name.startswith("ee")), default=0)
    told = there = 0
    for joint in range(n):
        left, rest = _of_joint(before, noises, joint), _of_joint(after, noises, joint)
        share, amount = _along(left, rest)
        there += _loudness(left) > CLEARLY * np.sqrt(2.0 * len(left))
        told += share > MOST and abs(amount - 1.0) < ABOUT
    return told >= JOINTS and 2 * told > there


def _of_joint(left: Sequence[Mapping[str, Vector]], noises: Sequence[Noise], joint: int) -> Vector:
    """What is left in a joint's own channels, in units of noise; 0 where nothing was measured."""
    parts = [
        one[name][:, joint] / noise.sigma[name][joint]
        for one, noise in zip(left, noises, strict=True)
        for name in sorted(one)
        if not name.startswith("ee")
    ]
    return np.nan_to_num(np.concatenate(parts))


def _loudness(values: Vector) -> float:
    """Energy of numbers in units of noise above that of noise; 0 is none."""
    return float(values @ values) - np.count_nonzero(values)


def _along(left: Vector, after: Vector) -> tuple[float, float]:
    """(part of what is left above noise that lies along what a suspect changes, how much of that change it is)."""
    change = left - after
    size, along = float(change @ change), float(left @ change)
    whole = _loudness(left)
    if size < SEEN**2 or along <= 0.0 or whole <= 0.0:
        return 0.0, 0.0
    return along**2 / (size * whole), along / size


def _in_noise(left: Mapping[str, Vector], noise: Noise) -> Vector:
    """All that is left, in units of noise, one after the other; 0 where nothing was measured."""
    sigma = noise.sigma
    return np.concatenate([np.zeros(0), *(np.nan_to_num(left[name] / sigma[name]).ravel() for name in sorted(left))])


def step_of(robot: Robot, run: Run, backend: Backend) -> float:
    """Integration step that a simulation of the run takes [s]."""
    imposed = run.control.mode in ("motion", "unknown")
    whole = expanded(robot, imposed=imposed)
    poses = whole.spread(poses_of(robot, run.motion()))
    return choose_step(whole.robot, backend, imposed=imposed, poses=poses, compiled=True)


def _apart(one: Mapping[str, Vector], other: Mapping[str, Vector]) -> dict[str, Vector]:
    return {
        # before the first window of mode torque there is nothing
        name: np.sqrt(np.nanmean(np.square(values - other[name]), axis=0))
        for name, values in one.items()
        if name != "ee_rot"
    }


def _said(what: str, error: Mapping[str, Vector], noise: Noise) -> str:
    """A sentence with the largest error in units of noise."""
    sigma = noise.sigma
    worst = [(float(np.max(error[name] / np.maximum(sigma[name], 1e-300))), name) for name in error if name in sigma]
    if not worst:
        return f"{what} in no signal that is compared."
    size, name = max(worst)
    return f"{what} by {size:.2g} times the noise at most (in {name})."
