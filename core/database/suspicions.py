"""What is not wrong in a database but makes one look twice."""

from __future__ import annotations

import math

import numpy as np

from ..representation import Joint
from .database import Database
from .problems import Problems, listed

# an angle of a table beyond one turn is mostly one in degrees that should have been in radians
TURN = 2.0 * math.pi + 1e-9
# a joint that is softer sags by its own length; one that is stiffer has no elasticity worth a model [Hz]
SOFT, STIFF = 0.5, 2000.0
# radius of gyration over the robot's reach: a body is neither a needle's point nor larger than the robot
THIN, WIDE = 1e-4, 2.0


def suspect(database: Database, problems: Problems) -> None:
    """Note as warnings what is suspicious in a database that could be read."""
    _gravity(database, problems)
    _angles(database, problems)
    _bodies(database, problems)
    _limits(database, problems)
    _springs(database, problems)
    _motions(database, problems)
    _visuals(database, problems)


def _gravity(database: Database, problems: Problems) -> None:
    size = math.hypot(*database.gravity)
    if size == 0.0:
        problems.warning("there is no gravity.", column="gravity", value=str(list(database.gravity)))
    elif not 9.7 < size < 9.9:
        problems.warning(f"gravity is {size:.6g} m/s^2; on earth it is 9.81.", column="gravity")
    elif database.gravity[2] > 0.0:
        problems.warning("gravity points up along z of the world.", column="gravity")


def _angles(database: Database, problems: Problems) -> None:
    for table, rows, first in (("kinematics", database.kinematics, 1), ("corrections", database.corrections, 0)):
        for number, row in enumerate(rows, first):
            for name in ("alpha", "theta", "beta"):
                value = getattr(row, name)
                if abs(value) > TURN:
                    problems.warning(
                        f"arm {number} has {name} = {value:.6g} rad, more than a turn; is it in degrees ({name}[deg])?",
                        table,
                        None,
                        name,
                    )
    for joint in database.joints:
        if joint.kind == "revolute" and any(math.isfinite(x) and abs(x) > 25.0 for x in (joint.lower, joint.upper)):
            problems.warning(
                f"{joint.name} may turn from {joint.lower:.6g} to {joint.upper:.6g} rad; is it in degrees?", "joints"
            )


def _reach(database: Database) -> float:
    """How far the tool can be from the base at most, slides at their limits [m]."""
    reach = math.hypot(*database.tool.xyz)
    for row, joint in zip(database.kinematics, database.joints, strict=True):
        slide = 0.0
        if joint.kind == "prismatic":
            slide = max((abs(x) for x in (joint.lower, joint.upper) if math.isfinite(x)), default=0.0)
        reach += math.hypot(row.a, abs(row.d) + slide)
    return reach


def _bodies(database: Database, problems: Problems) -> None:
    reach = _reach(database)
    if reach == 0.0:
        problems.warning("the robot has no extent: every a and d is zero.", "kinematics")
        return
    for number, inertia in enumerate(database.inertias, 1):
        away = math.hypot(*inertia.com)
        if away > reach:
            problems.warning(
                f"the center of mass of arm {number} is {away:.6g} m from its frame, and the robot "
                f"reaches {reach:.6g} m; is it in mm?",
                "inertia",
                None,
                "x, y, z",
            )
        if inertia.mass <= 0.0:
            continue
        largest = max(inertia.xx, inertia.yy, inertia.zz)
        radius = math.sqrt(max(largest, 0.0) / inertia.mass)
        if not THIN * reach <= radius <= WIDE * reach:
            problems.warning(
                f"arm {number} has a radius of gyration of {radius:.6g} m where the robot reaches {reach:.6g} m; "
                "is the inertia in another unit, or about another point than the center of mass?",
                "inertia",
                None,
                "Ixx, Iyy, Izz",
            )


def _limits(database: Database, problems: Problems) -> None:
    def told(what: str, joints: list[Joint]) -> None:
        if joints:
            problems.warning(
                f"no limit of {what} for {listed([joint.name for joint in joints])}; motions are planned without it.",
                "joints",
            )

    unbounded = [joint for joint in database.joints if math.isinf(joint.lower) and math.isinf(joint.upper)]
    # a revolute joint may turn without end, but hardly every one of an arm
    if 1 < len(unbounded) == database.n or any(joint.kind == "prismatic" for joint in unbounded):
        told("position", unbounded)
    told("velocity", [joint for joint in database.joints if math.isinf(joint.velocity)])
    told("effort", [joint for joint in database.joints if math.isinf(joint.effort)])
    for joint in database.joints:
        if joint.home in {joint.lower, joint.upper}:
            problems.warning(f"the home of {joint.name} stands at a limit.", "joints", None, "home", repr(joint.home))


def _springs(database: Database, problems: Problems) -> None:
    """Springs whose first frequency, the joint's by itself at home, is no industrial drive's."""
    rows = database.effects.get("joint_compliance", ())
    moments = home_moments(database) if rows else ()
    for row in rows:
        stiffness, moment = row.values["stiffness"], moments[row.at - 1]
        if moment <= 0.0:
            continue
        frequency = math.sqrt(stiffness / moment) / (2.0 * math.pi)
        if not SOFT <= frequency <= STIFF:
            kind = "soft" if frequency < SOFT else "stiff"
            problems.warning(
                f"the spring of joint_{row.at} is very {kind}: alone with the arm it swings at {frequency:.3g} Hz.",
                "effects/joint_compliance",
                None,
                "stiffness",
                repr(stiffness),
            )


def home_moments(database: Database) -> tuple[float, ...]:
    """Diagonal of the rigid mass matrix at home [kg m^2 or kg], by sums over the bodies."""
    frames = [np.eye(4)]
    for row, joint in zip(database.kinematics, database.joints, strict=True):
        move = np.eye(4)
        if joint.kind == "revolute":
            c, s = math.cos(joint.home), math.sin(joint.home)
            move[:2, :2] = [[c, -s], [s, c]]
        else:
            move[2, 3] = joint.home
        frames.append(frames[-1] @ move @ row.matrix())
    moments: list[float] = []
    for i, joint in enumerate(database.joints):
        axis, origin = frames[i][:3, 2], frames[i][:3, 3]
        moment = 0.0
        for inertia, frame in zip(database.inertias[i:], frames[i + 1 :], strict=True):
            if joint.kind == "prismatic":
                moment += inertia.mass
                continue
            rotation = frame[:3, :3]
            arm = np.cross(axis, rotation @ np.array(inertia.com) + frame[:3, 3] - origin)
            local = rotation.T @ axis
            moment += float(inertia.mass * (arm @ arm) + local @ inertia.tensor() @ local)
        moments.append(moment)
    return tuple(moments)


def _motions(database: Database, problems: Problems) -> None:
    for name, motion in database.motions.items():
        for i, joint in enumerate(database.joints):
            outside = [
                (t, q[i]) for t, q in zip(motion.t, motion.q, strict=True) if not joint.lower <= q[i] <= joint.upper
            ]
            if outside:
                t, q = outside[0]
                problems.warning(
                    f"{joint.name} leaves its limits at {len(outside)} knots, first at t = {t!r} s with {q!r}.",
                    f"motions/{name}",
                    None,
                    f"q{i + 1}",
                )


def _visuals(database: Database, problems: Problems) -> None:
    bare = [f"arm_{number}" for number, arm in enumerate(database.visuals, 1) if not arm]
    if bare:
        problems.warning(f"no shape for {listed(bare)}, while other arms have one.", "visuals")
