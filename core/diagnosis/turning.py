"""Friction that builds up in another way as its joint turns: what is left stands at the turns, and nowhere else.

A controller answers what friction does within milliseconds of a turn with a blow that fades as fast as its loop does.
How friction gets from one side to the other is another law's (bristles that bend by more, a damper in them), and no
motion tells it: turns are not compared along the measured motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..recording import Run
from .compared import near_turns
from .diagnosis import Overlay
from .found import Found
from .prepare import smoothed

Mask = NDArray[np.bool_]

DRY = ("coulomb_friction", "hysteresis", "load_friction", "stribeck_friction")
# a controller's error has faded after so many times kd / kp, its energy to a fiftieth
FADED = 2.0
# part of the time that may be near turns, or all of a run is
MOST_NEAR = 0.5


@dataclass(frozen=True, slots=True)
class Turning:
    """What is left near the turns of joints with dry friction.

    Attributes:
        place: Of the first finding that is such friction.
        leaves: Part of the energy above noise of what is left that is elsewhere.
    """

    place: int
    leaves: float


def turning(runs: Sequence[Run], overlays: Sequence[Overlay], found: Sequence[Found]) -> Turning | None:
    """How much of what is left on runs under a known controller is not near turns; None where that tells nothing.

    Args:
        runs: That were judged.
        overlays: Of each, measured and simulated with what was found.
        found: Findings.
    """
    dry = [k for k, item in enumerate(found) if item.effect in DRY]
    joints = sorted({found[k].at - 1 for k in dry})
    if not joints or not overlays:
        return None
    near, far = 0.0, 0.0
    close: list[Mask] = []
    for run, overlay in zip(runs, overlays, strict=True):
        gains = [(run.control.kd[i], run.control.kp[i]) for i in joints] if run.control.mode == "pd" else [(0.0, 0.0)]
        if not all(kp > 0.0 for _, kp in gains):
            return None
        grid = smoothed(run)
        reach = FADED * max(kd / kp for kd, kp in gains)
        turns = np.any(near_turns(grid, run.t, reach, np.ones(run.n, dtype=bool))[:, joints], axis=1)
        close.append(turns)
        for name, simulated in overlay.after.items():
            if name != "ee_rot" and name in overlay.measured:
                over = np.square((overlay.measured[name] - simulated) / overlay.noise[name]) - 1.0
                near += float(np.nansum(over[turns]))
                far += float(np.nansum(over[~turns]))
    if not near > 0.0 or float(np.mean(np.concatenate(close))) > MOST_NEAR:
        return None
    far = max(far, 0.0)
    return Turning(dry[0], far / (near + far))
