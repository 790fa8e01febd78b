"""What a robot's sensors would have said along a recorded motor motion: inverse dynamics with every effect."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.controller import feedforward_along
from ..expansion import Expansion
from ..kinematics import Dynamics, rigid_body
from ..representation import Drive, Robot
from ..simulation.compiled import as_it_stands, compile_text
from ..simulation.drives import Drives
from . import along, elastic, play
from .beyond import CONSTANT, LIMIT, Beyond, asked_to_give, at_joints, cut_softly, of_joints, of_springs, places
from .elastic import SpringTable
from .mechanism import Bodies, Itself, Mechanism, Rubbing, mechanism_of, rubbing_of
from .prepare import FEWEST_FILTERED, Prepared, creep_of, filtered, lowpass, ticks_a_row
from .starting_side import Witness

Vector = NDArray[np.float64]

# of its largest torque, a motor with less bears little
LIGHT = 0.1
# a joint that stands for this part of a run stands most of the time, and does not where it moves for so long [s]
STANDS, REST = 0.7, 0.05
# part of all arms' inertia that one without any is taken to have
LEAST_INERTIA = 1.0e-12
# up to this part of a run's band its torque's change is that of its motion, not of its noise
SLOW = 0.25
# what is late by so nearly a number of rows is late by that
WHOLE = 1.0e-6
# before and behind a row [s]
BESIDE = 1.0e-6
# motions of bodies that are kept, so that effects which change none of them need not work them out again
_REMEMBERED = 24
# and what rubs in single joints
_JOINTS = 8 * _REMEMBERED


@dataclass(frozen=True, slots=True, eq=False)
class Said:
    """What sensors would have said; shapes (m, n), ee (m, 3).

    Attributes:
        tau: Motor torque that the motion takes, as it would be reported.
        tau_link: What the drives pass to the arms.
        q_link: Arm sides.
        ee: Tool centre point in the base; zeros where the run has none.
        ee_rot: Rows of the tool's rotation matrix in the base, shape (m, 9); zeros where the run has none.
        u: What the controller asked for, as it would be reported; None where the run has no controller.
    """

    tau: Vector
    tau_link: Vector
    q_link: Vector
    ee: Vector
    ee_rot: Vector
    u: Vector | None


@cache
def _compiled(name: str) -> Any:
    for helper in (
        rigid_body.place_joints,
        rigid_body.newton_euler,
        rigid_body.carry_wrench,
        elastic.hang,
        elastic.mass_matrix_among,
    ):
        as_it_stands(helper)
    module = next(module for module in (along, elastic, play, rigid_body) if hasattr(module, name))
    return compile_text(getattr(module, name))


# what numbers that no robot has make of a motion may be beyond all numbers, and is told from others by that
@np.errstate(over="ignore", invalid="ignore")
def said(robot: Robot, run: Prepared, nominal: Robot, creep: Vector, beyond: Beyond = ()) -> Said:
    """What the sensors of a robot would have said along a run's motor motion.

    Args:
        robot: With its effects.
        run: The motion.
        nominal: Whose rigid bodies the controller's feedforward knows.
        creep: Speed below which a joint counts as standing, where friction is between its levels, shape (n,).
        beyond: What it has beyond the catalogue's laws.
    """
    machine = mechanism_of(robot)
    whole, driven = machine.whole, list(machine.whole.driven)
    moved = _moved(machine.bodies, run, of_springs(beyond), _asked_by(machine, nominal))
    clamped = [driven[joint - 1] for joint in run.run.locked]
    if machine.by_motors:
        friction, on_arm = _rubbed(machine.by_motors, run, machine.offsets, creep)
        passed = moved.load - _but(on_arm, clamped)
    else:
        friction, passed = _rubbed_beside(machine, run, moved, creep, clamped)
    slope, q = moved.slope, moved.q
    if whole.passive:
        passed, friction, slope, q = (values[:, driven] for values in (passed, friction, slope, q))
    imposed = run.run.control.mode in ("motion", "unknown")
    inertia = np.where(machine.dummies, 0.0, machine.rotors) if imposed else machine.rotors
    gain = machine.gain if run.gains_act else np.ones(robot.n)
    droop = np.array(at_joints(beyond, CONSTANT, robot.n)) if run.gains_act else np.zeros(robot.n)
    given = inertia * run.ddq + friction + (1.0 + slope) * passed
    tau = asked_to_give(given, gain, droop)
    if not imposed:
        tau = _held(tau, run, robot.delay)
        if "tau_link" in run.measured and not run.run.locked:
            # rotors keep their part of what a torque jumps by
            rigid = tuple(stage.drive.spring is None for stage in robot.stages)
            part = _part_of_arms(Itself(nominal), rigid, run)
            passed = passed + np.einsum("kij,kj->ki", part, _held(given, run, robot.delay) - given)
    asked = _asked(
        run,
        Itself(nominal),
        robot.kp_factor,
        robot.kd_factor,
        robot.delay,
        machine.limits,
        at_joints(beyond, LIMIT, robot.n),
    )
    if run.run.control.mode == "pd" and (more := _fed_forward(run, Itself(nominal))[1]) is not None:
        tau = tau + more
    bias = machine.bias
    return Said(tau + bias, passed, q, moved.tool, moved.turn, None if asked is None else asked + bias)


def _held(torque: Vector, run: Prepared, delay: float) -> Vector:
    """What rows show of a torque (m, n) along a smooth motion that is held from its tick on, late by a drive's delay.

    It makes what a continuous one would half a tick later.
    """
    rate = run.run.control.rate
    change = np.gradient(torque, run.h, axis=0)
    shown = torque + 0.5 / rate * change
    early = np.ceil(delay * rate - 1e-6) / rate - delay
    # late by other than whole ticks, what acts at a tick acts for a part of one
    return shown - early * _slow(change, run) if early > 0.0 else shown


@lru_cache(maxsize=_JOINTS)
def _part_of_arms(nominal: Itself[Robot], rigid: tuple[bool, ...], run: Prepared) -> Vector:
    """What part of motors' torques that jump reaches the arms, by a robot's bodies, shape (m, n, n).

    Args:
        nominal: The robot: what effects change of its bodies and rotors is a small part of a small part.
        rigid: Of which joints the arm goes as its motor does: behind a spring nothing jumps.
        run: The motion.
    """
    machine = mechanism_of(nominal.kept)
    bodies, driven = machine.bodies, list(machine.whole.driven)
    mass = bodies.arms.mass_matrix(machine.whole.spread(run.q - bodies.offsets))
    behind = np.zeros(mass.shape[1])
    behind[driven] = np.where(rigid, machine.rotors, 0.0)
    # M (M + R)^-1, both of them symmetric; an arm without inertia takes nothing
    heavier = mass + np.diag(behind + LEAST_INERTIA * np.trace(mass, axis1=1, axis2=2).max())
    part = np.swapaxes(np.linalg.solve(heavier, mass), 1, 2)[:, driven][:, :, driven]
    return np.asarray(part * np.array(rigid, dtype=np.float64), dtype=np.float64)


def arms_along(robot: Robot, run: Prepared, nominal: Robot) -> tuple[Vector, Vector]:
    """Positions and speeds of the arm sides along a run's motor motion, bent by what they bear as they move.

    Returns:
        Of all joints, those of soft arms and bearings too, shape (m, k) each.
    """
    machine = mechanism_of(robot)
    moved = _moved(machine.bodies, run, (), _asked_by(machine, nominal))
    return moved.q, moved.dq


def behind_gears(robot: Robot, run: Prepared) -> tuple[Vector, Vector, Vector]:
    """Positions, speeds and accelerations behind gears that err along a run's motor motion, shape (m, n) each."""
    error = _errors(rubbing_of(robot), run, run.q, run.dq)
    return (run.q, run.dq, run.ddq) if error is None else _erring(error, run.h, run.q, run.dq, run.ddq)


def _erring(error: Vector, h: float, q: Vector, dq: Vector, ddq: Vector) -> tuple[Vector, Vector, Vector]:
    """A motion with what gears add to it."""
    rate = np.gradient(error, h, axis=0)
    return q + error, dq + rate, ddq + np.gradient(rate, h, axis=0)


@np.errstate(over="ignore", invalid="ignore")
def stretch_of(robot: Robot, run: Prepared, nominal: Robot, effect: str, at: int, beyond: Beyond = ()) -> Vector:
    """Stretch [rad or m] along a run's motor motion of the softest spring of an effect at a place, shape (m,)."""
    machine = mechanism_of(robot)
    moved = _moved(machine.bodies, run, of_springs(beyond), _asked_by(machine, nominal))
    stretches = (moved.theta - moved.q)[:, places(robot, machine.whole, effect, at)]
    return stretches[:, int(np.argmax(np.mean(stretches**2, axis=0)))]


def _slow(values: Vector, run: Prepared) -> Vector:
    """Without the upper part of what is compared, where a change is that of noise.

    At either end, where the smoothing does not hold and nothing is compared, a change is wild and left out: what is
    slower would carry it far into the run.
    """
    signal: Any = import_module("scipy.signal")

    slow = values.copy()
    inner = slice(run.edge, len(values) - run.edge)
    if len(values) - 2 * run.edge >= FEWEST_FILTERED:
        slow[inner] = signal.sosfiltfilt(lowpass(2, SLOW * run.band, 1.0 / run.h), values[inner], axis=0)
    return slow


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """What a run's motor motion does to the bodies behind the drives; shapes (m, k) of all joints, passive ones too.

    Attributes:
        theta, dtheta: Motor sides.
        q, dq: Arm sides.
        load: Torque that moves the arms.
        slope: Change of the transmission error with the motor's angle.
        tool: Tool centre point in the base, shape (m, 3); zeros where the run has none.
        turn: Rows of its rotation matrix, shape (m, 9); zeros where the run has none.
    """

    theta: Vector
    dtheta: Vector
    q: Vector
    dq: Vector
    load: Vector
    slope: Vector
    tool: Vector
    turn: Vector


def _asked_by(machine: Mechanism, nominal: Robot) -> Itself[Robot] | None:
    """Whose feedforward was asked for, where that may have to tell how arms began; None where nothing has clearance."""
    return Itself(nominal) if machine.loose else None


@lru_cache(maxsize=_REMEMBERED)
def _moved(bodies: Bodies, run: Prepared, stiffening: Beyond, nominal: Itself[Robot] | None) -> _Moved:
    """Motion, load and tool of a robot's bodies; most effects change none of them."""
    offsets, whole, arms = bodies.offsets, bodies.whole, bodies.arms
    full = whole.robot
    theta, dtheta, ddtheta = (whole.spread(x) for x in (run.q - offsets, run.dq, run.ddq))
    error = _errors(bodies.gears, run, theta, dtheta)
    turned, dturned, ddturned = theta, dtheta, ddtheta
    slope = np.zeros_like(theta)
    if error is not None:
        turned, dturned, ddturned = _erring(error, run.h, theta, dtheta, ddtheta)
        moving = np.abs(dtheta) > 1e-9
        slope = np.divide(dturned - dtheta, dtheta, out=slope, where=moving)
    clamped = {whole.driven[joint - 1]: clamped_at(run, joint) - float(offsets[joint - 1]) for joint in run.run.locked}
    stiffens = of_joints(bodies.robot, whole, stiffening)
    motion = _stopped(clamped, turned, dturned, ddturned)
    q, dq, ddq = _arms(full, arms, run, clamped, stiffens, _witness_of(run, whole, nominal), *motion)
    load = arms.inverse_dynamics(q, dq, ddq)
    for i in clamped:
        # what the arm weighs is the clamp's too; its drive has what the spring is wound up by
        load[:, i] = _wound(full.stages[i].drive, turned[:, i] - q[:, i], dturned[:, i])
    tool, turn = np.zeros((len(q), 3)), np.zeros((len(q), 3, 3))
    if "ee" in run.measured or "ee_rot" in run.measured:
        frame = full.tool_in_last_joint().matrix()
        _compiled("points_along")(arms.table, frame[:3, 3].copy(), q, tool)
        for axis in range(3) if "ee_rot" in run.measured else ():
            tip = np.empty_like(tool)
            _compiled("points_along")(arms.table, frame[:3, 3] + frame[:3, axis], q, tip)
            turn[:, :, axis] = tip - tool
    return _Moved(theta, dtheta, q, dq, load, slope, tool, turn.reshape(-1, 9))


def _at(t: float, theta: Vector, dtheta: Vector) -> Any:
    from ..simulation import MachineState

    return MachineState(float(t), theta, dtheta, theta, dtheta)


def _rubbed(
    rubbing: Sequence[Rubbing], run: Prepared, offsets: tuple[float, ...], creep: Vector
) -> tuple[Vector, Vector]:
    """Friction and torque on the arms along a run's motor motion, shapes (m, n), where arms go as motors do.

    Args:
        rubbing: Drives that know nothing of each other, joint after joint.
        run: The motion.
        offsets: Of the encoders.
        creep: Speed below which a joint counts as standing, shape (n,).
    """
    each: list[tuple[Vector, Vector]] = []
    first = 0
    for one in rubbing:
        last = first + len(one.sheet.drives)
        each.append(_rubbed_at(one, run, first, offsets[first:last], tuple(creep.tolist())))
        first = last
    friction, on_arm = zip(*each, strict=True)
    return np.concatenate(friction, axis=1), np.concatenate(on_arm, axis=1)


@lru_cache(maxsize=_JOINTS)
def _rubbed_at(
    rubbing: Rubbing, run: Prepared, first: int, offsets: tuple[float, ...], creep: tuple[float, ...]
) -> tuple[Vector, Vector]:
    """The same of the joints from one on (from 0): of most robots that are tried those of the others are known."""
    here = slice(first, first + len(offsets))
    theta, dtheta = run.q[:, here] - np.array(offsets), np.ascontiguousarray(run.dq[:, here])
    error = _errors(rubbing, run, theta, dtheta)
    turned, dturned = (theta, dtheta) if error is None else (theta + error, dtheta + np.gradient(error, run.h, axis=0))
    motion = turned, dturned, theta, np.ascontiguousarray(_at_rest(run, creep)[:, here])
    return _along(rubbing.drives(creep[here]), run, motion, np.zeros_like(theta))


def _rubbed_beside(
    machine: Mechanism, run: Prepared, moved: _Moved, creep: Vector, clamped: Sequence[int]
) -> tuple[Vector, Vector]:
    """Friction, and what drives pass to the arms, shapes (m, k), where one or the other depends on the bodies."""
    whole = machine.whole
    assert machine.rubbing is not None
    drives = machine.rubbing.drives(whole.spread(creep, 1.0).tolist())
    motion = moved.q, moved.dq, moved.theta, whole.spread(_at_rest(run, tuple(creep.tolist())))
    friction, on_arm = _along(drives, run, motion, moved.load)
    passed = moved.load - _but(on_arm, clamped)
    if drives.needs_load and np.any(on_arm):
        # something pulls on the arms: friction under load must know what the drive passes on
        friction, _ = _along(drives, run, motion, passed)
    return friction, passed


def _along(
    drives: Drives, run: Prepared, motion: tuple[Vector, Vector, Vector, Vector], load: Vector
) -> tuple[Vector, Vector]:
    """Friction and torque on the arms along a motion q, dq, theta, dtheta under a load, shapes (m, k)."""
    q, dq, theta, dtheta = motion
    friction, on_arm = np.empty_like(theta), np.empty_like(theta)
    drives.reset(_at(run.t[0], theta[0], dtheta[0]))
    _compiled("drives_along")(drives.numbers, drives.counts, run.t, q, dq, theta, dtheta, load, friction, on_arm)
    return friction, on_arm


@lru_cache(maxsize=_REMEMBERED)
def _at_rest(run: Prepared, creep: tuple[float, ...]) -> Vector:
    """Speeds of a run's motors (m, n), 0 where joints that stand most of the time do: their noise turns no friction.

    What is stuck may bear anything up to its friction's level, and nobody knows what. None is the best guess, and the
    same whatever friction is thought to be there.
    """
    if run.run.locked:
        return run.dq
    moves = np.abs(run.dq) >= np.array(creep)
    stands = moves.mean(axis=0) <= 1.0 - STANDS
    if not stands.any():
        return run.dq
    ndimage: Any = import_module("scipy.ndimage")
    rest = max(3, int(REST / run.h))
    moves[:, stands] = ndimage.binary_opening(moves[:, stands], np.ones((rest, 1), dtype=bool))
    return np.where(stands & ~moves, 0.0, run.dq)


def _but(on_arm: Vector, clamped: Sequence[int]) -> Vector:
    """Torque on the arms but for clamped ones: what pulls on these is the clamp's to bear."""
    if not clamped:
        return on_arm
    out = on_arm.copy()
    out[:, clamped] = 0.0
    return out


def _errors(rubbing: Rubbing, run: Prepared, theta: Vector, dtheta: Vector) -> Vector | None:
    if not rubbing.errs:
        return None
    drives = rubbing.drives([1.0] * len(rubbing.sheet.drives))
    error = np.empty_like(theta)
    _compiled("errors_along")(drives.numbers, drives.counts, run.t, theta, dtheta, error)
    return error


@lru_cache(maxsize=64)
def clamped_at(run: Prepared, joint: int) -> float:
    """Where a clamped joint's arm stands, as its motor would report it [rad or m].

    By the second encoder, else in the middle of where the motor bears nothing, on ways there and back alike: friction
    keeps it before the middle on the one and beyond it on the other.

    Args:
        run: In which it is clamped.
        joint: From 1.
    """
    i = joint - 1
    if "q_link" in run.measured and not run.missing["q_link"][:, i].all():
        return float(np.mean(run.measured["q_link"][~run.missing["q_link"][:, i], i]))
    q, dq = run.q[:, i], run.dq[:, i]
    torques = run.measured.get("tau", run.measured.get("tau_link"))
    torque = np.zeros(len(q)) if torques is None else torques[:, i]
    light = np.abs(torque) <= LIGHT * np.abs(torque).max()
    ways = [_unloaded(q[way], torque[way]) for side in (dq > 0.0, dq < 0.0) if (way := light & side).any()]
    return float(np.mean(ways or [0.5 * (q.min() + q.max())]))


def _unloaded(q: Vector, torque: Vector) -> float:
    """Where a line through positions by torques has none; their mean would go with where samples happen to be."""
    aside = torque - float(torque.mean())
    power = float(aside @ aside)
    return float(q.mean()) - (float(aside @ q) / power * float(torque.mean()) if power > 0.0 else 0.0)


def _stopped(
    clamped: Mapping[int, float], theta: Vector, dtheta: Vector, ddtheta: Vector
) -> tuple[Vector, Vector, Vector]:
    """A motion (m, n) with clamped joints where they are held."""
    if not clamped:
        return theta, dtheta, ddtheta
    theta, dtheta, ddtheta = theta.copy(), dtheta.copy(), ddtheta.copy()
    for i, place in clamped.items():
        theta[:, i] = place
        dtheta[:, i] = ddtheta[:, i] = 0.0
    return theta, dtheta, ddtheta


def _wound(drive: Drive, stretch: Vector, rate: Vector) -> Vector:
    """What a drive's spring passes to a clamped arm, shape (m,); without one nothing, for it would not move."""
    spring = drive.spring
    if spring is None:
        return np.zeros_like(stretch)
    beyond = np.maximum(np.abs(stretch) - 0.5 * spring.gap, 0.0)
    push = spring.stiffness * beyond * np.sign(stretch) + spring.damping * rate * (beyond > 0.0)
    # across a clearance the damper never pulls
    return push if spring.gap == 0.0 else np.where(push * stretch > 0.0, push, 0.0)


def _arms(
    robot: Robot,
    arms: Dynamics,
    run: Prepared,
    clamped: Mapping[int, float],
    stiffening: Vector,
    witness: Witness | None,
    theta: Vector,
    dtheta: Vector,
    ddtheta: Vector,
) -> tuple[Vector, Vector, Vector]:
    """Where the arms are: with the motor sides, or behind their springs; the clamped ones stay."""
    springs = [stage.drive.spring for stage in robot.stages]
    if not any(springs):
        return theta, dtheta, ddtheta
    soft = np.array([_gives(stage.drive) for stage in robot.stages])
    soft[list(clamped)] = False
    if not soft.any():
        return theta, dtheta, ddtheta
    stiffness = np.array([spring.stiffness if spring else 1.0 for spring in springs])
    damping = np.array([spring.damping if spring else 0.0 for spring in springs])
    half_gap = np.array([0.5 * spring.gap if spring else 0.0 for spring in springs])
    pull = [[(s.stiffness, s.stiffness * s.rest) for s in stage.drive.arm_springs] for stage in robot.stages]
    arm_stiffness = np.array([sum(k for k, _ in entries) for entries in pull], dtype=float)
    moment = np.array([sum(m for _, m in entries) for entries in pull], dtype=float)
    arm_rest = np.divide(moment, arm_stiffness, out=np.zeros_like(moment), where=arm_stiffness > 0.0)
    holds = np.zeros(len(springs), dtype=bool)
    nowhere = np.full(len(springs), np.nan)
    table = SpringTable(stiffness, damping, stiffening, half_gap, nowhere, holds, arm_stiffness, arm_rest)
    some, motion, loose = np.flatnonzero(soft), (theta, dtheta, ddtheta), soft & (half_gap > 0.0)
    try:
        if loose.any():
            own = np.abs(np.diagonal(arms.mass_matrix(theta[:1])[0]))
            imposed = run.run.control.mode == "motion"
            rotors = np.array([math.inf if imposed else stage.drive.inertia for stage in robot.stages])
            finer, followed = play.finer_steps(stiffness, own, loose, run.h)
            thrown, holds = play.rebounding(followed, damping, own, rotors)
            table = table._replace(stiffness=followed, damping=np.where(loose, thrown, damping), holds=holds)

            def across(side: Vector, rows: int) -> tuple[Vector, Vector, Vector]:
                begun = table._replace(side=side)
                return _compiled("arms_across")(arms.table, some, begun, finer, run.h, *(x[:rows] for x in motion))

            side = nowhere if witness is None else witness.sides(robot, arms, run, loose, motion, across)
            q, dq, ddq = across(side, len(theta))
        else:
            q, dq, ddq = _compiled("arms_along")(arms.table, some, table, run.h, *motion)
    except ZeroDivisionError:
        # nothing between two springs is an arm that no motion is known of
        q, dq, ddq = (np.full_like(theta, np.nan) for _ in range(3))
    if np.any(table.stiffness < stiffness):
        # where the harder contact would hold the arm
        q += arms.inverse_dynamics(q, dq, ddq) * (1.0 / table.stiffness - 1.0 / stiffness)
    return q, dq, ddq


def _witness_of(run: Prepared, whole: Expansion, asked_by: Itself[Robot] | None) -> Witness | None:
    """What shows where arms began; None where nothing does, or nothing has a clearance."""
    if asked_by is None:
        return None
    nominal = mechanism_of(asked_by.kept)
    q_link, n = run.measured.get("q_link"), nominal.robot.n
    if q_link is not None:
        q_link = whole.spread(np.where(run.missing["q_link"].all(axis=0), math.nan, q_link))
    torque = run.measured.get("tau")
    if torque is None:
        torque = _asked(run, asked_by, (), (), 0.0, (math.inf,) * n, (0.0,) * n)
    if torque is None:
        return Witness(q_link, None)
    gain = nominal.gain if run.gains_act else np.ones(n)
    rubbing = nominal.by_motors or (rubbing_of(nominal.robot),)
    friction, _ = _rubbed(rubbing, run, nominal.offsets, creep_of(run))
    return Witness(q_link, whole.spread(gain * torque - friction))


def _gives(drive: Drive) -> bool:
    """Whether a spring is one of the robot: the stiff contact that engines need for a wobbling gear is none."""
    return drive.spring is not None and not drive.spring.stands_in


def fed_back(run: Prepared, nominal: Robot) -> tuple[Vector, Vector] | None:
    """Torques that the gains as stated ask for by position and by speed, shapes (m, n); None where no gains act."""
    control = run.run.control
    if control.mode != "pd":
        return None
    behind, slower, _ = _fed_back(run, Itself(nominal))
    return np.array(control.kp) * behind, np.array(control.kd) * slower


@lru_cache(maxsize=_REMEMBERED)
def _fed_back(run: Prepared, nominal: Itself[Robot]) -> tuple[Vector, Vector, Vector]:
    """How far a run stays behind its command in position and speed, and the feedforward, shapes (m, n)."""
    control = run.run.control
    q_cmd, dq_cmd, _ = run.run.motion().at(control.commanded_at(run.t))
    place = run.q + control.ahead / control.rate * run.dq
    rate = run.dq - 0.5 * control.differenced / control.rate * run.ddq
    if run.told is not None:
        told = run.told
        place = np.where(told.joints, told.q, place)
        rate = np.where(told.joints, rate + told.taken * (told.dq - rate), rate)
    return q_cmd - place, dq_cmd - rate, _fed_forward(run, nominal)[0]


@lru_cache(maxsize=_REMEMBERED)
def _fed_forward(run: Prepared, nominal: Itself[Robot]) -> tuple[Vector, Vector | None]:
    """The feedforward that rows show, and by how much that is more than acts about them, shapes (m, n); None: nothing.

    A command's acceleration may jump at every row and go back until the next one: pieces of third order join so. A row
    shows what comes after its jump, and a quick controller's other ticks, as many as a row stands for, what is left of
    it.
    """
    control, law, ticks = run.run.control, run.run.motion(), ticks_a_row(run.run)
    if ticks == 1 or control.every > 1 or control.feedforward != "inverse_dynamics":
        shown = feedforward_along(nominal.kept, control, *law.at(control.commanded_at(run.t)))
        return shown, None
    shown, before = (feedforward_along(nominal.kept, control, *law.at(run.t + side)) for side in (BESIDE, -BESIDE))
    return shown, filtered(run, 0.5 * (1.0 - 1.0 / ticks) * (shown - before))


@lru_cache(maxsize=_REMEMBERED)
def _asked(
    run: Prepared,
    nominal: Itself[Robot],
    kp_factor: Sequence[float],
    kd_factor: Sequence[float],
    delay: float,
    drive_limit: Sequence[float],
    knee: Sequence[float],
) -> Vector | None:
    """The controller's torque behind its factors, delay and limits, shape (m, n); None where nothing controls."""
    control, n = run.run.control, nominal.kept.n
    if control.mode == "pd":
        behind, slower, feedforward = _fed_back(run, nominal)
        kp = np.array(control.kp) * np.array(kp_factor or [1.0] * n)
        kd = np.array(control.kd) * np.array(kd_factor or [1.0] * n)
        torque = kp * behind + kd * slower + feedforward
    elif control.mode == "torque" and "tau_cmd" in run.measured:
        torque = run.measured["tau_cmd"]
    else:
        return None
    limit = np.array(control.torque_limit or [math.inf] * n)
    # a record at a tick shows the torque that acts there, and so the controller's of a whole number of ticks ago
    late = math.ceil(delay * control.rate - 1e-6) / control.rate
    asked = _before(run, torque, late)
    held: Vector = np.empty_like(run.q)
    for i in range(n):
        held[:, i] = cut_softly(cut_softly(asked[:, i], float(limit[i])), drive_limit[i], knee[i])
    return held


def _before(run: Prepared, values: Vector, late: float) -> Vector:
    """Values (m, n) of a while ago [s]; before the first one that one.

    Between samples by a spline: a straight line would take noise away, and what is late seem to leave less.
    """
    rows = late / run.h
    if abs(rows - round(rows)) <= WHOLE:
        return values[np.maximum(np.arange(len(values)) - round(rows), 0)]
    interpolate: Any = import_module("scipy.interpolate")

    spline = interpolate.make_interp_spline(run.t, values, axis=0)
    return np.asarray(spline(np.maximum(run.t - late, run.t[0])), dtype=np.float64)
