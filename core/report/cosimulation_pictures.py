"""The picture of a co-simulation: the tip's error over the communication step, and how early the tip is."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from ..cosimulation import CouplingStudy
from ..cosimulation.study import kind_named
from .pictures import COLOURS, Picture, new_figure, picture, styled

MILLIMETRES = 1.0e3
MILLISECONDS = 1.0e3
DPI = 110
# half of what is shown of the run [s]
WINDOW = 0.08
_MARKS = ("o", "s", "^")


def cosimulation_picture(study: CouplingStudy) -> Picture:
    """The picture as part of a page."""
    caption = (
        "Left: the largest distance of the tip from where the loop itself has it, over the communication step; grey "
        "lines fall by the order that theory expects. Right: how much earlier the tip is on its path. Below: the "
        "tip's distance from where its command has it, where that is largest. Couplings that are unstable are not "
        "drawn."
    )
    return picture(_figure(study), "The tip's error over the communication step", caption)


def cosimulation_svg(study: CouplingStudy) -> bytes:
    """The picture as an SVG file; the same bytes for the same results and libraries."""
    return _file(study, "svg", metadata={"Date": None, "Creator": None})


def cosimulation_png(study: CouplingStudy) -> bytes:
    """The picture as a PNG file; the same bytes for the same results and libraries."""
    return _file(study, "png", dpi=DPI, metadata={"Software": None})


def _file(study: CouplingStudy, kind: str, **options: Any) -> bytes:
    out = io.BytesIO()
    with styled():
        _figure(study).savefig(out, format=kind, **options)
    return out.getvalue()


def _figure(study: CouplingStudy) -> Any:
    with styled():
        figure = new_figure(10.5, 7.4)
        grid = figure.add_gridspec(2, 2, width_ratios=(6, 5), height_ratios=(5, 4))
        errors = figure.add_subplot(grid[0, 0])
        _draw_errors(errors, study)
        _draw_early(figure.add_subplot(grid[0, 1]), study)
        _draw_deviation(figure.add_subplot(grid[1, :]), study)
        handles, labels = errors.get_legend_handles_labels()
        if handles:
            figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _style(order: int, memory: bool) -> dict[str, Any]:
    return {
        "color": COLOURS[order],
        "marker": _MARKS[order],
        "linestyle": "--" if memory else "-",
        "markerfacecolor": "white" if memory else COLOURS[order],
        "linewidth": 1.5,
        "markersize": 5,
        "label": kind_named(order, memory),
    }


def _draw_errors(axes: Any, study: CouplingStudy) -> None:
    slopes: list[Any] = []
    for order, memory in study.kinds():
        curve = study.curve(order, memory)
        if not curve:
            continue
        steps = np.array([MILLISECONDS * one.interval for one in curve])
        values = np.array([MILLIMETRES * one.largest for one in curve])
        if not memory:
            slope = values[0] * (steps / steps[0]) ** (order + 1)
            # named once
            label = "_" if slopes else "order of theory: 1, 2, 3"
            slopes += axes.plot(steps, slope, color="#b8bec6", linewidth=4.0, zorder=1, label=label)
        axes.plot(steps, values, **_style(order, memory))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_title("largest error of the tip [mm]")
    _name_steps(axes, study)
    if not axes.get_lines():
        axes.text(0.5, 0.5, "no coupling is stable", ha="center", va="center", transform=axes.transAxes)


def _draw_early(axes: Any, study: CouplingStudy) -> None:
    for order, memory in study.kinds():
        curve = study.curve(order, memory)
        steps = [MILLISECONDS * one.interval for one in curve]
        axes.plot(steps, [MILLISECONDS * one.earlier for one in curve], **_style(order, memory))
    longest = MILLISECONDS * max(one.interval for one in study.measured)
    axes.plot([0.0, longest], [0.0, longest], color="#b8bec6", linewidth=1.0, zorder=1, label="one communication step")
    axes.set_title("how much earlier the tip is on its path [ms]")
    axes.set_xlabel("communication step [ms]")
    axes.legend(handles=axes.get_lines()[-1:])


def _draw_deviation(axes: Any, study: CouplingStudy) -> None:
    reference = study.reference
    deviation = np.linalg.norm(reference.tip - reference.commanded, axis=1)
    middle = float(reference.t[int(np.argmax(deviation))])
    drawn = [run for run in study.runs if run.coupling.order == min(one.order for one in study.measured)]
    axes.plot(reference.t, MILLIMETRES * deviation, color="black", linewidth=3.0, alpha=0.3, label=reference.in_words())
    for run in drawn:
        order, memory = run.coupling.order, run.coupling.memory
        every = round(run.coupling.interval / float(reference.t[1]))
        wanted = reference.commanded[::every][: len(run.t)]
        label = f"{kind_named(order, memory)}, {MILLISECONDS * run.coupling.interval:.4g} ms"
        style = {**_style(order, memory), "color": COLOURS[3 if memory else order], "label": label, "markersize": 3}
        axes.plot(run.t, MILLIMETRES * np.linalg.norm(run.tip - wanted, axis=1), **style)
    axes.set_xlim(max(0.0, middle - WINDOW), min(float(reference.t[-1]), middle + WINDOW))
    axes.set_title("deviation of the tip from its command [mm]")
    axes.set_xlabel("t [s]")
    axes.legend()


def _name_steps(axes: Any, study: CouplingStudy) -> None:
    steps = sorted({MILLISECONDS * one.interval for one in study.measured})
    axes.set_xticks(steps, [f"{step:.4g}" for step in steps])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("communication step [ms]")
