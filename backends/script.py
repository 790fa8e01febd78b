"""What the emitted scripts share: literals, the laws' and the drives' own text, and what the script runs by itself."""

from __future__ import annotations

import inspect
import math
import re
import textwrap
from collections.abc import Callable
from functools import cache
from typing import Any, cast

import numpy as np

from ..core.control.controller import feedforward_along
from ..core.errors import RefusedError
from ..core.motion import evaluate
from ..core.rendering import python_literal
from ..core.representation import Robot
from ..core.simulation import drive_law, drive_table, imposed
from ..core.simulation.backend import Program, Vector
from ..core.simulation.compiled import law_function, uses_load
from ..core.simulation.drive_sheet import DriveSheet
from .commanded import commanded

WIDTH = 118
# more numbers than this never stand on one line
FLAT = 16
_KERNEL = (
    drive_law.DriveTable,
    drive_law.DriveMemory,
    drive_law.call_law,
    drive_law.transmitted_torque,
    drive_law.drive_torques,
    drive_law.memory_torques,
    drive_law.coordinate_torques,
    drive_table.drive_table,
    drive_table.drive_memory,
    drive_table.relax,
)
_LOADED = (drive_law.factorised, drive_law.solved, drive_law.loaded_torques)
_MOTION = (evaluate.MotionTable, evaluate.motion_at)
_CONSTANTS = ("LEVEL", "RESISTANCE", "ARM", "ERROR", "ERROR_SLOPE", "COUPLED")
_LOADED_CONSTANTS = ("LOAD_ITERATIONS", "LOAD_TOLERANCE")


def script_values(robot: Robot, program: Program) -> dict[str, Any]:
    """What the templates of scripts need beside the engine's own model."""
    sheet = DriveSheet.of(robot)
    loaded = needs_load(sheet)
    motion = program.motion
    return {
        "name": robot.name,
        "drives": literal(sheet.to_data()),
        "loaded": loaded,
        "laws": [(effect, law, _law_text(effect, law)) for effect, law in sheet.laws()],
        "constants": [(name, getattr(drive_law, name)) for name in (*_CONSTANTS, *_LOADED_CONSTANTS * loaded)],
        "kernel": sources(*_KERNEL, *_LOADED * loaded),
        "motion_text": sources(*_MOTION),
        "correction_time": imposed.CORRECTION_TIME,
        "motion": literal({"knots": motion.knots.tolist(), "coefficients": motion.coefficients.tolist()}),
        "control": literal(_control(robot, program)),
        "feedforward": literal(_feedforward(robot, program)),
        "start": literal(_start(robot, program)),
        "duration": program.duration,
        "step": program.step,
        "mode": program.control.mode,
        "elastic": any(sheet.elastic()),
    }


@cache
def sources(*items: Any) -> str:
    """Text of functions and classes, verbatim."""
    return "\n\n\n".join(inspect.getsource(item).rstrip() for item in items)


def needs_load(sheet: DriveSheet) -> bool:
    """Some law at a rigid joint needs the torque that the joint passes to the arm."""
    return any(
        uses_load(term.effect, term.law) for drive in sheet.drives if drive.spring is None for term in drive.terms
    )


def motionless(robot: Robot) -> str | None:
    """Joints that would turn or shift no inertia at all, by name; None where there are none."""
    behind = 0.0
    for stage in reversed(robot.stages):
        body = stage.arm.inertia
        behind += body.mass + body.xx + body.yy + body.zz
        if behind == 0.0 and (stage.drive.inertia == 0.0 or stage.drive.spring is not None):
            return f"{stage.joint.name} moves no mass: {stage.arm.name} and what follows it have mass 0."
    return None


def literal(value: Any, indent: int = 0) -> str:
    """Plain data as Python that a person can read: on one line where it fits, else an item a line."""
    if _leaves(value) <= FLAT:
        flat = python_literal(value)
        if len(flat) + indent <= WIDTH:
            return flat
    deeper = " " * (indent + 4)
    if isinstance(value, dict):
        items = cast("dict[Any, Any]", value)
        lines = [f"{deeper}{python_literal(key)}: {literal(item, indent + 4)},\n" for key, item in items.items()]
        return "{\n" + "".join(lines) + " " * indent + "}"
    if isinstance(value, list | tuple):
        rows = cast("list[Any]", list(value))  # pyright: ignore[reportUnknownArgumentType]
        if any(isinstance(row, dict | list | tuple | str) for row in rows):
            body = "".join(f"{deeper}{literal(row, indent + 4)},\n" for row in rows)
        else:
            numbers = ", ".join(python_literal(row) for row in rows) + ","
            body = textwrap.fill(numbers, WIDTH, initial_indent=deeper, subsequent_indent=deeper) + "\n"
        return f"[\n{body}{' ' * indent}]"
    return python_literal(value)


def run_script(text: str, file: str) -> dict[str, Any]:
    """The names that a script defines; it runs as a module, so that its own main() does not."""
    names: dict[str, Any] = {"__name__": "mbexport_emitted", "__file__": file}
    exec(compile(text, file, "exec"), names)
    return names


def tick_times(program: Program) -> Vector:
    """When the controller looks at the robot [s], shape (m,)."""
    rate = program.control.rate
    return np.arange(math.floor(program.duration * rate + 1.0e-9 * rate) + 1) / rate


def _leaves(value: Any) -> int:
    if isinstance(value, dict):
        return sum(map(_leaves, cast("dict[Any, Any]", value).values()))
    if isinstance(value, list | tuple):
        return sum(map(_leaves, cast("list[Any]", value)))
    return 1


@cache
def _law_text(effect: str, law: str) -> str:
    """Source of a law under a name of its own, for two effects may call theirs the same."""
    function: Callable[..., float] = law_function(effect, law)
    try:
        text = textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError) as error:
        raise RefusedError(f"the law {law} of effect {effect} has no source text that a script could carry.") from error
    renamed, count = re.subn(rf"\Adef {re.escape(law)}\(", f"def {effect}_{law}(", text)
    if not count:
        raise RefusedError(f"the law {law} of effect {effect} must be a plain function for a script to carry it.")
    return renamed.rstrip()


def _control(robot: Robot, program: Program) -> dict[str, Any]:
    """The controller, and what of the robot acts in it."""
    control, n = program.control, robot.n
    pd = control.mode == "pd"
    return {
        "mode": control.mode,
        "rate": control.rate,
        "kp": list(control.kp) if pd else [0.0] * n,
        "kd": list(control.kd) if pd else [0.0] * n,
        "kp_factor": list(robot.kp_factor) or [1.0] * n,
        "kd_factor": list(robot.kd_factor) or [1.0] * n,
        "torque_limit": list(control.torque_limit) or [math.inf] * n,
        "delay": robot.delay,
        "feedforward": control.feedforward if pd else "none",
        "position_offset": [stage.sensor.position_offset for stage in robot.stages],
        "torque_offset": [stage.sensor.torque_offset for stage in robot.stages],
    }


def _feedforward(robot: Robot, program: Program) -> list[list[float]]:
    """Torque of the nominal rigid bodies that the controller adds at each of its ticks; none: no rows."""
    control = program.control
    if control.mode != "pd" or control.feedforward == "none":
        return []
    return feedforward_along(robot, control, *program.motion.at(tick_times(program))).tolist()


def _start(robot: Robot, program: Program) -> dict[str, list[float]]:
    """Where a run of ours starts too."""
    state = commanded(robot, program).start
    return {name: getattr(state, name).tolist() for name in ("q", "dq", "theta", "dtheta")}
