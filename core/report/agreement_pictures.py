"""The pictures of an agreement: the tool's path, deflections, distances to the gates, errors against steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..agreement import Agreement
from ..agreement.convergence import Convergence
from ..agreement.culprit import WORDS
from ..agreement.runs import Run
from ..agreement.scenarios import SCENARIOS
from ..kinematics import kinematics
from ..simulation.backend import Vector
from .pictures import COLOURS, Picture, line_style, new_figure, picture, styled

# points a curve is drawn with
POINTS = 500
# differences below this part of a gate are drawn on the picture's left edge
LEFT_EDGE = 1.0e-8
COMMAND = "#9aa2ac"


def _thin(values: Vector) -> Vector:
    """Every so many points, the last one included."""
    every = max(1, len(values) // POINTS)
    return values if every == 1 else np.concatenate([values[::every], values[-1:]])


def _shown(runs: Sequence[Run]) -> list[Run]:
    """One run of each voice: the one as it ran."""
    return [run for run in runs if not run.half and run.manner != "extrapolated" and np.isfinite(run.tip).all()]


def path_picture(agreement: Agreement) -> Picture | None:
    """The tool's path of the elastic robot (or the rigid one), with a corner of it enlarged."""
    runs = agreement.evidence.runs
    name = next((n for n in ("compliant_motion", "compliant_loop", "rigid_loop", "friction_loop") if n in runs), None)
    if name is None or not _shown(runs[name][1]):
        return None
    scenario, found = runs[name]
    shown = _shown(found)
    command = kinematics(scenario.robot).tool_in_base(scenario.motion.at(shown[0].t)[0])[:, :3, 3]
    plane, middle = _plane([command, *(run.tip for run in shown)])
    k = _corner(command, shown[0].t)
    with styled():
        figure = new_figure(9.6, 3.9)
        whole, near = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        for axes in (whole, near):
            _draw_path(axes, command, shown, plane, middle)
        here = (command[k] - middle) @ plane.T * 1e3
        apart = max(float(np.linalg.norm(run.tip[k] - command[k])) for run in shown) * 1e3
        extent = float(np.max(np.ptp((command - middle) @ plane.T * 1e3, axis=0)))
        half = max(2.2 * apart, 0.02 * extent, 1e-6)
        near.set_xlim(here[0] - half, here[0] + half)
        near.set_ylim(here[1] - half, here[1] + half)
        whole.add_patch(_square(here, half))
        whole.set_title("path of the tool")
        near.set_title(f"the corner at {shown[0].t[k]:.2f} s, {extent / (2 * half):.0f} times larger")
        for axes in (whole, near):
            axes.set_aspect("equal", adjustable="datalim" if axes is whole else "box")
            axes.set_xlabel("in the plane of the path [mm]")
        handles, labels = whole.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    spread = max((float(np.max(np.linalg.norm(a.tip - b.tip, axis=1))) for a in shown for b in shown), default=0.0)
    off = max(float(np.max(np.linalg.norm(run.tip - command, axis=1))) for run in shown)
    caption = (
        f"{SCENARIOS[name].capitalize()}, motion {scenario.motion_name}. The robot leaves the command by up to "
        f"{_length(off)}; the engines leave each other by {_length(spread)} at most, so their lines lie on one another "
        "(widest below)."
    )
    return picture(figure, f"Path of the tool in {len(shown)} engines and a corner of it", caption)


def _square(here: Vector, half: float) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle(
        (float(here[0] - half), float(here[1] - half)), 2 * half, 2 * half, fill=False, edgecolor="#222", linewidth=0.9
    )


def _draw_path(axes: Any, command: Vector, shown: Sequence[Run], plane: Vector, middle: Vector) -> None:
    for number, run in enumerate(shown):
        x, y = (run.tip - middle) @ plane.T[:, 0] * 1e3, (run.tip - middle) @ plane.T[:, 1] * 1e3
        axes.plot(x, y, label=run.voice, **line_style(number))
    x, y = (command - middle) @ plane.T[:, 0] * 1e3, (command - middle) @ plane.T[:, 1] * 1e3
    axes.plot(x, y, color="#222", linewidth=0.9, linestyle=(0, (4, 2)), label="command")


def _plane(paths: Sequence[Vector]) -> tuple[Vector, Vector]:
    """Two unit vectors, shape (2, 3), in which a path shows most of itself, and the origin, shape (3,)."""
    points = paths[0]
    middle = points.mean(axis=0)
    spread = points - middle
    if float(np.max(np.abs(spread))) < 1e-9:
        return np.eye(3)[[0, 2]], middle
    _, _, axes = np.linalg.svd(spread, full_matrices=False)
    plane = axes[:2]
    # the same way round whatever the library's signs are
    signs = np.sign([row[int(np.argmax(np.abs(row)))] for row in plane])
    return plane * signs[:, None], middle


def _corner(command: Vector, t: Vector) -> int:
    """Index of the sharpest turn of the path, away from its ends."""
    speed = np.gradient(command, t, axis=0)
    size = np.linalg.norm(speed, axis=1)
    inner = (t > 0.15 * t[-1]) & (t < 0.9 * t[-1])
    if not inner.any() or float(size.max()) < 1e-12:
        return len(t) // 2
    # directions a little before and after
    gap = max(2, len(t) // 60)
    turn = np.zeros(len(t))
    for k in range(gap, len(t) - gap):
        before, after = command[k] - command[k - gap], command[k + gap] - command[k]
        lengths = float(np.linalg.norm(before) * np.linalg.norm(after))
        turn[k] = 1.0 - float(before @ after) / lengths if lengths > 0.0 else 0.0
    slow = size < 0.2 * float(size.max())
    score = np.where(inner & slow, turn, 0.0)
    return int(score.argmax()) if score.any() else int(np.where(inner, turn, 0.0).argmax())


def deflection_picture(agreement: Agreement) -> Picture | None:
    """What every elastic joint gives, over time."""
    runs = agreement.evidence.runs
    name = next((n for n in ("compliant_motion", "compliant_loop") if n in runs and _shown(runs[n][1])), None)
    if name is None:
        return None
    scenario, found = runs[name]
    shown = _shown(found)
    joints = [i for i, elastic in enumerate(scenario.elastic) if elastic]
    rows = math.ceil(len(joints) / 2)
    with styled():
        figure = new_figure(9.6, 1.55 * rows + 0.7)
        grid = np.atleast_2d(figure.subplots(rows, 2, sharex=True, squeeze=False))
        for axes, i in zip(grid.flat, joints, strict=False):
            slides = scenario.robot.stages[i].joint.kind == "prismatic"
            for number, run in enumerate(shown):
                bent = (run.q_link - run.theta)[:, i] * 1e3
                axes.plot(_thin(run.t), _thin(bent), label=run.voice, **line_style(number))
            axes.set_title(f"joint_{i + 1} [{'mm' if slides else 'mrad'}]")
            axes.margins(x=0.01)
        for axes in list(grid.flat)[len(joints) :]:
            axes.set_axis_off()
        for axes in grid[-1]:
            axes.set_xlabel("time [s]")
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    worst = max(
        (figure for figure in agreement.figures if figure.scenario == name and figure.signal == "deflection"),
        key=lambda figure: figure.value / figure.gate,
        default=None,
    )
    closest = f" They differ by {worst.value:.0e} of the peak at most ({worst.at})." if worst is not None else ""
    caption = f"{SCENARIOS[name].capitalize()}: arm side less motor side of every elastic joint.{closest}"
    return picture(figure, "Deflection of every joint over time, all engines over each other", caption)


def gates_picture(agreement: Agreement) -> Picture | None:
    """Every comparison as a dot: how far it is from its gate."""
    rows = list(dict.fromkeys((figure.scenario, figure.signal) for figure in agreement.figures))
    if not rows:
        return None
    with styled():
        figure = new_figure(9.6, 0.235 * len(rows) + 1.15)
        axes = figure.subplots()
        axes.axvspan(1.0, 1e12, color="#fbe3e1", zorder=0)
        axes.axvline(1.0, color="#c8312b", linewidth=1.2)
        reaches = [1.0]
        for kind, marker, colour in (("A", "o", COLOURS[0]), ("B", "D", COLOURS[1])):
            x: list[float] = []
            y: list[int] = []
            for compared in agreement.figures:
                if (compared.manner in ("first", "extrapolated")) != (kind == "B"):
                    continue
                ratio = min(compared.value / compared.gate, 1e12) if compared.gate else 1e12
                x.append(max(ratio, LEFT_EDGE))
                y.append(rows.index((compared.scenario, compared.signal)))
            if x:
                label = f"{'a' if kind == 'B' else 'no'} first-order integrator takes part"
                axes.plot(x, y, marker, color=colour, markersize=5, alpha=0.65, markeredgewidth=0, label=label)
                reaches.append(max(x))
        axes.set_xscale("log")
        axes.set_xlim(LEFT_EDGE / 2, max(30.0, 10.0 * max(reaches)))
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_yticks(range(len(rows)), [_row_name(*row) for row in rows])
        axes.set_xlabel("difference over its gate: left of the line is agreement")
        axes.grid(axis="y", visible=False)
        # a line between scenarios
        for k in range(1, len(rows)):
            if rows[k][0] != rows[k - 1][0]:
                axes.axhline(k - 0.5, color="#c9ced5", linewidth=0.8)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    failed = sum(not figure.passed for figure in agreement.figures)
    caption = (
        f"All {len(agreement.figures)} comparisons of two voices, {failed or 'none'} beyond its gate. Those that agree "
        f"to better than {LEFT_EDGE:.0e} of the gate stand on the left edge."
    )
    return picture(figure, "Every comparison as a dot on a logarithmic axis, with the gate as a line", caption)


def _row_name(scenario: str, signal: str) -> str:
    where = "at rest" if scenario == "statics" else SCENARIOS[scenario]
    return f"{where}: {WORDS[signal]}"


def order_picture(agreement: Agreement) -> Picture | None:
    """Errors of the tool's position over the step of each engine."""
    study = agreement.convergence
    if study is None or not study.points:
        return None
    with styled():
        figure = new_figure(9.6, 3.5)
        axes = figure.subplots()
        engines = [voice for voice in agreement.evidence.engines if any(name == voice for name, _, _ in study.points)]
        smallest = 1e-17
        for number, voice in enumerate(engines):
            points = sorted((step, max(error, smallest)) for name, step, error in study.points if name == voice)
            order = study.order(voice)
            told = f"{voice}: order {order:.2f}" if order is not None else voice
            steps, errors = zip(*points, strict=True)
            colour = COLOURS[number % len(COLOURS)]
            size = 11.0 - 2.2 * min(number, 4)
            axes.plot(steps, errors, "o-", color=colour, linewidth=1.6, markersize=size, alpha=0.85, label=told)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("integration step [ms]")
        axes.set_title("error of the tool's position [m]")
        _slopes(axes, study, engines)
        steps = sorted({step for _, step, _ in study.points})
        axes.set_xticks(steps, [f"{1e3 * step:.3g}" for step in steps])
        axes.minorticks_off()
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    caption = (
        f"{SCENARIOS[study.scenario].capitalize()}, {study.duration!r} s: largest error at the tool against the step, "
        f"from {study.reference} at {study.reference_step!r} s. The order is that between the two largest steps; an "
        "engine that runs another robot stops falling."
    )
    return picture(figure, "Error against step on logarithmic axes, a line an engine", caption)


def _slopes(axes: Any, study: Convergence, engines: Sequence[str]) -> None:
    """A guide of first and of fourth order above the lines of engines of about that order."""
    steps = np.array(sorted({step for _, step, _ in study.points}))
    low, high = axes.get_ylim()
    for order in (1, 4):
        alike = [voice for voice in engines if ((study.order(voice) or 4.0) < 2.0) == (order == 1)]
        points = [(step, error) for name, step, error in study.points if name in alike]
        if not points or len(steps) < 2:
            continue
        last, top = max(points)
        line = 5.0 * top * (steps / last) ** order
        axes.plot(steps, line, color="#9aa2ac", linewidth=0.9, linestyle=(0, (2, 2)))
        at = (steps[-1], line[-1])
        axes.annotate(f"order {order}", at, xytext=(-4, 3), textcoords="offset points", color="#5b6470", ha="right")
        high = max(high, 10.0 * float(line[-1]))
    axes.set_ylim(low, high)


def _length(value: float) -> str:
    """A length in words that people read."""
    for unit, size in (("m", 1.0), ("mm", 1e-3), ("\u00b5m", 1e-6), ("nm", 1e-9)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value:.0e} m"


def all_pictures(agreement: Agreement) -> list[Picture]:
    """Those that there are, in the order of the page."""
    drawn = (f(agreement) for f in (path_picture, deflection_picture, gates_picture, order_picture))
    return [made for made in drawn if made is not None]
