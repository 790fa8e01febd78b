"""What every voice is asked at rest: kinematics, dynamics, drives and sag at random states, the same for all."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..kinematics import dynamics, reach
from ..representation import FrictionModel, Robot
from ..simulation.backend import Engine, MachineState, Vector
from ..simulation.settle import terms_at_rest
from .reference import Tables

STATICS = (
    "tool_position",
    "tool_orientation",
    "mass_matrix",
    "gravity",
    "bias",
    "inverse_dynamics",
    "motor_inertia",
    "drive_torque",
    "acceleration",
    "static_sag",
)
"""Names of the quantities, in the order in which a fault shows: geometry, then masses, then drives."""

SEED = 20130813
COUNT = 50
# acceleration and sag cost more than the others and vary less
FEW = 8
# least stretch of a spring [rad] at which its torque is asked
STRETCH = 1.0e-3
# torques of a drive are judged by this part of the largest of all drives, or of 1 N m, where its own are smaller
SMALL_TORQUE = 1.0e-6
# and by this part of the arm's weight
SMALL_LOAD = 1.0e-4
# what sags less [rad or m] is judged by this
SMALL_SAG = 1.0e-6
# a load below this part of the largest is none
WEIGHTLESS = 1.0e-9
# an arm without load that can be moved by this part of its play stands where it is put
LOOSE = 0.5
ERROR_ITERATIONS = 60
BISECTIONS = 60
# fractions of a run's step over which acceleration is taken, and the weights that leave an error of third order
ACCELERATION_STEPS = (1 / 64, 1 / 128, 1 / 256)
ACCELERATION_WEIGHTS = (1 / 3, -2.0, 8 / 3)


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Random states, arrays of shape (m, n) [rad or m, and per s]; the first FEW serve what costs more.

    Attributes:
        q, dq, ddq: Arm side.
        theta, dtheta: Motor side, equal to q, dq at rigid joints; springs stretched far enough for rounding.
        near_theta, near_dtheta: The same, springs stretched as the arms' weight would, so that other torques count.
    """

    q: Vector
    dq: Vector
    ddq: Vector
    theta: Vector
    dtheta: Vector
    near_theta: Vector
    near_dtheta: Vector


def random_states(robot: Robot, count: int = COUNT, seed: int = SEED) -> States:
    """States within the joints' limits (revolute: +-pi at most; prismatic without limits: half the reach)."""
    draw = np.random.default_rng(seed).uniform
    half = 0.5 * reach(robot)
    size = (count, robot.n)
    slides = np.array([stage.joint.kind == "prismatic" for stage in robot.stages])
    most = np.where(slides, max(half, 0.1), math.pi)
    lower = np.maximum([stage.joint.lower for stage in robot.stages], -most)
    upper = np.minimum([stage.joint.upper for stage in robot.stages], most)
    # limits that lie wholly beyond the range above
    wrong = lower >= upper
    home = np.array(robot.home())
    lower, upper = np.where(wrong, home - 0.1, lower), np.where(wrong, home + 0.1, upper)
    unit = np.where(slides, half, 1.0)
    q, dq, ddq = draw(lower, upper, size), draw(-1.0, 1.0, size) * unit, draw(-5.0, 5.0, size) * unit
    stretch, dstretch = draw(-1.0, 1.0, size), draw(-0.1, 0.1, size) * unit
    springs = [stage.drive.spring for stage in robot.stages]
    elastic = np.array([spring is not None for spring in springs])
    # what the weight of the arm, or an acceleration of 1, would stretch the spring by
    load = np.diag(dynamics(robot).mass_matrix(home)) + np.abs(dynamics(robot).gravity(home))
    give = np.array([load[i] / spring.stiffness if spring else 0.0 for i, spring in enumerate(springs)])
    far = np.where(elastic, np.maximum(give, STRETCH * unit), 0.0)
    # beyond the play, where there is something to be asked
    closed = np.sign(stretch) * [0.5 * spring.gap if spring else 0.0 for spring in springs]
    return States(
        q,
        dq,
        ddq,
        *_stretched(robot, q, dq, stretch * far + closed, np.where(elastic, dstretch, 0.0)),
        *_stretched(robot, q, dq, stretch * give + closed, np.where(elastic, 1e-2 * dstretch, 0.0)),
    )


def _stretched(robot: Robot, q: Vector, dq: Vector, stretch: Vector, dstretch: Vector) -> tuple[Vector, Vector]:
    """Motor sides theta, dtheta for which theta + e(theta) - q is stretched so far and so fast, shapes (m, n)."""
    theta, dtheta = q + stretch, dq + dstretch
    for i, stage in enumerate(robot.stages):
        if any(term.kind == "error" for term in stage.drive.terms):
            for k in range(len(q)):
                # an error of less slope than 1, as any gear's that turns its joint at all, makes this a contraction
                for _ in range(ERROR_ITERATIONS):
                    theta[k, i] = q[k, i] + stretch[k, i] - terms_at_rest(stage.drive, "error", theta[k, i], q[k, i])
                slope = terms_at_rest(stage.drive, "error_slope", theta[k, i], q[k, i])
                dtheta[k, i] /= 1.0 + slope
    return theta, dtheta


def smooth(robot: Robot) -> Robot:
    """The robot with friction that is a function of the state."""
    return replace(robot, friction=FrictionModel("smooth", robot.friction.velocity))


def ask_engine(
    engine: Engine,
    base_in_world: Vector,
    states: States,
    quantities: Sequence[str],
    *,
    moving: Callable[[], Engine],
    elastic: Sequence[bool],
    step: float,
    play: Sequence[float] = (),
) -> dict[str, Vector]:
    """Answers of a loaded model, by quantity; the first index counts the states.

    Args:
        engine: The loaded model.
        base_in_world: Shape (4, 4).
        states: What to ask at.
        quantities: Names of STATICS.
        moving: Gives the same model with smooth friction, for the torques of the drives: friction that sticks has a
            memory, and is compared in runs.
        elastic: Where motor and arm side are two coordinates.
        step: Step of a run [s].
        play: Clearance of the connection of the two, shape (n,) [rad or m]; () nowhere.
    """
    tool = np.array([base_in_world @ engine.tool_in_base(q) for q in states.q])
    few = range(min(FEW, len(states.q)))
    answers: dict[str, Callable[[], Vector]] = {
        "tool_position": lambda: tool[:, :3, 3],
        "tool_orientation": lambda: tool[:, :3, :3],
        "mass_matrix": lambda: np.array([engine.mass_matrix(q) for q in states.q]),
        "gravity": lambda: np.array([engine.gravity(q) for q in states.q]),
        "bias": lambda: np.array([engine.bias(q, dq) for q, dq in zip(states.q, states.dq, strict=True)]),
        "inverse_dynamics": lambda: np.array(
            [engine.inverse_dynamics(q, dq, ddq) for q, dq, ddq in zip(states.q, states.dq, states.ddq, strict=True)]
        ),
        "motor_inertia": lambda: np.array([engine.motor_inertia()]),
        "drive_torque": lambda: np.array(
            [
                np.concatenate(moving().drive_torque(q, dq, theta, dtheta))
                for q, dq, theta, dtheta in zip(states.q, states.dq, states.theta, states.dtheta, strict=True)
            ]
        ),
        "acceleration": lambda: np.array([_stepped(moving(), states, k, step) for k in few]),
        "static_sag": lambda: np.array([_sag(engine, states.q[k], elastic, play) for k in few]),
    }
    return {name: answers[name]() for name in quantities}


def ask_tables(tables: Tables, states: States, quantities: Sequence[str]) -> dict[str, Vector]:
    """Answers of the tables' text, by quantity, as `ask_engine` gives them; what it cannot say is left out."""
    few = slice(0, FEW)
    tool = tables.tool_in_world(states.q)
    answers: dict[str, Callable[[], Vector]] = {
        "tool_position": lambda: tool[:, :3, 3],
        "tool_orientation": lambda: tool[:, :3, :3],
        "mass_matrix": lambda: tables.mass_matrix(states.q),
        "gravity": lambda: tables.gravity_torque(states.q),
        "bias": lambda: tables.bias(states.q, states.dq),
        "inverse_dynamics": lambda: tables.inverse_dynamics(states.q, states.dq, states.ddq),
        "motor_inertia": lambda: tables.motor_inertia()[None],
        "drive_torque": lambda: np.concatenate(
            replace(tables, smooth=True).drive_torque(states.q, states.dq, states.theta, states.dtheta), axis=-1
        ),
        "acceleration": lambda: table_accelerations(tables, states, few),
        "static_sag": lambda: np.array([tables.sag(theta) - theta for theta in states.q[few]]),
    }
    # what the drives do is not said where this voice does not know all of their effects
    silent = {"drive_torque", "acceleration", "static_sag"} if tables.drives_unsaid else set[str]()
    return {name: answers[name]() for name in quantities if name not in silent}


def table_accelerations(tables: Tables, states: States, few: slice) -> Vector:
    """Accelerations of arm and motor sides at zero command, friction smooth, shape (m, 2 n)."""
    tables = replace(tables, smooth=True)
    q, dq, theta, dtheta = states.q[few], states.dq[few], states.near_theta[few], states.near_dtheta[few]
    on_arm, on_motor = tables.drive_torque(q, dq, theta, dtheta)
    elastic = np.isfinite(tables.stiffness)
    inertia = tables.mass_matrix(q) + np.diag(np.where(elastic, 0.0, tables.rotor))
    driving = on_arm + np.where(elastic, 0.0, on_motor) - tables.bias(q, dq)
    arm = np.asarray(np.linalg.solve(inertia, driving[..., None])[..., 0], dtype=float)
    motor = np.where(elastic, on_motor / np.where(elastic, tables.motor_inertia(), 1.0), arm)
    return np.concatenate([arm, motor], axis=-1)


def _stepped(engine: Engine, states: States, k: int, step: float) -> Vector:
    """Acceleration that the engine's own integrator takes at zero command, arm and motor sides, shape (2 n,)."""
    total = np.zeros(2 * engine.n)
    for fraction, weight in zip(ACCELERATION_STEPS, ACCELERATION_WEIGHTS, strict=True):
        q, dq, theta, dtheta = (
            array[k].copy() for array in (states.q, states.dq, states.near_theta, states.near_dtheta)
        )
        engine.reset(MachineState(0.0, q, dq, theta, dtheta), None)
        engine.hold(np.zeros(engine.n))
        before = engine.state()
        engine.advance(fraction * step, 1)
        after = engine.state()
        gained = np.concatenate([after.dq - before.dq, after.dtheta - before.dtheta])
        total += weight * gained / (fraction * step)
    return total


def _sag(engine: Engine, theta: Vector, elastic: Sequence[bool], play: Sequence[float]) -> Vector:
    """What the arms sag below motor sides held at theta, by the engine's own gravity and springs, shape (n,).

    Newton's method on spring torque = gravity, with differences for the slope. Play is closed by the load to begin
    with. An arm that nothing loads rests anywhere within its play: no one place is its answer, and the middle of the
    play, which the engine's own springs bound, stands for all of them.
    """
    sag = np.zeros(engine.n)
    fixed: set[int] = set()
    played = set(np.flatnonzero(play).tolist())
    for j in sorted(played):
        low, high = _rests(engine, theta, j)
        sag[j] = 0.5 * (low + high)
        if high - low > LOOSE * play[j]:
            fixed.add(j)
    free = np.array([j for j in np.flatnonzero(elastic) if j not in fixed], dtype=np.int64)
    if not len(free):
        return sag
    still = np.zeros(engine.n)

    def unbalance(sag: Vector) -> Vector:
        q = theta + sag
        return (engine.drive_torque(q, still, theta, still)[0] - engine.gravity(q))[free]

    # a difference over what the spring gives under its load: small beside the robot, large beside rounding
    for _ in range(30):
        now = unbalance(sag)
        slope = np.empty((len(free), len(free)))
        for column, j in enumerate(free):
            # short beside what a contact gives, whose play has no slope
            shift = 1e-8 if j in played else 1e-5
            shifted = sag.copy()
            shifted[j] += shift
            slope[:, column] = (unbalance(shifted) - now) / shift
        # at the edge of its play a joint may have no slope: it stays
        move = np.linalg.lstsq(slope, now, rcond=None)[0]
        sag[free] -= move
        if float(np.max(np.abs(move))) <= 1e-15 + 1e-13 * float(np.max(np.abs(sag))):
            break
    return sag


def _rests(engine: Engine, theta: Vector, j: int) -> tuple[float, float]:
    """Least and largest sag of joint j alone at which its springs hold its load, all but a load that is none."""
    still = np.zeros(engine.n)
    # beside what would accelerate the heaviest joint by 1, where the whole robot weighs on none
    none = WEIGHTLESS * float(max(np.max(np.abs(engine.gravity(theta))), np.max(np.diag(engine.mass_matrix(theta)))))

    def unbalance(sag: float) -> float:
        q = theta + sag * np.eye(engine.n)[j]
        return float((engine.drive_torque(q, still, theta, still)[0] - engine.gravity(q))[j])

    def falls_below(limit: float) -> float:
        """The sag beyond which the unbalance is below a limit: springs pull back the more, the farther."""
        reach = 1e-6
        while reach < 1.0 and not unbalance(-reach) > limit > unbalance(reach):
            reach *= 2.0
        low, high = -reach, reach
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if unbalance(middle) > limit else (low, middle)
        return 0.5 * (low + high)

    return falls_below(none), falls_below(-none)


def scales(answers: Mapping[str, Vector]) -> dict[str, Vector]:
    """By what the differences of a relative quantity are divided, from the answers of one trusted voice.

    Torques of a joint are taken by the root of its diagonal mass-matrix entry, so that a wrist of grams and a slide
    weigh as much as the shoulder.
    """
    found: dict[str, Vector] = {}
    weight: Vector | float = 1.0
    if "mass_matrix" in answers:
        diagonal = np.sqrt(np.abs(np.einsum("kii->ki", answers["mass_matrix"])))
        found["mass_matrix"] = diagonal[:, :, None] * diagonal[:, None, :]
        weight = np.max(diagonal, axis=0)
    for name in ("gravity", "bias", "inverse_dynamics"):
        if name in answers:
            largest = max(float(np.max(np.abs(answers[name]) / weight)), 1e-300)
            found[name] = np.broadcast_to(weight * largest, answers[name].shape[-1:])
    if "static_sag" in answers:
        most = max(float(np.max(np.abs(answers["static_sag"]))), SMALL_SAG)
        found["static_sag"] = np.full(answers["static_sag"].shape[-1], most)
    if "motor_inertia" in answers:
        found["motor_inertia"] = np.max(np.abs(answers["motor_inertia"]), axis=0)
    if "drive_torque" in answers:
        # both sides of a joint together, so that rounding on the idle side does not count
        both = np.max(np.abs(answers["drive_torque"]), axis=0).reshape(2, -1).max(axis=0)
        least = np.full_like(both, SMALL_TORQUE * max(float(both.max()), 1.0))
        if "gravity" in answers:
            # some engines tell it beside the arms' weight only
            least = np.maximum(least, SMALL_LOAD * np.max(np.abs(answers["gravity"]), axis=0))
        found["drive_torque"] = np.tile(np.maximum(both, least), 2)
    if "acceleration" in answers:
        found["acceleration"] = np.max(np.abs(answers["acceleration"]), axis=0)
    return found
