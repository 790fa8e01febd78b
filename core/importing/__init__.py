"""Databases from robot descriptions by others: any serial chain of a URDF or MJCF file.

The readers are our own; engines read the same files in the tests, as a check from outside.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from ..database import Database, FrozenMap, Placement
from ..database.database import joint_name
from ..effects import EffectRow
from ..errors import ModelFileError, Problem
from ..kinematics.fit import Fit, fit_chain
from ..representation import Inertia, Joint, Pose
from .bodies import impossible, repaired
from .chain import Chain, ChainArm, choose_tip, extract, impossible_bodies
from .findings import listing
from .mjcf import read_mjcf
from .model import Model, TreeJoint
from .urdf import read_urdf
from .xml_file import parse_xml, read_file

__all__ = ["Imported", "import_model"]


LONGEST_NAME = 64
"""Characters of a database's name."""


@dataclass(frozen=True, slots=True)
class Imported:
    """A database made from a file.

    Attributes:
        database: What the file says of the chain, with the remarks in it.
        remarks: The same remarks: names, what was merged, held still, repaired and left out, in plain sentences.
    """

    database: Database
    remarks: tuple[str, ...]


def import_model(path: str | Path, tip: str | None = None, repair: bool = False) -> Imported:
    """A database of the serial chain from the root of a URDF or MJCF model to a tip.

    The variables mean the same: joint i of the database at q_i stands where the file's i-th joint of the chain
    stands at q_i. Frames are fitted (Veitschegger and Wu, 1986), so forward kinematics, mass matrix and gravity are
    the file's to rounding.

    Args:
        path: The file; which format it is, its outermost element says.
        tip: Link, body or site where the chain ends and the tool stands. None: the end of the one chain that moves.
        repair: Replace arms that no body can be by the nearest that can, instead of keeping them with
            `inertia_check: warn`.

    Raises:
        ModelFileError: The file cannot be read or holds no such chain, with all that is wrong with it; or the tip
            is not there, or none was given and there are several.
    """
    path = Path(path)
    content = read_file(path, path.name)
    model = _read(path, content)
    others: tuple[str, ...] = ()
    try:
        if tip is None:
            tip, others = choose_tip(model)
        chain = extract(model, tip)
    except ModelFileError as error:
        raise ModelFileError(
            [replace(problem, file=problem.file or path.name) for problem in error.problems]
        ) from error
    fit = fit_chain([arm.axis for arm in chain.arms], chain.tip_in_root)
    inertias, notes, check = _inertias(model, chain, fit, repair)
    mapping = ", ".join(f"{joint_name(i)} = {arm.joint.name}" for i, arm in enumerate(chain.arms, 1))
    remarks = [
        f"joints: {mapping}",
        f"the tool stands at {chain.tip!r}" + (f"; as far out: {', '.join(map(repr, others))}" if others else ""),
    ]
    places = [name for name, (body, _) in model.frames.items() if body in chain.arms[-1].bodies and name != tip]
    if places:
        remarks.append(f"places on the last arm that can be the tip too: {listing([repr(name) for name in places])}")
    if fit.base_in_root != Pose():
        remarks.append(
            f"the base is not {model.root!r}: it stands on the axis of joint_1, its place is robot.yaml's base"
        )
    remarks += [
        f"{arm.joint.name!r} follows another joint in the file ({model.mimics[arm.joint.name]}), here it moves freely"
        for arm in chain.arms
        if arm.joint.name in model.mimics
    ]
    remarks += [*notes, *chain.remarks, *model.findings.remarks]
    digest = hashlib.sha256(content).hexdigest()
    database = Database(
        name=_identifier(model.name or path.stem),
        kinematics=fit.links,
        corrections=(fit.base_correction, *fit.corrections),
        inertias=inertias,
        joints=tuple(_joint(i, arm.joint) for i, arm in enumerate(chain.arms, 1)),
        gravity=model.gravity,
        base=_placement(fit.base_in_root),
        tool=_placement(fit.tool_in_arm),
        effects=_effects(chain.arms),
        inertia_check=check,
        source=f"{model.format} file {path.name}, SHA-256 {digest}",
        remarks=tuple(remarks),
    )
    return Imported(database, tuple(remarks))


def _read(path: Path, content: bytes) -> Model:
    root = parse_xml(content, path.name)
    if root.tag == "robot":
        return read_urdf(root)
    if root.tag == "mujoco":
        return read_mjcf(root, path)
    hint = {
        "sdf": "; SDF is not read",
        "mujocoinclude": "; it is a part of a model, import the file that includes it",
    }.get(root.tag, "")
    raise ModelFileError(
        [
            Problem(
                f"is no robot: <{root.tag}> is neither URDF's <robot> nor MJCF's <mujoco>{hint}", path.name, root.line
            )
        ]
    )


def _inertias(
    model: Model, chain: Chain, fit: Fit, repair: bool
) -> tuple[tuple[Inertia, ...], list[str], Literal["error", "warn"]]:
    """Arms' mass properties in their frames, remarks on impossible ones, and the database's inertia_check."""
    inertias: list[Inertia] = []
    notes: list[str] = []
    check: Literal["error", "warn"] = "error"
    for number, (arm, pose) in enumerate(zip(chain.arms, fit.arms_in_root, strict=True), 1):
        inertia = arm.inertia.moved(pose.inverse())
        wrong = impossible(inertia)
        if wrong:
            made_of = " + ".join(arm.bodies) or "between two joints of one body"
            what = f"arm_{number} ({made_of}): {wrong}"
            if repair:
                mended = repaired(inertia)
                inertia = mended.body
                notes.append(f"{what}; repaired: {mended.changes}")
            else:
                check = "warn"
                notes.append(f"{what}; kept as it stands, with inertia_check: warn")
        elif len(arm.bodies) > 1:
            notes += [
                f"{reason}; the whole of arm_{number} is possible" for reason in impossible_bodies(model, arm.bodies)
            ]
        inertias.append(inertia)
    return tuple(inertias), notes, check


def _joint(number: int, joint: TreeJoint) -> Joint:
    return Joint(joint_name(number), joint.kind, joint.lower, joint.upper, joint.velocity, joint.effort, joint.home)


def _effects(arms: tuple[ChainArm, ...]) -> FrozenMap[str, tuple[EffectRow, ...]]:
    """Tables of what the file says of the joints; only rows that say something."""
    tables: dict[str, Callable[[TreeJoint], dict[str, float] | None]] = {
        "coulomb_friction": lambda joint: {"torque": joint.friction} if joint.friction else None,
        "joint_spring": lambda joint: {"stiffness": joint.stiffness, "rest": joint.rest} if joint.stiffness else None,
        "rotor_inertia": lambda joint: {"inertia": joint.rotor_inertia} if joint.rotor_inertia else None,
        "viscous_friction": lambda joint: {"coefficient": joint.damping} if joint.damping else None,
    }
    effects: dict[str, tuple[EffectRow, ...]] = {}
    for name, row in tables.items():
        rows = tuple(
            EffectRow(number, FrozenMap(values)) for number, arm in enumerate(arms, 1) if (values := row(arm.joint))
        )
        if rows:
            effects[name] = rows
    return FrozenMap(effects)


def _placement(pose: Pose) -> Placement:
    """The pose in the file's numbers, without what rounding leaves of zeros."""
    (x, y, z), (roll, pitch, yaw) = (
        tuple(value if abs(value) > 1e-15 else 0.0 for value in values) for values in (pose.xyz, pose.rpy())
    )
    return Placement((x, y, z), (roll, pitch, yaw))


def _identifier(name: str) -> str:
    safe = re.sub(r"[^A-Za-z0-9_]+", "_", name)[:LONGEST_NAME].strip("_") or "robot"
    return safe if safe[0].isalpha() else f"robot_{safe}"
