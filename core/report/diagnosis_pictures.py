"""The pictures of a diagnosis: the gap before and after, what it goes with, where it lies, how it shrinks."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..diagnosis.diagnosis import Diagnosis, Overlay, Vector
from ..diagnosis.words import (
    PHASES,
    SIGNALS,
    capitalised,
    cause_in_words,
    effect_in_words,
    percent,
    place_in_words,
    plain_unit,
    variable_in_words,
)
from ..motion import from_table
from ..signals import joint_unit
from .pictures import COLOURS, Picture, new_figure, picture, styled

BEFORE, AFTER, BAND, INK = "#d55e00", "#0072b2", "#dfe4ea", "#39424e"
# bins a curve of many samples is drawn with, a lowest and a highest point each
BINS = 300
# points of a cloud
POINTS = 700
CHANNELS = 3
# the band that holds 95 % of a perfect model's gap
BAND_WIDTH = 1.96
_AXES = "xyz"
# rad and m of gaps are small
_SMALL = {"rad": (1e3, "mrad"), "m": (1e3, "mm"), "rad/s": (1e3, "mrad/s")}


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a run: its gap before and after, and the noise it is judged against.

    Attributes:
        signal: "tau", "q", "ee" ...
        number: Of the joint, or of the axis, from 1.
        before, after: Measured minus simulated, shape (m,); `after` None where nothing was found.
        noise: Standard deviation that a perfect model would leave.
    """

    overlay: Overlay
    signal: str
    number: int
    before: Vector
    after: Vector | None
    noise: float

    @property
    def strength(self) -> float:
        """Root mean square of the gap before, in units of noise."""
        return _rms(self.before) / self.noise

    @property
    def name(self) -> str:
        """For people: the motor torque of joint 2, the tool position along x."""
        what = SIGNALS.get(self.signal, self.signal)
        return f"{what}, {_AXES[self.number - 1]}" if _of_tool(self.signal) else f"{what} of joint {self.number}"


def _of_tool(signal: str) -> bool:
    return signal.startswith("ee")


def _rms(values: Vector) -> float:
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else 0.0


def channels(overlay: Overlay) -> list[Channel]:
    """Every channel of a run that was both measured and simulated, the one with the largest gap first."""
    found: list[Channel] = []
    for signal, simulated in overlay.before.items():
        measured, noise = overlay.measured.get(signal), overlay.noise.get(signal)
        if measured is None or noise is None or measured.shape != simulated.shape:
            continue
        corrected = overlay.after.get(signal)
        sizes = np.broadcast_to(np.asarray(noise, dtype=float), (simulated.shape[1],))
        for i in range(simulated.shape[1]):
            gap = measured[:, i] - simulated[:, i]
            if not np.isfinite(gap).any() or not sizes[i] > 0.0:
                continue
            left = None if corrected is None else measured[:, i] - corrected[:, i]
            found.append(Channel(overlay, signal, i + 1, gap, left, float(sizes[i])))
    return sorted(found, key=lambda channel: -channel.strength)


def shown_overlay(diagnosis: Diagnosis) -> Overlay | None:
    """The run that is drawn: one that no fit saw, if there is one, with the largest gap."""
    drawn = [(overlay, channels(overlay)) for overlay in diagnosis.overlays]
    drawn = [item for item in drawn if item[1]]
    if not drawn:
        return None
    return max(drawn, key=lambda item: (item[0].held_out, item[1][0].strength))[0]


def worst_channels(overlay: Overlay) -> list[Channel]:
    """The channels with the largest gaps: one of each signal first, if it stands out of its noise, then the rest."""
    ranked = channels(overlay)
    first = [next(c for c in ranked if c.signal == signal) for signal in dict.fromkeys(c.signal for c in ranked)]
    chosen = [c for c in first if c is ranked[0] or c.strength > 2.0]
    rest = [c for c in ranked if c not in chosen]
    return (chosen + rest)[:CHANNELS]


def worst_stretch(chosen: Sequence[Channel]) -> tuple[float, float]:
    """The stretch of time with the largest gap in these channels [s]."""
    t = chosen[0].overlay.t
    length = max(0.12 * float(t[-1] - t[0]), min(0.5, float(t[-1] - t[0])))
    energy = np.sum([np.nan_to_num(c.before / c.noise) ** 2 for c in chosen], axis=0)
    grown = np.concatenate([[0.0], np.cumsum(energy)])
    ends = np.searchsorted(t, t + length, side="right")
    starts = np.arange(len(t))
    whole = t <= t[-1] - length + 1e-9
    if not whole.any():
        return float(t[0]), float(t[-1])
    begin = int(np.argmax(np.where(whole, grown[ends] - grown[starts], -1.0)))
    return float(t[begin]), float(t[begin] + length)


def gap_picture(diagnosis: Diagnosis) -> Picture | None:
    """The gap before and after on top of each other, in the worst channels: the whole run, and its worst stretch."""
    overlay = shown_overlay(diagnosis)
    if overlay is None:
        return None
    chosen = worst_channels(overlay)
    stretch = worst_stretch(chosen)
    corrected = chosen[0].after is not None
    with styled():
        figure = new_figure(9.2, 1.75 * len(chosen) + 0.75)
        grid = figure.subplots(len(chosen), 2, sharex="col", squeeze=False, width_ratios=(1.7, 1.0))
        for row, channel in zip(grid, chosen, strict=True):
            scale, unit = _unit_of(diagnosis, channel)
            for axes, (begin, end) in zip(row, ((overlay.t[0], overlay.t[-1]), stretch), strict=True):
                _draw_gap(axes, channel, scale, float(begin), float(end))
            row[0].set_title(f"{capitalised(channel.name)} [{unit}]")
            row[0].axvspan(*stretch, color="#fff3cd", zorder=0)
        grid[0][1].set_title("the worst stretch")
        for axes in grid[-1]:
            axes.set_xlabel("t [s]")
        figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    seen = "which no fit saw" if overlay.held_out else "which the fit saw"
    caption = (
        f"Run {overlay.run}, {seen}: measured minus simulated where that is largest. 95 % of a perfect model's gap "
        "would lie within the grey band."
    )
    both = "before and after" if corrected else "as the model stands"
    return picture(figure, f"The gap over time {both}, with the band of the noise", caption)


def _unit_of(diagnosis: Diagnosis, channel: Channel) -> tuple[float, str]:
    """Factor and unit in which a channel's gap is drawn."""
    return _scale(_si_unit(diagnosis, channel.signal, channel.number))


def _si_unit(diagnosis: Diagnosis, signal: str, number: int) -> str:
    if _of_tool(signal):
        return "rad" if signal == "ee_rot" else "m"
    return joint_unit(signal, diagnosis.corrected.joints[number - 1].kind)


def _scale(unit: str) -> tuple[float, str]:
    factor, name = _SMALL.get(unit, (1.0, unit))
    return factor, plain_unit(name)


def _draw_gap(axes: Any, channel: Channel, scale: float, begin: float, end: float) -> None:
    t = channel.overlay.t
    inside = (t >= begin) & (t <= end)
    half = BAND_WIDTH * channel.noise * scale
    axes.axhspan(-half, half, color=BAND, zorder=1, label="noise")
    corrected = channel.after is not None
    style = {"linewidth": 1.3, "zorder": 2, "solid_joinstyle": "round"}
    label = "gap before" if corrected else "gap"
    axes.plot(*envelope(t[inside], channel.before[inside] * scale), color=BEFORE, label=label, **style)
    if channel.after is not None:
        axes.plot(*envelope(t[inside], channel.after[inside] * scale), color=AFTER, label="gap after", **style)
    axes.set_xlim(begin, end)


def envelope(t: Vector, values: Vector) -> tuple[Vector, Vector]:
    """A curve with no more points than can be seen: the lowest and the highest of every bin; gaps stay gaps."""
    if len(t) <= 2 * BINS:
        return t, values
    kept: list[int] = []
    for part in np.array_split(np.arange(len(t)), BINS):
        seen = part[np.isfinite(values[part])]
        if len(seen) == 0:
            kept.append(int(part[0]))
            continue
        ends = {int(seen[np.argmin(values[seen])]), int(seen[np.argmax(values[seen])])}
        kept += sorted(ends)
    return t[kept], values[kept]


_CHANNEL = re.compile(r"([a-z_]+?)_(\d+)")
_FUNCTIONS = {"sign": np.sign, "abs": np.abs, "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt, "exp": np.exp}


def variable_values(expression: str, overlay: Overlay) -> Vector | None:
    """Values of a variable of a run, such as "dq_2" or "abs(tau_2)*sign(dq_2)"; None where the run does not know it."""
    try:
        tree = ast.parse(expression.replace("^", "**"), mode="eval").body
        with np.errstate(all="ignore"):
            values = _evaluated(tree, overlay)
    except (SyntaxError, KeyError, ValueError, RecursionError):
        return None
    return values if values.shape == overlay.t.shape else None


def _evaluated(node: ast.expr, overlay: Overlay) -> Vector:
    match node:
        case ast.Name(id=name):
            return _signal(name, overlay)
        case ast.Constant(value=int() | float() as value):
            return np.asarray(float(value))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
            return _FUNCTIONS[name](_evaluated(argument, overlay))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_evaluated(operand, overlay)
        case ast.BinOp(left=left, op=operator, right=right):
            a, b = _evaluated(left, overlay), _evaluated(right, overlay)
            match operator:
                case ast.Add():
                    return a + b
                case ast.Sub():
                    return a - b
                case ast.Mult():
                    return a * b
                case ast.Div():
                    return a / b
                case ast.Pow():
                    return a**b
                case _:
                    raise ValueError(expression_fault(node))
        case _:
            raise ValueError(expression_fault(node))


def expression_fault(node: ast.expr) -> str:
    """What is no variable."""
    return f"{ast.unparse(node)} is no variable of a run"


def _signal(name: str, overlay: Overlay) -> Vector:
    if name == "t":
        return overlay.t
    match = _CHANNEL.fullmatch(name)
    if match is None:
        raise KeyError(name)
    signal, number = match[1], int(match[2])
    if signal in overlay.measured:
        values = overlay.measured[signal]
    elif signal in ("dq", "ddq"):
        values = _derivative(overlay, "q" if signal == "dq" else "dq")
    else:
        values = overlay.before[signal]
    if not 1 <= number <= values.shape[1]:
        raise KeyError(name)
    return values[:, number - 1]


def _derivative(overlay: Overlay, signal: str) -> Vector:
    """Rate of a signal: of the command where there is one, which has no noise."""
    for name in (f"{signal}_cmd", signal):
        if name in overlay.measured:
            return np.gradient(overlay.measured[name], overlay.t, axis=0)
    if signal == "dq":
        return np.gradient(_derivative(overlay, "q"), overlay.t, axis=0)
    raise KeyError(signal)


def dependence_picture(diagnosis: Diagnosis) -> Picture | None:
    """The gap of the worst channel against the variable that explains it, before and after."""
    overlay = shown_overlay(diagnosis)
    if overlay is None or diagnosis.verdict == "no_gap":
        return None
    for dependence in diagnosis.where.depends_on:
        # against the direction alone all points would lie on two lines
        against = re.sub(r"^sign\(([a-z_]+\d+)\)$", r"\1", dependence.variable)
        x = variable_values(against, overlay)
        if x is None or not np.isfinite(x).any() or np.nanmax(x) <= np.nanmin(x):
            continue
        return _scatter(diagnosis, _channel_of(overlay, against), against, dependence.variable, dependence.strength, x)
    return None


def _channel_of(overlay: Overlay, variable: str) -> Channel:
    """The channel whose gap is drawn against a variable: torque of the same joint, if there is one, else the worst."""
    ranked = channels(overlay)
    joint = re.search(r"_(\d+)", variable)
    own = [c for c in ranked if joint and not _of_tool(c.signal) and c.number == int(joint[1])]
    torque = [c for c in own if c.signal.startswith("tau")]
    # one that stands out of its noise says more than one that should
    best = max([*torque[:1], *own[:1]], key=lambda c: c.strength, default=ranked[0])
    return torque[0] if torque and torque[0].strength > 2.0 else best


def _scatter(
    diagnosis: Diagnosis, channel: Channel, against: str, variable: str, strength: float, x: Vector
) -> Picture:
    scale, unit = _unit_of(diagnosis, channel)
    x_unit = _unit_of_variable(diagnosis, against)
    panels = [(channel.before, BEFORE, "before" if channel.after is not None else "measured minus simulated")]
    if channel.after is not None:
        panels.append((channel.after, AFTER, "after"))
    with styled():
        figure = new_figure(9.2, 3.1)
        row = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
        for axes, (gap, colour, title) in zip(row, panels, strict=True):
            half = BAND_WIDTH * channel.noise * scale
            axes.axhspan(-half, half, color=BAND, zorder=1)
            seen = np.flatnonzero(np.isfinite(gap) & np.isfinite(x))
            shown = seen[:: 1 + len(seen) // POINTS]
            axes.plot(x[shown], gap[shown] * scale, ".", color=colour, alpha=0.45, markersize=4, zorder=2)
            axes.plot(*_means(x[seen], gap[seen] * scale), color=INK, linewidth=1.6, zorder=3)
            axes.set_title(title)
            axes.set_xlabel(capitalised(variable_in_words(against)) + (f" [{x_unit}]" if x_unit else ""))
        row[0].set_ylabel(f"{SIGNALS.get(channel.signal, channel.signal)} [{unit}]")
    caption = (
        f"The gap in the {channel.name} goes with {variable_in_words(variable)}, which by itself explains "
        f"{percent(strength)} of it. The line is its mean, the grey band that of the noise."
    )
    return picture(figure, f"The gap against {variable_in_words(against)}", caption)


def _unit_of_variable(diagnosis: Diagnosis, variable: str) -> str:
    match = _CHANNEL.fullmatch(re.sub(r"^abs\((.*)\)$", r"\1", variable))
    if variable == "t":
        return "s"
    if match is None or int(match[2]) > diagnosis.corrected.n:
        return ""
    return plain_unit(_si_unit(diagnosis, match[1], int(match[2])))


def _means(x: Vector, y: Vector) -> tuple[Vector, Vector]:
    """Mean of y in bins of x that hold alike many points; a line breaks where x jumps over zero."""
    if len(x) < 10:
        return x[:0], y[:0]
    parts = [np.flatnonzero(x < 0.0), np.flatnonzero(x >= 0.0)]
    xs: list[float] = []
    ys: list[float] = []
    for part in parts:
        if len(part) < 5:
            continue
        ordered = part[np.argsort(x[part], kind="stable")]
        for bin_ in np.array_split(ordered, min(12, len(ordered) // 5)):
            xs.append(float(np.mean(x[bin_])))
            ys.append(float(np.mean(y[bin_])))
        xs.append(float("nan"))
        ys.append(float("nan"))
    return np.array(xs), np.array(ys)


def where_picture(diagnosis: Diagnosis) -> Picture | None:
    """The gap by joint with intervals, by phase of motion, by frequency."""
    where = diagnosis.where
    if diagnosis.verdict == "no_gap" or not any(found.share > 0.0 for found in where.joints.values()):
        return None
    phases = {capitalised(_phase(p.phase)): p.share for p in where.when}
    bands = {f"{_hz(b.from_hz)} to {_hz(b.to_hz)} Hz": b.share for b in where.bands}
    panels = [(title, bars) for title, bars in (("phase of motion", phases), ("frequency", bands)) if bars]
    rows = max(len(where.joints), len(phases), len(bands))
    with styled():
        figure = new_figure(9.2, 0.8 + 0.3 * rows)
        row = figure.subplots(1, 1 + len(panels), squeeze=False)[0]
        _draw_joints(row[0], diagnosis)
        for axes, (title, bars) in zip(row[1:], panels, strict=True):
            _draw_shares(axes, title, bars)
    return picture(
        figure,
        "Bars of the gap by joint, by phase of motion and by frequency",
        "Where the gap lies. By joint: its size in units of noise with intervals of 95 %, and its share of the energy.",
    )


def _phase(phase: str) -> str:
    return PHASES.get(phase, phase.replace("_", " ")).removeprefix("at ").removeprefix("under ")


def _hz(value: float) -> str:
    return f"{value:.3g}"


def _draw_joints(axes: Any, diagnosis: Diagnosis) -> None:
    joints = diagnosis.where.joints
    sizes = np.array([found.rms for found in joints.values()])
    ends = np.array([found.ci95 for found in joints.values()])
    known = ends[:, 1] > 0.0
    errors = np.where(known[:, None], np.abs(ends - sizes[:, None]), 0.0).T
    at = np.arange(len(joints))
    axes.barh(at, sizes, 0.68, color=COLOURS[0], xerr=errors if known.any() else None, error_kw={"elinewidth": 1.1})
    right = np.where(known, np.maximum(ends[:, 1], sizes), sizes)
    for k, found in enumerate(joints.values()):
        axes.annotate(
            percent(found.share), (right[k], k), (4, 0), textcoords="offset points", va="center", fontsize=8.5
        )
    axes.set_xlim(0.0, 1.22 * max(float(right.max()), 1e-12))
    axes.set_title("joint [times the noise]")
    _name_bars(axes, [capitalised(place_in_words(name)) for name in joints])


def _draw_shares(axes: Any, title: str, bars: Mapping[str, float]) -> None:
    axes.barh(range(len(bars)), [100.0 * share for share in bars.values()], 0.68, color=COLOURS[5])
    for k, share in enumerate(bars.values()):
        text = percent(share)
        axes.annotate(text, (100.0 * share, k), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
    axes.set_xlim(0.0, 1.25 * max(100.0 * max(bars.values()), 1.0))
    axes.set_title(f"{title} [%]")
    _name_bars(axes, list(bars))


def _name_bars(axes: Any, names: list[str]) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)


def waterfall_picture(diagnosis: Diagnosis) -> Picture | None:
    """What each effect takes from the gap, one after the other."""
    how_far = diagnosis.how_far
    if how_far.shrinks_by is None or not how_far.by_effect:
        return None
    names, starts, widths, colours = ["Gap before"], [0.0], [100.0], [BEFORE]
    left = 100.0
    for share in how_far.by_effect:
        names.append(capitalised(cause_in_words(share.effect, share.at)))
        step = 100.0 * share.shrinks_by
        starts.append(left - step if step >= 0.0 else left)
        widths.append(abs(step))
        colours.append(COLOURS[2] if step >= 0.0 else COLOURS[3])
        left -= step
    names.append("Gap after")
    starts.append(0.0)
    widths.append(max(left, 0.0))
    colours.append(AFTER)
    with styled():
        figure = new_figure(9.2, 0.75 + 0.36 * len(names))
        axes = figure.subplots()
        at = np.arange(len(names))
        axes.barh(at, widths, 0.66, left=starts, color=colours)
        level = 100.0
        for k in range(1, len(names)):
            # where one bar ends, the next begins
            axes.plot([level, level], [k - 0.67, k - 0.33], color="#8a929c", linewidth=0.9)
            level -= 100.0 * how_far.by_effect[k - 1].shrinks_by if k <= len(how_far.by_effect) else 0.0
        for k, (start, width) in enumerate(zip(starts, widths, strict=True)):
            inner = 0 < k < len(names) - 1
            sign = "" if not inner else "\u2212" if colours[k] == COLOURS[2] else "+"
            axes.annotate(f"{sign}{width:.0f} %", (start + width, k), (4, 0), textcoords="offset points", va="center")
        axes.set_xlim(min(0.0, *starts), 1.1 * max(100.0, *(s + w for s, w in zip(starts, widths, strict=True))))
        _name_bars(axes, names)
        axes.set_xlabel("gap on runs that no fit saw [% of the gap before]")
    return picture(
        figure,
        "Waterfall: the gap before, what each effect takes from it, the gap after",
        "The effects in the order in which they were added; what each takes depends on those before it.",
    )


def motion_picture(diagnosis: Diagnosis) -> Picture | None:
    """The motion of the next experiment."""
    following = diagnosis.next_experiment
    if following is None:
        return None
    table = following.motion
    t = np.linspace(table.t[0], table.t[-1], 400)
    q, dq, _ = from_table(table.t, table.q, table.dq, table.ddq).at(t)
    slides = [joint.kind == "prismatic" for joint in diagnosis.corrected.joints]
    named = set(re.findall(r"(?:joint|arm)[ _](\d+)", following.why))
    with styled():
        figure = new_figure(9.2, 2.9)
        row = figure.subplots(1, 2, sharex=True)
        for i, prismatic in enumerate(slides):
            scale = 1e3 if prismatic else 180.0 / np.pi
            wide = 2.6 if str(i + 1) in named else 1.3
            for axes, values in zip(row, (q, dq), strict=True):
                label = f"joint {i + 1}" + (" [mm]" if prismatic else "")
                axes.plot(t, scale * values[:, i], color=COLOURS[i % len(COLOURS)], linewidth=wide, label=label)
        unit = "mm" if all(slides) else "\u00b0"
        row[0].set_title(f"position [{unit}]")
        row[1].set_title(f"speed [{unit}/s]")
        for axes in row:
            axes.set_xlabel("t [s]")
        figure.legend(*row[0].get_legend_handles_labels(), loc="outside lower center", ncols=min(len(slides), 7))
    caption = f"{table.t[-1] - table.t[0]:.3g} s, within the limits of the robot; what it is about is drawn thicker."
    return picture(figure, "Positions and speeds of the joints in the next experiment", caption)


def scores_by_effect(diagnosis: Diagnosis) -> dict[str, dict[str, tuple[float, float]]]:
    """Effect -> place -> (share of the gap it takes alone, probability); the strongest effects first."""
    table: dict[str, dict[str, tuple[float, float]]] = {}
    for score in diagnosis.scores:
        table.setdefault(score.effect, {})[score.at] = (score.explains, score.probability)
    return dict(
        sorted(table.items(), key=lambda item: (-max(x for x, _ in item[1].values()), effect_in_words(item[0])))
    )
