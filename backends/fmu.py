"""A co-simulation unit (FMI 2.0): the robot in C, for every tool that imports units; none of them needs Python."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import ClassVar, Literal

from ..core.representation import Robot
from ..core.simulation.backend import Backend, Concept, Emission, Program
from ..core.simulation.step import choose_step, poses_of
from .common import Fate, concepts_of, header_lines
from .emitted_only import EmittedOnly
from .fmu_unit import Unit, archive, binary_place, compiled_unit, compiler, unit_of

_FATES: dict[str, Fate] = {
    "gravity": ("exact", "parameters gravity_in_base"),
    "base": ("exact", "in gravity_in_base; its place moves nothing, outputs are in the base"),
    "kinematics": ("exact", "numbers of the chain"),
    "corrections": ("exact", "in the chain: the joints stand at their real places"),
    "inertia": ("exact", "numbers of the chain; mass and center of mass are parameters"),
    "tool": ("exact", "outputs ee"),
    "joint.type": ("exact", "kinds of the chain"),
    "shapes": ("impossible", "nothing to look at in a unit"),
    "home": ("impossible", "the unit starts where its program does"),
    "limits.position": ("impossible", "they bound planning; nothing in the unit enforces them"),
    "limits.velocity": ("impossible", "they bound planning; nothing in the unit enforces them"),
    "limits.effort": ("impossible", "they bound planning; nothing in the unit enforces them"),
    "friction.model": ("exact", "in the drives' equations"),
    "controller_gain": ("impossible", "the controller is outside of the unit"),
    "delay": ("exact", "parameter delay.time"),
}


class FmuBackend(EmittedOnly):
    """An FMU for co-simulation: description, C sources, and a binary of this platform where there is a compiler."""

    name: ClassVar[str] = "fmu"
    engine: ClassVar[str] = "FMI 2.0 for Co-Simulation"
    integrator: ClassVar[str] = "RK4, within the unit"
    order: ClassVar[int] = 4
    gate_class: ClassVar[Literal["A", "B"]] = "A"
    largest_step: ClassVar[float] = 1.0e-3
    stable: ClassVar[float] = 2.7
    # it may be driven either way, so elastic parts are joints on springs, moved by nothing else
    scripted: ClassVar[bool] = False
    elsewhere: ClassVar[str] = "a tool that imports FMI 2.0 units runs it, FMPy for instance."
    compiles: ClassVar[bool] = True

    def emit(self, robot: Robot, program: Program) -> Emission:
        """One .fmu.

        Raises:
            RefusedError: A law has no form in C, or the robot cannot be moved so.
        """
        return self.begin(robot, program)()

    def begin(self, robot: Robot, program: Program) -> Callable[[], Emission]:
        """The sources at once; a compiler makes the binary of them meanwhile.

        Raises:
            RefusedError: A law has no form in C, or the robot cannot be moved so.
        """
        self.insist_on(robot, program)
        program = replace(program, step=_step(self, robot, program))
        header = header_lines(
            robot,
            "conventions: ports are those of a run's data: q as the encoder reports it, q_link the arm's side",
            f"integration: classical Runge-Kutta, steps of {program.step!r} s or shorter",
        )
        unit = unit_of(robot, program, header)
        main = f"{robot.name}.fmu"
        found = compiler()
        compiling = _in_background(compiled_unit, unit, found) if found else None

        def packed() -> Emission:
            content: dict[str, str | bytes] = dict(unit.texts)
            if compiling:
                content[binary_place(unit.identifier)] = compiling.result()
            concepts = concepts_of(robot, _fate) + tuple(_of_program(program, unit.mode, compiling is not None))
            return Emission(self.name, main, {}, concepts, {main: archive(content)})

        return packed


def _in_background(function: Callable[[Unit, str], bytes], unit: Unit, with_compiler: str) -> Future[bytes]:
    """Its result to come; where nobody asks for it, it ends by itself and leaves nothing behind."""
    with_thread = ThreadPoolExecutor(1)
    try:
        return with_thread.submit(function, unit, with_compiler)
    finally:
        with_thread.shutdown(wait=False)


def _step(backend: Backend, robot: Robot, program: Program) -> float:
    """A step that does for every way in which the joints can be moved [s]."""
    weightless = any(stage.drive.spring and stage.drive.inertia == 0.0 for stage in robot.stages)
    poses = poses_of(robot, program.motion)
    steps = [
        choose_step(robot, backend, imposed=way, poses=poses) for way in ((True,) if weightless else (True, False))
    ]
    return min(program.step, *steps)


def _of_program(program: Program, mode: int, compiled: bool) -> list[Concept]:
    moved = {1: "torque in (mode 1)", 2: "motion in (mode 2)", 3: "the motion within (mode 3)"}[mode]
    concepts = [Concept("motion", "all joints", "exact", f"within the unit as polynomials; it starts with {moved}")]
    if program.control.mode == "pd":
        concepts.append(Concept("control", "all joints", "impossible", "the controller is outside; its torque goes in"))
    if not compiled:
        how = "sources only, for want of a C compiler here; whoever imports the unit has to compile them"
        concepts.append(Concept("binary", "robot", "impossible", how))
    return concepts


def _fate(datum: str, i: int) -> Fate:
    return _FATES.get(datum, ("exact", "parameters of the joint, by the effect's name"))
