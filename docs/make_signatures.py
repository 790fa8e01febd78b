"""Draws what every effect looks like in a run: the pictures of docs/signatures.md.

    python docs/make_signatures.py [EFFECT ...]

A joint runs with an effect and without it, slowly and fast, by `mbexport.simulate`. What differs is drawn against
each variable that an effect may follow: where slow and fast fall on one curve, that is the variable it follows.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mbexport
from mbexport.core.agreement.samples import sampled
from mbexport.core.control import default_pd
from mbexport.core.database import FrozenMap
from mbexport.core.effects import EffectRow
from mbexport.core.kinematics import kinematics
from mbexport.core.motion import from_table

PICTURES = Path(__file__).resolve().parent / "pictures" / "signatures"
ENGINE = "urdf"
DPI, COLOURS = 110, 96
SLOW, FAST, WITHOUT = "#7fa6e8", "#b0431b", "#aaaaaa"
ALONG = {"slow": "#93cf9f", "fast": "#1f6b35"}
# the fast one lies on the slow one, where they are one curve
WIDE, NARROW = 3.0, 1.1
KNOTS = 24  # of a swing; quintics through them are within 1e-6 of the sine
SAMPLES = 400  # of a period

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signature:
    """How one effect is shown.

    Attributes:
        kind: What is drawn, one of KINDS.
        telling: Which panels, from 0, tell the effect; their frames are drawn.
        robot: A built-in robot, whose joint 1 is looked at.
        amplitude: Of its swing [rad].
        periods: Of the slow and of the fast swing [s].
        beside: Other effects that both runs have.
        changed: Cells of the effect's sample rows that are not the samples'.
    """

    kind: str
    telling: tuple[int, ...]
    robot: str = "pendulum"
    amplitude: float = 1.0
    periods: tuple[float, float] = (3.0, 1.0)
    beside: tuple[str, ...] = ()
    changed: Mapping[str, float] = FrozenMap({})


ANGLE, SPEED, ACCELERATION, LOAD = range(4)
EVERYWHERE = (ANGLE, SPEED, ACCELERATION, LOAD)

SIGNATURES = {
    "backlash": Signature("twist", (LOAD,)),
    "base_tilt": Signature("torque", (ANGLE,), "imece2013", 2.6, (24.0, 9.0)),
    "controller_gain": Signature("loop", (2,), changed=FrozenMap({"kp": 0.7, "kd": 0.7})),
    "coulomb_friction": Signature("torque", (SPEED,)),
    "delay": Signature("loop", (2,), changed=FrozenMap({"time": 0.012})),
    "encoder_offset": Signature("twist", EVERYWHERE),
    "hysteresis": Signature("torque", (ANGLE,)),
    "joint_compliance": Signature("twist", (LOAD,)),
    # its component about the axis is joint_compliance's
    "joint_compliance_6d": Signature("tip", (LOAD,), changed=FrozenMap({"krz": np.inf})),
    "joint_spring": Signature("torque", (ANGLE,)),
    "kinematic_error": Signature("tip", EVERYWHERE),
    "link_flexibility": Signature("tip", (LOAD,)),
    "link_inertia": Signature("torque", (ANGLE, ACCELERATION)),
    "load_friction": Signature("torque", (LOAD,)),
    "payload": Signature("torque", (ANGLE, ACCELERATION)),
    "rotor_inertia": Signature("torque", (ACCELERATION,)),
    "stribeck_friction": Signature("torque", (SPEED,), changed=FrozenMap({"velocity": 0.6})),
    "torque_constant": Signature("loop", (3,)),
    "torque_limit": Signature("loop", (2,), changed=FrozenMap({"torque": 6.0})),
    "torque_offset": Signature("torque", EVERYWHERE),
    "torque_ripple": Signature("torque", (ANGLE,)),
    "transmission_error": Signature("twist", (ANGLE,)),
    "viscous_friction": Signature("torque", (SPEED,)),
}


@dataclass(frozen=True)
class Pair:
    """A run with the effect and one without it, joint 1 of each; `bare` is the robot without."""

    bare: mbexport.Robot
    law: mbexport.MotionLaw
    control: mbexport.Control
    given: mbexport.Trace
    absent: mbexport.Trace

    def commanded(self) -> tuple[Array, Array, Array]:
        """Position, speed and acceleration of the command, shape (m,) each."""
        q, dq, ddq = self.law.at(self.given.t)
        return q[:, 0], dq[:, 0], ddq[:, 0]


def robots(effect: str, signature: Signature) -> tuple[mbexport.Robot, mbexport.Robot]:
    """With the effect and without it."""
    whole = sampled(mbexport.load(signature.robot), (effect, *signature.beside))
    rows = tuple(
        EffectRow(row.at, {**row.values, **signature.changed}) if signature.changed else row
        for row in whole.effects[effect]
    )
    tables = {**whole.effects, effect: rows}
    given = replace(whole, effects=FrozenMap(tables))
    absent = replace(whole, effects=FrozenMap({name: tables[name] for name in signature.beside}))
    return mbexport.build(given), mbexport.build(absent)


def swing(robot: mbexport.Robot, amplitude: float, period: float) -> mbexport.MotionLaw:
    """Two periods of joint 1 about home, the first growing from rest; the others hold."""
    t = np.linspace(0.0, 2.0 * period, 2 * KNOTS + 1)
    w = 2.0 * np.pi / period
    grow = np.minimum(t / period, 1.0)
    g = grow**3 * (10.0 - 15.0 * grow + 6.0 * grow**2)
    dg = np.where(t < period, 30.0 * grow**2 * (1.0 - grow) ** 2 / period, 0.0)
    ddg = np.where(t < period, 60.0 * grow * (1.0 - grow) * (1.0 - 2.0 * grow) / period**2, 0.0)
    s, ds, dds = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    columns = (g * s, dg * s + g * ds, ddg * s + 2.0 * dg * ds + g * dds)
    first = np.eye(robot.n)[0]
    q, dq, ddq = (amplitude * np.outer(column, first) for column in columns)
    return from_table(t, np.array(robot.home()) + q, dq, ddq)


def step(robot: mbexport.Robot) -> mbexport.MotionLaw:
    """Joint 1 from home to 0.6 rad in 0.3 s, and there for a while."""
    start = np.array(robot.home())
    far = start + 0.6 * np.eye(robot.n)[0]
    q = np.array([start, far, far])
    return from_table([0.0, 0.3, 0.6], q, np.zeros_like(q), np.zeros_like(q))


def run(
    given: mbexport.Robot, absent: mbexport.Robot, law: mbexport.MotionLaw, control: mbexport.Control, rate: float
) -> Pair:
    """Both robots under the same command."""
    traces = [mbexport.simulate(robot, ENGINE, law, control, rate=rate) for robot in (given, absent)]
    return Pair(absent, law, control, *traces)


def swings(effect: str, signature: Signature) -> list[tuple[str, dict[str, Any], Pair]]:
    """Slow and fast: name, look of the line and runs, the motion imposed."""
    pair = robots(effect, signature)
    looks = ({"color": SLOW, "linewidth": WIDE}, {"color": FAST, "linewidth": NARROW})
    return [
        (name, look, run(*pair, swing(pair[1], signature.amplitude, period), mbexport.Control(), SAMPLES / period))
        for name, look, period in zip(("slow", "fast"), looks, signature.periods, strict=True)
    ]


# -- what is drawn ----------------------------------------------------------------------------------------------------

VARIABLES = ("angle q [rad]", "speed [rad/s]", "acceleration [rad/s²]", "load of the joint [N m]")

LOOP = ("time [s]", "time [s]", "torque by the log's gains [N m]", "reported torque [N m]")
LOOP_ORDINATES = ("angle q [rad]", "reported torque [N m]", "reported torque [N m]", "joint's torque sensor [N m]")


def variables(pair: Pair) -> list[Array]:
    """Those of VARIABLES, over the second period, shape (k,) each."""
    return [late(values) for values in (*pair.commanded(), pair.absent.joints["tau_link"][:, 0])]


def late(values: Array) -> Array:
    """The second of two periods."""
    return values[len(values) // 2 :]


def torque(effect: str, signature: Signature, figure: Any) -> None:
    """The torque that the effect adds."""
    axes = panels(figure, signature, VARIABLES, "torque added [N m]")
    for name, look, pair in swings(effect, signature):
        added = late((pair.given.joints["tau"] - pair.absent.joints["tau"])[:, 0])
        for axis, values in zip(axes, variables(pair), strict=True):
            axis.plot(values, added, label=name, **look)
    finish(figure, axes)


def twist(effect: str, signature: Signature, figure: Any) -> None:
    """What the second encoder says less than the first."""
    axes = panels(figure, signature, VARIABLES, "q - q_link [mrad]")
    for name, look, pair in swings(effect, signature):
        apart = 1e3 * late((pair.given.joints["q"] - pair.given.joints["q_link"])[:, 0])
        for axis, values in zip(axes, variables(pair), strict=True):
            axis.plot(values, apart, label=name, **look)
    finish(figure, axes)


def tip(effect: str, signature: Signature, figure: Any) -> None:
    """Where the tip is, off the place that the arm's own encoder gives it."""
    axes = panels(figure, signature, VARIABLES, "tip off its place [mm]")
    for name, look, pair in swings(effect, signature):
        chain = kinematics(pair.bare)
        place = np.array([chain.tool_in_base(q)[:3, 3] for q in pair.given.joints["q_link"]])
        off = 1e3 * (pair.given.tip - place)
        along = place / np.linalg.norm(place, axis=1, keepdims=True)
        across = np.cross([0.0, 0.0, 1.0], along)
        for direction, word, colour in ((along, "along the arm", ALONG[name]), (across, "across", look["color"])):
            part = late(np.sum(off * direction, axis=1))
            for axis, values in zip(axes, variables(pair), strict=True):
                axis.plot(values, part, label=f"{name}, {word}", **{**look, "color": colour})
    finish(figure, axes)


def loop(effect: str, signature: Signature, figure: Any) -> None:
    """A controller's torques in a step, the same with and without."""
    given, absent = robots(effect, signature)
    pair = run(given, absent, step(absent), default_pd(absent), 1000.0)
    axes = panels(figure, signature, LOOP, "")
    for axis, label in zip(axes, LOOP_ORDINATES, strict=True):
        axis.set_ylabel(label, fontsize=8)
    wanted, speed, _ = pair.commanded()
    axes[0].plot(pair.given.t, wanted, color="black", linewidth=0.8, linestyle=":", label="command")
    looks = ({"color": WITHOUT, "linewidth": WIDE}, {"color": FAST, "linewidth": NARROW})
    for name, look, trace in zip(("without", "with"), looks, (pair.absent, pair.given), strict=True):
        q, dq, reported, passed = (trace.joints[signal][:, 0] for signal in ("q", "dq", "tau", "tau_link"))
        by_gains = pair.control.kp[0] * (wanted - q) + pair.control.kd[0] * (speed - dq)
        style = {"label": name, **look}
        axes[0].plot(trace.t, q, **style)
        axes[1].plot(trace.t, reported, **style)
        axes[2].plot(by_gains, reported, **style)
        axes[3].plot(reported, passed, **style)
    finish(figure, axes)


KINDS: dict[str, Callable[[str, Signature, Any], None]] = {"torque": torque, "twist": twist, "tip": tip, "loop": loop}


def panels(figure: Any, signature: Signature, labels: tuple[str, ...], ordinate: str) -> list[Any]:
    """A row of axes, one a variable; those that tell the effect have a heavy frame."""
    axes = [figure.add_subplot(1, len(labels), i + 1) for i in range(len(labels))]
    for i, (axis, label) in enumerate(zip(axes, labels, strict=True)):
        tells = i in signature.telling
        for side in axis.spines.values():
            side.set(linewidth=1.8 if tells else 0.8, color="black" if tells else "#999999")
        axis.set_xlabel(label, fontsize=8)
        axis.tick_params(labelsize=7)
        axis.grid(color="#eeeeee")
        axis.ticklabel_format(useOffset=False)
        axis.locator_params(nbins=5)
    axes[0].set_ylabel(ordinate, fontsize=8)
    return axes


def finish(figure: Any, axes: list[Any]) -> None:
    """A key of the lines, below them all; a constant does not fill its panel with rounding."""
    for axis in axes:
        low, high = axis.get_ylim()
        if high - low < 1e-6:
            axis.set_ylim(low - 0.5 * abs(low) - 1e-3, high + 0.5 * abs(high) + 1e-3)
    lines, names = axes[0].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=8)


def draw(effect: str, path: Path) -> None:
    """The picture of one effect."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 2.5), dpi=DPI, layout="constrained")
    signature = SIGNATURES[effect]
    KINDS[signature.kind](effect, signature, figure)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_small(figure, path)


def save_small(figure: Any, path: Path) -> None:
    """Write a picture without a date, in a few colours: a third of the bytes."""
    from PIL import Image

    whole = io.BytesIO()
    figure.savefig(whole, format="png", metadata={"Software": None})
    Image.open(whole).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


def main(*wanted: str) -> None:
    """Draw them."""
    for effect in wanted or tuple(SIGNATURES):
        draw(effect, PICTURES / f"{effect}.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
