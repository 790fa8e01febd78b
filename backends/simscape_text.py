"""A robot and a program as MATLAB functions: the build, the command, the drives and the run."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.rendering import comment_line, number, render
from ..core.representation import Inertia, Pose, Robot, Stage
from ..core.simulation.backend import Program
from .commanded import Commanded, commanded
from .law_expression import Dialect, law_expression
from .negligible import negligible

WIDTH = 110
# MATLAB cuts longer names
LONGEST_NAME = 63
OUTPUT_RATE = 1000.0
# rows of the feedforward's table at most
MOST_TICKS = 2000
RELATIVE_ERROR = 1.0e-7
ABSOLUTE_ERROR = 1.0e-9
_FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "log10")
MATLAB = Dialect("^", {name: name for name in (*_FUNCTIONS, "sqrt", "abs", "max", "min")} | {"fabs": "abs"})


@dataclass(frozen=True, slots=True)
class Axis:
    """One joint of the class API.

    Attributes:
        name: Of the joint.
        kind: "revolute" or "prismatic".
        base, follower: Frames that it connects, "body/frame".
        spring: (stiffness, damping, rest) of its force law; None: it has none.
        start: (position, speed) [rad or m].
    """

    name: str
    kind: str
    base: str
    follower: str
    spring: tuple[float, float, float] | None
    start: tuple[float, float]

    @property
    def path(self) -> str:
        """Of its primitive."""
        return f"{self.name}/{'Rz' if self.kind == 'revolute' else 'Pz'}"


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame on a body, placed in another frame of it."""

    name: str
    parent: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class Segment:
    """A body and the joint that moves it.

    Attributes:
        name: Of the body.
        inertia: In its reference frame.
        frames: Beside the reference.
        axis: The joint.
    """

    name: str
    inertia: Inertia
    frames: tuple[Frame, ...]
    axis: Axis


def matlab_name(name: str) -> str:
    """A name as MATLAB takes it for functions: letters, digits and underscores, a letter first, not too long."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name)
    text = text if text[:1].isalpha() else f"robot_{text}"
    return text[: LONGEST_NAME - len("_simscape")]


def matlab_files(robot: Robot, program: Program, name: str, header: Sequence[str]) -> dict[str, str]:
    """File name to text of the four functions.

    Raises:
        RefusedError: The robot finds no rest to start from.
    """
    commands = commanded(robot, program)
    base, segments = _segments(robot, commands)
    values: dict[str, Any] = {
        "name": name,
        "header": [line for text in header for line in textwrap.wrap(_ascii(text), WIDTH)],
        "num": number,
        "row": _row,
        "matrix": _matrix,
        "mode": program.control.mode,
    }
    n, stages = robot.n, robot.stages
    files = {
        "simscape": {"gravity": robot.gravity, "base": base, "segments": segments},
        "command": _command(program, commands),
        "drives": {"n": n, "lines": [line for i in range(n) for line in _laws(robot, i).lines]},
        "run": {
            "axes": [_run_axis(stage, program.control.mode == "motion") for stage in stages],
            "duration": program.duration,
            "rate": OUTPUT_RATE,
            "relative": RELATIVE_ERROR,
            "absolute": ABSOLUTE_ERROR,
            "q": commands.start.q,
            "theta": commands.start.theta,
            "dq": commands.start.dq,
            "dtheta": commands.start.dtheta,
        },
    }
    return {f"{name}_{part}.m": render(f"simscape/{part}.m.j2", **values, **more) for part, more in files.items()}


def unsaid_laws(robot: Robot, i: int) -> set[str]:
    """Names of effects at joint i (from 0) whose laws have no expression."""
    return _laws(robot, i).unsaid


def _ascii(text: str) -> str:
    return comment_line(text).encode("ascii", "backslashreplace").decode("ascii")


def _row(values: Iterable[float]) -> str:
    return "[" + " ".join(number(value) for value in values) + "]"


def _matrix(rows: Iterable[Iterable[float]]) -> str:
    return "[" + "; ".join(" ".join(number(value) for value in row) for row in rows) + "]"


def _segments(robot: Robot, commands: Commanded) -> tuple[tuple[Frame, ...], list[Segment]]:
    """Frames of the base, and all bodies from there to the tool."""
    small = negligible(robot)
    segments: list[Segment] = []
    before = "base"
    for i, stage in enumerate(robot.stages):
        name, kind = stage.joint.name, stage.joint.kind
        q, theta = float(commands.start.q[i]), float(commands.start.theta[i])
        dq, dtheta = float(commands.start.dq[i]), float(commands.start.dtheta[i])
        frames = [Frame("tool", "reference", robot.tool_in_last_joint())]
        if i + 1 < robot.n:
            frames = [Frame(f"{robot.stages[i + 1].joint.name}_seat", "reference", robot.joint_in_previous(i + 1))]
        inertia = small if stage.arm.inertia == Inertia() else robot.inertia_in_joint(i)
        seat = f"{before}/{name}_seat"
        if stage.drive.spring:
            motor = f"{name}_motor"
            drive = Axis(f"{name}_drive", kind, seat, f"{motor}/reference", None, (theta, dtheta))
            segments.append(Segment(motor, small, (), drive))
            seat, q, dq = f"{motor}/reference", q - theta, dq - dtheta
        axis = Axis(name, kind, seat, f"{stage.arm.name}/reference", _spring(stage), (q, dq))
        segments.append(Segment(stage.arm.name, inertia, tuple(frames), axis))
        before = stage.arm.name
    seat = Frame(f"{robot.stages[0].joint.name}_seat", "base", robot.joint_in_previous(0))
    return (Frame("base", "reference", robot.base), seat), segments


def _spring(stage: Stage) -> tuple[float, float, float] | None:
    """The linear spring of a joint, that the class API has a force law for."""
    drive = stage.drive
    if drive.passive:
        (spring,) = drive.arm_springs
        return spring.stiffness, drive.damping, spring.rest
    if drive.spring is None or not _linear(stage):
        return None
    return drive.spring.stiffness, drive.spring.damping, 0.0


def _linear(stage: Stage) -> bool:
    spring = stage.drive.spring
    return spring is not None and not spring.gap and not any(term.kind == "error" for term in stage.drive.terms)


def _command(program: Program, commands: Commanded) -> dict[str, Any]:
    """The law's polynomials, and what the controller makes of them."""
    law, control = commands.motion, program.control
    times = np.linspace(0.0, program.duration, 1 + min(MOST_TICKS, math.ceil(program.duration * control.rate)))
    forward = commands.feedforward(times)
    return {
        "knots": law.knots,
        "shape": law.coefficients.shape,
        # by joint, piece and power
        "polynomials": law.coefficients.transpose(2, 1, 0).tolist(),
        "feedforward": None if forward is None else (times, forward),
        "kp": commands.kp,
        "kd": commands.kd,
        "limited": control.mode == "pd" and bool(np.isfinite(commands.limit).any()),
        "limit": commands.limit,
    }


@dataclass(frozen=True, slots=True)
class _Laws:
    """Lines of NAME_drives for one joint, and what they cannot say."""

    lines: list[str]
    unsaid: set[str]


def _laws(robot: Robot, i: int) -> _Laws:
    stage, drive = robot.stages[i], robot.stages[i].drive
    if drive.passive:
        return _Laws([], set())
    k = i + 1
    values = {name: f"{name}({k})" for name in ("q", "dq", "theta", "dtheta")} | {"t": "t"}
    if drive.spring:
        values["load"] = f"transmitted({k})"
    # what depends on two joints is no law of one
    unsaid = {term.effect for term in drive.terms if term.kind == "coupled"}

    def terms(kind: str) -> list[str]:
        found = [
            (term.effect, law_expression(term.effect, term.law, term.parameters, values, MATLAB))
            for term in drive.terms
            if term.kind == kind
        ]
        unsaid.update(effect for effect, text in found if text is None)
        return [text for _, text in found if text is not None]

    lines = [f"% {stage.joint.name}"]
    slope = " + ".join(terms("error_slope"))
    faster = f" * (1 + {slope})" if slope else ""
    if drive.spring:
        error = "".join(f" + {text}" for text in terms("error"))
        lines.append(
            f"transmitted({k}) = spring({number(drive.spring.stiffness)}, {number(drive.spring.damping)}, "
            f"{number(0.5 * drive.spring.gap)}, theta({k}){error} - q({k}), dtheta({k}){faster} - dq({k}));"
        )
    resistance = [f"{number(drive.damping)} * dtheta({k})"] if drive.damping else []
    resistance += terms("resistance")
    level = terms("level")
    if level:
        resistance.append(f"({' + '.join(level)}) * tanh(dtheta({k}) / {number(robot.friction.velocity)})")
    lines.append(f"friction({k}) = {' + '.join(resistance) or '0'};")
    springs = [f"-{number(spring.stiffness)} * (q({k}) - {MATLAB.number(spring.rest)})" for spring in drive.arm_springs]
    lines.append(f"on_arm({k}) = {' + '.join(springs + terms('arm')) or '0'};")
    back = f" - transmitted({k}){faster}" if drive.spring else ""
    gain = f"{number(drive.gain)} * " if drive.gain != 1.0 else ""
    lines.append(f"motor({k}) = {gain}command({k}) - friction({k}){back};")
    return _Laws(lines, unsaid)


def _run_axis(stage: Stage, imposed: bool) -> dict[str, Any]:
    """What NAME_run must know of one joint."""
    drive, name = stage.drive, stage.joint.name
    primitive = "Rz" if stage.joint.kind == "revolute" else "Pz"
    elastic = drive.spring is not None
    return {
        "arm": f"{name}/{primitive}",
        "motor": f"{name}_drive/{primitive}" if elastic else f"{name}/{primitive}",
        "revolute": stage.joint.kind == "revolute",
        "elastic": elastic,
        "passive": drive.passive,
        "linear": _linear(stage),
        "inertia": 0.0 if imposed and drive.dummy else drive.inertia,
    }


__all__ = ["matlab_files", "matlab_name", "unsaid_laws"]
