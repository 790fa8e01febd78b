"""What a co-simulation unit lets the outside see and set: inputs, outputs and parameters, with their places in C."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..core.effects import effect_named
from ..core.representation import Robot, Stage
from ..core.simulation.backend import Program, Vector

Causality = Literal["input", "output", "parameter"]

UNITS: Mapping[str, Mapping[str, int]] = {
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N.s/m": {"kg": 1, "s": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "s": {"s": 1},
}


@dataclass(frozen=True, slots=True)
class Variable:
    """A real variable of the unit.

    Attributes:
        name: As in a run's data where it has such a column (`q_1`, `tau_link_2`, `ee_x`).
        causality: "input", "output" or "parameter".
        variability: "continuous", "tunable" or "fixed".
        unit: A key of UNITS, or "".
        start: Its value where nothing is said; None for outputs.
        description: In words.
        place: Where it stands in the unit's struct.
    """

    name: str
    causality: Causality
    variability: Literal["continuous", "tunable", "fixed"]
    unit: str
    start: float | None
    description: str
    place: str


def variables_of(robot: Robot, program: Program, theta_start: Vector) -> tuple[Variable, ...]:
    """All real variables: outputs, then inputs, then parameters.

    Args:
        robot: With its passive joints.
        program: What the unit runs by itself; its motion has all joints.
        theta_start: Where the motor sides start where torque moves them [rad or m], shape (n,).
    """
    driven = [(number, i) for number, i in enumerate(_driven(robot), start=1)]
    found = [variable for signal in _OUTPUTS for variable in _ports(robot, driven, signal, "output")]
    for k, name in enumerate(("x", "y", "z", "qw", "qx", "qy", "qz")):
        unit, what = ("m", "position") if k < 3 else ("", "orientation, a quaternion with qw at least 0")
        found.append(
            Variable(
                f"ee_{name}", "output", "continuous", unit, None, f"tool centre point in the base, {what}", f"ee[{k}]"
            )
        )
    begin = program.motion.at(0.0)
    starts = {"q_cmd": begin[0], "dq_cmd": begin[1], "ddq_cmd": begin[2], "tau_cmd": np.zeros(robot.n)}
    for signal in _INPUTS:
        values: list[float] = starts[signal.name].tolist()
        found += _ports(robot, driven, signal, "input", values)
    found.append(_parameter("step", program.step, "s", "longest step of the integration", "step", fixed=True))
    for k, axis in enumerate("xyz"):
        what = f"gravity's acceleration along {axis} of the base"
        found.append(_parameter(f"gravity_in_base.{axis}", _gravity(robot)[k], "m/s2", what, f"chain.gravity[{k}]"))
    found += [variable for i, stage in enumerate(robot.stages) for variable in _body(robot, stage, i)]
    found += [variable for i, stage in enumerate(robot.stages) for variable in _drive(stage, i, float(theta_start[i]))]
    if robot.delay:
        found.append(_parameter("delay.time", robot.delay, "s", "how much later the commanded torque acts", "delay"))
    return tuple(found)


def _driven(robot: Robot) -> list[int]:
    return [i for i, stage in enumerate(robot.stages) if not stage.drive.passive]


def _gravity(robot: Robot) -> list[float]:
    return [float(value) for value in robot.base.rotation_matrix().T @ robot.gravity]


@dataclass(frozen=True, slots=True)
class _Signal:
    """A signal with one value a joint."""

    name: str
    place: str
    revolute: str
    prismatic: str
    what: str


_OUTPUTS = (
    _Signal("q", "q_out", "rad", "m", "motor side's position, as the encoder reports it"),
    _Signal("dq", "dq_out", "rad/s", "m/s", "motor side's speed"),
    _Signal("ddq", "ddq_out", "rad/s2", "m/s2", "motor side's acceleration"),
    _Signal("q_link", "q_link", "rad", "m", "arm side's position, true"),
    _Signal("dq_link", "dq_link", "rad/s", "m/s", "arm side's speed, true"),
    _Signal("ddq_link", "ddq_link", "rad/s2", "m/s2", "arm side's acceleration, true"),
    _Signal("tau", "tau", "N.m", "N", "motor's torque at the joint, as reported"),
    _Signal("tau_link", "tau_link", "N.m", "N", "torque that the drive passes to the arm"),
)
_INPUTS = (
    _Signal("tau_cmd", "tau_cmd", "N.m", "N", "commanded torque (mode 1), held over a communication step"),
    _Signal("q_cmd", "q_cmd", "rad", "m", "commanded position at the communication point (mode 2)"),
    _Signal("dq_cmd", "dq_cmd", "rad/s", "m/s", "commanded speed at the communication point (mode 2)"),
    _Signal("ddq_cmd", "ddq_cmd", "rad/s2", "m/s2", "commanded acceleration over the communication step (mode 2)"),
)


def _ports(
    robot: Robot,
    driven: list[tuple[int, int]],
    signal: _Signal,
    causality: Causality,
    starts: list[float] | None = None,
) -> Iterator[Variable]:
    """One variable a driven joint."""
    for number, i in driven:
        joint = robot.stages[i].joint
        unit = signal.prismatic if joint.kind == "prismatic" else signal.revolute
        start = starts[i] if starts is not None else None
        text = f"{joint.name}: {signal.what}"
        yield Variable(f"{signal.name}_{number}", causality, "continuous", unit, start, text, f"{signal.place}[{i}]")


def _parameter(name: str, start: float, unit: str, what: str, place: str, *, fixed: bool = False) -> Variable:
    return Variable(name, "parameter", "fixed" if fixed else "tunable", unit, float(start), what, place)


def _body(robot: Robot, stage: Stage, i: int) -> Iterator[Variable]:
    """Mass properties of an arm, in its moving joint frame."""
    body, name = robot.inertia_in_joint(i), stage.arm.name
    if body.mass == 0.0:
        return
    yield _parameter(f"{name}.mass", body.mass, "kg", "mass", f"chain.mass[{i}]")
    for k, axis in enumerate("xyz"):
        what = f"center of mass in the moving joint frame, {axis}"
        yield _parameter(f"{name}.com.{axis}", body.com[k], "m", what, f"chain.com[{i}][{k}]")


def _drive(stage: Stage, i: int, theta_start: float) -> Iterator[Variable]:
    """Numbers of the effects that a joint has."""
    name, drive, sensor = stage.joint.name, stage.drive, stage.sensor
    turns = stage.joint.kind == "revolute"
    length, torque = ("rad", "N.m") if turns else ("m", "N")
    stiffness, damping = ("N.m/rad", "N.m.s/rad") if turns else ("N/m", "N.s/m")

    def number(of: str, value: float, unit: str, what: str, place: str) -> Variable:
        return _parameter(f"{name}.{of}", value, unit, what, place)

    if not drive.passive:
        what = "motor side at the start (mode 1)"
        yield _parameter(f"{name}.theta_start", theta_start, length, what, f"theta_start[{i}]", fixed=True)
    if drive.inertia:
        of = "dummy_inertia" if drive.dummy else "rotor_inertia.inertia"
        yield number(of, drive.inertia, "kg.m2" if turns else "kg", "motor side's inertia", f"drives.inertia[{i}]")
    if drive.spring:
        k, b, gap = drive.spring.stiffness, drive.spring.damping, drive.spring.gap
        yield number("joint_compliance.stiffness", k, stiffness, "spring's stiffness", f"drives.stiffness[{i}]")
        yield number("joint_compliance.damping", b, damping, "spring's damping", f"drives.spring_damping[{i}]")
        if gap:
            yield number("backlash.gap", gap, length, "whole clearance", f"gap[{i}]")
    if drive.damping:
        of, what = ("damping", "damping") if drive.passive else ("viscous_friction.coefficient", "viscous friction")
        yield number(of, drive.damping, damping, what, f"drives.damping[{i}]")
    if drive.arm_springs:
        of = "spring" if drive.passive else "joint_spring"
        pull = sum(spring.stiffness for spring in drive.arm_springs)
        rest = sum(spring.stiffness * spring.rest for spring in drive.arm_springs) / pull if pull else 0.0
        yield number(f"{of}.stiffness", pull, stiffness, "stiffness of the arm's springs", f"drives.arm_stiffness[{i}]")
        yield number(f"{of}.rest", rest, length, "where they are at rest", f"drives.arm_rest[{i}]")
    if drive.slips:
        level, pull = sum(slip.level for slip in drive.slips), sum(slip.stiffness for slip in drive.slips)
        yield number("hysteresis.torque", level, torque, "sum of the elements' levels", f"hysteresis_torque[{i}]")
        yield number("hysteresis.stiffness", pull, stiffness, "sum of their stiffness", f"hysteresis_stiffness[{i}]")
    if drive.gain != 1.0:
        yield number("torque_constant.gain", drive.gain, "", "true torque per commanded one", f"drives.gain[{i}]")
    if math.isfinite(drive.torque_limit):
        what = "cut of the commanded torque"
        yield number("torque_limit.torque", drive.torque_limit, torque, what, f"torque_limit[{i}]")
    if sensor.position_offset:
        what = "reported less true position"
        yield number("encoder_offset.offset", sensor.position_offset, length, what, f"position_offset[{i}]")
    if sensor.torque_offset:
        yield number("torque_offset.torque", sensor.torque_offset, torque, "added to tau", f"torque_offset[{i}]")


def law_parameters(robot: Robot, first: list[int]) -> Iterator[Variable]:
    """Numbers of the laws of effects, by the names of the effects' columns.

    Args:
        robot: The robot.
        first: Number of each joint's first term.
    """
    for i, stage in enumerate(robot.stages):
        seen: set[str] = set()
        for k, term in enumerate(stage.drive.terms, start=first[i]):
            if term.effect in seen:
                continue
            seen.add(term.effect)
            columns = [column.name for column in effect_named(term.effect).columns]
            # an effect with an apply() of its own may hand its laws other numbers than its columns
            named = columns if len(columns) == len(term.parameters) else []
            for number, value in enumerate(term.parameters):
                if math.isfinite(value):
                    name = named[number] if named else f"parameter_{number + 1}"
                    what = f"parameter {number + 1} of the law of {term.effect}"
                    place = f"drives.parameters[{k}][{number}]"
                    yield _parameter(f"{stage.joint.name}.{term.effect}.{name}", value, "", what, place)
