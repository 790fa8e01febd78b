"""Noise of a run's sensors as it stands in what is compared: without what a loop makes of it, and never none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording import ChannelNoise, Run, noise_of
from .feedback import sensors_alone, told

Vector = NDArray[np.float64]

# noise that is there at least, as part of a signal [rad of orientations]: commands are interpolated between rows, which
# accelerations and so torques feel; and of the busiest channel's signal, what an idle one counts with
QUIETEST, QUIETEST_TORQUE, IDLE = 1.0e-6, 1.0e-4, 1.0e-3


@lru_cache(maxsize=256)
def noise_in(run: Run, signal: str) -> ChannelNoise:
    """`noise_of` a sensor, once a run and signal; at least what numbers that a simulation wrote are good for.

    Where the record shows a controller that hears its sensors, torques count without what it makes of them, and motions
    have the colour of the run that it shakes least.
    """
    torque = signal.startswith("tau")
    noise = noise_of(sensors_alone(run) if torque else run, signal)
    if not torque and told(run) is not None:
        noise = _quickest(noise, [noise_of(other, signal) for other in run.beside if other.has(signal)])
    if signal == "ee_rot":
        return replace(noise, sigma=np.maximum(noise.sigma, QUIETEST))
    values = run.signals[signal]
    size = np.sqrt(np.nansum(np.square(values), axis=0) / np.maximum(np.isfinite(values).sum(axis=0), 1))
    part = QUIETEST_TORQUE if torque else QUIETEST
    return replace(noise, sigma=np.maximum(noise.sigma, part * np.maximum(size, IDLE * size.max(initial=0.0))))


def _quickest(noise: ChannelNoise, beside: Sequence[ChannelNoise]) -> ChannelNoise:
    """Noise with the colour that is least slow in any run: what its loop shakes is slower than its sensor."""
    orders = max(one.ar.shape[1] for one in (noise, *beside))
    all_ar = np.array([np.pad(one.ar, ((0, 0), (0, orders - one.ar.shape[1]))) for one in (noise, *beside)])
    least = np.argmin([[next_alike(ar) for ar in one] for one in all_ar], axis=0)
    return replace(noise, ar=all_ar[least, np.arange(len(least))])


def in_band(run: Run, signal: str, band: float, order: int) -> Vector:
    """Variance of the noise of a signal's derivative of an order below a frequency [Hz], shape (n,)."""
    noise = noise_in(run, signal)
    f = np.linspace(0.0, min(band, 0.5 * run.rate), 200)
    turn = 2.0 * np.pi * f
    found: list[float] = []
    for sigma, ar in zip(noise.sigma, noise.ar, strict=True):
        lags = np.arange(1, len(ar) + 1)
        gain = 1.0 / np.abs(1.0 - np.exp(-1j * np.outer(turn / run.rate, lags)) @ ar) ** 2
        density = 2.0 / run.rate * sigma**2 / float(np.sum(np.square(response_of(ar)))) * gain
        found.append(float(np.trapezoid(density * turn ** (2 * order), f)))
    return np.array(found)


def next_alike(ar: Vector) -> float:
    """Correlation of an autoregressive process with itself a sample later."""
    response = response_of(ar)
    return float(response[1:] @ response[:-1] / (response @ response))


def response_of(ar: Vector) -> Vector:
    """What becomes of one innovation of an autoregressive process."""
    signal: Any = import_module("scipy.signal")

    impulse = np.zeros(4000)
    impulse[0] = 1.0
    return np.asarray(signal.lfilter([1.0], np.concatenate([[1.0], -ar]), impulse))
