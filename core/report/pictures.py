"""Pictures inside a page: Matplotlib to SVG, the same bytes for the same numbers."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

STYLE: dict[str, Any] = {
    "svg.hashsalt": "mbexport",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica Neue", "Arial", "DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": "#8a929c",
    "axes.labelcolor": "#39424e",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e9ed",
    "grid.linewidth": 0.8,
    "xtick.color": "#5b6470",
    "ytick.color": "#5b6470",
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
}

# told apart by people who do not see all colours (Okabe and Ito, 2008)
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c564b", "#444444")
# voices drawn over each other, wide below and narrow above, so that each can be seen where they agree
WIDTHS = (5.6, 3.6, 2.0, 0.8)
# voices that take turns along a line: its width [pt], and a turn in widths
TURN_WIDTH = 2.4
TURN = 3.0


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of a page.

    Attributes:
        source: Address of the picture with all of it inside (data:).
        alt: What is to be seen, for those who cannot.
        caption: Below it.
    """

    source: str
    alt: str
    caption: str


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A figure that has not been written yet, for pages and for files of its own.

    Attributes:
        figure: Of Matplotlib.
        alt: What is to be seen.
        caption: Below it.
    """

    figure: Any
    alt: str
    caption: str

    def svg(self) -> bytes:
        """As an SVG file."""
        stream = io.BytesIO()
        with styled():
            self.figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        return stream.getvalue()

    def png(self, dpi: float) -> bytes:
        """As a PNG file."""
        stream = io.BytesIO()
        with styled():
            self.figure.savefig(stream, format="png", dpi=dpi, metadata={"Software": None})
        return stream.getvalue()


def new_figure(width: float, height: float) -> Any:
    """An empty figure of that size [inch]."""
    with styled():
        return import_module("matplotlib.figure").Figure(figsize=(width, height), layout="constrained")


def styled() -> Any:
    """The style, as a context."""
    return import_module("matplotlib").rc_context(STYLE)


def picture(figure: Any, alt: str, caption: str) -> Picture:
    """A figure as part of a page."""
    return inside(Drawing(figure, alt, caption).svg(), alt, caption)


def inside(svg: bytes, alt: str, caption: str) -> Picture:
    """An SVG file as part of a page."""
    data = base64.b64encode(svg).decode("ascii")
    return Picture(f"data:image/svg+xml;base64,{data}", alt, caption)


def line_style(k: int) -> dict[str, Any]:
    """Colour and width of the k-th voice, from 0."""
    return {"color": COLOURS[k % len(COLOURS)], "linewidth": WIDTHS[min(k, len(WIDTHS) - 1)]}


def by_turns(k: int, count: int) -> dict[str, Any]:
    """Colour and dashes of the k-th of voices that are drawn over each other: where they agree, each is seen in turn.

    The first lies below all of the line, so that nothing is left out where another goes its own way.
    """
    style: dict[str, Any] = {"color": COLOURS[k % len(COLOURS)], "linewidth": TURN_WIDTH, "dash_capstyle": "butt"}
    if k:
        style["linestyle"] = ((count - k) * TURN, (TURN, (count - 1) * TURN))
    return style


def name_turns(axes: Any, names: Iterable[str]) -> None:
    """Legend of voices that take turns: whole lines, for of dashes it would show one or none."""
    for k, name in enumerate(names):
        axes.plot([], [], color=COLOURS[k % len(COLOURS)], linewidth=TURN_WIDTH, label=name)
