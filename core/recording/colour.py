"""Power and colour of noise under a motion: a spectrum from high to low frequency, as far as it is noise.

Clean stretches of a channel are taken apart into orthogonal contrasts: polynomials first, then cosines without what
polynomials have of them, so that a smooth motion stays in the first few. Under an autoregressive model of the noise
every contrast has a variance that is known exactly, its leakage included. The model is fitted to the upper contrasts
and taken further down as long as the next ones agree with it; where the motion begins they do not, and it ends.
Each stretch has a scale of its own in the fit, so that one with an impact in it weighs little.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

LENGTHS = (512, 256, 128, 64)
_POLYNOMIALS = 12
_FREQUENCIES = 512
_HIGHEST_ORDER = 3
# twice the logarithm of a likelihood ratio from which the next contrasts are no noise of the same model
_DISAGREES = 12.0
# times what noise gives, in a quarter of the stretches
_FAR_ABOVE = 4.0
# times what the model gives
_A_LITTLE = 1.25
# of white noise beside slow noise, tried
_WHITE_SHARES = np.array([0.0, 0.03, 0.1, 0.25, 0.5, 0.75])
# parts of what steps would make of noise that crosses many of them
_WHITES = np.array([1.0, 0.5, 0.25, 0.1])
# of the lowest frequency looked at: what turns below half of it cannot be told from what never turns
_LOWEST_CORNER = 0.25
# terms of the autoregression that stands for slow noise beside white
_LONG = 24
# twice the logarithm of a likelihood ratio from which a channel has another colour than those beside it
_OTHER_COLOUR = 6.0
# coefficients of an autoregression that add up to more are slow noise's
_SLOW = 0.2
# how many times the variance of the white noise that is seen one is that is known, from which the rest of it is slow
_UNSEEN = 2.0
# a variance that is known says something where it is so much more than quantisation's
_MORE = 1.05
# sizes of slow noise beside white that are tried, times the level
_SIZES = np.exp(np.linspace(-2.5, 1.0, 15))


@dataclass(frozen=True, slots=True, eq=False)
class Coloured:
    """Noise as an autoregression, the quantisation's share included.

    Attributes:
        variance: Of the whole noise.
        ar: Its coefficients, shape (p,); () where it is white.
    """

    variance: float
    ar: Vector


@dataclass(frozen=True, slots=True, eq=False)
class _Contrasts:
    """Orthonormal contrasts of n samples from smooth to rough, in bands, and how much of each frequency is in them.

    Attributes:
        basis: Shape (n, n), one a column.
        starts: First contrast of each band, shape (b,).
        sizes: Contrasts in each band, shape (b,).
        power: Weight of each frequency in a band's mean variance, shape (b, frequencies).
        variances: Of the bands for innovations of variance 1 at each model of order 1 that is tried, shape (k, b).
    """

    basis: Vector
    starts: NDArray[np.int64]
    sizes: Vector
    power: Vector
    variances: Vector

    def energies(self, stretches: Vector) -> Vector:
        """Mean square of the contrasts in each band of stretches (s, n), shape (s, b)."""
        return np.add.reduceat((stretches @ self.basis) ** 2, self.starts, axis=1) / self.sizes


_ANGLES = np.pi * (np.arange(_FREQUENCIES) + 0.5) / _FREQUENCIES
_SLOPES = np.tanh(np.linspace(-2.0, 3.0, 81))


@cache
def _contrasts(n: int) -> _Contrasts:
    samples = np.arange(n)
    polynomials = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, n), _POLYNOMIALS - 1)
    cosines = np.cos(np.pi * np.outer(samples + 0.5, samples[_POLYNOMIALS:]) / n)
    basis = np.linalg.qr(np.hstack([polynomials, cosines]))[0]
    starts = [0]
    while starts[-1] < n:
        starts.append(starts[-1] + max(1, starts[-1] // 8))
    sizes = np.diff(np.minimum(starts, n))
    power = (np.abs(np.exp(-1j * np.outer(_ANGLES, samples)) @ basis) ** 2 / _FREQUENCIES).T
    power = np.add.reduceat(power, starts[:-1], axis=0) / sizes[:, None]
    variances = np.array([power @ _spectrum(np.array([slope])) for slope in _SLOPES])
    return _Contrasts(basis, np.array(starts[:-1]), sizes.astype(np.float64), power, variances)


@dataclass(frozen=True, slots=True, eq=False)
class _Upper:
    """What of a channel is noise alone.

    Attributes:
        energy: Mean squares of stretches in bands, shape (s, b).
        tools: Contrasts of all bands.
        cut: First of the bands.
        white: Variance that is there at least and is white.
    """

    energy: Vector
    tools: _Contrasts
    cut: int
    white: float

    @property
    def power(self) -> Vector:
        return self.tools.power[self.cut :]

    @property
    def sizes(self) -> Vector:
        return self.tools.sizes[self.cut :]

    @property
    def level(self) -> float:
        """Mean square of a stretch in the middle."""
        return float(np.median(_mean(self.energy, self.sizes)))

    @property
    def highest(self) -> float:
        """The slowest reflection that can be told from noise that never turns."""
        return 1.0 - _LOWEST_CORNER * np.pi * float(self.tools.starts[self.cut]) / self.tools.basis.shape[0]


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """A channel's clean stretches as they are heard by themselves.

    Attributes:
        upper: What of it is noise alone; None where too few stretches moved.
        alone: Its noise, by the order that pays for itself.
        curve: -2 log likelihood of every slope that is tried, shape (k,); None where no model of order 1 may do.
    """

    upper: _Upper | None
    alone: Coloured
    curve: Vector | None


def heard(channels: Sequence[tuple[Vector, float]]) -> list[Heard]:
    """Channels by themselves.

    Args:
        channels: Of each its stretches, shape (s, n), n one of `LENGTHS`, and the variance that is there at least and
            is white (quantisation).
    """
    out: list[Heard] = []
    for stretches, white in channels:
        upper = _upper(stretches, white)
        alone = Coloured(white, np.zeros(0)) if upper is None else _best_order(upper)
        # a longer memory than one sample is a sensor of its own kind
        ordinary = upper is not None and len(alone.ar) in (0, 1, _LONG)
        out.append(Heard(upper, alone, _curve(upper) if upper is not None and ordinary else None))
    return out


def coloured(channels: Sequence[Heard], variances: Sequence[float], beside: Sequence[Heard] = ()) -> list[Coloured]:
    """Noise under clean stretches of channels that have sensors of one make.

    A slow colour is known badly from one channel, and what is compared lies where it is drawn on to: channels share
    one, but for those that disagree with it. Where the whole variance is known, what is seen at high frequencies is
    enough to tell how slow the rest of it is.

    Args:
        channels: Those that are asked about.
        variances: Their whole variance, nan where it isn't known.
        beside: The same channels in other runs.
    """
    alone = [one.alone for one in channels]
    every = dict(enumerate([*channels, *beside]))
    fit = {k: one.upper for k, one in every.items() if one.upper is not None and one.curve is not None}
    curves = {k: one.curve for k, one in every.items() if one.curve is not None}
    slope = _shared(curves)
    if len(curves) > 1:
        slope = min(slope, max((fit[k].highest for k in curves if k < len(channels)), default=1.0))
        for k in (k for k in curves if k < len(channels)):
            alone[k] = _of_slope(fit[k], slope)
    # what a size can tell is how slow noise is, white noise it would only make a little slow; and of a longer memory
    # whether one sample's does as well
    unseen = {k for k, size in enumerate(variances) if size > _UNSEEN * alone[k].variance}
    slow = (k for k in range(len(channels)) if k in unseen or abs(alone[k].ar.sum()) > _SLOW)
    there = {k: upper for k in slow if (upper := channels[k].upper) is not None}
    known = {k: variances[k] for k, one in there.items() if variances[k] > _MORE * one.white}
    curves = {k: _curve_of_known(there[k], variance, alone[k]) for k, variance in known.items()}
    curves = {k: curve for k, curve in curves.items() if curve.min() < _DISAGREES}
    for k, curve in curves.items():
        alone[k] = _of_known(there[k], known[k], _lowest_between(curve, int(np.argmin(curve))))
    # of what high frequencies show next to nothing of, other channels know how slow it is
    untold = sorted((unseen & known.keys()) - curves.keys()) if curves else []
    slope = _shared(curves)
    for k in (*curves, *untold):
        alone[k] = _of_known(there[k], known[k], slope)
    return alone


def _shared(curves: dict[int, Vector]) -> float:
    """The slope at the lowest point of curves together; those that object to it are taken out of them."""
    while curves:
        whole = np.sum(list(curves.values()), axis=0)
        best = int(np.argmin(whole))
        objects = {k: float(curve[best] - curve.min()) for k, curve in curves.items()}
        worst = max(objects, key=lambda k: objects[k])
        if len(curves) == 1 or objects[worst] <= _OTHER_COLOUR:
            return _lowest_between(whole, best)
        del curves[worst]
    return 0.0


def _upper(stretches: Vector, white: float) -> _Upper | None:
    """The bands of a channel's stretches that are noise; None where too few of them moved at all."""
    n = stretches.shape[1]
    tools = _contrasts(n)
    energy = tools.energies(stretches)
    rough = tools.starts >= n // 4
    # a sensor that did not move in a stretch says nothing of its noise
    energy = energy[_mean(energy[:, rough], tools.sizes[rough]) > max(0.02 * white, 1.0e-280)]
    if len(energy) < 3:
        return None
    cut = _lowest_noise(energy, tools, white)
    return _Upper(energy[:, cut:], tools, cut, white)


def _models(one: _Upper, shape: Vector) -> Vector:
    """Variances of the bands under a model of a shape (b,), in the sizes that are tried beside white, shape (k, b)."""
    shape = shape * one.level / float(_mean(shape, one.sizes))
    return shape[None] if one.white == 0.0 else _SIZES[:, None] * shape + one.white


def _curve(one: _Upper) -> Vector:
    """-2 log likelihood of every slope that is tried, shape (k,)."""
    shapes = one.tools.variances[:, one.cut :]
    return np.array([_cost(one.energy, _models(one, shape), one.sizes).min() for shape in shapes])


def _curve_of_known(one: _Upper, variance: float, free: Coloured) -> Vector:
    """-2 log likelihood of every slope under a variance that is known, less that of a model free of it, shape (k,)."""
    seen = _seen(one)
    shapes = one.tools.variances[:, one.cut :]
    costs = [_of_whites(one, seen, variance, slope, shape)[0] for slope, shape in zip(_SLOPES, shapes, strict=True)]
    return np.array(costs) - _cost_of(one, seen, _bands_of(one, free))


def _seen(one: _Upper) -> Vector:
    """Variances of the bands in most stretches, shape (b,)."""
    return np.array([_middle(energy, size) for energy, size in zip(one.energy.T, one.sizes, strict=True)])


def _cost_of(one: _Upper, seen: Vector, model: Vector) -> float:
    """-2 log likelihood of what is seen of the bands under their variances (b,)."""
    return len(one.energy) * float((np.log(model) + seen / model) @ one.sizes)


def _of_whites(one: _Upper, seen: Vector, variance: float, slope: float, shape: Vector) -> tuple[float, float]:
    """-2 log likelihood of a slope whose noise's whole variance is known, and how much of that is white.

    Steps as coarse as slow noise are rarely crossed: what they make is as slow as it is, and hardly white.
    """
    size = float(_spectrum(np.array([slope])).mean())
    tried = ((_cost_of(one, seen, (variance - w) / size * shape + w), w) for w in (_WHITES * one.white).tolist())
    return min(tried)


def _bands_of(one: _Upper, noise: Coloured) -> Vector:
    """Variances of the bands under noise that is known, shape (b,)."""
    spectrum = _spectrum(noise.ar)
    return noise.variance / float(spectrum.mean()) * (one.power @ spectrum)


def _of_known(one: _Upper, variance: float, slope: float) -> Coloured:
    """Noise of order 1 with a slope and a whole variance that are known."""
    ar = np.array([slope])
    spectrum = _spectrum(ar)
    white = _of_whites(one, _seen(one), variance, slope, one.power @ spectrum)[1]
    return _whole(ar, (variance - white) / float(spectrum.mean()), white)


def _lowest_between(curve: Vector, best: int) -> float:
    """The slope at the lowest point of a parabola through a curve's lowest value and its neighbours."""
    at = np.arctanh(_SLOPES)
    if not 0 < best < len(curve) - 1:
        return float(_SLOPES[best])
    before, here, after = curve[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    aside = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(np.tanh(at[best] + aside * (at[1] - at[0])))


def _of_slope(one: _Upper, slope: float) -> Coloured:
    """Noise of order 1 with a slope that is known."""
    shape = one.power @ _spectrum(np.array([slope]))
    models = _models(one, shape)
    variances = models[int(np.argmin(_cost(one.energy, models, one.sizes)))]
    size = float(_mean(variances - one.white, one.sizes) / _mean(shape, one.sizes))
    scale = _middle(_mean(one.energy / variances, one.sizes), float(one.sizes.sum()))
    return _whole(np.array([slope]), scale * size, scale * one.white)


def _spectrum(ar: Vector) -> Vector:
    """Power density of an autoregression with innovations of variance 1, shape (frequencies,)."""
    lags = np.arange(1, len(ar) + 1)
    return 1.0 / np.abs(1.0 - np.exp(-1j * np.outer(_ANGLES, lags)) @ ar) ** 2


def _mean(bands: Vector, sizes: Vector) -> Vector:
    """Mean over contrasts of what is given by band, shape (...,)."""
    return bands @ sizes / sizes.sum()


def _cost(energy: Vector, variances: Vector, sizes: Vector) -> Vector:
    """-2 log likelihood of bands (s, b) under variances (k, b), a scale a stretch left free, shape (k,)."""
    scales = energy @ (sizes / variances).T / sizes.sum()
    return sizes.sum() * np.log(np.maximum(scales, 1.0e-9)).sum(axis=0) + len(energy) * np.log(variances) @ sizes


def _candidates(energy: Vector, tools: _Contrasts, cut: int, white: float) -> Vector:
    """Variances of all bands under every model of order 1 that is tried, shape (k, b)."""
    shapes, sizes = tools.variances, tools.sizes[cut:]
    level = float(np.median(_mean(energy[:, cut:], sizes)))
    shapes = shapes * (level / _mean(shapes[:, cut:], sizes))[:, None]
    # slow noise beside white: what quantisation gives at least, or more of it
    shares = _WHITE_SHARES if white < 0.03 * level else np.maximum(_WHITE_SHARES, min(white / level, 0.98))
    return np.concatenate([(1.0 - share) * shapes + share * level for share in np.unique(shares)])


def _lowest_noise(energy: Vector, tools: _Contrasts, white: float) -> int:
    """The first band that noise alone explains."""
    sizes = tools.sizes
    firsts: list[int] = tools.starts.tolist()
    cuts = [bisect_left(firsts, tools.basis.shape[0] // 4)]
    while cuts[-1] > 3:
        # one band after the other, where they are narrow a few at a time
        cuts.append(max(3, min(cuts[-1] - 2, bisect_left(firsts, 0.75 * firsts[cuts[-1]]))))
    good, before = 0, _best(energy, tools, cuts[0], white)
    for number in range(1, len(cuts)):
        low, high = cuts[number], cuts[number - 1]
        now = _best(energy, tools, low, white)
        models = [now]
        for model in (now, before):
            scales = _mean(energy[:, high:] / model[high:], sizes[high:])
            ratios = _mean(energy[:, low:high] / model[low:high], sizes[low:high]) / scales
            count = float(sizes[low:high].sum())
            more = _middle(ratios, count)
            lifted = model.copy()
            # a little more is the model's own form, not the motion
            lifted[low:high] *= more if more > _A_LITTLE else 1.0
            models.append(lifted)
            # a quarter of the stretches with traces of the motion is too many
            upper = float(np.quantile(ratios, 0.75)) / _quantile(count, 0.6745)
        costs = _cost(energy[:, low:], np.array(models)[:, low:], sizes[low:])
        if upper > _FAR_ABOVE or float(costs[0] - costs.min()) > _DISAGREES:
            break
        good, before = number, now
    # the first traces of the motion stay below what the test sees
    return cuts[max(0, good - 1)] if good < len(cuts) - 1 else cuts[good]


def _best(energy: Vector, tools: _Contrasts, cut: int, white: float) -> Vector:
    """Variances of all bands (b,) under the model of order 1 that fits those from a cut on best."""
    models = _candidates(energy, tools, cut, white)
    return models[int(np.argmin(_cost(energy[:, cut:], models[:, cut:], tools.sizes[cut:])))]


def _quantile(k: float, normal: float) -> float:
    """Quantile of the mean of k squares of unit normals, by Wilson and Hilferty (1931)."""
    return (1.0 - 2.0 / (9.0 * k) + normal * math.sqrt(2.0 / (9.0 * k))) ** 3


def _middle(ratio: Vector, k: float) -> float:
    """Scale of means of k squares, shape (s,), that a minority of the stretches cannot move."""
    return float(np.median(ratio)) / _quantile(k, 0.0)


def _best_order(one: _Upper) -> Coloured:
    """The model that pays for its order, by the Bayesian information criterion."""
    energy, white, power, sizes, level, highest = one.energy, one.white, one.power, one.sizes, one.level, one.highest
    # SciPy's annotations leave its own types open
    minimize: Any = import_module("scipy.optimize").minimize

    price = math.log(len(energy) * sizes.sum())

    def model(parameters: Vector) -> tuple[Vector, Vector, float]:
        ar = _from_reflections(highest * np.tanh(parameters[1:]))
        shape = power @ _spectrum(ar)
        size = level * math.exp(float(parameters[0])) / float(_mean(shape, sizes))
        return size * shape + white, ar, size

    def cost(parameters: Vector) -> float:
        return float(_cost(energy, model(parameters)[0][None], sizes)[0])

    def without_size(parameters: Vector) -> float:
        return cost(np.concatenate([[0.0], parameters]))

    best: tuple[float, float, float, Vector] | None = None
    start = np.zeros(1)
    for order in range(_HIGHEST_ORDER + 1):
        if order == 1:
            tries = [np.append(start, slope) for slope in (0.1, 1.2)]
        else:
            tries = [np.append(start, 0.0)] if order else [np.array([-0.1])]
        if white == 0.0:
            # every stretch has a scale of its own: the size of the whole says nothing more
            found = [_lowest(minimize, without_size, x[1:]) for x in tries] if order else [(cost(start), start[1:])]
            value, shape = min(found, key=lambda one: one[0])
            start = np.append(0.0, shape)
        else:
            value, start = min((_lowest(minimize, cost, x) for x in tries), key=lambda one: one[0])
        value += price * order
        if best is None or value < best[0] - 2.0:
            variances, ar, size = model(start)
            scale = _middle(_mean(energy / variances, sizes), float(sizes.sum()))
            best = (value, scale * size, scale * white, ar)
        elif order > 1:
            break
    assert best is not None
    return _whole(best[3], best[1], best[2])


def _lowest(minimize: Any, cost: Callable[[Vector], float], start: Vector) -> tuple[float, Vector]:
    answer = minimize(cost, start, method="Nelder-Mead", options={"xatol": 5e-3, "fatol": 0.05, "maxiter": 120})
    return float(answer.fun), np.asarray(answer.x)


def _from_reflections(reflections: Vector) -> Vector:
    """Coefficients of the stable autoregression with these reflection coefficients (Durbin, Levinson)."""
    ar = np.zeros(0)
    for reflection in reflections:
        ar = np.concatenate([ar - reflection * ar[::-1], [reflection]])
    return ar


def _whole(ar: Vector, innovation: float, white: float) -> Coloured:
    """An autoregression and white noise beside it, as one autoregression."""
    spectrum = innovation * _spectrum(ar) + white
    lags = np.arange(_LONG + 1)
    covariance = (np.cos(np.outer(lags, _ANGLES)) @ spectrum) / _FREQUENCIES
    if len(ar) == 0 or white == 0.0:
        return Coloured(float(covariance[0]), ar)
    # what is slow beside white has a long memory; with a few terms its lowest frequencies would be lost
    toeplitz = covariance[np.abs(np.subtract.outer(lags[:-1], lags[:-1]))]
    whole = np.linalg.solve(toeplitz, covariance[1:]).astype(np.float64)
    return Coloured(float(covariance[0]), whole)
