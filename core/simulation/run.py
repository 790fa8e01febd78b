"""Running a robot in an engine: imposed motion, or torque under a controller at its own rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RefusedError, UsageError
from ..expansion import Expansion, expanded
from ..representation import JointKind, Robot
from ..signals import joint_unit
from .backend import Backend, Engine, MachineState, Program, Vector
from .backends import backend_named
from .program import whole_program
from .settle import controlled_start, imposed_start
from .step import choose_step, poses_of
from .timeline import INSTANT, Rows, Timeline
from .trace import Trace

if TYPE_CHECKING:
    from ..control import Control, Controller, ControllerUnit, UnitController
    from ..motion import MotionLaw

DEFAULT_RATE = 1000.0
# instants of a run that an engine goes through at once: an interrupt and the bar wait for no more
AT_ONCE = 1000
# a joint this far beyond a limit is at it [rad or m]
AT_LIMIT = 1.0e-9

Tell = Callable[[float], None]


def simulate(
    robot: Robot,
    backend: Backend | str,
    motion: MotionLaw | str,
    control: Control | None = None,
    *,
    duration: float | None = None,
    rate: float = DEFAULT_RATE,
    step: float | None = None,
    start: MachineState | None = None,
    torque: Vector | None = None,
    unit: ControllerUnit | None = None,
    nominal: Robot | None = None,
    without: Collection[str] = (),
    progress: bool = False,
) -> Trace:
    """Run a robot and record what a real one would.

    Args:
        robot: At its level.
        backend: A backend or its name.
        motion: Commanded joint motion, or its name ("greca", "excitation", "hold").
        control: Controller; None imposes the motion on the motor sides.
        duration: How long [s]; None: the motion's duration.
        rate: Rate of the record [Hz].
        step: Integration step [s]; None: chosen from the largest eigenvalue.
        start: State at t = 0; None: settled (log.md).
        torque: Mode torque: commanded torque at each tick of the controller [N m or N], shape (ticks, n).
        unit: Controller of others, a unit of FMI 2.0, whose native code runs in this process; `control`, where it is
            given, is of mode torque and says rate and limit.
        nominal: Robot whose rigid bodies the feedforward uses; None: this one.
        without: What nobody will look at, of "tau_link" and "tool": a controlled run without both takes three fifths
            of the time. The tool's pose is NaN then.
        progress: Show a progress bar on standard error.

    Raises:
        RefusedError: The backend refuses this robot, or the step is unstable.
        UsageError: Options that do not fit together.
    """
    from ..control import Control, Controller, UnitController
    from ..motion import motion_named

    engine_backend = backend_named(backend) if isinstance(backend, str) else backend
    law = motion_named(robot, motion) if isinstance(motion, str) else motion
    rules = control or (unit.control() if unit else Control())
    length = law.duration if duration is None else duration
    _check(robot, law, rules, length, rate, torque, unit)
    imposed = rules.mode == "motion"
    whole = expanded(robot, imposed=imposed)
    # the torques of a run come from the controller here; the engine's program only has to fit the robot
    plan = Program(law, replace(rules, feedforward="none"), length, engine_backend.largest_step)
    # what it refuses has no step either
    engine_backend.insist_on(whole.robot, whole_program(whole, plan))
    poses = whole.spread(poses_of(robot, law))
    h = choose_step(whole.robot, engine_backend, imposed=imposed, poses=poses, step=step, compiled=True)
    program = whole_program(whole, replace(plan, step=h))
    engine = engine_backend.engine_for(whole.robot, program)
    outside: UnitController | None = None
    try:
        times = _record_times(length, rate)
        # the drives follow what the encoders report
        offsets = np.array([stage.sensor.position_offset for stage in whole.robot.stages])
        followed = program.motion.shifted(-offsets) if offsets.any() else program.motion
        with _bar(progress, length) as tell:
            if imposed and not any(stage.drive.spring for stage in whole.robot.stages):
                record = _kinematic(whole.robot, engine, followed, times, h)
            elif imposed:
                begin = start or imposed_start(whole.robot, engine, followed)
                record = _elastic(whole.robot, engine, followed, times, h, begin, tell)
            else:
                if unit:
                    controller = outside = UnitController(unit, robot, rules, law, length)
                else:
                    controller = Controller(nominal or robot, robot, rules, law, length, torque)
                spread = _SpreadController(controller, whole) if whole.passive else controller
                begin = start or controlled_start(whole.robot, engine, followed, spread)
                passed = "tau_link" not in without
                record = _controlled(whole.robot, engine, spread, times, h, begin, tell, passed=passed)
        tool = np.full((len(times), 4, 4), np.nan) if "tool" in without else engine.tools_in_base(record.q)
        record.keep(whole.driven)
        asked = outside.asked() if outside else torque
        trace = _trace(robot, engine_backend, law, rules, times, record, tool, h, length, asked, without)
        return _told_of(trace, unit, outside, law) if unit and outside else trace
    finally:
        if outside:
            outside.close()
        engine.close()


class _SpreadController:
    """A controller of the driven joints of a robot that has passive ones too."""

    def __init__(self, controller: Controller, whole: Expansion) -> None:
        self._controller, self._whole, self._driven = controller, whole, list(whole.driven)
        self.kp = whole.spread(controller.kp)
        self.tick_times, self.switch_times = controller.tick_times, controller.switch_times
        self.reset = controller.reset

    def feedforward_at_start(self) -> Vector:
        return self._whole.spread(self._controller.feedforward_at_start())

    def tick(self, k: int, q: Vector, dq: Vector) -> None:
        self._controller.tick(k, q[self._driven], dq[self._driven])

    def held(self, k: int) -> Vector:
        return self._whole.spread(self._controller.held(k))

    def table(self) -> None:
        return


def _told_of(trace: Trace, unit: ControllerUnit, controller: UnitController, law: MotionLaw) -> Trace:
    """A run under a unit: its command beside the torque that it asked for, and what the unit is."""
    q_cmd, dq_cmd, ddq_cmd = law.at(trace.t)
    start = "in equilibrium under the controller" if controller.settles else "at rest at the command"
    joints = {"q_cmd": q_cmd, "dq_cmd": dq_cmd, "ddq_cmd": ddq_cmd, **trace.joints}
    return replace(trace, joints=joints, facts={**trace.facts, "controller": {**unit.facts(), "start": start}})


def _check(
    robot: Robot,
    law: MotionLaw,
    control: Control,
    duration: float,
    rate: float,
    torque: Vector | None,
    unit: ControllerUnit | None,
) -> None:
    from ..control import check_unit

    if law.n != robot.n:
        raise UsageError(f"the motion has {law.n} joints, {robot.name} has {robot.n}.")
    if not duration > 0.0:
        raise UsageError(f"duration {duration!r} s: it must be above 0.")
    if not rate > 0.0:
        raise UsageError(f"rate {rate!r} Hz: it must be above 0.")
    if control.mode == "unknown":
        raise UsageError("control mode unknown cannot be simulated; use motion, pd or torque.")
    if unit is not None:
        if torque is not None:
            raise UsageError(f"{unit.path.name} is the controller, and torques were given beside it: leave them out.")
        check_unit(robot, control, unit)
    elif (control.mode == "torque") != (torque is not None):
        raise UsageError("control mode torque and a commanded torque, or a controller's unit, go together.")


@dataclass(slots=True)
class _Record:
    """What is recorded at each time, arrays of shape (m, n): true states and torques."""

    q: Vector
    dq: Vector
    theta: Vector
    dtheta: Vector
    tau: Vector
    tau_link: Vector

    @staticmethod
    def empty(m: int, n: int) -> _Record:
        return _Record(*(np.zeros((m, n)) for _ in range(6)))

    def keep(self, joints: Sequence[int]) -> None:
        """Only these joints, in this order."""
        chosen = list(joints)
        for name in ("q", "dq", "theta", "dtheta", "tau", "tau_link"):
            setattr(self, name, getattr(self, name)[:, chosen])

    def put(self, k: int, state: MachineState) -> None:
        self.q[k], self.dq[k] = state.q, state.dq
        self.theta[k], self.dtheta[k] = state.theta, state.dtheta


def _record_times(duration: float, rate: float) -> Vector:
    count = int(np.floor(duration * rate + INSTANT * rate)) + 1
    return np.arange(count) / rate


def _motor_inertia(robot: Robot, engine: Engine) -> Vector:
    """Inertia that a drive feels when its motion is imposed: the rotor's; the paper's dummy part counts 0."""
    dummy = np.array([stage.drive.dummy for stage in robot.stages])
    return np.where(dummy, 0.0, engine.motor_inertia())


def _kinematic(robot: Robot, engine: Engine, law: MotionLaw, times: Vector, h: float) -> _Record:
    """Rigid joints with imposed motion: nothing to integrate but friction's memory, the drives give what is asked."""
    q, dq, ddq = law.at(times)
    record = _Record(q, dq, q, dq, np.zeros_like(q), np.zeros_like(q))
    rotor = _motor_inertia(robot, engine)
    engine.reset(MachineState(float(times[0]), q[0], dq[0], q[0], dq[0]), law)
    for k, t in enumerate(times):
        if k:
            span = float(t - times[k - 1])
            engine.advance(span, _steps(span, h))
        on_arm, _ = engine.drive_torque(q[k], dq[k], q[k], dq[k])
        passed = engine.inverse_dynamics(q[k], dq[k], ddq[k]) - on_arm
        record.tau_link[k] = passed
        record.tau[k] = passed + rotor * ddq[k] + engine.friction()
    return record


def _elastic(
    robot: Robot, engine: Engine, law: MotionLaw, times: Vector, h: float, begin: MachineState, tell: Tell
) -> _Record:
    """Motion imposed on the motor sides of elastic joints."""
    record = _Record.empty(len(times), robot.n)
    rotor = _motor_inertia(robot, engine)
    _, _, ddtheta = law.at(times)
    rigid = np.array([stage.drive.spring is None for stage in robot.stages])
    engine.reset(begin, law)
    for k, t in enumerate(times):
        if k:
            span = float(t - times[k - 1])
            engine.advance(span, _steps(span, h))
            tell(span)
        state = engine.state()
        record.put(k, state)
        transmitted, reaction = engine.transmitted(), engine.reaction()
        if rigid.any():
            passed = _passed_by_rigid(engine, state, ddtheta[k], rigid)
            transmitted, reaction = np.where(rigid, passed, transmitted), np.where(rigid, passed, reaction)
        record.tau_link[k] = transmitted
        record.tau[k] = rotor * ddtheta[k] + engine.friction() + reaction
    return record


def _passed_by_rigid(engine: Engine, state: MachineState, ddtheta: Vector, rigid: NDArray[np.bool_]) -> Vector:
    """Torque that rigid joints pass to the arms while the others are elastic, shape (n,)."""
    from .imposed import rigid_joint_torques

    on_arm, _ = engine.drive_torque(state.q, state.dq, state.theta, state.dtheta)
    return rigid_joint_torques(
        engine.mass_matrix(state.q),
        engine.bias(state.q, state.dq),
        np.where(rigid, 0.0, on_arm),
        rigid,
        ddtheta,
    ) - np.where(rigid, on_arm, 0.0)


def _controlled(
    robot: Robot,
    engine: Engine,
    controller: Controller | _SpreadController,
    times: Vector,
    h: float,
    begin: MachineState,
    tell: Tell,
    *,
    passed: bool,
) -> _Record:
    """Torque under a controller: ticks, switches of the delayed torque and record times cut the integration."""
    record = _Record.empty(len(times), robot.n)
    offsets = np.array([stage.sensor.position_offset for stage in robot.stages])
    engine.reset(begin, None)
    controller.reset()
    elastic = np.array([stage.drive.spring is not None for stage in robot.stages])
    rubs = any(stage.drive.terms or stage.drive.slips or stage.drive.damping for stage in robot.stages)
    friction = np.zeros_like(record.q)
    ask_friction, ask_transmitted = passed and rubs and not elastic.all(), passed and bool(elastic.any())
    # a delayed robot starts under the torque that settled it, which the first tick does not change
    controller.tick(0, begin.theta + offsets, begin.dtheta)
    held = controller.held(0).copy()
    engine.hold(held)
    # drives are asked step by step only
    law = None if ask_friction or ask_transmitted else controller.table()
    timeline = Timeline.of(times, controller.tick_times, controller.switch_times, h)
    rows = Rows(record.q, record.dq, record.theta, record.dtheta, record.tau)
    for part in timeline.parts(AT_ONCE):
        if law is not None and engine.follow(part, law, offsets, rows):
            tell(float(part.spans.sum()))
            continue
        for span, steps, tick, switch, k in part.instants():
            if steps:
                engine.advance(span, steps)
                tell(span)
            state = engine.state()
            if tick >= 0:
                controller.tick(tick, state.theta + offsets, state.dtheta)
            if switch >= 0:
                held = controller.held(switch)
                engine.hold(held)
            if k >= 0:
                record.put(k, state)
                record.tau[k] = held
                if ask_transmitted:
                    record.tau_link[k] = engine.transmitted()
                if ask_friction:
                    friction[k] = engine.friction()
    if passed:
        record.tau_link = _passed_by_moving(robot, engine, record, friction, elastic)
    return record


def _passed_by_moving(robot: Robot, engine: Engine, record: _Record, friction: Vector, elastic: Vector) -> Vector:
    """Torque behind the gear: T of the spring, or at a rigid joint what friction and rotor leave, shape (m, n)."""
    from ..kinematics import dynamics

    if elastic.all():
        return record.tau_link
    gain = np.array([stage.drive.gain for stage in robot.stages])
    free = gain * record.tau - friction
    driving = np.where(elastic, record.tau_link, free)
    if any(stage.drive.arm_springs or any(term.kind == "arm" for term in stage.drive.terms) for stage in robot.stages):
        states = zip(record.q, record.dq, record.theta, record.dtheta, strict=True)
        # at elastic joints with T, which a gear's error makes where both sides stand alike as well
        on_arm = np.array([engine.drive_torque(*state)[0] for state in states])
        driving = on_arm + np.where(elastic, 0.0, free)
    rotor = np.where(elastic, 0.0, engine.motor_inertia())
    arms = dynamics(robot)
    inertia = arms.mass_matrix(record.q) + np.diag(rotor)
    ddq = np.linalg.solve(inertia, (driving - arms.bias(record.q, record.dq))[..., None])[..., 0]
    return np.where(elastic, record.tau_link, free - rotor * ddq)


def _steps(span: float, h: float) -> int:
    return max(1, math.ceil(span / h - 1.0e-6))


def _trace(
    robot: Robot,
    backend: Backend,
    law: MotionLaw,
    control: Control,
    times: Vector,
    record: _Record,
    tool: Vector,
    h: float,
    duration: float,
    asked: Vector | None,
    without: Collection[str],
) -> Trace:
    q_cmd, dq_cmd, ddq_cmd = law.at(times)
    position = np.array([stage.sensor.position_offset for stage in robot.stages])
    torque = np.array([stage.sensor.torque_offset for stage in robot.stages])
    posed = "tool" in without or np.isfinite(tool).all()
    if not posed or not np.isfinite(record.q).all():
        worst = int(np.argmin(np.isfinite(record.q).all(axis=1)))
        raise RefusedError(
            f"{robot.name} in {backend.engine}: the motion is no longer finite at t = {float(times[worst])!r} s: "
            "take a smaller step or weaker gains."
        )
    joints = {
        "q_cmd": q_cmd,
        "dq_cmd": dq_cmd,
        "ddq_cmd": ddq_cmd,
        "q": record.theta + position,
        "dq": record.dtheta,
        "q_link": record.q,
        "tau": record.tau + torque,
        "tau_link": record.tau_link,
    }
    if "tau_link" in without:
        del joints["tau_link"]
    if asked is not None:
        joints["tau_cmd"] = asked[np.floor(times * control.rate + INSTANT * control.rate).astype(np.int64)]
        for command in ("q_cmd", "dq_cmd", "ddq_cmd"):
            del joints[command]
    facts: dict[str, Any] = {
        "robot": robot.name,
        "level": robot.level,
        "effects": list(robot.effects),
        "source_hash": robot.source_hash,
        "backend": backend.name,
        "engine": backend.engine,
        "version": _version(backend),
        "integrator": backend.integrator,
        "step": h,
        "duration": duration,
        "friction": {"model": robot.friction.model, "velocity": robot.friction.velocity},
        "notes": list(robot.notes),
        "control": control.to_mapping(),
    }
    kinds: tuple[JointKind, ...] = tuple(stage.joint.kind for stage in robot.stages)
    return Trace(times, joints, tool, kinds, facts, tuple(_left_limits(robot, times, record.q)))


@cache
def _version(backend: Backend) -> str:
    """Of the engine; reading it from its distribution takes 10 ms, which many short runs would notice."""
    return backend.version()


def _left_limits(robot: Robot, times: Vector, q: Vector) -> Iterator[str]:
    """Where and when a run left the joints' limits, which bound the planning and which no engine enforces."""
    for i, stage in enumerate(robot.stages):
        joint = stage.joint
        outside = (q[:, i] < joint.lower - AT_LIMIT) | (q[:, i] > joint.upper + AT_LIMIT)
        if outside.any():
            first = float(times[int(np.argmax(outside))])
            unit = joint_unit("q", joint.kind)
            yield (
                f"{joint.name} leaves its limits [{joint.lower!r}, {joint.upper!r}] {unit} at t = {first!r} s "
                f"({int(outside.sum())} of {len(times)} samples, "
                f"from {float(q[:, i].min())!r} to {float(q[:, i].max())!r} {unit})"
            )


@contextmanager
def _bar(wanted: bool, duration: float) -> Generator[Tell, None, None]:
    """A function that is told the seconds simulated, with or without a bar."""
    if not wanted:
        yield _say_nothing
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("simulating", total=duration)

        def advance(span: float) -> None:
            progress.advance(task, span)

        yield advance


def _say_nothing(span: float) -> None:
    """No bar."""
