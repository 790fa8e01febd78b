"""Running one scenario in one engine, first-order integrators at two steps and extrapolated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..expansion import expanded
from ..representation import Robot
from ..simulation import simulate
from ..simulation.backend import Backend, Program, Vector
from ..simulation.program import whole_program
from ..simulation.step import choose_step, poses_of
from ..simulation.trace import Trace
from .gates import Manner, manner_of
from .scenarios import Scenario


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What is compared of a run.

    Attributes:
        voice: Backend's name.
        manner: How it came to its numbers.
        step: Integration step [s]; of an extrapolated one the larger.
        half: The run at half the step, which serves the extrapolation, the order, and what a step leaves open.
        t: Times [s], shape (m,).
        tip: Tool centre point in the base [m], shape (m, 3).
        theta, dtheta: Motor side, shape (m, n).
        q_link: Arm side, shape (m, n).
        tau: Torques of the motors, shape (m, n).
        knocks: Play opened and closed in this run. There a damper's torque jumps, and a step that meets it leaves an
            error of first order whatever the integrator, another one at every meeting: no smaller step takes it out
            as smooth equations let it, and no extrapolation.
    """

    voice: str
    manner: Manner
    step: float
    half: bool
    t: Vector
    tip: Vector
    theta: Vector
    dtheta: Vector
    q_link: Vector
    tau: Vector
    knocks: bool = False


def run_all(scenario: Scenario, backend: Backend) -> Iterator[Run]:
    """The runs of one engine.

    Raises:
        RefusedError: The engine refuses the robot or the step, or the motion does not stay finite.
    """
    manner = manner_of(backend)
    step = step_of(scenario, backend)
    whole = one_run(scenario, backend, step)
    yield whole
    # imposed motion of rigid joints is not integrated
    first = manner == "first" and scenario.integrated
    if not (first or whole.knocks):
        return
    half = one_run(scenario, backend, step / 2, half=True)
    yield half
    if not first:
        return
    yield Run(
        whole.voice,
        "extrapolated",
        step,
        False,
        whole.t,
        *(
            2.0 * fine - coarse
            for fine, coarse in (
                (half.tip, whole.tip),
                (half.theta, whole.theta),
                (half.dtheta, whole.dtheta),
                (half.q_link, whole.q_link),
                (half.tau, whole.tau),
            )
        ),
        knocks=whole.knocks or half.knocks,
    )


def refusal(scenario: Scenario, backend: Backend) -> str | None:
    """Why a backend does not run a scenario; None where it does."""
    whole = expanded(scenario.robot, imposed=scenario.imposed)
    program = Program(scenario.motion, scenario.control, scenario.duration, step_of(scenario, backend))
    return backend.refusal(whole.robot, whole_program(whole, program))


def no_run(like: Run, voice: str) -> Run:
    """The run of an engine that broke down, as another one would have it: no numbers."""
    nothing = np.full_like(like.theta, np.nan)
    tip = np.full_like(like.tip, np.nan)
    return Run(voice, like.manner, like.step, False, like.t, tip, nothing, nothing, nothing, nothing)


def step_of(scenario: Scenario, backend: Backend) -> float:
    """The backend's own step; of a first-order one at most what its gate is for [s]."""
    whole = expanded(scenario.robot, imposed=scenario.imposed)
    poses = whole.spread(poses_of(scenario.robot, scenario.motion))
    own = choose_step(whole.robot, backend, imposed=scenario.imposed, poses=poses, compiled=True)
    return min(own, scenario.first_step) if backend.gate_class == "B" else own


def one_run(scenario: Scenario, backend: Backend, step: float, *, half: bool = False) -> Run:
    """One run at one step."""
    trace: Trace = simulate(
        scenario.robot, backend, scenario.motion, scenario.control, duration=scenario.duration, step=step
    )
    offset = np.array([stage.sensor.position_offset for stage in scenario.robot.stages])
    return Run(
        backend.name,
        manner_of(backend) if scenario.integrated else "algebra",
        step,
        half,
        trace.t,
        trace.tip,
        trace.joints["q"] - offset,
        trace.joints["dq"],
        trace.joints["q_link"],
        trace.joints["tau"],
        _knocks(scenario.robot, trace.joints["tau_link"]),
    )


def _knocks(robot: Robot, passed: Vector) -> bool:
    """Whether what a drive with play passes to its arm, shape (m, n), comes, goes or turns round."""
    played = [stage.drive.spring is not None and stage.drive.spring.gap > 0.0 for stage in robot.stages]
    sides = np.sign(passed[:, played])
    return bool(np.any(sides != sides[:1]))
