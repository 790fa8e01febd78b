"""What measured minus simulated would still be for a perfect model: sensors, their way through filters, tolerances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..database import Database, Tolerance
from ..kinematics import dynamics, kinematics
from ..recording import ChannelNoise, Run
from ..recording.run import MEASURED
from ..representation import Arm, Robot
from .beginning import WINDOW, window_edges
from .compared import mode_of
from .feedback import hears, told
from .inverse import behind_gears
from .model import robot_of
from .prepare import prepared, settled, small_turn, smoothed
from .sensed import noise_in, response_of

Vector = NDArray[np.float64]

# how well a standard deviation is known [relative]: as its log states it, as it is estimated (on the blind bank 99 % of
# positions and torques to 8 %, of speeds to 20 %), and where it is slow: on 60 cases of the set for tuning a tenth of
# such channels is estimated under 0.73 of it, 2 % under 0.6
STATED, ESTIMATED, SLOW = 0.03, 0.1, 0.3
# what two good integrators may differ by, as a part of the signal
NUMERICAL = 1.0e-6
# instants at which tolerances are followed [Hz]
TOLERANCE_RATE = 100.0
# draws of sensor noise that are sent through filters
DRAWS = 6
# a controller sees its sensor's noise where so much of the torque's high band is that of its feedback
SEEN = 0.3
# a torque that scatters by so much more than its log states has seen a loop
BEYOND = 1.1
# how rare what tolerances do is, from always to next to never, where their chances are added up
_TAIL = np.logspace(0.0, -12.0, 241)
# how often and for how long a loop is driven by noise [s]
LOOPS, LOOP_TIME = 3, 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Standard deviations that a perfect model would leave in one run, a value a channel: (n,), ee and ee_rot (3,).

    Attributes:
        sensor: What sensors add, their way through controller and filters included.
        tolerance: What the database's numbers may be off by.
        heard: Degrees of freedom of the sensors' mean square: how many independent samples of equal weight would
            scatter so.
        loose: Degrees of freedom of the tolerances'.
    """

    sensor: Mapping[str, Vector]
    tolerance: Mapping[str, Vector]
    heard: Mapping[str, Vector]
    loose: Mapping[str, Vector]

    @property
    def sigma(self) -> dict[str, Vector]:
        """Both together."""
        return {name: np.hypot(values, self.tolerance[name]) for name, values in self.sensor.items()}

    def freedom(self, name: str) -> Vector:
        """Degrees of freedom of a signal's mean square, sensors and tolerances together (Satterthwaite)."""
        a, b = self.sensor[name] ** 2, self.tolerance[name] ** 2
        return (a + b) ** 2 / (a * a / self.heard[name] + b * b / self.loose[name])

    def most(self, name: str, times: float, level: float) -> Vector:
        """Mean square of a signal's channels that sensors and tolerances may make together, shape (n,).

        Args:
            name: The signal.
            times: How many times their known power sensors may make.
            level: How rarely tolerances make more than is counted for them: one robot's are a few numbers, drawn once.
        """
        chi2: Any = import_module("scipy.stats").chi2

        loose = self.loose[name]
        of_tolerance = np.maximum(np.asarray(chi2.isf(level, loose)) / loose, times)
        return np.asarray(times * self.sensor[name] ** 2 + of_tolerance * self.tolerance[name] ** 2)

    def chance(self, name: str, square: Vector) -> Vector:
        """Probability that a perfect model leaves a mean square as large or larger of a signal's channels, (n,).

        Two chi-square variables are added as they are: the few numbers that a tolerance is made of have a longer tail
        than any single chi-square variable of the same spread.
        """
        chi2: Any = import_module("scipy.stats").chi2

        a, b = self.sensor[name] ** 2, self.tolerance[name] ** 2
        heard, loose = self.heard[name], self.loose[name]
        rarer = _TAIL[:, None]
        of_tolerance = b * chi2.isf(np.sqrt(rarer[1:] * rarer[:-1]), loose) / loose
        over = chi2.sf(np.maximum(square - of_tolerance, 0.0) / np.maximum(a, 1e-300) * heard, heard)
        return np.asarray(np.sum((rarer[:-1] - rarer[1:]) * over, axis=0) + rarer[-1])


@lru_cache(maxsize=64)
def noise_floor(database: Database, level: str, run: Run) -> Noise:
    """The noise of every signal of a run, for the database at a level; made once."""
    robot = robot_of(database, level, run)
    sensor, free = _sensor(robot, run)
    off = tolerance_changes(robot, database.tolerance, run)
    judged = tolerance_times(run) >= run.since
    tolerance: dict[str, Vector] = {}
    heard: dict[str, Vector] = {}
    loose: dict[str, Vector] = {}
    for name, sigma in sensor.items():
        floor = NUMERICAL * np.sqrt(_mean(np.square(run.signals[name]))) if name != "ee_rot" else NUMERICAL
        sensor[name] = np.maximum(sigma, floor)
        spread = off[name][:, judged] if name in off else None
        size = len(sigma)
        if spread is None or not spread.size:
            tolerance[name], loose[name] = np.zeros(size), np.ones(size)
        else:
            tolerance[name] = np.sqrt(np.mean(np.sum(np.square(spread), axis=0), axis=0))
            loose[name] = np.array([_participation(spread[:, :, i]) for i in range(size)])
        # of a channel that has nothing nothing is judged
        heard[name] = 1.0 / (1.0 / np.maximum(free[name], 1.0) + 2.0 * _known(run, name) ** 2)
    return Noise(sensor, tolerance, heard, loose)


def _known(run: Run, name: str) -> float:
    """How well the standard deviation of a signal's noise is known, relative."""
    if name in run.noise:
        return STATED
    return SLOW if noise_in(run, name).slow.any() else ESTIMATED


def _mean(values: Vector) -> Vector:
    """Mean over time of what is there, 0 where nothing is, shape (n,)."""
    count = np.isfinite(values).sum(axis=0)
    return np.nansum(values, axis=0) / np.maximum(count, 1)


def _participation(changes: Vector) -> float:
    """How many independent draws of equal size scatter like a sum of changes (p, k), each of random size."""
    thin = np.ascontiguousarray(changes[:, ::4])
    gram = thin @ thin.T
    total = float(np.trace(gram))
    return total * total / float(np.sum(np.square(gram))) if total > 0.0 else 1.0


def _sensor(robot: Robot, run: Run) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Standard deviation and effective number of samples of what sensors add to each channel of a run."""
    mode = mode_of(run)
    if mode == "unknown":
        return _through_inverse_dynamics(robot, run)
    sigma: dict[str, Vector] = {}
    samples: dict[str, Vector] = {}
    for name in (name for name in MEASURED if run.has(name)):
        noise = noise_in(run, name)
        size = 3 if name.startswith("ee") else run.n
        sigma[name] = noise.sigma * np.ones(size)
        there = np.isfinite(run.signals[name][run.judged]).any(axis=1)
        samples[name] = _independent(noise, int(there.sum())) * np.ones(size)
    if mode == "pd":
        _add_loop(robot, run, sigma)
    if mode == "torque":
        _add_start(robot, run, sigma, samples)
    return sigma, samples


def _independent(noise: ChannelNoise, m: int) -> Vector:
    """Effective number of samples of squares (Bartlett): m / sum of the squared autocorrelations, shape (n,)."""
    return np.array([m / _squared_correlation(ar) for ar in noise.ar])


def _squared_correlation(ar: Vector) -> float:
    """Sum over all lags, 0 and both signs, of the squared autocorrelation of an autoregressive process (p,)."""
    if not np.any(ar):
        return 1.0
    response = response_of(ar)
    lags = len(response)
    spectrum = np.abs(np.fft.rfft(response, 2 * lags)) ** 2
    correlation = np.fft.irfft(spectrum)[:lags]
    correlation = correlation / correlation[0]
    return float(2.0 * np.sum(np.square(correlation)) - 1.0)


def _drawn(run: Run, noise: ChannelNoise, seed: int) -> Vector:
    """Noise of a channel like the recorded one, shape (m, n)."""
    signal: Any = import_module("scipy.signal")

    m, warm = len(run.t), 500
    white = np.random.default_rng(seed).normal(size=(m + warm, len(noise.sigma)))
    out = np.empty((m, len(noise.sigma)))
    for i, (sigma, ar) in enumerate(zip(noise.sigma, noise.ar, strict=True)):
        coloured = np.asarray(signal.lfilter([1.0], np.concatenate([[1.0], -ar]), white[:, i]))[warm:]
        out[:, i] = float(sigma) * coloured / max(float(np.std(coloured)), 1e-300)
    return out


def _add_loop(robot: Robot, run: Run, sigma: dict[str, Vector]) -> None:
    """Mode pd: what a controller makes of its sensors' noise, as torque and as motion, into sigma.

    A log may state what its sensors scatter by, but not whether the controller saw that. Where the record does not
    show it plainly, the torque's scatter bounds it: speed that is not recorded is taken to scatter by what is left
    there.
    """
    q, control = noise_in(run, "q"), run.control
    kp, kd = np.array(control.kp), np.array(control.kd)
    sees = _sees(run) if len(kp) else False
    if sees is False:
        return
    if sees is None and run.has("tau"):
        # an estimated torque's scatter has the loop's in it
        seen = noise_in(_unstated(run), "tau").sigma
        own = sigma["tau"] if "tau" in run.noise else np.zeros(run.n)
        excess = np.sqrt(np.where(seen > BEYOND * own, seen**2 - own**2, 0.0))
    else:
        # what is plain needs no bound
        excess = np.full(run.n, np.inf)
    if run.has("dq"):
        speed = noise_in(run, "dq")
    else:
        # of a speed that is not recorded nothing is known but what a stated torque's scatter leaves for it
        left = np.sqrt(np.maximum(excess**2 - (kp * q.sigma) ** 2, 0.0)) if "tau" in run.noise else np.zeros(run.n)
        scatter = np.divide(left, kd, out=np.zeros(run.n), where=(kd > 0.0) & np.isfinite(left))
        speed = ChannelNoise(scatter, np.zeros((run.n, 1)), np.zeros(run.n), stated=False)
    grid = smoothed(run)
    draws = [(_drawn(run, q, 11 + k), _drawn(run, speed, 51 + k)) for k in range(LOOPS)]
    count = min(len(run.t), int(LOOP_TIME * run.rate))
    at = np.clip(np.round(run.t[:count] / grid.h).astype(np.int64), 0, len(grid.t) - 1)
    rotor = np.diag([0.0 if stage.drive.dummy else stage.drive.inertia for stage in robot.stages])
    arms = dynamics(robot, always_compiled=True).mass_matrix(grid.q[at])
    mass = arms + rotor
    torque = np.array([kp * one[:count] + kd * other[:count] for one, other in draws])
    way, rate = _giving_way(mass, kp, kd, torque, 1.0 / run.rate, 0)
    # what came before the first instant is not followed: its settling is left out
    half = slice(count // 4, None)
    shaken, hurried = (np.std(values[:, half], axis=(0, 1)) for values in (way, rate))
    asked = torque + kp * way + kd * rate
    # of what motors give, their rotors keep a part from the arms
    borne = np.einsum("kij,pkj->pki", arms @ np.linalg.inv(mass), asked)
    reported, passed = (np.std(values[:, half], axis=(0, 1)) for values in (asked, borne))
    # nothing shakes the robot more than the torque's own scatter tells; but a controller hears all its sensors, or
    # none, and of a joint whose own torque sensor hides that the others tell
    true = np.minimum(1.0, excess / np.maximum(reported, 1e-300))
    told_by = reported / np.maximum(noise_in(run, "tau").sigma, 1e-300) if run.has("tau") else np.ones(run.n)
    true = np.maximum(true, np.linalg.norm(true * told_by) / max(float(np.linalg.norm(told_by)), 1e-300))
    jacobian = kinematics(robot).jacobian(grid.q[:: max(1, len(grid.t) // 50)])
    added = {"q": shaken, "q_link": shaken, "dq": hurried, "tau_link": passed}
    # where nothing else is known, an estimated torque's scatter has the loop's in it already
    apart = np.ones(run.n, dtype=bool) if "tau" in run.noise else told(run)
    added |= {"tau": reported * apart} if apart is not None else {}
    added = {name: values * true for name, values in added.items()}
    for name, rows in (("ee", jacobian[:, :3]), ("ee_rot", jacobian[:, 3:])):
        added[name] = np.sqrt(np.mean(np.sum(np.square(rows * (shaken * true)), axis=2), axis=0))
    for name in (name for name in sigma if name in added):
        sigma[name] = np.hypot(sigma[name], added[name])


@lru_cache(maxsize=64)
def _unstated(run: Run) -> Run:
    """The run as if no log stated any noise, nor those of the runs beside it."""
    return replace(run, noise={}, beside=tuple(_unstated(one) for one in run.beside))


def _sees(run: Run) -> bool | None:
    """Whether the controller's torque follows the noise of the recorded positions and speeds; None: not to be told.

    Rounding may hide that it does, and cannot make it look as if it did.
    """
    part = hears(run)
    # many times what it should be is something else: the steps of a held command, a loud torque sensor
    if part is None or part > 1.0 / SEEN:
        return None
    if part >= SEEN:
        return True
    rounded = any(np.any(noise_in(run, name).step > 0.0) for name in ("q", "dq", "tau"))
    return None if rounded else False


def _through_inverse_dynamics(robot: Robot, run: Run) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Mode unknown: torque's noise behind the filter, and the position's behind filter, derivatives and masses."""
    grid, arms = smoothed(run), dynamics(robot, always_compiled=True)
    inside = settled(grid)
    rotor = np.array([0.0 if stage.drive.dummy else stage.drive.inertia for stage in robot.stages])
    base = arms.inverse_dynamics(grid.q, grid.dq, grid.ddq) + rotor * grid.ddq
    names = [name for name in ("tau", "tau_link") if run.has(name)]
    found: dict[str, list[Vector]] = {name: [] for name in names}
    for draw in range(DRAWS):
        extra = {name: _drawn(run, noise_in(run, name), 100 * draw + k) for k, name in enumerate(("q", *names))}
        other = prepared(run, grid.band, extra)
        torque = arms.inverse_dynamics(other.q, other.dq, other.ddq) + rotor * other.ddq - base
        for name in names:
            found[name].append((other.measured[name] - grid.measured[name] - torque)[inside])
    sigma = {name: np.sqrt(np.mean(np.square(values), axis=(0, 1))) for name, values in found.items()}
    return sigma, {name: np.array([_effective(v[0][:, i]) for i in range(run.n)]) for name, v in found.items()}


def _effective(values: Vector) -> float:
    """Effective number of samples of the squares of a series (m,)."""
    m = len(values)
    power = np.abs(np.fft.rfft(values - np.mean(values), 2 * m)) ** 2
    correlation = np.fft.irfft(power)[:m]
    if correlation[0] <= 0.0:
        return float(m)
    correlation = correlation / correlation[0]
    # beyond a tenth of the record there is nothing but chance
    return float(max(2.0, m / (2.0 * np.sum(np.square(correlation[: max(2, m // 10)])) - 1.0)))


def _add_start(robot: Robot, run: Run, sigma: dict[str, Vector], samples: dict[str, Vector]) -> None:
    """Mode torque: what noise in a window's first state grows to within it, into sigma and samples."""
    grid = smoothed(run)
    noise = noise_in(run, "q")
    starts = np.array(window_edges(run)[:-1])
    at = np.clip(np.round(starts / grid.h).astype(np.int64), 0, len(grid.t) - 1)
    others = [prepared(run, grid.band, {"q": _drawn(run, noise, seed)}) for seed in range(DRAWS)]
    place = np.sqrt(np.mean([np.square((other.q - grid.q)[at]) for other in others], axis=(0, 1)))
    speed = np.sqrt(np.mean([np.square((other.dq - grid.dq)[at]) for other in others], axis=(0, 1)))
    grown = np.sqrt(place**2 + speed**2 * WINDOW**2 / 3.0)
    through = kinematics(robot).jacobian(grid.q[:: max(1, len(grid.t) // 50)])
    if "q_link" in sigma:
        # arms are held against their motors
        sigma["q_link"] = np.hypot(sigma["q_link"], noise.sigma)
        samples["q_link"] = np.minimum(samples["q_link"], samples["q"])
    added = {"q": grown, "dq": speed}
    added["ee"] = np.sqrt(np.mean(np.sum(np.square(through[:, :3] * grown), axis=2), axis=0))
    added["ee_rot"] = np.sqrt(np.mean(np.sum(np.square(through[:, 3:] * grown), axis=2), axis=0))
    for name in (name for name in sigma if name in added):
        a, b = sigma[name] ** 2, added[name] ** 2
        samples[name] = (a + b) ** 2 / np.maximum(a * a / samples[name] + b * b / len(starts), 1e-300)
        sigma[name] = np.sqrt(a + b)


def _every(run: Run) -> int:
    """Rows of the smoothed motion between instants at which tolerances are followed."""
    return max(1, round(1.0 / (TOLERANCE_RATE * smoothed(run).h)))


def tolerance_times(run: Run) -> Vector:
    """Instants at which tolerances are followed [s]."""
    return smoothed(run).t[:: _every(run)]


def tolerance_changes(robot: Robot, tolerance: Tolerance, run: Run) -> dict[str, Vector]:
    """How a run's signals change with one sigma of each number that may be off, at some instants, linearly.

    Torques by inverse dynamics at the measured motion; under a controller (or in windows of given torque) the motion
    gives way as the linearised robot does.

    Returns:
        Signal -> changes, shape (p, k, n), ee and ee_rot (p, k, 3); empty where all tolerances are 0.
    """
    variants = list(perturbed(robot, tolerance))
    if not variants:
        return {}
    grid, every = smoothed(run), _every(run)
    # what an arm does behind its gear it weighs for as well
    q, dq, ddq = (values[::every] for values in behind_gears(robot, grid))
    h = grid.h * every
    arms = dynamics(robot, always_compiled=True)
    base = arms.inverse_dynamics(q, dq, ddq)
    torque = np.array([dynamics(other, always_compiled=True).inverse_dynamics(q, dq, ddq) - base for other in variants])
    chain = kinematics(robot)
    tool, jacobian = chain.tool_and_jacobian(q)
    # what is heavier elsewhere holds its tool where it was
    links = [stage.arm.link for stage in robot.stages]
    tools = [
        tool if [stage.arm.link for stage in other.stages] == links else kinematics(other).tool_in_base(q)
        for other in variants
    ]
    place = np.array([other[:, :3, 3] - tool[:, :3, 3] for other in tools])
    turn = np.array([small_turn(other[:, :3, :3] @ np.swapaxes(tool[:, :3, :3], -1, -2)) for other in tools])
    way, rate = np.zeros_like(torque), np.zeros_like(torque)
    reported = torque
    mode = mode_of(run)
    if mode in ("pd", "torque"):
        kp, kd = (
            np.array(gains) if mode == "pd" and gains else np.zeros(run.n) for gains in (run.control.kp, run.control.kd)
        )
        rotor = np.diag([0.0 if stage.drive.dummy else stage.drive.inertia for stage in robot.stages])
        every_window = round(WINDOW / h) if mode == "torque" else 0
        way, rate = _giving_way(arms.mass_matrix(q) + rotor, kp, kd, torque, h, every_window)
        reported = -(kp * way + kd * rate)
    moved = np.einsum("kij,pkj->pki", jacobian, way)
    changes = {
        "q": way,
        "dq": rate,
        "q_link": way if mode != "torque" else np.zeros_like(way),
        "tau": reported,
        "tau_link": torque,
    }
    changes |= {"ee": place + moved[..., :3], "ee_rot": turn + moved[..., 3:]}
    return changes


def _giving_way(mass: Vector, kp: Vector, kd: Vector, torque: Vector, h: float, window: int) -> tuple[Vector, Vector]:
    """Positions and speeds, shapes (p, k, n), by which a controlled robot gives way to torques it does not know.

    Newmark's method with constant average acceleration on M x'' + Kd x' + Kp x = -torque.

    Args:
        mass: M at every instant, shape (k, n, n).
        kp: Gains on position, shape (n,).
        kd: Gains on speed, shape (n,).
        torque: Shape (p, k, n).
        h: Step [s].
        window: Begin anew from rest at zero every so many instants; 0: never, and begin settled.
    """
    p, k, n = torque.shape
    x, v = np.zeros((p, k, n)), np.zeros((p, k, n))
    held = kp > 0.0
    if not window:
        x[:, 0, held] = -torque[:, 0, held] / kp[held]
    a: Vector = np.zeros((p, n))
    for j in range(1, k):
        if window and j % window == 0:
            continue
        if window and j % window == 1:
            a = _solved(mass[j - 1], -torque[:, j - 1])
        guess = x[:, j - 1] + h * v[:, j - 1] + 0.25 * h * h * a
        speed = v[:, j - 1] + 0.5 * h * a
        left = -torque[:, j] - kp * guess - kd * speed
        a = _solved(mass[j] + np.diag(0.5 * h * kd + 0.25 * h * h * kp), left)
        x[:, j], v[:, j] = guess + 0.25 * h * h * a, speed + 0.5 * h * a
    return x, v


def _solved(matrix: Vector, rows: Vector) -> Vector:
    """Solutions of matrix x = row, a row each, shape (p, n)."""
    return np.asarray(np.linalg.solve(matrix, rows.T).T, dtype=np.float64)


def perturbed(robot: Robot, tolerance: Tolerance) -> Iterator[Robot]:
    """The robot with one number after the other off by one sigma: masses, their centers, moments, lengths, angles."""
    for i, stage in enumerate(robot.stages):
        for arm in _perturbed_arms(stage.arm, tolerance):
            stages = list(robot.stages)
            stages[i] = replace(stage, arm=arm)
            yield replace(robot, stages=tuple(stages))


def _perturbed_arms(arm: Arm, tolerance: Tolerance) -> Iterator[Arm]:
    body, link = arm.inertia, arm.link
    if tolerance.mass and body.mass:
        yield replace(arm, inertia=replace(body, mass=body.mass * (1.0 + tolerance.mass)))
    if tolerance.com and body.mass:
        for axis in range(3):
            com = tuple(value + tolerance.com * (k == axis) for k, value in enumerate(body.com))
            yield replace(arm, inertia=replace(body, com=com))
    if tolerance.inertia:
        for name in ("xx", "yy", "zz"):
            yield replace(arm, inertia=replace(body, **{name: getattr(body, name) * (1.0 + tolerance.inertia)}))
    for size, names in ((tolerance.length, ("a", "d")), (tolerance.angle, ("alpha", "theta", "beta"))):
        if size:
            for name in names:
                yield replace(arm, link=replace(link, **{name: getattr(link, name) + size}))


def significant(left: Mapping[str, Vector], noise: Noise) -> float:
    """Probability that a perfect model would leave a mean square as large in any channel of a run.

    Every channel is tested by itself (`Noise.chance`), by degrees of freedom that know how noise is correlated in time
    and how well its size is known; the smallest probability counts as often as there are channels.

    Args:
        left: Measured minus simulated, (m, n) or (m, 3) a signal.
        noise: Of the run.
    """
    return significance([left], [noise])


def loudest(left: Sequence[Mapping[str, Vector]], noises: Sequence[Noise]) -> float:
    """Largest mean square of a channel over all runs, in units of noise."""
    squares: dict[str, list[Vector]] = {}
    for apart, noise in zip(left, noises, strict=True):
        sigma = noise.sigma
        for name, values in apart.items():
            squares.setdefault(name, []).append((values / np.maximum(sigma[name], 1e-300)) ** 2)
    most = 0.0
    for parts in squares.values():
        whole = np.concatenate(parts)
        there = np.maximum(np.isfinite(whole).sum(axis=0), 1)
        most = max(most, float((np.nansum(whole, axis=0) / there).max()))
    return most


def significance(left: Sequence[Mapping[str, Vector]], noises: Sequence[Noise]) -> float:
    """`significant` over several runs: all of their channels are tested together."""
    found: list[float] = []
    for one, noise in zip(left, noises, strict=True):
        for name in noise.sensor:
            if name in one:
                known = np.isfinite(one[name]).any(axis=0)
                found += noise.chance(name, _mean(np.square(one[name])))[known].tolist()
    return min(1.0, len(found) * min(found)) if found else 1.0
