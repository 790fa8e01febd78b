"""What is kept of one variant: the tip's error and the joints' torques, as numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..representation import JointKind
from ..signals import joint_unit

if TYPE_CHECKING:
    from ..simulation import Trace

Array = NDArray[np.float64]

AXES = ("x", "y", "z")
TIP = ("tip_rms", "tip_max", "tip_end")


def figure_names(n: int) -> tuple[str, ...]:
    """Names of the figures of a robot with n joints, in order."""
    return (
        *(f"{figure}{axis}" for figure in TIP for axis in ("", *(f"_{axis}" for axis in AXES))),
        *(f"tau_{figure}_{joint}" for figure in ("peak", "rms") for joint in range(1, n + 1)),
        "step",
    )


def figure_units(kinds: tuple[JointKind, ...]) -> dict[str, str]:
    """Name of each figure to its unit, for joints of these kinds."""
    units: dict[str, str] = {}
    for name in figure_names(len(kinds)):
        if name.startswith("tau_"):
            units[name] = joint_unit("tau", kinds[int(name.rpartition("_")[2]) - 1])
        else:
            units[name] = "s" if name == "step" else "m"
    return units


def figures_of(trace: Trace, rigid_tip: Array) -> tuple[float, ...]:
    """The figures of a run, in the order of `figure_names`.

    Of the tip's error, over all samples: root mean square, maximum and value at the end, of its length and along x, y
    and z of the base (maximum: of the magnitude; end: signed) [m]. Of each motor's reported torque: largest magnitude
    and root mean square [N m or N]. The step of the integration [s].

    Args:
        trace: The run.
        rigid_tip: Where the tip would be without any effect, the motion imposed, shape (m, 3) [m].
    """
    error = trace.tip - rigid_tip
    length = np.linalg.norm(error, axis=1)
    tau = trace.joints["tau"]
    figures = [
        _rms(length[:, None]),
        _rms(error),
        np.max(length, keepdims=True),
        np.max(np.abs(error), axis=0),
        length[-1:],
        error[-1],
        np.max(np.abs(tau), axis=0),
        _rms(tau),
        np.array([trace.facts["step"]]),
    ]
    return tuple(np.concatenate(figures).tolist())


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=0))
