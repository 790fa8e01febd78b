"""Simscape Multibody: MATLAB functions that build the robot by the class API and run it, beside a URDF for smimport."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from ..core.representation import Robot
from ..core.simulation.backend import Concept, Emission, Program
from .common import Fate, concepts_of, header_lines
from .emitted_only import EmittedOnly
from .simscape_text import matlab_files, matlab_name, unsaid_laws
from .urdf_text import urdf_text

_IN_URDF = "in the URDF beside the functions; the class API has none"
_IN_RUN = "in NAME_drives, which NAME_run applies; a block diagram made of the robot lacks it"
_FATES: dict[str, Fate] = {
    "gravity": ("exact", "Gravity of the Multibody"),
    "base": ("exact", "frame base of the body base"),
    "kinematics": ("exact", "frames of the bodies; a body's reference is the moving frame of its joint"),
    "corrections": ("exact", "in the frames of the joints: they stand at their real places"),
    "inertia": ("exact", "MassDistribution: mass, center, moments, products (Iyz Izx Ixy, the tensor's elements)"),
    "shapes": ("exact", "visuals of the URDF beside the functions; the functions draw a cube a body"),
    "tool": ("exact", "frame tool of the last body"),
    "joint.type": ("exact", "RevoluteJoint or PrismaticJoint, z axis"),
    "limits.position": ("exact", _IN_URDF),
    "limits.velocity": ("exact", _IN_URDF),
    "limits.effort": ("exact", _IN_URDF),
    "home": ("impossible", "the operating point is where the program starts"),
    "rotor_inertia.inertia": ("exact", _IN_RUN),
    "joint_compliance.stiffness": ("exact", "TorsionalSpringDamper or AxialSpringDamper, units said"),
    "joint_compliance.damping": ("exact", "TorsionalSpringDamper or AxialSpringDamper, units said"),
    "backlash.gap": ("exact", _IN_RUN),
    "viscous_friction.coefficient": ("exact", _IN_RUN),
    "hysteresis": ("impossible", "its elements remember; the run's equations have no memory"),
    "joint_spring": ("exact", _IN_RUN),
    "torque_constant.gain": ("exact", _IN_RUN),
    "torque_limit.torque": ("exact", "in NAME_command"),
    "encoder_offset.offset": ("exact", "the command is shifted by it"),
    "torque_offset.torque": ("impossible", "NAME_run reports no torque"),
    "delay": ("impossible", "the run's controller acts at once"),
    "controller_gain": ("exact", "factors of the controller's gains in NAME_command"),
}


class SimscapeBackend(EmittedOnly):
    """MATLAB functions for Simscape Multibody (class API, R2022a and later) and a URDF for smimport."""

    name: ClassVar[str] = "simscape"
    engine: ClassVar[str] = "Simscape Multibody"
    integrator: ClassVar[str] = "ode15s, chosen in NAME_run"
    order: ClassVar[int] = 5
    gate_class: ClassVar[Literal["A", "B"]] = "A"
    largest_step: ClassVar[float] = 1.0e-3
    stable: ClassVar[float] = math.inf
    elsewhere: ClassVar[str] = "the functions run in MATLAB with Simscape Multibody."

    def emit(self, robot: Robot, program: Program) -> Emission:
        """The robot, its commands and its drives as functions, and the URDF.

        Raises:
            RefusedError: An elastic joint without an inertia shall be moved by torque, or the robot finds no rest.
        """
        self.insist_on(robot, program)
        name = matlab_name(robot.name)
        header = header_lines(
            robot,
            "conventions: the reference of body arm_i is the moving frame of joint i at its real place (geometry "
            "corrections included), z along the axis; an elastic joint i is the joint i_drive to the dummy body "
            "joint_i_motor, and the joint i from there to the arm, both about one axis",
            "inertia: about the center of mass; products in the order yz zx xy, elements of the tensor (minus the "
            "integral)",
            "dummy bodies, and arms without mass, have a 1e-12th of the lightest arm's mass; rotor inertias act in "
            f"{name}_run",
            f"smimport({name}.urdf) knows neither springs, nor rotors, nor friction, and drops them without a word",
        )
        files = matlab_files(robot, program, name, header)
        files[f"{name}.urdf"] = urdf_text(robot)
        concepts = concepts_of(robot, lambda datum, i: _fate(robot, program, name, datum, i))
        return Emission(self.name, f"{name}_simscape.m", files, concepts + tuple(_of_program(program, name)))


def _of_program(program: Program, name: str) -> list[Concept]:
    """What became of the motion, the controller and the start."""
    concepts = [Concept("motion", "all joints", "exact", f"{name}_command: the law's own polynomials, thrice")]
    if program.control.mode == "pd":
        how = f"continuous; the {program.control.rate!r} Hz ticks and the held torque are not in {name}_command"
        concepts.append(Concept("control", "all joints", "approximated", how))
    elif program.control.mode != "motion":
        how = f"{name}_command gives torques of 0: put others there"
        concepts.append(Concept("control", "all joints", "impossible", how))
    concepts.append(Concept("start", "robot", "exact", "the operating point: settled, elastic joints sagged"))
    return concepts


def _fate(robot: Robot, program: Program, name: str, datum: str, i: int) -> Fate:
    status, how = _status(robot, program, datum, i)
    return status, how.replace("NAME", name)


def _status(robot: Robot, program: Program, datum: str, i: int) -> Fate:
    if datum == "corrections" and i == robot.n - 1:
        return "exact", "the flange: in the shapes"
    if datum == "dummy_inertia":
        if program.control.mode == "motion":
            return "exact", "none: it counts 0 where motion is imposed"
        return _FATES["rotor_inertia.inertia"]
    if datum in _FATES:
        return _FATES[datum]
    stick = robot.friction.model == "stick"
    if datum == "friction.model":
        smooth = f"tanh of speed over {robot.friction.velocity!r}"
        return ("approximated", f"{smooth} instead of a state that holds: it creeps") if stick else ("exact", smooth)
    if datum in unsaid_laws(robot, i):
        return "impossible", "its law is no expression of one line"
    levels = any(term.effect == datum and term.kind == "level" for term in robot.stages[i].drive.terms)
    if levels and stick:
        return "approximated", "its level, times tanh of the speed instead of sticking; " + _IN_RUN
    return "exact", _IN_RUN
