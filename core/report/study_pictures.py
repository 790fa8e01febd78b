"""The picture of a study: what the tip's error owes to which parameter, and how far it spreads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..study import Results
from ..study.figures import TIP
from ..study.sensitivity import level_means
from .pictures import COLOURS, Drawing, Picture, new_figure, picture, styled

MILLIMETRES = 1.0e3
MEANINGS = {"tip_rms": "root mean square", "tip_max": "maximum", "tip_end": "at the end"}
DPI = 110
_COLOUR: dict[str, str] = dict(zip(TIP, COLOURS, strict=False))
_INDEX_LABELS = {
    "total": "share of the error's variance: alone (mark), in all (bar)",
    "first": "share of the error's variance that it explains alone",
    "mean_effect": "mean change of the error over its whole range [mm]",
}
_BINS = 30
# points a picture is drawn with
_POINTS = 2000


def study_picture(results: Results) -> Picture:
    """The picture as part of a page."""
    drawing = _drawing(results)
    return picture(drawing.figure, drawing.alt, drawing.caption)


def study_png(results: Results) -> bytes:
    """The picture as a PNG file; the same bytes for the same results and libraries."""
    return _drawing(results).png(DPI)


def short_names(names: Sequence[str]) -> tuple[list[str], str]:
    """Names for labels, and what they share: where only the places differ, the places."""
    columns = {name.partition("@")[0] for name in names}
    if len(names) > 1 and len(columns) == 1:
        return [name.partition("@")[2] for name in names], columns.pop()
    return list(names), ""


def _drawing(results: Results) -> Drawing:
    rows = len(results.study.design.free)
    with styled():
        figure = new_figure(10.5, max(4.4, 1.9 + 0.46 * rows))
        grid = figure.add_gridspec(2, 2, width_ratios=(6, 5))
        _draw_indices(figure.add_subplot(grid[:, 0]), results)
        _draw_strongest(figure.add_subplot(grid[0, 1]), results)
        _draw_spread(figure.add_subplot(grid[1, 1]), results)
    caption = (
        "Left: what each parameter contributes; whiskers are intervals of 95 %. Above: the error over the parameter it "
        "owes most to, a point a variant. Below: how the error is spread over the variants."
    )
    return Drawing(figure, "Sensitivity of the tip's error, and its spread", caption)


def _draw_indices(axes: Any, results: Results) -> None:
    plan = results.study.design
    names = [plan.parameters[i].name for i in plan.free]
    labels, shared = short_names(names)
    known = [one for one in results.sensitivities if one.ranking]
    axes.set_title("What the tip's error owes to " + (shared or "each parameter"))
    axes.set_yticks(range(len(names)), labels)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    if not known:
        axes.text(0.5, 0.5, results.sensitivities[0].note, ha="center", va="center", transform=axes.transAxes)
        return
    height = 0.8 / len(known)
    for number, one in enumerate(known):
        unit = MILLIMETRES if one.ranking == "mean_effect" else 1.0
        at = np.arange(len(names)) - 0.4 + (number + 0.5) * height
        width = one.values.get(f"{one.ranking}_ci")
        axes.barh(
            at,
            unit * np.array(one.values[one.ranking]),
            0.92 * height,
            xerr=None if width is None else unit * np.array(width),
            color=_COLOUR[one.figure],
            alpha=0.8,
            error_kw={"elinewidth": 0.9, "ecolor": "#333333"},
        )
        if one.ranking == "total":
            axes.plot(np.array(one.values["first"]), at, "|", color="black", markersize=7)
        axes.plot([], [], "s", color=_COLOUR[one.figure], label=MEANINGS[one.figure])
    axes.axvline(0.0, color="#333333", linewidth=0.8)
    axes.set_xlabel(_INDEX_LABELS[known[0].ranking])
    # bars may be anywhere within
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=len(known))


def _draw_strongest(axes: Any, results: Results) -> None:
    plan, y = results.study.design, results.figures["tip_rms"]
    names = [parameter.name for parameter in plan.parameters]
    i = names.index(results.strongest())
    parameter = plan.parameters[i]
    ran = np.flatnonzero(np.isfinite(y))
    shown = ran[:: 1 + len(ran) // _POINTS]
    axes.plot(plan.values[shown, i], MILLIMETRES * y[shown], ".", color=COLOURS[0], alpha=0.5, markersize=4)
    if plan.sampling == "grid" and len(ran):
        levels, means = level_means(plan, i, y)
        axes.plot(levels, MILLIMETRES * means, color=COLOURS[1], linewidth=1.5, label="mean of each level")
    nominal = results.nominal_figures()
    if nominal and parameter.factors:
        stands = MILLIMETRES * nominal["tip_rms"]
        axes.plot([parameter.scale], [stands], "k*", markersize=9, label="as the database stands")
    if axes.get_legend_handles_labels()[0]:
        axes.legend()
    axes.set_xlabel(f"{parameter.name} [{parameter.unit or '1'}]")
    axes.set_title("tip's error, root mean square [mm]")


def _draw_spread(axes: Any, results: Results) -> None:
    values = {name: MILLIMETRES * results.figures[name] for name in TIP}
    values = {name: data[np.isfinite(data)] for name, data in values.items()}
    everything = np.concatenate(list(values.values()))
    axes.set_title("variants over the tip's error [mm]")
    if len(everything) == 0:
        axes.text(0.5, 0.5, "no variant ran", ha="center", va="center", transform=axes.transAxes)
        return
    low, high = float(everything.min()), float(everything.max())
    bins = np.linspace(low, high if high > low else low + 1.0, _BINS + 1)
    nominal = results.nominal_figures()
    for name, data in values.items():
        axes.hist(data, bins, histtype="step", color=_COLOUR[name], linewidth=1.5, label=MEANINGS[name])
        if nominal:
            axes.axvline(MILLIMETRES * nominal[name], color=_COLOUR[name], linestyle=":", linewidth=1.2)
    if nominal:
        axes.plot([], [], ":", color="#444444", label="as the database stands")
    axes.legend()
