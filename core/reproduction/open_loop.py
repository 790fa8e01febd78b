"""Figure 12: motion imposed on the motor sides of elastic joints (open loop), in every engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..simulation import Trace, backend_named
from .case import Case
from .modes import Mode, arm_modes, nearest
from .ringing import ringing
from .statics import linear_sag, sagged_positions, sagged_tip

Array = NDArray[np.float64]

# after the motion the quick oscillations, and the last of what drove them, die away first [s]
CALM = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class OpenLoop:
    """What the joints' compliance does to the path.

    Attributes:
        t: Times [s], shape (m,).
        moving: Those of them at which the command moves, shape (m,).
        command: Where the tip is asked to be, in the base [m], shape (m, 3).
        resting: Where the tip of the elastic arm at rest would be, shape (m, 3).
        linear: The sag by the Jacobian alone [m], shape (m, 3).
        tips: Backend -> its tip, shape (m, 3).
        steps: Backend -> its step [s].
        corner: Number of the corner about which the tip leaves the path's edges most.
        own_error: How much the reference engine's tip moves when its step is halved [m].
        measured, predicted: The oscillations of the last standstill, and the eigenvalues' that are nearest to them.
    """

    t: Array
    moving: NDArray[np.bool_]
    command: Array
    resting: Array
    linear: Array
    tips: Mapping[str, Array]
    steps: Mapping[str, float]
    corner: int
    own_error: float
    measured: tuple[Mode, ...]
    predicted: tuple[Mode, ...]

    @property
    def tip(self) -> Array:
        """The reference engine's tip, shape (m, 3)."""
        return next(iter(self.tips.values()))

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        off = (self.tip - self.command)[self.moving]
        sag = (self.resting - self.command)[self.moving]
        level = np.linalg.norm(off[:, :2], axis=1)
        return {
            "shift_z_m": spread(off[:, 2]),
            "static_sag_z_m": spread(sag[:, 2]),
            "static_sag_by_jacobian_z_m": spread(self.linear[self.moving, 2]),
            "start_against_static_sag_m": float(np.linalg.norm(self.tip[0] - self.resting[0])),
            "in_plane_m": {"rms": rms(level), "largest": float(np.max(level))},
            "static_in_plane_m": {"largest": float(np.max(np.linalg.norm(sag[:, :2], axis=1)))},
            "oscillation_m": rms(np.linalg.norm((self.tip - self.resting)[self.moving], axis=1)),
            "corner": self.corner,
            "engines_apart_m": apart(self.tips),
            "engines_of_high_order_apart_m": apart(of_high_order(self.tips)),
            "steps_s": dict(self.steps),
            "halving_the_step_m": self.own_error,
            "ringing": [mode.to_json() for mode in self.measured],
            "eigenvalues": [mode.to_json() for mode in self.predicted],
        }


def open_loop(case: Case) -> OpenLoop:
    """Figure 12 in all engines."""
    traces = {name: case.run("figure 12", case.compliant, name, case.motion) for name in case.backends}
    first = traces[case.reference]
    theta = case.motion.at(first.t)[0]
    command, resting = case.command(first.t), sagged_tip(case.compliant, theta)
    moving = first.t <= case.motion.duration
    key = case.first_key()
    half = 0.5 * first.facts["step"]
    halved = case.run("figure 12, half the step", case.compliant, case.reference, key, duration=key.duration, step=half)
    m = len(halved.t)
    measured, eigen = after_the_end(case, first)
    return OpenLoop(
        first.t,
        moving,
        command,
        resting,
        linear_sag(case.compliant, theta),
        {name: trace.tip for name, trace in traces.items()},
        {name: trace.facts["step"] for name, trace in traces.items()},
        _corner(first.t, first.tip, case.corners, case.command(case.corners)),
        float(np.max(np.linalg.norm(halved.tip - first.tip[:m], axis=1))),
        measured,
        tuple(nearest(eigen, mode) for mode in measured),
    )


def after_the_end(case: Case, trace: Trace) -> tuple[tuple[Mode, ...], tuple[Mode, ...]]:
    """Oscillations seen in the arms' sides once the imposed motion has ended, and all that the eigenvalues give."""
    still = trace.t > case.motion.duration + CALM
    theta = case.motion.at(case.motion.duration)[0]
    rest = sagged_positions(case.compliant, theta[None])[0]
    return ringing(trace.t[still], trace.joints["q_link"][still] - rest), arm_modes(case.compliant, rest)


def _corner(t: Array, tip: Array, corners: Array, places: Array) -> int:
    """The corner (its number, inner ones only) about which the tip leaves the two edges most in the level plane."""
    inner = range(1, max(2, len(corners) - 1))
    return 1 + int(np.argmax([float(np.max(about_corner(t, tip, corners, places, k))) for k in inner]))


def about_corner(t: Array, tip: Array, corners: Array, places: Array, k: int) -> Array:
    """Distance of the tip from the nearer of a corner's two edges in the level plane [m], shape (j,).

    From the time of half the edge before the corner to that of half the edge after it.
    """
    last = min(k + 1, len(corners) - 1)
    begin, end = 0.5 * (corners[k - 1] + corners[k]), 0.5 * (corners[k] + corners[last])
    on = tip[(t >= begin) & (t <= end), :2]
    distances: list[Array] = []
    for begin, end in ((k - 1, k), (k, last))[: last - k + 1]:
        edge = (places[end] - places[begin])[:2]
        along = np.clip((on - places[begin, :2]) @ edge / (edge @ edge), 0.0, 1.0)
        distances.append(np.linalg.norm(on - places[begin, :2] - np.outer(along, edge), axis=1))
    return np.min(distances, axis=0)


def of_high_order(tips: Mapping[str, Array]) -> dict[str, Array]:
    """The tips of engines that integrate to second order or better."""
    return {name: tip for name, tip in tips.items() if backend_named(name).gate_class == "A"}


def apart(tips: Mapping[str, Array]) -> dict[str, Any]:
    """How far the tips of any two engines are apart at most [m], and which two."""
    worst, pair = 0.0, ""
    for (one, a), (other, b) in combinations(tips.items(), 2):
        distance = float(np.max(np.linalg.norm(a - b, axis=1)))
        if distance >= worst:
            worst, pair = distance, f"{one} and {other}"
    return {"largest": worst, "between": pair}


def spread(values: Array) -> dict[str, float]:
    """Mean and ends of some values, shape (m,)."""
    return {"mean": float(np.mean(values)), "least": float(np.min(values)), "most": float(np.max(values))}


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
