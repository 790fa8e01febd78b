"""What the page says of the tip's error, as HTML."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import NDArray

from .session import View

Array = NDArray[np.float64]

_BLUE, _ORANGE, _GREY, _RED = "#0072b2", "#d55e00", "#6b7480", "#b3261e"
_STYLE = (
    "font: 13px/1.45 system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif; "
    "padding: 2px 10px 4px; font-variant-numeric: tabular-nums"
)


def readout(view: View, motion: str, factor: float) -> str:
    """The tip's error where the robot stands, and along the motion."""
    where = "at rest" if view.time is None or view.paths is None else f"at {view.time:.2f} s"
    lines = [
        _line(f"Tip's error, {where}", _millimetres(view.posture.error)),
        _along(view, motion),
        f"<div style='margin-top:4px'>{_key(_BLUE, 'without effects')} &nbsp; "
        f"{_key(_ORANGE, f'as it runs, its error drawn {_times(factor)}')}</div>",
    ]
    if view.problem:
        lines.append(f"<div id='problem' style='color:{_RED}; margin-top:4px'>{escape(view.problem)}</div>")
    return f"<div id='readout' style=\"{_STYLE}\">{''.join(lines)}</div>"


def _along(view: View, motion: str) -> str:
    title = f"Along {escape(motion)}"
    if view.running:
        return _line(title, f"<span style='color:{_GREY}'>running …</span>")
    if view.paths is None:
        return _line(title, f"<span style='color:{_GREY}'>no run</span>")
    distance = 1.0e3 * view.paths.distance
    largest, rms = float(distance.max()), float(np.sqrt(np.mean(distance**2)))
    return _line(title, f"<b>{_number(largest)} mm</b> at most, {_number(rms)} mm rms")


def changes(view: View) -> str:
    """The numbers that were changed, as a table."""
    from .knobs import shown_unit

    bench = view.bench
    if not bench.values:
        return f'<div style="{_STYLE}; color:{_GREY}">All numbers are the database\'s.</div>'
    rows: list[str] = []
    for place, value in bench.values.items():
        unit, scale = shown_unit(place.unit(bench.original))
        before = f"{bench.nominal(place) / scale:.6g}"
        rows.append(
            f"<tr><td>{escape(place.name)}</td><td style='text-align:right; padding:0 8px'>{before}</td>"
            f"<td style='text-align:right'><b>{value / scale:.6g}</b></td>"
            f"<td style='padding-left:4px; color:{_GREY}'>{escape(unit)}</td></tr>"
        )
    return f"<div style=\"{_STYLE}; font-size:12px\">Changed:<table id='changes'>{''.join(rows)}</table></div>"


def _line(title: str, value: str) -> str:
    return f"<div><span style='color:{_GREY}'>{title}:</span> {value}</div>"


def _millimetres(error: Array) -> str:
    x, y, z = 1.0e3 * error
    length = float(np.linalg.norm(1.0e3 * error))
    return (
        f"<b id='error'>{_number(length)} mm</b> "
        f"<span style='color:{_GREY}'>x {_signed(x)} y {_signed(y)} z {_signed(z)}</span>"
    )


def _number(value: float) -> str:
    return f"{value:.3f}" if abs(value) < 100.0 else f"{value:.1f}"


def _signed(value: float) -> str:
    # what rounds to nothing has no sign
    return f"{value:+.2f}" if abs(value) >= 0.005 else "0"


def _times(factor: float) -> str:
    return "as it is" if factor == 1.0 else f"{factor:g} times larger"


def _key(colour: str, text: str) -> str:
    dash = f"display:inline-block; width:16px; height:3px; background:{colour}; vertical-align:middle; margin-right:5px"
    return f"<span style='white-space:nowrap'><span style='{dash}'></span>{text}</span>"
