"""The neutral robot: what a backend needs to know, in SI, and nothing of any engine.

A robot is a serial chain of stages; as in figure 5 of IMECE2013-64815 a stage is an arm on its joint, an
actuator (here: drive) and a sensor. Frames:

- base: the robot's foot, at `Robot.base` in the world.
- arm i (i from 1): the Veitschegger-Wu frame of arm i; the chain, the centers of mass and the tool are given in it.
- joint i: the real place of joint i (geometry corrections included), z along its axis; it MOVES with arm i.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from ..errors import UsageError
from .inertia import Inertia
from .names import is_name
from .pose import Pose, Vector3
from .veitschegger_wu import VeitscheggerWu

JointKind = Literal["revolute", "prismatic"]
TermKind = Literal["level", "resistance", "arm", "error", "error_slope", "coupled"]
TERM_KINDS: tuple[TermKind, ...] = ("level", "resistance", "arm", "error", "error_slope", "coupled")
# poses that are kept: of robots that are tried one after the other most are the same
_REMEMBERED = 1024


@dataclass(frozen=True, slots=True)
class Joint:
    """One degree of freedom along or about z of the joint's frame.

    Attributes:
        name: "joint_1" ... ; the same in every backend.
        kind: "revolute" or "prismatic".
        lower, upper: Limits of position [rad or m], -inf and inf where there are none. They bound planning only.
        velocity: Limit of speed [rad/s or m/s], inf where there is none.
        effort: Limit of torque [N m or N] as the maker states it, for planning; inf where there is none.
        home: Home position [rad or m].
        in_previous: Where the joint's frame stands in the previous joint's frame; None: where the Veitschegger-Wu
            parameters put it. Only joints that stand for elastic parts have one (see `expansion`).
    """

    name: str
    kind: JointKind = "revolute"
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    effort: float = math.inf
    home: float = 0.0
    in_previous: Pose | None = None


@dataclass(frozen=True, slots=True)
class Shape:
    """Something to look at, fixed to an arm; it has no mass.

    Attributes:
        kind: "box" (size: x, y, z lengths), "cylinder" (radius, length; axis z), "sphere" (radius),
            "mesh" (size: scale along x, y, z).
        size: Lengths [m], or the scale of a mesh.
        in_arm: Pose in the arm's Veitschegger-Wu frame.
        mesh: File of the mesh, else "".
        rgba: Colour, each 0 to 1.
    """

    kind: Literal["box", "cylinder", "sphere", "mesh"]
    size: tuple[float, ...]
    in_arm: Pose = Pose()
    mesh: str = ""
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True, slots=True)
class Arm:
    """A rigid body of the chain.

    Attributes:
        name: "arm_1" ...
        link: Its Veitschegger-Wu parameters, at the zero of the joint's variable.
        correction: Geometry correction after link: places the NEXT joint (for the last arm: the flange, drawn only).
        inertia: Mass properties in the arm's own Veitschegger-Wu frame.
        shapes: What viewers draw.
        in_joint: Pose of the arm's frame in its moving joint frame; None: as the Veitschegger-Wu parameters say.
    """

    name: str
    link: VeitscheggerWu
    correction: VeitscheggerWu = VeitscheggerWu()
    inertia: Inertia = Inertia()
    shapes: tuple[Shape, ...] = ()
    in_joint: Pose | None = None


@dataclass(frozen=True, slots=True)
class Mount:
    """What a joint's bearing gives beside the drive's own direction, at its real place, on the arm's side of the drive.

    Attributes:
        stiffness: In the frame that moves with the joint; inf is rigid. At a revolute joint along x y z [N/m] and
            about x y [N m/rad]; at a prismatic one along x y and about x y z.
        damping: The same [N s/m and N m s/rad].
    """

    stiffness: tuple[float, float, float, float, float]
    damping: tuple[float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Bend:
    """Two bending springs in an arm.

    Attributes:
        stiffness: About u and v [N m/rad].
        damping: About u and v [N m s/rad].
        at: Where, as a fraction of the line from the previous arm's frame to this one; the mass is split so too.
        carried: What of the arm's inertia is fixed to its frame and stands whole behind the bend: payloads.
    """

    stiffness: tuple[float, float]
    damping: tuple[float, float]
    at: float = 0.5
    carried: Inertia = Inertia()


@dataclass(frozen=True, slots=True)
class Spring:
    """What lies between motor side theta and arm side q: T = stiffness s + damping ds/dt, s = theta - q.

    Attributes:
        stiffness: K [N m/rad or N/m].
        damping: b [N m s/rad or N s/m].
        gap: Whole clearance [rad or m]: T = 0 while |s| < gap / 2, and the damper never pulls.
        stands_in: Whether it is none of the robot's, but what engines need where one without spring wobbles.
    """

    stiffness: float
    damping: float = 0.0
    gap: float = 0.0
    stands_in: bool = False


@dataclass(frozen=True, slots=True)
class Term:
    """One law of one effect at one joint; the law itself is code of the effect, found by its name.

    Attributes:
        effect: Name of the effect, e.g. "coulomb_friction".
        law: Name of the law within the effect.
        kind: What the law's value is. "level": sticking friction's level, >= 0, motor side [N m or N];
            "resistance": torque against the motor side; "arm": torque on the arm; "error": transmission error e
            that q follows, theta + e [rad or m]; "error_slope": de/dtheta; "coupled": torque against the motion of
            this joint plus that of the one before it times the first parameter, felt by both (wrists whose motors turn
            together).
        parameters: Values handed to the law, SI, in its order; at most 8.
    """

    effect: str
    law: str
    kind: TermKind
    parameters: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Slip:
    """One Maxwell-slip element on the motor side: a spring behind a slider.

    Attributes:
        stiffness: [N m/rad or N/m].
        level: Force at which it slips [N m or N].
    """

    stiffness: float
    level: float


@dataclass(frozen=True, slots=True)
class ArmSpring:
    """Torque -stiffness (q - rest) on the arm (hoses, gravity compensators)."""

    stiffness: float
    rest: float = 0.0


@dataclass(frozen=True, slots=True)
class Stick:
    """Give of a stuck joint: friction = level clamp((x + time dtheta) / displacement, -1, 1).

    x is what theta has moved since it stuck: a bristle (Haessig and Friedland, 1991) that slips exactly at the level.

    Attributes:
        displacement: Give at break-away [rad or m].
        time: Time constant of the bristle's damping [s].
    """

    displacement: float
    time: float


@dataclass(frozen=True, slots=True)
class Drive:
    """Motor side of one joint: inertia theta'' = gain tau - friction - (1 + de/dtheta) T.

    Attributes:
        inertia: J at the joint [kg m^2 or kg]; 0 where the joint is rigid and has no rotor inertia.
        dummy: True where `inertia` is the paper's dummy part, not a measured rotor.
        spring: Elastic connection to the arm; None: rigid, theta = q (+ error).
        damping: Linear viscous friction on theta' [N m s/rad or N s/m].
        terms: Laws of effects.
        slips: Maxwell-slip elements (hysteresis).
        arm_springs: Springs on the arm side.
        stick: Give of the sticking friction; None where nothing sticks.
        gain: True motor torque per reported one.
        torque_limit: Cut of the commanded torque [N m or N].
        passive: No motor is there: the joint stands for an elastic part and is moved by its arm springs alone.
    """

    inertia: float = 0.0
    dummy: bool = False
    spring: Spring | None = None
    damping: float = 0.0
    terms: tuple[Term, ...] = ()
    slips: tuple[Slip, ...] = ()
    arm_springs: tuple[ArmSpring, ...] = ()
    stick: Stick | None = None
    gain: float = 1.0
    torque_limit: float = math.inf
    passive: bool = False


@dataclass(frozen=True, slots=True)
class Sensor:
    """What the joint reports: q + position_offset [rad or m], tau + torque_offset [N m or N]."""

    position_offset: float = 0.0
    torque_offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Stage:
    """One joint with the arm it moves, its drive and its sensor.

    Attributes:
        joint, arm, drive, sensor: Its parts.
        mount: Elastic bearing of the joint; None where it is rigid.
        bend: Elastic arm; None where it is rigid.
    """

    joint: Joint
    arm: Arm
    drive: Drive = Drive()
    sensor: Sensor = Sensor()
    mount: Mount | None = None
    bend: Bend | None = None


@dataclass(frozen=True, slots=True)
class FrictionModel:
    """How sign(theta') is realised. "stick": held by a state; "smooth": tanh(theta' / velocity)."""

    model: Literal["stick", "smooth"] = "stick"
    velocity: float = 1.0e-3


@dataclass(frozen=True, slots=True)
class Robot:
    """A serial robot at one level of complexity.

    Attributes:
        name: Name, safe as a file name and an identifier.
        gravity: In the world [m/s^2].
        base: Pose of the base in the world.
        base_correction: Row 0 of the corrections: places joint 1 in the base.
        stages: Base to tool.
        tool: Tool centre point in the last arm's Veitschegger-Wu frame.
        friction: How sign() is realised.
        delay: How much later the commanded torque acts [s].
        kp_factor, kd_factor: Factors on the controller's gains, one a joint; () is all ones.
        level: Name of the level it was built at, or "custom".
        effects: Names of the effects that are in, sorted.
        source_hash: SHA-256 of the database's content, hex.
        notes: Remarks that every export and run repeats (the dummy's inertia, conventions).
    """

    name: str
    gravity: Vector3
    base: Pose
    base_correction: VeitscheggerWu
    stages: tuple[Stage, ...]
    tool: Pose = Pose()
    friction: FrictionModel = FrictionModel()
    delay: float = 0.0
    kp_factor: tuple[float, ...] = ()
    kd_factor: tuple[float, ...] = ()
    level: str = "full"
    effects: tuple[str, ...] = ()
    source_hash: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse names that could break out of a file's name or of a text that is emitted.

        Raises:
            UsageError: The name of the robot, of an arm or of a joint is none.
        """
        for name in (self.name, *(part.name for stage in self.stages for part in (stage.joint, stage.arm))):
            if not is_name(name):
                raise UsageError(
                    f"{name[:80]!a} is no name of a robot, an arm or a joint: a letter, then at most 63 letters, "
                    "digits, _ or -."
                )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.stages)

    def home(self) -> tuple[float, ...]:
        """Home position of every joint [rad or m]."""
        return tuple(stage.joint.home for stage in self.stages)

    def correction_before(self, i: int) -> VeitscheggerWu:
        """Correction that places joint i + 1 (stage i, from 0) on the arm before it."""
        return self.base_correction if i == 0 else self.stages[i - 1].arm.correction

    def arm_in_joint(self, i: int) -> Pose:
        """Arm frame of stage i (from 0) in its own moving joint frame: constant.

        The chain goes on from the Veitschegger-Wu frame, the joint stands at the corrected one, and a correction
        commutes with the joint's motion, so arm = joint Q(q) C^-1 A_VW(0).
        """
        arm = self.stages[i].arm
        return arm.in_joint or _from_corrected(self.correction_before(i), arm.link)

    def joint_in_previous(self, i: int) -> Pose:
        """Frame of the joint of stage i, at zero, in the previous stage's joint frame (stage 0: in the base)."""
        joint = self.stages[i].joint
        if joint.in_previous is not None:
            return joint.in_previous
        placed = self.correction_before(i).pose()
        return placed if i == 0 else self.arm_in_joint(i - 1) @ placed

    def inertia_in_joint(self, i: int) -> Inertia:
        """Mass properties of the arm of stage i in its moving joint frame."""
        return self.stages[i].arm.inertia.moved(self.arm_in_joint(i))

    def tool_in_last_joint(self) -> Pose:
        """Tool centre point in the last moving joint frame."""
        return self.arm_in_joint(self.n - 1) @ self.tool


@lru_cache(maxsize=_REMEMBERED)
def _from_corrected(correction: VeitscheggerWu, link: VeitscheggerWu) -> Pose:
    """Arm frame in the frame of its joint, which stands at the corrected place."""
    return correction.pose().inverse() @ link.pose()
