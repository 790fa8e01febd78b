"""The noise of a channel: what no model could explain."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from .run import Run, Vector

_ORDER = 6


@dataclass(frozen=True, slots=True, eq=False)
class ChannelNoise:
    """Noise of a signal's channels: x_k = sum of ar_j x_(k-j) + innovation, of standard deviation sigma.

    Attributes:
        sigma: Standard deviation, at least the quantisation step / sqrt 12, shape (n,).
        ar: Coefficients of an autoregressive model, 0 where white, shape (n, p).
        step: Quantisation step, 0 where none was found, shape (n,).
        stated: Whether sigma is log.yaml's.
    """

    sigma: Vector
    ar: Vector
    step: Vector
    stated: bool


def noise_of(run: Run, signal: str) -> ChannelNoise:
    """Noise of a signal: stated where log.yaml has it, else estimated from what no model could explain.

    Raises:
        KeyError: The run has no such signal.
    """
    values = run.signals[signal]
    weights = np.array([(-1.0) ** k * comb(_ORDER, k) for k in range(_ORDER + 1)])
    step = np.array([quantisation(column) for column in values.T])
    sigma = np.zeros(values.shape[1])
    for i, column in enumerate(values.T):
        left = np.convolve(column, weights, "valid")
        left = left[np.isfinite(left)]
        if len(left):
            sigma[i] = np.median(np.abs(left)) / 0.6745 / np.sqrt(comb(2 * _ORDER, _ORDER))
    stated = signal in run.noise
    if stated:
        sigma = np.array(run.noise[signal]) * np.ones(values.shape[1] if signal != "ee_rot" else 1)
    count = len(sigma)
    return ChannelNoise(np.maximum(sigma, step[:count] / np.sqrt(12.0)), np.zeros((count, 1)), step[:count], stated)


def quantisation(values: Vector) -> float:
    """Step of a channel (m,) whose values are whole multiples of it; 0 where there is none."""
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) < 3:
        return 0.0
    apart = np.diff(levels)
    step = float(apart[apart > 1e-12 * np.abs(levels).max()].min(initial=np.inf))
    if not np.isfinite(step):
        return 0.0
    whole = np.round(apart / step)
    return float(apart.sum() / whole.sum()) if np.abs(apart / step - whole).max() < 0.05 else 0.0
