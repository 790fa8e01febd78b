"""Where a fault common to all engines lies: in the reader, in the build, or after it.

The tables' text is held against the database that the reader made of it, and against the representation that the build
made of that; the first that differs has the fault.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..representation import Robot
from ..simulation.backend import Vector
from .inertia_faults import PARAMETERS, parameters_of
from .look import brief
from .reference import GEOMETRY, Lump, Tables

if TYPE_CHECKING:
    from ..database import Database

# relative difference of two readings of one number
SAME = 1.0e-12
CONVERTED = "after the conversion from modified rows"
_MOMENTS = PARAMETERS[4:]


def reader_faults(bare: Tables, tables: Tables, database: Database) -> Iterator[str]:
    """What the database has otherwise than the tables' text, one clause each.

    Args:
        bare: The tables without effects.
        tables: The tables with the effects that count.
        database: What the reader made of them.
    """
    if not bare.modified:
        for i, link in enumerate(database.kinematics):
            row = [getattr(link, name) for name in GEOMETRY]
            yield from _cells("kinematics.dat", f"arm {i + 1}", GEOMETRY, bare.rows[i], np.array(row))
        for i, correction in enumerate(database.corrections):
            row = [getattr(correction, name) for name in GEOMETRY]
            yield from _cells("corrections.dat", f"arm {i}", GEOMETRY, bare.corrections[i], np.array(row))
        for i, inertia in enumerate(database.inertias):
            lump = bare.lumps[i][0]
            got = Lump(inertia.mass, np.array(inertia.com), inertia.tensor())
            names = ("mass", "x", "y", "z", *_MOMENTS)
            yield from _cells("inertia.dat", f"arm {i + 1}", names, _as_written(lump), _as_written(got))
    else:
        yield from _converted(bare, database)
    for name, rows in tables.effects.items():
        read = {row.at: row.values for row in database.effects.get(name, ())}
        for at, row in rows.items():
            told = {column: value for column, value in row.items() if column not in ("joint", "arm")}
            if at not in read:
                yield f"{name} has no row {at}, which its table has"
                continue
            columns = tuple(told)
            seen = np.array([read[at].get(column, 0.0) for column in columns])
            yield from _cells(f"effects/{name}.dat", f"row {at}", columns, np.array(list(told.values())), seen)
    for i, joint in enumerate(database.joints):
        if joint.kind != bare.kinds[i]:
            yield f"joint {i + 1} (joints.dat) is read as {joint.kind} instead of {bare.kinds[i]}"
    for name, (t, q) in tables.motions.items():
        motion = database.motions.get(name)
        if motion is None or np.shape(motion.q) != q.shape:
            yield f"the motion {name} has other rows than its table"
            continue
        yield from _rows_shifted(name, t, q, np.array(motion.t), np.array(motion.q))


def _converted(bare: Tables, database: Database) -> Iterator[str]:
    """Modified rows are converted, so that numbers cannot be compared; where things stand at zero can."""
    read = replace(
        bare,
        modified=False,
        base=database.base.pose().matrix(),
        rows=np.array([[getattr(link, name) for name in GEOMETRY] for link in database.kinematics]),
        lumps=tuple((Lump(body.mass, np.array(body.com), body.tensor()),) for body in database.inertias),
    )
    at_zero = np.zeros(bare.n)
    told, got = bare.frames(at_zero), read.frames(at_zero)
    for i in range(bare.n):
        # axes are lines: direction, and distance of the one's point from the other's line
        off = float(np.linalg.norm(np.cross(told[1][i], got[2][i] - told[2][i])))
        if bare.kinds[i] == "revolute" and (off > 1e-9 or float(np.max(np.abs(told[1][i] - got[1][i]))) > 1e-9):
            yield f"the axis of joint {i + 1} (kinematics.dat) stands otherwise {CONVERTED}"
        a, b = (world_lump(tables.lumps[i][0], frames[0][i]) for tables, frames in ((bare, told), (read, got)))
        if float(np.max(np.abs(a.com - b.com))) > 1e-9 or a.mass != b.mass:
            yield f"the center of mass of arm {i + 1} (inertia.dat) stands otherwise {CONVERTED}"
        elif float(np.max(np.abs(a.tensor - b.tensor))) > 1e-9 * float(np.max(np.abs(a.tensor))):
            yield f"the inertia of arm {i + 1} (inertia.dat) is turned otherwise {CONVERTED}"


def world_lump(lump: Lump, frame: Vector) -> Lump:
    """A body seen from the world, whose arm's frame stands at a homogeneous matrix (4, 4)."""
    rotation = frame[:3, :3]
    return Lump(lump.mass, frame[:3, 3] + rotation @ lump.com, rotation @ lump.tensor @ rotation.T)


def _as_written(lump: Lump) -> Vector:
    t = lump.tensor
    return np.array([lump.mass, *lump.com, t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]])


def _rows_shifted(name: str, t: Vector, q: Vector, read_t: Vector, read_q: Vector) -> Iterator[str]:
    size = max(float(np.max(np.abs(q))), 1e-300)
    if float(np.max(np.abs(read_q - q))) <= SAME * size and float(np.max(np.abs(read_t - t))) <= SAME * float(t[-1]):
        return
    late = float(read_t[0] - t[0])
    if np.allclose(read_t - t, late, rtol=0.0, atol=1e-12) and late:
        yield f"the motion {name} comes {brief(late)} s late in time"
    elif len(q) > 2 and np.allclose(read_q[1:], q[:-1], rtol=0.0, atol=1e-12 * size):
        yield f"the motion {name} comes one row late: each time has the positions of the row before"
    elif len(q) > 2 and np.allclose(read_q[:-1], q[1:], rtol=0.0, atol=1e-12 * size):
        yield f"the motion {name} comes one row early: each time has the positions of the row after"
    else:
        k, i = np.unravel_index(int(np.argmax(np.abs(read_q - q))), q.shape)
        yield (
            f"q{int(i) + 1} of the motion {name} at t = {brief(float(t[k]))} s is read as {brief(float(read_q[k, i]))} "
            f"instead of {brief(float(q[k, i]))}"
        )


def _cells(table: str, row: str, names: tuple[str, ...], told: Vector, read: Vector) -> Iterator[str]:
    for name, should, has in zip(names, told, read, strict=True):
        if not np.isclose(should, has, rtol=SAME, atol=0.0):
            yield f"{name} of {row} ({table}) is read as {brief(float(has))} instead of {brief(float(should))} (SI)"


def build_faults(tables: Tables, robot: Robot) -> Iterator[str]:
    """What the representation has otherwise than the tables with their effects, one clause each."""
    if not tables.modified:
        for i, stage in enumerate(robot.stages):
            row = np.array([getattr(stage.arm.link, name) for name in GEOMETRY])
            yield from _built(f"{{}} of arm_{i + 1}'s geometry", GEOMETRY, tables.rows[i], row)
            body = stage.arm.inertia
            got = parameters_of(Lump(body.mass, np.array(body.com), body.tensor()))
            told = sum((parameters_of(lump) for lump in tables.lumps[i]), tables.added[i])
            yield from _built(f"{{}} of arm_{i + 1} (about its frame's origin)", PARAMETERS, told, got)
    for i, stage in enumerate(robot.stages):
        drive = stage.drive
        spring = drive.spring
        # springs of effects that the fifth voice does not read
        unsaid = bool(tables.drives_unsaid)
        names = ("motor-side inertia", "stiffness", "spring damping", "viscous damping", "arm spring")
        told = np.array(
            [
                tables.motor_inertia()[i] if not drive.dummy else drive.inertia,
                tables.stiffness[i] if not (unsaid and spring) else spring.stiffness,
                tables.damping[i] if not (unsaid and spring) else spring.damping,
                tables.viscous[i],
                tables.spring[i],
            ]
        )
        got = np.array(
            [
                drive.inertia,
                spring.stiffness if spring else np.inf,
                spring.damping if spring else 0.0,
                drive.damping,
                sum(arm.stiffness for arm in drive.arm_springs),
            ]
        )
        yield from _built(f"the {{}} of joint_{i + 1}", names, told, got)
    if not np.allclose(robot.gravity, tables.gravity, rtol=SAME, atol=0.0):
        yield f"gravity is {tuple(robot.gravity)} instead of {tuple(float(g) for g in tables.gravity)}"
    if not tables.modified and not np.allclose(robot.base.matrix(), tables.base, rtol=0.0, atol=1e-12):
        yield "the base stands elsewhere or is turned otherwise"
    if not np.allclose(robot.tool.matrix(), tables.tool, rtol=0.0, atol=1e-12):
        yield "the tool stands elsewhere or is turned otherwise"


def _built(what: str, names: tuple[str, ...], told: Vector, has: Vector) -> Iterator[str]:
    scale = float(np.max(np.abs(told[np.isfinite(told)]), initial=0.0))
    for name, should, seen in zip(names, told, has, strict=True):
        if not np.isclose(should, seen, rtol=1e-9, atol=1e-13 * scale):
            yield f"{what.format(name)} is {brief(float(seen))} instead of {brief(float(should))} (SI)"
