"""One serial chain out of a tree: from the root, which stands still, to a tip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ModelFileError
from ..kinematics.fit import JointAxis
from ..representation import Inertia, Pose
from ..signals import joint_unit
from .bodies import impossible, put_together
from .findings import listing, nearest
from .model import Model, TreeJoint

SHOWN = 40
"""Tips that a message lists at most."""


@dataclass(frozen=True, slots=True)
class ChainArm:
    """What one joint moves, up to the next one.

    Attributes:
        joint: The joint at its inner end.
        axis: Where that joint stands with all variables at zero, in the root.
        bodies: Names of the bodies that make it up; none between two joints of one body.
        inertia: Of all of them, in the root with all variables at zero.
    """

    joint: TreeJoint
    axis: JointAxis
    bodies: tuple[str, ...]
    inertia: Inertia


@dataclass(frozen=True, slots=True)
class Chain:
    """A serial chain.

    Attributes:
        arms: From the root outwards.
        tip: Name of the tip.
        tip_in_root: With all variables at zero.
        remarks: What was merged, held still and left out.
    """

    arms: tuple[ChainArm, ...]
    tip: str
    tip_in_root: Pose
    remarks: tuple[str, ...]


def choose_tip(model: Model) -> tuple[str, tuple[str, ...]]:
    """The tip where none was asked for: the end of the one chain that moves.

    Bodies that are fixed to each other count as one. If one alone of these moves and carries no other that does,
    the tip is its body that is farthest from its joint in links, the first in the file among equals.

    Returns:
        The tip and the others that are as far out.

    Raises:
        ModelFileError: No joint moves, or there are several chains; the message names a tip for each.
    """
    children = model.children()
    head: dict[str, str] = {}  # body to the body whose joint moves it
    depth: dict[str, int] = {}
    for name, body in model.bodies.items():
        if body.parent is None or body.joints or body.loose:
            head[name], depth[name] = name, 0
        else:
            head[name], depth[name] = head[body.parent], depth[body.parent] + 1
    carrying: set[str] = set()
    for body in model.bodies.values():
        inner = body.parent if body.joints else None
        while inner is not None and head[inner] not in carrying:
            carrying.add(head[inner])
            inner = model.bodies[head[inner]].parent
    ends: dict[str, list[str]] = {}
    for name in model.bodies:
        outermost = all(head[child] != head[name] for child in children[name])
        if model.bodies[head[name]].joints and head[name] not in carrying and outermost:
            ends.setdefault(head[name], []).append(name)
    tips: list[tuple[str, tuple[str, ...]]] = []
    for leaves in ends.values():
        tip = max(leaves, key=lambda name: depth[name])  # the first among equals
        tips.append((tip, tuple(name for name in leaves if name != tip and depth[name] == depth[tip])))
    if not tips:
        kinds = sorted({body.loose for body in model.bodies.values() if body.loose})
        hint = f"; its joints are {' and '.join(kinds)}" if kinds else ""
        raise ModelFileError(f"no joint of it turns or slides, so there is no chain{hint}")
    if len(tips) > 1:
        ways = [_way(model, tip) for tip, _ in tips[:SHOWN]]
        listed = [f"{way[-1]!r} ({_count(model, way)})" for way in ways]
        more = f" and {len(tips) - SHOWN} more" if len(tips) > SHOWN else ""
        shared = _shared(ways)
        common = f"; they part at {shared[-1]!r} ({_count(model, shared)})" if len(shared) > 1 else ""
        raise ModelFileError(
            f"has {len(tips)} chains that move: {', '.join(listed)}{more}{common}. Choose one by --tip"
        )
    return tips[0]


def extract(model: Model, tip: str) -> Chain:
    """The chain from the root to a body or a marked place.

    What hangs on the chain by fixed joints is part of its arms. What moves beside the chain is held where it
    stands by itself, and is part of the arms too. What hangs on the root is left out, because it moves nothing.

    Raises:
        ModelFileError: There is no such tip, no joint moves it, or one on the way has no single degree of freedom.
    """
    body_name, tip_in_body = _find(model, tip)
    way = _way(model, body_name)
    loose = [name for name in way if model.bodies[name].loose]
    if loose:
        kind = model.bodies[loose[0]].loose
        raise ModelFileError(
            f"body {loose[0]!r} on the way to {tip!r} hangs on a {kind} joint; a serial robot stands on a fixed base "
            "and its joints turn about or slide along one axis each. Fix that joint, or choose another tip"
        )
    if not any(model.bodies[name].joints for name in way):
        raise ModelFileError(f"no joint moves {tip!r}; choose a tip beyond a joint")
    return _Extraction(model, way).chain(tip, tip_in_body)


def _find(model: Model, tip: str) -> tuple[str, Pose]:
    if tip in model.bodies:
        return tip, Pose()
    if tip in model.frames:
        return model.frames[tip]
    known = [*model.bodies, *model.frames]
    raise ModelFileError(f"has no link, body or site {tip!r}; {nearest(tip, known)}")


def _way(model: Model, name: str) -> list[str]:
    way: list[str] = []
    at: str | None = name
    while at is not None:
        way.append(at)
        at = model.bodies[at].parent
    return way[::-1]


def _shared(ways: Sequence[Sequence[str]]) -> list[str]:
    """What all ways begin with."""
    return [bodies[0] for bodies in zip(*ways, strict=False) if len(set(bodies)) == 1]


def _count(model: Model, way: Sequence[str]) -> str:
    joints = sum(len(model.bodies[body].joints) for body in way)
    return f"{joints} joint{'s' if joints != 1 else ''}"


class _Extraction:
    """Walks the way to the tip once and gathers arms and remarks."""

    def __init__(self, model: Model, way: Sequence[str]) -> None:
        self.model = model
        self.way = way
        self.children = model.children()
        self.remarks: list[str] = []
        self.left_out: list[str] = []

    def chain(self, tip: str, tip_in_body: Pose) -> Chain:
        joints: list[tuple[TreeJoint, JointAxis]] = []
        parts: list[list[tuple[str, Inertia | None]]] = []
        pose = Pose()
        for position, name in enumerate(self.way):
            body = self.model.bodies[name]
            pose = pose @ body.in_parent
            for joint in body.joints:
                joints.append((joint, _axis(pose, joint)))
                parts.append([])
                pose = pose @ joint.motion(0.0)
            if len(body.joints) > 1:
                self._remark_massless(name, len(joints), len(body.joints))
            onwards = self.way[position + 1] if position + 1 < len(self.way) else None
            beside = [child for child in self.children[name] if child != onwards]
            if not joints:
                self._leave_out(name, beside)
                continue
            arm = f"arm_{len(joints)}"
            if not body.joints:
                self.remarks.append(f"{name!r} is fixed to {body.parent!r}; both are part of {arm}")
            parts[-1].append((name, _in_root(body.inertia, pose)))
            for child in beside:
                parts[-1].extend(self._beside(child, pose, arm))
        if self.left_out:
            self.remarks.append(f"left out, for they hang on what stands still: {listing(self.left_out)}")
        unweighed = [
            problem for bodies in parts for name, _ in bodies for problem in self.model.unweighed.get(name, ())
        ]
        if unweighed:
            raise ModelFileError(unweighed)
        arms = tuple(
            ChainArm(
                joint,
                axis,
                tuple(name for name, _ in bodies),
                put_together([inertia for _, inertia in bodies if inertia is not None]),
            )
            for (joint, axis), bodies in zip(joints, parts, strict=True)
        )
        return Chain(arms, tip, pose @ tip_in_body, tuple(self.remarks))

    def _remark_massless(self, name: str, upto: int, count: int) -> None:
        first, last = upto - count + 1, upto - 1
        arms = f"arm_{first}" if first == last else f"arm_{first} to arm_{last}"
        self.remarks.append(
            f"{name!r} has {count} joints; {arms} between them {'has' if first == last else 'have'} no mass, which "
            "some engines refuse"
        )

    def _leave_out(self, name: str, beside: Sequence[str]) -> None:
        """The root's own mass and branches do not take part in the motion."""
        inertia = self.model.bodies[name].inertia
        if inertia is not None and inertia.mass > 0.0:
            self.remarks.append(f"{name!r} ({inertia.mass!r} kg) stands still; its mass is left out")
        self.left_out += [repr(child) for child in beside]

    def _beside(self, name: str, parent_in_root: Pose, arm: str) -> list[tuple[str, Inertia | None]]:
        """A branch off the chain, held still: its bodies, in the root."""
        found: list[tuple[str, Inertia | None]] = []
        waiting = [(name, parent_in_root)]
        while waiting:
            branch, parent = waiting.pop()
            body = self.model.bodies[branch]
            pose = parent @ body.in_parent
            held: list[str] = []
            for joint in body.joints:
                unit = joint_unit("q", joint.kind)
                held.append(f"{joint.name!r} at {joint.home!r} {unit}")
                pose = pose @ joint.motion(joint.home)
            if held:
                self.remarks.append(
                    f"joint {' and '.join(held)} moves beside the chain: it is held there, {branch!r} is part of {arm}"
                )
            elif body.loose:
                self.remarks.append(
                    f"{branch!r} hangs on a {body.loose} joint beside the chain: it is held where it stands and is "
                    f"part of {arm}"
                )
            else:
                self.remarks.append(f"{branch!r} is fixed to {body.parent!r}; both are part of {arm}")
            found.append((branch, _in_root(body.inertia, pose)))
            waiting.extend((child, pose) for child in reversed(self.children[branch]))
        return found


def _axis(body_in_root: Pose, joint: TreeJoint) -> JointAxis:
    rotation = body_in_root.rotation_matrix()
    ox, oy, oz = (float(c) for c in rotation @ np.array(joint.origin) + np.array(body_in_root.xyz))
    direction = rotation @ np.array(joint.axis)
    # products of many rotations leave the unit sphere by rounding
    x, y, z = (float(c) for c in direction / np.linalg.norm(direction))
    return JointAxis((ox, oy, oz), (x, y, z))


def _in_root(inertia: Inertia | None, pose: Pose) -> Inertia | None:
    return None if inertia is None else inertia.moved(pose)


def impossible_bodies(model: Model, names: Sequence[str]) -> list[str]:
    """Which bodies of the file no body can be, with the reason; frames without any inertia do not count."""
    found: list[str] = []
    for name in names:
        inertia = model.bodies[name].inertia
        if inertia is None or inertia == Inertia():
            continue
        reason = impossible(inertia)
        if reason:
            found.append(f"{name!r} by itself: {reason}")
    return found
