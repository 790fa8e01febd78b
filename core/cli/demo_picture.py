"""The picture of the demo: the tip's path rigid and elastic, a corner of it, and how far apart the engines are."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from ..simulation import Trace
from ..simulation.backend import Vector

Runs = Mapping[str, Mapping[str, Trace]]
"""Kind of run -> backend -> its trace; all traces at the same times."""

COLOURS = {"rigid": "#555555", "compliant": "#c8312b", "closed_loop": "#2456b8"}
NAMES = {
    "rigid": "rigid joints, imposed motion",
    "compliant": "compliant joints, imposed motion",
    "closed_loop": "compliant joints, closed loop",
}
# engines drawn over each other: wide below, narrow above, so that each can be seen where they agree
WIDTHS = (7.0, 4.6, 2.6, 1.0)
FADE = (0.18, 0.3, 0.5, 1.0)
DPI = 110
# half of the zoom's side [m], around the corner
ZOOM = 0.008
# what agrees to all digits has no place on a logarithmic axis [m]
FLOOR = 1.0e-17


def worst_apart(runs: Mapping[str, Trace]) -> tuple[Vector, str]:
    """Largest distance between the tips of any two engines at each time [m], shape (m,), and the worst pair."""
    times = len(next(iter(runs.values())).t)
    largest, pair, peak = np.zeros(times), "", -1.0
    for (one, a), (other, b) in combinations(runs.items(), 2):
        apart = np.linalg.norm(a.tip - b.tip, axis=1)
        if float(apart.max()) > peak:
            peak, pair = float(apart.max()), f"{one} and {other}"
        largest = np.maximum(largest, apart)
    return largest, pair


def draw(runs: Runs) -> bytes:
    """The picture as PNG; the same bytes for the same runs and libraries."""
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(10.0, 7.0), dpi=DPI, layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.0, 1.15))
    _path(top, runs)
    left, right = bottom.subfigures(1, 2, width_ratios=(1.0, 1.25))
    _corner(left, runs)
    _distances(right, runs)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def _path(figure: Any, runs: Runs) -> None:
    axes = figure.subplots()
    for kind, engines in runs.items():
        tip = next(iter(engines.values())).tip
        axes.plot(-tip[:, 1], tip[:, 0], color=COLOURS[kind], linewidth=1.3, label=NAMES[kind])
    x, y = corner(runs)
    axes.plot(
        [y - ZOOM, y + ZOOM, y + ZOOM, y - ZOOM, y - ZOOM],
        [x - ZOOM, x - ZOOM, x + ZOOM, x + ZOOM, x - ZOOM],
        color="black",
        linewidth=0.8,
    )
    axes.set_aspect("equal")
    axes.set_title("tip of the built-in arm along the Greek key, seen from above", fontsize=10)
    _label(axes, "-y [m]", "x [m]")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def corner(runs: Runs) -> tuple[float, float]:
    """The corner that is shown larger: x and -y of the rigid path's corner farthest from the middle [m]."""
    tip = next(iter(runs["rigid"].values())).tip
    x, y = tip[:, 0], -tip[:, 1]
    k = int(np.argmax((x - x.mean()) * (x.max() - x.min()) - (y - y.mean()) * 0.1))
    return float(x[k]), float(y[k])


def _corner(figure: Any, runs: Runs) -> None:
    """All paths about a corner, in millimetres from it."""
    axes = figure.subplots()
    x, y = corner(runs)
    for kind, engines in runs.items():
        # rigid paths are the command, the same in all engines
        traces = list(engines.values())[: 1 if kind == "rigid" else len(WIDTHS)]
        for k, trace in enumerate(traces):
            style = {"linewidth": 1.2} if kind == "rigid" else {"linewidth": WIDTHS[k], "alpha": FADE[k]}
            axes.plot(1e3 * (-trace.tip[:, 1] - y), 1e3 * (trace.tip[:, 0] - x), color=COLOURS[kind], **style)
    side = 1e3 * ZOOM
    axes.set_xlim(-side, side)
    axes.set_ylim(-side, side)
    axes.set_aspect("equal")
    axes.set_title(f"the corner, {len(next(iter(runs.values())))} engines over each other", fontsize=10)
    _label(axes, "[mm]", "[mm]")
    axes.grid(alpha=0.3)


def _distances(figure: Any, runs: Runs) -> None:
    axes = figure.subplots()
    rigid = next(iter(runs["rigid"].values()))
    for kind, engines in runs.items():
        if kind == "rigid":
            continue
        first = next(iter(engines.values()))
        colour = COLOURS[kind]
        axes.semilogy(
            first.t, np.linalg.norm(first.tip - rigid.tip, axis=1), color=colour, linewidth=1.3, label=NAMES[kind]
        )
        if len(engines) > 1:
            apart, _ = worst_apart(engines)
            axes.semilogy(first.t, np.maximum(apart, FLOOR), color=colour, linewidth=1.0, linestyle=":")
    axes.set_title("from the rigid path (solid), between any two engines (dotted)", fontsize=10)
    _label(axes, "t [s]", "distance of the tips [m]")
    axes.grid(alpha=0.3)


def _label(axes: Any, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.tick_params(labelsize=8)
