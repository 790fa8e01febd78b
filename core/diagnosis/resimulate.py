"""What a simulation gives for every signal of a recorded run, at the run's own stamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from itertools import pairwise, product
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..control import Control
from ..errors import RefusedError
from ..expansion import expanded
from ..kinematics import dynamics, jacobian
from ..motion import MotionLaw, from_table, hold
from ..parallel import side_by_side
from ..recording import Run
from ..recording.run import MEASURED
from ..representation import Robot
from ..simulation import Backend, MachineState, Trace, backend_named, simulate
from ..simulation.settle import sagged
from ..simulation.step import choose_step, poses_of
from .evidence import sticking
from .inverse import STANDS, arms_along, said
from .prepare import Prepared, creep_of, filtered, prepared, widened
from .sensed import noise_in
from .starting_side import clearance_of, nearest_start, places_at_rest, rows_until_taken_along

Item = TypeVar("Item")
Made = TypeVar("Made")
Vector = NDArray[np.float64]

# modes in which a simulation's motors move as they are told to
IMPOSED = ("motion", "unknown")
# samples at a simulation's end that may know of what is behind it
ENDS = 3
# torque alone lets a simulation drift away: it is begun anew from what was measured
WINDOW = 0.5
# a stamp may be so much of a tick before it and mean it
EARLY = 0.05
# a stamp this near to a uniform clock is on it [s]
ON_CLOCK = 1.0e-7
# a record between whose samples is interpolated
FINE_RATE = 1000.0
# what is near the turn of a given motion, and of one that a given torque makes, whose time is not known as well [s]
TURN, TURNED = 0.004, 0.01
# the first part of a run that tells whether it began at rest: seconds, and samples at least
BEGINNING, FEWEST = 0.02, 8
# how often its noise polynomials may miss a beginning, and of what degree these are: a controller's kick at rest is no
# even acceleration
MISSES, DEGREES = 3.0, range(2, 6)
# what moves so many standard deviations at the start, and such a part of the fastest, plainly moves
PLAIN, FAST = 8.0, 0.02
# how far a speed's noise may take it from what it is
SURELY = 3.0
# a filter that was begun on a moving robot is let settle so many of its edges long
SETTLED = 2
# a command is known through a gap of so many samples; times kd / kp until a controller has caught up with one
GAP, CAUGHT_UP = 5.5, 6.0
# steps of a run at most, of a robot with what a fit came to: some minutes with six joints
AWAITED = 1.0e7
# finer ticks where a delay is not a whole number of them
FINER = 4


@lru_cache(maxsize=32)
def smoothed(run: Run) -> Prepared:
    """The run behind the zero-phase filter that mode unknown is compared through, made once a run."""
    return prepared(run)


def settled(grid: Prepared) -> slice:
    """What is compared, where the filter's ends are no longer felt."""
    edge = min(SETTLED * grid.edge, (len(grid.t) - grid.first) // 4)
    return slice(max(edge, grid.first), len(grid.t) - edge)


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
            return {name: _between(grid.t, values, acts[name]) for name, values in heard.items()}
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
    if not rattles(robot) or _moving_at_first(run):
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
    if mode_of(run) == "unknown" or not rattles(robot) or _moving_at_first(run):
        return ()
    whole = expanded(robot, imposed=run.control.mode == "motion")
    places = places_at_rest(whole.robot, state_at(robot, smoothed(run).q[0], np.zeros(run.n)))
    return tuple(joint for joint, i in enumerate(whole.driven, start=1) if i in places)


def _first_rows(run: Run, rows: int) -> Run:
    """A run that ends early, to be simulated: it is still compared as the whole one is."""
    return replace(run, t=run.t[:rows], signals={name: values[:rows] for name, values in run.signals.items()})


def rattles(robot: Robot) -> bool:
    """Whether an arm may fly across a clearance."""
    return any(clearance_of(stage) > 0.0 for stage in robot.stages)


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


def mode_of(run: Run) -> str:
    """How a run is held against a model: as its control says, and along its motion where joints are clamped.

    Raises:
        RefusedError: Joints are clamped, and no torque was measured.
    """
    if not run.locked:
        return run.control.mode
    if not (run.has("tau") or run.has("tau_link")):
        raise RefusedError(f"{run.name}: with joints clamped only torques can be compared, and it has none measured.")
    return "unknown"


def compared(run: Run, robot: Robot) -> dict[str, Vector]:
    """What was measured of each signal that a simulation is held against, shapes as `resimulated`; NaN where nothing.

    In mode unknown that is torque alone, behind the filter that the motion was smoothed with, and not where that feels
    a hole of the record: what is bridged there has no accelerations. Where a motion is given, a joint's torque at the
    turn of its way is not compared: which sample friction changes its sign at nobody knows; nor is, in mode torque,
    what drives pass on there and as a window begins. What was commanded in a gap of the record is not known either, and
    nothing is compared behind it until the controller has caught up, or a window begins anew.

    Args:
        run: As read.
        robot: With all that it is thought to have: friction that sticks bears anything where a joint stands.
    """
    judged = run.judged[:, None]
    return {name: np.where(judged, values, np.nan) for name, values in _compared(run, robot).items()}


def _compared(run: Run, robot: Robot) -> dict[str, Vector]:
    """The same of all rows."""
    stuck = sticking(robot)
    if mode_of(run) == "motion":
        turns = _loose(smoothed(run), run.t, TURN, stuck)
        return {
            name: np.where(turns, np.nan, run.signals[name]) if name in ("tau", "tau_link") else run.signals[name]
            for name in MEASURED
            if run.has(name)
        }
    if mode_of(run) == "torque":
        # a window begins with friction's bristles unbent, and turns when its start's noise lets it
        loose = _loose(smoothed(run), run.t, TURNED, stuck)
        begun: Vector = np.array(window_edges(run))[:, None] - ON_CLOCK
        loose |= np.any((run.t >= begun) & (run.t < begun + TURNED), axis=0)[:, None]
        lost = _beyond_command(run)[:, None]
        return {
            name: np.where(lost | loose if name == "tau_link" else lost, np.nan, run.signals[name])
            for name in MEASURED
            if run.has(name)
        }
    if mode_of(run) != "unknown":
        lost = _beyond_command(run)[:, None]
        return {name: np.where(lost, np.nan, run.signals[name]) for name in MEASURED if run.has(name)}
    grid = smoothed(run)
    found: dict[str, Vector] = {}
    known = settled(grid)
    inside = (run.t >= grid.t[known][0]) & (run.t <= grid.t[known][-1])
    none = np.zeros(run.signals["q"].shape, dtype=bool)
    loose = none if run.locked else _loose(grid, run.t, 0.5 / grid.band, stuck)
    moved = grid.bridged("q").any(axis=1, keepdims=True)
    for name in ("tau", "tau_link"):
        if run.has(name):
            values = _between(grid.t, grid.measured[name], run.t)
            bridged = _nearest(grid, grid.bridged(name) | moved, run.t)
            there = np.isfinite(run.signals[name]) & inside[:, None] & ~loose & ~bridged
            found[name] = np.where(there, values, np.nan)
    if run.locked and "tau" in found:
        # while the motor before a clamped output stands, friction takes whatever there is to take
        stands = linear(grid.t, (np.abs(grid.dq) < creep_of(grid)).astype(float), run.t) > 0.0
        for joint in run.locked:
            found["tau"][stands[:, joint - 1], joint - 1] = np.nan
    return found


def _beyond_command(run: Run) -> NDArray[np.bool_]:
    """Rows behind a gap in which what was commanded there still acts, shape (m,).

    A controller makes up for it; where torque is commanded, the motion is lost until a window begins anew.
    """
    lost = np.zeros(len(run.t), dtype=bool)
    gaps = np.flatnonzero(np.diff(run.t) * run.rate > GAP) + 1
    if run.control.mode == "torque":
        edges, reach = window_edges(run), smoothed(run).edge * smoothed(run).h
        lost |= run.t < edges[0] - ON_CLOCK
        for row, (begin, end) in product(gaps, pairwise(edges)):
            before, after = run.t[row - 1], run.t[row]
            if before < end and begin < after + reach:
                # a start beside the gap has the bridge's motion
                first = begin if begin > before - reach else after
                lost |= (run.t >= first - ON_CLOCK) & (run.t < end - ON_CLOCK)
    if run.control.mode == "pd":
        gains = zip(run.control.kd, run.control.kp, strict=True)
        # a damped loop settles within some of these
        settled = CAUGHT_UP * max((kd / kp for kd, kp in gains if kp > 0.0), default=0.0)
        for row in gaps:
            lost |= (run.t >= run.t[row]) & (run.t < run.t[row] + settled)
    return lost


def _loose(grid: Prepared, times: Vector, reach: float, stuck: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where joints (nearly) stand, so that friction is between its levels and no motion tells it, shape (k, n).

    A joint that stands most of the time still shows its load, unless its friction may bear any of it.

    Args:
        grid: The motion.
        times: At which to tell [s], shape (k,).
        reach: What is near it, before and after [s].
        stuck: Joints with friction that sticks, shape (n,).
    """
    stands = np.abs(grid.dq) < creep_of(grid)
    stands |= np.vstack([np.zeros((1, stands.shape[1]), dtype=bool), np.diff(np.signbit(grid.dq), axis=0)])
    near = widened(stands, reach / grid.h)
    near &= (stands.mean(axis=0) < STANDS) | stuck
    return _nearest(grid, near, times)


def _nearest(grid: Prepared, flags: NDArray[np.bool_], times: Vector) -> NDArray[np.bool_]:
    """Flags of the grid's times (m, n) at other times (k,)."""
    return flags[np.clip(np.searchsorted(grid.t, times), 0, len(grid.t) - 1)]


def residuals(run: Run, simulated: Mapping[str, Vector], robot: Robot) -> dict[str, Vector]:
    """Measured minus simulated of each signal; ee_rot as rotation vectors in the base (m, 3) [rad].

    Of a simulation that ends early, of its rows. Mode torque: arms are held against their motors, for both drift away
    together.
    """
    left: dict[str, Vector] = {}
    for name, whole in compared(run, robot).items():
        measured = whole[: len(simulated[name])] if name in simulated else whole
        if name == "ee_rot":
            left[name] = _turn(measured, simulated[name])
        elif name in simulated:
            left[name] = measured - simulated[name]
    if mode_of(run) == "torque" and {"q", "q_link"} <= left.keys():
        left["q_link"] = left["q_link"] - left["q"]
    return left


def start_of(robot: Robot, run: Run) -> MachineState | None:
    """The measured state at the first row, where a run plainly does not begin at rest; None where it does.

    The arm sides stand behind their springs as gravity lets them, and move with the motor sides.
    """
    begun = _moving_at_first(run)
    return state_at(robot, *begun) if begun else None


@lru_cache(maxsize=32)
def _moving_at_first(run: Run) -> tuple[Vector, Vector] | None:
    """Measured positions and speeds (n,) at the first row of a run that plainly begins in motion."""
    first = (run.t <= BEGINNING) | (np.arange(len(run.t)) < FEWEST)
    q, dq, spread = np.empty(run.n), np.empty(run.n), np.empty(run.n)
    fastest = np.nanmax(np.abs(smoothed(run).dq), axis=0)
    for i, column in enumerate(run.signals["q"][first].T):
        good = np.isfinite(column)
        if good.sum() < 4:
            return None
        for degree in DEGREES:
            q[i], dq[i], spread[i], misses = _begun(run.t[first][good], column[good], degree)
            # noise is asked for where it matters: to know it takes as long as a simulation
            if abs(dq[i]) <= FAST * fastest[i] or misses <= MISSES * float(noise_in(run, "q").sigma[i]):
                break
    fast = np.abs(dq) > FAST * fastest
    moves = fast.any() and fast & (np.abs(dq) > PLAIN * spread * noise_in(run, "q").sigma) & _agrees(run, dq)
    return (q, dq) if np.any(moves) else None


def _begun(t: Vector, values: Vector, degree: int) -> tuple[float, float, float, float]:
    """Position and speed at t = 0 by a polynomial, the speed's error for noise of 1, and what it misses, rms.

    Nothing is missed where it has hardly fewer numbers than there are rows.
    """
    terms = np.vander(t / t[-1], degree + 1, increasing=True)
    covariance = np.linalg.inv(terms.T @ terms)
    amounts = covariance @ (terms.T @ values)
    left = values - terms @ amounts
    spare = len(t) - degree - 1
    misses = math.sqrt(float(left @ left) / spare) if spare > 1 else 0.0
    return float(amounts[0]), float(amounts[1]) / t[-1], math.sqrt(covariance[1, 1]) / t[-1], misses


def _agrees(run: Run, dq: Vector) -> NDArray[np.bool_]:
    """Whether the first recorded speed of each joint is not far below another, shape (n,); 0 is where slopes begin."""
    if not run.has("dq"):
        return np.ones(run.n, dtype=bool)
    first = run.signals["dq"][0]
    known = np.isfinite(first) & (first != 0.0)
    low = np.abs(np.where(known, first, 0.0)) + SURELY * noise_in(run, "dq").sigma < 0.5 * np.abs(dq)
    return ~(known & low)


def state_at(robot: Robot, reported: Vector, dtheta: Vector) -> MachineState:
    """The state of a robot whose motors report positions and speeds (n,), its arms where gravity lets them hang."""
    whole = expanded(robot, imposed=False)
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    theta, speed = whole.spread(reported - offsets), whole.spread(dtheta)
    q = sagged(whole.robot, dynamics(whole.robot, always_compiled=True), theta)
    passive = np.array([stage.drive.passive for stage in whole.robot.stages])
    return MachineState(0.0, q, speed, np.where(passive, q, theta), speed.copy())


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
        without=_unseen(run, robot),
    )
    if on_clock:
        # rows that are missing in the record were simulated too
        return {name: values[rows.astype(np.int64)] for name, values in _signals(trace, run, robot).items()}
    # a given motion stops at once behind its end, which no spline may see
    known = trace.t <= (run.t[-1] + ON_CLOCK if control.mode == "motion" else np.inf)
    signals = {name: values[known] for name, values in _signals(trace, run, robot).items()}
    return _at(run.t, trace.t[known], signals, held=control.mode == "pd")


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

    Arms that give are bent by what they bear along the measured motion; what rings in them is not known.
    """
    ticks = run.control.rate * robot.delay
    rate = run.control.rate * (1 if abs(ticks - round(ticks)) < 1.0e-6 else FINER)
    control = replace(run.control, rate=rate)
    prompt = replace(robot, delay=0.0)
    grid = smoothed(run)
    edges = window_edges(run)
    # motors' positions and speeds as windows begin, and those of arms that are bent
    there = (grid.q, grid.dq, *(arms_along(prompt, grid, prompt) if _gives(prompt) else ()))
    starts = [_between(grid.t, values, np.array(edges)) for values in there]
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
            without=_unseen(run, robot),
        )
        pieces.append(_at(run.t[inside] - begin, trace.t, _signals(trace, run, robot), held=True))
    before = int(np.sum(run.t < edges[0] - ON_CLOCK))
    unknown = {name: np.full((before, *values.shape[1:]), np.nan) for name, values in pieces[0].items()}
    return {name: np.concatenate([unknown[name], *(piece[name] for piece in pieces)]) for name in pieces[0]}


def window_edges(run: Run) -> list[float]:
    """Where the windows of mode torque begin, on ticks, and where the last one ends [s].

    Of a run that begins in the midst of a motion the filter's edge is left out: it knows no state there.
    """
    grid, rate, begin = smoothed(run), run.control.rate, 0.0
    if _moving_at_first(run):
        begin = float(np.ceil(min(grid.edge * grid.h, run.duration / 4.0) * rate) / rate)
    spans = max(1, int(np.ceil((run.t[-1] - begin) / WINDOW - 1.0e-9)))
    return [round((begin + (run.duration - begin) * k / spans) * rate) / rate for k in range(spans + 1)]


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


def _unseen(run: Run, robot: Robot) -> list[str]:
    """What a simulation need not record: the run has nothing to hold it against."""
    tool = run.has("ee") or run.has("ee_rot")
    passed = run.has("tau_link") or bool(_standing_in(robot).any())
    return [name for name, there in (("tau_link", passed), ("tool", tool)) if not there]


def _standing_in(robot: Robot) -> Vector:
    """Whether a joint's spring stands for a rigid connection, shape (n,)."""
    return np.array([bool(stage.drive.spring and stage.drive.spring.stands_in) for stage in robot.stages])


def _given(robot: Robot, trace: Trace) -> tuple[Vector, Vector] | None:
    """How far springs that stand for rigid connections give, and its second derivative; None where there are none.

    To second order in how fast their dampers follow: s = T / K - (b / K) (T / K)'. Shapes (m, n) [rad or m].
    """
    interpolate: Any = import_module("scipy.interpolate")

    there = _standing_in(robot)
    if not there.any():
        return None
    springs = [stage.drive.spring for stage in robot.stages]
    pairs = [(spring.stiffness, spring.damping) if spring else (math.inf, 0.0) for spring in springs]
    stiffness, damping = np.where(there, np.array(pairs).T, [[math.inf], [0.0]])
    still = trace.joints["tau_link"] / stiffness
    # a given motion stops at once behind its end, which no spline may see
    inside = trace.t[:-ENDS]
    curve = interpolate.CubicSpline(inside, still[:-ENDS])
    at = np.minimum(trace.t, inside[-1])
    return still - damping / stiffness * curve(at, nu=1), curve(at, nu=2)


def _signals(trace: Trace, run: Run, robot: Robot) -> dict[str, Vector]:
    """Those signals of a trace that the run has, of a robot whose rigid connections are rigid.

    An engine needs a spring where a rigid joint's gear wobbles. That spring is none of the robot's: what it gives under
    what it bears is many times a second encoder's noise, and is taken off; the tool's part of it by the Jacobian. Where
    motors move as they are told to, so is what it takes to move the arms by so much, which makes more of quick torques.
    """
    rotation: Any = import_module("scipy.spatial.transform").Rotation

    found = {name: trace.joints[name] for name in MEASURED if run.has(name) and name in trace.joints}
    give = _given(robot, trace)
    if give is not None and "q_link" in found:
        found["q_link"] = found["q_link"] + give[0]
    if give is not None and mode_of(run) in IMPOSED:
        takes = (dynamics(robot).mass_matrix(trace.joints["q_link"]) @ give[1][:, :, None])[:, :, 0]
        found |= {name: found[name] + takes for name in ("tau", "tau_link") if name in found}
    if not (run.has("ee") or run.has("ee_rot")):
        return found
    tip, turn = trace.tip, rotation.from_matrix(trace.tool_in_base[:, :3, :3])
    if give is not None:
        twist = (jacobian(robot, trace.joints["q_link"]) @ give[0][:, :, None])[:, :, 0]
        tip, turn = tip + twist[:, :3], rotation.from_rotvec(twist[:, 3:]) * turn
    if run.has("ee"):
        found["ee"] = tip
    if run.has("ee_rot"):
        found["ee_rot"] = turn.as_quat()[:, [3, 0, 1, 2]]
    return found


def _at(times: Vector, grid: Vector, signals: Mapping[str, Vector], *, held: bool) -> dict[str, Vector]:
    """Signals of a uniform grid at other times; a motor torque that is held between ticks stays held."""
    found: dict[str, Vector] = {}
    for name, values in signals.items():
        if name == "tau" and held:
            # a row whose stamp is a little before a tick was recorded at that tick
            early = EARLY * float(grid[1] - grid[0]) if len(grid) > 1 else 0.0
            at = np.searchsorted(grid, times + max(early, ON_CLOCK), side="right") - 1
            found[name] = values[np.clip(at, 0, len(grid) - 1)]
        elif name == "ee_rot":
            # neighbouring quaternions of one hemisphere
            flips = np.cumprod(np.where(np.sum(values[1:] * values[:-1], axis=1) < 0.0, -1.0, 1.0))
            near = _between(grid, values * np.concatenate([[1.0], flips])[:, None], times)
            found[name] = near / np.linalg.norm(near, axis=1, keepdims=True)
        else:
            found[name] = _between(grid, values, times)
    return found


def _between(grid: Vector, values: Vector, times: Vector) -> Vector:
    """Cubic interpolation of what is smooth, shape (k, n)."""
    interpolate: Any = import_module("scipy.interpolate")

    if len(grid) < 4:
        return linear(grid, values, times)
    return np.asarray(interpolate.CubicSpline(grid, values)(times))


def linear(grid: Vector, values: Vector, times: Vector) -> Vector:
    """Linear interpolation, shape (k, n)."""
    out = np.empty((len(times), values.shape[1]))
    for i in range(values.shape[1]):
        out[:, i] = np.interp(times, grid, values[:, i])
    return out


def _turn(measured: Vector, simulated: Vector) -> Vector:
    rotation: Any = import_module("scipy.spatial.transform").Rotation

    known = np.isfinite(measured).all(axis=1)
    left = np.full((len(measured), 3), np.nan)
    order = [1, 2, 3, 0]
    if known.any():
        real, ours = rotation.from_quat(measured[known][:, order]), rotation.from_quat(simulated[known][:, order])
        left[known] = (real * ours.inv()).as_rotvec()
    return left
