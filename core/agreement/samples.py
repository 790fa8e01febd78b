"""Rows that show every effect of the catalogue on any robot, in the size that a real one may have.

What proves effects uses them: agreement of engines, pictures, benchmarks. Sizes follow the robot's own masses and
reach: a joint's inertia M and the torque T that its arm's weight, or an acceleration of 10 rad/s^2, asks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..build import build
from ..effects import EffectRow, effect_named
from ..errors import UsageError
from ..kinematics import dynamics, reach
from ..representation import Robot
from ..simulation.backend import Vector
from .scenarios import gives, rubs

if TYPE_CHECKING:
    from ..database import Database

Rows = Mapping[int, Mapping[str, float]]
"""Joint, arm or (0) robot to columns and values [SI]; columns that are missing have their defaults."""

ACCELERATION = 10.0
# natural frequencies on the joint's inertia [Hz], damping ratio
COMPLIANCE, BEARING, BENDING, COMPENSATOR, CONTACT = 12.0, 40.0, 25.0, 0.5, 60.0
DAMPING_RATIO = 0.05
# of a contact: an arm that flaps in its play is chaotic, and no two engines flap alike for long
CONTACT_DAMPING_RATIO = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Sizes:
    """What is large and small on a robot.

    Attributes:
        n: Number of joints.
        slides: Prismatic joints, shape (n,).
        unit: 1 rad, or on a slide a quarter of the reach [m], shape (n,).
        inertia: Diagonal of the mass matrix at home, shape (n,).
        torque: Of the arm's weight or an acceleration of 10 units/s^2, shape (n,).
        tilting: Inertia of what turns about a joint's place, of all axes the largest [kg m^2], shape (n,).
        mass: Behind each joint [kg], shape (n,).
        arm_mass: Of each arm [kg], shape (n,).
        reach: [m].
    """

    n: int
    slides: tuple[bool, ...]
    unit: Vector
    inertia: Vector
    torque: Vector
    tilting: Vector
    mass: Vector
    arm_mass: Vector
    reach: float

    @staticmethod
    def of(robot: Robot) -> _Sizes:
        slides = tuple(stage.joint.kind == "prismatic" for stage in robot.stages)
        length = reach(robot)
        unit = np.where(slides, 0.25 * length, 1.0)
        home = np.array(robot.home())
        arms = dynamics(robot)
        inertia = np.diag(arms.mass_matrix(home)).copy()
        arm_mass = np.array([stage.arm.inertia.mass for stage in robot.stages])
        mass = np.cumsum(arm_mass[::-1])[::-1].copy()
        torque = np.maximum(np.abs(arms.gravity(home)), inertia * ACCELERATION * unit)
        tilting = np.maximum(np.where(slides, 0.0, inertia), mass * (0.25 * length) ** 2)
        return _Sizes(robot.n, slides, unit, inertia, torque, tilting, mass, arm_mass, length)


def _spring(inertia: float, frequency: float, damping_ratio: float = DAMPING_RATIO) -> tuple[float, float]:
    """Stiffness and damping that give an inertia a natural frequency [Hz]."""
    w = 2.0 * math.pi * frequency
    return inertia * w * w, 2.0 * damping_ratio * w * inertia


def _by_joint(row: Callable[[_Sizes, int], Mapping[str, float]]) -> Callable[[_Sizes], Rows]:
    return lambda sizes: {i + 1: row(sizes, i) for i in range(sizes.n)}


def _compliance(s: _Sizes, i: int) -> Mapping[str, float]:
    k, b = _spring(float(s.inertia[i]), COMPLIANCE)
    return {"stiffness": k, "damping": b}


def _play(s: _Sizes, i: int) -> Mapping[str, float]:
    k, b = _spring(float(s.inertia[i]), CONTACT, CONTACT_DAMPING_RATIO)
    return {"gap": 2.0e-3 * float(s.unit[i]), "stiffness": k, "damping": b}


def _bearing(s: _Sizes) -> Rows:
    """At the first joint: all six components; each further stage of a robot would only cost time."""
    k, b = _spring(float(s.mass[0]), BEARING)
    kr, br = _spring(float(s.tilting[0]), BEARING)
    own, own_b = _spring(float(s.inertia[0]), COMPLIANCE)
    row = {"kx": k, "ky": 1.3 * k, "kz": 0.8 * k, "krx": kr, "kry": 1.2 * kr, "krz": kr}
    row |= {"bx": b, "by": b, "bz": b, "brx": br, "bry": br, "brz": br}
    axis = "z" if s.slides[0] else "rz"
    return {1: row | {f"k{axis}": own, f"b{axis}": own_b}}


def _bending(s: _Sizes) -> Rows:
    """The arm behind the heaviest joint that has a length of its own is the first one's, or a later one's."""
    k, b = _spring(float(s.tilting[-1]), BENDING)
    return {s.n: {"ku": k, "kv": 1.3 * k, "bu": b, "bv": b, "at": 0.4}}


_ROWS: dict[str, Callable[[_Sizes], Rows]] = {
    "backlash": _by_joint(_play),
    "base_tilt": lambda s: {0: {"roll": 0.03, "pitch": -0.02}},
    "controller_gain": _by_joint(lambda s, i: {"kp": 0.8, "kd": 1.2}),
    "coulomb_friction": _by_joint(lambda s, i: {"torque": 0.1 * float(s.torque[i])}),
    "delay": lambda s: {0: {"time": 2.3e-3}},
    "encoder_offset": _by_joint(lambda s, i: {"offset": 0.01 * float(s.unit[i])}),
    "hysteresis": _by_joint(
        lambda s, i: {"torque": 0.1 * float(s.torque[i]), "stiffness": 2.0 * float(s.torque[i] / s.unit[i])}
    ),
    "joint_compliance": _by_joint(_compliance),
    "joint_compliance_6d": _bearing,
    "joint_spring": _by_joint(
        lambda s, i: {"stiffness": _spring(float(s.inertia[i]), COMPENSATOR)[0], "rest": 0.2 * float(s.unit[i])}
    ),
    "kinematic_error": lambda s: {
        i: {"alpha": 2.0e-3, "a": 1.0e-3 * s.reach, "theta": -3.0e-3, "d": -1.0e-3 * s.reach, "beta": 1.0e-3}
        for i in range(1, s.n + 1)
    },
    "link_flexibility": _bending,
    "link_inertia": lambda s: {
        i: {"mass": 0.05 * float(s.arm_mass[i - 1]), "mx": 5.0e-3 * float(s.arm_mass[i - 1]) * s.reach}
        | {name: 1.0e-3 * float(s.arm_mass[i - 1]) * s.reach**2 for name in ("Ixx", "Iyy", "Izz")}
        for i in range(1, s.n + 1)
    },
    "load_friction": _by_joint(lambda s, i: {"coefficient": 0.1}),
    "payload": lambda s: {
        0: {"mass": 0.3 * float(s.arm_mass[-1]), "x": 0.02 * s.reach, "y": 0.01 * s.reach, "z": 0.03 * s.reach}
        | {name: 1.0e-4 * float(s.arm_mass[-1]) * s.reach**2 for name in ("Ixx", "Iyy", "Izz")}
    },
    "rotor_inertia": _by_joint(lambda s, i: {"inertia": 0.5 * float(s.inertia[i])}),
    "stribeck_friction": _by_joint(
        lambda s, i: {"torque": 0.06 * float(s.torque[i]), "velocity": 0.1 * float(s.unit[i])}
    ),
    "torque_constant": _by_joint(lambda s, i: {"gain": 0.9}),
    "torque_limit": _by_joint(lambda s, i: {"torque": 1.06 * float(s.torque[i])}),
    "torque_offset": _by_joint(lambda s, i: {"torque": 0.05 * float(s.torque[i])}),
    "torque_ripple": _by_joint(
        lambda s, i: {"amplitude": 0.05 * float(s.torque[i]), "cycles": 12.0 / float(s.unit[i]), "phase": 0.4}
    ),
    "transmission_error": _by_joint(
        lambda s, i: {"amplitude": 2.0e-3 * float(s.unit[i]), "cycles": 20.0 / float(s.unit[i]), "phase": 0.3}
    ),
    "viscous_friction": _by_joint(lambda s, i: {"coefficient": 0.1 * float(s.torque[i] / s.unit[i])}),
}

SAMPLED = tuple(sorted(_ROWS))
"""Names of the effects that have sample rows: all built-in ones."""


def sample_rows(database: Database, name: str) -> tuple[EffectRow, ...]:
    """Rows of one effect that suit a robot.

    Raises:
        UsageError: No sample is known of that effect.
    """
    if name not in _ROWS:
        raise UsageError(f"no sample rows of effect {name!r}; known: {', '.join(SAMPLED)}.")
    rows = _ROWS[name](_Sizes.of(build(database, effects=())))
    columns = effect_named(name).columns
    defaults = {column.name: 0.0 if column.default is None else column.default for column in columns}
    return tuple(EffectRow(at, {**defaults, **values}) for at, values in sorted(rows.items()))


def acting_runs(robot: Robot) -> tuple[str, ...]:
    """Names of the runs (see scenarios.SCENARIOS) in which all that a robot has acts at once, and no more.

    Rigid runs leave out what gives, and elastic ones what rubs, so that what rubs shows in the last ones alone.
    """
    sticks = any(term.kind == "level" for stage in robot.stages for term in stage.drive.terms)
    if rubs(robot):
        return ("friction_loop", "stick_loop") if sticks else ("friction_loop",)
    return ("compliant_motion", "compliant_loop") if gives(robot) else ("rigid_motion", "rigid_loop")


def sampled(database: Database, names: Iterable[str]) -> Database:
    """The database with sample rows of these effects, and no others; no levels but full and rigid.

    joint_compliance and the bearing's own component about the joint's axis are the same spring: with both, the latter
    is rigid. A torque limit leaves twice the room where other effects ask for torque too: an arm that is let down
    falls, and how it falls no two integrators agree on for long.

    Raises:
        UsageError: No sample is known of an effect.
    """
    from ..database.frozen import FrozenMap

    chosen = sorted(set(names))
    tables = {name: sample_rows(database, name) for name in chosen}
    if "joint_compliance" in tables and "joint_compliance_6d" in tables:
        slides = {i + 1: joint.kind == "prismatic" for i, joint in enumerate(database.joints)}
        tables["joint_compliance_6d"] = tuple(
            replace(row, values={**row.values, "kz" if slides[row.at] else "krz": math.inf})
            for row in tables["joint_compliance_6d"]
        )
    if "torque_limit" in tables and len(tables) > 1:
        tables["torque_limit"] = tuple(
            replace(row, values={**row.values, "torque": 2.0 * row.values["torque"]}) for row in tables["torque_limit"]
        )
    return replace(database, effects=FrozenMap(tables), levels=FrozenMap({}))
