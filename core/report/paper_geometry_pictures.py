"""Pictures of the paper's geometry: figures 3, 4 and 11, and the beta sweep."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np

from ..reproduction import Reproduction
from ..simulation.backend import Vector
from .pictures import COLOURS, Drawing, new_figure, styled

# as in the paper: x red, y green, z (the axis of motion) blue
AXES = ("#c8312b", "#2f8f3a", "#2456b8")
VIEW = {"elev": 18, "azim": -60}
GROUND = "#cccccc"
# so that a name can be read before a line
HALO = {"linewidth": 3.0, "foreground": "white"}
TRIAD = 0.11
"""Length of a frame's axes [m]."""


def frames_drawing(study: Reproduction) -> Drawing:
    """Figures 3 and 4: the frames of the joints without and with the geometry corrections."""
    frames = study.frames
    everything = np.concatenate([frames.chain, frames.real])[:, :3, 3]
    with styled():
        figure = new_figure(9.6, 4.5)
        panels = (
            (frames.chain, "figure 3: Veitschegger-Wu alone"),
            (frames.real, "figure 4: with geometry corrections"),
        )
        both: list[Any] = [figure.add_subplot(1, 2, number, projection="3d") for number in (1, 2)]
        for axes, (shown, title) in zip(both, panels, strict=True):
            axes.set_title(title)
            _room(axes, everything)
            _line(axes, shown[:, :3, 3], color="black", linewidth=2.2)
            for frame in shown:
                _triad(axes, frame)
            _name(axes, shown[:, :3, 3])
        for name, colour in zip(("x", "y", "z, the joint's axis"), AXES, strict=True):
            both[0].plot([], [], color=colour, linewidth=2.0, label=name)
        both[0].plot([], [], color="black", linewidth=2.2, label="arms")
        both[0].plot([], [], "s", color="white", markeredgecolor=GROUND, markersize=9, label="0.1 m by 0.1 m")
        figure.legend(loc="outside lower center", ncols=5)
    moved = np.flatnonzero(frames.shifts > 0.0) + 1
    caption = (
        "The arm in its zero state; frame k is that of joint k, the last one the flange. By the convention alone the "
        "fourth frame, the wrist's first, falls together with the third in the elbow. With the corrections every "
        "joint is "
        f"where it is built: {', '.join(f'{k} by {1e3 * frames.shifts[k - 1]:.0f} mm' for k in moved)}."
    )
    return Drawing(figure, "Frames of the arm's joints, without and with geometry corrections", caption)


def _room(axes: Any, points: Vector) -> None:
    """Equal scales about the points, with a grid of decimetres on the ground."""
    low, high = points.min(axis=0) - 0.13, points.max(axis=0) + 0.13
    low[2] = 0.0
    low[1], high[1] = -0.25, 0.25
    x, y = (_decimetres(float(a), float(b)) for a, b in zip(low[:2], high[:2], strict=True))
    for value in x:
        _line(axes, np.array([[value, y[0], 0.0], [value, y[-1], 0.0]]), color=GROUND, linewidth=0.7)
    for value in y:
        _line(axes, np.array([[x[0], value, 0.0], [x[-1], value, 0.0]]), color=GROUND, linewidth=0.7)
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(a, b)
    axes.set_box_aspect(tuple(high - low), zoom=1.25)
    axes.view_init(**VIEW)
    axes.set_axis_off()


def _decimetres(low: float, high: float) -> list[float]:
    """Multiples of 0.1 m from below a place to above another."""
    return [k / 10 for k in range(math.floor(10 * low), math.ceil(10 * high) + 1)]


def _triad(axes: Any, frame: Vector) -> None:
    for column, colour in enumerate(AXES):
        ends = np.array([frame[:3, 3], frame[:3, 3] + TRIAD * frame[:3, column]])
        _line(axes, ends, color=colour, linewidth=2.0, zorder=10)


def _line(axes: Any, points: Vector, **style: Any) -> None:
    axes.plot(*points.T, **style)


def _name(axes: Any, points: Vector) -> None:
    """Numbers of the frames; those that fall together stand side by side."""
    halo = [import_module("matplotlib.patheffects").withStroke(**HALO)]
    places: dict[tuple[float, float, float], list[str]] = {}
    for number, point in enumerate(points, start=1):
        name = "flange" if number == len(points) else str(number)
        x, y, z = (round(float(value), 6) for value in point)
        places.setdefault((x, y, z), []).append(name)
    for (x, y, z), names in places.items():
        # the flange is close behind the last joint
        right, up = (0.14, 0.07) if "flange" in names else (-0.06, -0.1)
        style = {"fontsize": 10, "fontweight": "bold", "ha": "center", "zorder": 20, "path_effects": halo}
        axes.text(x + right, y, z + up, ", ".join(names), **style)


def path_drawing(study: Reproduction) -> Drawing:
    """Figure 11: the Greek key in space, and the joints' motion laws."""
    path = study.path
    with styled():
        figure = new_figure(9.6, 3.9)
        space: Any = figure.add_subplot(1, 2, 1, projection="3d")
        _line(space, 1e3 * path.tip, color=COLOURS[0], linewidth=1.6)
        begin, end = 1e3 * path.tip[0], 1e3 * path.tip[-1]
        space.plot(*begin[:, None], "o", color=COLOURS[2], markersize=5, label="begin")
        space.plot(*end[:, None], "s", color=COLOURS[1], markersize=5, label="end")
        space_labels(space, 1e3 * path.tip, flat=60.0)
        space.legend(loc="upper right", ncols=2)
        space.set_title("desired trajectory")
        laws = figure.add_subplot(1, 2, 2)
        for joint in range(path.q.shape[1]):
            turned = np.degrees(path.q[:, joint] - path.q[0, joint])
            style = "--" if joint == path.q.shape[1] - 1 else "-"
            laws.plot(path.t, turned, style, color=COLOURS[joint], linewidth=1.4, label=f"joint {joint + 1}")
        laws.set_xlabel("t [s]")
        laws.set_title("motion laws, from where they begin [deg]")
        figure.legend(*laws.get_legend_handles_labels(), loc="outside lower right", ncols=6)
    caption = (
        "Rigid joints, imposed motion. The tool looks down and keeps its orientation, so joint 4 stands still and "
        "joint 6 "
        "turns as joint 1 does. The paper gives the path as a drawing only; size, place and speed are ours."
    )
    return Drawing(figure, "The Greek key in space and the joints' rotations over time", caption)


def space_labels(axes: Any, points: Vector, flat: float) -> None:
    """A box about points of a nearly level path [mm], at least so high [mm]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low[2] + high[2])
    low[2], high[2] = min(low[2], middle - flat / 2), max(high[2], middle + flat / 2)
    for name, a, b in zip("xyz", low, high, strict=True):
        room = 0.03 * (b - a)
        getattr(axes, f"set_{name}lim")(a - room, b + room)
        getattr(axes, f"set_{name}label")(f"{name} [mm]", labelpad=-2 if name == "z" else 4)
    axes.tick_params(labelsize=8, pad=0)
    axes.locator_params(axis="x", nbins=4)
    axes.locator_params(axis="z", nbins=3)
    axes.view_init(elev=32, azim=-58)
    axes.set_box_aspect((1.0, 1.9, 0.55), zoom=1.2)


def misalignment_drawing(study: Reproduction) -> Drawing:
    """The beta sweep: tip against angle, and along the path."""
    found = study.misalignment
    degrees = np.degrees(found.angles)
    along = 1e3 * np.linalg.norm(found.per_degree, axis=2)
    with styled():
        figure = new_figure(9.6, 3.6)
        swept, walked = figure.subplots(1, 2)
        for arm in range(len(found.largest)):
            style = {"color": COLOURS[arm], "linewidth": 1.6, "label": f"arm {arm + 1}"}
            swept.plot(degrees, 1e3 * found.largest[arm], marker="o", markersize=3.5, **style)
            walked.plot(found.t, along[arm], **style)
        swept.set_xlabel("beta [deg]")
        swept.set_title("tip's shift, at most along the path [mm]")
        walked.set_xlabel("t [s]")
        walked.set_title("tip's shift along the path for 1 deg [mm]")
        figure.legend(*swept.get_legend_handles_labels(), loc="outside lower center", ncols=6)
    caption = (
        "Rigid joints, one arm misaligned at a time. Small errors add up linearly: the sweep's widest angle is within "
        f"{1e3 * found.linear:.2f} mm of the Jacobian's line. Arm 6 turns the tool about its own tip and shifts "
        f"nothing."
    )
    return Drawing(figure, "The tip's shift over the misalignment of each joint's axis", caption)
