"""Pictures of the paper's runs: figures 12 and 13, the Memory block, and codes that differentiate by themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..reproduction import Reproduction
from ..reproduction.derivatives import WORDS
from ..reproduction.open_loop import about_corner
from ..reproduction.peaks import across
from ..simulation.backend import Vector
from .paper_geometry_pictures import space_labels
from .pictures import COLOURS, Drawing, by_turns, name_turns, new_figure, styled

COMMAND = {"color": "#222222", "linewidth": 0.9, "linestyle": (0, (4, 2)), "label": "desired", "zorder": 9}
MEMORY = {"color": "#222222", "linewidth": 1.2, "linestyle": (0, (1.2, 1.2)), "label": "with Memory", "zorder": 8}
# a corner is shown for so long before and after the command stands there [s]
NEAR = 0.25
# what agrees to all digits has no place on a logarithmic axis [m]
FLOOR = 1.0e-17


def open_loop_drawing(study: Reproduction) -> Drawing:
    """Figure 12: the whole path and a corner of it, open loop, elastic joints."""
    opened = study.open_loop
    moving, off = opened.moving, 1e3 * (opened.tip - opened.command)
    with styled():
        figure = new_figure(9.6, 7.0)
        grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 1.05))
        space: Any = figure.add_subplot(grid[0, 0], projection="3d")
        near = figure.add_subplot(grid[1, 0])
        time, between = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
        space.plot(*(1e3 * opened.tip[moving].T), color=COLOURS[1], linewidth=1.5)
        space.plot(*(1e3 * opened.command[moving].T), **COMMAND)
        space_labels(space, 1e3 * np.concatenate([opened.command, opened.tip]), flat=40.0)
        space.set_title("the whole path")
        time.plot(opened.t, off[:, 2], color=COLOURS[1], linewidth=1.4, label="along z")
        sag = 1e3 * (opened.resting - opened.command)[:, 2]
        time.plot(
            opened.t,
            sag,
            color=COLOURS[1],
            linewidth=1.0,
            linestyle=":",
            label="along z, the arm at rest in every point",
        )
        time.plot(
            opened.t, np.linalg.norm(off[:, :2], axis=1), color=COLOURS[0], linewidth=1.4, label="in the x-y plane"
        )
        time.axhline(0.0, **{**COMMAND, "label": "_"})
        time.set_ylim(top=float(np.max(np.abs(off[:, :2]))) + 7.5)
        time.set_title("tip off the desired path [mm]")
        time.legend(loc="upper right")
        for number, (name, tip) in enumerate(opened.tips.items()):
            near.plot(*_plane(tip, opened.t, study), **by_turns(number, len(opened.tips)))
            if number:
                apart: Vector = np.linalg.norm(tip - opened.tip, axis=1)
                between.semilogy(opened.t, np.maximum(apart, FLOOR), color=COLOURS[number], linewidth=1.1, label=name)
        name_turns(near, opened.tips)
        near.plot(*_plane(opened.command, opened.t, study), **COMMAND)
        _corner(near, study, opened.tip, opened.t)
        between.set_title(f"distance of the engines' tips from {next(iter(opened.tips))}'s [m]")
        for axes in (time, between):
            axes.set_xlabel("t [s]")
        figure.legend(*near.get_legend_handles_labels(), loc="outside lower center", ncols=6)
    data = opened.to_json()
    caption = (
        f"Imposed motion, elastic joints. The arm hangs {-1e3 * data['shift_z_m']['mean']:.2f} mm below the path in "
        f"the mean "
        f"and strays up to {1e3 * data['in_plane_m']['largest']:.2f} mm in the plane. {_engines(opened.tips)}"
    )
    return Drawing(figure, "The path of the elastic arm under imposed motion, and a corner of it", caption)


def _engines(tips: Mapping[str, Vector]) -> str:
    if len(tips) == 1:
        return "One engine."
    return f"{len(tips)} engines drawn over each other, dashes in turn: where all colours are seen, they agree."


def _corner(axes: Any, study: Reproduction, tip: Vector, t: Vector) -> None:
    """Labels, and a square so wide that the tip's way about the corner fills it."""
    corner, path = study.open_loop.corner, study.path
    half = 2.2e3 * float(np.max(about_corner(t, tip, path.corners, path.places, corner)))
    # into the quarter in which the two edges lie
    place = path.places[corner]
    ends = path.places[corner - 1] + path.places[min(corner + 1, len(path.places) - 1)]
    x, y = (0.4 * half * _sign(float(value)) for value in (ends - 2.0 * place)[:2])
    axes.set_xlim(-y - half, -y + half)
    axes.set_ylim(x - half, x + half)
    axes.set_aspect("equal")
    axes.set_xlabel("-y, from the corner [mm]")
    axes.set_ylabel("x, from the corner [mm]")
    axes.set_title(f"the corner at ({place[0]:.3f}, {place[1]:.3f}) m")


def _sign(value: float) -> float:
    return 0.0 if abs(value) < 1.0e-6 else math.copysign(1.0, value)


def _plane(tip: Vector, t: Vector, study: Reproduction) -> tuple[Vector, Vector]:
    """A tip about the corner that is shown, as seen from above [mm]: (-y, x), shapes (k,)."""
    corner = study.open_loop.corner
    when = study.path.corners[corner]
    shown = (t >= when - NEAR) & (t <= when + NEAR)
    off = 1e3 * (tip[shown] - study.path.places[corner])
    return -off[:, 1], off[:, 0]


def closed_loop_drawing(study: Reproduction) -> Drawing:
    """Figure 13: a corner of the path, closed loop, and the deviation across the edge that follows it."""
    closed, opened = study.closed_loop, study.open_loop
    t, first = closed.t, next(iter(closed.tips))
    corner, corners, places = opened.corner, study.path.corners, study.path.places
    edge = corner if corner + 1 < len(corners) else corner - 1
    on = (t >= corners[edge]) & (t <= corners[edge + 1])
    with styled():
        figure = new_figure(9.6, 4.6)
        near, beside = figure.subplots(1, 2)
        for number, tip in enumerate(closed.tips.values()):
            style = by_turns(number, len(closed.tips))
            near.plot(*_plane(tip, t, study), **style)
            beside.plot(t[on], 1e3 * across(tip[on], places[edge], places[edge + 1]), **style)
        name_turns(near, closed.tips)
        late = closed.memory_tips[first]
        near.plot(*_plane(late, t, study), **MEMORY)
        near.plot(*_plane(opened.tip, t, study), color="#999999", linewidth=1.2, label="open loop")
        beside.plot(t[on], 1e3 * across(late[on], places[edge], places[edge + 1]), **MEMORY)
        beside.plot(t[on], 1e3 * across(opened.tip[on], places[edge], places[edge + 1]), color="#999999", linewidth=1.2)
        near.plot(*_plane(closed.command, t, study), **COMMAND)
        beside.axhline(0.0, **{**COMMAND, "label": "_"})
        peaks = [peak for peak in closed.peaks[first] if peak.edge == edge]
        beside.plot(
            [p.t for p in peaks], [1e3 * p.height for p in peaks], "o", color="black", markersize=5, label="peaks"
        )
        _corner(near, study, closed.tip, t)
        beside.set_xlabel("t [s]")
        beside.set_title("tip off the edge after it, across [mm]")
        handles, labels = near.get_legend_handles_labels()
        more = beside.get_legend_handles_labels()
        handles, labels = [*handles, more[0][-1]], [*labels, more[1][-1]]
        figure.legend(handles, labels, loc="outside lower center", ncols=5)
    data, before = closed.to_json(), opened.to_json()
    caption = (
        f"Torque from the feedback on the joints' rotations. The tip's oscillation is "
        f"{1e3 * data['oscillation_m']:.2f} mm "
        f"rms, {1e3 * before['oscillation_m']:.2f} in the open loop. {_engines(closed.tips)} With feedback one step "
        f"of 1 ms "
        "old the same turns come earlier."
    )
    return Drawing(figure, "A corner of the path in the closed loop, and the oscillation after it", caption)


def memory_drawing(study: Reproduction) -> Drawing:
    """What the age of the feedback does: the path earlier, the peaks earlier still."""
    closed = study.closed_loop
    first = closed.memory[next(iter(closed.memory))]
    steps = [1e3 * late.late for late in closed.longer]
    with styled():
        figure = new_figure(9.6, 3.4)
        each, over = figure.subplots(1, 2)
        each.hist(1e3 * np.array(first.peaks), bins=24, color=COLOURS[0], alpha=0.85)
        each.axvline(1e3 * first.shift, color=COLOURS[1], linewidth=1.6, label="the whole path")
        each.axvline(0.0, color="#222222", linewidth=0.8)
        each.set_xlabel("earlier by [ms]")
        each.set_title("number of peaks, feedback 1 ms old")
        each.legend()
        over.plot(
            [0.0, max(steps)], [0.0, max(steps)], color="#222222", linewidth=0.9, linestyle=(0, (4, 2)), label="its age"
        )
        over.plot(steps, [1e3 * late.shift for late in closed.longer], "s-", color=COLOURS[1], label="the whole path")
        means = [1e3 * float(np.mean(late.peaks)) if late.peaks else np.nan for late in closed.longer]
        over.plot(steps, means, "o-", color=COLOURS[0], label="peaks, mean")
        over.set_xlabel("age of the feedback [ms]")
        over.set_title("earlier by [ms], over the age")
        over.legend()
    caption = (
        "A feedback that is old shows the arm where it was, and the controller drives it ahead by as much: the whole "
        "path is "
        "early by the feedback's age. The peaks are earlier still, as the age takes from the loop's inertia (kd late) "
        "and "
        "makes it quicker."
    )
    return Drawing(figure, "How much earlier path and peaks are with old feedback", caption)


def derivatives_drawing(study: Reproduction) -> Drawing:
    """Codes that are given rotations only: how far their tips are from where all three functions put them."""
    found = study.derivatives
    with styled():
        figure = new_figure(9.6, 3.6)
        axes = figure.subplots()
        for number, (name, away) in enumerate((name, away) for name, away in found.away.items() if away.any()):
            axes.plot(found.t, 1e6 * away, color=COLOURS[number], linewidth=1.4, label=WORDS[name])
        axes.plot(
            found.t,
            1e6 * found.codes,
            color="#222222",
            linewidth=0.9,
            label=f"between two codes: {found.who[0]} differentiates, {found.who[1]} takes differences",
        )
        axes.set_xlabel("t [s]")
        axes.set_title("distance of the tip from that with all three functions given [um]")
        axes.set_yscale("log")
        axes.set_ylim(bottom=1e-2)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    caption = (
        f"Elastic joints, imposed motion. Dark: the paper's situation, one code ({found.who[0]}) that differentiates "
        f"Akima's "
        f"spline beside one ({found.who[1]}) that takes differences over 1 ms. Most of it is there at the "
        "beginning, where a spline through rotations alone does not start from rest. With all three functions given, "
        "the "
        "engines are one line far below this picture."
    )
    return Drawing(figure, "Differences that come from differentiating the motion law", caption)
