"""Mean squares of channels over blocks of time: gaps, and how they scatter when blocks are drawn anew."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..recording import Run
from .noise import Noise

Vector = NDArray[np.float64]

# long beside what an arm's gap remembers, short enough for many in a run [s]
BLOCK = 0.5
# resamples of a bootstrap
DRAWS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """Sums over the samples of some channels, a signal each; shapes (..., n), leading axes are draws.

    Attributes:
        squares: Of the squares of measured minus simulated.
        noises: Of the squared noise of the same samples.
        counts: Samples; 0 where there is no such channel.
    """

    squares: Mapping[str, Vector]
    noises: Mapping[str, Vector]
    counts: Mapping[str, Vector]

    @property
    def signals(self) -> tuple[str, ...]:
        """Names, sorted."""
        return tuple(sorted(self.squares))

    def rms(self, signal: str) -> float:
        """Root of the mean square over all channels of a signal [its unit]."""
        return float(np.sqrt(np.sum(self.squares[signal]) / max(1.0, float(np.sum(self.counts[signal])))))

    def noise(self, signal: str) -> float:
        """The same of its noise."""
        return float(np.sqrt(np.sum(self.noises[signal]) / max(1.0, float(np.sum(self.counts[signal])))))

    def relative(self, signal: str) -> Vector:
        """Mean square of each channel in units of its noise, shape (..., n); 0 where there is no channel."""
        noises = self.noises[signal]
        return np.divide(self.squares[signal], noises, out=np.zeros_like(noises), where=noises > 0.0)

    def above(self, signal: str) -> Vector:
        """Energy above noise of each channel in units of noise, shape (..., n)."""
        return np.maximum(self.relative(signal) - 1.0, 0.0) * self.counts[signal]

    def energy(self, signal: str) -> Vector:
        """Squared gap of a signal: mean over its channels of rms^2 / noise^2 - 1, not below 0, shape (...)."""
        there = self.counts[signal] > 0.0
        excess = np.where(there, np.maximum(self.relative(signal) - 1.0, 0.0), 0.0)
        return np.sum(excess, axis=-1) / np.maximum(np.sum(there, axis=-1), 1)

    def gap(self, signal: str | None = None) -> Vector:
        """Gap in units of noise, of a signal or over all of them, shape (...)."""
        names = self.signals if signal is None else (signal,)
        if not names:
            return np.zeros(())
        return np.sqrt(np.mean([self.energy(name) for name in names], axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Sums over each of b blocks of time of some runs, shapes (b, n)."""

    each: Sums

    @staticmethod
    def of(residuals: Sequence[Mapping[str, Vector]], noises: Sequence[Noise], runs: Sequence[Run]) -> Blocks:
        """Blocks of measured minus simulated, signal -> (m, n) or (m, 3), of some runs."""
        widths = {name: values.shape[1] for one in residuals for name, values in one.items()}
        kept: tuple[dict[str, list[Vector]], ...] = ({}, {}, {})
        for one, noise, run in zip(residuals, noises, runs, strict=True):
            sigma, t = noise.sigma, run.t[run.judged]
            number = max(1, int((t[-1] - run.since) / BLOCK))
            place = np.minimum((t - run.since) / (t[-1] - run.since) * number, number - 1).astype(np.int64)
            for name, width in widths.items():
                sums = np.zeros((3, number, width))
                if name in one:
                    values = one[name][run.judged]
                    good = np.isfinite(values)
                    np.add.at(sums[0], place, np.where(good, np.square(values), 0.0))
                    np.add.at(sums[2], place, good.astype(np.float64))
                    sums[1] = sums[2] * np.square(sigma[name])
                for lists, part in zip(kept, sums, strict=True):
                    lists.setdefault(name, []).append(part)
        return Blocks(Sums(*({name: np.concatenate(parts) for name, parts in lists.items()} for lists in kept)))

    def together(self) -> Sums:
        """All blocks, shapes (n,)."""
        return self._map(lambda values: np.sum(values, axis=0))

    def drawn(self, seed: int = 0) -> Sums:
        """As many blocks drawn with replacement, shapes (DRAWS, n); the same seed draws the same blocks."""
        number = len(next(iter(self.each.counts.values()), np.zeros((1, 0))))
        times = np.random.default_rng(seed).multinomial(number, np.full(number, 1.0 / number), size=DRAWS)
        return self._map(lambda values: times @ values)

    def _map(self, change: Callable[[Vector], Vector]) -> Sums:
        parts = (self.each.squares, self.each.noises, self.each.counts)
        return Sums(*({name: change(values) for name, values in part.items()} for part in parts))
