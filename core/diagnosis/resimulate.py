"""What a simulation gives for every signal of a recorded run, at the run's own stamps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..control import Control
from ..errors import RefusedError
from ..expansion import expanded
from ..motion import MotionLaw, from_table, hold
from ..parallel import side_by_side
from ..recording import Run
from ..representation import Robot
from ..simulation import Backend, MachineState, backend_named, simulate
from ..simulation.step import choose_step, poses_of
from .beginning import FEWEST, moving_at_first, slips_at, start_of, state_at, window_edges
from .compared import mode_of, residuals
from .inverse import arms_along, said
from .prepare import creep_of, filtered, smoothed
from .recorded import IMPOSED, signals_of, unasked
from .resample import EARLY, ON_CLOCK, at_stamps, between, linear
from .sensed import noise_in
from .starting_side import clearance_of, nearest_start, places_at_rest, rattles, rows_until_taken_along

Item = TypeVar("Item")
Made = TypeVar("Made")
Vector = NDArray[np.float64]

# a record between whose samples is interpolated
FINE_RATE = 1000.0
# steps of a run at most, of a robot with what a fit came to: some minutes with six joints
AWAITED = 1.0e7
# finer ticks where a delay is not a whole number of them
FINER = 4


def resimulated_once(
    robot: Robot,
    nominal: Robot,
    run: Run,
    backend: Backend | str,
    *,
    step: float | None = None,
    begun: Run | None = None,
) -> Mapping[str, Vector]:
    """Every signal that the run has, as the simulation gives it under the same command and controller.

    Mode pd and motion: begun at rest, or from the measured state where the run plainly begins otherwise. Mode torque:
    in windows of half a second, each begun from the smoothed measured state, NaN before the first. Mode unknown: as
    mode motion, with the measured positions behind a zero-phase filter, the torque as motors are asked for it. Clamped
    joints, which no engine holds, and in mode unknown play, whose arms would hit motors as if these were walls: inverse
    dynamics along the measured motion.

    Args:
        robot: With all that it is thought to have.
        nominal: Whose rigid bodies the controller's feedforward knows.
        run: As read.
        backend: Which engine, or its name.
        step: Integration step [s]; None: chosen from the largest eigenvalue.
        begun: Run whose start is the run's in mode pd; None: its own.

    Returns:
        Signal -> values at run.t: (m, n), ee (m, 3), ee_rot (m, 4) as w x y z.

    Raises:
        RefusedError: The backend refuses this robot or this run, or another robot than the known one, which may be
            anything that a fit came to, takes so many steps that nobody waits for its end.
    """
    mode = mode_of(run)
    along_motion = mode == "unknown" and (bool(run.locked) or rattles(robot))
    if step is None and not along_motion and robot != nominal and (steps := steps_of(robot, run, backend)) > AWAITED:
        raise RefusedError(f"{robot.name} with these effects takes {steps:.1g} steps for {run.name}: nobody awaits it.")
    if mode == "torque":
        return _in_windows(robot, run, backend, step)
    if mode == "unknown":
        grid = smoothed(run)
        if along_motion:
            speech = said(robot, grid, nominal, creep_of(grid))
            acts = {"tau": run.t + 0.5 * run.control.held, "tau_link": run.t}
            heard = {name: getattr(speech, name) for name in acts if run.has(name)}
            if not run.locked:
                # of a blow what was measured has only what is left behind its filter
                heard = {name: filtered(grid, values) for name, values in heard.items()}
            return {name: between(grid.t, values, acts[name]) for name, values in heard.items()}
        law, control = from_table(grid.t, grid.q, grid.dq, grid.ddq), Control()
        return _asked_for(robot, run, _simulated(robot, nominal, run, backend, law, control, None, step))
    law, start = run.motion(), None
    if mode == "pd":
        # the tick of a last row that is stamped a little early is behind the table's end, where a command would stop
        law, start = law.going_on(2.0 / min(run.control.rate, run.rate)), start_of(robot, begun or run)
    if start is None:
        start = _start_in_play(robot, nominal, run, backend, law, step)
    return _simulated(robot, nominal, run, backend, law, run.control, start, step)


def _start_in_play(
    robot: Robot, nominal: Robot, run: Run, backend: Backend | str, law: MotionLaw, step: float | None
) -> MachineState | None:
    """The state of rest with free arms where in their clearances the run began; None where no arm is free.

    Whether they are free is told by where they settle, and where they were by the run's first moments.
    """
    if not rattles(robot) or moving_at_first(run):
        return None
    whole = expanded(robot, imposed=run.control.mode == "motion")
    settled = _simulated(robot, nominal, _first_rows(run, FEWEST), backend, law, run.control, None, step)
    rest = state_at(robot, settled["q"][0], np.zeros(run.n))
    places = places_at_rest(whole.robot, rest)
    if not places:
        return None
    gaps = np.array([clearance_of(stage) if i in places else 0.0 for i, stage in enumerate(whole.robot.stages)])
    first = _first_rows(run, rows_until_taken_along(gaps, whole.spread(law.at(run.t)[0]), run.t))

    def missed(start: MachineState) -> float:
        left = residuals(run, _simulated(robot, nominal, first, backend, law, run.control, start, step), robot)
        squares = [np.square(values / noise_in(run, name).sigma) for name, values in left.items()]
        # of what was not measured then nothing is known
        return sum(float(np.mean(one[there])) for one in squares if (there := np.isfinite(one)).any())

    return nearest_start(rest, places, missed)


def free_arms(robot: Robot, run: Run) -> tuple[int, ...]:
    """Joints (from 1) with an arm that a simulation begins where in its clearance the run's first moments have it."""
    if mode_of(run) == "unknown" or not rattles(robot) or moving_at_first(run):
        return ()
    whole = expanded(robot, imposed=run.control.mode == "motion")
    places = places_at_rest(whole.robot, state_at(robot, smoothed(run).q[0], np.zeros(run.n)))
    return tuple(joint for joint, i in enumerate(whole.driven, start=1) if i in places)


def _first_rows(run: Run, rows: int) -> Run:
    """A run that ends early, to be simulated: it is still compared as the whole one is."""
    return replace(run, t=run.t[:rows], signals={name: values[:rows] for name, values in run.signals.items()})


@lru_cache(maxsize=32)
def resimulated(
    robot: Robot,
    nominal: Robot,
    run: Run,
    backend: Backend | str,
    *,
    step: float | None = None,
    begun: Run | None = None,
) -> Mapping[str, Vector]:
    """As `resimulated_once` has it, kept: for what is asked for again."""
    return resimulated_once(robot, nominal, run, backend, step=step, begun=begun)


def each_simulated(of: Callable[[Item], Made], items: Sequence[Item], backend: Backend | str) -> list[Made]:
    """What simulations in an engine make of each item, in their order: side by side where the engine can run so."""
    engine = backend_named(backend) if isinstance(backend, str) else backend
    return side_by_side(of, items) if engine.threads else [of(item) for item in items]


def steps_of(robot: Robot, run: Run, backend: Backend | str) -> float:
    """How many steps an engine takes to simulate a run: what is stiff and light asks for short ones."""
    imposed = mode_of(run) in IMPOSED
    whole = expanded(robot, imposed=imposed)
    poses = whole.spread(poses_of(robot, run.motion()))
    engine = backend_named(backend) if isinstance(backend, str) else backend
    return run.duration / choose_step(whole.robot, engine, imposed=imposed, poses=poses, compiled=True)


def _simulated(
    robot: Robot,
    nominal: Robot,
    run: Run,
    backend: Backend | str,
    law: MotionLaw,
    control: Control,
    start: MachineState | None,
    step: float | None,
) -> dict[str, Vector]:
    rate = run.rate
    rows = np.round(run.t * rate)
    rate = float(rows[-1] / run.t[-1])
    on_clock = bool(np.all(np.abs(run.t - rows / rate) <= ON_CLOCK))
    if not on_clock:
        # a whole number of rows a tick: a held torque must not be read beside its tick
        ticks = max(1, round(run.rate / control.rate))
        rate = max(FINE_RATE, run.rate) if control.mode == "motion" else ticks * control.rate
    duration = float(run.t[-1]) + (0.0 if on_clock else 1.0 / rate)
    trace = simulate(
        robot,
        backend,
        law,
        control,
        duration=duration,
        rate=rate,
        step=step,
        start=start,
        nominal=nominal,
        without=unasked(run, robot),
    )
    if on_clock:
        # rows that are missing in the record were simulated too
        return {name: values[rows.astype(np.int64)] for name, values in signals_of(trace, run, robot).items()}
    # a given motion stops at once behind its end, which no spline may see
    known = trace.t <= (run.t[-1] + ON_CLOCK if control.mode == "motion" else np.inf)
    signals = {name: values[known] for name, values in signals_of(trace, run, robot).items()}
    return at_stamps(run.t, trace.t[known], signals, held=control.mode == "pd")


def _asked_for(robot: Robot, run: Run, signals: Mapping[str, Vector]) -> Mapping[str, Vector]:
    """Signals of an imposed motion as a controller nobody knows leaves them: motors are asked for less than they give.

    Where a motion is imposed gains do not act, so that a simulation has the drive's own torque; and a torque that is
    held makes what a continuous one would half of that later.
    """
    if "tau" not in signals:
        return signals
    gain = np.array([stage.drive.gain for stage in robot.stages])
    offset = np.array([stage.sensor.torque_offset for stage in robot.stages])
    tau = linear(run.t, signals["tau"], run.t + 0.5 * run.control.held)
    return {**signals, "tau": (tau - offset) / gain + offset}


def _in_windows(robot: Robot, run: Run, backend: Backend | str, step: float | None) -> dict[str, Vector]:
    """Mode torque: every window begins as the smoothed measurement was, the first one at rest unless the run began in
    motion; a delayed torque is there from before.

    Arms that give are bent by what they bear along the measured motion, and hysteresis as it left it; what rings in
    them is not known.
    """
    ticks = run.control.rate * robot.delay
    rate = run.control.rate * (1 if abs(ticks - round(ticks)) < 1.0e-6 else FINER)
    control = replace(run.control, rate=rate)
    prompt = replace(robot, delay=0.0)
    grid = smoothed(run)
    edges = window_edges(run)
    # motors' positions and speeds as windows begin, and those of arms that are bent
    there = (grid.q, grid.dq, *(arms_along(prompt, grid, prompt) if _gives(prompt) else ()))
    starts = [between(grid.t, values, np.array(edges)) for values in there]
    slips = slips_at(prompt, grid, np.array(edges))
    pieces: list[dict[str, Vector]] = []
    for number, (begin, end) in enumerate(pairwise(edges)):
        last = number == len(edges) - 2
        inside = (run.t >= begin - ON_CLOCK) & ((run.t < end - ON_CLOCK) | last)
        if not inside.any():
            continue
        duration = float(max(end, run.t[inside][-1]) - begin) + 2.0 / rate
        torque = held_torque(run, begin + np.arange(int(duration * rate) + 2) / rate - robot.delay)
        q, dq, *arms = (values[number] for values in starts)
        # a run begins at rest, or it would not be compared from its first row on; a filter's edge knows no speed
        start = state_at(prompt, q, dq if begin > 0.0 else np.zeros_like(dq))
        if begin > 0.0 and arms:
            start = replace(start, q=arms[0], dq=arms[1])
        elif rattles(prompt):
            # where in its clearance an arm was is told by how it was taken along
            start = replace(start, q=arms[0])
        if slips is not None:
            start = replace(start, slips=slips[number])
        trace = simulate(
            prompt,
            backend,
            hold(q, duration),
            control,
            duration=duration,
            rate=rate,
            step=step,
            start=start,
            torque=torque,
            without=unasked(run, robot),
        )
        pieces.append(at_stamps(run.t[inside] - begin, trace.t, signals_of(trace, run, robot), held=True))
    before = int(np.sum(run.t < edges[0] - ON_CLOCK))
    unknown = {name: np.full((before, *values.shape[1:]), np.nan) for name, values in pieces[0].items()}
    return {name: np.concatenate([unknown[name], *(piece[name] for piece in pieces)]) for name in pieces[0]}


def _gives(robot: Robot) -> bool:
    """Whether arms bend under what they bear, or stand at a side of their play."""
    drives = [stage.drive for stage in expanded(robot, imposed=False).robot.stages]
    return any(drive.spring is not None or drive.passive for drive in drives)


def held_torque(run: Run, times: Vector) -> Vector:
    """The commanded torque at times [s], held from each row's tick to the next's, shape (..., n); 0 where none is.

    A stamp a little behind its tick does not make the command wait for the next one.
    """
    commanded = np.nan_to_num(run.signals["tau_cmd"])
    given = np.floor(run.t * run.control.rate + EARLY) / run.control.rate
    at = np.searchsorted(given, times + ON_CLOCK, side="right") - 1
    return commanded[np.clip(at, 0, len(commanded) - 1)]
