"""From the neutral robot and a program to a model of Adams: the paper's chain of a rigid and an elastic joint."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from ..core.representation import Drive, Inertia, JointKind, Pose, Robot, Shape, Stage
from ..core.simulation.backend import Program, Vector
from .adams_drives import DriveLaws, Sides, number, spring_torque
from .adams_model import GROUND, Joint, Marker, Model, Motion, Part, Spring
from .adams_motion import Splines, splines_of
from .commanded import Commanded, commanded
from .negligible import negligible


@dataclass(frozen=True, slots=True)
class Built:
    """A model, and what is to be said of its motion.

    Attributes:
        model: The model.
        splines: Of the motion.
        duration: [s].
        step: Longest step of the integrator [s].
        begins_moving: The motion has a speed at t = 0.
    """

    model: Model
    splines: Splines
    duration: float
    step: float
    begins_moving: bool


def adams_name(name: str) -> str:
    """A name as View takes it: letters, digits and underscores, no digit first."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return text if not text[:1].isdigit() else f"_{text}"


def build_model(robot: Robot, program: Program) -> Built:
    """The model of a robot that runs a program by itself.

    Raises:
        RefusedError: The robot finds no rest to start from.
    """
    commands = commanded(robot, program)
    splines = splines_of(commands.motion, program.duration)
    model = Model(adams_name(robot.name), robot.gravity)
    ground = model.add_part(GROUND)
    base = model.add_marker(ground, "base", robot.base)
    small = negligible(robot)
    before, place, in_world = ground, robot.base, Pose()
    every: list[Sides] = []
    for i, stage in enumerate(robot.stages):
        place = place @ robot.joint_in_previous(i)
        sides, before, in_world = _add_stage(model, robot, i, (before, place, in_world), commands, small)
        every.append(sides)
        _add_drive(model, robot, stage, sides, i, commands, splines, imposed=program.control.mode == "motion")
        place = Pose()
    tool = model.add_marker(before, "tool", robot.tool_in_last_joint())
    _add_tip(model, tool, base)
    begins = bool(commands.start.dtheta.any())
    return Built(model, splines, program.duration, program.step, begins)


def _displaced(kind: JointKind, value: float) -> Pose:
    """Where a joint puts what it moves."""
    if kind == "prismatic":
        return Pose((0.0, 0.0, value))
    c, s = math.cos(value), math.sin(value)
    return Pose((0.0, 0.0, 0.0), ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def _add_stage(
    model: Model,
    robot: Robot,
    i: int,
    here: tuple[Part, Pose, Pose],
    commands: Commanded,
    small: Inertia,
) -> tuple[Sides, Part, Pose]:
    """Parts and joints of one stage, and the arm with its place in the world.

    The arm's frame is the moving frame of its joint.
    """
    stage = robot.stages[i]
    name, kind = stage.joint.name, stage.joint.kind
    before, place, before_in_world = here
    seat = model.add_marker(before, f"{name}_seat", place)
    joint_in_world = before_in_world @ place
    q, theta = float(commands.start.q[i]), float(commands.start.theta[i])
    arm_in_world = joint_in_world @ _displaced(kind, q)

    motor_axis = None
    if stage.drive.spring:
        motor = model.add_part(f"{name}_motor", joint_in_world @ _displaced(kind, theta), small)
        motor_axis = model.add_marker(motor, "axis")
    arm = model.add_part(
        stage.arm.name, arm_in_world, small if stage.arm.inertia == Inertia() else robot.inertia_in_joint(i)
    )
    axis = model.add_marker(arm, "axis")
    for count, shape in enumerate(stage.arm.shapes, start=1):
        if shape.kind != "mesh":
            marker = model.add_marker(arm, f"shape_{count}", robot.arm_in_joint(i) @ shape.in_arm @ _origin_of(shape))
            arm.shapes.append((marker, shape))

    if motor_axis is None:
        joint = _add_joint(model, name, kind, axis, seat)
        return Sides(joint, None, joint), arm, arm_in_world
    moving = bool(commands.start.dtheta[i])
    drive = _add_joint(model, f"{name}_drive", kind, motor_axis, seat)
    elastic = _add_joint(model, name, kind, axis, motor_axis, (q - theta, 0.0) if moving else None)
    return Sides(drive, elastic, Joint(0, name, kind, axis, seat)), arm, arm_in_world


def _origin_of(shape: Shape) -> Pose:
    """Where View has the marker of a shape, seen from its middle: a block's corner, a cylinder's end."""
    if shape.kind == "box":
        x, y, z = shape.size
        return Pose((-0.5 * x, -0.5 * y, -0.5 * z))
    return Pose((0.0, 0.0, -0.5 * shape.size[1])) if shape.kind == "cylinder" else Pose()


def _add_joint(
    model: Model, name: str, kind: JointKind, i: Marker, j: Marker, initial: tuple[float, float] | None = None
) -> Joint:
    joint = Joint(len(model.joints) + 1, name, kind, i, j, initial)
    model.joints.append(joint)
    return joint


def _add_drive(
    model: Model,
    robot: Robot,
    stage: Stage,
    sides: Sides,
    i: int,
    commands: Commanded,
    splines: Splines,
    *,
    imposed: bool,
) -> None:
    """What moves one joint: motion or torque, friction, springs."""
    drive, name = stage.drive, stage.joint.name
    if drive.passive:
        spring = Spring(sum(s.stiffness for s in drive.arm_springs), drive.damping, _rest(drive))
        model.add_force(f"{name}_spring", sides.whole, spring_torque(spring, sides.whole), spring)
        return
    laws = DriveLaws(robot, drive, sides)
    torque: list[str] = []
    command = _add_command(model, name, i, splines)
    if imposed:
        motion = Motion(len(model.motions) + 1, f"{name}_motion", sides.motor, command[0])
        model.motions.append(motion)
        reported = f"MOTION({{c{motion.id}}},0,{8 if stage.joint.kind == 'revolute' else 4},{sides.motor.j.token})"
    else:
        motor = model.add_variable(f"{name}_tau", _torque(model, name, i, commands, splines, command, sides.motor))
        if robot.delay:
            history = number(float(commands.first[i]))
            motor = model.add_variable(f"{name}_late", f"DELAY({motor.value},{number(robot.delay)},{history})")
        reported = motor.value
        torque.append(f"{number(drive.gain)}*{motor.value}" if drive.gain != 1.0 else motor.value)
    if drive.inertia and not (drive.dummy and imposed):
        torque.append(f"- {number(drive.inertia)}*{sides.motor.acceleration}")
    torque += [f"- {term}" for term in laws.resistances()]
    if laws.wobble:
        torque.append(f"- {laws.wobble}*{laws.transmitted}")
    if torque:
        model.add_force(f"{name}_torque", sides.motor, " ".join(torque))
    if sides.arm is not None:
        assert drive.spring is not None
        linear = not (drive.spring.gap or laws.error)
        spring = Spring(drive.spring.stiffness, drive.spring.damping) if linear else None
        function = spring_torque(spring, sides.arm) if spring else laws.transmitted
        model.add_force(f"{name}_spring", sides.arm, function, spring)
    on_arm = laws.on_arm()
    if on_arm:
        model.add_force(f"{name}_arm", sides.whole, " ".join(on_arm))
    offset = stage.sensor.torque_offset
    if offset:
        reported += f" + {number(offset)}"
    model.add_request(
        f"{name}_state",
        {
            "q": sides.whole.position,
            "dq": sides.whole.velocity,
            "theta": sides.motor.position,
            "dtheta": sides.motor.velocity,
            "tau": reported,
            "tau_link": laws.transmitted if sides.arm else "0.0",
        },
    )
    theta, speed = sides.motor.position, sides.motor.velocity
    model.add_request(
        f"{name}_command",
        dict(zip(("q_cmd", "dq_cmd", "ddq_cmd"), command, strict=True))
        | {"q_error": f"{theta} - {command[0]}", "dq_error": f"{speed} - {command[1]}"},
    )


def _rest(drive: Drive) -> float:
    """Where several springs together rest."""
    stiffness = sum(spring.stiffness for spring in drive.arm_springs)
    return sum(spring.stiffness * spring.rest for spring in drive.arm_springs) / stiffness


def _add_command(model: Model, name: str, i: int, splines: Splines) -> tuple[str, str, str]:
    """Expressions of the commanded position, speed and acceleration of joint i (from 0)."""
    if not splines.moves(i):
        return number(float(splines.position[0, i])), "0.0", "0.0"

    def spline(suffix: str, values: Vector) -> str:
        added = model.add_spline(f"{name}_{suffix}", tuple(splines.knots.tolist()), tuple(values[:, i].tolist()))
        return f"{splines.function}(TIME,0,{{s{added.id}}}"

    position = spline("q", splines.position)
    if splines.exact:
        return f"{position},0)", f"{position},1)", f"{position},2)"
    return f"{position},0)", f"{spline('dq', splines.velocity)},0)", f"{spline('ddq', splines.acceleration)},0)"


def _torque(
    model: Model,
    name: str,
    i: int,
    commands: Commanded,
    splines: Splines,
    command: tuple[str, str, str],
    motor: Joint,
) -> str:
    """The commanded torque of joint i (from 0), cut; 0 where there is no controller, for others to drive."""
    kp, kd = float(commands.kp[i]), float(commands.kd[i])
    terms: list[str] = []
    if kp:
        terms.append(f"{number(kp)}*({command[0]} - {motor.position})")
    if kd:
        terms.append(f"{number(kd)}*({command[1]} - {motor.velocity})")
    feedforward = commands.feedforward(splines.knots)
    if feedforward is not None:
        x, y = tuple(splines.knots.tolist()), tuple(feedforward[:, i].tolist())
        terms.append(f"{splines.function}(TIME,0,{{s{model.add_spline(f'{name}_ff', x, y).id}}},0)")
    torque = " + ".join(terms) or "0.0"
    limit = float(commands.limit[i])
    if math.isinf(limit) or not terms:
        return torque
    return f"MAX({number(-limit)},MIN({number(limit)},{torque}))"


def _add_tip(model: Model, tool: Marker, base: Marker) -> None:
    i, j = tool.token, base.token
    position = {name: f"{function}({i},{j},{j})" for name, function in (("x", "DX"), ("y", "DY"), ("z", "DZ"))}
    angles = {name: f"{name.upper()}({i},{j})" for name in ("psi", "theta", "phi")}
    model.add_request("tip", position | angles)
