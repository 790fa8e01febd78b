"""MSC Adams: a View command file and a Solver dataset of the same model, to be run by those who have Adams."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from ..core.representation import Robot
from ..core.simulation.backend import Concept, Emission, Program
from .adams_build import Built, adams_name, build_model
from .adams_drives import said_laws
from .adams_text import command_text, dataset_text, run_text
from .common import Fate, concepts_of, header_lines
from .emitted_only import EmittedOnly

_FATES: dict[str, Fate] = {
    "gravity": ("exact", "ACCGRAV"),
    "base": ("exact", "in the ground's markers"),
    "kinematics": ("exact", "markers of the joints; a part's frame is the moving frame of its joint"),
    "corrections": ("exact", "in the markers of the joints: they stand at their real places"),
    "inertia": ("exact", "MASS, CM and IP about the marker cm; products with Adams' sign, plus the integral"),
    "tool": ("exact", "marker tool on the last part"),
    "joint.type": ("exact", "JOINT, REVOLUTE or TRANSLATIONAL, along the z axes of its markers"),
    "limits.position": ("impossible", "nothing in the files: a stop would be a force of its own"),
    "limits.velocity": ("impossible", "nothing in the files"),
    "limits.effort": ("impossible", "nothing in the files; torque_limit cuts the motor's torque"),
    "home": ("impossible", "the parts stand where the program starts"),
    "rotor_inertia.inertia": ("exact", "-J times the acceleration in the motor's torque, as seen by the part before"),
    "joint_compliance.stiffness": ("exact", "spring from the dummy part to the arm, radians"),
    "joint_compliance.damping": ("exact", "the same spring's damping"),
    "backlash.gap": ("exact", "IF, MIN and MAX in the spring's function"),
    "viscous_friction.coefficient": ("exact", "in the motor's torque"),
    "hysteresis": ("impossible", "its elements remember; no function expression does"),
    "joint_spring": ("exact", "torque between the arm and the part before"),
    "torque_constant.gain": ("exact", "factor of the commanded torque"),
    "torque_limit.torque": ("exact", "MIN and MAX in the commanded torque"),
    "encoder_offset.offset": ("exact", "the command is shifted by it"),
    "torque_offset.torque": ("exact", "added to tau in the requests"),
    "delay": ("exact", "DELAY of the commanded torque (Adams Solver C++)"),
    "controller_gain": ("exact", "factors of the controller's gains"),
}


class AdamsBackend(EmittedOnly):
    """A View command file (.cmd), a Solver dataset (.adm) and the Solver's commands to run it (.acf)."""

    name: ClassVar[str] = "adams"
    engine: ClassVar[str] = "MSC Adams"
    integrator: ClassVar[str] = "GSTIFF SI2, chosen in the files"
    order: ClassVar[int] = 2
    gate_class: ClassVar[Literal["A", "B"]] = "A"
    largest_step: ClassVar[float] = 1.0e-3
    stable: ClassVar[float] = math.inf
    # its parts without mass of their own may hang on springs: no need of motor sides that stand still
    scripted: ClassVar[bool] = False
    elsewhere: ClassVar[str] = "Adams is a program of its own, that opens the .cmd or runs the .adm."

    def emit(self, robot: Robot, program: Program) -> Emission:
        """The robot, and its program, as three files.

        Raises:
            RefusedError: An elastic joint without an inertia shall be moved by torque, or the robot finds no rest.
        """
        self.insist_on(robot, program)
        built = build_model(robot, program)
        name = adams_name(robot.name)
        header = header_lines(
            robot,
            "angles: radians; orientations: body-fixed 3-1-3",
            "conventions: the frame of part arm_i is the moving frame of joint i at its real place (geometry "
            "corrections included), z along the axis; an elastic joint i is the joint i_drive to the "
            "dummy part joint_i_motor, and the joint i from there to the arm, both about one axis",
            "products of inertia: plus the integral (Adams' sign)",
            "rotor inertias act through the acceleration in the motor's torque; dummy parts, and arms without mass, "
            "have a 1e-12th of the lightest arm's mass",
            _motion_line(built),
        )
        dataset = f"{name}.adm"
        files = {
            f"{name}.cmd": command_text(built, header),
            dataset: dataset_text(built, header),
            f"{name}.acf": run_text(built, dataset),
        }
        concepts = concepts_of(robot, lambda datum, i: _fate(robot, program, datum, i))
        return Emission(self.name, f"{name}.cmd", files, concepts + tuple(_of_program(program, built)))


def _motion_line(built: Built) -> str:
    splines = built.splines
    if not any(splines.moves(i) for i in range(splines.position.shape[1])):
        return "motion: none, the command stands still"
    q, dq, ddq = splines.errors
    return (
        f"motion: {splines.function} through {len(splines.knots)} knots; it and its derivatives are within {q:.1e} rad "
        f"or m, {dq:.1e} a second and {ddq:.1e} a second^2 of the law"
    )


def _of_program(program: Program, built: Built) -> list[Concept]:
    """What became of the motion, the controller and the start."""
    said = _motion_line(built).removeprefix("motion: ")
    still = said.startswith("none")
    exact = still or built.splines.exact
    concepts = [Concept("motion", "all joints", "exact" if exact else "approximated", said)]
    if program.control.mode == "pd":
        how = f"continuous; the {program.control.rate!r} Hz ticks and the held torque are not in the files"
        concepts.append(Concept("control", "all joints", "approximated", how))
    elif program.control.mode != "motion":
        how = "variables joint_i_tau are 0: drive them by functions, or from outside (Adams Controls)"
        concepts.append(Concept("control", "all joints", "impossible", how))
    how = "the parts stand as they do settled, elastic joints sagged"
    if built.begins_moving:
        how += "; elastic joints begin without relative speed by their initial conditions"
    concepts.append(Concept("start", "robot", "exact", how))
    return concepts


def _fate(robot: Robot, program: Program, datum: str, i: int) -> Fate:
    if datum == "corrections" and i == robot.n - 1:
        return "exact", "the flange: in the shapes"
    if datum == "shapes":
        if any(shape.kind == "mesh" for shape in robot.stages[i].arm.shapes):
            return "impossible", "meshes are in neither file; other shapes are drawn by the .cmd"
        return "exact", "geometry of the .cmd; the .adm has none"
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
    if datum in said_laws(robot, i).unsaid:
        return "impossible", "its law has no function expression here"
    levels = any(term.effect == datum and term.kind == "level" for term in robot.stages[i].drive.terms)
    if levels and stick:
        return "approximated", "its level, times tanh of the speed instead of sticking"
    return "exact", "its law as a function expression"
