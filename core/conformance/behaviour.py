"""How an engine behaves: it forgets at reset, hands out copies, shares nothing, enforces no limits, says why not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ..agreement.exercise import exercise
from ..control import Control, default_pd
from ..errors import MbexportError, RefusedError
from ..export import default_program
from ..motion import MotionLaw
from ..representation import Drive, Robot, Slip
from ..simulation import simulate
from ..simulation.backend import Engine, MachineState, Program, Vector
from ..simulation.backends import contract_fault
from ..simulation.step import choose_step, poses_of
from .check import Check, ConformanceError, Refusals, must
from .subject import Subject, robot

ROBOT, OTHER = "planar2r", "pendulum"
STEPS, PIECE = 20, 1.0e-3
# engines that adapt their steps need not cut them as we do
SPLIT = 1.0e-8


def checks() -> Iterator[Check]:
    """Of this module."""
    for check in (words, forgets, bent, copies, alone, pieces, beyond_limits, not_finite, weightless, unstable):
        yield Check("behaviour", check.__name__, check, quick=True)


def words(subject: Subject) -> Refusals:
    """The class says what it is, and the engine's version is known."""
    backend = subject.backend
    fault = contract_fault(backend)
    must(fault is None, f"{fault}")
    must(backend.name.isidentifier(), f"its name {backend.name!r} cannot stand in a command or a file name.")
    must(bool(backend.version()), "it does not know the version of its engine.")
    must(backend.runs, "it runs nothing; this suite is for backends that do.")
    return ()


def forgets(subject: Subject) -> Refusals:
    """After a reset nothing is left of the run before: the same run again gives the same numbers to the last bit."""
    model = _robot()
    with subject.engine(model, _program(subject, model)) as engine:
        first = _run(engine, model)
        _push(engine, 5)
        second = _run(engine, model)
    must(np.array_equal(first, second), f"the same run after a reset differs by {_apart(first, second)!r}.")
    return ()


def bent(subject: Subject) -> Refusals:
    """A run that begins with hysteresis bent begins with its torque, and without where the state does not say so."""
    slips = (Slip(400.0, 2.0), Slip(100.0, 3.0))
    model = _with_drives(robot(ROBOT, "rigid"), lambda drive: replace(drive, slips=slips))
    start = _start(model)
    reach = np.array([slip.level / slip.stiffness for slip in slips])
    # the first joint's wound up by half of what they bear, the second one's back by a quarter
    fixed = np.concatenate([start.theta[0] - 0.5 * reach, start.theta[1] + 0.25 * reach])
    try:
        with subject.engine(model, _program(subject, model)) as engine:
            engine.reset(replace(start, slips=fixed), None)
            wound = engine.friction().copy()
            engine.reset(start, None)
            free = engine.friction().copy()
    except RefusedError as error:
        must("hysteresis" in str(error), f"it refuses hysteresis and does not name it: {error}")
        return (str(error),)
    must(_apart(free, np.zeros(model.n)) < SPLIT, f"a run that says nothing of it begins with {free.tolist()!r} N m.")
    asked = np.array([2.5, -1.25])
    must(_apart(wound, asked) < SPLIT, f"hysteresis bent by {asked.tolist()!r} N m begins with {wound.tolist()!r} N m.")
    return ()


def copies(subject: Subject) -> Refusals:
    """What the engine hands out is the caller's: writing on it changes nothing."""
    model = _robot()
    n = model.n
    with subject.engine(model, _program(subject, model)) as engine:
        engine.reset(_start(model), None)
        _push(engine, 3)
        state = engine.state()
        kept = np.concatenate([state.q, state.dq, state.theta, state.dtheta])
        q, dq = state.q.copy(), state.dq.copy()
        for array in (
            state.q,
            state.dq,
            state.theta,
            state.dtheta,
            engine.friction(),
            engine.transmitted(),
            engine.motor_inertia(),
            engine.mass_matrix(q),
            engine.bias(q, dq),
            engine.inverse_dynamics(q, dq, np.ones(n)),
            *engine.drive_torque(q, dq, q, dq),
            engine.tool_in_base(q),
        ):
            array[...] = 7.0
        state = engine.state()
        now = np.concatenate([state.q, state.dq, state.theta, state.dtheta])
        must(np.array_equal(kept, now), "its state changes when who asked for it writes on the arrays.")
        held = np.ones(n)
        engine.hold(held)
        held += 1e6
        _push(engine, 1, hold=False)
        moved = engine.state()
        engine.reset(_start(model), None)
        _push(engine, 3)
        engine.hold(np.ones(n))
        _push(engine, 1, hold=False)
        again = engine.state()
        must(np.array_equal(moved.q, again.q), "hold keeps the caller's array instead of its numbers.")
    return ()


def alone(subject: Subject) -> Refusals:
    """Two engines of one process that take turns run as each does by itself."""
    one, two = _robot(), robot(OTHER)
    expected: list[Vector] = []
    for model in (one, two):
        with subject.engine(model, _program(subject, model)) as engine:
            expected.append(_run(engine, model))
    with (
        subject.engine(one, _program(subject, one)) as first,
        subject.engine(two, _program(subject, two)) as second,
    ):
        engines = ((first, one), (second, two))
        for engine, model in engines:
            engine.reset(_start(model), None)
        for _ in range(STEPS):
            # first all are told, then all move: what is kept for the process shows
            for engine, _ in engines:
                engine.hold(_push_torque(engine))
            for engine, _ in engines:
                _push(engine, 1, hold=False)
        together = [_numbers(engine) for engine, _ in engines]
    for model, a, b in zip((one, two), expected, together, strict=True):
        must(np.array_equal(a, b), f"{model.name} runs otherwise beside another robot: {_apart(a, b)!r}.")
    return ()


def pieces(subject: Subject) -> Refusals:
    """A time cut into pieces is the same time: what is advanced does not depend on where records fall."""
    model = _robot()
    with subject.engine(model, _program(subject, model)) as engine:
        ends: list[Vector] = []
        for cut in (1, 4):
            engine.reset(_start(model), None)
            engine.hold(np.ones(model.n))
            for _ in range(cut):
                engine.advance(8 * PIECE / cut, 80 // cut)
            must(abs(engine.state().t - 8 * PIECE) < 1e-12, f"after {8 * PIECE!r} s it is {engine.state().t!r} s.")
            ends.append(_numbers(engine))
    must(_apart(*ends) < SPLIT, f"the same steps in four pieces end {_apart(*ends)!r} apart.")
    return ()


def beyond_limits(subject: Subject) -> Refusals:
    """Limits bound the planning of motions and nothing else: a run goes through them as if they were not there."""
    model = _robot()
    law = exercise(model, 0.2)
    middle, speeds, _ = (row[0] for row in law.at(np.array([0.05])))
    stages = tuple(
        replace(
            stage,
            joint=replace(
                stage.joint,
                lower=min(stage.joint.home, float(q)) - 1e-6,
                upper=max(stage.joint.home, float(q)) + 1e-6,
                velocity=0.5 * abs(float(dq)),
                effort=1e-3,
            ),
        )
        for stage, q, dq in zip(model.stages, middle, speeds, strict=True)
    )
    runs = [
        simulate(narrow, subject.backend, law, default_pd(model), duration=0.1)
        for narrow in (model, replace(model, stages=stages))
    ]
    apart = float(np.max(np.abs(runs[0].joints["q"] - runs[1].joints["q"])))
    must(apart < SPLIT, f"a run that leaves the joints' limits differs by {apart!r} from one without limits.")
    return ()


def not_finite(subject: Subject) -> Refusals:
    """A motion that is not finite ends in RefusedError, not in numbers."""
    model = _robot()
    start = _start(model)
    wild = MachineState(0.0, start.q, np.full(model.n, 1e200), start.theta, np.full(model.n, 1e200))
    try:
        trace = simulate(model, subject.backend, exercise(model, 0.1), default_pd(model), start=wild)
    except MbexportError:
        return ()
    except Exception as error:
        raise ConformanceError(f"a motion that is not finite ends in {type(error).__name__}: {error}") from error
    raise ConformanceError(f"speeds of 1e200 rad/s are integrated to {trace.joints['q'][-1]!r}.")


def weightless(subject: Subject) -> Refusals:
    """An elastic joint without inertia of its motor side cannot be moved by torque, and is refused in words."""
    model = _with_drives(robot(ROBOT, "compliant"), lambda drive: replace(drive, inertia=0.0, dummy=False))
    program = replace(default_program(model, exercise(model, 1.0), Control("torque")), step=1e-4)
    try:
        with subject.engine(model, program) as engine:
            engine.reset(_start(model), None)
    except RefusedError as error:
        must("joint_" in str(error), f"the refusal does not say which joint: {error}")
        return ()
    except Exception as error:
        raise ConformanceError(f"a motor side without inertia ends in {type(error).__name__}: {error}") from error
    raise ConformanceError("a motor side without inertia may be moved by torque.")


def unstable(subject: Subject) -> Refusals:
    """A step beyond what the backend says is stable is refused, and the stable one is named."""
    if subject.backend.stable == float("inf"):
        return ()
    model = robot(ROBOT, "compliant")
    try:
        simulate(model, subject.backend, exercise(model, 0.1), default_pd(model), step=0.05)
    except RefusedError as error:
        must("stable" in str(error), f"the refusal names no stable step: {error}")
        return ()
    raise ConformanceError("a step of 0.05 s was taken on a robot with springs.")


def _robot() -> Robot:
    """With springs, rotors and friction that has a memory."""
    return robot(ROBOT)


def _with_drives(model: Robot, change: Callable[[Drive], Drive]) -> Robot:
    return replace(model, stages=tuple(replace(stage, drive=change(stage.drive)) for stage in model.stages))


def _program(subject: Subject, model: Robot) -> Program:
    law: MotionLaw = exercise(model, 1.0)
    step = choose_step(model, subject.backend, imposed=False, poses=poses_of(model, law))
    return replace(default_program(model, law, Control("torque")), step=step)


def _start(model: Robot) -> MachineState:
    q = np.array(model.home()) + 0.1
    still = np.zeros(model.n)
    return MachineState(0.0, q, still, q.copy(), still.copy())


def _push(engine: Engine, pieces: int, *, hold: bool = True) -> None:
    """Let it run for some milliseconds, under a torque that differs from joint to joint."""
    if hold:
        engine.hold(_push_torque(engine))
    for _ in range(pieces):
        engine.advance(PIECE, 20)


def _push_torque(engine: Engine) -> Vector:
    return np.linspace(1.0, 3.0, engine.n)


def _run(engine: Engine, model: Robot) -> Vector:
    engine.reset(_start(model), None)
    _push(engine, STEPS)
    return _numbers(engine)


def _numbers(engine: Engine) -> Vector:
    state = engine.state()
    return np.concatenate([state.q, state.dq, state.theta, state.dtheta, engine.friction(), engine.transmitted()])


def _apart(a: Vector, b: Vector) -> float:
    return float(np.max(np.abs(a - b)))
