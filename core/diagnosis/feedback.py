"""How far controllers act on the noise of recorded positions and speeds, as their torque shows."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..recording import Run, steps_of

Vector = NDArray[np.float64]

# differences of so high an order leave noise of a motion; of what an arm that rings leaves, least is in the last third
# of their band
ORDER, LAST = 4, 3
# times what it should be: the record is what the controller was told, where all of its joints together say so. On the
# blind bank's set for tuning 65 of 67 controllers that know better follow less than half of HEARD, the others less than
# it, and 42 of 56 that know no better follow more
TOLD, HEARD = 0.7, 0.6


@lru_cache(maxsize=256)
def followed(run: Run, signal: str = "tau") -> Vector | None:
    """By what part every joint's torque follows the noise of its recorded position and speed, shape (n,).

    About 1 where the controller acts on what is recorded, about 0 where it knows better; None where no record tells.

    Args:
        run: As read.
        signal: "tau"; of "tau_link" by what part drives pass it on, for rotors keep some.
    """
    control = run.control
    if control.mode != "pd" or not (run.has("dq") and run.has(signal)):
        return None
    x, y = (np.diff(values, ORDER, axis=0) for values in (_fed_back(run), run.signals[signal]))
    good = np.isfinite(x) & np.isfinite(y)
    spectra = (np.fft.rfft(np.where(good, values, 0.0), axis=0) for values in (x, y))
    x, y = (lines[len(lines) - len(lines) // LAST :] for lines in spectra)
    both, own = np.sum((np.conj(x) * y).real, axis=0), np.sum(np.abs(x) ** 2, axis=0)
    return np.asarray(both / np.maximum(own, 1e-300))


def hears(run: Run) -> float | None:
    """By what part torques follow the noise of records in most joints of the runs of one controller.

    An arm that rings moves its torque as well, and may look so at a joint; a controller hears all its sensors, or none.
    """
    parts = [one for one in map(followed, (run, *run.beside)) if one is not None]
    return float(np.median(np.concatenate(parts))) if parts else None


def told(run: Run) -> NDArray[np.bool_] | None:
    """Joints whose controller was told what is recorded, noise and all, shape (n,); None where there are none."""
    parts, most = followed(run), hears(run)
    # many times what it should be is something else: the steps of a held command, a loud torque sensor
    if parts is None or most is None or not HEARD <= most <= 1.0 / HEARD:
        return None
    joints = (parts > TOLD) & (parts < 1.0 / TOLD)
    return joints if joints.any() else None


@lru_cache(maxsize=256)
def sensors_alone(run: Run) -> Run:
    """The run, and those beside it, without what controllers that were told what is recorded made of it as torque.

    What is left of torques' scatter is their sensors'.
    """
    joints, signals, steps = told(run), dict(run.signals), dict(run.steps)
    if joints is None:
        return run
    for name in ("tau", "tau_link"):
        if (parts := followed(run, name)) is not None:
            signals[name] = signals[name] - np.where(joints, parts * _fed_back(run), 0.0)
            steps[name] = steps_of(run, name)
    return replace(run, signals=signals, beside=tuple(sensors_alone(other) for other in run.beside), steps=steps)


def _fed_back(run: Run) -> Vector:
    """What recorded positions and speeds take from a controller's torque, shape (m, n)."""
    return -np.array(run.control.kp) * run.signals["q"] - np.array(run.control.kd) * run.signals["dq"]
