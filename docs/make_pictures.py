"""Draws the pictures of the documentation from the code.

    python docs/make_pictures.py

Frames are those of the built-in arm as the representation has them, not drawn by hand.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.kinematics import kinematics

PICTURES = Path(__file__).resolve().parent / "pictures"
AXES = (("x", "#c8312b"), ("y", "#2f8f3a"), ("z", "#2456b8"))
DPI = 110

# a posture in which no two frames hide each other [deg], and from where it is seen
POSTURE = (15.0, -20.0, 20.0, 25.0, 55.0, 0.0)
VIEW = {"elev": 20, "azim": -48}

# where names stand beside their frames [points]
ARM_NAMES = {"arm 1": (12, -14), "arm 2": (-42, 2), "arm 3": (8, -18), "arm 4": (-40, -16), "arm 5": (2, -34)}
JOINT_NAMES = {
    "joint 1": (14, -22),
    "joint 2": (-50, 6),
    "joint 3": (-50, -4),
    "joint 4": (-10, 34),
    "joint 5": (-4, -40),
    "joint 6": (-2, 38),
}

Array = NDArray[np.float64]


def new_figure(width: float, height: float) -> Any:
    """A figure without a screen; the same bytes for the same libraries."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def save(figure: Any, path: Path) -> None:
    """Write a picture without a date in it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Software": None})


def triad(axes: Any, frame: Array, size: float) -> None:
    """A frame (4, 4) as three coloured axes."""
    origin = frame[:3, 3]
    for column, (_, colour) in enumerate(AXES):
        line(axes, [origin, origin + size * frame[:3, column]], color=colour, linewidth=2.0, zorder=10)


def line(axes: Any, points: list[Array], **style: Any) -> None:
    """A line through points (3,)."""
    axes.plot(*np.array(points).T, **style)


def name_at(axes: Any, point: Array, name: str, shift: tuple[int, int]) -> None:
    """A name beside a point (3,), shifted by some points on the page."""
    from mpl_toolkits.mplot3d import proj3d

    x, y, _ = proj3d.proj_transform(*point, axes.get_proj())
    axes.annotate(name, (x, y), xytext=shift, textcoords="offset points", fontsize=9, zorder=20)


def frames(path: Path) -> None:
    """The frames of the paper's arm: the Veitschegger-Wu chain, and the joints at their real places."""
    robot = build(load("imece2013"), "rigid")
    chain = kinematics(robot)
    q = np.radians(POSTURE)
    base, joints, arms, tool = np.eye(4), chain.joints_in_base(q), chain.arms_in_base(q), chain.tool_in_base(q)
    figure = new_figure(10.5, 5.2)
    chained = [base[:3, 3], *(arm[:3, 3] for arm in arms)]
    real = [base[:3, 3], *(joint[:3, 3] for joint in joints), tool[:3, 3]]
    axes: Any = figure.add_subplot(1, 2, 1, projection="3d")
    axes.set_title("arm frames: the Veitschegger-Wu chain", fontsize=11, y=0.98)
    _ground(axes, np.array([*chained, *real]))
    line(axes, chained, color="#888888", linewidth=6.0, alpha=0.5, solid_capstyle="round")
    for arm in arms:
        triad(axes, arm, 0.15)
    for i, arm in enumerate(arms[:-1], 1):
        name_at(axes, arm[:3, 3], f"arm {i}", ARM_NAMES[f"arm {i}"])
    name_at(axes, tool[:3, 3], "arm 6 = tool", (16, -8))
    _base(axes, base)
    axes = figure.add_subplot(1, 2, 2, projection="3d")
    axes.set_title("joint frames: the real places, corrections included", fontsize=11, y=0.98)
    _ground(axes, np.array([*chained, *real]))
    line(axes, chained, color="#888888", linewidth=1.2, linestyle=":")
    line(axes, real, color="#d87a28", linewidth=6.0, alpha=0.5, solid_capstyle="round")
    for i, joint in enumerate(joints, 1):
        triad(axes, joint, 0.15)
        name_at(axes, joint[:3, 3], f"joint {i}", JOINT_NAMES[f"joint {i}"])
    # the frame from which the next joint is shifted
    for arm, joint in zip(arms, joints[1:], strict=False):
        line(axes, [arm[:3, 3], joint[:3, 3]], color="#7b3fa0", linewidth=2.0, linestyle="--", zorder=15)
    triad(axes, tool, 0.1)
    name_at(axes, tool[:3, 3], "tool", (16, -4))
    _base(axes, base)
    figure.legend(handles=_legend(), loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    save(figure, path)


def _base(axes: Any, base: Array) -> None:
    triad(axes, base, 0.2)
    name_at(axes, base[:3, 3], "base (= world)", (-66, -24))


def _legend() -> list[Any]:
    from matplotlib.lines import Line2D

    correction = Line2D([], [], color="#7b3fa0", linewidth=2.0, linestyle="--", label="geometry correction")
    return [*(Line2D([], [], color=colour, linewidth=2.0, label=name) for name, colour in AXES), correction]


def _ground(axes: Any, points: Array) -> None:
    """Equal scales about the points, with a grid of decimetres below them."""
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.12
    low[2] = -0.02
    x, y = (np.arange(np.floor(10 * a), np.ceil(10 * b) + 1) / 10 for a, b in zip(low[:2], high[:2], strict=True))
    for value in x:
        line(axes, [np.array([value, y[0], 0.0]), np.array([value, y[-1], 0.0])], color="#dddddd", linewidth=0.7)
    for value in y:
        line(axes, [np.array([x[0], value, 0.0]), np.array([x[-1], value, 0.0])], color="#dddddd", linewidth=0.7)
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{name}lim")(a, b)
    axes.set_box_aspect(tuple(high - low), zoom=1.12)
    axes.view_init(**VIEW)
    axes.set_axis_off()


def drive(path: Path) -> None:
    """One stage: command, motor side, elastic connection, arm side, and what is measured where."""
    figure = new_figure(9.0, 3.3)
    axes: Any = figure.add_subplot()
    axes.set_xlim(0, 18)
    axes.set_ylim(0, 6.4)
    axes.set_aspect("equal")
    axes.axis("off")
    y = 3.2
    _block(axes, 2.0, y, 2.7, 1.7, "controller\nlimit, delay,\ntorque limit")
    _block(axes, 6.9, y, 2.5, 1.7, "motor side\n$J$, friction", "#e6edf7")
    _block(axes, 15.6, y, 2.9, 1.7, "arm side\nrigid bodies", "#f9ead9")
    _arrow(axes, (3.4, y), (5.6, y), "gain · tau")
    _spring(axes, 8.15, 14.1, y)
    axes.text(11.1, y + 1.05, "$T = K\\,(\\theta - q) + b\\,(\\dot\\theta - \\dot q)$", ha="center", fontsize=11)
    axes.text(11.1, y - 1.35, "stiffness, damping, clearance,\ntransmission error", ha="center", fontsize=8)
    _sensor(axes, 4.5, y, "tau", "reported torque\n(+ offset)")
    _sensor(axes, 7.3, y + 0.85, "q = $\\theta$", "encoder of the motor\n(+ offset)", up=True)
    _sensor(axes, 15.6, y + 0.85, "q_link = $q$", "second encoder", up=True)
    _sensor(axes, 13.5, y, "tau_link = $T$", "joint torque sensor")
    save(figure, path)


def _block(axes: Any, x: float, y: float, width: float, height: float, text: str, colour: str = "#eeeeee") -> None:
    from matplotlib.patches import FancyBboxPatch

    box = FancyBboxPatch(
        (x - width / 2, y - height / 2), width, height, boxstyle="round,pad=0.05", facecolor=colour, edgecolor="#444444"
    )
    axes.add_patch(box)
    axes.text(x, y, text, ha="center", va="center", fontsize=10)


def _arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], text: str) -> None:
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "#444444"})
    axes.text((start[0] + end[0]) / 2, start[1] + 0.2, text, ha="center", fontsize=10)


def _spring(axes: Any, left: float, right: float, y: float) -> None:
    """A spring above a damper between two blocks."""
    a, b = left + 0.7, right - 0.7
    x = np.linspace(a, b, 17)
    zigzag = np.where(np.arange(17) % 2, 0.28, -0.28)
    zigzag[[0, 1, -2, -1]] = 0.0
    style = {"color": "#444444", "linewidth": 1.3}
    axes.plot([left, a], [y, y], **style)
    axes.plot([b, right], [y, y], **style)
    axes.plot([a, a], [y - 0.45, y + 0.45], **style)
    axes.plot([b, b], [y - 0.45, y + 0.45], **style)
    axes.plot(x, y + 0.45 + zigzag, **style)
    middle = (a + b) / 2
    axes.plot([a, middle - 0.1], [y - 0.45, y - 0.45], **style)
    axes.plot([middle - 0.1, middle - 0.1], [y - 0.65, y - 0.25], **style)
    axes.plot([middle - 0.5, middle + 0.3, middle + 0.3, middle - 0.5], [y - 0.7, y - 0.7, y - 0.2, y - 0.2], **style)
    axes.plot([middle + 0.3, b], [y - 0.45, y - 0.45], **style)


def _sensor(axes: Any, x: float, y: float, name: str, text: str, *, up: bool = False) -> None:
    """What is measured at a place."""
    way = 1.0 if up else -1.0
    reach = 0.9 if up else 1.75
    axes.plot([x, x], [y, y + way * reach], color="#2456b8", linewidth=1.0, linestyle="--")
    axes.plot([x], [y], marker="o", color="#2456b8", markersize=4)
    at = y + way * reach
    if up:
        axes.text(x, at + 0.75, name, ha="center", va="bottom", fontsize=10, color="#2456b8")
        axes.text(x, at + 0.05, text, ha="center", va="bottom", fontsize=8, color="#2456b8")
    else:
        axes.text(x, at - 0.1, name, ha="center", va="top", fontsize=10, color="#2456b8")
        axes.text(x, at - 0.55, text, ha="center", va="top", fontsize=8, color="#2456b8")


PICTURES_OF = {"frames.png": frames, "drive.png": drive}


def main() -> None:
    """Draw all of them."""
    for name, draw in PICTURES_OF.items():
        draw(PICTURES / name)


if __name__ == "__main__":
    main()
