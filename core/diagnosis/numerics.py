"""Suspects that are no physics, tried before any effect: the integrator's step, the controller's hold, the stamps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..expansion import expanded
from ..recording import Run
from ..recording.run import MEASURED
from ..representation import Robot
from ..simulation import Backend, backend_named
from ..simulation.step import choose_step, poses_of
from .noise import Noise
from .resimulate import linear, mode_of, residuals, resimulated

Vector = NDArray[np.float64]

# a controller that ticks so much faster is nearly a continuous one
FASTER = 4
# a shift is told where it stands so many standard errors above none, and is so many samples long
CLEAR, SHORTEST = 5.0, 0.1
# channels that say the same shift agree to this part of it, or of a sample
AGREE = 0.25
# of a gap that only one sensor's word makes one of stamps, the part that a shift may leave
LEAVES = 0.1
# stamps that are further off than so many samples are no matter of counting
FURTHEST = 3.0


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
    step_error = _apart(base, resimulated(robot, nominal, run, engine, step=0.5 * step))
    hold_error: dict[str, Vector] = {}
    if (quick := without_hold(run)) is not None:
        hold_error = _apart(base, resimulated(robot, nominal, quick, engine, step=step))
    notes = [_said(f"Half the step ({0.5 * step!r} s) changes the simulation of {run.name}", step_error, noise)]
    if hold_error:
        notes.append(_said(f"A controller {FASTER} times as fast changes that of {run.name}", hold_error, noise))
    return Numerics(step, step_error, hold_error, tuple(notes))


def without_hold(run: Run) -> Run | None:
    """The run of a controller that ticks FASTER times as fast, nearly a continuous one; None where none ticks."""
    control = run.control
    return replace(run, control=replace(control, rate=FASTER * control.rate)) if control.mode == "pd" else None


def hold_said(run: Run) -> str:
    """A sentence on a gap that goes with the hold."""
    return (
        f"The gap in {run.name} is that of a controller that acts without a hold: it is compared with one that ticks "
        f"{FASTER} times as fast. That is numerics and no effect."
    )


def shift_said(run: Run, shift: float) -> str:
    """What to say of stamps that are off by a shift [s]; of one joint's positions alone that they may be right."""
    alone = run.n == 1 and shift > 0.0 and not (run.has("tau") or run.has("tau_link"))
    return (
        f"All that was measured in {run.name} comes {1e3 * shift:.3f} ms ({shift * run.rate:.2f} samples) "
        f"{'after' if shift > 0.0 else 'before'} its stamps; that is taken out and is no effect."
        + (" Viscous friction would hold its one joint back alike: only a torque could tell." if alone else "")
    )


def step_of(robot: Robot, run: Run, backend: Backend) -> float:
    """Integration step that a simulation of the run takes [s]."""
    imposed = run.control.mode in ("motion", "unknown")
    whole = expanded(robot, imposed=imposed)
    poses = whole.spread(poses_of(robot, run.motion()))
    return choose_step(whole.robot, backend, imposed=imposed, poses=poses)


def shift_of(run: Run, simulated: Mapping[str, Vector], noise: Noise) -> float:
    """By how much measured signals come later than simulated ones, if all channels say the same [s]; else 0.

    A delay of the drives is another thing: there the torque is late against the controller, while position, torque
    and tool were recorded at one instant, so that their shifts differ.
    """
    if mode_of(run) in ("torque", "unknown"):
        # their simulation begins from what was measured
        return 0.0
    left, sigma = residuals(run, simulated), noise.sigma
    shifts: list[float] = []
    errors: list[float] = []
    signals: set[str] = set()
    # the arm side and the tool go with the motors; a torque is another witness
    witnesses: set[tuple[bool, int]] = set()
    before, after = 0.0, 0.0
    for name in (name for name in ("q", "tau", "ee", "q_link", "tau_link") if name in left):
        rates: Vector = np.asarray(np.gradient(simulated[name], run.t, axis=0))
        for i in range(simulated[name].shape[1]):
            good = np.isfinite(left[name][:, i])
            kept: Vector = rates[good, i]
            rate: Vector = kept - (float(kept.mean()) if good.any() else 0.0)
            power = float(np.sum(rate**2))
            error = float(sigma[name][i]) / np.sqrt(power) if power > 0.0 else np.inf
            # a channel that could not tell a tenth of a sample has no say
            if error * run.rate < SHORTEST / 2.0:
                here: Vector = left[name][good, i] / float(sigma[name][i])
                shift = -float(rate @ left[name][good, i]) / power
                shifts.append(shift)
                errors.append(error)
                signals.add(name)
                if name != "ee":
                    witnesses.add((name.startswith("tau"), i))
                before += float(here @ here) - len(here)
                after += float(np.sum((here + shift * rate / float(sigma[name][i])) ** 2)) - len(here)
    if len(shifts) < 2:
        return 0.0
    if run.has("tau") and "tau" not in signals:
        return 0.0
    values, spread = np.array(shifts), np.array(errors)
    common = float(np.median(values))
    error = float(1.0 / np.sqrt(np.sum(1.0 / spread**2)))
    clear = abs(common) > max(CLEAR * error, SHORTEST / run.rate) and abs(common) < FURTHEST / run.rate
    near = np.abs(values - common) < np.maximum(AGREE * max(abs(common), SHORTEST / run.rate), 4.0 * spread)
    # alone, what holds a joint back looks late as well
    sure = len(witnesses) > 1 or after < LEAVES * before
    return common if clear and sure and near.all() else 0.0


def unshifted(run: Run, shift: float) -> Run:
    """The run with what was measured put back by a shift [s]; the command stays where it is."""
    if not shift:
        return run
    signals = dict(run.signals)
    for name in (name for name in MEASURED if run.has(name)):
        signals[name] = linear(run.t, run.signals[name], run.t + shift)
    return replace(run, signals=signals)


def _apart(one: Mapping[str, Vector], other: Mapping[str, Vector]) -> dict[str, Vector]:
    return {
        name: np.sqrt(np.mean(np.square(values - other[name]), axis=0))
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
