"""The picture of the demo: the tip's path rigid and elastic, a corner of it, and how far apart the engines are."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from ..simulation import Trace, backend_named
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
# what is shown of the corner: from where to where to the right of it and above it [m]
RIGHT = (-0.004, 0.012)
ABOVE = (-0.010, 0.006)
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


def of_high_order(runs: Mapping[str, Trace]) -> dict[str, Trace]:
    """The runs of engines that integrate to second order or better."""
    return {name: trace for name, trace in runs.items() if backend_named(name).gate_class == "A"}


def draw(runs: Runs) -> bytes:
    """The picture as PNG; the same bytes for the same runs and libraries."""
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(10.0, 7.0), dpi=DPI, layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.1, 1.15))
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
    (left, right), (low, high) = RIGHT, ABOVE
    axes.plot(
        [y + left, y + right, y + right, y + left, y + left],
        [x + low, x + low, x + high, x + high, x + low],
        color="black",
        linewidth=0.8,
    )
    axes.set_aspect("equal")
    axes.set_title("tip of the built-in arm along the Greek key, seen from above", fontsize=10)
    _label(axes, "-y [m]", "x [m]")
    figure.legend(fontsize=9, loc="outside lower center", ncols=3, frameon=False)


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
    axes.set_xlim(1e3 * np.array(RIGHT))
    axes.set_ylim(1e3 * np.array(ABOVE))
    axes.set_aspect("equal")
    axes.set_title(f"the corner, {len(next(iter(runs.values())))} engines over each other", fontsize=10)
    _label(axes, "[mm]", "[mm]")
    axes.grid(alpha=0.3)


def _distances(figure: Any, runs: Runs) -> None:
    """How far the tip leaves the rigid path, and how far apart the engines are."""
    axes = figure.subplots()
    rigid = next(iter(runs["rigid"].values()))
    styles = {"from the rigid path": "-", "between any two engines": ":", "without first-order ones": "--"}
    for kind, engines in runs.items():
        if kind == "rigid":
            continue
        first = next(iter(engines.values()))
        lines = [np.linalg.norm(first.tip - rigid.tip, axis=1), worst_apart(engines)[0]]
        if len(of_high_order(engines)) < len(engines):
            lines.append(worst_apart(of_high_order(engines))[0])
        for distance, style in zip(lines, styles.values(), strict=False):
            if distance.any():
                shown = {"color": COLOURS[kind], "linewidth": 1.2, "linestyle": style}
                axes.semilogy(first.t, np.maximum(distance, FLOOR), **shown)
    for name, style in styles.items():
        axes.plot([], [], color="#333333", linewidth=1.2, linestyle=style, label=name)
    axes.set_title("how far the tips are apart", fontsize=10)
    _label(axes, "t [s]", "[m]")
    axes.grid(alpha=0.3)
    figure.legend(fontsize=8, loc="outside lower center", ncols=3, frameon=False)


def _label(axes: Any, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.tick_params(labelsize=8)
